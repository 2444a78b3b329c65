"""What the checks against strangers cost a tick and a start, as shares of them, in one process.

A tick is one of two_robots without a page. Its price: what `Live.publish` adds to handing a snapshot over,
what `Hearing.take` adds to keeping a sample of each robot, and for one page at 60 Hz the allowance of each
acknowledgement and the age of each frame. A start is loading and compiling two_robots; its price: the modules
of roles, tokens, rates and visits, and making them. Time of this thread, the least of several.

``--smoke`` is a short run without judgement.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import seerob as sr
from seerob.app.server.access import Tokens, Visits
from seerob.app.server.allowance import Allowance
from seerob.app.server.live import Live
from seerob.core.snapshot import Snapshot
from seerob.twin.validity.hearing import Heard, Hearing

FOLDER = Path(__file__).parents[1] / "workstations" / "two_robots"
MOST = 0.01
"""Of a tick, and of a start."""
PAGE = 60.0
"""Frames per second."""
MODULES = ("access", "allowance")


def least(act: Callable[[], object], times: int, rounds: int) -> float:
    """Time of one call [s]."""
    found = []
    for _ in range(rounds):
        begun = time.thread_time()
        for _ in range(times):
            act()
        found.append((time.thread_time() - begun) / times)
    return min(found)


class _Timed:
    """A writer that notes how long each tick took, without the first second."""

    def __init__(self) -> None:
        self.taken: list[float] = []
        self._then = time.thread_time()

    def write(self, snapshot: Snapshot, samples: object) -> None:
        now = time.thread_time()
        if snapshot.t > 1.0:
            self.taken.append(now - self._then)
        self._then = now

    def close(self) -> None:
        """Nothing."""

    def __enter__(self) -> _Timed:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def tick(station: sr.Station, ticks: int) -> float:
    """Median time of a tick [s]."""
    timed = _Timed()
    station.run(writers=[timed], stop=lambda: len(timed.taken) >= ticks)
    return sorted(timed.taken)[len(timed.taken) // 2]


def price_of_tick(period: float, rounds: int) -> float:
    """What the checks add to a tick [s]."""
    live, plain = Live(), deque[tuple[Snapshot, float]](maxlen=8192)
    shown = Snapshot(seq=0, t=0.0, poses=b"", joints={}, results=())
    publish = least(lambda: live.publish(shown), 5000, rounds)
    publish -= least(lambda: plain.append((shown, 0.0)), 5000, rounds)
    hearing, samples, said = Hearing(given=False, driven=True), deque[Heard](maxlen=4), Heard(0.0)

    def hear() -> None:
        hearing.take(said)
        del hearing.heard[:-4]

    def keep() -> None:
        samples.append(said)

    heard = least(hear, 5000, rounds) - least(keep, 5000, rounds)
    allowance = Allowance(1e9, 1e9)
    page = least(allowance.take, 5000, rounds) + least(time.monotonic, 5000, rounds)
    return publish + 2 * heard + page * PAGE * period


def price_of_start(rounds: int) -> float:
    """What modules and objects of the checks add to a start [s]."""
    code = (
        "import time, secrets, tomllib, hmac, msgspec, seerob.core.errors, seerob.recording.format\n"
        "begun = time.process_time()\n"
        + "".join(f"import seerob.app.server.{name}\n" for name in MODULES)
        + "print(time.process_time() - begun)"
    )
    said = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        for _ in range(rounds)
    ]
    return min(map(float, said)) + least(lambda: (Tokens.made(), Visits()), 50, rounds)


def main() -> int:
    """Print the shares; 1 when one of them is too large."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    rounds, ticks = (2, 20) if options.smoke else (9, 600)
    begun = time.process_time()
    station = sr.load(FOLDER)
    _ = station.model
    start = time.process_time() - begun
    whole = tick(station, ticks)
    added = price_of_tick(station.workstation.engine.tick, rounds)
    begins = price_of_start(rounds)
    print(f"a tick of {1e3 * whole:.2f} ms: {1e6 * added:.1f} µs, {added / whole:.3%}")
    print(f"a start of {start:.2f} s: {1e3 * begins:.1f} ms, {begins / start:.3%}")
    print(f"goal: {MOST:.0%}")
    return 0 if options.smoke or max(added / whole, begins / start) <= MOST else 1


if __name__ == "__main__":
    sys.exit(main())
