"""How late live sources are: from the packet to the mailbox, and to the State that uses it.

A UR10 over RTDE, a 7-axis arm over FRI and the variables of a cell over OPC UA at once, each emulated by a
process of its own, beside a person with distances between all of them. A packet is as old as the kernel of
this machine says; of a stream (RTDE), packets that are read together are as old as the newest of them. The
peer is the same listeners with no twin beside them: what this machine makes late. A machine that does
other things beside makes everything late: ``chrt -f 1 python benchmarks/live.py`` goes before them.

``--seconds`` is the length of either part, ``--switch`` how long a thread keeps the interpreter
[s] instead of what a live run sets, ``--smoke`` a short run without judgement.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

import seerob as sr
from seerob import live, run
from seerob.samples import SignalSample, key

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
MAILBOX, BEYOND_TICK = 2e-3, 3e-3
"""Budgets of the 99th percentile [s]: packet to mailbox, and to the State beyond one tick."""


class Post:
    """Notes every sample between its arrival and the mailbox, and what each tick took."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.arrived: dict[tuple[str, int], float] = {}
        self.mailbox: dict[str, list[float]] = defaultdict(list)
        self.posted: dict[tuple[str, int], float] = {}
        self.taken: list[tuple[float, tuple]] = []

    @contextlib.contextmanager
    def watching(self):
        """Patch the road while it is driven on."""
        hear, take = live.Listener._take, live.Listening.take

        def heard(listener, sample):
            before = listener._seq
            hear(listener, sample)
            posted = time.monotonic()
            if listener._seq == before:
                return
            with self.lock:
                self.arrived[listener.name, before] = sample.t
                self.posted[listener.name, before] = posted
                self.mailbox[listener.name].append(posted - sample.t)

        def taking(listening):
            now, found = time.monotonic(), take(listening)
            self.taken.append((now, found))
            return found

        live.Listener._take, live.Listening.take = heard, taking
        try:
            yield self
        finally:
            live.Listener._take, live.Listening.take = hear, take


class States:
    """A writer that notes what each State was made from, and when it was there."""

    def __init__(self, seconds: float) -> None:
        self.end = seconds
        self.ticks: list[tuple[float, tuple]] = []
        self.undecided, self.over = 0, False

    def write(self, snapshot, samples) -> None:
        self.ticks.append((time.monotonic(), samples))
        self.undecided += any(r.verdict == sr.Verdict.UNDECIDED for r in snapshot.results)
        self.over = snapshot.t >= self.end

    def ages(self, post: Post) -> dict[str, list[float]]:
        """Between the arrival of samples and the State with its results, by source [s]."""
        found = defaultdict(list)
        for instant, samples in self.ticks[1:]:  # the first waits for the beginning
            for sample in samples:
                arrived = post.arrived.get((sample.source, sample.seq))
                if arrived is not None:
                    found[sample.source].append(instant - arrived)
        return found

    def close(self) -> None: ...

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None: ...


@contextlib.contextmanager
def emulators(*commands: list[str]):
    """Emulators, and the port of each."""
    with contextlib.ExitStack() as stack:
        ports = []
        for command in commands:
            whole = [sys.executable, "-m", "seerob.cli", "emulate", *command]
            process = stack.enter_context(subprocess.Popen(whole, stdout=subprocess.PIPE, text=True))
            stack.callback(process.terminate)
            ports.append(int([re.search(r":(\d+)", process.stdout.readline()) for _ in range(2)][1][1]))
        yield ports


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
    count, newest = 0, {}
    for now, samples in post.taken:
        for sample in samples:
            if not isinstance(sample, SignalSample):
                newest[key(sample), sample.source] = sample.seq
        for (_, source), seq in newest.items():
            following = post.posted.get((source, seq + 1))
            count += following is not None and following < now - period
    return count


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--switch", type=float)
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    seconds = 0.5 if options.smoke else options.seconds
    if options.switch is not None:
        live.PROMPT = options.switch
    print(f"work that waits on this machine before: {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores")
    fri = free_port()
    commands = [["rtde", "--port", "0"], ["opcua", "--port", "0"], ["fri", "--port", str(fri)]]
    with emulators(*commands) as (rtde, opcua, _), tempfile.TemporaryDirectory() as folder:
        station = cell(folder, rtde, fri, opcua)
        sources = [s for s in station.workstation.sources if isinstance(s, live.LiveSource)]
        _ = station.sources
        with Post().watching() as alone:
            pairs = [(source, run.source_target(station.model, source)) for source in sources]
            with live.Listening(pairs) as listening:
                listening.first(5.0)
                time.sleep(seconds)
        with Post().watching() as post:
            states = States(seconds)
            summary = station.run(live=True, writers=[states], stop=lambda: states.over)
    period = station.workstation.engine.tick
    base = table("packet to mailbox, listeners alone", alone.mailbox)
    own = table("packet to mailbox, beside the twin", post.mailbox)
    state = table("packet to State and results", states.ages(post))
    for name, late in own.items():
        print(f"{name}: p99 {late / base[name]:.2f} x that of the listener alone")
    print(
        f"tick {1e3 * period:g} ms, {len(states.ticks)} ticks, {states.undecided} with something undecided, "
        f"slipped {summary.slipped:.3f} s"
    )
    print(f"older than a tick and used while a newer one was there: {used_late(post, period)}")
    for what, found, budget in (
        ("packet to mailbox", max(own.values()), MAILBOX),
        ("packet to State", max(state.values()), period + BEYOND_TICK),
    ):
        print(f"{what} p99 {1e3 * found:.2f} ms, budget {1e3 * budget:g} ms: {found / budget:.2f} of it")


if __name__ == "__main__":
    main()
