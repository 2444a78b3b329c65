"""Pages and strangers who ask as fast as they can: the others, and the run, have their share."""

import asyncio
import multiprocessing
import threading
import time
from contextlib import ExitStack, suppress

import httpx
import msgspec
import pytest
from websockets.exceptions import InvalidStatus

from seerob.app.server import door
from seerob.app.server.access import Role, Tokens
from seerob.app.server.allowance import Allowance, Allowances
from seerob.app.server.door import STRANGERS
from seerob.app.server.hub import RATES, SHARED
from seerob.app.server.live import Live
from seerob.app.server.serving import Server
from seerob.core.snapshot import Command, Snapshot
from server.flooding import flood
from server.frames import MESHES, PATIENCE, Visitor, scene, snapshot
from server.test_hostile_visitors import frame

SECONDS = 1.0


class Counting(Live):
    """A live feed that counts what it is asked."""

    asked = 0

    def command(self, command):
        self.asked += 1


@pytest.fixture
def feed():
    return Counting()


@pytest.fixture
def server(feed):
    over = threading.Event()

    def publish():
        k = 0
        while not over.wait(0.01):
            feed.publish(snapshot(k))
            k += 1

    with Server(scene=scene(), meshes=MESHES, feed=feed, port=0) as server:
        publisher = threading.Thread(target=publish)
        publisher.start()
        yield server
        over.set()
        publisher.join()


COMMANDS = frame(2, msgspec.msgpack.encode(Command(action="seek", value=1.0))) * 200
ACKS = frame(2, msgspec.msgpack.encode(Command(action="ack", value=1.0))) * 200


@pytest.mark.parametrize(("messages", "pages"), [(COMMANDS, 1), (COMMANDS, 6), (ACKS, 1)])
def test_a_page_that_floods_is_read_no_faster_than_allowed_and_others_go_on(server, feed, messages, pages):
    with Visitor(server) as witness:
        witness.of(Snapshot)
        begun = time.monotonic()
        flooders = [
            multiprocessing.get_context("spawn").Process(target=flood, args=(server.port, SECONDS, messages))
            for _ in range(pages)
        ]
        for flooder in flooders:
            flooder.start()
        seen, gap, last = 0, 0.0, time.monotonic()
        while any(flooder.is_alive() for flooder in flooders):
            witness.of(Snapshot)
            now = time.monotonic()
            seen, gap, last = seen + 1, max(gap, now - last), now
        passed = time.monotonic() - begun
    rate, burst = RATES["command"]
    shared, at_once = SHARED["command"]
    assert feed.asked <= min(pages * (burst + rate * passed), at_once + shared * passed) + pages
    if messages is COMMANDS:
        assert feed.asked > burst  # it is slowed down, not cut
        assert any("per second: command" in v for e in server.visits.take(end=True) for v in e.refused)
    assert seen > 10  # whatever the machine: a stalled one sees none


def test_pings_without_end_are_not_read_on(server):
    pings = frame(9, b"") * 500
    with Visitor(server) as witness:
        witness.of(Snapshot)
        sent = flood(server.port, SECONDS, pings)
        alone = flood(server.port, SECONDS, COMMANDS[:40])
        assert witness.of(Snapshot)
    assert sent < 2**24  # what kernels keep, not what one sends in that time
    assert alone


def test_strangers_who_ask_without_end_are_slowed_down_and_visitors_are_not():
    tokens = Tokens.made()
    with Server(scene=scene(), meshes=MESHES, feed=Live(), port=0, tokens=tokens) as server:
        address = f"http://127.0.0.1:{server.port}/none"

        async def ask(count, **options):
            async with httpx.AsyncClient(limits=httpx.Limits(max_connections=20), timeout=PATIENCE) as client:
                answers = await asyncio.gather(*(client.get(address, **options) for _ in range(count)))
            return [answer.status_code for answer in answers]

        begun = time.monotonic()
        rate, burst = STRANGERS
        codes = asyncio.run(ask(120))
        took = time.monotonic() - begun
        answered = codes.count(401)
        assert set(codes) <= {401, 429}
        assert answered <= burst + rate * (took + 5.0) + 1
        cookie = {"Cookie": f"seerob-{server.port}={tokens.cookie(Role.VIEW)}"}
        begun = time.monotonic()
        assert set(asyncio.run(ask(120, headers=cookie))) <= {404, 503}
        assert time.monotonic() - begun < took


def test_who_begins_sockets_without_end_waits_or_is_turned_away_and_owes_nothing_for_that(monkeypatch):
    monkeypatch.setattr(door, "SOCKETS", (5.0, 4.0))
    monkeypatch.setattr(door, "LONGEST_WAIT", 0.5)
    with Server(scene=scene(), meshes=MESHES, feed=Live(), port=0) as server, ExitStack() as held:
        for _ in range(4):
            held.enter_context(Visitor(server))
        codes = []

        def come():
            try:
                held.enter_context(Visitor(server))
                codes.append(101)
            except InvalidStatus as refused:
                codes.append(refused.response.status_code)

        many = [threading.Thread(target=come) for _ in range(40)]
        for one in many:
            one.start()
        begun = time.monotonic()
        held.enter_context(Visitor(server, source_address=("127.0.0.9", 0)))  # another address
        assert time.monotonic() - begun < PATIENCE / 2
        for one in many:
            one.join()
        assert set(codes) == {101, 429}
        assert codes.count(429) > codes.count(101)
        time.sleep(1.0)
        held.enter_context(Visitor(server))  # 40 that were turned away would be 7 s


def test_an_allowance_gives_its_rate_and_never_more():
    now = 0.0
    allowance = Allowance(10.0, 5.0, now=lambda: now)
    given = 0
    while now < 100.0:
        now += allowance.take()
        given += 1
    assert given == pytest.approx(5 + 10 * 100, abs=1)
    now += 1000.0
    assert [allowance.take() for _ in range(5)] == [0.0] * 5
    assert allowance.take() > 0


def test_allowances_are_of_those_who_asked_last():
    allowances = Allowances(1.0, 1.0)
    first = allowances.of("a")
    for k in range(5000):
        allowances.of(str(k))
    assert allowances.of("a") is not first
    assert len(allowances._of) <= 1025


def test_refusals_and_those_who_wait_when_the_server_stops_are_no_errors_in_the_log(monkeypatch, caplog):
    monkeypatch.setattr(door, "SOCKETS", (0.5, 1.0))
    tokens = Tokens.made()
    with ExitStack() as held:
        asking = held.enter_context(Server(scene=scene(), meshes=MESHES, feed=Live(), port=0, tokens=tokens))
        with pytest.raises(InvalidStatus, match="401"):
            Visitor(asking)
        held.enter_context(Visitor(asking, path=f"/ws?token={tokens.view}"))

        def come():
            with suppress(Exception):
                Visitor(asking, path=f"/ws?token={tokens.view}")

        waiting = threading.Thread(target=come, daemon=True)
        waiting.start()
        time.sleep(0.5)  # it is made to wait for 2 s
        asking.stop()
        waiting.join(PATIENCE)
    assert [r for r in caplog.records if r.exc_info or "handshake" in r.getMessage()] == []
