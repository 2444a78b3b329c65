"""Everything together: two robots, one person, every criterion, against real time on one core.

    python benchmarks/everything.py            # prints ms per tick, percentiles, x real time
    python benchmarks/everything.py --smoke    # a second of motion, correctness only

One tick is pump, engine, all criteria, snapshot and its encoding, as `seerob assess` does it. A page asks for
60 pictures a second: the rest of the ticks is not encoded. The peer is MuJoCo alone: what it computes for the
same tick from the same positions (steps, torques of the reference, kinematics, masses), called from Python.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

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


def measure(seconds: float) -> dict[str, float]:
    """Times of one pass over the workstation's motion [ms], and the factor over real time."""
    station = sr.load(FOLDER, cache=cache_folder())
    period = station.workstation.engine.tick
    driven = {source.target(): source.timeout for source in station.workstation.sources}
    engine = Engine(station.model, driven=driven)
    judge = road.Judge(station.bound)
    feed = road.pump(station.sources, period, endless=True, ahead=road.looks_ahead(station.model))
    peer = Peer(engine)
    encoder = msgspec.msgpack.Encoder(enc_hook=plain)
    stages: dict[str, list[float]] = {"engine": [], "criteria": [], "snapshot": []}
    whole, computed, twin, with_page, alone, worst_distance = [], [], [], [], [], np.inf
    page, size = 0.0, 0
    if seconds >= road.LONG:
        use_huge_pages()
    with road.settled():
        for seq, samples in enumerate(feed):
            begin, began = time.perf_counter(), time.thread_time()
            engine.take(samples)
            state = engine.tick() if seq else engine.start()
            moved, stepped = time.perf_counter(), time.thread_time()
            results = judge(state)
            judged = time.perf_counter()
            out = road.snapshot(state, seq, results)
            quiet = time.thread_time()
            size = len(encoder.encode(out))
            end, ended = time.perf_counter(), time.thread_time()
            shows = state.t >= page
            page += PAGE * shows
            if seq >= 20:  # the first ticks touch cold memory
                whole.append(end - begin)
                computed.append(ended - began)
                twin.append(stepped - began)
                with_page.append((ended if shows else quiet) - began)
                alone.append(peer.tick())
                for name, spent in zip(stages, (moved - begin, judged - moved, end - judged), strict=True):
                    stages[name].append(spent)
            for result in results:
                if result.unit == "m" and result.value is not None:
                    worst_distance = min(worst_distance, result.value)
            if state.t >= seconds:
                break
    ms = 1e3 * np.array(whole)
    return {
        "ticks": len(ms),
        "criteria": len(station.bound),
        "dof": station.model.mj.nv,
        "median_ms": float(np.median(ms)),
        "mean_ms": float(ms.mean()),
        "p99_ms": float(np.percentile(ms, 99)),
        "max_ms": float(ms.max()),
        **{f"{name}_ms": 1e3 * float(np.median(spent)) for name, spent in stages.items()},
        "x_real_time": float(period * 1e3 / ms.mean()),
        "cpu_median_ms": 1e3 * float(np.median(computed)),
        "cpu_p99_ms": 1e3 * float(np.percentile(computed, 99)),
        "x_computed": float(period / np.mean(computed)),
        "cpu_min_ms": 1e3 * min(computed),
        "page_ms": 1e3 * float(np.median(with_page)),
        "mujoco_ms": 1e3 * float(np.median(alone)),
        "x_mujoco": float(np.median(with_page) / np.median(alone)),
        "x_engine": float(np.median(twin) / np.median(alone)),
        "bytes": size,
        "least_distance": float(worst_distance),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
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
