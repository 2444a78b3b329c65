"""VRPN over TCP: the bytes, and a server on a real socket."""

import asyncio
import socket
import struct
import threading

import numpy as np
import pytest

from seerob.app.emulation.mvn_person import animated
from seerob.app.emulators.vive import FIVE, WORN
from seerob.app.emulators.vrpn import VrpnServer
from seerob.core.samples import Quality
from seerob.devices.sources.vrpn import Vrpn, names_of
from seerob.files.motion_capture.upright import Up
from seerob.protocols import ProtocolError
from seerob.protocols.tracking import mvn_pose, vrpn
from sources.listening import by_name, heard

PERSON = animated("library:reach")


def source(port, **more):
    return Vrpn(host="127.0.0.1", port=port, human="anna", name="tracker", timeout=1.0, **more)


def test_the_first_message_of_a_server():
    # 0x29 = 24 + 17 bytes, which take 48 on the wire.
    data = vrpn.describe(vrpn.SENDER_DESCRIPTION, 0, b"VRPN Control")
    assert struct.unpack(">i", data[:4])[0] == 0x29
    assert len(data) == 48
    reader = vrpn.Reader()
    (message,) = vrpn.Splitter().feed(data)
    assert reader.take(message) is None
    assert reader.senders == {0: "VRPN Control"}


def test_a_stream_in_any_pieces_is_the_same_stream():
    made = VrpnServer(PERSON, {role: WORN[role] for role in FIVE}, port=0)
    stream = made.names() + made.instant(0.5) + made.instant(0.75)
    rng = np.random.default_rng(3)
    whole = vrpn.Splitter().feed(stream)
    splitter, found, at = vrpn.Splitter(), [], 0
    while at < len(stream):
        size = int(rng.integers(1, 60))
        found += splitter.feed(stream[at : at + size])
        at += size
    assert found == whole
    reader = vrpn.Reader()
    poses = [pose for message in whole if (pose := reader.take(message)) is not None]
    assert [pose.tracker for pose in poses] == [*FIVE, *FIVE]
    assert poses[-1].t == pytest.approx(0.75)
    row = mvn_pose.SEGMENTS.index(WORN["right_hand"])
    np.testing.assert_array_equal(poses[-1].position, PERSON(0.75).positions[row])


@pytest.mark.parametrize("length", [-1, 0, 23, 1 << 30])
def test_lengths_that_cannot_be_are_refused(length):
    with pytest.raises(ProtocolError, match="bytes"):
        vrpn.Splitter().feed(vrpn.HEADER.pack(length, 0, 0, 0, 0, 0))


def test_too_many_names_are_refused():
    reader = vrpn.Reader()
    names = b"".join(vrpn.describe(vrpn.SENDER_DESCRIPTION, k, b"x") for k in range(vrpn.MOST_NAMES + 1))
    *before, last = vrpn.Splitter().feed(names)
    for message in before:
        assert reader.take(message) is None
    with pytest.raises(ProtocolError, match="names"):
        reader.take(last)


@pytest.mark.parametrize("units", [1.0, 1000.0])
def test_trackers_are_where_they_were_sent_from(units):
    with VrpnServer(PERSON, {role: WORN[role] for role in FIVE}, port=0, rate=50, units=units) as made:
        listened = source(made.port, unit="m" if units == 1 else "mm", up=Up.Z)
        samples = heard(listened, lambda s: len(s) >= 3)
        findings = asyncio.run(listened.ask())
    points = by_name(samples[-1])
    assert set(points) == set(FIVE)
    sent = PERSON(samples[-1].t_device)
    for role, point in points.items():
        row = mvn_pose.SEGMENTS.index(WORN[role])
        np.testing.assert_allclose(point.position, sent.positions[row], atol=1e-9)
    assert samples[-1].quality is Quality.GOOD
    assert "waist" in findings[0].text
    assert not any("z is up" in f.text for f in findings)


def test_names_at_the_server_are_given_places():
    with VrpnServer(PERSON, {"Tracker0": "Pelvis"}, port=0, rate=50) as made:
        listened = source(made.port, trackers={"Tracker0": "waist", "Tracker9": "chest"})
        samples = heard(listened, lambda s: len(s) >= 1)
        findings = asyncio.run(listened.ask())
    assert samples[0].points[0].bone == "pelvis"
    text = " ".join(f.text for f in findings)
    assert "not heard: Tracker9" in text
    assert "z is up" in text


def test_a_tracker_with_several_sensors_has_numbers():
    assert names_of([("a", 0), ("b", 0), ("b", 1)]) == {("a", 0): "a", ("b", 0): "b/0", ("b", 1): "b/1"}


@pytest.mark.parametrize(
    ("answer", "text"), [(b"SSH-2.0-OpenSSH_9.2 and more", "begins with 'SSH"), (b"short", "closed")]
)
def test_another_server_is_named(answer, text):
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def speak():
            link, _ = listening.accept()
            with link:
                link.recv(24)
                link.sendall(answer)

        thread = threading.Thread(target=speak)
        thread.start()
        with pytest.raises(ProtocolError, match=text):
            asyncio.run(source(listening.getsockname()[1]).ask())
        thread.join()
