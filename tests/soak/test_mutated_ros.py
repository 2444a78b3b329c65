"""Any bytes may come from ROS: they are understood, or refused; nothing else happens."""

import json

import cbor2
import pytest

from seerob.app.emulators.rosbridge import _typed, document
from seerob.protocols.links.protobuf_wire import double, message, whole
from seerob.protocols.ros import foxglove, ros_tcp, rosbridge
from seerob.protocols.ros.foxglove import ServerChannel
from seerob.protocols.ros.ros_messages import Content, Edition, Joints, Plan, Point, Transform, decode, encode
from soak.mutations import refusals

COUNTS = [pytest.param(1500, id="short"), pytest.param(100_000, id="long", marks=pytest.mark.soak)]
SAID = {
    Content.JOINT_STATE: Joints(1000.5, ("a", "b"), (1.0, -2.0), (0.25, 0.5), (3.0, 4.0)),
    Content.TF: (Transform(1000.5, "base", "tool", (1.0, 2.0, 3.0), (0.5, 0.5, 0.5, 0.5)),),
    Content.TRAJECTORY: Plan(None, ("a",), (Point(0.0, (1.0,), (2.0,)), Point(0.5, (1.5,)))),
}
JOINTS = SAID[Content.JOINT_STATE]


def published(said):
    return {"op": "publish", "topic": "/t", "msg": said}


def read_bridge(data):
    frame = rosbridge.Reader().take(data)
    if isinstance(frame, rosbridge.Published):
        rosbridge.message(Content.JOINT_STATE, frame, Edition.ROS2)


def read_text(data):
    read_bridge(data.decode("utf-8", "replace"))


def read_unity(data):
    for frame in ros_tcp.Splitter().feed(data):
        if frame.is_command:
            ros_tcp.edition_of(frame)


def read_offer(data):
    foxglove.channels(foxglove.operation(data.decode("utf-8", "replace")))


def protobuf():
    joint = message(1, b"a") + double(2, 1.0) + double(3, 2.0)
    return message(1, whole(1, 1000) + whole(2, 5)) + message(2, joint)


def read_protobuf(data):
    foxglove.decode(Content.JOINT_STATE, ServerChannel(1, "/t", "protobuf", "foxglove.JointStates"), data)


def json_of(value):
    return json.dumps(value).encode()


DECODERS = {
    **{
        f"{edition} {content}": (
            encode(content, SAID[content], edition),
            lambda data, c=content, e=edition: decode(c, data, e),
        )
        for edition in Edition
        for content in Content
    },
    "json": (json_of(published(document(JOINTS, Edition.ROS2))), read_text),
    "cbor": (cbor2.dumps(published(_typed(document(JOINTS, Edition.ROS2)))), read_bridge),
    "unity": (ros_tcp.handshake(Edition.ROS1), read_unity),
    "offer": (
        json_of(
            {"op": "advertise", "channels": [{"id": 1, "topic": "/t", "encoding": "cdr", "schemaName": "x"}]}
        ),
        read_offer,
    ),
    "protobuf": (protobuf(), read_protobuf),
}


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("kind", DECODERS)
def test_mutated_messages_of_ros_are_read_or_refused(kind, count):
    whole_message, read = DECODERS[kind]
    assert refusals(read, whole_message, seed=11, count=count) > 0
