"""What ROS messages say of a robot, however they came: as JSON, as CBOR, or serialised by ROS 1 or 2.

``sensor_msgs/JointState`` (rad and m, by name: the order means nothing, and all but the names may be empty),
``tf2_msgs/TFMessage`` and ``trajectory_msgs/JointTrajectory``. Values that are not finite come through as
NaN: rosbridge writes them as ``null``.

ROS messages as ROS itself serialises them: by ROS 1, or by ROS 2 as CDR.

Only by the definitions of the three types that are read: definitions that come over the wire are not made
into code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Any

from seerob.core.extras import need
from seerob.protocols import ProtocolError

MOST_JOINTS = 256
MOST_TRANSFORMS = 2048
MOST_POINTS = 20_000
LONGEST_NAME = 256
LATEST = 4_294_967_296
"""A stamp beyond it is none [s]."""
NANO = 1_000_000_000


class Content(StrEnum):
    """What the messages of a topic say."""

    JOINT_STATE = "joint_state"
    """``sensor_msgs/JointState``: where the joints are."""
    TF = "tf"
    """``tf2_msgs/TFMessage``: where frames are, of which one is the tool."""
    TRAJECTORY = "trajectory"
    """``trajectory_msgs/JointTrajectory``: where the joints are to go; played from its arrival."""

    @property
    def message_type(self) -> str:
        """Name in ROS 2."""
        return {
            Content.JOINT_STATE: "sensor_msgs/msg/JointState",
            Content.TF: "tf2_msgs/msg/TFMessage",
            Content.TRAJECTORY: "trajectory_msgs/msg/JointTrajectory",
        }[self]

    @property
    def topic(self) -> str:
        """Where it usually is."""
        return {
            Content.JOINT_STATE: "/joint_states",
            Content.TF: "/tf",
            Content.TRAJECTORY: "/joint_trajectory",
        }[self]


@dataclass(frozen=True, slots=True)
class Joints:
    """A message of joints."""

    stamp: float | None
    """On the clock of ROS [s], which may be simulated; None when it is not set."""
    names: tuple[str, ...]
    position: tuple[float, ...]
    """[rad or m], one per name; NaN where it is not finite. Empty, as the others, when it is not said."""
    velocity: tuple[float, ...] = ()
    """[rad/s or m/s]"""
    effort: tuple[float, ...] = ()
    """[N·m or N]"""


@dataclass(frozen=True, slots=True)
class Transform:
    """Where a frame is."""

    stamp: float | None
    """[s]; None when it is not set."""
    parent: str
    child: str
    position: tuple[float, float, float]
    """Position of the child, in the parent [m]."""
    wxyz: tuple[float, float, float, float]
    """Parent from child."""


@dataclass(frozen=True, slots=True)
class Point:
    """Where the joints are to be."""

    t: float
    """From the start of the trajectory [s]."""
    position: tuple[float, ...]
    velocity: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Plan:
    """A trajectory that somebody commands."""

    stamp: float | None
    names: tuple[str, ...]
    points: tuple[Point, ...]


RosMessage = Joints | tuple[Transform, ...] | Plan


def ros1_name(message_type: str) -> str:
    """``sensor_msgs/JointState`` for ``sensor_msgs/msg/JointState``."""
    return message_type.replace("/msg/", "/")


def same_type(one: str, other: str) -> bool:
    """Whether two names, of ROS 1 or 2, mean the same type."""
    return ros1_name(one) == ros1_name(other)


def read(content: Content, message: Any) -> RosMessage:
    """What a message says.

    Args:
        content: What it is a message of.
        message: With its fields as keys (out of JSON or CBOR) or as attributes (deserialised).

    Raises:
        ProtocolError: A field is missing, of another kind, or too large.
    """
    match content:
        case Content.JOINT_STATE:
            return _joints(message)
        case Content.TF:
            listed = _list(_field(message, "transforms"), MOST_TRANSFORMS, "transforms")
            return tuple(_transform(item) for item in listed)
        case Content.TRAJECTORY:
            return _plan(message)


def _joints(message: Any) -> Joints:
    names = _names(_field(message, "name"))
    values = {key: _numbers(_field(message, key), key) for key in ("position", "velocity", "effort")}
    for key, numbers in values.items():
        if numbers and len(numbers) != len(names):
            raise ProtocolError(f"{len(numbers)} values of {key} for {len(names)} joints")
    return Joints(stamp=_stamp(message), names=names, **values)


def _transform(item: Any) -> Transform:
    said = _field(item, "transform")
    place, turn = _field(said, "translation"), _field(said, "rotation")
    w, x, y, z = (_number(_field(turn, key)) for key in "wxyz")
    px, py, pz = (_number(_field(place, key)) for key in "xyz")
    return Transform(
        stamp=_stamp(item),
        parent=_frame(_field(_field(item, "header"), "frame_id")),
        child=_frame(_field(item, "child_frame_id")),
        position=(px, py, pz),
        wxyz=(w, x, y, z),
    )


def _plan(message: Any) -> Plan:
    names = _names(_field(message, "joint_names"))
    points: list[Point] = []
    for item in _list(_field(message, "points"), MOST_POINTS, "points"):
        position = _numbers(_field(item, "positions"), "positions")
        velocity = _numbers(_field(item, "velocities"), "velocities")
        if len(position) != len(names) or len(velocity) not in (0, len(names)):
            raise ProtocolError(f"a point of {len(position)} positions for {len(names)} joints")
        t = time(_field(item, "time_from_start"))
        if points and t <= points[-1].t:
            raise ProtocolError(f"a point at {t:g} s after one at {points[-1].t:g} s")
        points.append(Point(t, position, velocity))
    return Plan(_stamp(message), names, tuple(points))


def time(value: Any) -> float:
    """Seconds of a time or a duration: ``secs`` and ``nsecs`` (ROS 1), ``sec`` and ``nanosec`` (ROS 2).

    Raises:
        ProtocolError: It is none.
    """
    whole = _first(value, ("sec", "secs"))
    part = _first(value, ("nanosec", "nsecs", "nsec"))
    for number in (whole, part):
        if isinstance(number, bool) or not isinstance(number, int):
            raise ProtocolError(f"{str(number)[:40]!r} is no whole number of seconds or nanoseconds")
    if not (abs(whole) < LATEST and 0 <= part < NANO):
        raise ProtocolError(f"no time: {str(whole)[:20]} s and {str(part)[:20]} ns")
    return float(whole) + 1e-9 * float(part)


def _stamp(message: Any) -> float | None:
    """None for a stamp of zero: nobody set it."""
    return time(_field(_field(message, "header"), "stamp")) or None


def _field(message: Any, key: str) -> Any:
    try:
        return message[key] if isinstance(message, Mapping) else getattr(message, key)
    except (KeyError, AttributeError):
        raise ProtocolError(f"a message without {key}") from None


def _first(message: Any, keys: tuple[str, ...]) -> Any:
    for key in keys:
        if key in message if isinstance(message, Mapping) else hasattr(message, key):
            return _field(message, key)
    raise ProtocolError(f"a time without {keys[0]}")


def _list(value: Any, most: int, what: str) -> Any:
    if isinstance(value, str | bytes | Mapping) or not hasattr(value, "__len__"):
        raise ProtocolError(f"{what} is no list")
    if len(value) > most:
        raise ProtocolError(f"{len(value)} {what}; at most {most} are read")
    return value.tolist() if hasattr(value, "tolist") else value


def _numbers(value: Any, what: str) -> tuple[float, ...]:
    return tuple(_number(item) for item in _list(value, MOST_JOINTS, what))


def _number(value: Any) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ProtocolError(f"{str(value)[:40]!r} is no number")
    try:
        number = float(value)
    except OverflowError:
        return math.nan
    return number if math.isfinite(number) else math.nan


def _names(value: Any) -> tuple[str, ...]:
    names = tuple(_name(item) for item in _list(value, MOST_JOINTS, "names"))
    if len(set(names)) != len(names):
        raise ProtocolError("a joint is named twice")
    return names


def _name(value: Any) -> str:
    if not isinstance(value, str) or len(value) > LONGEST_NAME:
        raise ProtocolError(f"{str(value)[:40]!r} is no name")
    return value


def _frame(value: Any) -> str:
    """Without the leading slash that tf had and tf2 has not."""
    return _name(value).lstrip("/")


MAX_BYTES = 1 << 20


class Edition(StrEnum):
    """Of ROS, as its serialisation is concerned."""

    ROS1 = "ros1"
    ROS2 = "ros2"


@cache
def store(edition: Edition) -> Any:
    """The definitions of the standard messages (a `rosbags` type store)."""
    need("rosbags")
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    found = get_typestore(Stores.ROS1_NOETIC if edition is Edition.ROS1 else Stores.ROS2_HUMBLE)
    # It lacks this one; the definition is that of geometry2.
    frames = Content.TF.message_type
    found.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", frames))
    return found


def decode(content: Content, raw: bytes, edition: Edition) -> RosMessage:
    """What a serialised message says.

    Args:
        content: What it is a message of.
        raw: The message; CDR with its header of four bytes.
        edition: Who serialised it.

    Raises:
        ProtocolError: It cannot be understood.
    """
    if len(raw) > MAX_BYTES:
        raise ProtocolError(f"a message of {len(raw)} bytes; at most {MAX_BYTES} are read")
    types = store(edition)
    unpack = types.deserialize_ros1 if edition is Edition.ROS1 else types.deserialize_cdr
    try:
        message = unpack(raw, content.message_type)
    except Exception as error:  # the reader trusts its bytes: whatever it raises, they are wrong
        what = f"no {content.message_type} of {edition}: {type(error).__name__}"
        raise ProtocolError(f"{what} {str(error)[:100]}") from None
    return read(content, message)


def encode(content: Content, message: RosMessage, edition: Edition) -> bytes:
    """A serialised message, as a robot would send it.

    Args:
        content: What it is a message of.
        message: What it says.
        edition: Who is to read it.
    """
    types = store(edition)
    pack = types.serialize_ros1 if edition is Edition.ROS1 else types.serialize_cdr
    return bytes(pack(_made(content, message, edition), content.message_type))


def _made(content: Content, said: RosMessage, edition: Edition) -> Any:
    import numpy as np

    def made(name: str, /, **fields: Any) -> Any:
        return store(edition).types[name](**fields)

    def span(name: str, t: float | None) -> Any:
        sec, nanosec = divmod(round((t or 0.0) * NANO), NANO)
        return made(f"builtin_interfaces/msg/{name}", sec=sec, nanosec=nanosec)

    def header(stamp: float | None, frame: str = "") -> Any:
        more = {"seq": 0} if edition is Edition.ROS1 else {}
        return made("std_msgs/msg/Header", stamp=span("Time", stamp), frame_id=frame, **more)

    if isinstance(said, Joints):
        return made(
            content.message_type,
            header=header(said.stamp),
            name=list(said.names),
            **{k: np.array(getattr(said, k), float) for k in ("position", "velocity", "effort")},
        )
    if isinstance(said, Plan):
        points = [
            made(
                "trajectory_msgs/msg/JointTrajectoryPoint",
                positions=np.array(p.position, float),
                velocities=np.array(p.velocity, float),
                accelerations=np.array([]),
                effort=np.array([]),
                time_from_start=span("Duration", p.t),
            )
            for p in said.points
        ]
        names = list(said.names)
        return made(content.message_type, header=header(said.stamp), joint_names=names, points=points)
    transforms = []
    for t in said:
        w, x, y, z = t.wxyz
        px, py, pz = t.position
        turn = made("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
        place = made("geometry_msgs/msg/Vector3", x=px, y=py, z=pz)
        transforms.append(
            made(
                "geometry_msgs/msg/TransformStamped",
                header=header(t.stamp, t.parent),
                child_frame_id=t.child,
                transform=made("geometry_msgs/msg/Transform", translation=place, rotation=turn),
            )
        )
    return made(content.message_type, transforms=transforms)
