"""Which body regions of a person each moving part of a robot could hit in the present posture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import Undecided
from seerob.core.snapshot import Verdict
from seerob.core.transforms import Array
from seerob.description.humans.skeleton import without_side
from seerob.description.humans.skin import BODY_REGION
from seerob.description.norms import body_limits
from seerob.distance.least import Per, Query, Reach, Survey
from seerob.model.model import Mechanism, Model
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.spans import Span, rows_of
from seerob.twin.state import State

SENSITIVE = "Larynx, eyes and ears"
"""In no row of the table; contact is not permitted."""
FEET = "Feet"
"""In no row of the table; no limit is available."""
REGIONS = (*body_limits.REGIONS, SENSITIVE, FEET)
_WITHIN_CAP = int(Reach.WITHIN_CAP)
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
        close: NDArray[np.bool_] = np.asarray(found.reach == _WITHIN_CAP).reshape(self._shape)
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
        close: NDArray[np.bool_] = np.asarray(found.reach == _WITHIN_CAP).reshape(self._shape)
        self._close = np.asarray(close.any(axis=0))
        near: NDArray[np.bool_] = close @ self._member
        if speed is not None:
            return near, np.full(len(REGIONS), speed)
        fast = (
            state.fastest_points(self.bodies)[0] if span is None else (span.fast + span.noise)[self._people]
        )
        v = np.where(self._close, fast, 0.0)
        return near, np.asarray(np.max(v[:, None] * self._member, axis=0))
