"""The benchmark of what a run writes at its end runs, and openpyxl reads what it measures."""

import subprocess
import sys
from pathlib import Path


def test_the_captured_operators_workbook():
    script = Path(__file__).parents[1] / "benchmarks" / "exports.py"
    done = subprocess.run(
        [sys.executable, str(script), "--smoke"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "x openpyxl" in done.stdout
