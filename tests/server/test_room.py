"""What visitors do in the room, over the connection of their page: hands take things, controls are pulled."""

import time
from contextlib import contextmanager

import msgspec
import pytest

from seerob.app.server.access import Tokens
from seerob.app.server.live import Live
from seerob.app.server.serving import Server
from seerob.core.samples import GrabSample, SignalSample
from seerob.core.snapshot import Grab, Pull, Refused
from seerob.devices.live.listening import Listener
from seerob.devices.sources.room import HELD, Room
from seerob.workstation.source import Target
from seerob.workstation.tables.controls import Control, ControlKind
from seerob.workstation.variables import Kind, Variable
from server.frames import MESHES, PATIENCE, scene
from server.test_headset import Page, heard

LEVER = Control(name="lever", of="valve", kind=ControlKind.LEVER, sets="valve/angle", upper=1.2)
SWITCH = Control(name="lamp", of="panel", kind=ControlKind.SWITCH, sets="lamp", start=1.0)
ENABLING = Control(name="enabling", of="panel", kind=ControlKind.ENABLING, sets="enabled")
VARIABLES = (
    Variable(name="valve/angle", source="room", address="lever", unit="rad"),
    *(Variable(name=name, source="room", address=name, type=Kind.BOOL) for name in ("lamp", "enabled")),
)
TARGET = Target(variables=VARIABLES, controls=(LEVER, SWITCH, ENABLING))


class Visitor(Page):
    """A page that does something."""

    def do(self, what):
        self.socket.send(msgspec.msgpack.encode(what))
        return self

    def refusal(self):
        while True:
            data = self.socket.recv(timeout=PATIENCE)
            if b"refused" in data[:20]:
                return msgspec.msgpack.decode(data, type=Refused).reason


@pytest.fixture(name="server")
def a_server():
    with Server(scene=scene(), meshes=MESHES, feed=Live(), port=0) as server:
        yield server


@contextmanager
def room(server):
    """Samples of what is done."""
    samples = []
    listener = Listener(Room(name="room").taking(server.offers), TARGET, samples.append)
    listener.start()
    wait(lambda: samples)
    try:
        yield samples
    finally:
        listener.ask_to_stop()
        assert listener.join(PATIENCE)


def wait(until):
    end = time.monotonic() + PATIENCE
    while not until():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.005)


def stands(samples, name, value):
    wait(lambda: [s for s in samples if isinstance(s, SignalSample)][-1].values[name] == value)


def grabs(samples):
    return [(s.target, s.piece) for s in samples if isinstance(s, GrabSample)]


def test_controls_stand_where_the_file_has_them_and_then_where_they_were_pulled(server):
    with room(server) as samples, Visitor(server) as page:
        assert samples[0].values == {"valve/angle": 0.0, "lamp": True, "enabled": False}
        page.do(Pull(control="lever", value=0.7))
        stands(samples, "valve/angle", 0.7)
        page.do(Pull(control="lamp", value=0.0))
        stands(samples, "lamp", False)
        for value, said in ((1.3, "is not between 0 and 1.2"), (-0.1, "is not between")):
            assert said in page.do(Pull(control="lever", value=value)).refusal()
        assert "neither 0 nor 1" in page.do(Pull(control="lamp", value=0.5)).refusal()
        assert "no control named 'laver'" in page.do(Pull(control="laver", value=1.0)).refusal()
        assert [s for s in samples if isinstance(s, SignalSample)][-1].values["valve/angle"] == 0.7


def test_an_enabling_switch_is_let_go_by_silence_by_others_not_and_by_who_leaves(server):
    with room(server) as samples, Visitor(server) as other:
        with Visitor(server) as page:
            page.do(Pull(control="enabling", value=1.0))
            stands(samples, "enabled", True)
            assert "somebody else holds it" in other.do(Pull(control="enabling", value=0.0)).refusal()
            begun = time.monotonic()
            stands(samples, "enabled", False)
            assert time.monotonic() - begun > 0.5 * HELD
            page.do(Pull(control="enabling", value=1.0))
            stands(samples, "enabled", True)
        stands(samples, "enabled", False)


def test_a_hand_takes_things_for_the_page_that_is_its_persons_headset_alone(server):
    with heard(server), room(server) as samples, Visitor(server) as other:
        with Visitor(server) as page:
            assert "not the headset of 'anna'" in page.do(Grab(hand="anna/left_hand", piece="nut")).refusal()
            page.see()
            assert page.answer().accepted
            page.do(Grab(hand="anna/right_hand", piece="nut"))
            wait(lambda: grabs(samples) == [("anna/right_hand", "nut")])
            assert "not the headset" in other.do(Grab(hand="anna/right_hand")).refusal()
            page.do(Grab(hand="anna/right_hand"))
            wait(lambda: len(grabs(samples)) == 2)
            page.do(Grab(hand="anna/left_hand", piece="bolt"))
            wait(lambda: len(grabs(samples)) == 3)
        wait(lambda: grabs(samples)[3:] == [("anna/left_hand", "")])


@pytest.mark.parametrize(
    "what",
    [
        Pull(control="lever", value=float("nan")),
        Pull(control="lever", value=float("inf")),
        Pull(control="x" * 65, value=1.0),
    ],
)
def test_what_no_page_sends_ends_its_connection_and_nothing_moves(server, what):
    with room(server) as samples, Visitor(server) as page:
        page.do(what)
        with pytest.raises(Exception, match="1007"):
            page.refusal()
        stands(samples, "valve/angle", 0.0)


def test_without_a_room_a_page_hears_that_nobody_waits(server):
    with Visitor(server) as page:
        assert "no source of kind room" in page.do(Pull(control="lever", value=1.0)).refusal()


def test_who_may_only_look_pulls_nothing():
    tokens = Tokens.made()
    with (
        Server(scene=scene(), meshes=MESHES, feed=Live(), port=0, tokens=tokens) as server,
        room(server) as samples,
        Visitor(server, path=f"/ws?token={tokens.view}") as page,
    ):
        assert "this page may not" in page.do(Pull(control="lever", value=1.0)).refusal()
        with Visitor(server, path=f"/ws?token={tokens.control}") as desk:
            desk.do(Pull(control="lever", value=1.0))
            stands(samples, "valve/angle", 1.0)
            assert "this page may not" in desk.do(Grab(hand="anna/left_hand", piece="nut")).refusal()
