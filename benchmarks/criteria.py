"""The whole set of criteria for one robot and one person: per tick on one core, and over a recording on two.

    python benchmarks/criteria.py            # µs of every criterion, ms of all, x real time of a recording
    python benchmarks/criteria.py --smoke    # seconds of motion, correctness only

In a tick, whoever asks first pays for what others share (Jacobians, masses, distances). A recording is
judged without physics (``engine.physics = false``) by two processes, half of it each; its peer is the
same with physics, in the same run. All times are those of the processor, so that what else the machine
does is not in them: two processes take as long on two free cores.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

# One core per process: the figures must not borrow another one from a library's threads.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np
from msgspec.structs import replace

from seerob import run as road
from seerob.commands import cache_folder
from seerob.criterion import Criterion
from seerob.engine import Engine
from seerob.reading import read
from seerob.safety.effective_mass import EffectiveMass
from seerob.safety.force_polytope import ForcePolytope
from seerob.safety.kinetic_energy import KineticEnergy
from seerob.safety.manipulability import Manipulability
from seerob.safety.minimum_distance import MinimumDistance
from seerob.safety.power_and_force import PowerAndForce
from seerob.safety.safety_area import SafetyArea
from seerob.safety.separation import Separation, Stop
from seerob.safety.velocity import Velocity
from seerob.station import Station

FOLDER = Path(__file__).parents[1] / "workstations" / "ur10_assembly"
ROBOT, PERSON = "ur10", "operator"
ALONE: tuple[Criterion, ...] = (
    Velocity(name="velocity", at=ROBOT),
    Velocity(name="fastest point", of=ROBOT),
    KineticEnergy(name="kinetic energy", robot=ROBOT),
    Manipulability(name="manipulability", at=ROBOT),
    EffectiveMass(name="effective mass", at=ROBOT),
    ForcePolytope(name="force polytope", at=ROBOT, limit=200.0),
)
"""Without distances. Tool force is left out: it needs measured torques, which the motion does not have."""
APART: tuple[Criterion, ...] = (
    MinimumDistance(name="minimum distance", between=(ROBOT, PERSON)),
    SafetyArea(name="safety area", area="robot_side", of=PERSON),
    Separation(
        name="separation",
        between=(ROBOT, PERSON),
        stop=Stop(reaction=0.1, stopping=0.3),
        intrusion=0.0,
        human_uncertainty=0.05,
        robot_uncertainty=0.005,
    ),
)
CONTACT: tuple[Criterion, ...] = (PowerAndForce(name="power and force", robot=ROBOT, human=PERSON),)


def made(criteria: tuple[Criterion, ...], *, physics: bool) -> Station:
    """The workstation with other criteria."""
    station = read(FOLDER)
    engine = replace(station.engine, physics=physics)
    return Station(replace(station, safety=criteria, ergonomics=(), engine=engine), cache=cache_folder())


def engine_of(station: Station) -> Engine:
    """Driven as in a run."""
    return Engine(station.model, driven={s.target(): s.timeout for s in station.workstation.sources})


def per_tick(ticks: int) -> tuple[dict[str, float], float, float]:
    """Median time of every criterion [µs]; median and 99th percentile of all together [ms]."""
    station = made((*ALONE, *APART, *CONTACT), physics=True)
    engine, judges = engine_of(station), [road.Judge([bound]) for bound in station.bound]
    spent: list[list[float]] = []
    feed = road.pump(station.sources, station.workstation.engine.tick, endless=True)
    with road.settled():
        for seq, samples in zip(range(ticks), feed, strict=False):
            engine.take(samples)
            state = engine.tick() if seq else engine.start()
            times = [time.thread_time()]
            for judge in judges:
                judge(state)
                times.append(time.thread_time())
            spent.append(np.diff(times).tolist())
    found = 1e6 * np.array(spent[20:])
    names = [bound.criterion.name for bound in station.bound]
    whole = found.sum(axis=1) / 1e3
    median = dict(zip(names, np.median(found, axis=0).tolist(), strict=True))
    return median, float(np.median(whole)), float(np.percentile(whole, 99))


def recorded(ticks: int, *, distances: bool, physics: bool) -> float:
    """Time to judge one half of a recording, without reading and compiling [s]."""
    station = made((*ALONE, *(APART if distances else ())), physics=physics)
    engine, judge = engine_of(station), road.Judge(station.bound)
    model = station.model
    parts = model.gap(model.robot(ROBOT).moving, model.human(PERSON).bodies)
    feed = list(zip(range(ticks), road.pump(station.sources, 0.01, endless=True), strict=False))
    begin = 0.0
    with road.settled():
        for seq, samples in feed:
            if seq == 1:
                begin = time.thread_time()  # the first tick loads what is compiled
            engine.take(samples)
            state = engine.tick() if seq else engine.start()
            road.snapshot(state, seq, judge(state))
            if distances:
                state.closest_per_body(parts)
    return time.thread_time() - begin


def halves(ticks: int, *, distances: bool, physics: bool) -> float:
    """How many times faster than real time two processes are, half of the recording each."""
    with ProcessPoolExecutor(2) as pool:
        jobs = [pool.submit(recorded, ticks // 2, distances=distances, physics=physics) for _ in range(2)]
        longest = max(job.result() for job in jobs)
    return ticks * 0.01 / longest


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    ticks, samples = (60, 60) if options.smoke else (800, 10_000)
    each, median, p99 = per_tick(ticks)
    print(f"one robot, one person, {len(each)} criteria, one core:")
    for name, spent in each.items():
        print(f"  {name:20s} {spent:7.1f} µs")
    print(f"all criteria: median {median:.2f} ms, p99 {p99:.2f} ms per tick   (goal: <= 1 ms)")
    for distances, goal in ((False, 100), (True, 15)):
        placed = halves(samples, distances=distances, physics=False)
        pulled = halves(min(samples, 3000), distances=distances, physics=True)
        kind = "with the distances of every body part" if distances else "without distances"
        print(
            f"recording of {samples} samples {kind}, two processes: {placed:.0f} x real time "
            f"(goal: >= {goal}), {placed / pulled:.1f} x as fast as with physics"
        )
    return 0 if np.isfinite(median) else 1


if __name__ == "__main__":
    sys.exit(main())
