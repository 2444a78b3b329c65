"""Live sources in general: thread, back-off, stop, time, and a run that follows one."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import math
import sys
import threading
import time

import msgspec
import pytest

from live_story import wait_for as until
from seerob.core.errors import SeerobError
from seerob.core.samples import BodyPoint, BodySample, JointSample, Quality, SignalSample
from seerob.devices.live.listening import (
    FIRST_PAUSE,
    LONGEST_PAUSE,
    MARGIN,
    STILL,
    Listener,
    LiveSource,
    delay_of,
    say_once,
)
from seerob.devices.live.receivers import PROMPT, Clock, Receivers, hear
from seerob.workstation.source import Source


class Made(LiveSource, frozen=True, kw_only=True):
    """Yields what a script of the test says."""

    script: object = None
    rate: float = 100.0

    def target(self):
        return "arm"

    def period(self):
        return 1 / self.rate

    def listen(self, target):
        return self.script()


class Machine(Made, frozen=True, kw_only=True):
    """One that drives nothing."""

    def target(self):
        return ""


def joint(t=None, device=None):
    return JointSample(
        source="", seq=0, target="arm", q=(0.0,), t=time.monotonic() if t is None else t, t_device=device
    )


class Collector:
    def __init__(self, script):
        self.samples = []
        self.listener = Listener(Made(script=script, name="made"), None, self.samples.append)

    def __enter__(self):
        self.listener.start()
        return self

    def __exit__(self, *_):
        self.listener.ask_to_stop()
        assert self.listener.join(30.0)


def test_what_is_heard_is_numbered_named_and_put_on_the_hosts_clock():
    async def script():
        for k in range(5):
            yield joint(t=1000 + 0.1 * k + 0.01 * (k == 2), device=5 + 0.1 * k)
            yield joint(t=1000.05 + 0.1 * k, device=5 + 0.1 * k)  # no news
        yield SignalSample(source="", seq=0, t=1001.0, values={"on": True})
        await asyncio.sleep(60)

    with Collector(script) as collector:
        until(lambda: len(collector.samples) == 6)
    assert [s.seq for s in collector.samples] == [0, 1, 2, 3, 4, 0]
    assert {s.source for s in collector.samples} == {"made"}
    assert [s.t for s in collector.samples] == pytest.approx([1000, 1000.1, 1000.2, 1000.3, 1000.4, 1001.0])
    found = collector.listener.statistics()
    assert (found.count, found.repeated, found.offset) == (5, 5, pytest.approx(995))


def test_what_a_source_doubts_itself_stays_a_doubt():
    """Also where nothing else is found, and it calls the sample good for all that."""
    doubt = "it is another robot"

    async def script():
        for k in range(40):
            yield msgspec.structs.replace(joint(device=5 + 0.01 * k), reason=doubt if k % 2 else "")
            await asyncio.sleep(0.01)
        await asyncio.sleep(60)

    with Collector(script) as collector:
        until(lambda: len(collector.samples) == 40)
    heard = collector.samples
    assert all(s.reason and s.quality is not Quality.GOOD for s in heard[1::2])
    assert any(doubt in s.reason for s in heard[1::2])
    assert not any(doubt in s.reason for s in heard[::2])


@pytest.mark.parametrize("error", [OSError(111, "x"), SeerobError("nonsense"), ValueError("a bug"), None])
def test_one_line_per_loss_and_one_per_return_whatever_ends_it(caplog, error):
    sessions = []

    async def script():
        sessions.append(time.monotonic())
        if len(sessions) not in {2, 3}:
            yield joint()
        if len(sessions) >= 4:
            await asyncio.sleep(60)
        if error:
            raise error

    with caplog.at_level(logging.INFO, "seerob.devices.live.listening"), Collector(script) as collector:
        until(lambda: len(collector.samples) == 2)
    lines = [r.getMessage() for r in caplog.records if "mistake in the source" not in r.getMessage()]
    assert len(lines) == 2
    assert lines[0].startswith("made: not heard: ")
    assert lines[1] == "made: heard again"
    assert collector.listener.statistics().losses == 1


def test_it_is_tried_again_less_and_less_often(monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.01)
    monkeypatch.setattr("seerob.devices.live.listening.LONGEST_PAUSE", 0.08)
    tried = []

    async def script():
        tried.append(time.monotonic())
        raise OSError
        yield

    with Collector(script):
        until(lambda: len(tried) >= 8)
    pauses = [b - a for a, b in itertools.pairwise(tried)]
    for pause, least in zip(pauses, [0.01, 0.02, 0.04, 0.08, 0.08, 0.08], strict=False):
        assert pause >= least
    assert FIRST_PAUSE < LONGEST_PAUSE


def test_a_source_that_waits_is_stopped_at_once_and_its_thread_ends():
    left = threading.Event()

    async def script():
        try:
            yield joint()
            await asyncio.sleep(1e6)
        finally:
            left.set()

    before = set(threading.enumerate())
    with Collector(script) as collector:
        until(lambda: collector.samples)
    assert left.is_set()
    assert set(threading.enumerate()) <= before


def test_a_listener_that_is_stopped_before_it_began_ends():
    listener = Listener(Made(script=None), None, print)
    listener.ask_to_stop()
    listener.start()
    assert listener.join(30.0)


def test_the_newest_wins_and_nothing_queues():
    async def script():
        for k in range(1000):
            yield joint(t=float(k))
        said.set()
        await asyncio.sleep(60)

    said = threading.Event()
    with Receivers([(Made(script=script), None)]) as listening:
        assert said.wait(60)
        (sample,) = listening.take()
        assert (sample.t, sample.seq) == (999.0, 999)
        assert listening.take() == ()


def test_run_time_begins_at_the_first_sample_and_the_tick_that_speaks_of_it_comes_a_delay_later():
    async def script():
        while True:
            yield joint()
            await asyncio.sleep(0.005)

    source = Made(script=script)
    clock, period = Clock(), 0.01
    with Receivers([(source, None)]) as listening:
        feed = hear(iter(lambda: (), None), listening, clock)
        for k in range(20):
            samples = next(feed)
            now = time.monotonic()
            for sample in samples:
                assert sample.t <= now - clock.start + listening.delay
            if k == 0:
                assert samples[0].t == pytest.approx(0.0, abs=1e-9)
                assert now - clock.start >= 0
            clock.wait((k + 1) * period)
    assert listening.delay == delay_of([source]) == source.behind() == 0.01 + MARGIN


def test_a_run_begins_with_what_is_heard_then_and_not_with_what_was_heard_before(monkeypatch):
    posted, begun = threading.Event(), threading.Event()

    async def script():
        yield joint(t=1.0)
        posted.set()
        await asyncio.to_thread(begun.wait, 60)
        yield joint(t=2.0)
        await asyncio.sleep(60)

    with Receivers([(Made(script=script), None)]) as listening:
        assert posted.wait(60)
        take = listening.take

        def taken():
            found = take()
            begun.set()
            return found

        monkeypatch.setattr(listening, "take", taken)
        assert [s.t for s in listening.first(patience=60.0)] == [2.0]


def test_a_run_begins_without_a_source_that_is_not_there():
    async def script():
        yield joint()
        said.set()
        await asyncio.sleep(60)

    said = threading.Event()
    with Receivers([(Made(script=script), None)]) as listening:
        assert said.wait(60)
        assert listening.first(patience=0.05) == ()


def test_a_live_run_waits_for_no_thread_for_long_and_leaves_that_as_it_was():
    before = sys.getswitchinterval()
    with Receivers([]):
        assert sys.getswitchinterval() <= PROMPT < before
    assert sys.getswitchinterval() == before


def test_a_live_source_cannot_loop_and_its_time_out_is_longer_than_its_delay():
    for wrong, what in (({"loop": True}, "remove loop"), ({"timeout": 0.01}, "longer timeout")):
        with pytest.raises(msgspec.ValidationError, match=what):
            msgspec.convert({**wrong}, Made)
    assert Made(delay=0.1).behind() == 0.1
    assert delay_of([Source(), Made(delay=0.03), Made(delay=0.05)]) == 0.05


def test_a_cancellation_that_a_library_forgets_is_a_stop_all_the_same():
    async def script():
        while True:
            yield joint()
            with contextlib.suppress(asyncio.CancelledError):  # as asyncio.wait_for may, until Python 3.12
                await asyncio.sleep(0.01)

    with Collector(script) as collector:
        until(lambda: collector.samples)


def test_what_is_as_true_of_the_next_connection_is_said_once(caplog):
    log, sessions = logging.getLogger("made"), []

    async def script():
        sessions.append(1)
        say_once(log, logging.WARNING, "no torques")
        yield joint()
        raise OSError

    with caplog.at_level(logging.INFO, "made"), Collector(script):
        until(lambda: len(sessions) > 2)
    assert [r.getMessage() for r in caplog.records if r.name == "made"] == ["no torques"]
    with caplog.at_level(logging.INFO, "made"):
        say_once(log, logging.WARNING, "no torques")
    assert caplog.text.count("no torques") == 2  # elsewhere it is another matter


def test_what_a_machine_says_is_counted_and_so_are_its_losses():
    async def script():
        for _ in range(3):
            yield SignalSample(source="", seq=0, t=time.monotonic(), values={"on": True})
        raise OSError

    samples = []
    source = Machine(script=script, name="plc")
    listener = Listener(source, None, samples.append)
    listener.start()
    until(lambda: len(samples) >= 6)
    listener.ask_to_stop()
    assert listener.join(30.0)
    found = listener.statistics()
    assert found.count == len(samples)
    assert found.losses >= 1


@pytest.mark.parametrize("kind", [Made, Machine])
def test_who_only_has_signals_of_a_robot_is_not_heard_again(monkeypatch, caplog, kind):
    """Where the joints are is what is missed; of a machine the signals are all there is."""
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.005)
    begun = itertools.count()
    sessions = []

    async def script():
        sessions.append(next(begun))
        yield SignalSample(source="", seq=0, t=time.monotonic(), values={"on": True})
        raise ConnectionError("no joints")

    listener = Listener(kind(script=script, name="made"), None, lambda sample: None)
    listener.start()
    until(lambda: len(sessions) > 3)
    listener.ask_to_stop()
    assert listener.join(30.0)
    lines = [r.getMessage() for r in caplog.records if r.name == "seerob.devices.live.listening"]
    assert lines[0] == "made: not heard: no joints"
    assert ("made: heard again" in lines) == (kind is Machine)
    assert kind is Machine or len(lines) == 1


def test_a_mistake_in_a_source_is_told_with_its_place_once(monkeypatch, caplog):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.005)
    sessions = []

    async def script():
        sessions.append(None)
        raise KeyError("gone")
        yield

    with Collector(script):
        until(lambda: len(sessions) > 3)
    said = [
        (r.getMessage(), bool(r.exc_info))
        for r in caplog.records
        if r.name == "seerob.devices.live.listening"
    ]
    assert said == [
        ("made: a mistake in the source itself", True),
        ("made: not heard: KeyError: 'gone'", False),
    ]


def test_what_is_no_number_and_is_said_again_is_the_same():
    """A person of whom one point is none hangs; a robot's buffer is no other clock."""
    told = []
    ears = Listener(Made(name="made", timeout=0.2), None, told.append)
    for k in range(100):
        nowhere = BodyPoint(name="hand", bone="right_hand", position=(math.nan * k, 0.0, 0.0))
        there = BodyPoint(name="head", bone="head", position=(0.0, 0.0, 1.7))
        body = BodySample(
            source="", seq=0, t=5 + 0.01 * k, t_device=0.01 * k, target="op", points=(nowhere, there)
        )
        ears.take(body)
    assert told[-1].reason.endswith(STILL)
    ears = Listener(Made(name="made", timeout=0.2), None, told.append)
    for late, first in ((0.0, 0), (3.0, 100)):
        ears._clock.reconnect()
        for k in range(first, 200):
            q = (math.nan * k,)
            ears.take(msgspec.structs.replace(joint(5 + late + 0.01 * k, 0.01 * k), q=q))
    assert ears.statistics().offset == pytest.approx(5, abs=2e-3)
