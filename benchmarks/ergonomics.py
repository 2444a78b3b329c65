"""RULA and REBA on many postures at once, on one core.

    python benchmarks/ergonomics.py            # 100 000 postures, both sides
    python benchmarks/ergonomics.py --smoke    # 1 000, correctness only

Three stages, each with its time: bones from joint values, angles from bones, scores from angles. The goal,
100 000 postures in 1 s, is of the scores of both rules; the stages before it are shared by every rule.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np

from seerob.criteria.ergonomics.reba import METHOD as REBA
from seerob.criteria.ergonomics.reba import Coupling, Reba, RebaPhase
from seerob.criteria.ergonomics.rula import METHOD as RULA
from seerob.criteria.ergonomics.rula import LoadUse, Rula, RulaPhase
from seerob.criteria.scoring.judgement import Method
from seerob.criteria.scoring.spans import Span
from seerob.description.humans import manikin
from seerob.description.humans.angles import Angles, angles
from seerob.description.humans.skeleton import bone_poses

CHUNK = 5_000
"""Postures at a time: what fits the cache."""
RULA_TASK = RulaPhase(
    load=1.0,
    load_use=LoadUse.INTERMITTENT,
    muscle_arms=False,
    muscle_body=False,
    supported_arms="none",
    back_supported=False,
    legs="posture",
)
REBA_TASK = RebaPhase(
    load=1.0,
    shock=False,
    coupling=Coupling.GOOD,
    supported_arms="none",
    legs="posture",
    static=False,
    repeated=False,
    rapid=False,
)


def final(method: Method, components: dict[str, Span], count: int, end: str = "low") -> Any:
    """Score of both sides, shape (count, 2)."""
    scores = {}
    for key, span in components.items():
        score = getattr(span, end)
        scores[key] = score[:, None] if score.shape == (count,) else score
    return method.grand(scores)


def timed(work: Callable[..., Any], *given: Any) -> tuple[float, Any]:
    """Seconds and the result."""
    begin = time.perf_counter()
    found = work(*given)
    return time.perf_counter() - begin, found


def measure(count: int) -> dict[str, float]:
    """Seconds per stage for ``count`` postures, and the mean scores."""
    person = manikin.build(name="op", stature=1.75, mass=75, sex="male")
    rng = np.random.default_rng(0)
    joints = person.joints()
    low = np.array([-0.3 if j.lower is None else 0.5 * j.lower for j in joints])
    high = np.array([0.3 if j.upper is None else 0.5 * j.upper for j in joints])
    rula, reba = Rula(human="op"), Reba(human="op")
    total = dict.fromkeys(("bones", "angles", "rula", "reba", "rula_mean", "reba_mean"), 0.0)
    for start in range(0, count, CHUNK):
        n = min(CHUNK, count - start)
        q = rng.uniform(low, high, (n, len(joints)))
        spent, bones = timed(bone_poses, person, q)
        total["bones"] += spent
        spent, found = timed(angles, *bones)
        total["angles"] += spent
        for name, rule, method, task in (("rula", rula, RULA, RULA_TASK), ("reba", reba, REBA, REBA_TASK)):
            spent, scores = timed(score, rule, method, task, found, n)
            total[name] += spent
            total[f"{name}_mean"] += float(scores.max(axis=-1).sum()) / count
    return total


def score(rule: Any, method: Method, task: Any, found: Angles, count: int) -> Any:
    """Scores of a batch, both sides."""
    return final(method, rule.components(found, task), count)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    count = 1_000 if options.smoke else 100_000
    found = measure(count)
    print(f"{count} postures, both sides, one core")
    print(f"bones from joint values  {found['bones']:.3f} s   (for comparison, not in the goal)")
    print(f"angles from bones        {found['angles']:.3f} s")
    print(f"RULA from angles         {found['rula']:.3f} s   mean score {found['rula_mean']:.2f}")
    print(f"REBA from angles         {found['reba']:.3f} s   mean score {found['reba_mean']:.2f}")
    both = found["rula"] + found["reba"]
    print(
        f"RULA + REBA              {both:.3f} s   with angles {both + found['angles']:.3f} s   (goal: <= 1 s)"
    )
    return 0 if 1 <= found["rula_mean"] <= 7 and 1 <= found["reba_mean"] <= 15 else 1


if __name__ == "__main__":
    sys.exit(main())
