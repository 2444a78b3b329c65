"""The benchmark of live sources runs: three emulators, their listeners alone, and beside the twin."""

import re
import subprocess
import sys
from pathlib import Path

import pytest


def test_packets_are_followed_to_the_mailbox_and_to_the_state():
    pytest.importorskip("asyncua")
    script = Path(__file__).parents[1] / "benchmarks" / "live.py"
    done = subprocess.run(
        [sys.executable, str(script), "--smoke"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for source in ("rtde ur10", "fri lbr", "plc"):
        assert f"{source}: p99" in done.stdout
    assert re.search(r"^rtde ur10: [\d.]+ % were read together", done.stdout, re.MULTILINE)
    assert "used while a newer one was there: 0" in done.stdout
    assert "packet to State p99" in done.stdout
