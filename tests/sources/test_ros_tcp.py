"""Unity's ROS-TCP wire, both sides on real sockets, and its frames as they were seen on a real endpoint."""

from __future__ import annotations

import socket
import struct
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from listening import heard

from free_ports import free_port
from live_story import wait_for
from seerob.app.commands.emulate import options_of
from seerob.app.emulators.ros_tcp import RosTcpEndpoint, UnityProject
from seerob.core.errors import InputError
from seerob.core.samples import PoseSample
from seerob.devices.live.listening import Listener
from seerob.devices.sources.ros_tcp import RosTcp, Side
from seerob.protocols import ProtocolError
from seerob.protocols.ros import ros_tcp
from seerob.protocols.ros.ros_messages import Content, Edition, Joints, Transform, decode, encode
from seerob.protocols.ros.ros_tcp import Frame, Splitter

NAMES = ("a", "b", "c")


def motion(t):
    q = np.array([1.0, 2.0, 3.0]) * np.sin(t)
    return tuple(q.tolist()), tuple((np.array([1.0, 2.0, 3.0]) * np.cos(t)).tolist())


def check(samples, epoch):
    for sample in samples:
        q, qd = motion(sample.t_device - epoch)
        np.testing.assert_allclose(sample.q, q, atol=2e-6)
        np.testing.assert_allclose(sample.qd, qd, atol=2e-6)


@pytest.mark.parametrize("edition", list(Edition))
def test_an_endpoint_is_read(edition):
    with RosTcpEndpoint(motion, NAMES, edition=edition) as server:
        said = RosTcp(robot="arm", host="127.0.0.1", port=server.port)
        check(heard(said, lambda s: len(s) > 5), server.epoch)


@pytest.mark.parametrize("edition", list(Edition))
def test_unity_connects_to_us_and_may_come_back(edition):
    port = free_port(socket.SOCK_STREAM)
    said = RosTcp(robot="arm", side=Side.ENDPOINT, port=port, edition=edition)
    project = UnityProject(motion, NAMES, port=port).start()
    samples = []
    listener = Listener(said, None, samples.append)
    listener.start()
    try:
        for _ in range(2):
            wait_for(lambda: len(samples) > 5)
            check(samples[:5], project.epoch)
            project.stop()
            samples.clear()
            project.start()
        # It took the serialisation from our handshake.
        wait_for(lambda: len(samples) > 5)
        assert project.edition is edition
    finally:
        listener.ask_to_stop()
        assert listener.join(10.0)
        project.stop()


def test_transforms_come_too():
    def edges(t):
        return (Transform(1000.0 + t, "base_link", "tool0", (t, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),)

    more = {"/tf": (Content.TF, edges), "/tf_static": (Content.TF, lambda t: ())}
    with RosTcpEndpoint(motion, NAMES, more=more) as server:
        sample = heard(RosTcp(robot="arm", host="127.0.0.1", port=server.port, content=Content.TF), len)[0]
    assert isinstance(sample, PoseSample)
    assert sample.position[0] == pytest.approx(sample.t_device - 1000.0, abs=1e-6)


def test_what_the_endpoint_refuses_is_said(caplog):
    with RosTcpEndpoint(motion, NAMES) as server:
        said = RosTcp(robot="arm", host="127.0.0.1", port=server.port, topic="/nobody")
        listener = Listener(said, None, lambda _: None)
        listener.start()
        wait_for(lambda: "Failed to resolve message name" in caplog.text)
        listener.ask_to_stop()
        assert listener.join(10.0)


def test_a_side_without_what_it_needs_is_an_error(tmp_path):
    for wrong in (RosTcp(robot="arm"), RosTcp(robot="arm", side=Side.ENDPOINT, host="h")):
        with pytest.raises(InputError, match="a client needs the endpoint's address"):
            wrong.open(tmp_path, None)


# -- frames -------------------------------------------------------------------------------------


def test_the_handshake_of_a_real_endpoint_is_ours_byte_for_byte():
    body = b'{"version": "v0.7.0", "metadata": "{\\"protocol\\": \\"ROS1\\"}"}'
    seen = struct.pack("<I", 11) + b"__handshake" + struct.pack("<I", len(body)) + body
    assert ros_tcp.handshake(Edition.ROS1) == seen
    (frame,) = Splitter().feed(seen)
    assert ros_tcp.edition_of(frame) is Edition.ROS1


def test_joints_of_ros_1_are_serialised_as_its_wiki_says():
    said = Joints(5.25, ("j1", "j2"), (0.5, -0.5))
    written = struct.pack("<IIII", 0, 5, 250_000_000, 0)  # seq, stamp, empty frame_id
    written += struct.pack("<I", 2) + b"".join(struct.pack("<I", 2) + n for n in (b"j1", b"j2"))
    written += struct.pack("<I2d", 2, 0.5, -0.5) + struct.pack("<II", 0, 0)
    assert encode(Content.JOINT_STATE, said, Edition.ROS1) == written
    assert decode(Content.JOINT_STATE, written, Edition.ROS1) == said


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.text(st.characters(codec="ascii", min_codepoint=33), max_size=20), st.binary(max_size=60)
        )
    ),
    st.lists(st.integers(0, 3000), max_size=8),
)
def test_frames_come_out_however_the_stream_is_cut(frames, cuts):
    stream = b"".join(ros_tcp.pack(name, body) for name, body in frames)
    edges = [0, *sorted(min(c, len(stream)) for c in cuts), len(stream)]
    splitter = Splitter()
    found = [f for a, b in pairwise(edges) for f in splitter.feed(stream[a:b])]
    # An empty frame says only that somebody is there.
    assert found == [Frame(n, b) for n, b in frames if n or b]


def test_hostile_lengths_are_refused_before_anything_is_kept():
    for wrong in (b"\xff\xff\xff\xff", struct.pack("<I", 1) + b"/" + b"\xff\xff\xff\x7f"):
        with pytest.raises(ProtocolError, match="is that ROS-TCP"):
            Splitter().feed(wrong)


# -- as a user starts it ------------------------------------------------------------------------


def asked(*arguments):
    return options_of("ros_tcp", ["--robot", "ur10", *arguments]).ready()


def test_an_emulated_endpoint_and_an_emulated_unity_project_are_heard():
    server, what, *_ = asked("--port", "0")
    assert what == "ur10, a calm swing"
    with server:
        samples = heard(RosTcp(robot="arm", host="127.0.0.1", port=server.port), lambda s: len(s) > 2)
    assert {len(s.q) for s in samples} == {6}
    port = free_port(socket.SOCK_STREAM)
    project, what, where, *_ = asked("--unity", "127.0.0.1", "--port", str(port))
    assert (what, where) == ("a Unity project, ur10, a calm swing", f"127.0.0.1:{port}")
    with project:
        samples = heard(RosTcp(robot="arm", side=Side.ENDPOINT, port=port), lambda s: len(s) > 2)
    assert {len(s.q) for s in samples} == {6}


@pytest.mark.parametrize("wrong", [("--rate", "0"), ("--rate", "nan"), ("--unity", "here", "--port", "0")])
def test_what_cannot_be_emulated_is_refused(wrong):
    with pytest.raises(InputError, match=wrong[-2].replace("--unity", "--port")):
        asked(*wrong)
