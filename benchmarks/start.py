"""Start of ``seerob run`` to its first tick, warm: a new process each time.

    python benchmarks/start.py

``--seconds 0.01`` ends the run after its second tick, so the whole process bounds the figure from above.
"""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "workstations" / "ur10_assembly"


def once() -> float:
    begin = time.perf_counter()
    command = [
        sys.executable,
        "-m",
        "seerob.app.cli",
        "run",
        str(FOLDER),
        "--port",
        "0",
        "--no-record",
        "--seconds",
        "0.01",
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert "ran" in done.stdout, done.stdout + done.stderr
    return time.perf_counter() - begin


def main() -> int:
    once()  # fills the caches
    times = [once() for _ in range(1 if "--smoke" in sys.argv else 5)]
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    computed = (spent.ru_utime + spent.ru_stime) / (1 + len(times))
    bare = time.perf_counter()
    subprocess.run([sys.executable, "-c", "import mujoco, numba, trimesh"], check=True)
    bare = time.perf_counter() - bare
    median = statistics.median(times)
    print(
        f"start to the end of a run of two ticks: median {median:.2f} s of {len(times)} (goal: <= 5 s warm)"
    )
    print(f"by the processor's clock, mean of all with the first: {computed:.2f} s")
    print(f"ratio to `import mujoco, numba, trimesh` alone: {median / bare:.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
