"""The benchmark of the criteria runs, live and over a recording."""

import subprocess
import sys
from pathlib import Path


def test_every_criterion_for_one_robot_and_one_person():
    script = Path(__file__).parents[1] / "benchmarks" / "criteria.py"
    done = subprocess.run(
        [sys.executable, str(script), "--smoke"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "power and force" in done.stdout
    assert "Pinocchio" in done.stdout
    assert done.stdout.count("x real time") == 2
