"""Which body regions of a person each moving part of a robot could hit in the present posture.

By its height a part can hit only some of them, where the file says how people can be there (`HeightReach`).
Without a word of the file anyone can be anywhere in any posture, and every region counts. With postures and
statures the skin of each region lies between two heights; a part that moves farther above or below than the
horizon cannot hit it. Arms and hands are held anywhere, and never left out. Nobody who is nearer than the
horizon in the twin is left out either, nor is anybody whose place is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import Undecided
from seerob.core.shapes import Solid
from seerob.core.snapshot import Input, Origin, Verdict
from seerob.core.transforms import Array
from seerob.description.humans import manikin
from seerob.description.humans.body_areas import BODY_REGION
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import bone_poses, without_side
from seerob.description.norms import body_limits
from seerob.distance.least import DistanceKind, Per, Query, Survey
from seerob.kernels.contact_speeds import reached
from seerob.model.model import Mechanism, Model
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.spans import Span, rows_of
from seerob.twin.state import State

SENSITIVE = "Larynx, eyes and ears"
"""In no row of the table; contact is not permitted."""
FEET = "Feet"
"""In no row of the table; no limit is available."""
REGIONS = (*body_limits.REGIONS, SENSITIVE, FEET)
_WITHIN_CAP = int(DistanceKind.WITHIN_CAP)
FORBIDDEN = frozenset({*body_limits.FORBIDDEN, SENSITIVE})


def without_limit(name: str, permitted: bool, within: str | None, file: str) -> tuple[Verdict, str]:
    """Verdict on a region that has no permissible speed, and why.

    Args:
        name: One of `REGIONS`.
        permitted: What the table says of contact; True when it says nothing.
        within: What of the robot a person's region is near to; None when there is no person to ask.
        file: Of the table.
    """
    if permitted and name not in FORBIDDEN:
        return Verdict.UNDECIDED, "no limit available" if name == FEET else f"no limit in {file}"
    if within is not None:
        return Verdict.EXCEEDED, f"contact not permitted, {within}"
    return Verdict.UNDECIDED, (
        "contact not permitted, and whether it can occur is open without a person: "
        "name one, or exclude the region if other measures keep it out"
    )


class Person:
    """The bones of one or several people by body region, bound once.

    A bone counts for its region in front and for that behind: a person can turn. Head and neck count
    for larynx, eyes and ears too. A bone that is off from where devices see it counts from as much farther.
    """

    def __init__(
        self,
        model: Model,
        robot: Mechanism,
        *people: str,
        horizon: float,
        without: tuple[int, ...] = (),
    ) -> None:
        """Bind.

        Args:
            model: The compiled workstation.
            robot: A robot with moving bodies that have shapes.
            people: Names of humans.
            horizon: Distance within which a part could hit a bone [m].
            without: Bones that are left out, by index.

        Raises:
            UnknownName: No such human.
        """
        every = (i for name in people for i in model.human(name).bodies)
        self.bodies = tuple(i for i in every if i not in without)
        self.several = len(people) > 1
        self._gap = model.gap(robot.moving, self.bodies)
        self._robot, self._people = rows_of(robot.moving), rows_of(self.bodies)
        self._asked = (*robot.moving, *self.bodies)
        # Not the gap's own query: that measures pairs however far they are.
        self._reach = float(np.nextafter(horizon + self._gap.deviation, np.inf))
        self._query = Query(model.shapes, robot.moving, self.bodies, cap=self._reach)
        self._farther = Survey(model.shapes, [(self._query, Per.WHETHER)])
        self._off = TrackingError(model, self.bodies)
        self._names = [model.bodies[body].name for body in self.bodies]
        self._close: NDArray[np.bool_] = np.zeros(len(self.bodies), bool)
        self._still = np.zeros(len(self.bodies))
        self._shape = len(robot.moving), len(self.bodies)
        self._member = np.zeros((len(self.bodies), len(REGIONS)), bool)
        for i, body in enumerate(self.bodies):
            bone = without_side(model.bodies[body].name.rsplit("/", 1)[-1])
            for region in BODY_REGION[bone]:
                self._member[i, REGIONS.index(FEET if region is None else region)] = True
            if bone in ("head", "neck"):
                self._member[i, REGIONS.index(SENSITIVE)] = True

    def hit(self, region: str) -> tuple[str, ...]:
        """Full names of the bones of one of `REGIONS` that were within the horizon at the latest `near`."""
        return tuple(
            self._names[i] for i in np.flatnonzero(self._close & self._member[:, REGIONS.index(region)])
        )

    def owners(self, region: str) -> tuple[str, ...]:
        """Whose bones these are."""
        return tuple(dict.fromkeys(bone.rpartition("/")[0] for bone in self.hit(region)))

    def touched(self, state: State, more: float = 0.0) -> NDArray[np.bool_]:
        """Which moving bodies touch which regions, or may since surfaces stick out, shape (b, len(REGIONS)).

        Or come so near [m].

        Raises:
            Undecided: As of `near`.
        """
        state.require_bodies(self._asked)
        caps = np.tile(np.nextafter(self._gap.deviation + more, np.inf) + self._off.at(state), self._shape[0])
        found = self._farther.within(*state.placed(self._asked), caps)
        close: NDArray[np.bool_] = np.asarray(found.kind == _WITHIN_CAP).reshape(self._shape)
        return close @ self._member

    def near(
        self, state: State, speed: float | None, span: Span | None = None
    ) -> tuple[NDArray[np.bool_], Array]:
        """What could be hit.

        Args:
            state: The twin.
            speed: Of every region, instead of the observed one [m/s].
            span: At any instant of that instead, of which the twin is at one end.

        Returns:
            Per moving body and region, shape (b, len(REGIONS)), and bounds on the regions' speeds [m/s].
        """
        state.require_bodies(self._asked)
        off = self._off.at(state)
        if span is not None and off.any():
            raise Undecided("how far devices are off is not known between two ticks")
        more = 0.0 if span is None else span.way(self._robot) + span.way(self._people)
        if off.any() or more:
            caps = np.tile(self._reach + more + off, self._shape[0])
            found = self._farther.within(*state.placed(self._asked), caps)
        else:
            found = state.distances(self._query, Per.WHETHER)
        fast = self._still
        if speed is None:
            fast = (
                state.fastest_speeds(self.bodies) if span is None else (span.fast + span.noise)[self._people]
            )
        near, v = np.empty((self._shape[0], len(REGIONS)), bool), np.empty(len(REGIONS))
        reached(found.kind, _WITHIN_CAP, self._member, fast, near, self._close, v)
        return near, v if speed is None else np.full(len(REGIONS), speed)


ANYWHERE = frozenset({"Upper arms and elbow joints", "Lower arms and wrist joints", "Hands and fingers"})
"""Regions that are moved to any height in any posture."""
INDICES = (15.0, 45.0)
"""Body mass over the square of the stature that is believed [kg/m²], see `humans.anthropometry`."""
STATURES = 3
"""So many statures between the ends of a range."""


@cache
def heights(postures: tuple[str, ...], statures: tuple[float, float]) -> dict[str, tuple[float, float]]:
    """Lowest and highest point of the skin of each body region over the floor [m].

    Over men and women, the given postures of the library, and statures and body masses between the ends.

    Args:
        postures: Names of postures.
        statures: Least and largest [m].

    Raises:
        UnknownName: No such posture.
        InputError: A stature that no adult has.
    """
    found: dict[str, list[float]] = {}
    for stature in np.linspace(*statures, STATURES).tolist():
        for sex in ("male", "female"):
            for index in INDICES:
                mass = float(np.clip(index * stature**2, 30.0, 250.0))
                person = manikin.build(name="person", stature=stature, mass=mass, sex=sex)
                for name in postures:
                    rotations, positions = bone_poses(person, posture(person, name))
                    for k, link in enumerate(person.links[1:]):
                        z = _heights(link.solids, rotations[k], positions[k])
                        for region in _regions(link.name):
                            found.setdefault(region, []).extend(z)
    return {region: (min(z), max(z)) for region, z in found.items()}


def _heights(solids: Sequence[Solid], rotation: Array, position: Array) -> list[float]:
    z = []
    for solid in solids:
        points, radius = solid.points, solid.radius
        assert points is not None
        corners = points if len(points) == 2 else np.vstack([points, points[1] + points[2] - points[0]])
        at = (corners @ rotation.T + position)[:, 2]
        z += [float(at.min() - radius), float(at.max() + radius)]
    return z


def _regions(bone: str) -> set[str]:
    of = {FEET if region is None else region for region in BODY_REGION[without_side(bone)]}
    return of | ({SENSITIVE} if bone in ("head", "neck") else set())


class HeightReach:
    """Which regions each moving body of a robot can hit, bound once.

    Args:
        model: The compiled workstation.
        robot: The robot.
        postures: In which people can be there.
        statures: Theirs, least and largest [m].
        horizon: Distance within which a part could hit a body part [m].
        floor: Height of the floor that they stand on [m].
    """

    def __init__(
        self,
        model: Model,
        robot: Mechanism,
        postures: tuple[str, ...],
        statures: tuple[float, float],
        *,
        horizon: float,
        floor: float,
    ) -> None:
        bands = heights(postures, statures)
        self._horizon, self._moving = horizon, robot.moving
        self._bodies = [model.bodies[i] for i in robot.moving]
        everywhere = -np.inf, np.inf
        band = [everywhere if name in ANYWHERE else bands.get(name, everywhere) for name in REGIONS]
        self._low, self._high = np.array(band).T + floor
        humans = [name for name, m in model.mechanisms.items() if m.role == "human"]
        self._people = (
            [Person(model, robot, name, horizon=horizon) for name in humans] if robot.moving else []
        )
        self.words = " or ".join(postures)

    def at(self, state: State, span: Span | None = None) -> NDArray[np.bool_]:
        """Per moving body and region, shape (b, len(REGIONS)); ``span`` as of `Person.near`."""
        horizon = self._horizon + (0.0 if span is None else span.way(rows_of(self._moving)))
        R, x = state.placed(self._moving)
        z = [
            (body.corners @ R[i, 2] + x[i, 2], body.radius + body.deviation)
            for i, body in zip(self._moving, self._bodies, strict=True)
        ]
        low = np.array([at.min() - r - horizon for at, r in z])[:, None]
        high = np.array([at.max() + r + horizon for at, r in z])[:, None]
        found: NDArray[np.bool_] = (low <= self._high) & (high >= self._low)
        for person in self._people:
            try:
                found |= person.near(state, 0.0, span)[0]
            except Undecided:
                return np.ones_like(found)
        return found


def reach_inputs(
    postures: tuple[str, ...], source: str, statures: tuple[float, float], floor: float
) -> tuple[Input, ...]:
    """How people can be there, and at which heights each body region is then."""
    method = f"skin of statures {statures[0]:g} to {statures[1]:g} m, {' or '.join(postures)}, on the floor"
    return (
        Input(name="postures of people", value=", ".join(postures), origin=Origin.GIVEN, source=source),
        *(
            Input(
                name=f"{name}: {end} over the ground",
                value=z + floor,
                unit="m",
                origin=Origin.COMPUTED,
                source=method,
            )
            for name, band in heights(postures, statures).items()
            if name not in ANYWHERE
            for end, z in zip(("lowest", "highest"), band, strict=True)
        ),
    )
