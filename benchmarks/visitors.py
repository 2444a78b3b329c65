"""Twenty visitors who see each other move in a live run: what it costs, and how late they see it.

The server is in this process, its visitors are in another: all of them are headsets that move, 30 poses a
second, and look at a run of 100 Hz. One is stopped and one is killed after a third of the time. Told are the
processor time of the server's thread, how late others hear of a pose (from when it is sent to when it is
read, in the other process), and frames that visitors lost besides those two.

``--smoke`` is a short run without judgement.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import multiprocessing
import os
import signal
import statistics
import sys
import threading
import time
from collections import Counter
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Protocol

import msgspec
import numpy as np
from websockets.asyncio.client import connect

from seerob.app.server.live import Live
from seerob.app.server.serving import Server
from seerob.core.snapshot import PROTOCOL, Command, Introduction, Node, Presence, Presences, Scene, Snapshot

MOST_CPU, MOST_LATE = 0.15, 0.050
"""Of one core; p95 [s]."""
RATE = 30.0
BODIES = 50
OBSERVERS = 4
"""Visitors who look at what the others say: reading it all costs this benchmark more than the server."""
_encode = msgspec.msgpack.Encoder().encode


class Instant(Protocol):
    """A time that processes share [s], monotonic."""

    value: float


_seq = msgspec.msgpack.Decoder(msgspec.defstruct("Seq", [("seq", int)], tag="snapshot")).decode
_presences = msgspec.msgpack.Decoder(Presences).decode


def scene() -> Scene:
    """Fifty bodies."""
    nodes = tuple(Node(name=f"r/{i}", role="robot", owner="r", moves=True) for i in range(BODIES))
    return Scene(
        title="", edition="", version="0", workstation_hash="", period=0.01, nodes=nodes, criteria=()
    )


class Crowd:
    """Visitors of one process."""

    def __init__(self, port: int, count: int, offset: int) -> None:
        self.port, self.count, self.offset = port, count, offset
        self.sent: dict[tuple[int, int], float] = {}
        self.late: list[float] = []
        self.frames: Counter[int] = Counter()
        self.gaps: list[int] = []

    async def visit(self, own: int, until: Instant) -> None:
        """One visitor: moves, looks, acknowledges."""
        url = f"ws://127.0.0.1:{self.port}/ws"
        async with connect(url, subprotocols=[PROTOCOL], compression=None, max_size=2**24) as page:  # type: ignore[list-item]
            hello = msgspec.msgpack.decode(await page.recv())
            number = hello["visitor"]
            await page.send(_encode(Introduction(name=f"{own}", device="vr")))
            moving = asyncio.create_task(self.move(page, number, own, until))
            seen: dict[int, int] = {}
            async for data in page:
                now = time.monotonic()
                if b"presences" in data[:24] and own < OBSERVERS:
                    self.look(_presences(data), number, seen, now)
                elif b"snapshot" in data[:24]:
                    self.frames[own] += 1
                    if self.frames[own] % 4 == 0:  # as the page does
                        await page.send(_encode(Command(action="ack", value=_seq(data).seq)))
                if now > until.value:
                    break
            moving.cancel()

    async def move(self, page: object, number: int, own: int, until: Instant) -> None:
        """Say where one is, again and again; the count of it is in its height."""
        k, begun = 0, time.monotonic() + own / (RATE * self.count)
        points = np.random.default_rng(own).normal(size=75).astype("<f4").tobytes()
        while time.monotonic() < until.value:
            k += 1
            rows = np.tile(np.float32([own, k, 1.7, 1, 0, 0, 0]), (3, 1))
            self.sent[number, k] = time.monotonic()
            await page.send(_encode(Presence(poses=rows.tobytes(), points=points, laser=bytes(24))))  # type: ignore[attr-defined]
            await asyncio.sleep(max(0.0, begun + k / RATE - time.monotonic()))

    def look(self, told: Presences, number: int, seen: dict[int, int], now: float) -> None:
        """Note what is new."""
        for visitor in told.visitors:
            k = int(np.frombuffer(visitor.poses, "<f4", 2)[1])
            if visitor.id != number and k > seen.get(visitor.id, 0):
                seen[visitor.id] = k
                sent = self.sent.get((visitor.id, k))
                if sent is not None:
                    self.late.append(now - sent)

    async def all(self, until: Instant) -> None:
        """Everybody."""
        await asyncio.gather(*(self.visit(self.offset + i, until) for i in range(self.count)))


def crowd(port: int, count: int, offset: int, until: Instant, told: Connection) -> None:
    """In a process of its own."""
    found = Crowd(port, count, offset)
    asyncio.run(found.all(until))
    told.send((found.late, dict(found.frames)))


def measure(count: int, seconds: float) -> tuple[float, list[float], int, int]:
    """Processor share of the server's thread, how late poses were heard [s], frames lost to the good
    ones, and the fewest that one of them saw."""
    live, over = Live(), threading.Event()
    rng = np.random.default_rng(0)

    def publish() -> None:
        begun, k = time.monotonic(), 0
        while not over.is_set():
            poses = rng.normal(size=7 * BODIES).astype("<f4").tobytes()
            live.publish(Snapshot(seq=k, t=k * 0.01, poses=poses))
            k += 1
            over.wait(max(0.0, begun + k * 0.01 - time.monotonic()))

    context = multiprocessing.get_context("spawn")
    with Server(scene=scene(), meshes={}, feed=live, port=0) as server:
        publisher = threading.Thread(target=publish)
        publisher.start()
        # Counted once everybody is there, however long that takes.
        until = context.Value("d", math.inf)
        mine, theirs = context.Pipe()
        groups = [
            (count - 2, 0, until, theirs),
            (1, count - 2, context.Value("d", math.inf), None),
            (1, count - 1, context.Value("d", math.inf), None),
        ]
        people = [context.Process(target=crowd, args=(server.port, *each), daemon=True) for each in groups]
        for each in people:
            each.start()
        while len(server.hub.clients) < count:
            time.sleep(0.01)
        clock = time.pthread_getcpuclockid(server._thread.ident)  # type: ignore[union-attr, arg-type]
        begun, used = time.monotonic(), time.clock_gettime(clock)
        until.value = begun + seconds + 0.5
        time.sleep(seconds / 3)
        os.kill(people[1].pid, signal.SIGSTOP)  # type: ignore[arg-type]
        people[2].kill()
        before = {client: client.skipped for client in server.hub.clients}
        time.sleep(max(0.0, until.value - 0.5 - time.monotonic()))
        share = (time.clock_gettime(clock) - used) / (time.monotonic() - begun)
        # Of the stopped one the most are lost; the killed one is gone.
        lost = sum(
            sorted(client.skipped - before[client] for client in tuple(server.hub.clients))[: count - 2]
        )
        late, frames = mine.recv()
        least = min(frames.values())
        people[1].kill()
        over.set()
        publisher.join()
    return share, late, lost, least


def main() -> int:
    """Measure and judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    count, seconds = (5, 2.0) if options.smoke else (20, 20.0)
    share, late, lost, least = measure(count, seconds)
    p50, p95 = statistics.median(late), float(np.percentile(late, 95))
    print(
        f"{count} visitors, one stopped, one killed, {seconds:g} s, "
        f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
    )
    print(f"server's thread   {100 * share:.1f} % of a core (at most {100 * MOST_CPU:g})")
    print(
        f"poses heard late  p50 {1e3 * p50:.1f} ms, p95 {1e3 * p95:.1f} ms "
        f"(at most {1e3 * MOST_LATE:g}), {len(late)} of them"
    )
    print(f"frames lost       {lost} by the {count - 2} others, who saw {least} or more each")
    return 0 if options.smoke or (share <= MOST_CPU and p95 <= MOST_LATE) else 1


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    sys.exit(main())
