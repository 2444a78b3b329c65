import subprocess
import sys
from pathlib import Path


def test_every_figure_of_the_documentation_can_be_measured_again():
    script = Path(__file__).parents[1] / "benchmarks" / "accuracy.py"
    done = subprocess.run([sys.executable, script, "--smoke"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert {line.split()[0] for line in done.stdout.splitlines()} >= {
        "dynamics",
        "tracking",
        "person",
        "energy",
    }
    assert ": 0 differ" in done.stdout
