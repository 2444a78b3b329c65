"""The benchmark's rays agree with MuJoCo's, and its inside tests with the winding number."""

import subprocess
import sys
from pathlib import Path


def test_rays_and_inside_tests_agree_with_their_peers():
    script = Path(__file__).parents[1] / "benchmarks" / "areas.py"
    done = subprocess.run(
        [sys.executable, str(script), "--smoke"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "541 beams" in done.stdout
    assert "0 differ" in done.stdout
