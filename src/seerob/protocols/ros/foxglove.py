"""Foxglove's WebSocket protocol, as its SDK's servers and the bridge of ROS speak it.

Text frames carry JSON operations (``serverInfo``, ``advertise``, ``status``), binary ones messages: a byte 1,
the number of the subscription (u32), an instant (u64, ns), the payload; little-endian. Payloads are JSON,
CDR, ROS 1 or Protocol Buffers, by what the channel says. Of schemas only names are used.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

from seerob.protocols import ProtocolError
from seerob.protocols.links import protobuf_wire
from seerob.protocols.links.json_pointer import document
from seerob.protocols.ros.ros_messages import (
    LONGEST_NAME,
    MOST_JOINTS,
    MOST_TRANSFORMS,
    NANO,
    Content,
    Edition,
    Joints,
    RosMessage,
    Transform,
    read,
    same_type,
)
from seerob.protocols.ros.ros_messages import decode as deserialise

PORT = 8765
SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
"""That of today's servers, and that of older bridges."""
MAX_MESSAGE = 1 << 20
MOST_CHANNELS = 4096
MESSAGE_DATA = 1
_HEAD = struct.Struct("<BIQ")
OWN = {
    Content.JOINT_STATE: ("foxglove.JointStates",),
    Content.TF: ("foxglove.FrameTransform", "foxglove.FrameTransforms"),
    Content.TRAJECTORY: (),
}
"""Foxglove's own schemas that say the same as those of ROS."""


@dataclass(frozen=True, slots=True)
class ServerChannel:
    """What a server offers."""

    id: int
    topic: str
    encoding: str
    """Encoding of its messages: ``json``, ``cdr``, ``ros1``, ``protobuf``."""
    schema: str
    """Name of the schema."""

    def says(self, content: Content) -> bool:
        """Whether its messages can be read as that."""
        if self.encoding == "protobuf":
            return self.schema in OWN[content]
        return self.schema in OWN[content] or same_type(self.schema, content.message_type)


@dataclass(frozen=True, slots=True)
class Message:
    """What came on a subscription."""

    subscription: int
    log_time: float
    """When the server had it [s]."""
    payload: bytes


@dataclass(frozen=True, slots=True)
class Operation:
    """What a text frame says."""

    op: str
    fields: dict[str, Any]


def subscribe(channels: dict[int, int]) -> str:
    """Ask for channels.

    Args:
        channels: Number of the channel by the number that its messages will carry.
    """
    listed = [{"id": own, "channelId": channel} for own, channel in channels.items()]
    return json.dumps({"op": "subscribe", "subscriptions": listed})


def operation(text: str) -> Operation:
    """Read a text frame.

    Raises:
        ProtocolError: It is no operation.
    """
    found = document(text)
    if not isinstance(found, dict) or not isinstance(found.get("op"), str):
        raise ProtocolError("a text that is no operation of Foxglove")
    return Operation(found["op"], found)


def channels(said: Operation) -> list[ServerChannel]:
    """What an ``advertise`` offers.

    Raises:
        ProtocolError: It is not as it should be.
    """
    listed = said.fields.get("channels")
    if not isinstance(listed, list) or len(listed) > MOST_CHANNELS:
        raise ProtocolError("an offer without channels, or with too many")
    found = []
    for item in listed:
        number = item.get("id") if isinstance(item, dict) else None
        if type(number) is not int or not 0 <= number < 1 << 53:
            raise ProtocolError("a channel without a number")
        topic, encoding, schema = (
            str(item.get(k, ""))[:LONGEST_NAME] for k in ("topic", "encoding", "schemaName")
        )
        found.append(ServerChannel(number, topic, encoding, schema))
    return found


def server_info(name: str) -> str:
    """What a server says first."""
    said = {"op": "serverInfo", "name": name, "capabilities": [], "metadata": {}, "sessionId": name}
    return json.dumps(said)


def offer(channels: list[ServerChannel]) -> str:
    """What a server has."""
    listed = [
        {"id": c.id, "topic": c.topic, "encoding": c.encoding, "schemaName": c.schema, "schema": ""}
        for c in channels
    ]
    return json.dumps({"op": "advertise", "channels": listed})


def subscriptions(said: Operation) -> dict[int, int]:
    """Channels that a ``subscribe`` asks for, by the number that their messages are to carry.

    Raises:
        ProtocolError: It is not as it should be.
    """
    listed = said.fields.get("subscriptions")
    if not isinstance(listed, list) or len(listed) > MOST_CHANNELS:
        raise ProtocolError("a wish without channels, or with too many")
    pairs = [(w.get("id"), w.get("channelId")) for w in listed if isinstance(w, dict)]
    numbers = [(own, at) for own, at in pairs if isinstance(own, int) and isinstance(at, int)]
    return {own: channel for own, channel in numbers if 0 <= own < 1 << 32}


def pack(subscription: int, log_time: float, payload: bytes) -> bytes:
    """A message on a subscription.

    Args:
        subscription: Its number.
        log_time: When the server had it [s].
        payload: As the channel's encoding is.
    """
    return _HEAD.pack(MESSAGE_DATA, subscription, int(log_time * 1e9)) + payload


def message(data: bytes) -> Message | None:
    """Read a binary frame; None for one of another kind (the server's time).

    Raises:
        ProtocolError: It is cut short.
    """
    if not data or data[0] != MESSAGE_DATA:
        return None
    if len(data) < _HEAD.size:
        raise ProtocolError(f"a message of {len(data)} bytes")
    _, subscription, nanoseconds = _HEAD.unpack_from(data)
    return Message(subscription, nanoseconds * 1e-9, data[_HEAD.size :])


def decode(content: Content, channel: ServerChannel, payload: bytes) -> RosMessage:
    """What a message says.

    Raises:
        ProtocolError: It cannot be understood.
    """
    if channel.encoding in ("cdr", "ros1"):
        edition = Edition.ROS1 if channel.encoding == "ros1" else Edition.ROS2
        return deserialise(content, payload, edition)
    if channel.encoding == "json":
        said = document(payload)
        return _own_json(content, said) if channel.schema in OWN[content] else read(content, said)
    if channel.encoding == "protobuf":
        return (
            _joint_states(payload) if content is Content.JOINT_STATE else _transforms(payload, channel.schema)
        )
    raise ProtocolError(f"messages in the unknown encoding {channel.encoding[:40]!r}")


# -- Foxglove's own schemas ---------------------------------------------------------------------


def _own_json(content: Content, said: object) -> RosMessage:
    """By putting it as ROS would."""
    if not isinstance(said, dict):
        raise ProtocolError("a message that is no table")
    if content is Content.JOINT_STATE:
        joints = said.get("joints")
        if not isinstance(joints, list) or not all(isinstance(j, dict) for j in joints):
            raise ProtocolError("joint states without joints")
        put: dict[str, object] = {"header": {"stamp": said.get("timestamp")}}
        put["name"] = [j.get("name") for j in joints]
        for key in ("position", "velocity", "effort"):
            known = any(j.get(key) is not None for j in joints)
            put[key] = [j.get(key) for j in joints] if known else []
        return read(content, put)
    listed = said.get("transforms") if "transforms" in said else [said]
    if not isinstance(listed, list) or not all(isinstance(t, dict) for t in listed):
        raise ProtocolError("transforms that are no list")
    edges = [
        {
            "header": {"stamp": t.get("timestamp"), "frame_id": t.get("parent_frame_id")},
            "child_frame_id": t.get("child_frame_id"),
            "transform": {"translation": t.get("translation"), "rotation": t.get("rotation")},
        }
        for t in listed
    ]
    return read(content, {"transforms": edges})


def _instant(data: bytes) -> float | None:
    found = {f.number: f.signed() for f in protobuf_wire.fields(data)}
    seconds, nanoseconds = found.get(1, 0), found.get(2, 0)
    if not (abs(seconds) < 1 << 32 and 0 <= nanoseconds < NANO):
        raise ProtocolError(f"no time: {seconds} s and {nanoseconds} ns")
    return seconds + 1e-9 * nanoseconds or None


def _double(field: protobuf_wire.Field) -> float:
    values = field.doubles()
    if len(values) != 1:
        raise ProtocolError(f"{len(values)} numbers where one belongs")
    return values[0]


def _joint_states(payload: bytes) -> Joints:
    stamp: float | None = None
    names: list[str] = []
    values: dict[int, list[float | None]] = {2: [], 3: [], 5: []}
    for field in protobuf_wire.fields(payload):
        if field.number == 1:
            stamp = _instant(field.bytes())
        elif field.number == 2:
            joint = {f.number: f for f in protobuf_wire.fields(field.bytes())}
            names.append(joint[1].text()[:LONGEST_NAME] if 1 in joint else "")
            for key, column in values.items():
                column.append(_double(joint[key]) if key in joint else None)
        if len(names) > MOST_JOINTS:
            raise ProtocolError(f"more than {MOST_JOINTS} joints")
    put = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}},
        "name": names,
        **{
            key: values[number] if any(v is not None for v in values[number]) else []
            for key, number in (("position", 2), ("velocity", 3), ("effort", 5))
        },
    }
    said = read(Content.JOINT_STATE, put)
    if not isinstance(said, Joints):
        raise ProtocolError("no joint states")
    return Joints(stamp, said.names, said.position, said.velocity, said.effort)


def _transforms(payload: bytes, schema: str) -> tuple[Transform, ...]:
    if schema == "foxglove.FrameTransform":
        return (_transform(payload),)
    found = [_transform(f.bytes()) for f in protobuf_wire.fields(payload) if f.number == 1]
    if len(found) > MOST_TRANSFORMS:
        raise ProtocolError(f"{len(found)} transforms; at most {MOST_TRANSFORMS} are read")
    return tuple(found)


def _transform(payload: bytes) -> Transform:
    found = {f.number: f for f in protobuf_wire.fields(payload)}

    def part(number: int) -> dict[int, float]:
        if number not in found:
            return {}
        return {f.number: _double(f) for f in protobuf_wire.fields(found[number].bytes())}

    place, turn = part(4), part(5)
    return Transform(
        stamp=_instant(found[1].bytes()) if 1 in found else None,
        parent=found[2].text()[:LONGEST_NAME].lstrip("/") if 2 in found else "",
        child=found[3].text()[:LONGEST_NAME].lstrip("/") if 3 in found else "",
        position=(place.get(1, 0.0), place.get(2, 0.0), place.get(3, 0.0)),
        wxyz=(turn.get(4, 0.0), turn.get(1, 0.0), turn.get(2, 0.0), turn.get(3, 0.0)),
    )
