"""The whole set of criteria for one robot and one person: per tick on one core, and over a recording on two.

    python benchmarks/criteria.py            # µs of every criterion, ms of all, x real time of a recording
    python benchmarks/criteria.py --smoke    # seconds of motion, correctness only

In a tick, whoever asks first pays for what others share (Jacobians, masses, distances). A recording is
judged by ``Station.batch`` with two threads, and by the road without physics, instant by instant. The peer
is Pinocchio with numpy in a loop, as one would write it, for the four criteria that this makes short.
All times are those of the processor, so that what else the machine does is not in them: what two threads
spend counts by half, as two free cores would take, and what only one can do counts in full.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from dataclasses import replace as plain
from pathlib import Path

# One core per process: the figures must not borrow another one from a library's threads.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np
import pinocchio as pin
from msgspec.structs import replace

from seerob.app.console.terminal import cache_folder
from seerob.core.transforms import Array
from seerob.criteria.criterion import Criterion
from seerob.criteria.safety.effective_mass import EffectiveMass
from seerob.criteria.safety.force_polytope import ForcePolytope
from seerob.criteria.safety.kinetic_energy import KineticEnergy
from seerob.criteria.safety.manipulability import Manipulability
from seerob.criteria.safety.minimum_distance import MinimumDistance
from seerob.criteria.safety.power_and_force import PowerAndForce
from seerob.criteria.safety.safety_area import SafetyArea
from seerob.criteria.safety.separation import Separation, Stop
from seerob.criteria.safety.velocity import Velocity
from seerob.description.robots import library
from seerob.session import batch
from seerob.session import run as road
from seerob.session.reading import read
from seerob.session.recorded_motion import recorded
from seerob.session.station import Station
from seerob.twin.engine import Engine

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from oracles.pinocchio_oracle import pinocchio_model

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
SHORT = (ALONE[0], *ALONE[2:5])
"""Velocity, energy, manipulability, effective mass: what a loop over Pinocchio makes short."""
FAR = (*ALONE, APART[0], APART[2])
"""With the distances of all parts of the person and the robot, and S_p of each."""
HEAD = ("Skull and forehead", "Face", "Larynx, eyes and ears")
NEAR = PowerAndForce(name="near", robot=ROBOT, excluded=HEAD, contact_area={ROBOT: 1e-4, "gripper": 1e-4})
"""Anyone, anywhere: whatever moves is next to every region, and exceeds, is within or nearly so by turns."""
CONTACT: tuple[Criterion, ...] = (PowerAndForce(name="power and force", robot=ROBOT, human=PERSON),)


def made(criteria: tuple[Criterion, ...], *, physics: bool) -> Station:
    """The workstation with other criteria."""
    station = read(FOLDER)
    engine = replace(station.engine, physics=physics)
    return Station(replace(station, safety=criteria, ergonomics=(), engine=engine), cache=cache_folder())


def engine_of(station: Station) -> Engine:
    """Driven as in a run."""
    return Engine(station.model, driven={s.target(): s.timeout for s in station.workstation.sources})


class Peer:
    """Four criteria with Pinocchio and numpy, as one would write it; without the tool, other figures."""

    def __init__(self) -> None:
        self.model = pinocchio_model(library.load("ur10"))
        self.data, self.tool = self.model.createData(), self.model.getFrameId("tool0")

    def ask(self, q: Array, qd: Array) -> None:
        """Speed, kinetic energy, singular values and effective mass along the motion, once."""
        model, data = self.model, self.data
        J = pin.computeFrameJacobian(model, data, q, self.tool, pin.LOCAL_WORLD_ALIGNED)[:3]
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        v = J @ qd
        speed, energy, sigma = np.linalg.norm(v), qd @ M @ qd / 2, np.linalg.svd(J, compute_uv=False)
        inverse = J @ np.linalg.solve(M, J.T)
        mass = speed**2 / (v @ inverse @ v) if speed > 0 else np.inf
        assert np.isfinite([speed, energy, sigma[2]]).all()
        assert mass > 0


def per_tick(ticks: int) -> tuple[dict[str, float], float, float, float]:
    """Median time of every criterion [µs]; median and 99th percentile of all together [ms].

    And the median of the peer's four criteria in the same ticks [µs].
    """
    peer, peers = Peer(), []
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
            robot = station.model.robot(ROBOT)
            q, qd = state.joint_positions(robot), state.qd(robot)
            begin = time.thread_time()
            peer.ask(q, qd)
            peers.append(time.thread_time() - begin)
    found = 1e6 * np.array(spent[20:])
    names = [bound.criterion.name for bound in station.bound]
    whole = found.sum(axis=1) / 1e3
    median = dict(zip(names, np.median(found, axis=0).tolist(), strict=True))
    other = 1e6 * float(np.median(peers[20:]))
    return median, float(np.median(whole)), float(np.percentile(whole, 99)), other


def together(ticks: int) -> tuple[float, float]:
    """Median time of `SHORT`, asked by one judge as in a run, and of the peer in the same ticks [µs]."""
    peer, station = Peer(), made(SHORT, physics=True)
    engine, judge, robot = engine_of(station), road.Judge(station.bound), station.model.robot(ROBOT)
    own, peers = [], []
    with road.settled():
        for seq, samples in zip(range(ticks), pump(station), strict=False):
            engine.take(samples)
            state = engine.tick() if seq else engine.start()
            begin = time.thread_time()
            judge(state)
            own.append(time.thread_time() - begin)
            q, qd = state.joint_positions(robot), state.qd(robot)
            begin = time.thread_time()
            peer.ask(q, qd)
            peers.append(time.thread_time() - begin)
    return 1e6 * float(np.median(own[20:])), 1e6 * float(np.median(peers[20:]))


def between_ticks(ticks: int, *criteria: Criterion) -> tuple[float, float, float]:
    """Processor time per tick of the demo with and without what decides between ticks [s], looks per tick.

    Args:
        ticks: How many.
        criteria: Instead of those of the demo.
    """
    spent, looks = [], 0
    for watched in (True, False):
        station = made(criteria, physics=True) if criteria else Station(read(FOLDER), cache=cache_folder())
        bound = [one if watched else plain(one, watch=None) for one in station.bound]
        engine, judge = road.engine_of(station.model), road.Judge(bound)
        times = []
        with road.settled():
            for seq, samples in zip(range(ticks), pump(station), strict=False):
                begin = time.process_time()
                engine.take(samples)
                judge(engine.tick() if seq else engine.start())
                times.append(time.process_time() - begin)
        spent.append(float(np.mean(times[20:])))
        looks += judge.looks
    return spent[0], spent[1], looks / ticks


def batched(samples: int, criteria: tuple[Criterion, ...]) -> tuple[float, float, float, float]:
    """Time per sample to follow a recording, to judge it on two cores, that of both, and on the road [s]."""
    station = made(criteria, physics=False)
    feed = [one for _, one in zip(range(samples), pump(station), strict=False)]
    # What is compiled is loaded, and threads are there, before time is taken.
    batch.judged(
        station.model,
        station.bound,
        recorded(station.model, iter(feed[:600]), math.inf),
        threads=2,
    )
    begin = time.process_time()
    motion = recorded(station.model, iter(feed), math.inf)
    followed, alone = time.process_time(), time.thread_time()
    batch.judged(station.model, station.bound, motion, threads=2)
    judged, alone = time.process_time(), time.thread_time() - alone
    spent = judged - followed
    few = feed[: max(samples // 10, 20)]
    engine, judge = engine_of(station), road.Judge(station.bound)
    with road.settled():
        start = time.process_time()
        for seq, heard in enumerate(few):
            engine.take(heard)
            judge(engine.tick() if seq else engine.start())
        walked = time.process_time() - start
    on_two = alone + (spent - alone) / 2
    return (followed - begin) / samples, on_two / samples, spent / samples, walked / len(few)


def pump(station: Station) -> road.Feed:
    """Its sources, over and over."""
    return road.pump(station.sources, station.workstation.engine.tick, endless=True)


def beside(samples: int) -> tuple[float, float]:
    """Processor time per sample of four criteria: here on one core, and Pinocchio with numpy [s]."""
    station = made(SHORT, physics=False)
    motion = recorded(
        station.model, (one for _, one in zip(range(samples), pump(station), strict=False)), math.inf
    )
    robot = station.model.robot(ROBOT)
    batch.judged(station.model, station.bound, motion.part(0, 300), threads=1)
    begin = time.process_time()
    found = batch.judged(station.model, station.bound, motion, threads=1)
    own = time.process_time() - begin
    peer = Peer()
    q, qd = motion.q[:, robot.q_address], motion.v[:, robot.v_address]
    begin = time.process_time()
    for k in range(samples):
        peer.ask(q[k], qd[k])
    other = time.process_time() - begin
    assert np.isfinite(found["kinetic energy"].value).all()
    return own / samples, other / samples


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    ticks, samples = (30, 30) if options.smoke else (800, 10_000)
    each, median, p99, alone = per_tick(ticks)
    print(f"one robot, one person, {len(each)} criteria, one core:")
    for name, spent in each.items():
        print(f"  {name:20s} {spent:7.1f} µs")
    print(f"all criteria: median {median:.2f} ms, p99 {p99:.2f} ms per tick   (goal: <= 1 ms)")
    four = sum(each[criterion.name] for criterion in SHORT)
    print(
        f"four of them in a tick, with verdicts, markers and what all share: {four:.0f} µs, "
        f"Pinocchio with numpy {alone:.0f} µs for the bare figures, ratio {alone / four:.2f}   (goal: >= 3)"
    )
    own, other = together(ticks)
    print(
        f"the four asked by one judge, as a run asks: {own:.0f} µs, Pinocchio with numpy {other:.0f} µs, "
        f"ratio {other / own:.2f}   (goal: >= 3)"
    )
    watched, unwatched, looks = between_ticks(ticks)
    print(
        f"a tick of the demo {1e3 * watched:.2f} ms, without what decides between ticks "
        f"{1e3 * unwatched:.2f} ms: ratio {watched / unwatched:.2f}, {looks:.2f} instants looked at per tick"
    )
    watched, unwatched, looks = between_ticks(ticks, NEAR)
    print(
        f"of contacts of anyone anywhere alone {1e3 * watched:.2f} ms, without {1e3 * unwatched:.2f} ms: "
        f"ratio {watched / unwatched:.2f}, {looks:.2f} instants looked at per tick"
    )
    own, other = beside(samples)
    print(
        f"four of them over a recording, one core: {1e6 * own:.1f} µs per sample, "
        f"Pinocchio with numpy {1e6 * other:.1f} µs, ratio {other / own:.1f}   (goal: >= 20)"
    )
    period = 0.01
    for kind, criteria, goal in (("without distances", ALONE, 300), ("with 25-part distances", FAR, 100)):
        followed, on_two, judged, walked = batched(samples, criteria)
        print(
            f"recording of {samples} samples at {1 / period:.0f} Hz {kind}, two cores: "
            f"{period / (followed + on_two):.0f} x real time (goal: >= {goal}), "
            f"{period / on_two:.0f} x from arrays; {(followed + judged) * 1e6:.0f} µs per sample, "
            f"{walked / (followed + judged):.1f} x less than on the road"
        )
    return 0 if np.isfinite(median) else 1


if __name__ == "__main__":
    sys.exit(main())
