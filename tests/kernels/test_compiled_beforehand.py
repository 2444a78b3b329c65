"""What is compiled before a first run is what that run asks for, and with its types."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib import import_module
from inspect import signature
from pathlib import Path

import pytest
from numba.core.sigutils import normalize_signature

from seerob.kernels._beforehand import LOOPS, PLANNING, PLANNING_IN_TIME

SCRIPT = """
import json, sys
from importlib import import_module
from pathlib import Path
from numba.core.dispatcher import Dispatcher
import seerob as sr
from seerob.app.console.sinks import sinks_of

station = sr.load(Path(sys.argv[1]))
ticks = iter(range(20))
station.run(
    folder=sys.argv[2], sinks=sinks_of(station.workstation, lossless=True),
    stop=lambda: next(ticks, None) is None,
)
asked, imported = {}, set()
for name, module in list(sys.modules.items()):
    if name.startswith("seerob.kernels."):
        for loop in vars(module).values():
            if isinstance(loop, Dispatcher) and loop.__module__ == name:
                own = name.rpartition(".")[2]
                if loop._can_compile:
                    asked[f"{own} {loop.__name__}"] = list(map(str, loop.signatures))
                else:
                    imported.add(own)
ready = "numba.np.arraymath" in sys.modules
print(json.dumps([{name: found for name, found in asked.items() if found}, sorted(imported), ready]))
"""


def test_a_run_compiles_no_loop_but_those_that_are_listed(tmp_path):
    """Of what is loaded from Numba's cache, only what Python calls has types: what compiled is run again."""
    cell = Path(__file__).parents[2] / "workstations" / "ur10_assembly"
    command = [sys.executable, "-P", "-c", SCRIPT, str(cell)]
    for turn in ("perhaps compiled", "loaded"):
        done = subprocess.run([*command, str(tmp_path / turn)], check=True, capture_output=True, text=True)
        asked, imported, ready = json.loads(done.stdout.splitlines()[-1])
        if not ready:
            break
    listed = {name: [str(normalize_signature(types)[0])] for name, types in LOOPS.items() if types}
    assert {name: types for name, types in asked.items() if types != listed.get(name)} == {}
    assert "nearest nearest" in asked
    assert {name.split()[0] for name in LOOPS}.issuperset(imported)
    # What Numba needs to compile, and SciPy's linear algebra with it, is loaded by who compiles.
    assert not ready


@pytest.mark.parametrize("name", [*LOOPS, *PLANNING, *PLANNING_IN_TIME])
def test_what_is_listed_is_there(name):
    module, function = name.split()
    loop = getattr(import_module(f"seerob.kernels.{module}"), function)
    if types := {**LOOPS, **PLANNING, **PLANNING_IN_TIME}[name]:
        assert len(normalize_signature(types)[0]) == len(signature(loop.py_func).parameters)
    else:
        assert not loop._can_compile, "its decorator has no types"
