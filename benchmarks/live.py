"""How late a live source is: from the controller's packet to the mailbox, and to the State that uses it.

The emulator is a process of its own. Its instants are on a grid and the least latency is not known, so
figures are beyond the least latency of the run. ``--seconds`` and ``--frequency`` change the length and
the rate.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import seerob as sr
from seerob import live
from seerob.samples import JointSample

FOLDER = Path(__file__).parents[1] / "workstations" / "ur10_rtde"


class Late:
    """A writer that notes when each tick was done and which samples it took."""

    def __init__(self, seconds: float) -> None:
        self.end = seconds
        self.doubts: set[str] = set()
        self.ticks: list[tuple[float, list[JointSample], float]] = []

    def write(self, snapshot, samples) -> None:
        heard = [s for s in samples if isinstance(s, JointSample) and s.source.startswith("rtde")]
        self.doubts |= {
            f"{snapshot.t:.2f} s {r.reason}" for r in snapshot.results if r.verdict == sr.Verdict.UNDECIDED
        }
        self.ticks.append((time.monotonic(), heard, snapshot.t))

    def stop(self) -> bool:
        return bool(self.ticks) and self.ticks[-1][2] >= self.end

    def close(self) -> None: ...

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None: ...


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--frequency", type=float, default=500.0)
    options = parser.parse_args()
    posted: list[tuple[float, float]] = []
    post = live.Mailbox.post

    def note(box, sample) -> None:
        post(box, sample)
        if isinstance(sample, JointSample):
            posted.append((time.monotonic(), sample.t_device))

    live.Mailbox.post = note
    command = [sys.executable, "-m", "seerob.cli", "emulate", "rtde", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as emulator:
        try:
            port = [re.search(r":(\d+)", emulator.stdout.readline()) for _ in range(2)][1][1]
            with tempfile.TemporaryDirectory() as folder:
                text = (FOLDER / "workstation.toml").read_text()
                text = text.replace("frequency = 125 ", f"frequency = {options.frequency} ")
                text = text.replace('kind = "rtde"\n', f'kind = "rtde"\nport = {port}\n')
                Path(folder, "workstation.toml").write_text(text)
                station = sr.load(folder)
                writer = Late(options.seconds)
                summary = station.run(live=True, writers=[writer], stop=writer.stop)
        finally:
            emulator.terminate()
    mailbox = np.array([host - device for host, device in posted])
    least = mailbox.min()
    state = np.array([done - s.t_device for done, heard, _ in writer.ticks[1:] for s in heard]) - least
    starved, newest = 0, -np.inf
    for _, heard, t in writer.ticks:
        newest = max([newest, *(s.t for s in heard)])
        starved += newest < t
    period = station.workstation.engine.tick
    for name, late in (("packet to mailbox", mailbox - least), ("packet to State and results", state)):
        p50, p99, worst = 1e3 * np.percentile(late, (50, 99, 100))
        print(f"{name:<28} p50 {p50:6.2f} ms   p99 {p99:6.2f} ms   worst {worst:6.2f} ms")
    print(f"tick {1e3 * period:g} ms, {len(posted)} packets, {len(writer.ticks)} ticks")
    print(f"slipped {summary.slipped:.3f} s")
    print(f"ticks beyond the newest sample: {starved}; verdict {summary.verdict}")
    for reason in sorted(writer.doubts)[:10]:
        print(f"  undecided: {reason}")


if __name__ == "__main__":
    main()
