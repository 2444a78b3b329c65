"""Motions out of bags: written by rosbags and by the MCAP library, read by us."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.devices.motion_files import PoseFrame
from seerob.devices.sources.bag import Bag
from seerob.files.motion_capture.ros_bag import TimeBase, topics_of
from seerob.protocols.ros.ros_messages import Content, Edition, Joints, Plan, Point, Transform, encode, store
from seerob.workstation.source import Target

NAMES = ("j1", "j2")
INF = (math.inf, math.inf)
TARGET = Target(
    name="arm",
    joints=NAMES,
    units=("rad", "rad"),
    lower=(-math.inf, -math.inf),
    upper=INF,
    velocity=(None, None),
)
T = np.arange(50) * 0.02
DELAY = 0.5


def joints(t):
    # In the file the joints stand the other way round, and a gripper is among them.
    return Joints(100.0 + t, ("grip", "j2", "j1"), (0.0, 2 * t, t**2), (0.0, 2.0, 2 * t), ())


def states():
    return [(Content.JOINT_STATE, "/joint_states", t, joints(t)) for t in T.tolist()]


def write(folder, kind, listed):
    """A bag of what is said, each as recorded half a second after its stamp."""
    edition = Edition.ROS1 if kind == "ros1" else Edition.ROS2
    if kind == "ros1":
        from rosbags.rosbag1 import Writer

        path, writer = folder / "m.bag", Writer(folder / "m.bag")
    else:
        from rosbags.rosbag2 import StoragePlugin, Writer

        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        path, writer = folder / "m", Writer(folder / "m", version=9, storage_plugin=plugin)
    with writer:
        connections = {}
        for content, topic, t, said in listed:
            if topic not in connections:
                types = {"typestore": store(edition)}
                connections[topic] = writer.add_connection(topic, content.message_type, **types)
            instant = round((100.0 + t + DELAY) * 1e9)
            writer.write(connections[topic], instant, encode(content, said, edition))
    return path


def opened(path, **more):
    return Bag(robot="arm", file=path.name, **more).open(path.parent, TARGET)


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
def test_joints_come_by_name_out_of_every_kind_of_bag(tmp_path, kind):
    found = list(opened(write(tmp_path, kind, states())).samples)
    np.testing.assert_allclose([s.t for s in found], T, atol=1e-6)
    np.testing.assert_allclose([s.q for s in found], np.column_stack([T**2, 2 * T]), atol=1e-12)
    np.testing.assert_allclose([s.qd for s in found], np.column_stack([2 * T, np.full(50, 2.0)]), atol=1e-12)
    assert {s.tau for s in found} == {None}


def test_the_mcap_library_writes_what_we_read(tmp_path):
    from mcap.writer import Writer

    path = tmp_path / "m.mcap"
    text = store(Edition.ROS2).generate_msgdef("sensor_msgs/msg/JointState", ros_version=2)[0]
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", text.encode())
        channel = writer.register_channel("/joint_states", "cdr", schema)
        for t in T.tolist():
            raw = encode(Content.JOINT_STATE, joints(t), Edition.ROS2)
            instant = round((100.0 + t) * 1e9)
            writer.add_message(channel, log_time=instant, publish_time=instant, data=raw)
        writer.finish()
    found = list(opened(path).samples)
    np.testing.assert_allclose([s.q for s in found], np.column_stack([T**2, 2 * T]), atol=1e-12)


def test_either_time_may_count_and_what_has_none_is_asked_about(tmp_path):
    path = write(tmp_path, "mcap", states())
    by_arrival = opened(path, time_base=TimeBase.RECEIVED)
    first = next(iter(by_arrival.samples))
    assert first.t_device == pytest.approx(100.0 + DELAY)
    assert "those of recording" in " ".join(f.text for f in by_arrival.findings)
    bare = [(c, topic, t, Joints(None, s.names, s.position)) for c, topic, t, s in states()]
    (tmp_path / "bare").mkdir()
    path = write(tmp_path / "bare", "ros1", bare)
    with pytest.raises(InputError, match='write time_base = "received"'):
        opened(path)
    assert len(list(opened(path, time_base=TimeBase.RECEIVED).samples)) == len(T)


def test_what_is_recorded_twice_counts_once(tmp_path):
    twice = [item for item in states() for _ in range(2)]
    found = opened(write(tmp_path, "mcap", twice))
    assert len(list(found.samples)) == len(T)
    assert "50 messages left out" in " ".join(f.text for f in found.findings)


def test_a_commanded_trajectory_is_played(tmp_path):
    points = tuple(Point(t, (t, -t)) for t in T.tolist())
    said = [(Content.TRAJECTORY, "/plan", 0.0, Plan(None, ("j2", "j1"), points))]
    found = opened(write(tmp_path, "mcap", said), content=Content.TRAJECTORY)
    np.testing.assert_allclose([s.q for s in found.samples], np.column_stack([-T, T]), atol=1e-12)


def test_the_tool_is_where_the_chain_of_transforms_says(tmp_path):
    one = (1.0, 0.0, 0.0, 0.0)
    said = [
        (Content.TF, "/tf", t, (Transform(100.0 + t, "base_link", "wrist", (0.1 * t, 0.0, 0.4), one),))
        for t in T.tolist()
    ]
    # Recorded after all others, it holds from the beginning.
    said.append((Content.TF, "/tf_static", 2.0, (Transform(None, "wrist", "tool0", (0.0, 0.2, 0.0), one),)))
    path = write(tmp_path, "mcap", said)
    found = opened(path, content=Content.TF, frame=PoseFrame.WORLD)
    samples = list(found.samples)
    assert {s.target for s in samples} == {"arm/tool0"}
    expected = np.column_stack([0.1 * T, np.full(50, 0.2), np.full(50, 0.4)])
    np.testing.assert_allclose([s.position for s in samples], expected, atol=1e-12)
    np.testing.assert_allclose([s.t for s in samples], T, atol=1e-6)
    assert "joints are solved" in " ".join(f.text for f in found.findings)
    with pytest.raises(InputError, match="frames that are heard: base_link, tool0, wrist"):
        opened(path, content=Content.TF, frame=PoseFrame.WORLD, child="gripper")


def test_mistakes_are_named(tmp_path):
    path = write(tmp_path, "mcap", states())
    with pytest.raises(InputError, match="nothing is said of a, b; other joints that are: grip, j2, j1"):
        opened(path, joints=("a", "b"))
    with pytest.raises(
        InputError, match="no sensor_msgs/msg/JointState called '/x'; there is: /joint_states"
    ):
        opened(path, topic="/x")
    with pytest.raises(InputError, match="no trajectory_msgs/msg/JointTrajectory"):
        opened(path, content=Content.TRAJECTORY)
    with pytest.raises(InputError, match="no such file"):
        opened(tmp_path / "absent.bag")
    (tmp_path / "no.bag").write_bytes(b"nonsense")
    with pytest.raises(InputError, match="not a ROS bag that can be read"):
        opened(tmp_path / "no.bag")


def test_a_pipe_is_no_bag_and_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "motion.bag")
    with pytest.raises(InputError, match=r"motion\.bag: cannot be read: is a pipe or a device"):
        topics_of(tmp_path / "motion.bag", "motion.bag")


@pytest.mark.parametrize(
    ("profile", "library", "said"),
    [
        ("", "foxglove", "the profile ''"),
        ("x", "a", "the profile 'x'"),
        ("", "seerob 1", 'kind = "recording"'),
    ],
)
def test_an_mcap_file_of_another_profile_is_not_called_broken(tmp_path, profile, library, said):
    """Written by the mcap library; nothing of it needs to be repaired."""
    from mcap.writer import Writer

    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile=profile, library=library)
        schema = writer.register_schema("foxglove.SceneUpdate", "jsonschema", b"{}")
        channel = writer.register_channel("/joints", "json", schema)
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()
    with pytest.raises(InputError) as caught:
        topics_of(tmp_path / "a.mcap", "a.mcap")
    assert said in str(caught.value)
    assert "reindex" not in str(caught.value)
    (tmp_path / "a.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:12])
    with pytest.raises(InputError, match="reindex"):
        topics_of(tmp_path / "a.mcap", "a.mcap")
