"""Robots over rosbridge, on real sockets; our server read by roslibpy in a process of its own."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import threading

import numpy as np
import pytest
from listening import heard

from live_story import Story, lived, open_files, wait_for
from made_cell import made
from seerob.app.emulation.ros_robot import JOINT_STATES, states_of
from seerob.app.emulators.rosbridge import RosbridgeServer
from seerob.core.errors import InputError
from seerob.core.samples import JointSample, PoseSample, Quality
from seerob.devices import ros as _ros
from seerob.devices.live.listening import Listener
from seerob.devices.sources.rosbridge import Rosbridge
from seerob.protocols.ros.ros_messages import Content, Edition, Joints, Plan, Point, Transform
from seerob.protocols.ros.rosbridge import Compression

UR10 = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
NAMES = tuple(f"{name}_joint" for name in UR10)
# The driver of Universal Robots sorts its joints: the elbow comes first.
SORTED = (NAMES[2], NAMES[1], NAMES[0], *NAMES[3:])
HOME, AMPLITUDE = np.array([0, -1.2, 1.4, -1.5, -1.5, 0]), np.array([0.5, 0.3, -0.3, 0.4, -0.4, 0.5])


def motion(t):
    return tuple((HOME + AMPLITUDE * np.sin(t)).tolist()), tuple((AMPLITUDE * np.cos(t)).tolist())


def sorted_motion(t):
    order = [NAMES.index(name) for name in SORTED]
    return tuple(tuple(row[k] for k in order) for row in motion(t))


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """A busy machine may take its time to answer at start."""
    monkeypatch.setattr("seerob.devices.live.listening.ASK_WITHIN", 30.0)
    monkeypatch.setattr("seerob.devices.ros.LISTEN_AT_START", 20.0)


def cell(folder, server, more="", timeout=0.2):
    return made(
        folder,
        '[[robots]]\nname = "arm"\nmodel = "library:ur10"\n'
        '[[sources]]\nkind = "rosbridge"\nname = "ros"\nrobot = "arm"\nhost = "127.0.0.1"\n'
        f"port = {server.port}\ntimeout = {timeout}\n{more}"
        '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm"\nlimit = 1.5\n',
    )


def source(server, **more):
    return Rosbridge(robot="arm", host="127.0.0.1", port=server.port, **more)


def joint_samples(samples):
    return [s for s in samples if isinstance(s, JointSample)]


@pytest.mark.parametrize(
    ("edition", "compression"),
    [(Edition.ROS2, way) for way in Compression]
    + [(Edition.ROS1, Compression.NONE), (Edition.ROS1, Compression.CBOR_RAW)],
)
def test_joints_come_by_name_in_every_form(edition, compression, caplog):
    with RosbridgeServer(sorted_motion, SORTED, edition=edition) as server:
        said = source(server, edition=edition, compression=compression, joints=NAMES)
        samples = heard(said, lambda s: len(s) > 5)
        for sample in samples:
            q, qd = motion(sample.t_device - server.epoch)
            np.testing.assert_allclose(sample.q, q, atol=1e-6)
            np.testing.assert_allclose(sample.qd, qd, atol=1e-6)
            assert sample.tau is None
    assert "asked for as JSON" not in caplog.text


def test_a_server_of_ros_1_that_fails_at_cbor_is_asked_for_json(monkeypatch, caplog):
    monkeypatch.setattr("seerob.devices.ros.SILENCE", 0.3)
    with RosbridgeServer(motion, NAMES, edition=Edition.ROS1) as server:
        said = source(server, edition=Edition.ROS1, compression=Compression.CBOR)
        assert len(heard(said, lambda s: len(s) > 5)) > 5
    assert "nothing comes as cbor; asked for as JSON" in caplog.text


def test_the_twin_follows_whatever_order_the_joints_are_in(tmp_path):
    with RosbridgeServer(sorted_motion, SORTED, rate=125.0) as server:
        story = lived(cell(tmp_path, server, "frequency = 125\n"), Story(150, Story.seen_enough))
    for s in story.joints():
        np.testing.assert_allclose(s.q, motion(s.t_device - server.epoch)[0], atol=1e-6)
    story.check_that_it_follows(lambda t: motion(t - server.epoch))


def test_a_topic_that_dies_is_undecided_and_followed_again(tmp_path):
    server = RosbridgeServer(motion, NAMES).start()

    def on():
        # Another clock, and none that is a little late.
        server.topics[JOINT_STATES] = Content.JOINT_STATE, states_of(motion, NAMES, server.epoch - 100.0)
        server.start()

    story = Story(
        300,
        lambda s: "within" in s.verdicts()[110:],
        at_50=server.stop,
        at_110=on,
    )
    try:
        lived(cell(tmp_path, server), story)
    finally:
        server.stop()
    verdicts = story.verdicts()
    assert "within" in verdicts[:60]
    assert set(verdicts[105:110]) == {"undecided"}
    assert "not heard for" in story.snapshots[109].results[0].reason
    assert story.decided(110) > 0


def test_null_is_not_a_number_and_the_sample_is_invalid():
    def broken(t):
        q, qd = motion(t)
        return (math.nan, *q[1:]), qd

    with RosbridgeServer(broken, NAMES) as server:
        sample = heard(source(server), len)[0]
    assert math.isnan(sample.q[0])
    assert sample.quality is Quality.INVALID


def test_what_the_server_refuses_is_said(caplog):
    with RosbridgeServer(motion, NAMES) as server:
        listener = Listener(source(server, topic="/arm/joint_states"), None, lambda _: None)
        listener.start()
        wait_for(lambda: "Cannot infer topic type for topic /arm/joint_states" in caplog.text)
        listener.ask_to_stop()
        assert listener.join(10.0)


def test_a_topic_without_a_message_is_silence(monkeypatch, caplog):
    monkeypatch.setattr(_ros, "SILENCE", 0.2)
    with RosbridgeServer(motion, NAMES) as server:
        server.topics["/quiet"] = (Content.JOINT_STATE, lambda t: Joints(None, (), ()))
        del server.topics["/joint_states"]
        listener = Listener(source(server, topic="/quiet", joints=NAMES), None, lambda _: None)
        listener.start()
        wait_for(lambda: "/quiet: nothing is said of shoulder_pan_joint" in caplog.text)
        listener.ask_to_stop()
        assert listener.join(10.0)


def test_two_publishers_on_one_topic_are_one_robot():
    turn = [0]

    def half(t):
        turn[0] += 1
        q, qd = motion(t)
        part = slice(0, 3) if turn[0] % 2 else slice(3, 6)
        return Joints(1000.0 + t, NAMES[part], q[part], qd[part])

    with RosbridgeServer(motion, NAMES, rate=200.0) as server:
        server.topics["/joint_states"] = (Content.JOINT_STATE, half)
        said = source(server, joints=NAMES, frequency=200.0)
        samples = heard(said, lambda s: sum(x.quality is Quality.GOOD for x in s) > 3)
    for sample in samples:
        assert len(sample.q) == 6
        if sample.quality is not Quality.GOOD:
            continue  # a busy machine sent the halves too far apart
        # It is as old as its oldest half.
        np.testing.assert_allclose(sample.q, motion(sample.t_device - 1000.0)[0], atol=0.01)


def chain(t):
    angle = 0.3 * math.sin(t)
    turned = (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))
    return (Transform(1000.0 + t, "base_link", "wrist", (0.5, 0.0, 0.4), turned),)


def tool(t):
    return (Transform(None, "/wrist", "tool0", (0.2, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),)


FRAMES = {"/tf": (Content.TF, chain), "/tf_static": (Content.TF, tool)}


def test_the_tool_is_where_the_chain_of_transforms_says():
    with RosbridgeServer(motion, NAMES, more=FRAMES) as server:
        samples = heard(source(server, content=Content.TF), lambda s: len(s) > 5)
    for sample in samples:
        assert isinstance(sample, PoseSample)
        angle = 0.3 * math.sin(sample.t_device - 1000.0)
        expected = (0.5 + 0.2 * math.cos(angle), 0.2 * math.sin(angle), 0.4)
        np.testing.assert_allclose(sample.position, expected, atol=1e-6)
        np.testing.assert_allclose(sample.wxyz, (math.cos(angle / 2), 0, 0, math.sin(angle / 2)), atol=1e-6)


def test_transforms_move_the_robot(tmp_path):
    with RosbridgeServer(motion, NAMES, more=FRAMES) as server:
        station = cell(tmp_path, server, 'content = "tf"\n')
        story = lived(
            station, Story(40, lambda s: any(isinstance(x, PoseSample) for h in s.heard for x in h))
        )
        poses = [s for samples in story.heard for s in samples if isinstance(s, PoseSample)]
        assert {s.target for s in poses} == {"arm/tool0"}
        assert "joints are solved" in " ".join(f.text for f in station.scene().findings)
        with pytest.raises(InputError, match="no link 'arm/torso'"):
            _ = cell(tmp_path / "a", server, 'content = "tf"\nparent = "torso"\n').sources


def test_a_trajectory_is_played_and_then_stands():
    points = (Point(0.0, tuple(HOME), (0.0,) * 6), Point(0.4, tuple(HOME + 0.1), (0.0,) * 6))
    with RosbridgeServer(motion, NAMES) as server:
        server.topics["/joint_trajectory"] = (Content.TRAJECTORY, lambda t: Plan(None, NAMES, points))
        server.rate = 0.5
        said = source(server, content=Content.TRAJECTORY, joints=NAMES)
        samples = heard(
            said, lambda s: bool(s) and np.allclose(s[-1].q, HOME + 0.1) and s[-1].qd == (0.0,) * 6
        )
    moved = np.array([s.q for s in samples]) - HOME
    assert np.all((moved > -1e-9) & (moved < 0.1 + 1e-9))


def test_another_robots_joints_and_wrong_counts_are_errors(tmp_path):
    with RosbridgeServer(motion, ("a", "b", "c", "d", "e", "f")) as server:
        with pytest.raises(InputError, match="messages of a, b, c"):
            cell(tmp_path / "a", server).reach()
        with pytest.raises(InputError, match="2 joints for the 6"):
            _ = cell(tmp_path / "b", server, 'joints = ["a", "b"]\n').sources


def test_kills_and_restarts_leave_no_thread_and_no_socket(monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.005)
    server = RosbridgeServer(motion, NAMES, rate=250.0).start()
    samples = []
    files, threads = open_files() if sys.platform == "linux" else 0, threading.active_count()
    listener = Listener(source(server, frequency=250.0), None, samples.append)
    listener.start()
    try:
        for _ in range(8):
            samples.clear()
            wait_for(lambda: len(samples) > 3)
            server.stop()
            server.start()
    finally:
        listener.ask_to_stop()
        assert listener.join(10.0)
    assert listener.statistics().losses >= 7
    wait_for(lambda: threading.active_count() <= threads)
    if sys.platform == "linux":
        wait_for(lambda: open_files() <= files)
    server.stop()


FOREIGN = """
import json, sys, time, roslibpy
ros = roslibpy.Ros(host="127.0.0.1", port=int(sys.argv[1]))
ros.run(timeout=120)
heard = []
roslibpy.Topic(ros, "/joint_states", "sensor_msgs/JointState").subscribe(heard.append)
talker = roslibpy.Topic(ros, "/target", "geometry_msgs/PoseStamped")
talker.advertise()
talker.publish(roslibpy.Message({"pose": {"position": {"x": 1.0}}}))
end = time.monotonic() + 120
while len(heard) < 5 and time.monotonic() < end:
    time.sleep(0.01)
print(json.dumps(heard[:5]))
ros.terminate()
"""


@pytest.mark.parametrize("edition", list(Edition))
def test_roslibpy_reads_our_server(edition):
    with RosbridgeServer(motion, NAMES, edition=edition) as server:
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", FOREIGN, str(server.port)],
            capture_output=True,
            text=True,
            timeout=240,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        messages = json.loads(done.stdout)
        assert len(messages) == 5
        for message in messages:
            stamp = message["header"]["stamp"]
            one = edition is Edition.ROS1
            t = stamp["secs" if one else "sec"] + 1e-9 * stamp["nsecs" if one else "nanosec"]
            assert tuple(message["name"]) == NAMES
            np.testing.assert_allclose(message["position"], motion(t - server.epoch)[0], atol=1e-6)
        ops = [r["op"] for r in server.received]
    assert ops[:2] == ["advertise", "publish"]
