"""Devices of each kind, killed and restarted: always heard again, said once each time, nothing left behind.

``make soak KINDS="rtde fri" KILLS=1000`` chooses; the figures of a long run are printed with ``-rP``.
"""

from __future__ import annotations

import gc
import logging
import os
import sys
import time
from importlib import import_module
from pkgutil import iter_modules

import pytest

from live_story import open_files, own_threads, wait_for
from seerob.core.samples import Quality, SignalSample
from seerob.devices import sources
from seerob.devices.live.listening import Listener, LiveSource
from seerob.devices.sources.opcua_robot import OpcuaRobot
from seerob.twin.validity.hearing import Heard, Hearing
from soak.device_kinds import FOREIGN, KINDS, OWN
from soak.elsewhere import Elsewhere

KILLS = int(os.environ.get("SEEROB_SOAK_KILLS", "1000"))
CHOSEN = os.environ.get("SEEROB_SOAK_KINDS", "").split() or list(KINDS)
SPARE = 8 << 20
"""Memory that a long run may take beyond what it has after a fifth of its kills [byte]."""


def resident():
    """Memory in use [byte], without what waits for the collector."""
    gc.collect()
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")


def load():
    """Open files, threads and memory [byte] of this process."""
    return open_files(), own_threads(), resident()


class Ears(logging.Filter):
    """Notes what is known of a device, and what is said of its loss and return.

    Nothing is handed on: pytest keeps every line, which would look like a leak.
    """

    def __init__(self, source):
        super().__init__()
        self.said, self.known, self.newest, self.drives = [], 0, 0.0, bool(source.target())

    def filter(self, record):
        """Called by the log."""
        if "not heard: " in record.getMessage() or "heard again" in record.getMessage():
            self.said.append("lost" if "not heard: " in record.getMessage() else "found")
        return False

    def hear(self, sample):
        """Called by the listener, from its thread."""
        if self.drives:
            good = not isinstance(sample, SignalSample) and sample.quality is Quality.GOOD
        else:
            good = bool(sample.values) and not sample.doubts
        if good:
            self.known, self.newest = self.known + 1, max(self.newest, sample.t)

    @property
    def losses(self):
        """That were said."""
        return self.said.count("lost")


@pytest.fixture
def listen(monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.002)
    monkeypatch.setattr("seerob.devices.live.listening.LONGEST_PAUSE", 0.02)
    # A clock that starts again ten times a second is not relied on; here only whether it is heard is asked.
    nothing = dict.fromkeys(("RESTART_HOLD", "AGAIN", "HOLD", "BUFFERED"), 0.0)
    for name, value in {**nothing, "DRIFT": 1e9}.items():
        monkeypatch.setattr(f"seerob.devices.live.device_clock.{name}", value)
    log, made = logging.getLogger("seerob.devices.live.listening"), []

    def make(source):
        made.append(Ears(source))
        log.addFilter(made[-1])
        return made[-1]

    yield make
    for each in made:
        log.removeFilter(each)


KEEPS = {"zenoh"}
"""Whose library keeps threads and files for the rest of a process, as many as for one connection."""


def kill_and_restart(monkeypatch, listen, kind, kills):
    """What was in use after a fifth of the kills, and at the end."""
    before = load()
    server, source, target = KINDS[kind](monkeypatch)
    heard = listen(source)
    listener = Listener(source, target, heard.hear)
    listener.start()
    settled = None
    try:
        for k in range(kills):
            known = heard.known
            wait_for(lambda known=known: heard.known > known + 2)
            if k == max(1, kills // 5):
                settled = load()
            server.stop()
            stopped = time.monotonic()
            # On a busy machine it may have been lost just before.
            wait_for(lambda: heard.said[-1:] == ["lost"])
            # Nothing is said for a device that is gone, so that its time-out begins with its last word.
            assert heard.newest <= stopped + 0.5 * source.timeout
            last = Hearing(given=False, driven=True, timeout=source.timeout, heard=[Heard(heard.newest)])
            assert "not heard for" in last.invalid_reason(stopped + 1.6 * source.timeout)
            server.start()
        known = heard.known
        wait_for(lambda: heard.known > known + 2)
        # One line for each loss and one for each return, in turn.
        assert heard.said[:2] == ["lost", "found"]
        assert all(a != b for a, b in zip(heard.said, heard.said[1:], strict=False))
        assert heard.losses >= kills
        # What is closed is gone a moment later.
        settled = settled or load()
        wait_for(lambda: open_files() <= settled[0] + 2 and own_threads() <= settled[1])
        end = load()
    finally:
        listener.ask_to_stop()
        assert listener.join(10.0)
        server.stop()
        getattr(server, "close", lambda: None)()
    files, threads, _ = settled if kind in KEEPS else before
    wait_for(lambda: own_threads() <= threads and open_files() <= files + 2)
    print(
        f"{kind}: {kills} kills, {heard.losses} losses said, {heard.said.count('found')} returns said; "
        f"files {settled[0]} to {end[0]}, threads {settled[1]} to {end[1]}, "
        f"memory {settled[2] / 2**20:.1f} to {end[2] / 2**20:.1f} MiB"
    )
    return settled, end


pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


@pytest.mark.parametrize("kind", [make.__name__ for make in OWN])
def test_every_kill_is_survived(monkeypatch, listen, kind):
    kill_and_restart(monkeypatch, listen, kind, 1)


@pytest.mark.soak
@pytest.mark.parametrize("kind", CHOSEN)
def test_a_thousand_kills_leave_nothing_behind(monkeypatch, listen, kind):
    settled, end = kill_and_restart(monkeypatch, listen, kind, KILLS)
    assert end[2] < settled[2] + SPARE


@pytest.mark.soak
@pytest.mark.parametrize("kind", [make.__name__ for make in FOREIGN])
def test_a_server_that_is_held_still_is_silent_within_the_time_out(monkeypatch, listen, kind):
    """Its connection stays, and it must not seem that nothing has changed."""
    server, source, target = KINDS[kind](monkeypatch)
    heard = listen(source)
    listener = Listener(source, target, heard.hear)
    listener.start()
    try:
        wait_for(lambda: heard.known > 2)
        server.freeze()
        still = time.monotonic()
        wait_for(lambda: heard.said[-1:] == ["lost"])
        assert heard.newest <= still + source.timeout / 2
        server.thaw()
        wait_for(lambda: heard.said[-1:] == ["found"])
    finally:
        listener.ask_to_stop()
        assert listener.join(10.0)
        server.stop()
        server.close()


@pytest.mark.soak
def test_a_robot_that_stands_still_is_known_as_long_as_its_server_is_there(listen):
    """OPC UA speaks of changes only, and a standing robot has none."""
    server = Elsewhere("opcua_standing").start()
    source = OpcuaRobot(robot="arm", url=f"opc.tcp://127.0.0.1:{server.port}")
    heard = listen(source)
    listener = Listener(source, None, heard.hear)
    listener.start()
    try:
        wait_for(lambda: heard.known > 5)
        wait_for(lambda: time.monotonic() - heard.newest < source.timeout / 2)
        server.freeze()
        still = time.monotonic()
        wait_for(lambda: heard.said[-1:] == ["lost"])
        assert heard.newest <= still + source.timeout / 2
    finally:
        server.thaw()
        listener.ask_to_stop()
        assert listener.join(10.0)
        server.stop()
        server.close()


def test_every_live_kind_is_killed():
    kinds = [m.name for m in iter_modules(sources.__path__) if not m.name.startswith("_")]
    modules = {kind: vars(import_module(f"seerob.devices.sources.{kind}")) for kind in kinds}
    live = {
        kind
        for kind, names in modules.items()
        for cls in names.values()
        if isinstance(cls, type) and issubclass(cls, LiveSource) and cls.__module__.endswith(f".{kind}")
    }
    # The room has nobody who could be killed: it says how controls stand whether somebody is there or not.
    assert live - {"room"} <= set(KINDS)
    assert len(FOREIGN) + len(OWN) == len(KINDS) > len(live)
