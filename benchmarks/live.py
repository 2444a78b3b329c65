"""How late live sources are: from the packet to the mailbox, and to the State that uses it.

A UR10 over RTDE, a 7-axis arm over FRI and the variables of a cell over OPC UA at once, each emulated by a
process of its own, beside a person with distances between all of them. A packet is as old as the kernel of
this machine says. Of a stream (RTDE) the kernel keeps the stamp of the newest packet that it holds: those
before it that are read together with it count as old as they can be: as when the emulator wrote them, which
it notes on the clock that both share. The emulators stand for other machines and leave this one's time to the
twin (``nice``).
The peer is the same listeners with no twin beside them: what this machine makes late. A machine that does
other things beside makes everything late: ``chrt -f 1 python benchmarks/live.py`` goes before them.

``--seconds`` is the length of either part, ``--smoke`` a short run without judgement.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import numpy as np

import seerob as sr
from seerob.app import cli
from seerob.app.emulators.rtde import RtdeServer
from seerob.core.samples import SignalSample, key
from seerob.devices.live import listening_process, receivers, source_process
from seerob.devices.live.listening import Listener, LiveSource, name_of

FOLDER = Path(__file__).parents[1] / "workstations" / "plc_cell"
KUKA = """
[[robots]]
name = "lbr"
model = "library:iiwa14"
base = {{ position = [0.6, -1.0, 0.75] }}

[[sources]]
kind = "fri"
robot = "lbr"
host = "127.0.0.1"
port = {port}
frequency = 200
timeout = 0.3
origin = "simulator"

[[safety]]
kind = "minimum_distance"
name = "lbr – operator"
between = ["lbr", "operator"]
limit = 0.05

"""
PATIENCE = 30.0
"""With a source that is not heard, beyond the length of a part [s]: a busy machine starts late."""
MAILBOX, BEYOND_TICK = 2e-3, 3e-3
"""Budgets of the 99th percentile [s]: packet to mailbox, and to the State beyond one tick."""


class Post:
    """Every sample between its arrival and the mailbox, and what each tick took."""

    def __init__(self, notes: Path) -> None:
        self._notes = notes
        notes.mkdir()
        self.came: dict[tuple[str, bool], list[tuple[int, float, float | None]]] = defaultdict(list)
        """Sequence number, arrival and device's time of samples, by source and whether they are signals."""
        self.posted: dict[tuple[str, int], float] = {}
        self.taken: list[tuple[float, tuple]] = []
        self.heard: set[str] = set()

    @contextlib.contextmanager
    def watching(self):
        """Note what is taken while the road is driven on, and afterwards what the listeners noted."""
        take = receivers.Receivers.take

        def taking(listening):
            now, found = time.monotonic(), take(listening)
            self.taken.append((now, found))
            self.heard.update(sample.source for sample in found)
            return found

        receivers.Receivers.take = taking
        source_process.COMMAND = (sys.executable, __file__, "--listen", str(self._notes))
        try:
            yield self
        finally:
            receivers.Receivers.take = take
        for notes in self._notes.iterdir():
            for name, signals, seq, instant, device, posted in json.loads(notes.read_bytes()):
                self.posted[name, signals, seq] = posted
                self.came[name, signals].append((seq, instant, device))

    def arrived(self, written: dict[float, float]) -> dict[tuple[str, bool, int], float]:
        """When each sample came in at the earliest, by source, whether it is of signals, and number [s].

        Signals that are told again while nothing is heard are no packet.

        Args:
            written: When the emulator of a stream wrote each packet, by the device's time.
        """
        found = {}
        for (source, signals), said in self.came.items():
            firsts: dict[float, tuple[int, float, float | None]] = {}
            for one in said:
                firsts.setdefault(one[1], one)
            came = list(firsts.values()) if signals else said
            for k, (seq, instant, device) in enumerate(came):
                # Datagrams may share an instant, too, and it is theirs.
                shared = k + 1 < len(came) and came[k + 1][1] == instant
                found[source, signals, seq] = (
                    min(instant, written.get(device, instant)) if shared else instant
                )
        return found

    def mailbox(self, written: dict[float, float], since: float) -> dict[str, list[float]]:
        """Between arrival and mailbox, by source [s]; of what arrived since everybody had begun."""
        found = defaultdict(list)
        for (source, signals, seq), instant in self.arrived(written).items():
            if instant >= since:
                found[source].append(self.posted[source, signals, seq] - instant)
        return found

    def together(self) -> dict[str, float]:
        """Share of the samples that came in together with a later one, by source."""
        found = {}
        for (source, signals), came in self.came.items():
            if not signals:
                instants = [instant for _, instant, _ in came]
                found[source] = 1 - len(set(instants)) / len(instants)
        return found


class States:
    """A writer that notes what each State was made from, and when it was there."""

    def __init__(self, seconds: float) -> None:
        self.end = seconds
        self.ticks: list[tuple[float, tuple]] = []
        self.undecided, self.now = 0, 0.0

    def write(self, snapshot, samples) -> None:
        self.ticks.append((time.monotonic(), samples))
        self.undecided += any(r.verdict == sr.Verdict.UNDECIDED for r in snapshot.results)
        self.now = snapshot.t

    def over(self, all_heard: bool) -> bool:
        """Whether it has lasted long enough; who is not heard yet is waited for a while."""
        return self.now >= self.end + (0.0 if all_heard else PATIENCE)

    def ages(self, post: Post, written: dict[float, float]) -> dict[str, list[float]]:
        """Between the arrival of samples and the State with its results, by source [s]."""
        found, arrived = defaultdict(list), post.arrived(written)
        for instant, samples in self.ticks[1:]:  # the first waits for the beginning
            for sample in samples:
                came = arrived.get((sample.source, isinstance(sample, SignalSample), sample.seq))
                if came is not None:
                    found[sample.source].append(instant - came)
        return found

    def close(self) -> None: ...

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None: ...


NOTED = struct.Struct("<dd")
"""Device's time and the machine's monotonic one, of a packet that is written to a stream."""


def emulate(notes: str, command: list[str], *, nice: int) -> int:
    """``seerob emulate``, with a note of when each RTDE packet was made, just before it is written."""
    os.nice(nice)
    at = RtdeServer.at
    with Path(notes).open("ab", buffering=0) as file:

        def noted(server, t):
            file.write(NOTED.pack(t, time.monotonic()))
            return at(server, t)

        RtdeServer.at = noted
        return cli.main(["emulate", *command])


def listen(notes: str) -> int:
    """The process that listens, with a note of when each sample was in the mailbox."""
    hear, noted = Listener.take, []

    def heard(listener, sample):
        signals = isinstance(sample, SignalSample)
        what = ("signal", listener.name) if signals else key(sample)
        before = (told := listener._told.get(what)) and told.posted
        hear(listener, sample)
        posted = (told := listener._told.get(what)) and told.posted
        if posted is not None and posted is not before:
            noted.append((listener.name, signals, posted.seq, sample.t, sample.t_device, time.monotonic()))

    Listener.take = heard
    code = listening_process.main()
    Path(notes, str(os.getpid())).write_text(json.dumps(noted))
    return code


def written(notes: Path) -> dict[float, float]:
    """When each packet was written, by the device's time."""
    return dict(NOTED.iter_unpack(notes.read_bytes()))


@contextlib.contextmanager
def emulators(notes: Path, *commands: list[str], smoke: bool):
    """Emulators, and the port of each; they step back for the twin, unless it is not judged."""
    with contextlib.ExitStack() as stack:
        started = []
        for command in commands:
            whole = [sys.executable, __file__, *["--smoke"] * smoke, "--emulate", str(notes), *command]
            process = stack.enter_context(subprocess.Popen(whole, stdout=subprocess.PIPE, text=True))
            stack.callback(process.terminate)
            started.append(process.stdout)
        yield [int([re.search(r":(\d+)", said.readline()) for _ in range(2)][1][1]) for said in started]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        return link.getsockname()[1]


def cell(folder: str, rtde: int, fri: int, opcua: int) -> sr.Station:
    text = (FOLDER / "workstation.toml").read_text()
    text = text.replace("frequency = 125 ", "frequency = 500 ").replace(":4840", f":{opcua}")
    text = text.replace('kind = "rtde"\n', f'kind = "rtde"\nport = {rtde}\n')
    Path(folder, "workstation.toml").write_text(text + KUKA.format(port=fri))
    Path(folder, "variables.toml").write_text((FOLDER / "variables.toml").read_text())
    return sr.load(folder)


def table(title: str, late: dict[str, list[float]]) -> dict[str, float]:
    """Print a line per source; the 99th percentile of each [s]."""
    print(title)
    return {name: line(f"  {name}", values) for name, values in sorted(late.items())}


def line(what: str, late: list[float]) -> float:
    p50, p99, worst = 1e3 * np.percentile(late, (50, 99, 100))
    print(f"{what:<34} {len(late):6d}   p50 {p50:6.2f} ms   p99 {p99:6.2f} ms   worst {worst:6.2f} ms")
    return p99 * 1e-3


def used_late(post: Post, period: float) -> int:
    """Ticks that used a sample older than one tick while a newer one had been in the mailbox."""
    count, newest, after = 0, {}, {}
    for (source, signals), came in post.came.items():
        if not signals:
            after |= {(source, one[0]): post.posted[source, False, two[0]] for one, two in pairwise(came)}
    for now, samples in post.taken:
        for sample in samples:
            if not isinstance(sample, SignalSample):
                newest[key(sample), sample.source] = sample.seq
        for (_, source), seq in newest.items():
            following = after.get((source, seq))
            count += following is not None and following < now - period
    return count


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--smoke", action="store_true")
    parser.add_argument("--emulate", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    parser.add_argument("--listen", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.emulate:
        sys.exit(emulate(options.emulate[0], options.emulate[1:], nice=0 if options.smoke else 10))
    if options.listen:
        sys.exit(listen(options.listen))
    # Emulators and listeners, which are this file too, do without it as those of a run do.
    from seerob.session.opening import source_target

    seconds = 0.5 if options.smoke else options.seconds
    print(f"work that waits on this machine before: {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores")
    fri = free_port()
    commands = [["rtde", "--port", "0"], ["opcua", "--port", "0"], ["fri", "--port", str(fri)]]
    with (
        tempfile.TemporaryDirectory() as folder,
        emulators(Path(folder, "written"), *commands, smoke=options.smoke) as (rtde, opcua, _),
    ):
        station = cell(folder, rtde, fri, opcua)
        sources = [s for s in station.workstation.sources if isinstance(s, LiveSource)]
        names = {name_of(source) for source in sources}
        _ = station.sources
        with Post(Path(folder, "alone")).watching() as alone:
            pairs = [(source, source_target(station.model, source)) for source in sources]
            with receivers.Receivers(pairs) as listening:
                listening.first(5.0)
                begun = time.monotonic()
                time.sleep(seconds)
                end = time.monotonic() + PATIENCE
                while not alone.heard >= names and time.monotonic() < end:
                    listening.take()
                    time.sleep(0.05)
        with Post(Path(folder, "beside")).watching() as post:
            states = States(seconds)
            summary = station.run(live=True, writers=[states], stop=lambda: states.over(post.heard >= names))
        made = written(Path(folder, "written"))
    period = station.workstation.engine.tick
    base = table("packet to mailbox, listeners alone", alone.mailbox(made, begun))
    mailbox, ages = post.mailbox(made, states.ticks[0][0]), states.ages(post, made)
    own = table("packet to mailbox, beside the twin", mailbox)
    table("packet to State and results", ages)
    for name, share in post.together().items():
        print(f"{name}: {100 * share:.2f} % were read together with a later one and count as old as can be")
    for name in sorted(own.keys() & base):
        print(f"{name}: p99 {own[name] / base[name]:.2f} x that of the listener alone")
    print(
        f"tick {1e3 * period:g} ms, {len(states.ticks)} ticks, {states.undecided} with something undecided, "
        f"slipped {summary.slipped:.3f} s"
    )
    print(f"older than a tick and used while a newer one was there: {used_late(post, period)}")
    for what, late, budget in (
        ("packet to mailbox", mailbox, MAILBOX),
        ("packet to State", ages, period + BEYOND_TICK),
    ):
        every = float(np.percentile([x for values in late.values() for x in values], 99))
        worst = max(float(np.percentile(values, 99)) for values in late.values())
        print(
            f"{what} p99 {1e3 * every:.2f} ms, of the latest source alone {1e3 * worst:.2f} ms, "
            f"budget {1e3 * budget:g} ms: {every / budget:.2f} and {worst / budget:.2f} of it"
        )


if __name__ == "__main__":
    main()
