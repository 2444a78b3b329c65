"""Visitors of a run, in the replay of its recording: who was there, where, and how they were called."""

import numpy as np
import pytest
from mcap.reader import make_reader
from msgspec.structs import replace

from seerob.app.server.access import Visits
from seerob.app.server.player import Player, there_at
from seerob.app.server.serving import Server
from seerob.core.snapshot import Command, Introduction, Presences, VisitorPresence
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.format import Visitor
from seerob.recording.recording import Recording
from server.frames import MESHES, scene, snapshot
from server.test_company import Guest

NAN = [np.nan] * 7


def seen(number, head, hand=None):
    poses = np.array([head, NAN, hand or NAN], "<f4")
    laser = np.array([[0, 0, 1], [1, 0, 1]], "<f4")
    points = np.array([[1, 2, 3]], "<f4")
    return VisitorPresence(id=number, poses=poses.tobytes(), points=points.tobytes(), laser=laser.tobytes())


HEAD, LATER = [1, 2, 1.7, 1, 0, 0, 0], [1.5, 2, 1.7, 1, 0, 0, 0]
HAND = [1, 2.3, 1.1, 1, 0, 0, 0]


def recorded(folder, *, names):
    """A second: one comes at 0.1 s, moves at 0.3 s, another comes at 0.5 s, the first leaves at 0.7 s."""
    visits = Visits()
    visits.names = names
    there = {}

    def come(number, name):
        there[number] = visits.come("track", "192.0.2.7", number)
        there[number].introduce(Introduction(name=name, device="vr", human="operator", scale=2.0))

    doings = {
        10: lambda: (come(1, "Ada"), visits.see(Presences(visitors=(seen(1, HEAD, HAND),)))),
        30: lambda: visits.see(Presences(visitors=(seen(1, LATER),))),
        50: lambda: (come(2, "Bob"), visits.see(Presences(visitors=(seen(1, LATER), seen(2, HEAD))))),
        70: lambda: (there[1].leave(), visits.see(Presences(visitors=(seen(2, HEAD),)))),
    }
    with Recorder().open(scene(), MESHES, {}, folder) as writer:
        writer.watch(visits)
        for k in range(100):
            doings.get(k, lambda: None)()
            writer.write(snapshot(k), ())
    return folder / "run.mcap"


def at(recording, t):
    """Who is there [s], and the poses of heads and hands, by number."""
    player = Player(recording)
    infos, presences = player._recalled(recording, t)
    return {info.id: info for info in infos}, {one.id: one for one in presences}


def test_who_was_there_and_where_at_each_instant(tmp_path):
    recording = Recording.open(recorded(tmp_path, names=False))
    assert at(recording, 0.05) == ({}, {})
    infos, presences = at(recording, 0.2)
    assert set(infos) == set(presences) == {-1}
    assert presences[-1] == replace(seen(1, HEAD, HAND), id=-1)
    told = infos[-1]
    assert (told.role, told.device, told.human, told.scale, told.recorded) == (
        "operator", "vr", "operator", 2.0, True,
    )  # fmt: skip
    assert told.name == "visitor 1"
    _, presences = at(recording, 0.4)
    np.testing.assert_allclose(np.frombuffer(presences[-1].poses, "<f4")[:3], LATER[:3])
    assert set(at(recording, 0.6)[0]) == {-1, -2}
    infos, presences = at(recording, 0.99)
    assert set(infos) == set(presences) == {-2}


def test_names_are_there_only_where_they_were_recorded(tmp_path):
    recording = Recording.open(recorded(tmp_path, names=True))
    assert at(recording, 0.6)[0][-1].name == "Ada"


def test_whoever_looks_at_the_replay_sees_them_and_is_told_apart(tmp_path):
    recording = Recording.open(recorded(tmp_path, names=False))
    player = Player(recording)
    with Server(scene=recording.scene, meshes=MESHES, feed=player, port=0) as server, Guest(server) as guest:
        guest.say(Command(action="seek", value=0.6))
        others = guest.others(lambda every: {-1, -2} <= set(every))
        assert {number for number, one in others.items() if not one.recorded} == {guest.hello.visitor}
        told = guest.sees(lambda every: {-1, -2} <= set(every))
        assert told[-2].poses == seen(2, HEAD).poses
        guest.say(Command(action="seek", value=0.9))
        assert set(guest.others(lambda every: -1 not in every)) == {-2, guest.hello.visitor}


@pytest.mark.parametrize(
    "wrong",
    [
        b"{",
        b'{"visitors": [{"id": 1, "head": [1, 2]}]}',
        b'{"visitors": [{"id": 1, "head": [1e9, 0, 0, 1, 0, 0, 0]}]}',
    ],
)
def test_a_recording_that_says_nonsense_shows_nobody_there(wrong):
    class Odd:
        scene = scene()
        start = end = 0.0

        def visits(self):
            return ((0.0, Visitor(event="came", role="view", address="", since="", id=1)),)

        def presences_at(self, t):
            return wrong

        def snapshots(self, start=None, end=None):
            yield snapshot(0)

        def snapshot_at(self, t):
            return snapshot(0)

    assert Player(Odd())._recalled(Odd(), 0.0)[1] == ()


def test_strangers_and_the_refused_are_nobody():
    refused = Visitor(event="refused", role="none", address="192.0.2.1", since="", id=0)
    assert there_at([(0.0, refused)], 1.0) == ()


def test_the_topic_holds_what_the_replay_shows(tmp_path):
    path = recorded(tmp_path, names=False)
    with path.open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert {"/visitors", "/presences"} <= topics
