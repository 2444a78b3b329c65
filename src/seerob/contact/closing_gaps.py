r"""Which gaps clamp somebody, asked of the shapes only where the answer can depend on it.

The rule is that of `seerob.contact.clamping.clamps`. A gap changes by no more than its two sides move, so
most gaps need not be measured to know that they clamp nobody:

- of a body part that nothing moving could hit it does not matter whether it would be clamped;
- parts of a robot that stand still against each other clamp nobody between them;
- a gap above :math:`D + \delta`, with :math:`\delta` how far its sides have moved since the instant
  before, clamps nobody of the thickness D: it is measured no farther than that;
- whether the robot's own parts were once as far apart as D is settled when they were, and cannot
  change before they have moved by what is lacking.

What is skipped is proven to be of no effect: the flags are those of the rule, as if every gap had been
measured at every instant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seerob.contact.clamping import AHEAD, STILL, Flags, PinchPairs, clamps
from seerob.distances.least import Reach, Survey
from seerob.kernels.approach import relative_speeds
from seerob.kernels.displacement import displacements
from seerob.kernels.pairs import CORNERS
from seerob.kernels.shapes import Shapes
from seerob.kernels.speed import stacked
from seerob.transforms import Array

ROUNDING = 1e-9
"""What bounds give away against rounding [m]."""


@dataclass(eq=False)
class _Instant:
    """What is known of the gaps at an instant."""

    t: float
    rotations: Array
    positions: Array
    gaps: Array
    """[m], not above the cap; NaN where not measured, shape (g,)."""
    moved: Array
    """How far the sides of each gap have moved since the instant before [m], shape (g,)."""
    upper: Array
    """Upper bound of each gap [m], shape (g,)."""
    had_room: Flags
    """Whether each gap counts for each body part; see `clamps`, shape (g, r)."""
    lacking: Array
    """How wide each must yet have been to count for one more of them [m], NaN where for all, shape (g,)."""

    def at(self, rotations: Array, positions: Array) -> bool:
        """Whether it is of these poses."""
        same = np.array_equal(self.positions, positions, equal_nan=True)
        return same and np.array_equal(self.rotations, rotations, equal_nan=True)


class ClosingGaps:
    """The gaps of a robot as run time passes.

    Asked again for the last instant it says the same; asked for an earlier one (a replay was set back), it
    forgets.
    """

    def __init__(self, shapes: Shapes, pairs: PinchPairs, thickness: Array, *, cap: float) -> None:
        """Bind.

        Args:
            shapes: Of the model.
            pairs: Its gaps.
            thickness: Of body parts [m], shape (r,).
            cap: Largest gap that matters [m], above every thickness; that of the queries of ``pairs``.
        """
        self._pairs, self._thickness, self._cap = pairs, thickness, cap
        self._survey = Survey(shapes, pairs.queries) if pairs.queries else None
        self._hulls = stacked([_corners(shapes, body) for body in range(len(shapes.names))])
        others = sorted({i for query, _ in pairs.queries for i in query.a if shapes.solids[i]})
        moving = np.array(pairs.moving, np.int64)
        first = moving[pairs.first] if len(pairs.first) else pairs.first
        # The far side of a gap to surfaces is any of them; of one between own parts it is the other.
        across = np.full(len(first), -1, np.int64)
        end = int(pairs.opened.sum())
        for query, _ in pairs.queries[1:] if end else pairs.queries:
            across[end : end + len(query.a)] = query.a
            end += len(query.a)
        in_world = np.array([[-1, i] for i in others], np.int64).reshape(-1, 2)
        self._seen = np.ascontiguousarray(np.concatenate([np.column_stack([across, first]), in_world]))
        self._own = np.ascontiguousarray(np.column_stack([across, first])[~pairs.opened])
        self._last: _Instant | None = None

    def clamped(
        self, t: float, rotations: Array, positions: Array, twists: tuple[Array, Array], wanted: Flags
    ) -> Flags:
        """Which moving bodies clamp which body parts now.

        Args:
            t: Instant [s].
            rotations: world_from_body of every body, shape (n, 3, 3).
            positions: Likewise [m], shape (n, 3).
            twists: Velocities of their origins [m/s] and angular ones [rad/s], world axes, shape (n, 3) each.
            wanted: Of which bodies, that move now, and which body parts that matters, shape (b, r).

        Returns:
            Shape (b, r); False where it does not matter.
        """
        if self._survey is None:
            return np.zeros_like(wanted)
        last = self._last
        if last is not None and t < last.t:
            last = None
        if last is None or t > last.t or not last.at(rotations, positions):
            last = self._last = self._begun(t, rotations, positions, last)
        pairs = self._pairs
        # A row of False at the end is what -1 means.
        rows = np.concatenate([wanted, np.zeros((1, wanted.shape[1]), bool)])
        of_gaps = (rows[pairs.first] | rows[pairs.second]) & last.had_room
        if not of_gaps.any():
            return np.zeros_like(wanted)
        speed = np.full(len(pairs.first), np.inf)
        own = np.empty(len(self._own))
        relative_speeds(rotations, positions, *twists, self._own, *self._hulls, own)
        speed[~pairs.opened] = own
        of_gaps &= (speed > STILL)[:, None]
        found = np.zeros(of_gaps.shape, bool)
        some = self._narrow(last, of_gaps)
        if len(some):
            # Whether there was room is known already.
            room = np.ones(len(some), bool)
            gaps, moved = last.gaps[None, some], last.moved[None, some]
            found[some] = clamps(gaps, moved, speed[None, some], self._thickness, opened=room)[0]
        return np.asarray(pairs.per_body(found & of_gaps) & wanted)

    def _begun(self, t: float, rotations: Array, positions: Array, before: _Instant | None) -> _Instant:
        """What is known of an instant before anything is asked of it but whether own parts had room."""
        g = len(self._pairs.first)
        unknown, endless = np.full(g, np.nan), np.full(g, np.inf)
        if before is None:
            had_room = np.repeat(self._pairs.opened[:, None], len(self._thickness), axis=1)
            lacking = self._lacking(had_room)
            now = _Instant(
                t, rotations.copy(), positions.copy(), unknown, np.zeros(g), endless, had_room, lacking
            )
        else:
            moved = np.empty(len(self._seen))
            displacements(
                before.rotations, before.positions, rotations, positions, self._seen, *self._hulls, moved
            )
            others = moved[g:].max(initial=0.0)
            moved = moved[:g] + (others * self._pairs.opened + ROUNDING)
            now = _Instant(
                t, rotations.copy(), positions.copy(), unknown, moved, before.upper + moved,
                before.had_room, before.lacking,
            )  # fmt: skip
        asked = now.upper >= now.lacking
        if asked.any():
            self._measure(now, np.where(asked, self._cap, -np.inf))
            # Of a body inside another the surfaces are as near as it is deep.
            now.upper = np.where(asked, np.abs(now.gaps), now.upper)
            now.had_room = now.had_room | (asked[:, None] & (now.gaps[:, None] >= self._thickness))
            now.lacking = self._lacking(now.had_room)
        return now

    def _lacking(self, had_room: Flags) -> Array:
        """How wide each gap must yet have been to count for one more body part [m], NaN: for all."""
        least = np.where(had_room, np.inf, self._thickness).min(axis=1, initial=np.inf)
        return np.where(np.isfinite(least), least, np.nan)

    def _narrow(self, now: _Instant, wanted: Flags) -> NDArray[np.int64]:
        """Gaps that may clamp a body part that matters, measured."""
        widest = np.where(wanted, self._thickness, -np.inf).max(axis=1)
        reach = np.minimum(widest + np.minimum(now.moved, AHEAD) + ROUNDING, self._cap)
        lacking = np.isnan(now.gaps) & (widest > -np.inf)
        if lacking.any():
            self._measure(now, np.where(lacking, reach, -np.inf))
        return np.flatnonzero(now.gaps <= reach)

    def _measure(self, instant: _Instant, caps: Array) -> None:
        """Measure gaps up to caps; those beyond stay unknown, unless it is the cap."""
        assert self._survey is not None
        found = self._survey.within(instant.rotations, instant.positions, caps)
        known = (found.reach != Reach.BEYOND_CAP) | (caps >= self._cap)
        instant.gaps = np.where(known, found.distance, instant.gaps)


def _corners(shapes: Shapes, body: int) -> Array:
    """Points whose hull contains the cores of a body's solids, in the body's frame [m], shape (k, 3)."""
    found = [np.zeros((0, 3))]
    for i in shapes.solids[body]:
        rotation, position = shapes.local[i, :9].reshape(3, 3), shapes.local[i, 9:]
        count = int(shapes.which[i, CORNERS])
        found.append(shapes.corners[i, :count] @ rotation.T + position)
    return np.concatenate(found)
