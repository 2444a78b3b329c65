"""A waypoint as a table: by hand in the workstation file, in TOML and YAML, and as a row of a sheet."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any

from msgspec import Meta

from seerob.core.errors import InputError, Problem
from seerob.core.quantities import Metres3, Pose, Radians, Table, unit
from seerob.core.samples import Vec4
from seerob.core.transforms import rotation_from_rpy, wxyz_from_rotation
from seerob.files.waypoints.waypoint import MAX_WAYPOINTS, Move, Program, ToolPose, Waypoint

Positive = Annotated[float, Meta(gt=0, le=1e4)]


class Point(Table, frozen=True, kw_only=True):
    """One waypoint: joint positions ``q`` or a tool pose ``at``."""

    name: str = ""
    move: Move | None = None
    """``joint``, ``linear``, ``process`` or ``circular``; ``joint`` for joint positions, and to be given
    for a pose."""
    q: Radians | None = None
    """Joint positions [rad or m]; ``q_deg`` for degrees."""
    at: Pose | None = None
    """Pose of the tool point, in the frame that the source says."""
    via: Metres3 | None = None
    """A point on the way of a circular move [m]."""
    speed: Positive | None = None
    """Speed of the leading joint [rad/s or m/s], or of the tool point [m/s]."""
    acceleration: Positive | None = None
    """Acceleration of the leading joint [rad/s² or m/s²], or of the tool point [m/s²]."""
    duration: Annotated[float, unit("s", gt=0, le=1e5)] | None = None
    """Duration of the move [s], instead of speed and acceleration."""
    blend: Annotated[float, unit("m", ge=0, le=10)] = 0.0
    """Radius in which the path is rounded off [m]."""
    pause: Annotated[float, unit("s", ge=0, le=1e5)] = 0.0
    """Time that the robot stands there [s]."""

    def __post_init__(self) -> None:
        if (self.q is None) == (self.at is None):
            raise ValueError("give either q or at")
        if self.at is not None and self.move is None:
            raise ValueError("a pose needs its move: joint, linear, process or circular")
        if (self.via is not None) != (self.move is Move.CIRCULAR):
            raise ValueError("via belongs to a circular move, and a circular move needs it")
        if self.at is not None and self.at.rpy is None and self.at.wxyz is None:
            raise ValueError("a tool pose needs its orientation: rpy (or rpy_deg) or wxyz")

    def waypoint(self, place: str) -> Waypoint:
        """As the readers of programs give it."""
        pose = None if self.at is None else ToolPose(self.at.position, _wxyz(self.at))
        return Waypoint(
            place=place,
            move=self.move or Move.JOINT,
            name=self.name,
            q=self.q,
            pose=pose,
            via=None if self.via is None else ToolPose(self.via, (1.0, 0.0, 0.0, 0.0)),
            speed=self.speed,
            acceleration=self.acceleration,
            duration=self.duration,
            blend=self.blend,
            pause=self.pause,
        )


def program_of(tables: Iterable[tuple[str, Mapping[str, Any]]], file: str) -> Program:
    """A program of waypoints that are tables, each with its place in the file.

    Raises:
        InputError: With every mistake in every one of them.
    """
    from seerob.workstation.conversion import convert

    problems: list[Problem] = []
    found: list[Waypoint] = []
    for place, table in tables:
        point = convert(table, Point, file=file, key=place, problems=problems)
        if point is not None:
            found.append(point.waypoint(place))
        if len(found) > MAX_WAYPOINTS:
            raise InputError.at(file, place, f"more than {MAX_WAYPOINTS} waypoints", "split the file")
    if problems:
        raise InputError(problems)
    return Program(file, tuple(found))


def _wxyz(pose: Pose) -> Vec4:
    if pose.wxyz is not None:
        w, x, y, z = pose.wxyz
        length = (w * w + x * x + y * y + z * z) ** 0.5
        return w / length, x / length, y / length, z / length
    w, x, y, z = wxyz_from_rotation(rotation_from_rpy(pose.rpy or (0.0, 0.0, 0.0))).tolist()
    return w, x, y, z
