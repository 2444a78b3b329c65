"""Which body regions each moving body of a robot clamps: against surfaces, itself and the floor.

People stand on z = 0 by definition, whether or not a part of the workstation is drawn there: unless told
otherwise it is a surface like any other, endless and horizontal. A body that moves clamps against it where
its lowest point is no higher than the body part is thick; see `seerob.criteria.contact.clamping`.

Shapes are asked about a gap only where the answer can depend on it. The rule is
that of `seerob.criteria.contact.clamping.clamps`. Most gaps need not be measured to know that
they clamp nobody: of a body part that nothing moving could hit it does not matter whether it would be
clamped; parts of a robot that stand still against each other clamp nobody between them; and none is measured
farther than the thickest body part that matters. The answer is a function of what is given alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seerob.core.snapshot import Input, Origin
from seerob.core.transforms import Array
from seerob.criteria.contact.clamping import (
    STILL,
    Flags,
    PinchPairs,
    clamps,
    getting_in,
    robot_pinch_pairs,
)
from seerob.criteria.contact.joint_gaps import JointGaps
from seerob.description.norms.crushing_gaps import crushing_gaps, openings
from seerob.distance.least import DistanceKind, Survey
from seerob.kernels.approach import lowest_points, relative_speeds
from seerob.kernels.pairs import CORNERS
from seerob.kernels.shapes import Shapes
from seerob.kernels.speed import stacked
from seerob.model.model import Mechanism, Model
from seerob.model.provenance import given
from seerob.twin.spans import Relative, Span
from seerob.twin.state import State

ROUNDING = 1e-9
"""What bounds give away against rounding [m]."""


class ClosingGaps:
    """The gaps of a robot, bound once."""

    def __init__(self, shapes: Shapes, pairs: PinchPairs, thickness: Array) -> None:
        """Bind.

        Args:
            shapes: Of the model.
            pairs: Its gaps.
            thickness: Of the body parts that each can clamp [m], shape (g, r).
        """
        self._pairs, self._thickness = pairs, thickness
        self._shapes = shapes
        self._survey = Survey(shapes, pairs.queries) if pairs.queries else None
        bodies = range(len(shapes.names))
        self._hulls = stacked([_corners(shapes, body) for body in bodies])
        self._reach = np.array(
            [max((shapes.radius[i] for i in shapes.solids[b]), default=0.0) for b in bodies]
        )
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
        of = [(every[i].mj, every[j].mj) for i, j in pairs]
        return Relative(model.mj, of, hulls, self._reach[self._pair[:, 1]])

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
        relative_speeds(rotations, positions, *twists, self._pair, *self._hulls, self._reach, seen)
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
        caps = widest + ways + ROUNDING
        if not (caps > -np.inf).any():
            return nothing
        found = self._survey.within(rotations, positions, caps)
        known = (caps > -np.inf) & (found.kind != DistanceKind.BEYOND_CAP)
        gaps = np.where(known, found.distance - ways, np.inf)
        flags = clamps(gaps, speed, self._thickness) & of_gaps
        return np.asarray(pairs.per_body(flags) & wanted), pairs.fastest(flags, speed) * wanted


def _corners(shapes: Shapes, body: int) -> Array:
    """Points whose hull contains the cores of a body's solids [m], in its frame, shape (k, 3)."""
    found = [np.zeros((0, 3))]
    for i in shapes.solids[body]:
        rotation, position = shapes.local[i, :9].reshape(3, 3), shapes.local[i, 9:]
        count = int(shapes.which[i, CORNERS])
        found.append(shapes.corners[i, :count] @ rotation.T + position)
    return np.concatenate(found)


ROOM = 0.1
"""How far beyond the thickest body part gaps are told [m]."""


class FloorGap:
    """The gap between the moving bodies of a robot and the floor, bound once."""

    def __init__(self, model: Model, moving: Sequence[int], height: float) -> None:
        """Bind.

        Args:
            model: The compiled workstation.
            moving: Bodies that the robot's joints move.
            height: Of the floor, z in the world [m].
        """
        bodies = [model.bodies[i] for i in moving]
        self._height, self._moving, self._bodies = height, np.array(moving, np.int64), tuple(moving)
        self._corners = stacked([body.corners for body in bodies])
        self._radius = np.array([body.radius for body in bodies], float)

    def lowest(self, state: State) -> Array:
        """Gap between each moving body and the floor [m], shape (b,)."""
        found = np.empty(len(self._moving))
        lowest_points(self._moving, *state.placed(self._bodies), *self._corners, self._radius, found)
        return found - self._height

    def clamped(self, state: State, thickness: Array, wanted: Flags) -> Flags:
        """Which moving bodies clamp which body parts.

        Args:
            state: The twin.
            thickness: Of body parts [m], shape (r,).
            wanted: Of which bodies and body parts that matters, shape (b, r).
        """
        return np.asarray((self.lowest(state)[:, None] <= thickness) & wanted)

    def ever(self, state: State, span: Span, thickness: Array, wanted: Flags) -> Flags:
        """Which moving bodies clamp which body parts at any instant of a span, given the twin at one end."""
        gap = self.lowest(state) - span.fast[self._moving] * span.T
        return np.asarray((gap[:, None] <= thickness) & wanted)


class Clamping:
    """What clamps which body region, bound once."""

    def __init__(
        self,
        model: Model,
        robot: Mechanism,
        gaps: dict[str, float],
        regions: Sequence[str],
        floor: float | None,
    ) -> None:
        """Bind.

        Args:
            model: The compiled workstation.
            robot: The robot.
            gaps: Thickness of body regions by name [m], instead of those of ISO 13854.
            regions: Body regions in the order of the answers.
            floor: Height of the floor [m]; None when it is no surface.
        """
        known = {**crushing_gaps()[0], **gaps}
        others = [b for b in model.bodies if b.role not in ("human", "area")]
        # The real surfaces may be nearer than the shapes, or farther apart.
        deviation = 2 * max((body.deviation for body in others), default=0.0)
        plain = np.array([known[name] for name in regions])
        fits = np.minimum([openings()[0][name] for name in regions], plain)
        self._thickness = plain + deviation
        cap = float(self._thickness.max(initial=0.0)) + ROOM
        fits = np.maximum(fits - deviation, 0.0)
        enough = float(fits.max(initial=0.0))
        pairs, opens, placed = robot_pinch_pairs(model, robot, cap=cap, enough=enough)
        self._gaps = ClosingGaps(model.shapes, pairs, getting_in(opens, fits, self._thickness))
        self._relative = self._gaps.relative(model)
        least = min(openings()[0].values())
        self._joints = JointGaps(model, robot, placed, self._thickness, fits, least=least)
        self._moving = robot.moving
        self._floor = None if floor is None else FloorGap(model, robot.moving, floor)
        self._asked = tuple(b.index for b in others)
        # All that carries a surface: where a machine is not known, nor are the gaps to it.
        self._carriers = [name for name, m in model.mechanisms.items() if m.role != "human"]

    def at(self, state: State, wanted: Flags) -> tuple[Flags, Flags, Array]:
        """Which moving bodies clamp which regions, which of those against the floor, and how fast.

        That is against what moves itself [m/s], shape (b, r): both sides may be slower than they close.

        Args:
            state: The twin.
            wanted: Of which bodies, that move now, and which regions that matters, shape (b, r).

        Raises:
            Undecided: A robot or a machine that was not heard.
        """
        state.require(*self._carriers)
        if not wanted.any():
            return np.zeros_like(wanted), np.zeros_like(wanted), np.zeros(wanted.shape)
        v, twists = state.fastest_speeds(self._moving), state.body_velocities(self._asked)
        clamped, speeds = self._gaps.clamped(*state.placed(self._asked), twists, v, wanted)
        at_joints = self._joints.speeds(state, wanted)
        clamped |= at_joints > 0
        speeds = np.maximum(speeds, at_joints)
        if self._floor is None:
            return clamped, np.zeros_like(clamped), speeds
        floor = self._floor.clamped(state, self._thickness, wanted)
        return clamped | floor, floor, speeds

    def ever(self, state: State, span: Span, wanted: Flags) -> tuple[Flags, Array]:
        """What may clamp at any instant of a span of which the twin is at one end, and how fast; see `at`.

        Raises:
            Undecided: A robot or a machine that was not heard.
        """
        state.require(*self._carriers)
        poses, twists = state.placed(self._asked), state.body_velocities(self._asked)
        clamped, speeds = self._gaps.ever(*poses, twists, span, self._relative, wanted)
        at_joints = self._joints.speeds(state, wanted, span)
        clamped |= at_joints > 0
        if self._floor is not None:
            clamped |= self._floor.ever(state, span, self._thickness, wanted)
        return clamped, np.maximum(speeds, at_joints)


def floor_input(height: float | None) -> Input:
    """Whether the floor is a surface, and at which height."""
    name = "floor as a surface that clamps"
    if height is None:
        return Input(name=name, value="left out", origin=Origin.GIVEN, source="workstation file")
    if height:
        return given(name, height, "m")
    return Input(name=name, value=0.0, unit="m", origin=Origin.STATED, source="people stand on z = 0")
