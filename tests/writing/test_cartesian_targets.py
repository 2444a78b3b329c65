"""Cartesian targets out: off unless both allow it, in the controller's frame, heard by a rosbridge server."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest

from live_story import wait_for
from made_cell import made
from seerob.app.emulation.motions import swing
from seerob.app.emulators.ros_tcp import RosTcpEndpoint
from seerob.app.emulators.rosbridge import RosbridgeServer
from seerob.core.errors import InputError
from seerob.core.samples import PoseSample, Quality
from seerob.core.snapshot import Snapshot
from seerob.core.transforms import rotation_from_wxyz, transform
from seerob.protocols.ros.ros_messages import Edition
from seerob.session.writing import CartesianTargets, message, serialised, targets_allowed
from seerob.workstation.tables.writing import CartesianTarget, TargetMessage, TargetWire

HALF = math.sqrt(0.5)
STATION = """
allow_writing = true
[[robots]]
name = "arm"
model = "library:ur10"
base = { position = [1, 2, 0.5], rpy_deg = [0, 0, 90] }
[[targets]]
at = "arm/tool0"
host = "127.0.0.1"
port = PORT
topic = "/target_pose"
link = "arm/base_link"
every = 0.01
"""


@pytest.fixture
def server():
    with RosbridgeServer(swing((0.0,)), ("a",)) as running:
        yield running


def station(folder, server, text=STATION):
    return made(folder, text.replace("PORT", str(server.port)))


def pose(x, t=0.0, **more):
    said = {"position": (x, 2.0, 1.5), "wxyz": (HALF, 0.0, 0.0, HALF), **more}
    return PoseSample(source="s", seq=0, t=t, target="arm/tool0", **said)


def at(t):
    return Snapshot(seq=0, t=t, poses=b"")


def published(server):
    return [r["msg"]["pose"]["position"] for r in list(server.received) if r["op"] == "publish"]


def test_targets_are_published_in_the_frame_of_the_controller(tmp_path, server):
    model = station(tmp_path, server).model
    with CartesianTargets(model, on_command_line=True) as targets:
        wait_for(lambda: any(r["op"] == "advertise" for r in list(server.received)))

        def sent():
            targets.write(at(0.0), (pose(1.25),))
            return published(server)

        wait_for(sent)
    (asked, first, *_) = server.received
    assert (asked["topic"], asked["type"]) == ("/target_pose", "geometry_msgs/msg/PoseStamped")
    # 0.25 m along x of the world is 0.25 m along -y of a base that is turned by 90 degrees.
    place, turn = first["msg"]["pose"]["position"], first["msg"]["pose"]["orientation"]
    np.testing.assert_allclose([place[k] for k in "xyz"], (0.0, -0.25, 1.0), atol=1e-9)
    np.testing.assert_allclose([turn[k] for k in "xyzw"], (0.0, 0.0, 0.0, 1.0), atol=1e-9)
    assert first["msg"]["header"]["frame_id"] == "base_link"


def test_only_what_is_due_and_good_is_published(tmp_path, server):
    model = station(tmp_path, server).model
    (way,) = CartesianTargets(model, on_command_line=True).ways
    way.note(0.0, (pose(1.0, t=0.5),))
    assert way.take() is None
    way.note(1.0, (pose(2.0, t=0.9),))
    # Of both that are due the newest, and once.
    assert way.take()["pose"]["position"]["y"] == pytest.approx(-1.0)
    assert way.take() is None
    for wrong in (
        pose(1.0, t=1.1, quality=Quality.DEGRADED),
        pose(math.nan, t=1.1),
        pose(1.0, t=1.1, wxyz=(0.0, 0.0, 0.0, 0.0)),
    ):
        way.note(2.0, (wrong,))
        assert way.take() is None


@pytest.mark.parametrize(("file", "command"), [(True, False), (False, True), (False, False)])
def test_nothing_is_published_unless_file_and_command_line_both_allow_it(tmp_path, server, file, command):
    text = STATION if file else STATION.replace("allow_writing = true", "")
    model = station(tmp_path, server, text).model
    assert not targets_allowed(model, on_command_line=command)
    with pytest.raises(InputError, match="not allowed; it takes both"):
        CartesianTargets(model, on_command_line=command)


@pytest.mark.parametrize(
    ("change", "reason"),
    [(("arm/base_link", "arm/tool0"), "no link that stands still"), (("arm/tool0", "arm/nose"), "nose")],
)
def test_a_name_that_is_not_there_is_an_error(tmp_path, server, change, reason):
    model = station(tmp_path, server, STATION.replace(*change)).model
    with pytest.raises(InputError, match=reason):
        CartesianTargets(model, on_command_line=True)


def test_messages_have_the_fields_of_their_types():
    def said(kind, ros):
        table = CartesianTarget(at="arm/tool0", host="h", topic="/t", message=kind, ros=ros)
        return message(table, transform(rotation_from_wxyz((1, 0, 0, 0)), (1, 2, 3)), 12.5)

    assert set(said(TargetMessage.POSE, 2)) == {"position", "orientation"}
    assert said(TargetMessage.POSE_STAMPED, 1)["header"]["stamp"] == {"secs": 12, "nsecs": 500_000_000}
    moved = said(TargetMessage.TRANSFORM_STAMPED, 2)
    assert moved["child_frame_id"] == "tool0"
    assert moved["transform"]["translation"] == {"x": 1.0, "y": 2.0, "z": 3.0}


@pytest.mark.parametrize("edition", [Edition.ROS1, Edition.ROS2])
def test_targets_reach_an_endpoint_of_ros_tcp_as_it_serialises(tmp_path, edition):
    with RosTcpEndpoint(swing((0.0,)), ("a",), edition=edition) as server:
        text = STATION.replace('host = "127.0.0.1"', 'host = "127.0.0.1"\nwire = "ros_tcp"')
        model = station(tmp_path, server, text).model
        with pytest.raises(InputError, match="not allowed; it takes both"):
            CartesianTargets(model, on_command_line=False)
        with CartesianTargets(model, on_command_line=True) as targets:

            def sent():
                targets.write(at(0.0), (pose(1.25),))
                return [f for f in list(server.received) if f.destination == "/target_pose"]

            wait_for(sent)
    announced = server.received[0]
    assert announced.destination == "__publish"
    assert announced.fields()["message_name"] == "geometry_msgs/PoseStamped"
    body = next(f.body for f in server.received if f.destination == "/target_pose")
    # Whatever the header is, a pose ends with its seven numbers.
    place, turn = np.split(np.array(struct.unpack("<7d", body[-56:])), [3])
    np.testing.assert_allclose(place, (0.0, -0.25, 1.0), atol=1e-9)
    np.testing.assert_allclose(turn, (0.0, 0.0, 0.0, 1.0), atol=1e-9)
    assert b"base_link" in body


@pytest.mark.parametrize("edition", [Edition.ROS1, Edition.ROS2])
@pytest.mark.parametrize("kind", list(TargetMessage))
def test_every_message_is_serialised_as_ros_has_it(kind, edition):
    table = CartesianTarget(at="arm/tool0", host="h", topic="/t", message=kind)
    said = message(table, transform(rotation_from_wxyz((HALF, 0, 0, HALF)), (1, 2, 3)), 12.5)
    raw = serialised(kind, said, edition)
    assert struct.unpack("<7d", raw[-56:]) == pytest.approx((1, 2, 3, 0, 0, HALF, HALF))
    if kind is TargetMessage.POSE:
        # By hand: seven numbers, in ROS 2 behind the four bytes of CDR.
        assert len(raw) == 56 + 4 * (edition is Edition.ROS2)
    else:
        start = 4  # seq in ROS 1, the header of CDR in ROS 2
        assert struct.unpack("<2I", raw[start : start + 8]) == (12, 500_000_000)


def test_encryption_is_of_rosbridge_only():
    with pytest.raises(ValueError, match="has no encryption"):
        CartesianTarget(at="arm/tool0", host="h", topic="/t", wire=TargetWire.ROS_TCP, tls=True)
