"""Start of ``seerob run`` to its second tick, and a whole ``seerob assess``, warm, beside bare imports.

    python benchmarks/start.py [--cold]

``--seconds 0.01`` ends the run after its second tick, so the whole process bounds the figure from above.
``--cold`` begins with no compiled loops and no trees, as on a machine on which seerob was never run.
Processes of all kinds take turns, each by the processor's clock and as an installation runs: with bytecode.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "workstations" / "ur10_assembly"
RUN = ("-m", "seerob", "run", str(FOLDER), "--port", "0", "--no-record", "--seconds", "0.01")
BARE = ("-c", "import mujoco, numpy, numba")
ASSESS = ("-m", "seerob", "assess", str(FOLDER), "-o")
GOAL, WHOLE, WHOLE_COLD = 2.0, 5.0, 30.0
"""Start to the first tick, warm; the whole of an assessment, warm and first ever [s]."""


def once(arguments: tuple[str, ...], **environment: str) -> tuple[float, float]:
    """Wall and processor time of a process and those that it waited for [s]."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before, begin = os.times(), time.perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments],
        env={**kept, **environment},
        stdout=subprocess.DEVNULL,
        timeout=600,
        check=False,
    )
    if done.returncode > 2:  # up to there it is a verdict
        raise SystemExit(f"{arguments} ended with {done.returncode}")
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return time.perf_counter() - begin, spent


def told(what: str, runs: list[tuple[float, float]], bare: list[tuple[float, float]], goal: str) -> None:
    """Print the medians of some processes beside those of bare imports."""
    wall, spent = (statistics.median(each) for each in zip(*runs, strict=True))
    bare_wall, bare_spent = (statistics.median(each) for each in zip(*bare, strict=True))
    print(f"{what}, median of {len(runs)}:")
    print(f"  {wall:.2f} s{goal}, {spent:.2f} s by the processor's clock")
    print(f"  {wall / bare_wall:.1f} and {spent / bare_spent:.1f} times `{BARE[1]}`")


def main() -> int:
    smoke, cold = "--smoke" in sys.argv, "--cold" in sys.argv
    runs, whole, bare = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        kept = {"NUMBA_CACHE_DIR": f"{folder}/loops", "XDG_CACHE_HOME": f"{folder}/trees"} if cold else {}
        if cold:
            whole.append(once((*ASSESS, f"{folder}/first"), **kept))
            runs.append(once(RUN, **{name: f"{path}_of_run" for name, path in kept.items()}))
            bare.append(once(BARE))
        else:
            once(RUN)  # fills the caches
        for k in range(0 if cold else 1 if smoke else 5):
            bare.append(once(BARE))
            runs.append(once(RUN))
            if not smoke:
                whole.append(once((*ASSESS, f"{folder}/{k}")))
    state = "first ever" if cold else "warm"
    told(f"start to the second tick, {state}", runs, bare, "" if cold else f" (goal: <= {GOAL:g} s)")
    if whole:
        told(f"a whole assessment, {state}", whole, bare, f" (goal: <= {WHOLE_COLD if cold else WHOLE:g} s)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
