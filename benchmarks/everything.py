"""Everything together: two robots, one person, every criterion, against real time on one core.

    python benchmarks/everything.py            # prints ms per tick, percentiles, x real time
    python benchmarks/everything.py --smoke    # a second of motion, correctness only
    python benchmarks/everything.py --against FOLDER    # in turns with a checkout of another commit

One tick is pump, engine, all criteria, snapshot and its encoding, as `seerob assess` does it. A page asks for
60 pictures a second: the rest of the ticks is not encoded. The peer is MuJoCo alone: what it computes for the
same tick from the same positions (steps, torques of the reference, kinematics, masses), called from Python.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from itertools import islice, takewhile
from pathlib import Path
from subprocess import PIPE, Popen
from typing import Any, NamedTuple

# One core: the figure must not borrow a second one from a library's threads.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import msgspec
import mujoco
import numpy as np

import seerob as sr
from seerob.app.console.terminal import cache_folder
from seerob.core.markers import plain
from seerob.session import run as road
from seerob.session.huge_pages import use_huge_pages
from seerob.twin.engine import Engine

FOLDER = Path(__file__).parents[1] / "workstations" / "two_robots"


PAGE = 1 / 60
"""Period of the pictures of a page [s]."""


class Peer:
    """MuJoCo's own part of a tick.

    Args:
        engine: Whose tick.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._mj = engine.state.model.mj.__copy__()
        self._moving, self._wanted = mujoco.MjData(self._mj), mujoco.MjData(self._mj)
        self._torques = np.zeros(self._mj.nv)
        self._steps = round(engine.model.workstation.engine.tick / self._mj.opt.timestep)

    def tick(self) -> float:
        """Seconds of the processor for a tick from where the twin is."""
        mj, moving, wanted = self._mj, self._moving, self._wanted
        shown = self._engine.state.data
        moving.qpos[:], moving.qvel[:] = shown.qpos, shown.qvel
        wanted.qpos[:], wanted.qvel[:] = shown.qpos, shown.qvel
        began = time.thread_time()
        for _ in range(self._steps):
            mujoco.mj_kinematics(mj, wanted)
            mujoco.mj_comPos(mj, wanted)
            mujoco.mj_comVel(mj, wanted)
            mujoco.mj_passive(mj, wanted)
            mujoco.mj_rne(mj, wanted, 1, self._torques)
            mujoco.mj_step(mj, moving)
        mujoco.mj_kinematics(mj, wanted)
        mujoco.mj_comPos(mj, wanted)
        mujoco.mj_comVel(mj, wanted)
        mujoco.mj_makeM(mj, wanted)
        return time.thread_time() - began


class Tick(NamedTuple):
    """What one tick took [s], by the processor's clock but for the first four; of many, arrays of it."""

    whole: Any
    engine: Any
    criteria: Any
    snapshot: Any
    computed: Any
    twin: Any
    judged: Any
    with_page: Any
    """Where a page takes it, with its encoding; else without."""
    alone: Any
    """MuJoCo's own part."""
    size: Any
    """Bytes of the snapshot."""
    least: Any
    """Least distance [m], infinite where there is none."""
    t: Any
    """Run time [s]."""


def ticks(station: sr.Station, *, large: bool) -> Iterator[Tick]:
    """Go through the workstation's motion, which repeats itself; in ``large`` pages of memory."""
    period = station.workstation.engine.tick
    driven = {source.target(): source.timeout for source in station.workstation.sources}
    engine = Engine(station.model, driven=driven)
    judge = road.Judge(station.bound)
    feed = road.pump(station.sources, period, endless=True, ahead=road.looks_ahead(station.model))
    peer, encoder, page = Peer(engine), msgspec.msgpack.Encoder(enc_hook=plain), 0.0
    if large:
        use_huge_pages()
    with road.settled():
        for seq, samples in enumerate(feed):
            begin, began = time.perf_counter(), time.thread_time()
            engine.take(samples)
            state = engine.tick() if seq else engine.start()
            moved, stepped = time.perf_counter(), time.thread_time()
            results = judge(state)
            judged, said = time.perf_counter(), time.thread_time()
            out = road.snapshot(state, seq, results)
            quiet = time.thread_time()
            size = len(encoder.encode(out))
            end, ended = time.perf_counter(), time.thread_time()
            shows = state.t >= page
            page += PAGE * shows
            distances = [r.value for r in results if r.unit == "m" and r.value is not None]
            yield Tick(
                end - begin, moved - begin, judged - moved, end - judged, ended - began, stepped - began,
                said - stepped, (ended if shows else quiet) - began, peer.tick(), size,
                min(distances, default=np.inf), state.t,
            )  # fmt: skip


def measure(seconds: float) -> dict[str, float]:
    """Times of one pass over the workstation's motion [ms], and the factor over real time."""
    station = sr.load(FOLDER, cache=cache_folder())
    period = station.workstation.engine.tick
    every = list(takewhile(lambda tick: tick.t < seconds, ticks(station, large=seconds >= road.LONG)))
    found = Tick(*map(np.array, zip(*every[20:], strict=True)))  # the first ticks touch cold memory
    ms, computed, alone = 1e3 * found.whole, found.computed, np.median(found.alone)
    return {
        "ticks": len(ms),
        "criteria": len(station.bound),
        "dof": station.model.mj.nv,
        "median_ms": float(np.median(ms)),
        "mean_ms": float(ms.mean()),
        "p99_ms": float(np.percentile(ms, 99)),
        "max_ms": float(ms.max()),
        "engine_ms": 1e3 * float(np.median(found.engine)),
        "criteria_ms": 1e3 * float(np.median(found.criteria)),
        "snapshot_ms": 1e3 * float(np.median(found.snapshot)),
        "x_real_time": float(period * 1e3 / ms.mean()),
        "cpu_median_ms": 1e3 * float(np.median(computed)),
        "cpu_p99_ms": 1e3 * float(np.percentile(computed, 99)),
        "x_computed": float(period / np.mean(computed)),
        "cpu_min_ms": 1e3 * float(np.min(computed)),
        "page_ms": 1e3 * float(np.median(found.with_page)),
        "mujoco_ms": 1e3 * float(alone),
        "x_mujoco": float(np.median(found.with_page) / alone),
        "x_engine": float(np.median(found.twin) / alone),
        "bytes": every[-1].size,
        "least_distance": min(tick.least for tick in every),
    }


STAGES = {
    "whole, with a page": "with_page",
    "engine": "twin",
    "criteria": "judged",
    "MuJoCo's own part": "alone",
}


def in_turns() -> None:
    """For whoever compares two commits: take as many ticks as each line says, and tell what they took."""
    every = ticks(sr.load(FOLDER, cache=cache_folder()), large=True)
    list(islice(every, 60))
    print("ready", flush=True)
    for line in sys.stdin:
        some = list(islice(every, int(line)))
        print(*(np.median([getattr(tick, name) for tick in some]) for name in STAGES.values()), flush=True)


def against(folder: Path, pairs: int, count: int) -> None:
    """Take ticks in turns with the sources of another checkout, and print how much longer ones of here take.

    Args:
        folder: Of the checkout, whose loops are compiled.
        pairs: How often.
        count: So many ticks at a time.
    """
    ours = Path(__file__).resolve().parents[1]
    workers = []
    for root in (folder.resolve(), ours):
        environment = {**os.environ, "PYTHONPATH": str(root / "src")}
        command = [sys.executable, __file__, "--in-turns"]
        workers.append(Popen(command, env=environment, stdin=PIPE, stdout=PIPE, text=True))
    times = np.empty((2, pairs, len(STAGES)))
    for k, worker in enumerate(workers):
        if worker.stdout is None or worker.stdout.readline() != "ready\n":
            raise SystemExit(f"{(folder, ours)[k]}: it did not begin")
    for pair in range(pairs):
        for k in (0, 1) if pair % 2 else (1, 0):
            worker = workers[k]
            assert worker.stdin is not None
            assert worker.stdout is not None
            print(count, file=worker.stdin, flush=True)
            times[k, pair] = [float(each) for each in worker.stdout.readline().split()]
    for worker in workers:
        worker.communicate()
    low, middle, high = np.percentile(times[1] / times[0], [25, 50, 75], axis=0)
    for k, name in enumerate(STAGES):
        before, here = 1e3 * np.median(times[:, :, k], axis=1)
        said = f"{name}: {before:.3f} ms there, {here:.3f} ms here, {middle[k]:.3f} x"
        print(f"{said} (quartiles {low[k]:.3f} and {high[k]:.3f})")
    before, here = np.median(times[:, :, 0] / times[:, :, -1], axis=1)
    print(
        f"tick / MuJoCo's own part: {before:.2f} x there, {here:.2f} x here, {pairs} pairs of {count} ticks"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    parser.add_argument("--against", type=Path, metavar="FOLDER")
    parser.add_argument("--pairs", type=int, default=60)
    parser.add_argument("--in-turns", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    if options.in_turns:
        in_turns()
        return 0
    if options.against is not None:
        against(options.against, options.pairs, 20)
        return 0
    found = measure(1.0 if options.smoke else 20.0)
    print(
        f"two robots, one person: {found['dof']} dof, {found['criteria']} criteria, "
        f"{found['ticks']} ticks, one core"
    )
    print(
        "median {median_ms:.2f} ms (engine {engine_ms:.2f}, criteria {criteria_ms:.2f}, "
        "snapshot {snapshot_ms:.2f}), p99 {p99_ms:.2f}, max {max_ms:.2f}".format(**found)
    )
    print(f"real time / computed time: {found['x_real_time']:.1f} x   (goal: >= 5, p99 < 10 ms)")
    print(
        "by the processor's clock, without what else the core does: median {cpu_median_ms:.2f} ms, "
        "minimum {cpu_min_ms:.2f}, p99 {cpu_p99_ms:.2f}, {x_computed:.1f} x".format(**found)
    )
    print(
        "with a page at 60 Hz {page_ms:.2f} ms, MuJoCo's own part {mujoco_ms:.3f} ms: {x_mujoco:.1f} x "
        "(goal: <= 4), the engine {x_engine:.2f} x; {bytes} bytes per snapshot".format(**found)
    )
    return 0 if np.isfinite(found["least_distance"]) else 1


if __name__ == "__main__":
    sys.exit(main())
