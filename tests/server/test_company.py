"""Visitors who see each other: roles, presence, what they hold, and those who stall or are killed."""

import os
import signal
import subprocess
import sys
import threading
from contextlib import ExitStack
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from live_story import wait_for
from seerob.app.server.access import Role, Tokens
from seerob.app.server.company import COLORS, FARTHEST, LONGEST_NAME, MOST_POINTS, SHAPES, place_mistake
from seerob.app.server.desk import changed_entries
from seerob.app.server.hub import LARGEST
from seerob.app.server.live import Live
from seerob.app.server.player import Player
from seerob.app.server.serving import Server
from seerob.core.plugin import kind_of
from seerob.core.snapshot import Hello, Hold, Introduction, Presence, Presences, Snapshot, Visitors
from seerob.session.reading import read
from server.frames import MESHES, Remembered, Visitor, scene, snapshot

TOKENS = Tokens.made()
_encode = msgspec.msgpack.encode


def presence(x=0.0, hands=True, **more):
    """The head at (x, 0, 1.7), the hands below it."""
    rows = [[x, 0, 1.7, 1, 0, 0, 0], [x, 0.3, 1, 1, 0, 0, 0], [x, -0.3, 1, 1, 0, 0, 0]]
    if not hands:
        rows[1:] = [[np.nan] * 7] * 2
    return Presence(poses=np.array(rows, "<f4").tobytes(), **more)


def head(seen):
    return np.frombuffer(seen.poses, "<f4")[:3]


class Guest(Visitor):
    """A visitor who says who they are."""

    def __init__(self, server, role="", introduce=True, **said):
        super().__init__(server, path=f"/ws?token={getattr(TOKENS, role)}" if role else "/ws")
        self.hello = self.of(Hello)
        if introduce:
            self.say(Introduction(**said))

    def say(self, message):
        self.socket.send(_encode(message))

    def others(self, accept=lambda every: True):
        """Who is there, by number, as soon as that is as wanted."""
        told = self.until(
            lambda m: isinstance(m, Visitors) and accept({v.id: v for v in m.visitors})
        ).visitors
        return {visitor.id: visitor for visitor in told}

    def sees(self, accept):
        """Where visitors are, by number, as soon as that is as wanted."""
        told = self.until(
            lambda m: isinstance(m, Presences) and accept({v.id: v for v in m.visitors})
        ).visitors
        return {visitor.id: visitor for visitor in told}


@pytest.fixture
def server():
    feed = Player(Remembered([snapshot(k) for k in range(100)]))
    with Server(scene=scene(), meshes=MESHES, feed=feed, port=0, tokens=TOKENS) as server:
        yield server


def test_who_comes_later_sees_who_is_there_and_where(server):
    said = Introduction(
        name="Anna", color="#123456", shape="box", device="vr", scale=10.0, position=(1.0, 2.0, 0.0)
    )
    with Guest(server, "track", introduce=False) as first:
        first.say(said)
        first.say(presence(3.0, points=bytes(24), laser=bytes(24)))
        first.sees(lambda every: first.hello.visitor in every)
        with Guest(server, "view") as late:
            known = late.others()[first.hello.visitor]
            assert (known.name, known.color, known.shape, known.device) == ("Anna", "#123456", "box", "vr")
            assert (known.role, known.scale, known.position) == ("operator", 10.0, (1.0, 2.0, 0.0))
            seen = late.sees(lambda every: first.hello.visitor in every)[first.hello.visitor]
            np.testing.assert_array_equal(head(seen), np.float32([3, 0, 1.7]))
            assert (len(seen.points), len(seen.laser)) == (24, 24)
            number = late.hello.visitor
            other = first.others(lambda every: number in every and every[number].introduced)[number]
            assert (other.role, other.introduced, other.name) == ("viewer", True, f"visitor {other.id}")
            assert other.color in COLORS
            assert other.shape in SHAPES
        assert set(first.others(lambda every: len(every) == 1)) == {first.hello.visitor}


def test_a_third_sees_the_visitors_of_both_places_and_each_of_them_is_told_of_the_other():
    """The headsets that the cell of two places asks for, beside a page that somebody opens."""
    cell = read(Path(__file__).parents[2] / "workstations/two_places")
    headsets = [each for each in cell.emulators if kind_of("emulators", each) == "headset"]
    feed = Player(Remembered([snapshot(k) for k in range(100)]))
    with Server(scene=scene(), meshes=MESHES, feed=feed, port=0) as server, ExitStack() as until_the_end:
        heard = []
        for each in headsets:
            visitor = until_the_end.enter_context(
                replace(each, port=server.port, file="library:reach").ready().server
            )
            heard.append(visitor)
        with Guest(server, name="C") as third:
            known = third.others(lambda every: {"A", "B", "C"} <= {v.name for v in every.values()})
            by_name = {v.name: v for v in known.values()}
            assert (by_name["A"].device, by_name["A"].scale) == ("ar", 1.0)
            assert (by_name["B"].device, by_name["B"].scale) == ("vr", 0.1)
            ids = {by_name[name].id for name in "AB"}
            seen = third.sees(lambda every: ids <= every.keys())
            # Heads are above the floor of each room, as large as each is: 1.7 m, and a tenth of that.
            tall = {name: head(seen[by_name[name].id])[2] - by_name[name].position[2] for name in "AB"}
            assert 1.4 < tall["A"] < 1.9
            assert tall["B"] == pytest.approx(0.1 * tall["A"], rel=0.1)
            wait_for(lambda: all({"A", "B", "C"} <= set(visitor.others) for visitor in heard))


def test_numbers_are_given_once_and_presence_goes_with_whoever_leaves(server):
    with Guest(server, "view") as witness:
        numbers = set()
        for _ in range(3):
            with Guest(server, "view") as guest:
                guest.say(presence())
                witness.sees(lambda every, guest=guest: guest.hello.visitor in every)
                numbers.add(guest.hello.visitor)
            witness.sees(lambda every: not every)
        assert len(numbers) == 3


def test_a_program_that_says_nothing_is_listed_and_told_nothing(server):
    with Guest(server, "view", introduce=False) as program, Guest(server, "view") as witness:
        known = witness.others()[program.hello.visitor]
        assert (known.introduced, known.device) == (False, "program")
        for x in range(20):
            witness.say(presence(float(x)))
        witness.sees(lambda every: True)
        program.ask("seek", 0.5)  # whatever was to be told before is told before the answer
        heard = []
        program.until(lambda m: heard.append(type(m)) or (type(m).__name__ == "Transport" and len(heard) > 3))
        assert not {Visitors, Presences} & set(heard)


def test_a_viewer_who_would_be_a_person_is_a_viewer_and_nobody_notices(server):
    with Guest(server, "control") as supervisor, Guest(server, "view", human="operator") as viewer:
        number = viewer.hello.visitor
        known = supervisor.others(lambda every: number in every and every[number].introduced)
        assert known[viewer.hello.visitor].human == ""
        assert known[viewer.hello.visitor].role == "viewer"
        assert known[supervisor.hello.visitor].role == "supervisor"
        viewer.say(Hold(names=("r",)))
        viewer.ask("seek", 0.7)
        viewer.say(presence())
        supervisor.sees(lambda every: viewer.hello.visitor in every)
        assert known[viewer.hello.visitor].holds == ()
    server.stop()
    events = server.visits.take(end=True)
    refused = next(v.refused for v in events if v.role == "view" and v.event == "left")
    assert refused == {"to be a person": 1, "hold": 1, "seek": 1}
    assert next(v.refused for v in events if v.role == "control" and v.event == "left") == {}


@pytest.mark.parametrize(
    "wrong",
    [
        {"name": "n" * (LONGEST_NAME + 1)},
        {"color": "red"},
        {"color": "#12345G"},
        {"shape": "dragon"},
        {"device": "toaster"},
        {"scale": 0.0},
        {"scale": -1.0},
        {"scale": float("nan")},
        {"scale": 1e9},
        {"position": (float("nan"), 0.0, 0.0)},
        {"position": (1e9, 0.0, 0.0)},
        {"turn": (2.0, 0.0, 0.0, 0.0)},
        {"turn": (float("inf"), 0.0, 0.0, 0.0)},
    ],
)
def test_an_introduction_that_cannot_be_ends_the_connection(server, wrong):
    with Guest(server, "view", **wrong) as guest:
        assert guest.end()[0] == 1007


@pytest.mark.parametrize(
    "wrong",
    [
        Presence(poses=b""),
        presence(points=bytes(13)),
        presence(points=bytes(12 * (MOST_POINTS + 1))),
        presence(laser=bytes(12)),
    ],
)
def test_a_presence_of_the_wrong_length_ends_the_connection(server, wrong):
    with Guest(server, "view") as guest:
        guest.say(wrong)
        assert guest.end()[0] == 1007


@pytest.mark.parametrize("wrong", [np.inf, -np.inf, 1e9, np.nan])
def test_a_pose_that_cannot_be_is_refused_and_said_and_nobody_sees_it(server, wrong):
    with Guest(server, "view") as witness, Guest(server, "track") as guest:
        guest.say(presence(1.0))
        guest.say(presence(wrong))
        guest.say(presence(2.0))
        xs = []
        witness.sees(
            lambda every: (
                guest.hello.visitor in every
                and xs.append(float(head(every[guest.hello.visitor])[0])) is None
                and xs[-1] == 2.0
            )
        )
        assert set(xs) <= {1.0, 2.0}
    server.stop()
    refused = next(v.refused for v in server.visits.take(end=True) if v.role == "track" and v.event == "left")
    assert sum(refused.values()) == 1
    assert next(iter(refused)).startswith("presence: a p")


FLOATS = st.floats(width=32) | st.floats(-20000, 20000, width=32)
POSE = st.tuples(FLOATS, FLOATS, FLOATS, *map(st.just, (1.0, 0.0, 0.0, 0.0)))
ROWS = st.tuples(*[POSE | st.just((np.nan,) * 7)] * 3).map(lambda rows: sum(rows, ()))


@given(ROWS, st.lists(FLOATS, max_size=9), st.lists(FLOATS, max_size=6))
def test_whatever_is_said_no_place_that_passes_is_far_or_no_number(poses, points, laser):
    poses, points, laser = (np.array(numbers, "<f4").tobytes() for numbers in (poses, points, laser))
    try:
        mistake = place_mistake(Presence(poses=poses, points=points, laser=laser))
    except ValueError:
        return
    if not mistake:
        places = np.frombuffer(poses, "<f4").reshape(3, 7)[:, :3].astype(float)
        numbers = np.frombuffer(points + laser, "<f4").astype(float)
        assert (np.abs(places[~np.isnan(places)]) <= FARTHEST).all()
        assert (np.abs(numbers) <= FARTHEST).all()


@pytest.mark.parametrize("role", ["view", "control"])
def test_a_message_is_as_large_as_the_role_needs_at_most(server, role):
    most = LARGEST[Role(role)]
    with Guest(server, role) as guest:
        guest.say({"type": "presence", "poses": presence().poses, "more": bytes(most - 200)})
        guest.sees(lambda every: guest.hello.visitor in every)
        guest.say({"type": "presence", "poses": presence().poses, "more": bytes(most)})
        assert guest.end()[0] in (1007, 1009)


def test_what_is_said_in_another_name_is_written_out(server):
    with Guest(server, "view", name="\u202eAnna\x1b[2J") as guest:
        assert guest.others()[guest.hello.visitor].name == "\\u202eAnna\\x1b[2J"


# -- who does not read, and who is gone ---------------------------------------------------------

STALLED = """
import sys, time
from websockets.sync.client import connect
import msgspec
port, token, protocol = int(sys.argv[1]), sys.argv[2], sys.argv[3]
page = connect(f"ws://127.0.0.1:{port}/ws?token={token}", subprotocols=[protocol], compression=None)
page.send(msgspec.msgpack.encode({"type": "introduction"}))
print(msgspec.msgpack.decode(page.recv())["visitor"], flush=True)
time.sleep(600)
"""


def test_one_who_stalls_and_one_who_is_killed_cost_nobody_a_frame():
    feed, over = Live(rate=200.0), threading.Event()

    def publish():
        k = 0
        while not over.wait(0.02):
            feed.publish(snapshot(k))
            k += 1

    with ExitStack() as stack:
        server = stack.enter_context(
            Server(scene=scene(), meshes=MESHES, feed=feed, port=0, tokens=TOKENS, patience=1.0)
        )
        stack.callback(over.set)
        witness = stack.enter_context(Guest(server, "view"))
        command = [sys.executable, "-c", STALLED, str(server.port), TOKENS.view, "seerob.v2.msgpack"]
        others = [
            stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
            for _ in range(2)
        ]
        for other in others:
            stack.callback(other.kill)
        stalled, killed = (int(other.stdout.readline()) for other in others)
        witness.others(lambda every: {stalled, killed} <= set(every))
        publisher = threading.Thread(target=publish)
        publisher.start()
        stack.callback(publisher.join)
        stack.callback(over.set)
        os.kill(others[0].pid, signal.SIGSTOP)
        others[1].kill()
        both = {stalled, killed}
        witness.others(lambda every: both.isdisjoint(every))
        client = next(iter(server.hub.clients))
        assert len(server.hub.clients) == 1
        sent = client.sent
        for _ in range(50):
            witness.of(Snapshot)
        assert client.sent >= sent + 50
        os.kill(others[0].pid, signal.SIGCONT)
    seen = server.visits.take(end=True)
    assert sum(v.event == "left" for v in seen) == 3


# -- what they hold -----------------------------------------------------------------------------


def test_entries_that_differ_are_found_by_name():
    before = {"robots": [{"name": "a", "x": 1}, {"name": "b"}], "title": "t", "safety": [{"kind": "k"}]}
    after = {"robots": [{"name": "b"}, {"name": "c"}], "title": "u", "safety": []}
    assert changed_entries(before, after) == {"a", "c"}
    assert changed_entries(before, before | {"robots": [{"name": "a", "x": 2}, {"name": "b"}]}) == {"a"}
    assert changed_entries(before, before) == set()


def test_the_benchmark_of_visitors_runs():
    file = Path(__file__).parents[2] / "benchmarks" / "visitors.py"
    done = subprocess.run([sys.executable, file, "--smoke"], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert "poses heard late" in done.stdout
