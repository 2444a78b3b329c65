"""The benchmark's libraries agree, tick by tick."""

import subprocess
import sys
from pathlib import Path


def test_seerob_coal_and_fcl_agree_on_a_ur10():
    script = Path(__file__).parents[1] / "benchmarks" / "distances.py"
    done = subprocess.run(
        [sys.executable, str(script), "--smoke"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "person" in done.stdout
    assert "parts" in done.stdout
