"""Robots behind a Foxglove bridge: the server is Foxglove's own, out of its SDK."""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from contextlib import contextmanager

import foxglove
import numpy as np
import pytest
from foxglove import Channel, Context, Schema
from foxglove.messages import (
    FrameTransform,
    FrameTransforms,
    JointState,
    JointStates,
    Quaternion,
    Timestamp,
    Vector3,
)
from listening import heard

from free_ports import free_port
from live_story import wait_for
from seerob.app.emulators.rosbridge import document
from seerob.core.samples import JointSample, PoseSample
from seerob.devices.live.listening import Listener
from seerob.devices.sources.foxglove import Foxglove
from seerob.protocols.ros.ros_messages import Content, Edition, Joints, encode

NAMES = ("a", "b")
TURN = 0.3


def joints(t):
    return Joints(1000.0 + t, NAMES, (math.sin(t), math.cos(t)), (math.cos(t), -math.sin(t)))


def stamp(t):
    whole = int(1000.0 + t)
    return Timestamp(sec=whole, nsec=round((1000.0 + t - whole) * 1e9) % 1_000_000_000)


@contextmanager
def serving(*publish):
    """A server that publishes again and again until the end."""
    context = Context()
    server = foxglove.start_server(host="127.0.0.1", port=0, context=context)
    sends = [make(context) for make in publish]
    over = threading.Event()

    def work():
        begun = time.monotonic()
        while not over.wait(0.01):
            for send in sends:
                send(time.monotonic() - begun)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield server.port
    finally:
        over.set()
        thread.join()
        server.stop()


def ros(encoding):
    def make(context):
        schema = Schema(
            name="sensor_msgs/msg/JointState",
            encoding="ros1msg" if encoding == "ros1" else "ros2msg",
            data=b"string[] name",
        )
        channel = Channel("/joint_states", schema=schema, message_encoding=encoding, context=context)
        write = {
            "cdr": lambda t: encode(Content.JOINT_STATE, joints(t), Edition.ROS2),
            "ros1": lambda t: encode(Content.JOINT_STATE, joints(t), Edition.ROS1),
            "json": lambda t: json.dumps(document(joints(t), Edition.ROS2)).encode(),
        }[encoding]
        return lambda t: channel.log(write(t))

    return make


def protobuf(context):
    channel = foxglove.channels.JointStatesChannel("/joint_states", context=context)

    def send(t):
        said = joints(t)
        rows = zip(said.names, said.position, said.velocity, strict=True)
        listed = [JointState(name=n, position=q, velocity=v) for n, q, v in rows]
        channel.log(JointStates(timestamp=stamp(t), joints=listed))

    return send


def source(port, **more):
    return Foxglove(robot="arm", host="127.0.0.1", port=port, **more)


@pytest.mark.parametrize("make", [ros("cdr"), ros("ros1"), ros("json"), protobuf])
def test_joints_come_in_every_encoding(make):
    with serving(make) as port:
        for sample in heard(source(port), lambda s: len(s) > 3):
            assert isinstance(sample, JointSample)
            said = joints(sample.t_device - 1000.0)
            np.testing.assert_allclose(sample.q, said.position, atol=1e-6)
            np.testing.assert_allclose(sample.qd, said.velocity, atol=1e-6)


def edge(t, parent, child, x, yaw=0.0):
    turn = Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    place = Vector3(x=x, y=0.0, z=0.0)
    return FrameTransform(
        timestamp=stamp(t), parent_frame_id=parent, child_frame_id=child, translation=place, rotation=turn
    )


def one_by_one(context):
    channel = foxglove.channels.FrameTransformChannel("/tf", context=context)

    def send(t):
        channel.log(edge(t, "base_link", "wrist", 0.5, TURN))
        channel.log(edge(t, "wrist", "tool0", 0.2))

    return send


def together(context):
    channel = foxglove.channels.FrameTransformsChannel("/tf", context=context)
    return lambda t: channel.log(
        FrameTransforms(transforms=[edge(t, "base_link", "wrist", 0.5, TURN), edge(t, "wrist", "tool0", 0.2)])
    )


@pytest.mark.parametrize("make", [one_by_one, together])
def test_the_tool_comes_out_of_transforms(make):
    with serving(make) as port:
        sample = heard(source(port, content=Content.TF), len)[0]
    assert isinstance(sample, PoseSample)
    expected = (0.5 + 0.2 * math.cos(TURN), 0.2 * math.sin(TURN), 0)
    np.testing.assert_allclose(sample.position, expected, atol=1e-9)
    np.testing.assert_allclose(sample.wxyz, (math.cos(TURN / 2), 0, 0, math.sin(TURN / 2)), atol=1e-9)


@pytest.mark.parametrize(
    ("topic", "said"),
    [
        ("/nobody", "/nobody is not offered; there is: /joint_states"),
        ("/joint_states", "/joint_states is foxglove.JointStates as protobuf, which is no tf2_msgs"),
    ],
)
def test_what_is_not_offered_is_said(monkeypatch, caplog, topic, said):
    monkeypatch.setattr("seerob.devices.ros.SILENCE", 0.5)
    with serving(protobuf) as port:
        content = Content.JOINT_STATE if topic == "/nobody" else Content.TF
        listener = Listener(source(port, topic=topic, content=content), None, lambda _: None)
        listener.start()
        wait_for(lambda: said in caplog.text)
        listener.ask_to_stop()
        assert listener.join(10.0)


def test_a_bridge_that_is_restarted_is_heard_again(monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.005)
    samples = []
    context = Context()
    port, send = free_port(socket.SOCK_STREAM), protobuf(context)
    server = foxglove.start_server(host="127.0.0.1", port=port, context=context)
    listener = Listener(source(port), None, samples.append)
    listener.start()

    def spoken():
        send(time.monotonic() % 1000)
        return len(samples) > 3

    servers = [server]

    def begin_again(port):
        try:
            servers.append(foxglove.start_server(host="127.0.0.1", port=port, context=context))
        except RuntimeError:  # the last one still holds the address
            return False
        return True

    for k in range(3):
        wait_for(spoken)
        servers[-1].stop()
        # On a loaded machine what it said before is still being heard.
        wait_for(lambda lost=k + 1: listener.statistics().losses >= lost)
        wait_for(lambda: begin_again(port))
        samples.clear()
    wait_for(spoken)
    listener.ask_to_stop()
    assert listener.join(60.0)
    assert listener.statistics().losses >= 3
    servers[-1].stop()
