"""The relations between verdicts on as many random cells as there is time for.

Each find is printed when it comes, with the line that asks of its cell again. Ctrl-C, or SIGTERM, ends it
with what was found. ``SEEROB_SOAK_CELLS`` says of how many cells, ``SEEROB_SOAK_FROM`` from which on.
"""

import inspect
import os
import shutil
import signal
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "relations"))
import test_relations as recorded

CELLS = int(os.environ.get("SEEROB_SOAK_CELLS", "100000"))
FROM = int(os.environ.get("SEEROB_SOAK_FROM", recorded.EACH))
ASKED = [
    (module, name, {"what": what} if what else {})
    for module, whats in ((recorded, recorded.SAME),)
    for name in vars(module)
    if name.startswith("test_")
    for what in (whats if "what" in inspect.signature(vars(module)[name]).parameters else ("",))
]
"""Each relation: its module and name, and which of many things are done to a cell."""
SAID_EVERY = 100
"""Cells after which a line says how far it is."""


@pytest.mark.soak
def test_many_cells(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(signal, "SIGTERM", signal.signal(signal.SIGTERM, signal.default_int_handler), False)
    finds, asked, begun = [], 0, time.monotonic()

    def tell(line):
        with capsys.disabled():
            print(line, flush=True)

    seed = FROM
    try:
        while asked < CELLS:
            # All relations of one cell together: it is run once for all of them.
            for module, name, more in ASKED:
                folder = tmp_path / f"{seed}"
                asked += 1
                try:
                    vars(module)[name](seed=seed, tmp_path=folder, **more)
                except Exception as error:  # whatever ends a run of a random cell is a find
                    words = f"{type(error).__name__}: {error}".splitlines()[0]
                    again = (
                        f"SEEROB_CELLS={seed} pytest tests/relations/{Path(module.__file__).name} -k {name}"
                    )
                    finds.append(f"cell {seed}, {name} {more.get('what', '')}: {words}\n  again: {again}")
                    tell(finds[-1])
                finally:
                    shutil.rmtree(folder, ignore_errors=True)
            seed += 1
            if seed % SAID_EVERY == 0:
                tell(f"cell {seed}: {asked} asked in {time.monotonic() - begun:.0f} s, {len(finds)} finds")
    except KeyboardInterrupt:
        tell(f"stopped at cell {seed}: {asked} asked, {len(finds)} finds")
    assert not finds, "\n".join(finds)
