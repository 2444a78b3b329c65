"""Which gaps clamp somebody, asked of the shapes only where the answer can depend on it.

The rule is that of `seerob.criteria.contact.clamping.clamps`. Most gaps need not be measured to know that
they clamp nobody: of a body part that nothing moving could hit it does not matter whether it would be
clamped; parts of a robot that stand still against each other clamp nobody between them; and none is measured
farther than the thickest body part that matters. The answer is a function of what is given alone.
"""

from __future__ import annotations

import numpy as np

from seerob.core.transforms import Array
from seerob.criteria.contact.clamping import AHEAD, STILL, Flags, PinchPairs, clamps
from seerob.distance.least import Reach, Survey
from seerob.kernels.approach import relative_speeds
from seerob.kernels.pairs import CORNERS
from seerob.kernels.shapes import Shapes
from seerob.kernels.speed import stacked
from seerob.model.model import Model
from seerob.twin.spans import Relative, Span

ROUNDING = 1e-9
"""What bounds give away against rounding [m]."""


class ClosingGaps:
    """The gaps of a robot, bound once."""

    def __init__(self, shapes: Shapes, pairs: PinchPairs, thickness: Array, *, period: float) -> None:
        """Bind.

        Args:
            shapes: Of the model.
            pairs: Its gaps.
            thickness: Of the body parts that each can clamp [m], shape (g, r).
            period: Of the ticks at which they are asked for [s].
        """
        self._pairs, self._thickness, self._period = pairs, thickness, period
        self._shapes = shapes
        self._survey = Survey(shapes, pairs.queries) if pairs.queries else None
        self._hulls = stacked([_corners(shapes, body) for body in range(len(shapes.names))])
        moving = np.array(pairs.moving, np.int64)
        first = moving[pairs.first] if len(pairs.first) else pairs.first
        self._seen = pairs.across >= 0
        self._pair = np.ascontiguousarray(np.column_stack([pairs.across, first])[self._seen])

    def clamped(
        self,
        rotations: Array,
        positions: Array,
        twists: tuple[Array, Array],
        speeds: Array,
        wanted: Flags,
    ) -> tuple[Flags, Array]:
        """Which moving bodies clamp which body parts now.

        Args:
            rotations: world_from_body of every body, shape (n, 3, 3).
            positions: Likewise [m], shape (n, 3).
            twists: Velocities of their origins [m/s] and angular ones [rad/s], world axes, shape (n, 3) each.
            speeds: Of the fastest point of each moving body [m/s], shape (b,).
            wanted: Of which bodies, that move now, and which body parts that matters, shape (b, r).

        Returns:
            Shape (b, r); False where it does not matter. And how fast each does so, seen from a side that
            moves too [m/s], 0 where none does, shape (b, r).
        """
        speed = self._speeds(rotations, positions, twists, speeds)
        return self._within(rotations, positions, speed, np.zeros(len(speed)), wanted)

    def relative(self, model: Model) -> Relative:
        """How the sides of gaps that move can move against each other, for `ever`."""
        pairs, every = self._pair.tolist(), model.bodies
        hulls = [_corners(self._shapes, j) for _, j in pairs]
        return Relative(model.mj, [(every[i].mj, every[j].mj) for i, j in pairs], hulls)

    def ever(
        self,
        rotations: Array,
        positions: Array,
        twists: tuple[Array, Array],
        span: Span,
        relative: Relative,
        wanted: Flags,
    ) -> tuple[Flags, Array]:
        """Which moving bodies clamp which body parts at any instant of a span, given one end of it."""
        bodies, first = np.array(self._pairs.moving, np.int64), self._pairs.first
        speed = self._speeds(rotations, positions, twists, span.fast[bodies] + span.noise[bodies])
        speed[self._seen] += relative.quick(span) * span.T + span.noise[self._pair].sum(axis=1)
        ways = span.fast[bodies][first] * span.T
        ways[self._seen] += span.fast[self._pairs.across[self._seen]] * span.T
        return self._within(rotations, positions, speed, ways, wanted)

    def _speeds(
        self, rotations: Array, positions: Array, twists: tuple[Array, Array], speeds: Array
    ) -> Array:
        """Of one side of each gap seen from the other [m/s], shape (g,)."""
        speed = np.array(np.asarray(speeds)[self._pairs.first], float)
        seen = np.empty(len(self._pair))
        relative_speeds(rotations, positions, *twists, self._pair, *self._hulls, seen)
        speed[self._seen] = seen
        return speed

    def _within(
        self, rotations: Array, positions: Array, speed: Array, ways: Array, wanted: Flags
    ) -> tuple[Flags, Array]:
        """Find clamped parts as `clamped` does, of gaps narrower by some ways [m], shape (g,)."""
        pairs = self._pairs
        nothing = np.zeros_like(wanted), np.zeros(wanted.shape)
        if self._survey is None or not wanted.any():
            return nothing
        # A row of False at the end is what -1 means.
        rows = np.concatenate([wanted, np.zeros((1, wanted.shape[1]), bool)])
        of_gaps = (rows[pairs.first] | rows[pairs.second]) & (speed > STILL)[:, None]
        widest = np.where(of_gaps, self._thickness, -np.inf).max(axis=1)
        caps = widest + np.minimum(speed * self._period, AHEAD) + ways + ROUNDING
        if not (caps > -np.inf).any():
            return nothing
        found = self._survey.within(rotations, positions, caps)
        known = (caps > -np.inf) & (found.reach != Reach.BEYOND_CAP)
        gaps = np.where(known, found.distance - ways, np.inf)
        flags = clamps(gaps, speed, self._period, self._thickness) & of_gaps
        return np.asarray(pairs.per_body(flags) & wanted), pairs.fastest(flags, speed) * wanted


def _corners(shapes: Shapes, body: int) -> Array:
    """Points whose hull contains the cores of a body's solids, in the body's frame [m], shape (k, 3)."""
    found = [np.zeros((0, 3))]
    for i in shapes.solids[body]:
        rotation, position = shapes.local[i, :9].reshape(3, 3), shapes.local[i, 9:]
        count = int(shapes.which[i, CORNERS])
        found.append(shapes.corners[i, :count] @ rotation.T + position)
    return np.concatenate(found)
