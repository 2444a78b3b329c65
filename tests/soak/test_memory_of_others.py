"""What comes out hangs on no memory that nobody wrote: whatever it holds, results are the same bit by bit."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CELLS = Path(__file__).parents[2] / "workstations"
PROGRAM = """
import hashlib, sys
import seerob
from seerob.app.console.terminal import cache_folder

class Told:
    def __init__(self): self.hash = hashlib.sha256()
    def write(self, snapshot, samples): self.hash.update(repr(snapshot.results).encode() + snapshot.poses)
    def close(self): pass
    def __enter__(self): return self
    def __exit__(self, *error): pass

told = Told()
seerob.load(sys.argv[1], cache=cache_folder()).run(writers=[told])
print(told.hash.hexdigest())
"""


@pytest.mark.soak
@pytest.mark.parametrize("cell", ["two_robots", "ur10_assembly", "guarded_cell", "captured_operator"])
def test_results_are_the_same_whatever_fresh_memory_holds(cell):
    found = {}
    # The C library of GNU fills what it gives out with the complement of this, and what it takes back.
    for fill in ("0", "1", "170", "255"):
        env = {**os.environ, "MALLOC_PERTURB_": fill}
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, CELLS / cell], env=env, capture_output=True, text=True, check=True
        )
        found[fill] = done.stdout
    assert len(set(found.values())) == 1, found
