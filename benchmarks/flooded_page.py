"""What a page that floods the server takes from a file-driven run and from another page, in one run.

The run goes as fast as it can; quiet and flooded stretches alternate, and their medians are compared. Floods:
commands (each was obeyed and answered once), acknowledgements, pings, and requests over HTTP. Ticks are
counted per second by the clock, and per second of this process's own time, in which the flooder, a process of
its own, has no share.

``--smoke`` is a short run without judgement.
"""

from __future__ import annotations

import argparse
import multiprocessing
import socket
import statistics
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import msgspec
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import seerob as sr
from seerob.app.server.live import LiveView
from seerob.core.snapshot import PROTOCOL, Command, Snapshot

FOLDER = Path(__file__).parents[1] / "workstations" / "two_robots"
LEAST = 0.9
"""Of the ticks, and of the frames, that are left in a flood."""
_encode = msgspec.msgpack.Encoder().encode


def _frame(opcode: int, payload: bytes) -> bytes:
    return bytes([0x80 | opcode, 0x80 | len(payload)]) + bytes(4) + payload


FLOODS = {
    "commands": _frame(2, _encode(Command(action="seek", value=1.0))) * 100,
    "acknowledgements": _frame(2, _encode(Command(action="ack", value=1.0))) * 100,
    "pings": _frame(9, b"") * 100,
    "requests": b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n" * 100,
}


def flood(port: int, what: str, on: threading.Event, over: threading.Event) -> None:
    """Send as fast as the other end reads, while ``on``; connect again where that ends."""
    upgrade = (
        "GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n"
        f"Sec-WebSocket-Protocol: {PROTOCOL}\r\n\r\n"
    ).encode()
    while not over.is_set():
        on.wait(0.1)
        with suppress(OSError), socket.create_connection(("127.0.0.1", port)) as link:
            if what != "requests":
                link.sendall(upgrade)
            while on.is_set() and not over.is_set():
                link.settimeout(0.02)
                with suppress(TimeoutError):
                    link.sendall(FLOODS[what])
                with suppress(TimeoutError, BlockingIOError):
                    link.settimeout(0.0)
                    if not link.recv(1 << 16):
                        break


class Onlooker(threading.Thread):
    """Another page, in this process; it counts its frames."""

    def __init__(self, port: int) -> None:
        super().__init__(daemon=True)
        self.seen = 0
        self._socket = connect(
            f"ws://127.0.0.1:{port}/ws", subprotocols=[PROTOCOL], compression=None, max_size=2**26
        )

    def run(self) -> None:
        """Acknowledge what comes."""
        decode = msgspec.msgpack.Decoder().decode
        with suppress(ConnectionClosed):
            for message in self._socket:
                said = decode(message)
                if said["type"] == Snapshot.__struct_config__.tag:
                    self.seen += 1
                    self._socket.send(_encode(Command(action="ack", value=said["seq"])))


def compare(what: str, seconds: float, pairs: int) -> tuple[float, float, float]:
    """What is left in a flood: ticks by the clock, ticks by own time, frames of another page, as shares."""
    station = sr.load(FOLDER)
    context = multiprocessing.get_context("spawn")
    on, over = context.Event(), context.Event()
    rates: dict[bool, list[tuple[float, float, float]]] = {True: [], False: []}
    with LiveView(scene=station.scene(), meshes=station.model.meshes, port=0) as view:
        flooder = context.Process(target=flood, args=(view.server.port, what, on, over), daemon=True)
        flooder.start()
        looking = Onlooker(view.server.port)
        looking.start()
        begun = time.monotonic(), time.process_time(), 0, looking.seen
        ticks, phase, ended = 0, -1, False

        def progress(_: float) -> None:
            nonlocal begun, ticks, phase, ended
            ticks += 1
            now = time.monotonic()
            if now - begun[0] < seconds:
                return
            own, seen = time.process_time(), looking.seen
            if phase >= 0:  # the first stretch is for whatever begins
                count = ticks - begun[2]
                found = (
                    count / (now - begun[0]),
                    count / (own - begun[1]),
                    (seen - begun[3]) / (now - begun[0]),
                )
                rates[on.is_set()].append(found)
            phase += 1
            ended = phase >= 2 * pairs
            (on.clear if on.is_set() else on.set)()
            begun = now, own, ticks, seen

        while not ended:
            station.run(writers=[_Kept(view)], stop=lambda: ended, progress=progress)
        over.set()
        flooder.join()
    quiet, flooded = (
        [statistics.median(column) for column in zip(*rates[which], strict=True)] for which in (False, True)
    )
    return tuple(f / q for f, q in zip(flooded, quiet, strict=True))  # type: ignore[return-value]


class _Kept:
    """The view, not closed when one round of the motion ends."""

    def __init__(self, view: LiveView) -> None:
        self.write = view.write

    def close(self) -> None:
        """Nothing."""

    def __enter__(self) -> _Kept:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def main() -> int:
    """Print the shares; 1 when one of them is too small."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    parser.add_argument("--seconds", type=float, default=3.0, help="of each stretch")
    parser.add_argument("--pairs", type=int, default=5)
    options = parser.parse_args()
    seconds, pairs = (0.3, 1) if options.smoke else (options.seconds, options.pairs)
    least = 1.0
    for what in FLOODS:
        clock, own, frames = compare(what, seconds, pairs)
        least = min(least, own, frames)
        text = f"{clock:.2f} of the ticks by the clock, {own:.2f} by own time, {frames:.2f} of the frames"
        print(f"{what:<17} leave {text}")
    print(f"goal: {LEAST} of the ticks by own time and of the frames")
    return 0 if options.smoke or least >= LEAST else 1


if __name__ == "__main__":
    sys.exit(main())
