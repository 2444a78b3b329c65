"""One captured person of 53 degrees of freedom, tracked in physics at 1 kHz, on one core.

    python benchmarks/human_tracking.py            # 10 s of walking and of standing at a table
    python benchmarks/human_tracking.py --smoke    # a fraction of a second, correctness only

A device sees all 21 bones 60 times a second; every sample becomes a posture
(`seerob.description.capture.fitting`), and the body is pulled there, 1 000 steps a second, with errors per
bone at every tick. The goal is at most 35 % of one core. The peer, in the same run, is the bare
`mujoco.mj_step` of the same model: what no twin of this body can be faster than.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import mujoco
import numpy as np
from msgspec.structs import replace

from seerob.core.samples import BodyPoint, BodySample
from seerob.core.transforms import wxyz_from_rotation
from seerob.description.humans import keyframes, manikin
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.session.reading import convert_workstation
from seerob.session.station import Station
from seerob.twin.engine import Engine

RATE = 60.0
GOAL = 0.35
TABLE = {
    "parts": [{"name": "table", "shape": {"box": [1.2, 2.0, 0.9]}, "at": {"position": [0.9, 0.0, 0.45]}}],
    "contacts": [{"between": ["operator", "table"]}],
}


def samples(seconds: float) -> list[BodySample]:
    """What a device says of a person who walks, in time order, the same walk again and again."""
    person = manikin.build(name="operator", stature=1.75, mass=75, sex="male")
    walk = keyframes.sample(keyframes.read("library:walk", person, folder=Path()), person, RATE)
    made = []
    for seq in range(round(seconds * RATE) + 2):
        # There and back, so that it goes on without a jump.
        k = seq % (2 * len(walk.q) - 2)
        R, p = bone_poses(person, walk.q[min(k, 2 * len(walk.q) - 2 - k)])
        points = tuple(
            BodyPoint(
                name=bone,
                bone=bone,
                position=tuple(p[i].tolist()),
                wxyz=tuple(wxyz_from_rotation(R[i]).tolist()),
            )
            for i, bone in enumerate(BONES)
        )
        made.append(BodySample(source="device", target="operator", seq=seq, t=seq / RATE, points=points))
    return made


def station(**tables: object) -> Station:
    human = {"name": "operator", "stature": 1.75, "mass": 75.0, "sex": "male"}
    made, problems = convert_workstation(
        {"humans": [human], "engine": {"timestep": 0.001}, **tables}, "benchmark"
    )
    if made is None:
        raise SystemExit(str(problems))
    return Station(replace(made, folder="."))


def tracked(made: Station, heard: list[BodySample], seconds: float) -> tuple[float, list[float], list[str]]:
    """CPU time [s], distances of the bones [m] and doubts."""
    engine = Engine(made.model, driven={"operator": 0.2})
    left = iter(heard)
    nearest = next(left)
    engine.take([nearest])
    engine.start()
    away: list[float] = []
    doubts: list[str] = []
    begun = time.process_time()
    for tick in range(round(seconds / 0.01)):
        due = []
        while nearest.t <= (tick + 1) * 0.01:
            nearest = next(left)
            due.append(nearest)
        engine.take(due)
        state = engine.tick()
        away += [error[0] for error in state.hearings["operator"].bones.values() if error[0] is not None]
        doubts.append(state.invalid_reason("operator"))
    return time.process_time() - begun, away, doubts


def bare(made: Station, seconds: float) -> float:
    """CPU time of the physics alone [s], the body held where it stands, contacts off."""
    mj = made.model.mj.__copy__()
    mj.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    mj.opt.gravity[:] = 0.0
    data = mujoco.MjData(mj)
    begun = time.process_time()
    for _ in range(round(seconds / 0.001)):
        mujoco.mj_step(mj, data)
    return time.process_time() - begun


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--smoke", action="store_true")
    smoke = options.parse_args().smoke
    seconds = 0.3 if smoke else 10.0
    heard = samples(seconds)
    free, beside = station(), station(**TABLE)
    tracked(free, heard, 0.1)  # what is compiled at first use
    alone = bare(free, seconds) / seconds
    failed = False
    for name, made in (("without contacts", free), ("beside a table", beside)):
        used, away, doubts = tracked(made, heard, seconds)
        share = used / seconds
        median, worst = 1e3 * np.median(away), 1e3 * np.max(away)
        undecided = np.mean([doubt != "" for doubt in doubts])
        sys.stdout.write(
            f"{name:17} {100 * share:5.1f} % of one core at 1 kHz (goal {100 * GOAL:.0f} %), "
            f"{share / alone:4.1f} x bare mj_step ({100 * alone:.1f} %); bones {median:.1f} mm median, "
            f"{worst:.1f} mm largest; {100 * undecided:.0f} % undecided\n"
        )
        failed |= bool(median > 5.0 and made is free)
        failed |= not smoke and share > GOAL
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
