"""Cartesian targets out: off unless both allow it, in the controller's frame, heard by a rosbridge server."""

from __future__ import annotations

import math

import numpy as np
import pytest

from live_story import wait_for
from made_cell import made
from seerob.emulators.motions import swing
from seerob.emulators.rosbridge import RosbridgeServer
from seerob.errors import InputError
from seerob.samples import PoseSample, Quality
from seerob.snapshot import Snapshot
from seerob.transforms import rotation_from_wxyz, transform
from seerob.writing.cartesian_targets import CartesianTargets, message, targets_allowed
from seerob.writing.target_table import CartesianTarget, TargetMessage

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
        wait_for(lambda: any(r["op"] == "advertise" for r in list(server.received)), 30.0)

        def sent():
            targets.write(at(0.0), (pose(1.25),))
            return published(server)

        wait_for(sent, 30.0)
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
