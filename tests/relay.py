"""A wire between a device and who listens to it, that can be cut or garbled: ``from relay import …``."""

from __future__ import annotations

import queue
import random
import socket
import threading
import time
from collections import deque
from contextlib import suppress
from enum import StrEnum

HERE = "127.0.0.1"
MERGING = 0.03
"""[s]"""
LOOP = 120
"""Pieces that are played again and again, or among those that come."""
LENGTHS = (b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\0")


class Garbled(StrEnum):
    """What happens to what the device says."""

    NOT = "not"
    SPLIT = "split"
    MERGED = "merged"
    FLIPPED = "flipped"
    DOUBLED = "doubled"
    SWAPPED = "swapped"
    CUT = "cut"
    LENGTHS = "lengths"
    NOISE = "noise"
    AGAIN = "again"
    AMONG = "among"


class Wire:
    """What comes out of what goes in.

    Args:
        seed: Of what is done where.
    """

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._held: list[bytes] = []
        self._last: deque[bytes] = deque(maxlen=LOOP)
        self.how = Garbled.NOT
        self.passed = 0
        """Pieces that went in."""

    def pass_on(self, data: bytes, *, whole: bool) -> list[bytes]:
        """Pieces that come out; an empty one where it is cut.

        Args:
            data: A piece of a stream, or a datagram.
            whole: Whether pieces keep their ends, as datagrams do.
        """
        rng, how = self._random, self.how
        self.passed += 1
        if how in (Garbled.AGAIN, Garbled.AMONG) and self._last:
            self._last.rotate(-1)
            return [self._last[-1], data][: 1 + (how is Garbled.AMONG)]
        self._last.append(data)
        some, at = rng.random() < 0.3, rng.randrange(len(data) + 1)
        match how:
            case Garbled.SPLIT if not whole:
                step = 1 if len(data) < 400 else 7
                return [data[k : k + step] for k in range(0, len(data), step)]
            case Garbled.FLIPPED if some and at:
                return [data[: at - 1] + bytes([data[at - 1] ^ 1 << rng.randrange(8)]) + data[at:]]
            case Garbled.DOUBLED if some:
                return [data, data if whole else data[:at]]
            case Garbled.SWAPPED if whole:
                self._held.append(data)
                return [] if len(self._held) % 4 else rng.sample(self._release(), 4)
            case Garbled.SWAPPED if some:
                return [data[at:] + data[:at]]
            case Garbled.CUT if some:
                return [data[:at]] if whole else [data[:at], b""]
            case Garbled.LENGTHS if some:
                return [data[:at] + rng.choice(LENGTHS) + data[at + 4 :]]
            case Garbled.NOISE if some:
                return [rng.randbytes(1 + at)]
        return [*self._release(), data]

    def _release(self) -> list[bytes]:
        held, self._held = self._held, []
        return held


class Stream(Wire):
    """A wire of TCP: who connects to `port` is connected to the device.

    Args:
        to: The device's port.
        seed: Of what is done where.
        port: To listen on; any free one when 0.
        back: Whether the device is the one who connects.
    """

    def __init__(self, to: int, *, seed: int = 1, port: int = 0, back: bool = False) -> None:
        super().__init__(seed)
        self._to, self._back = to, back
        self._listening = socket.create_server((HERE, port))
        self.port = self._listening.getsockname()[1]
        self._open: set[socket.socket] = set()
        self.deaf = False
        """Whether nobody who connects is let through."""
        self.late = 0.0
        """How much later than it was said all arrives that the device says from now on [s]."""
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self) -> None:
        """Cut what is connected, without a word."""
        for each in list(self._open):
            _shut(each)

    def close(self) -> None:
        """End it."""
        _shut(self._listening)
        self.cut()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listening.accept()
            except OSError:
                return
            try:
                if self.deaf:
                    raise ConnectionRefusedError
                device = socket.create_connection((HERE, self._to))
            except OSError:
                client.close()
                continue
            self._open |= {client, device}
            for a, b, said in ((client, device, self._back), (device, client, not self._back)):
                threading.Thread(target=self._carry, args=(a, b, said), daemon=True).start()

    def _carry(self, a: socket.socket, b: socket.socket, said: bool) -> None:
        pieces = queue.SimpleQueue()
        threading.Thread(target=self._deliver, args=(pieces, b), daemon=True).start()
        with suppress(OSError):
            while data := self._read(a, said):
                for piece in self.pass_on(data, whole=False) if said else [data]:
                    if not piece:
                        raise OSError
                    if said and self.late:
                        pieces.put((time.monotonic() + self.late, piece))
                    else:
                        b.sendall(piece)
        pieces.put((0.0, b""))
        for each in (a, b):
            self._open.discard(each)
            _shut(each)

    def _deliver(self, pieces: queue.SimpleQueue[tuple[float, bytes]], b: socket.socket) -> None:
        with suppress(OSError):
            while (item := pieces.get())[1]:
                time.sleep(max(0.0, item[0] - time.monotonic()))
                b.sendall(item[1])

    def _read(self, a: socket.socket, said: bool) -> bytes:
        if said and self.how is Garbled.MERGED:
            time.sleep(MERGING)  # meanwhile the system puts together what comes
        return a.recv(65536)


class Datagrams(Wire):
    """A wire of UDP: what comes to `port` goes on, and answers go back to who sent last.

    Args:
        to: Where it goes.
        seed: Of what is done where.
        port: To listen on; any free one when 0.
        back: Whether the device is the one who answers.
    """

    def __init__(self, to: int, *, seed: int = 1, port: int = 0, back: bool = False) -> None:
        super().__init__(seed)
        self._near, self._far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for each in (self._near, self._far):
            each.settimeout(0.2)
        self._near.bind((HERE, port))
        self._far.bind((HERE, 0))
        self.port = self._near.getsockname()[1]
        self._who = HERE, to
        self._sender: tuple[str, int] | None = None
        for inward in (True, False):
            threading.Thread(target=self._carry, args=(inward, inward != back), daemon=True).start()

    def close(self) -> None:
        """End it."""
        for each in (self._near, self._far):
            _shut(each)

    def _carry(self, inward: bool, said: bool) -> None:
        a, b = (self._near, self._far) if inward else (self._far, self._near)
        while True:
            try:
                data, sender = a.recvfrom(65536)
            except TimeoutError:
                continue
            except OSError:
                return
            if inward:
                self._sender = sender
            to = self._who if inward else self._sender
            with suppress(OSError):
                for piece in self.pass_on(data, whole=True) if said else [data]:
                    if to is not None:
                        b.sendto(piece, to)


def _shut(each: socket.socket) -> None:
    with suppress(OSError):
        each.shutdown(socket.SHUT_RDWR)
    each.close()
