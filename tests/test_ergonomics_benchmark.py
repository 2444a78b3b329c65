"""The benchmark of the posture rules runs, and scores what it measures."""

import subprocess
import sys
from pathlib import Path


def test_rula_and_reba_on_a_thousand_postures():
    script = Path(__file__).parents[1] / "benchmarks" / "ergonomics.py"
    done = subprocess.run(
        [sys.executable, str(script), "--smoke"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "RULA + REBA" in done.stdout
