"""A live source of one's own is shown to be never wrongly green by one line, on real sockets."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from typing import ClassVar

import pytest
from msgspec.structs import replace

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.app.emulation.background import LoopEmulator
from seerob.core.samples import JointSample
from seerob.devices.live.listening import Listener, LiveSource
from seerob.protocols.links.tcp_server import tcp_server
from seerob.session.station import Station
from seerob.testing import never_within, sources_never_within

RATE = 100.0
SPEED = '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm/tip"\nlimit = 5\n'


class Server(LoopEmulator):
    """Says a line for each sample: its time, both angles, both speeds."""

    async def serve(self, ready, over):
        async with tcp_server(self._speak, "127.0.0.1", 0) as server:
            self.port = server.sockets[0].getsockname()[1]
            ready()
            await over.wait()

    async def _speak(self, _, writer):
        begun, k = time.monotonic(), 0
        with contextlib.suppress(OSError, asyncio.CancelledError):
            while not writer.transport.is_closing():
                t = k / RATE
                q, qd = (0.3 * math.sin(2 * t), 0.2), (0.6 * math.cos(2 * t), 0.0)
                writer.write(" ".join(map(repr, (t, *q, *qd))).encode() + b"\n")
                k += 1
                await asyncio.sleep(max(0.0, begun + k / RATE - time.monotonic()))
        writer.transport.abort()


class Own(LiveSource, frozen=True, kw_only=True):
    """Hears those lines."""

    port: int
    robot: str = "arm"
    timeout: float = 0.3
    stamped: ClassVar[bool] = True
    rates: ClassVar[bool] = True

    def target(self):
        return self.robot

    def period(self):
        return 1 / RATE

    async def listen(self, target):
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        try:
            while line := await reader.readline():
                t, a, b, va, vb = map(float, line.split())
                yield JointSample(
                    source="", seq=0, target=self.robot, t=time.monotonic(),
                    t_device=t if self.stamped else None, q=(a, b), qd=(va, vb) if self.rates else None,
                )  # fmt: skip
        finally:
            writer.transport.abort()


class Unstamped(Own, frozen=True, kw_only=True):
    """Gives no time of the device, and a bound of how late it is."""

    stamped: ClassVar[bool] = False
    delay: float | None = 0.05


@pytest.fixture(scope="module")
def server():
    with Server() as there:
        yield there


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return made(tmp_path_factory.mktemp("own"), FLOATING + TWO_R + SPEED, {"arm.urdf": two_r()})


def with_source(cell, source, **more):
    return Station(replace(cell.workstation, sources=(source,), **more))


@pytest.mark.parametrize("kind", [Own, Unstamped])
def test_what_is_looked_at_where_it_is_heard_is_never_within(cell, server, kind):
    sources_never_within(with_source(cell, kind(name="own", port=server.port)), names=["own"])


def test_a_live_source_that_is_not_there_or_that_nothing_rests_on_is_not_passed(cell, server):
    with Server() as gone:
        port = gone.port
    with pytest.raises(AssertionError, match=r"own: .*is it there\?"):
        sources_never_within(with_source(cell, Own(name="own", port=port)))
    with pytest.raises(AssertionError, match="no criterion depends on what it says"):
        sources_never_within(with_source(cell, Own(name="own", port=server.port), safety=()))
    slow = replace(cell.workstation.safety[0], limit=1e-6)
    with pytest.raises(AssertionError, match="give a motion in which it is within"):
        sources_never_within(with_source(cell, Own(name="own", port=server.port), safety=(slow,)))


def test_a_lie_that_is_believed_is_told(cell, server, monkeypatch):
    """Of a listener that looks at nothing."""
    monkeypatch.setattr(Listener, "take", lambda self, sample: self._post(replace(sample, source="own")))
    with pytest.raises(AssertionError, match=r"is within at .* although own "):
        sources_never_within(with_source(cell, Own(name="own", port=server.port)))


def test_names_of_nobody_are_not_passed(cell, server):
    station = with_source(cell, Own(name="own", port=server.port))
    with pytest.raises(AssertionError, match="no source is called 'owm'"):
        sources_never_within(station, names=["owm"])
    with pytest.raises(AssertionError, match="no criterion is called 'spede'"):
        never_within(station, names=["spede"])
    with pytest.raises(AssertionError, match="there is no criterion to be asked"):
        never_within(Station(replace(cell.workstation, safety=())))
    with pytest.raises(AssertionError, match="there is no source to be asked"):
        sources_never_within(cell)
