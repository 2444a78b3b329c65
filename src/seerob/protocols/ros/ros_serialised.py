"""ROS messages as ROS itself serialises them: by ROS 1, or by ROS 2 as CDR.

Only by the definitions of the three types that are read: definitions that come over the wire are not made
into code.
"""

from __future__ import annotations

from enum import StrEnum
from functools import cache
from typing import Any

from seerob.core.extras import need
from seerob.protocols import ProtocolError
from seerob.protocols.ros.ros_messages import Content, Said, read

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


def decode(content: Content, raw: bytes, edition: Edition) -> Said:
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


def encode(content: Content, message: Said, edition: Edition) -> bytes:
    """A serialised message, as a robot would send it.

    Args:
        content: What it is a message of.
        message: What it says.
        edition: Who is to read it.
    """
    types = store(edition)
    pack = types.serialize_ros1 if edition is Edition.ROS1 else types.serialize_cdr
    return bytes(pack(_made(content, message, edition), content.message_type))


def _made(content: Content, said: Said, edition: Edition) -> Any:
    import numpy as np

    from seerob.protocols.ros.ros_messages import NANO, Joints, Plan

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
