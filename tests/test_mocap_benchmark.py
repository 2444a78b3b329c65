"""The benchmark of the motion capture decoders runs, and they say what their peers say."""

import subprocess
import sys
from pathlib import Path


def test_decoders_beside_their_peers():
    script = Path(__file__).parents[1] / "benchmarks" / "mocap_decoders.py"
    done = subprocess.run(
        [sys.executable, str(script), "--smoke"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr + done.stdout
    for what in ("MVN datagrams decoded", "MVNX frames", "BVH frames"):
        assert what in done.stdout
