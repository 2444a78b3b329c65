"""A small scene, its snapshots, and a visitor, for the tests of the server."""

import contextlib
import select
import socket
import ssl
import threading

import msgspec
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from seerob.core import snapshot as wire
from seerob.core.snapshot import Arrow, Command, CriterionInfo, Node, Result, Scene, Snapshot, Verdict

PATIENCE = 60.0
"""With what comes for sure [s]."""

MESHES = {"ab" * 32: b"glTF" + bytes(100)}


def scene(nodes=3):
    return Scene(
        title="made up",
        edition="ISO/TS 15066:2016",
        version="0",
        workstation_hash="00" * 32,
        period=0.01,
        nodes=tuple(Node(name=f"r/link_{i}", role="robot", owner="r", mesh="ab" * 32) for i in range(nodes)),
        criteria=(
            CriterionInfo(name="distance", kind="minimum_distance", group="safety", title="Distance."),
        ),
    )


def snapshot(k, nodes=3):
    rng = np.random.default_rng(k)
    value = float(rng.normal())
    return Snapshot(
        seq=k,
        t=k * 0.01,
        poses=rng.normal(size=7 * nodes).astype("<f4").tobytes(),
        joints={"r": tuple(rng.normal(size=6).tolist())},
        results=(
            Result(
                name="distance",
                value=value,
                limit=1.0,
                verdict=Verdict.WITHIN if value <= 1.0 else Verdict.EXCEEDED,
                markers=(Arrow(origin=(0.0, 0.0, 0.0), vector=tuple(rng.normal(size=3).tolist())),),
            ),
        ),
    )


class Remembered:
    """What `Recording` offers to a player, in memory."""

    def __init__(self, snapshots, recorded_scene=None):
        self._snapshots = list(snapshots)
        self.scene = recorded_scene or scene()
        self.start, self.end = self._snapshots[0].t, self._snapshots[-1].t

    def snapshots(self, start=None, end=None):
        for s in self._snapshots:
            if (start is None or s.t >= start) and (end is None or s.t <= end):
                yield s

    def snapshot_at(self, t):
        return next((s for s in reversed(self._snapshots) if s.t <= t), self._snapshots[0])


class OneAtATime(ssl.SSLSocket):
    """Read in one thread and written in another: OpenSSL serves one at a time, or loses what is written.

    ``websockets`` does so without a lock, and so does Python up to 3.12 (python/cpython#124984).
    """

    def __new__(cls, *arguments, **options):
        made = super().__new__(cls, *arguments, **options)
        made.turn = threading.Lock()
        return made

    def recv(self, *arguments):
        while True:
            if not self.pending() and not select.select([self], [], [], self.gettimeout())[0]:
                raise TimeoutError
            with self.turn:
                patience = self.gettimeout()
                super().settimeout(0)
                try:
                    return super().recv(*arguments)
                except ssl.SSLWantReadError:  # what came was no message
                    continue
                finally:
                    super().settimeout(patience)

    def settimeout(self, value):
        with self.turn:
            super().settimeout(value)

    def sendall(self, *arguments):
        with self.turn:
            super().sendall(*arguments)


class Visitor:
    """A page without a screen: decodes what comes and, unless told otherwise, acknowledges frames."""

    _decoder = msgspec.msgpack.Decoder(
        wire.Hello
        | wire.Scene
        | wire.History
        | wire.SoFar
        | wire.Transport
        | wire.Snapshot
        | wire.Draft
        | wire.Edited
        | wire.Measured
        | wire.Visitors
        | wire.Presences
    )

    def __init__(self, server, *, acknowledge=True, path="/ws", **options):
        options.setdefault("subprotocols", [wire.PROTOCOL])
        options.setdefault("open_timeout", PATIENCE)
        scheme = "ws"
        if "ssl" in options:
            scheme, options["ssl"].sslsocket_class = "wss", OneAtATime
        self._open = connect(
            f"{scheme}://127.0.0.1:{server.port}{path}", compression=None, max_size=2**26, **options
        )
        self.socket = self._open.__enter__()
        self.acknowledge = acknowledge

    def read(self, timeout=PATIENCE):
        message = self._decoder.decode(self.socket.recv(timeout=timeout))
        if isinstance(message, Snapshot) and self.acknowledge:
            self.ask("ack", message.seq)
        return message

    def until(self, accept, timeout=PATIENCE):
        """The first message that is accepted; those before it are dropped."""
        while True:
            message = self.read(timeout)
            if accept(message):
                return message

    def end(self, timeout=PATIENCE):
        """Read until the server ends the connection; the code and the reason that it gave."""
        try:
            while True:
                self.read(timeout)
        except ConnectionClosed as closed:
            return (closed.rcvd.code, closed.rcvd.reason) if closed.rcvd else (1006, "")

    def of(self, kind, timeout=PATIENCE):
        return self.until(lambda m: isinstance(m, kind), timeout)

    def ask(self, action, value=None):
        self.socket.send(msgspec.msgpack.encode(Command(action=action, value=value)))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with contextlib.suppress(Exception):
            self._open.__exit__(None, None, None)


def raw(server, data, *, finish=False):
    """What the server answers to bytes, until it closes."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as s:
        s.sendall(data)
        if finish:
            s.shutdown(socket.SHUT_WR)
        answer = b""
        while chunk := s.recv(65536):
            answer += chunk
        return answer
