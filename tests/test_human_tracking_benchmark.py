"""The benchmark of a captured person runs, and the person is where the device has it."""

import subprocess
import sys
from pathlib import Path


def test_a_person_is_tracked():
    script = Path(__file__).parents[1] / "benchmarks" / "human_tracking.py"
    done = subprocess.run(
        [sys.executable, str(script), "--smoke"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "bare mj_step" in done.stdout
