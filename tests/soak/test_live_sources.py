"""Devices of each kind, killed and restarted a thousand times, and a hundred thousand malformed packages."""

from __future__ import annotations

import contextlib
import gc
import os
import random
import sys
import threading
import time

import pytest

from seerob.emulators.motions import swing
from seerob.live import Listener
from seerob.protocols import ProtocolError
from seerob.protocols.rtde import Kind, Package, Recipe, Splitter, decode_reply, decode_request, pack
from seerob.samples import SignalSample
from seerob.source import Target
from seerob.sources.rtde import FIELDS
from sources.listening import free_port

KILLS = int(os.environ.get("SEEROB_SOAK_KILLS", "1000"))
PACKAGES = 100_000


def resident():
    """Memory in use [B], without what waits for the collector: an OPC UA server is a large cycle."""
    gc.collect()
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")


def files():
    return len(os.listdir("/proc/self/fd"))


def wait_for(true, seconds=60.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.001)


# -- kinds: a server that can be stopped and started, who listens to it, and to what it listens ---


def rtde(_):
    from seerob.emulators.rtde import RtdeServer
    from seerob.sources.rtde import Rtde

    server = RtdeServer(swing((0.0, -1.2, 1.4, -1.5, -1.5, 0.0))).start()
    return server, Rtde(robot="arm", host="127.0.0.1", port=server.port), None


def fri(patch):
    from seerob.emulators.fri import FriServer
    from seerob.sources.fri import Fri

    patch.setattr("seerob.sources.fri.SILENCE", 0.05)
    port = free_port()
    server = FriServer(swing((0.0, 0.5, 0.0, -1.4, 0.0, 1.2, 0.0)), to=("127.0.0.1", port)).start()
    return server, Fri(robot="arm", host="127.0.0.1", port=port), None


def natnet(_):
    from seerob.emulators.mvn_person import animated
    from seerob.emulators.natnet import NatnetServer
    from seerob.sources.natnet import Natnet, Transmission

    server = NatnetServer({"Anna": animated("library:reach")}, port=0).start()
    options = {"human": "anna", "timeout": 1.0, "transmission": Transmission.UNICAST}
    return server, Natnet(host="127.0.0.1", port=server.port, **options), None


def vrpn(_):
    from seerob.emulators.mvn_person import animated
    from seerob.emulators.vive import FIVE, WORN
    from seerob.emulators.vrpn import VrpnServer
    from seerob.sources.vrpn import Vrpn

    worn = {role: WORN[role] for role in FIVE}
    server = VrpnServer(animated("library:reach"), worn, port=0).start()
    return server, Vrpn(host="127.0.0.1", port=server.port, human="anna", timeout=1.0), None


def siemens_web(patch):
    from seerob.emulators.siemens_web import SiemensWebServer
    from seerob.sources.siemens_web import SiemensWeb
    from seerob.variables.dictionary import Variable

    patch.setenv("PLC_PASSWORD", "secret")
    speed = Variable(name="speed", source="plc", address="speed", unit="mm/s", timeout=1)
    server = SiemensWebServer({"speed": lambda t: 250.0}, user="twin", password="secret").start()
    options = {"user": "twin", "password_env": "PLC_PASSWORD", "every": 0.02}
    return server, SiemensWeb(name="plc", url=server.url, **options), Target(variables=(speed,))


def opcua(_):
    pytest.importorskip("asyncua")
    from seerob.emulators.opcua import URI, Emulated, OpcuaServer
    from seerob.sources.opcua import Opcua
    from seerob.variables.dictionary import Variable

    address = f"nsu={URI};s=Belt/position"
    position = Variable(name="position", source="plc", address=address, unit="mm", timeout=1)
    server = OpcuaServer({"Belt/position": Emulated(lambda t: t, "mm")}).start()
    return server, Opcua(name="plc", url=server.url), Target(variables=(position,))


KINDS = [rtde, fri, natnet, vrpn, siemens_web, opcua]


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize(
    ("kind", "kills"),
    [pytest.param(kind, 3, id=f"{kind.__name__}-short") for kind in KINDS if kind is not opcua]
    + [pytest.param(kind, KILLS, id=kind.__name__, marks=pytest.mark.soak) for kind in KINDS],
)
def test_every_kill_is_survived_and_nothing_is_left_behind(monkeypatch, kind, kills):
    monkeypatch.setattr("seerob.live.FIRST_PAUSE", 0.002)
    monkeypatch.setattr("seerob.live.LONGEST_PAUSE", 0.02)
    server, source, target = kind(monkeypatch)
    known = [0]

    def hear(sample):
        # A variable that is only in doubt says that the device is gone.
        known[0] += (
            not isinstance(sample, SignalSample) or len(sample.doubts) < len(sample.values) or not target
        )

    listener = Listener(source, target, hear)
    listener.start()
    settled = None

    def again():
        before = known[0]
        wait_for(lambda: known[0] > before + 2)

    try:
        for k in range(kills):
            again()
            if k == max(1, kills // 5):
                settled = files(), threading.active_count(), resident()
            server.stop()
            server.start()
        again()
        # What is closed is gone a moment later.
        wait_for(lambda: files() <= settled[0] + 2 and threading.active_count() <= settled[1])
        assert resident() < settled[2] + (8 << 20)
    finally:
        listener.ask_to_stop()
        assert listener.join(10.0)
        server.stop()


@pytest.mark.soak
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
