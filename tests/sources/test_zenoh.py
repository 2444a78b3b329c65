"""Robots over Zenoh: against nodes of another library, and keys as rmw_zenoh forms them."""

from __future__ import annotations

import asyncio
import json
import math
import subprocess
import sys
import threading
import time
import tracemalloc
from contextlib import aclosing, contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st
from listening import heard
from zenoh_ros2_sdk.attachment import Attachment
from zenoh_ros2_sdk.keyexpr import topic_keyexpr
from zenoh_ros2_sdk.qos import QosDurability, QosProfile
from zenoh_ros2_sdk.utils import get_type_hash, ros2_to_dds_type

from free_ports import free_port
from live_story import wait_for
from seerob.app.emulation.ros_robot import EPOCH
from seerob.app.emulators.zenoh import ZenohRouter
from seerob.core.samples import JointSample, PoseSample
from seerob.devices.live.listening import Listener
from seerob.devices.sources.zenoh import Zenoh
from seerob.protocols.ros import rmw_zenoh
from seerob.protocols.ros.ros_messages import Content, Edition, Joints, Plan, Point, Transform, encode, store
from soak.elsewhere import JOINT_STATE, JOINT_STATE_HASH, Elsewhere

NAMES = ("a", "b")
TURN = 0.3
FOLDER = Path(__file__).parent


def motion(t):
    return (0.1 * t, -0.2), (0.1, 0.0)


def source(port, **more):
    return Zenoh(robot="arm", host="127.0.0.1", port=port, **more)


@contextmanager
def router(port, where="listen"):
    """A router of Zenoh's own library, or with ``connect`` another one at it, as a bridge from DDS is."""
    config = zenoh.Config()
    for path, value in (
        ("mode", "router"),
        ("scouting/multicast/enabled", False),
        (f"{where}/endpoints", [f"tcp/127.0.0.1:{port}"]),
    ):
        config.insert_json5(path, json.dumps(value))
    session = zenoh.open(config)
    try:
        yield session
    finally:
        session.close()


@contextmanager
def again_and_again(*sends):
    """What is sent again and again until the end."""
    over = threading.Event()

    def work():
        while not over.wait(0.01):
            for send in sends:
                send()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


# -- a node of others ---------------------------------------------------------------------------


def test_a_node_of_another_library_is_heard_at_the_first_connection():
    server = Elsewhere("zenoh").start()
    try:
        samples = heard(source(server.port), lambda s: len(s) > 5)
    finally:
        server.close()
    for sample in samples:
        assert isinstance(sample, JointSample)
        assert sample.q == (0.1, 0.1)
        assert sample.qd == (0.0, 0.0)
        assert sample.tau is None
        assert abs(sample.t - sample.t_device) < 1.0  # its stamps are of this machine's monotonic clock


def test_a_subscriber_of_another_library_hears_the_emulated_node():
    with ZenohRouter(motion, NAMES) as node:
        said = subprocess.run(
            [sys.executable, FOLDER / "zenoh_subscriber.py", str(node.port)],
            capture_output=True, text=True, timeout=120, check=True,
        ).stdout  # fmt: skip
    rows = [json.loads(line) for line in said.splitlines() if line.startswith("{")]
    assert len(rows) == 5
    for row in rows:
        assert row["name"] == list(NAMES)
        assert row["position"] == pytest.approx([0.1 * (row["stamp"] - EPOCH), -0.2], abs=1e-6)


def test_keys_hashes_and_attachments_are_those_of_another_library():
    kind = Content.JOINT_STATE.message_type
    definition = store(Edition.ROS2).hash_rihs01(kind)
    ours = JOINT_STATE.partition("=")[0]
    _, header, stamp = JOINT_STATE.split("MSG: ")
    of_others = {"std_msgs/msg/Header": header, "builtin_interfaces/msg/Time": stamp}
    depends = {name: text.partition("\n")[2].partition("=")[0] for name, text in of_others.items()}
    assert definition == JOINT_STATE_HASH == get_type_hash(kind, msg_definition=ours, dependencies=depends)
    theirs = topic_keyexpr(5, "/cell/joint_states", ros2_to_dds_type(kind), definition)
    assert rmw_zenoh.key("/cell/joint_states", kind, 5, definition) == theirs
    assert rmw_zenoh.message_type(ros2_to_dds_type(kind)) == kind
    port, said, tokens = free_port(), [], []
    with router(port) as session:
        session.declare_subscriber("**", lambda sample: said.append(sample.attachment.to_bytes()))
        session.liveliness().declare_subscriber(
            "@ros2_lv/**",
            lambda sample: sample.kind == zenoh.SampleKind.PUT and tokens.append(str(sample.key_expr)),
        )
        for kept in (False, True):
            publisher = rmw_zenoh.Publisher(session, "/tf_static", kind, definition, 0, kept=kept)
            publisher.publish(b"x", 12.5)
            wait_for(lambda: said and tokens)
            note = Attachment.from_bytes(said.pop())
            assert (note.sequence_id, note.timestamp_ns, len(note.gid)) == (1, 12_500_000_000, 16)
            token = tokens.pop()
            quality = QosProfile.decode(token.rpartition("/")[2])
            assert (quality.durability is QosDurability.TRANSIENT_LOCAL) == kept
            assert rmw_zenoh.offered([token]) == {"/tf_static": kind}


# -- what is said -------------------------------------------------------------------------------


def test_the_tool_comes_out_of_transforms_of_which_some_were_said_before():
    def edge(t, parent, child, x, yaw=0.0):
        turn = (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))
        return Transform(1000.0 + t, parent, child, (x, 0.0, 0.0), turn)

    port = free_port()
    with router(port) as session:
        hashed = store(Edition.ROS2).hash_rihs01(Content.TF.message_type)
        kind = Content.TF.message_type
        fixed = rmw_zenoh.Publisher(session, "/tf_static", kind, hashed, 0, kept=True)
        fixed.publish(encode(Content.TF, (edge(0, "wrist", "tool0", 0.2),), Edition.ROS2), 0.0)
        moving = rmw_zenoh.Publisher(session, "/tf", kind, hashed, 0)
        begun = time.monotonic()

        def send():
            said = (edge(time.monotonic() - begun, "base_link", "wrist", 0.5, TURN),)
            moving.publish(encode(Content.TF, said, Edition.ROS2), 0.0)

        with again_and_again(send):
            sample = heard(source(port, content=Content.TF), len)[0]
    assert isinstance(sample, PoseSample)
    expected = (0.5 + 0.2 * math.cos(TURN), 0.2 * math.sin(TURN), 0)
    np.testing.assert_allclose(sample.position, expected, atol=1e-9)
    np.testing.assert_allclose(sample.wxyz, (math.cos(TURN / 2), 0, 0, math.sin(TURN / 2)), atol=1e-9)


def test_a_trajectory_is_played():
    plan = Plan(None, NAMES, (Point(0.0, (0.0, 1.0), (0.0, 0.0)), Point(600.0, (0.6, 1.0), (0.0, 0.0))))
    port = free_port()
    with router(port) as session:
        kind = Content.TRAJECTORY.message_type
        hashed = store(Edition.ROS2).hash_rihs01(kind)
        commands = rmw_zenoh.Publisher(session, "/joint_trajectory", kind, hashed, 0)
        raw = encode(Content.TRAJECTORY, plan, Edition.ROS2)
        with again_and_again(lambda: commands.publish(raw, 0.0)):
            sample = heard(source(port, content=Content.TRAJECTORY), len)[0]
    assert sample.q == pytest.approx((0.0, 1.0), abs=1e-3)


def test_a_bridge_from_dds_publishes_under_the_topic_alone():
    raw = encode(Content.JOINT_STATE, Joints(7.0, NAMES, (0.5, 0.25)), Edition.ROS2)
    port = free_port()
    with router(port) as session, again_and_again(lambda: session.put("cell/joint_states", raw)):
        sample = heard(source(port, topic="/cell/joint_states"), len)[0]
    assert sample.q == (0.5, 0.25)


HASH = store(Edition.ROS2).hash_rihs01(Content.JOINT_STATE.message_type)
BRIDGED, OF_DOMAIN_0 = (
    "joint_states",
    rmw_zenoh.key("/joint_states", Content.JOINT_STATE.message_type, 0, HASH),
)


@pytest.mark.parametrize(
    ("keys", "domain", "heard_of", "doubted"),
    [
        ((BRIDGED, BRIDGED), None, {0.5, 0.7}, True),
        ((OF_DOMAIN_0, BRIDGED), None, {0.5, 0.7}, True),
        ((OF_DOMAIN_0, BRIDGED), 0, {0.5}, False),
        ((OF_DOMAIN_0, OF_DOMAIN_0), None, {0.5, 0.7}, False),
    ],
    ids=["two bridges", "a node and a bridge", "a node whose domain is given", "two nodes of a domain"],
)
def test_what_is_heard_from_two_domains_at_once_is_not_relied_on(keys, domain, heard_of, doubted):
    """Keys of a bridge have no domain; within one a topic may have several publishers."""
    port = free_port()
    first, second = (
        encode(Content.JOINT_STATE, Joints(None, NAMES, (x, 0.25)), Edition.ROS2) for x in (0.5, 0.7)
    )

    async def listened():
        found = []
        async with asyncio.timeout(60), aclosing(source(port, domain=domain).listen(None)) as samples:
            async for sample in samples:
                found.append(sample)
                if {x.q[0] for x in found} >= heard_of and len(found) > 30:
                    return found

    with (
        router(port) as one,
        router(port, "connect") as other,
        again_and_again(lambda: one.put(keys[0], first), lambda: other.put(keys[1], second)),
    ):
        samples = asyncio.run(listened())
    assert {sample.q[0] for sample in samples} == heard_of
    both = next((k for k, sample in enumerate(samples) if sample.q != samples[0].q), len(samples))
    assert all(("give the domain" in sample.reason) == doubted for sample in samples[both:])
    assert not any(sample.reason for sample in samples[:both])


def test_who_takes_the_place_of_another_is_relied_on_after_a_while():
    origins = rmw_zenoh.Origins()

    def doubt(t, origin, topic="/joint_states"):
        return origins.take(rmw_zenoh.Put(t, topic, b"", origin))

    assert not doubt(0.0, "a")
    assert "/joint_states is heard from two, a and b" in doubt(1.0, "b")
    assert doubt(1.1, "a", "/tf")  # what is known of the robot is of both topics
    assert doubt(1.0 + rmw_zenoh.ONE_ALONE, "b")
    assert not doubt(1.1 + rmw_zenoh.ONE_ALONE, "b")
    assert doubt(3.2, "a")


def test_a_frame_that_stays_is_not_relied_on_once_two_bridges_have_said_it(monkeypatch):
    """Also of a robot that stands switched off: its frames are there all the same."""
    monkeypatch.setattr(rmw_zenoh, "ONE_ALONE", 0.05)
    port, straight = free_port(), (1.0, 0.0, 0.0, 0.0)
    moves, own, foreign = (
        encode(Content.TF, (Transform(stamp, parent, child, (x, 0.0, 0.0), straight),), Edition.ROS2)
        for stamp, parent, child, x in (
            (1.0, "base_link", "link", 0.5), (None, "link", "tool0", 0.1), (None, "link", "tool0", 0.2),
        )
    )  # fmt: skip

    async def listened(send):
        found, sent = [], False
        tracked = source(port, content=Content.TF)
        async with asyncio.timeout(60), aclosing(tracked.listen(None)) as samples:
            async for sample in samples:
                found.append(sample)
                if len(found) > 10 and not sent:
                    sent = True
                    send()
                after = [x for x in found if math.isclose(x.position[0], 0.7)]
                if after and sample.t - after[0].t > 1.0:
                    return found, after

    with router(port) as one, router(port, "connect") as other:
        one.put("tf_static", own)
        with again_and_again(lambda: one.put("tf", moves), lambda: found or one.put("tf_static", own)):
            found = []

            def send():
                found.append("no more of it")
                time.sleep(0.1)
                other.put("tf_static", foreign)

            every, after = asyncio.run(listened(send))
    assert not every[0].reason
    assert all("/tf_static is heard from two" in sample.reason for sample in after)


def test_another_domain_is_not_heard_and_what_there_is_is_said(monkeypatch, caplog):
    monkeypatch.setattr("seerob.devices.ros.SILENCE", 0.5)
    with ZenohRouter(motion, NAMES, domain=7) as node:
        assert heard(source(node.port, domain=7), len)
        for more, said in (
            ({"domain": 6}, "nobody publishes /joint_states in domain 6; there is: nothing"),
            (
                {"domain": 7, "topic": "/other"},
                "nobody publishes /other in domain 7; there is: /joint_states",
            ),
            (
                {"domain": 7, "topic": "/joint_states", "content": Content.TF},
                "/joint_states is sensor_msgs/msg/JointState, no tf2_msgs/msg/TFMessage",
            ),
        ):
            listener = Listener(source(node.port, **more), None, lambda _: None)
            listener.start()
            wait_for(lambda said=said: said in caplog.text)
            listener.ask_to_stop()
            assert listener.join(10.0)


def test_a_router_that_is_restarted_is_heard_again(monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.005)
    samples = []
    node = ZenohRouter(motion, NAMES, port=free_port())
    listener = Listener(source(node.port), None, samples.append)
    listener.start()
    for k in range(3):
        with node:
            samples.clear()
            wait_for(lambda: len(samples) > 3)
        wait_for(lambda lost=k + 1: listener.statistics().losses >= lost)
    listener.ask_to_stop()
    assert listener.join(60.0)


def test_what_is_no_message_is_passed_over_and_too_much_of_it_ends_the_connection(monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.005)
    port, samples = free_port(), []
    good = encode(Content.JOINT_STATE, Joints(None, NAMES, (0.5, 0.25)), Edition.ROS2)
    key = rmw_zenoh.key("/joint_states", Content.JOINT_STATE.message_type, 0, JOINT_STATE_HASH)
    nonsense = [b"", b"\0", good[:-5], b"\xff" * 100, bytes(rmw_zenoh.MAX_MESSAGE + 1)]
    with router(port) as session:
        listener = Listener(source(port), None, samples.append)
        listener.start()

        def every():
            session.put(key, good)
            for raw in nonsense:
                session.put(key, raw)

        with again_and_again(every):
            wait_for(lambda: len(samples) > 20)
        losses = listener.statistics().losses
        assert all(sample.q == (0.5, 0.25) for sample in samples)
        with again_and_again(lambda: session.put(key, b"\1")):
            wait_for(lambda: listener.statistics().losses > losses)
        samples.clear()
        with again_and_again(lambda: session.put(key, good)):
            wait_for(lambda: samples)
        listener.ask_to_stop()
        assert listener.join(60.0)


@given(st.lists(st.text(alphabet="@ros2_lv/%0MPNS:,jd", max_size=80)))
def test_tokens_of_strangers_are_passed_over(tokens):
    of_publishers = [text for text in tokens if text.startswith("@ros2_lv/") and "/MP/" in text]
    assert len(rmw_zenoh.offered(tokens)) <= len(of_publishers)


def test_names_that_are_longer_than_any_are_not_listed():
    begin, kind = "@ros2_lv/0/a/0/1/MP/%/%/node", "std_msgs::msg::dds_::Bool_"
    for topic, type_, listed in (("%x", kind, 1), ("%" + "x" * 300, kind, 0), ("%x", "x" * 300, 0)):
        assert len(rmw_zenoh.offered([f"{begin}/{topic}/{type_}/hash/qos"])) == listed


def test_who_publishes_faster_than_is_read_fills_no_memory():
    async def flooded():
        port = free_port()
        with router(port) as session:
            async with rmw_zenoh.opened("127.0.0.1", port) as link:
                link.subscribe("/x", ["x"], kept=False)
                first = None
                while first is None:  # until the router knows of it
                    session.put("x", b"there")
                    with suppress(TimeoutError):
                        first = await link.next(0.2)
                raw, kept = bytes(rmw_zenoh.MAX_MESSAGE), zenoh.CongestionControl.BLOCK
                tracemalloc.start()
                try:
                    for k in range(40):
                        session.put("x", raw[: -k - 1], congestion_control=kept)
                    session.put("x", b"last", congestion_control=kept)
                    await asyncio.sleep(0.5)  # what is on its way comes, and nobody reads
                    while len((await link.next(5.0)).payload) != 4:
                        pass
                    return tracemalloc.get_traced_memory()[1]
                finally:
                    tracemalloc.stop()

    most = asyncio.run(flooded())
    assert rmw_zenoh.MOST_BYTES / 2 < most <= rmw_zenoh.MOST_BYTES + 4 * rmw_zenoh.MAX_MESSAGE
