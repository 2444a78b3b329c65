"""Serves a made-up workstation through the real server, for the page's tests.

``python serve.py [--mode live|replay] [--port N] [--seconds S] [--tls FOLDER] [--further N] [--beside]``
prints one line of JSON with the address and when run time is zero by the machine's clock [s since 1970]
(with ``--tls`` those of each role, by an authority that is made in the folder), then obeys lines on standard
input (``freeze``, ``go``, ``finish``, ``stop``, ``start``, ``told``, ``snapshot T``) and ends with it. Each
answers with a line of JSON.
Everything is a function of run time: `snapshot`.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import json
import math
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from made_up_cell import HOSTILE, PERIOD, snapshot, workstation

from seerob.app.server import certificates
from seerob.app.server.access import Tokens
from seerob.app.server.feed import Audience
from seerob.app.server.live import Live
from seerob.app.server.player import Player
from seerob.app.server.serving import Server
from seerob.core.snapshot import History, Scene, Snapshot, Verdict
from seerob.recording.result_log import ResultLog


class Remembered:
    """A recording that is only in memory."""

    def __init__(self, scene: Scene, seconds: float) -> None:
        self.scene = scene
        self._snapshots = [snapshot(k, k * PERIOD) for k in range(round(seconds / PERIOD) + 1)]
        self.start, self.end = self._snapshots[0].t, self._snapshots[-1].t

    def snapshots(self, start: float | None = None, end: float | None = None) -> Iterator[Snapshot]:
        """Snapshots with ``start <= t <= end`` [s]."""
        for s in self._snapshots:
            if (start is None or s.t >= start) and (end is None or s.t <= end):
                yield s

    def snapshot_at(self, t: float) -> Snapshot:
        """The last snapshot at or before ``t`` [s]."""
        return next((s for s in reversed(self._snapshots) if s.t <= t), self._snapshots[0])


def other_run(scene: Scene, seconds: float) -> History:
    """Of a run that is longer, never in its work area, and of which energy is undecided from 5 to 8 s."""
    log = ResultLog(scene.criteria)
    for k in range(round(seconds / PERIOD) + 1):
        made = snapshot(k, k * PERIOD)
        results = {r.name: r for r in made.results if r.name != "manipulability"}
        area, energy = results["work area"], results["arm energy"]
        results["work area"] = msgspec.structs.replace(
            area, value=-0.25, limit=-0.1, verdict=Verdict.EXCEEDED, markers=()
        )
        if 5 <= made.t < 8:
            results["arm energy"] = msgspec.structs.replace(
                energy, verdict=Verdict.UNDECIDED, reason="who knows"
            )
        log.add(msgspec.structs.replace(made, results=tuple(results.values())))
    return History(traces=(), beside=log.history().traces, beside_title=f"other {HOSTILE}/run.mcap")


def _say(**fields: object) -> None:
    sys.stdout.write(json.dumps(fields) + "\n")
    sys.stdout.flush()


def _pin(certificate: Path) -> str:
    """What browsers take for the key of a certificate on their command line."""
    key = x509.load_pem_x509_certificate(certificate.read_bytes()).public_key()
    der = key.public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo)
    return base64.b64encode(hashlib.sha256(der).digest()).decode()


class Timed(Live):
    """A live run that knows how old each snapshot was when pages were offered it [s]."""

    def __init__(self, begun: float) -> None:
        super().__init__()
        self._begun = begun
        self.ages: deque[float] = deque(maxlen=1000)

    async def run(self, audience: Audience) -> None:
        """As any live run."""
        ages, begun = self.ages, self._begun

        class Noting:
            def show(self, snapshot: Snapshot, until: float = math.inf) -> None:
                ages.append(time.monotonic() - begun - snapshot.t)
                audience.show(snapshot, until)

            def __getattr__(self, name: str) -> object:
                return getattr(audience, name)

        await super().run(Noting())  # type: ignore[arg-type]


def _publish(live: Live, frozen: threading.Event, over: threading.Event, begun: float, further: int) -> None:
    k = 0
    while not over.is_set():
        if not frozen.is_set():
            made = snapshot(k, k * PERIOD, further)
            live.publish(made)
            if live.log is not None:
                live.log.add(made)
        # As a run that was held up: it goes on with the present, and hurries after nothing.
        k = max(k + 1, int((time.monotonic() - begun) / PERIOD))
        over.wait(max(0.0, begun + k * PERIOD - time.monotonic()))


def _named(thing: object) -> object:
    """What is an array on the wire, with the names of its fields."""
    if isinstance(thing, tuple):
        return [_named(one) for one in thing]
    if not isinstance(thing, msgspec.Struct):
        return thing
    fields = {k: _named(v) for k, v in msgspec.structs.asdict(thing).items()}
    return fields | {"type": thing.__struct_config__.tag}


def _told(scene: Scene, t: float) -> dict[str, object]:
    told = snapshot(round(t / PERIOD), round(t / PERIOD) * PERIOD)
    block = np.frombuffer(told.poses, "<f4").reshape(-1, 7).tolist()
    names = [node.name for node in scene.nodes]
    return {
        "t": told.t,
        "poses": dict(zip(names, block, strict=True)),
        "results": _named(told.results),
    }


def main() -> None:
    """Serve until standard input ends."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--mode", choices=("live", "replay"), default="live")
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=24.0)
    parser.add_argument("--tls", type=Path)
    parser.add_argument("--further", type=int, default=0, help="boxes that move besides, in a live run")
    parser.add_argument("--beside", action="store_true", help="another run, of a replay")
    options = parser.parse_args()
    tls = certificates.own(options.tls, "127.0.0.1") if options.tls else None
    scene, meshes = workstation(options.further)
    frozen, over = threading.Event(), threading.Event()
    recording = Remembered(scene, options.seconds) if options.mode == "replay" else None
    beside = other_run(scene, options.seconds + 6) if options.beside else None
    others = {"later/run.mcap": lambda: Remembered(scene, options.seconds + 3)} if beside else None
    begun, began = time.monotonic(), time.time()
    live = Timed(begun)
    live.log = ResultLog(scene.criteria)

    def open_server(port: int) -> Server:
        feed = Player(recording, beside=beside, others=others) if recording else live
        tokens = Tokens.made() if tls else None
        server = Server(scene=scene, meshes=meshes, feed=feed, port=port, tokens=tokens, tls=tls)
        pin = _pin(tls.authority) if tls and tls.authority else None
        _say(url=server.start(), port=server.port, urls=server.urls, pin=pin, begun=began)
        return server

    server = open_server(options.port)
    publisher = threading.Thread(
        target=_publish, args=(live, frozen, over, begun, options.further), daemon=True
    )
    if recording is None:
        publisher.start()
    for line in sys.stdin:
        if line.startswith("snapshot "):
            _say(**_told(scene, float(line.split()[1])))
            continue
        match line.strip():
            case "freeze":
                frozen.set()
            case "go":
                frozen.clear()
            case "slip" if live.log is not None:
                live.log.slip(live.log.slipped + 1.25)
            case "finish":
                frozen.set()
                live.finish()
            case "stop":
                server.stop()
            case "told":
                each = [(client.sent, client.skipped) for client in server.hub.clients]
                _say(ages=list(live.ages), clients=each)
                continue
            case "start":
                server = open_server(server.port)
                continue
        _say(done=line.strip())
    over.set()
    server.stop()


if __name__ == "__main__":
    main()
