"""ROS messages in every form say the same."""

from __future__ import annotations

import json
import math

import pytest

from seerob.app.emulators.rosbridge import document
from seerob.protocols import ProtocolError
from seerob.protocols.ros import rosbridge
from seerob.protocols.ros.ros_messages import (
    Content,
    Edition,
    Joints,
    Plan,
    Point,
    Transform,
    decode,
    encode,
    read,
    same_type,
)
from seerob.protocols.ros.rosbridge import Published, Reader

SAID = {
    Content.JOINT_STATE: Joints(1000.5, ("a", "b"), (1.0, -2.0), (0.25, 0.5), (3.0, 4.0)),
    Content.TF: (
        Transform(1000.5, "base", "wrist", (1.0, 2.0, 3.0), (0.5, 0.5, 0.5, 0.5)),
        Transform(None, "wrist", "tool", (0.0, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0)),
    ),
    Content.TRAJECTORY: Plan(None, ("a",), (Point(0.0, (1.0,), (2.0,)), Point(0.5, (1.5,)))),
}


@pytest.mark.parametrize("edition", list(Edition))
@pytest.mark.parametrize("content", list(Content))
def test_what_is_written_is_read_again(content, edition):
    assert decode(content, encode(content, SAID[content], edition), edition) == SAID[content]
    assert read(content, json.loads(json.dumps(document(SAID[content], edition)))) == SAID[content]


def test_null_and_what_is_too_large_are_not_finite():
    said = {"header": {"stamp": {"sec": 1, "nanosec": 0}}, "name": ["a", "b", "c"]}
    said |= {"position": [None, 10**400, 1], "velocity": [], "effort": []}
    found = read(Content.JOINT_STATE, said)
    assert [math.isnan(x) for x in found.position] == [True, True, False]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"position": [1.0]}, "1 values of position for 2 joints"),
        ({"name": ["a", "a"]}, "named twice"),
        ({"name": "ab"}, "names is no list"),
        ({"position": [True, 1.0]}, "'True' is no number"),
        ({"header": {"stamp": {"sec": 1.5, "nanosec": 0}}}, "no whole number of seconds"),
        ({"header": {}}, "without stamp"),
        ({"effort": list(range(300))}, "300 effort; at most 256"),
    ],
)
def test_a_message_that_is_wrong_says_why(change, reason):
    said = document(SAID[Content.JOINT_STATE], Edition.ROS2) | change
    with pytest.raises(ProtocolError, match=reason):
        read(Content.JOINT_STATE, said)


def test_types_of_both_editions_are_the_same():
    assert same_type("sensor_msgs/JointState", "sensor_msgs/msg/JointState")
    assert not same_type("sensor_msgs/JointState", "sensor_msgs/msg/Imu")


def test_fragments_are_put_together_in_any_order():
    whole = json.dumps({"op": "publish", "topic": "/t", "msg": {"x": 1}})
    parts = [whole[:10], whole[10:25], whole[25:]]
    frames = [{"op": "fragment", "id": "7", "data": d, "num": k, "total": 3} for k, d in enumerate(parts)]
    reader = Reader()
    assert [reader.take(json.dumps(frames[k])) for k in (2, 0)] == [None, None]
    assert reader.take(json.dumps(frames[1])) == Published("/t", {"x": 1})


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        ('{"op": "png", "data": ""}', "pictures"),
        ('{"op": "fragment", "id": "1", "num": 3, "total": 3, "data": ""}', "without its place"),
        ('{"op": "publish", "msg": 1}', "without a topic"),
        ("[1]", "no table"),
        ("[" * 100_000, "no JSON"),
        (b"\x81" * 5000, "no CBOR"),
        (b"\xd8\x56\x43abc", "no CBOR"),
    ],
)
def test_what_no_server_sends_is_refused(frame, reason):
    with pytest.raises(ProtocolError, match=reason):
        Reader().take(frame)


def test_many_unfinished_messages_do_not_fill_the_memory():
    reader = Reader()
    for k in range(1000):
        reader.take(json.dumps({"op": "fragment", "id": str(k), "data": "x" * 100, "num": 0, "total": 2}))
    assert len(reader._parts) <= rosbridge.MOST_UNFINISHED
