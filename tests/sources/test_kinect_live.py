"""A depth camera's sender on real sockets: the person who is heard is the one that was sent."""

import asyncio
import time
from dataclasses import replace

import numpy as np
import pytest

import seerob as sr
from free_ports import free_port
from reached import reached
from seerob.app.emulators.kinect import CAMERA, KinectSender, animated
from seerob.core.errors import InputError
from seerob.core.samples import Quality
from seerob.core.transforms import wxyz_from_rotation
from seerob.devices.live.listening import Listener
from seerob.devices.sources.kinect import Kinect, Link, remarks
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.kinect import (
    BODY_FROM_OPTICAL,
    NONSENSE,
    Body,
    Picture,
    Sieve,
    decode_message,
    encode_message,
)
from seerob.session.opening import open_sources
from seerob.workstation.workstation import Pose

PATIENCE = 120.0
AT = Pose(position=tuple(CAMERA[:3, 3]), wxyz=tuple(wxyz_from_rotation(CAMERA[:3, :3])))


def sender(link, scene, **more):
    if link is Link.UDP:
        port = free_port()
        return KinectSender(scene, to=("127.0.0.1", port), **more), port
    made = KinectSender(scene, to=None, port=0, **more)
    return made, None


def heard(source, enough):
    """Samples until there are enough of them."""
    samples = []
    listener = Listener(source, None, samples.append)
    listener.start()
    end = time.monotonic() + PATIENCE
    while not enough(samples) and time.monotonic() < end:
        time.sleep(0.01)
    listener.ask_to_stop()
    assert listener.join(PATIENCE)
    assert enough(samples)
    return samples


def source(port, link=Link.UDP, **more):
    more = {"at": AT, "human": "anna", "name": "camera", "timeout": 1.0} | more
    return Kinect(host="127.0.0.1", port=port, link=link, **more)


def test_a_sender_without_confidences_says_what_that_means():
    places = np.random.default_rng(1).uniform(1, 2, (32, 3))
    for confidence, said in ((None, True), (np.ones(32), False)):
        picture = Picture(t=0.0, bodies=(Body(1, places, None, confidence),))
        found = [text for level, text in remarks([picture], AT) if level == "assumed"]
        assert any("the tracker only predicts count as seen" in text for text in found) is said


@pytest.mark.parametrize("link", list(Link))
def test_the_person_stands_where_it_was_sent_from(link):
    made, port = sender(link, animated("library:reach"))
    with made:
        # A packet that was held up leaves the clock to be found for a while longer.
        samples = heard(
            source(port or made.port, link), lambda s: len(s) >= 5 and s[-1].quality is Quality.GOOD
        )
        findings = asyncio.run(source(port or made.port, link).ask())
    points = {p.name: p for p in samples[-1].points}
    feet = np.array([points[f"FOOT_{side}"].position for side in ("LEFT", "RIGHT")])
    # Turned and moved into the world: on the floor, below the head.
    assert np.all(np.abs(feet[:, 2]) < 0.1)
    assert 1.4 < points["HEAD"].position[2] < 1.8
    assert samples[-1].quality is Quality.GOOD
    steps = np.diff([s.t_device for s in samples])
    assert np.all(steps > 0)
    text = " ".join(f.text for f in findings)
    assert "depth camera emulated" in text
    assert "at agrees to 0.0°" in text


def test_nobody_in_the_picture_is_heard_as_nobody():
    walk = animated("library:reach")

    def scene(t):
        return walk(t) if t < 0.2 else replace(walk(t), bodies=())

    made, port = sender(Link.UDP, scene)
    with made:
        samples = heard(source(port), lambda s: any(x.quality is Quality.INVALID for x in s))
    assert all(p.position is None for p in samples[-1].points)


def test_damaged_late_and_doubled_messages_are_left_out():
    def way(message):
        return [message[: len(message) // 2], b"\xff\x00", message, message]

    made, port = sender(Link.UDP, animated("library:reach"), way=way)
    with made:
        samples = heard(source(port), lambda s: len(s) >= 5)
    assert np.all(np.diff([s.t_device for s in samples]) > 0)


def test_only_nonsense_is_given_up():
    sieve = Sieve()
    for _ in range(NONSENSE - 1):
        assert sieve.take(b"{}") is None
    with pytest.raises(ProtocolError, match="not a frame of body tracking"):
        sieve.take(b"{}")


def test_a_camera_that_starts_again_is_noticed():
    sieve = Sieve()
    assert sieve.take(encode_message(Picture(t=100.0, bodies=()))) is not None
    assert sieve.take(encode_message(Picture(t=99.5, bodies=()))) is None
    with pytest.raises(ProtocolError, match="started again"):
        sieve.take(encode_message(Picture(t=1.0, bodies=())))


def test_a_message_comes_back_as_it_was_sent():
    rng = np.random.default_rng(4)
    wxyz = rng.normal(size=(32, 4))
    wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
    positions = rng.normal(size=(32, 3))
    positions[3] = np.nan
    body = Body(12, positions, wxyz, rng.choice([0.0, 1.0], 32))
    up = np.array([0.6, 0.0, 0.8])
    sent = Picture(t=1.25, bodies=(body,), frame=7, camera="x", up=up)
    found = decode_message(encode_message(sent))
    np.testing.assert_allclose(found.bodies[0].positions, positions, atol=1e-5)
    np.testing.assert_allclose(found.bodies[0].orientations, wxyz, atol=2e-6)
    np.testing.assert_array_equal(found.bodies[0].confidence, body.confidence)
    np.testing.assert_allclose(found.up, up, atol=1e-9)
    assert (found.t, found.frame, found.camera, found.bodies[0].id) == (1.25, 7, "x", 12)


def test_the_optical_frame_of_a_level_camera():
    # Right is not left, down is not up, forward is x.
    np.testing.assert_array_equal(BODY_FROM_OPTICAL @ [1, 0, 0], [0, -1, 0])
    np.testing.assert_array_equal(BODY_FROM_OPTICAL @ [0, 1, 0], [0, 0, -1])
    np.testing.assert_array_equal(BODY_FROM_OPTICAL @ [0, 0, 1], [1, 0, 0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seerob": "kinect/9"}, "version 'kinect/9'"),
        ({"num_bodies": 2}, "num_bodies is 2"),
        ({"timestamp_usec": -1}, ">= 0"),
        ({"bodies": [{"body_id": 1, "joint_positions": [[0, 0, 0]]}], "num_bodies": 1}, "1 joint_positions"),
    ],
)
def test_what_is_wrong_with_a_message_is_said(change, message):
    import msgspec

    data = msgspec.json.decode(encode_message(Picture(t=1.0, bodies=()))) | change
    with pytest.raises(ProtocolError, match=message):
        decode_message(msgspec.json.encode(data))


def test_a_camera_without_a_place_is_named_by_its_table(tmp_path):
    """The file, and which of its sources: the source knows neither."""
    (tmp_path / "workstation.toml").write_text(
        '[[humans]]\nname = "eva"\nstature = 1.7\nmass = 65\nsex = "female"\n'
        '[[sources]]\nkind = "kinect"\nhuman = "eva"\n'
    )
    with pytest.raises(InputError) as caught:
        open_sources(sr.load(tmp_path).model)
    (problem,) = caught.value.problems
    assert (problem.file, problem.key) == ("workstation.toml", "sources[0].at")


def test_what_must_be_given_is_asked(tmp_path):
    with pytest.raises(InputError, match="where the camera stands"):
        source(9, at=Pose()).open(tmp_path, None)
    with pytest.raises(InputError, match="no address to connect to"):
        Kinect(human="a", link=Link.WEBSOCKET, at=AT).open(tmp_path, None)
    with pytest.raises(InputError, match="is no number of a body"):
        source(9, subject="anna").open(tmp_path, None)


def test_a_sender_that_is_not_there_is_a_warning_not_an_end(tmp_path):
    (warning,) = (f for f in reached(source(free_port()), tmp_path, None) if f.level == "warning")
    assert "not reached at start: nothing came to port" in warning.text
