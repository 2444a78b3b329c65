"""What every reader of waypoints returns: where to go, how, and how fast, in SI units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from seerob.core.samples import Vec3, Vec4

MAX_WAYPOINTS = 20_000
"""More are no program, but a recording."""


class Move(StrEnum):
    """How the robot gets to a waypoint from the one before it."""

    JOINT = "joint"
    """Every joint in proportion, on a straight line in joint space (``movej``)."""
    LINEAR = "linear"
    """The tool point on a straight line (``movel``)."""
    PROCESS = "process"
    """A straight line, like `LINEAR`; the speed of the tool point is kept through blends (``movep``)."""
    CIRCULAR = "circular"
    """The tool point on the arc through ``via`` (``movec``)."""

    @property
    def of_tool(self) -> bool:
        """Whether the tool's way in space is given."""
        return self is not Move.JOINT


@dataclass(frozen=True)
class ToolPose:
    """Pose of the tool point in the frame that the file's poses are in."""

    position: Vec3
    """[m]"""
    wxyz: Vec4
    """Unit quaternion."""


@dataclass(frozen=True)
class Waypoint:
    """One waypoint; exactly one of ``q`` and ``pose``."""

    place: str
    """Where it stands in its file: ``line 12``."""
    move: Move = Move.JOINT
    name: str = ""
    q: tuple[float, ...] | None = None
    """Joint positions [rad or m]."""
    pose: ToolPose | None = None
    near: tuple[float, ...] | None = None
    """Joint positions to which those of ``pose`` are the nearest, of `Move.JOINT` [rad or m]; those where
    the robot is when not given."""
    via: ToolPose | None = None
    """A pose on the way of `Move.CIRCULAR`; only its position counts."""
    speed: float | None = None
    """Speed of the leading joint [rad/s or m/s], or of the tool point [m/s]."""
    acceleration: float | None = None
    """Acceleration of the leading joint [rad/s² or m/s²], or of the tool point [m/s²]."""
    duration: float | None = None
    """Time of the move instead of speed and acceleration [s]."""
    blend: float = 0.0
    """Distance of the tool point from the waypoint at which the path leaves for the next one [m]; infinite
    for half of the shorter of both moves."""
    pause: float = 0.0
    """Time that the robot stands there [s]."""

    @property
    def shown(self) -> str:
        """Its name and place, for messages."""
        return f"{self.name!r} ({self.place})" if self.name else self.place

    def waiting(self, seconds: float) -> Waypoint:
        """Return this waypoint with ``seconds`` more time to stand there [s]."""
        return replace(self, pause=self.pause + seconds)


@dataclass(frozen=True)
class Program:
    """Waypoints in the order in which they are visited."""

    file: str
    waypoints: tuple[Waypoint, ...]
    remarks: tuple[str, ...] = ()
    """What was left out, and what else is to be known of how it was read."""
    tcp: ToolPose | None = None
    """Tool point in the frame of the flange, where the file says it."""
    controller: bool = False
    """Whether the file is a controller's own, with poses in the controller's base frame."""
