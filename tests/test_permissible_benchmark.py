"""The benchmark of rescaled motions runs, and is not far from toppra where no jerk limit binds."""

import subprocess
import sys
from pathlib import Path


def test_against_toppra_alone():
    script = Path(__file__).parents[1] / "benchmarks" / "permissible.py"
    done = subprocess.run(
        [sys.executable, str(script), "--smoke"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "toppra alone" in done.stdout
