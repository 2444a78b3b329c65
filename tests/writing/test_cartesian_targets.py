"""Cartesian targets out: off unless both allow it, in the controller's frame, heard by a rosbridge server."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
import zenoh

from free_ports import free_port
from live_story import wait_for
from made_cell import made
from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.app.emulation.motions import swing
from seerob.app.emulators.ros_tcp import RosTcpEndpoint
from seerob.app.emulators.rosbridge import RosbridgeServer
from seerob.app.emulators.zenoh import ZenohRouter
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
    return PoseSample(**{"source": "s", "seq": 0, "t": t, "target": "arm/tool0", **said})


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


def test_targets_reach_nodes_of_ros_2_over_zenoh(tmp_path):
    with ZenohRouter(swing((0.0,)), ("a",)) as router:
        text = STATION.replace('host = "127.0.0.1"', 'host = "127.0.0.1"\nwire = "zenoh"\ndomain = 3')
        model = station(tmp_path, router, text).model
        with pytest.raises(InputError, match="not allowed; it takes both"):
            CartesianTargets(model, on_command_line=False)
        heard = []
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", f'["tcp/127.0.0.1:{router.port}"]')
        with zenoh.open(config) as node:
            key = "3/target_pose/geometry_msgs::msg::dds_::PoseStamped_/*"
            node.declare_subscriber(key, lambda sample: heard.append(sample.payload.to_bytes()))
            with CartesianTargets(model, on_command_line=True) as targets:

                def sent():
                    targets.write(at(0.0), (pose(1.25),))
                    return heard

                wait_for(sent)
                tokens = [str(said.ok.key_expr) for said in node.liveliness().get("@ros2_lv/3/**")]
                (way,) = targets.ways
                router.stop()
                wait_for(lambda: way.reason)
                router.start()
                heard.clear()
                wait_for(sent)
    assert ["MP", "%target_pose", "geometry_msgs::msg::dds_::PoseStamped_"] in [
        [said.split("/")[k] for k in (5, 9, 10)] for said in tokens
    ]
    np.testing.assert_allclose(
        struct.unpack("<7d", heard[0][-56:]), (0.0, -0.25, 1.0, 0.0, 0.0, 0.0, 1.0), atol=1e-9
    )


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


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"wire": TargetWire.ROS_TCP, "tls": True}, "ros_tcp is not encrypted here"),
        ({"wire": TargetWire.ZENOH, "tls": True}, "zenoh is not encrypted here"),
        ({"wire": TargetWire.ZENOH, "ros": 1}, "nodes of ROS 1 do not speak Zenoh"),
        ({"domain": 3}, "domain does nothing with wire = rosbridge"),
    ],
)
def test_options_that_do_nothing_are_refused(options, reason):
    with pytest.raises(ValueError, match=reason):
        CartesianTarget(at="arm/tool0", host="h", topic="/t", **options)


def load_of(tool):
    return f"""
[[tools]]
name = "load"
on = "arm/tool0"
shape = {{ box = [0.1, 0.1, 0.1] }}
mass = 3
{tool}
"""


@pytest.mark.parametrize(
    ("tool", "said", "at", "published_at"),
    [
        # The robot's own name is its tool point: by nature tool0, with a tool on it the tip of that.
        ("", "arm", "arm/tool0", 0.0),
        (load_of("tcp = { position = [0, 0, 0.1] }"), "arm", "arm/tool0", -0.1),
        (load_of("tcp = { position = [0, 0, 0.1] }"), "arm/tool0", "arm", 0.1),
        ("", "arm/flange", "arm/tool0", 0.0),
    ],
)
def test_what_moves_with_the_tool_is_published_of_the_tool(tmp_path, server, tool, said, at, published_at):
    model = station(tmp_path, server, STATION.replace('at = "arm/tool0"', f'at = "{at}"') + tool).model
    (way,) = CartesianTargets(model, on_command_line=True).ways
    # Straight up in the world, where z of what is said points.
    way.note(0.0, (pose(1.0, target=said, wxyz=(1.0, 0.0, 0.0, 0.0)),))
    assert way.take()["pose"]["position"]["z"] == pytest.approx(1.0 + published_at, abs=1e-9)
    way.note(1.0, (pose(1.0, t=0.5, target="arm/forearm_link"),))
    assert way.take() is None


POSES = "t [s],x [m],y [m],z [m],qw,qx,qy,qz\n" + "".join(
    f"{k / 50},0.5,0.3,0.6,0,1,0,0\n" for k in range(51)
)
BY_POSES = '[[sources]]\nkind = "tool_path"\nrobot = "arm"\nfile = "a.csv"\nframe = "world"\n'


def test_a_run_says_how_many_were_sent_and_where_the_last_was(tmp_path, server, capsys):
    """The documented forms of both tables: `at` of the target, none of the source."""
    text = STATION.replace("[1, 2, 0.5], rpy_deg = [0, 0, 90]", "[0, 0, 0]")
    (tmp_path / "a.csv").write_text(POSES, encoding="utf-8")
    made(tmp_path, text.replace("PORT", str(server.port)) + BY_POSES)
    call = ["run", str(tmp_path), "--no-record", "--seconds", "1", "--port", "0", "--allow-writing"]
    cli.main(call)
    sent = len(published(server))
    assert sent > 10
    said = " ".join(capsys.readouterr().out.split())
    assert (
        f"/target_pose: {sent} poses of arm/tool0 sent, the last at 0.500, 0.300, 0.600 m in base_link"
        in said
    )


def test_a_run_says_why_nothing_was_sent(tmp_path, capsys):
    (tmp_path / "a.csv").write_text(POSES, encoding="utf-8")
    made(tmp_path, STATION.replace("PORT", str(free_port())) + BY_POSES)
    call = ["run", str(tmp_path), "--no-record", "--seconds", "0.5", "--port", "0", "--allow-writing"]
    cli.main(call)
    said = " ".join(capsys.readouterr().out.split())
    assert "/target_pose: nothing was sent of arm/tool0: " in said
    assert "refused" in said.partition("nothing was sent of arm/tool0")[2].lower()


JOINTS = "t [s]," + ",".join(f"q{k} [rad]" for k in range(6)) + "\n" + "0,0,-1,1,0,0,0\n0.1,0,-1,1,0,0,0\n"


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ('[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "q.csv"\n', "csv arm says joint positions"),
        ("", "none drives arm"),
        (
            BY_POSES + 'at = "arm/forearm_link"\n',
            "tool path arm says poses of arm/forearm_link",
        ),
        (
            '[[sources]]\nkind = "rosbridge"\nrobot = "arm"\nhost = "127.0.0.1"\n',
            "rosbridge arm says joint positions",
        ),
    ],
)
def test_check_file_refuses_a_target_of_which_nobody_says_poses(tmp_path, server, capsys, source, why):
    (tmp_path / "q.csv").write_text(JOINTS, encoding="utf-8")
    (tmp_path / "a.csv").write_text(POSES, encoding="utf-8")
    station(tmp_path, server, STATION + source)
    assert cli.main(["check-file", str(tmp_path)]) == Exit.ERROR
    said = " ".join(capsys.readouterr().err.split())
    assert "targets[0].at" in said
    assert why in said


def test_check_file_takes_a_target_whose_tool_follows_a_live_frame(tmp_path, server):
    source = '[[sources]]\nkind = "rosbridge"\nrobot = "arm"\nhost = "127.0.0.1"\ncontent = "tf"\n'
    station(tmp_path, server, STATION + source + 'child = "flange"\n')
    assert cli.main(["check-file", str(tmp_path)]) == Exit.WITHIN
