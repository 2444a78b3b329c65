"""Rokoko Studio's stream: the person who is heard is the one that was sent."""

import asyncio
import math

import lz4.frame
import msgspec
import numpy as np
import pytest

from free_ports import free_port
from seerob.app.emulation.mvn_person import animated
from seerob.app.emulators.rokoko import RokokoSender
from seerob.core.samples import Quality
from seerob.core.transforms import rotation_from_axis_angle, wxyz_from_rotation
from seerob.devices.sources.rokoko import Rokoko, remarks
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.rokoko import SEGMENTS, WORLD_FROM_UNITY, Actor, Scene, decode, encode
from sources.listening import by_name, heard


def some_actor(seed=1):
    rng = np.random.default_rng(seed)
    turns = rng.normal(size=(len(SEGMENTS), 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return Actor("Anna", rng.normal(size=(len(SEGMENTS), 3)), turns)


@pytest.mark.parametrize("version", ["2", "3"])
@pytest.mark.parametrize("compressed", [False, True])
def test_a_datagram_comes_back_as_it_was_sent(version, compressed):
    actor = some_actor()
    found = decode(encode(Scene(1.5, version, (actor,)), compressed=compressed))
    assert (found.t, found.version, found.actors[0].name) == (1.5, version, "Anna")
    np.testing.assert_allclose(found.actors[0].positions, actor.positions, atol=1e-12)
    np.testing.assert_allclose(found.actors[0].orientations, actor.orientations, atol=1e-12)


def test_a_three_with_its_persons_at_the_root_is_a_two():
    said = msgspec.json.decode(encode(Scene(1.0, "2", (some_actor(),))))
    found = decode(msgspec.json.encode({**said, "version": "3,0"}))
    assert found.version == "2"
    assert len(found.actors) == 1


def test_left_handed_rotations_become_right_handed_ones():
    # In Unity a turn by +90° about y (up) takes forward (z) to the right (x): seen from above, clockwise.
    half = math.sqrt(0.5)
    segment = {"position": {"x": 1, "y": 2, "z": 3}, "rotation": {"w": half, "x": 0, "y": half, "z": 0}}
    body = {"actors": [{"name": "a", "hip": segment}], "timestamp": 0, "version": 2}
    actor = decode(msgspec.json.encode(body)).actors[0]
    np.testing.assert_allclose(actor.positions[0], [3, -1, 2])
    clockwise = wxyz_from_rotation(rotation_from_axis_angle((0, 0, 1), -np.pi / 2))
    np.testing.assert_allclose(actor.orientations[0], clockwise, atol=1e-12)
    assert np.linalg.det(WORLD_FROM_UNITY) == pytest.approx(-1)


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"{}", "neither scene nor actors"),
        (b"\x04\x22\x4d\x18\x00", "LZ4"),
        (lz4.frame.compress(bytes(1 << 21)), "more than"),
        (lz4.frame.compress(b'{"actors": []}')[:-6], "LZ4"),
        (b"[" * 100_000, "Rokoko"),
        (b" " * (1 << 18), "bytes, more than"),
        (b'{"timestamp": 1, "actors": [{"hip": {"position": 7}}]}', "JSON"),
        (b'{"timestamp": 1, "actors": [{"name": "\xff"}]}', "Rokoko"),
    ],
)
def test_what_is_no_datagram_says_why(data, text):
    with pytest.raises(ProtocolError, match=text):
        decode(data)


@pytest.mark.parametrize(("version", "compressed"), [("3", False), ("2", True)])
def test_the_person_stands_where_it_was_sent_from(version, compressed):
    port, person = free_port(), animated("library:reach")
    source = Rokoko(human="anna", name="suit", port=port, timeout=1.0)
    sender = RokokoSender(
        {"Anna": person}, to=("127.0.0.1", port), version=version, compressed=compressed, rate=50
    )
    with sender:
        samples = heard(source, lambda s: len(s) >= 3)
        findings = asyncio.run(source.ask())
    sample = samples[-1]
    points, sent = by_name(sample), sender.scene(sample.t_device).actors[0]
    for name, point in points.items():
        np.testing.assert_allclose(point.position, sent.positions[SEGMENTS.index(name)], atol=1e-9)
    assert 0.7 < points["hip"].position[2] < 1.1
    assert sample.quality is Quality.GOOD
    assert f"version {version}" in findings[0].text
    assert any(f.level == "assumed" and "left-handed" in f.text for f in findings)


def test_who_is_not_there_or_one_of_several_is_said():
    two = [Scene(1.0, "3", (some_actor(), Actor("Berta", *[some_actor().positions] * 2)))]
    assert any("several persons (Anna, Berta)" in text for _, text in remarks(two, ""))
    assert any("nobody is called 'Carl'" in text for _, text in remarks(two, "Carl"))
    assert any("nobody is in the stream" in text for _, text in remarks([Scene(1.0, "3", ())], ""))
