"""Controllers that are killed and restarted a thousand times, and a hundred thousand malformed packages."""

from __future__ import annotations

import contextlib
import os
import random
import sys
import threading
import time

import pytest

from seerob.emulators.motions import swing
from seerob.emulators.rtde import RtdeServer
from seerob.live import Listener
from seerob.protocols import ProtocolError
from seerob.protocols.rtde import Kind, Package, Recipe, Splitter, decode_reply, decode_request, pack
from seerob.sources.rtde import FIELDS, Rtde

pytestmark = pytest.mark.soak

KILLS = int(os.environ.get("SEEROB_SOAK_KILLS", "1000"))
PACKAGES = 100_000


def resident():
    """Memory in use [B]."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")


def wait_for(true, seconds=20.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.001)


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_every_kill_is_survived_and_nothing_is_left_behind(monkeypatch):
    monkeypatch.setattr("seerob.live.FIRST_PAUSE", 0.002)
    monkeypatch.setattr("seerob.live.LONGEST_PAUSE", 0.02)
    server = RtdeServer(swing((0.0, -1.2, 1.4, -1.5, -1.5, 0.0))).start()
    count = [0]

    def hear(_):
        count[0] += 1

    listener = Listener(Rtde(robot="arm", host="127.0.0.1", port=server.port), None, hear)
    listener.start()
    settled = None
    try:
        for k in range(KILLS):
            heard = count[0]
            wait_for(lambda heard=heard: count[0] > heard + 2)
            server.stop()
            server.start()
            if k == KILLS // 5:
                settled = len(os.listdir("/proc/self/fd")), threading.active_count(), resident()
        heard = count[0]
        wait_for(lambda: count[0] > heard + 2)
        files, threads, memory = settled
        assert len(os.listdir("/proc/self/fd")) <= files + 2
        assert threading.active_count() <= threads
        assert resident() < memory + (8 << 20)
        assert listener.statistics().losses >= KILLS - 5
    finally:
        listener.ask_to_stop()
        assert listener.join(1.0)
        server.stop()


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("decode", [decode_request, decode_reply])
def test_malformed_packages_are_an_error_and_nothing_else(decode, version):
    chance = random.Random(11)
    recipe = Recipe(FIELDS[:4], ("DOUBLE", "VECTOR6D", "VECTOR6D", "VECTOR6D"), 1)
    for _ in range(PACKAGES):
        kind = chance.choice([*Kind, chance.randrange(256)])
        payload = chance.randbytes(chance.choice([0, 1, 2, 7, 8, 9, 16, 60, 152, 153, 300]))
        frame = bytearray(pack(kind, payload))
        frame[chance.randrange(len(frame))] = chance.randrange(256)
        for read in (
            lambda p=payload, k=kind: decode(Package(k, p), version),
            lambda p=payload: recipe.unpack(p),
            lambda f=bytes(frame): Splitter().feed(f),
        ):
            with contextlib.suppress(ProtocolError):
                read()
