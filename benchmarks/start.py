"""Start of ``seerob run`` to its second tick, warm: a new process each time, beside bare imports.

    python benchmarks/start.py [--cold]

``--seconds 0.01`` ends the run after its second tick, so the whole process bounds the figure from above.
``--cold`` begins with no compiled loops and no trees, as on a machine on which seerob was never run.
Processes of both kinds take turns, each by the processor's clock and as an installation runs: with bytecode.
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
GOAL = 2.0
"""Start to the first tick, warm [s]."""


def once(arguments: tuple[str, ...], **environment: str) -> tuple[float, float]:
    """Wall and processor time of a process and those that it waited for [s]."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before, begin = os.times(), time.perf_counter()
    subprocess.run(
        [sys.executable, *arguments],
        env={**kept, **environment},
        stdout=subprocess.DEVNULL,
        timeout=600,
        check=True,
    )
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return time.perf_counter() - begin, spent


def main() -> int:
    smoke, cold = "--smoke" in sys.argv, "--cold" in sys.argv
    runs, bare = [], []
    if cold:
        bare.append(once(BARE))
        with tempfile.TemporaryDirectory() as folder:
            runs.append(once(RUN, NUMBA_CACHE_DIR=f"{folder}/loops", XDG_CACHE_HOME=f"{folder}/trees"))
    else:
        once(RUN)  # fills the caches
        for _ in range(1 if smoke else 5):
            bare.append(once(BARE))
            runs.append(once(RUN))
    wall, spent = (statistics.median(each) for each in zip(*runs, strict=True))
    bare_wall, bare_spent = (statistics.median(each) for each in zip(*bare, strict=True))
    print(f"start to the second tick, {'first ever' if cold else 'warm'}, median of {len(runs)}:")
    goal = "" if cold else f" (goal: <= {GOAL:g} s)"
    print(f"  {wall:.2f} s{goal}, {spent:.2f} s by the processor's clock")
    print(f"  {wall / bare_wall:.1f} and {spent / bare_spent:.1f} times `{BARE[1]}`")
    return 0


if __name__ == "__main__":
    sys.exit(main())
