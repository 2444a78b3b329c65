"""What every reader of waypoints returns: where to go, how, and how fast, in SI units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from seerob.core.samples import Vec3, Vec4
from seerob.core.transforms import Array, rotation_from_wxyz, transform, wxyz_from_rotation

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

    @classmethod
    def of(cls, matrix: Array) -> ToolPose:
        """From a transform, (4, 4)."""
        x, y, z = matrix[:3, 3].tolist()
        w, i, j, k = wxyz_from_rotation(matrix[:3, :3]).tolist()
        return cls((x, y, z), (w, i, j, k))

    @property
    def matrix(self) -> Array:
        """The transform that it is, (4, 4)."""
        return transform(rotation_from_wxyz(self.wxyz), self.position)


@dataclass(frozen=True)
class Configuration:
    """Which of the ways of reaching a pose a program means, as its controller tells them apart."""

    text: str
    """The program's own words for it: ``S 2, T 35``."""
    ranges: tuple[tuple[float, float] | None, ...] = ()
    """Where each joint is [rad]: from, up to; None where it is not said."""
    like: tuple[float, ...] = ()
    """Joint positions of a posture that ``sides`` are told by [rad]; empty where they are not."""
    sides: tuple[bool | None, bool | None] = (None, None)
    """Whether shoulder and elbow are on the side of that posture; None where it is not said."""


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
    via_q: tuple[float, ...] | None = None
    """Joint positions on the way of `Move.CIRCULAR`, instead of ``via`` [rad or m]."""
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
    share: float | None = None
    """Of `Move.JOINT`: share of the joints' own largest speeds, instead of ``speed``."""
    along: float | None = None
    """Of `Move.JOINT`: mean speed of the tool point on the way [m/s], instead of ``speed``."""
    acceleration_share: float = 1.0
    """Share of the acceleration that the source gives, where the program gives no other."""
    turn: float | None = None
    """Largest turning speed of the tool where the tool's way is given [rad/s]."""
    blend_share: float = 0.0
    """Instead of ``blend``: share of half of the shorter of both moves."""
    tool: ToolPose | None = None
    """Its own tool point, where those of a program differ; that of the program when not given."""
    configuration: Configuration | None = None
    """Which way of reaching ``pose`` is meant, where the program says it."""

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
    left_out: tuple[str, ...] = ()
    """Parts of the motion that are not known, each with its place: of that robot nothing is within."""


def one_tool(waypoints: Sequence[Waypoint]) -> tuple[tuple[Waypoint, ...], ToolPose | None]:
    """The waypoints, and the tool point that all of them have; each keeps its own where they differ."""
    tools = {w.tool for w in waypoints}
    if len(tools) != 1:
        return tuple(waypoints), None
    return tuple(replace(w, tool=None) for w in waypoints), next(iter(tools))
