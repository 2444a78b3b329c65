"""How machines move, in the workstation file: each motion names the variables that tell it.

A machine whose motion names no variable is driven by a source of its own, or stands still.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Annotated

from msgspec import Meta

from seerob.core.quantities import Corner, Length, Seconds, Table, unit
from seerob.core.shapes import Track

Travel = Annotated[float, unit("m", ge=-1000, le=1000)]
Turned = Annotated[float, unit("rad", ge=-1000, le=1000)]
Direction = tuple[float, float, float]

UP: Direction = (0.0, 0.0, 1.0)
FORTH: Direction = (1.0, 0.0, 0.0)
ACROSS: Direction = (0.0, 1.0, 0.0)
YES = "bool"
"""What a variable must be that says yes or no, where others must have a unit."""


class AtEnd(StrEnum):
    """What becomes of something at the end of its belt."""

    STOP = "stop"
    """It stays there."""
    LOOP = "loop"
    """The next one of its kind enters at the begin."""


def _direction(key: str, axis: Direction) -> None:
    if not math.isfinite(sum(axis)) or math.hypot(*axis) < 1e-6:
        raise ValueError(f"{key} = {list(axis)} is no direction")


def _ends(
    exact: str | None, binary: str | None, ends: tuple[float | None, float | None], travel: float | None
) -> None:
    if exact is not None and binary is not None:
        raise ValueError("it follows a number or a bool: keep one of the two variables")
    low, high = ends
    if low is not None and high is not None and not low < high:
        raise ValueError(f"lower = {low:g} is not below upper = {high:g}")
    if binary is not None and (low is None or high is None or travel is None):
        raise ValueError("open tells of two ends only: give lower (shut), upper (open) and travel, the time")
    if binary is None and travel is not None:
        raise ValueError("travel belongs to open: a position needs none")


class Slide(Table, frozen=True, kw_only=True):
    """Straight: a linear axis, a lift, a sliding door."""

    along: Direction = FORTH
    """Direction in its own frame."""
    position: str | None = None
    """Variable that tells how far it is from where ``at`` puts it, a length."""
    open: str | None = None
    """Instead: variable, a bool, that tells at which end it is; between them it is undecided."""
    lower: Travel | None = None
    """Its lower end [m]; shut, where ``open`` is told."""
    upper: Travel | None = None
    """Its upper end [m]; open."""
    travel: Seconds | None = None
    """Time from one end to the other [s], where ``open`` is told."""

    def __post_init__(self) -> None:
        _direction("along", self.along)
        _ends(self.position, self.open, (self.lower, self.upper), self.travel)

    def variables(self) -> dict[str, str]:
        """Variables and the SI unit that each must have."""
        return _given({self.position: "m", self.open: YES})


class Turn(Table, frozen=True, kw_only=True):
    """About an axis: a turntable, a hinged door."""

    about: Direction = UP
    """Axis through the origin of its own frame."""
    angle: str | None = None
    """Variable that tells how far it is turned, an angle; one that starts again after a turn goes on
    the short way."""
    open: str | None = None
    """Instead: variable, a bool, that tells at which end it is; between them it is undecided."""
    lower: Turned | None = None
    """Its lower end [rad]; shut, where ``open`` is told."""
    upper: Turned | None = None
    """Its upper end [rad]; open."""
    travel: Seconds | None = None
    """Time from one end to the other [s], where ``open`` is told."""

    def __post_init__(self) -> None:
        _direction("about", self.about)
        _ends(self.angle, self.open, (self.lower, self.upper), self.travel)

    def variables(self) -> dict[str, str]:
        """Variables and the SI unit that each must have."""
        return _given({self.angle: "rad", self.open: YES})


class Belt(Table, frozen=True, kw_only=True):
    """Carried by a conveyor: a part on a belt, whose begin is where ``at`` puts it."""

    length: Length
    """Way from the begin of the belt to its end [m]."""
    along: Direction = FORTH
    """Direction of the belt in its own frame."""
    start: Annotated[float, unit("m", ge=0, le=1000)] = 0.0
    """Where on the belt it lies first [m]."""
    position: str | None = None
    """Variable that tells how far the belt has run, a length."""
    speed: str | None = None
    """Variable of the belt's speed. Beside ``position`` it smooths what arrives unevenly; alone it is summed
    up: after a silence nobody knows where the part is, until ``placed`` says so."""
    placed: str | None = None
    """Variable, a bool: when it turns true, a part is put at ``start``."""
    at_end: AtEnd = AtEnd.STOP
    """``loop``: the next one enters at the begin."""

    def __post_init__(self) -> None:
        _direction("along", self.along)
        if self.start > self.length:
            raise ValueError(f"start = {self.start:g} m lies behind the end of the belt, {self.length:g} m")
        if self.placed is not None and self.speed is None and self.position is None:
            raise ValueError("placed needs position or speed of the belt beside it")

    def variables(self) -> dict[str, str]:
        """Variables and the SI unit that each must have."""
        return _given({self.position: "m", self.speed: "m/s", self.placed: YES})


class Conveyor(Table, frozen=True, kw_only=True):
    """A surface that runs: loose workpieces on it ride along."""

    along: Direction = FORTH
    """Direction in which it runs, in the frame of the part."""
    speed: str
    """Variable of its speed. While that is not known, what lies on it rides where nobody knows."""

    def __post_init__(self) -> None:
        _direction("along", self.along)

    def variables(self) -> dict[str, str]:
        """Variables and the SI unit that each must have."""
        return {self.speed: "m/s"}


class Vehicle(Table, frozen=True, kw_only=True):
    """On the floor: a cart or an AGV that tells its pose in the frame that ``at`` gives."""

    x: str | None = None
    """Variable of its place [m]; all three or none."""
    y: str | None = None
    """Variable of its place along y [m]; all three or none."""
    heading: str | None = None
    """Variable of the angle from x to where it looks, about z."""

    def __post_init__(self) -> None:
        if len({v is None for v in (self.x, self.y, self.heading)}) != 1:
            raise ValueError("x, y and heading belong together: give all three or none")

    def variables(self) -> dict[str, str]:
        """Variables and the SI unit that each must have."""
        return _given({self.x: "m", self.y: "m", self.heading: "rad"})


class Route(Table, frozen=True, kw_only=True):
    """Along a drawn way on the floor: an AGV that tells how far it has come, or how fast it is."""

    points: Annotated[tuple[Corner, ...], unit("m", min_length=2, max_length=1000)]
    """Corners (x, y) of the way in the frame that ``at`` gives [m]; it looks along it."""
    radius: Annotated[float, unit("m", ge=0, le=100)] = 0.0
    """Corners are rounded by arcs of this radius [m]; a way of more than two points needs one."""
    closed: bool = False
    """The last point is followed by the first again."""
    start: Annotated[float, unit("m", ge=0, le=1e5)] = 0.0
    """Where on the way it stands first [m]."""
    position: str | None = None
    """Variable that tells how far along the way it is, a length."""
    speed: str | None = None
    """Variable of its speed along the way. Beside ``position`` it smooths what arrives unevenly; alone it is
    summed up: after a silence nobody knows where it is, until ``placed`` says so."""
    placed: str | None = None
    """Variable, a bool: when it turns true, it is at ``start``."""

    def __post_init__(self) -> None:
        track = self.track
        if self.start > track.length:
            raise ValueError(f"start = {self.start:g} m lies behind the end of the way, {track.length:g} m")
        if self.placed is not None and self.speed is None and self.position is None:
            raise ValueError("placed needs position or speed beside it")

    @property
    def track(self) -> Track:
        """The way, corners rounded."""
        return Track.rounded(self.points, self.radius, closed=self.closed)

    def variables(self) -> dict[str, str]:
        """Variables and the SI unit that each must have."""
        return _given({self.position: "m", self.speed: "m/s", self.placed: YES})


class Fingers(Table, frozen=True, kw_only=True):
    """Two fingers that open and close evenly: a parallel gripper.

    The table's shape and mass are those of one finger, as it stands with the gripper shut: on the side of
    ``along``, its inner face in the middle (a box, cylinder, capsule or sphere is put there). The other is
    the same, turned by half a turn about z.
    """

    along: Direction = ACROSS
    """Direction in which it opens in its own frame, at right angles to z."""
    opening: str | None = None
    """Variable that tells how far the fingers are apart, a length."""
    open: str | None = None
    """Instead: variable, a bool, that tells at which end it is; between them it is undecided."""
    lower: Travel | None = None
    """Least opening [m]; shut, where ``open`` is told."""
    upper: Travel | None = None
    """Largest opening [m]; open."""
    travel: Seconds | None = None
    """Time from one end to the other [s], where ``open`` is told."""
    touch: Annotated[float, unit("m", gt=0, le=0.1)] = 0.005
    """A workpiece that is loose or has ``rest`` is held once both fingers are as near to it as this [m], and
    let go once one of them is twice as far."""
    takes: Annotated[str, Meta(min_length=1, max_length=300)] = "*"
    """Names of the loose workpieces that it takes, one at a time, wildcards allowed."""

    def __post_init__(self) -> None:
        _direction("along", self.along)
        if abs(self.along[2]) > 1e-6 * math.hypot(*self.along):
            raise ValueError(
                f"along = {list(self.along)} is not at right angles to z, which fingers turn about"
            )
        _ends(self.opening, self.open, (self.lower, self.upper), self.travel)

    def variables(self) -> dict[str, str]:
        """Variables and the SI unit that each must have."""
        return _given({self.opening: "m", self.open: YES})


Motion = Slide | Turn | Belt | Vehicle | Route | Fingers


def _given(needs: dict[str | None, str]) -> dict[str, str]:
    return {name: what for name, what in needs.items() if name is not None}
