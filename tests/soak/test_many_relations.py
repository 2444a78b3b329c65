"""The relations between verdicts on as many random cells as there is time for, all of them of each cell.

Each find is printed when it comes, with the line that asks of its cell again. Ctrl-C, or SIGTERM, ends it
with what was found. ``SEEROB_SOAK_CELLS`` says of how many cells, ``SEEROB_SOAK_FROM`` from which on.
"""

import os
import shutil
import signal
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "relations"))
from test_relations import CELLS as IN_TESTS
from test_relations import RELATIONS, ask

CELLS = int(os.environ.get("SEEROB_SOAK_CELLS", "100000"))
FROM = int(os.environ.get("SEEROB_SOAK_FROM", IN_TESTS))
SAID_EVERY = 10
"""Cells after which a line says how far it is."""


@pytest.mark.soak
def test_many_cells(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(signal, "SIGTERM", signal.signal(signal.SIGTERM, signal.default_int_handler), False)
    finds, begun, seed = [], time.monotonic(), FROM

    def tell(line):
        with capsys.disabled():
            print(line, flush=True)

    try:
        for seed in range(FROM, FROM + CELLS):
            # All relations of one cell together: it is run once for all of them.
            for name in RELATIONS:
                try:
                    ask(name, seed, tmp_path)
                except Exception as error:  # whatever ends a run of a random cell is a find
                    words = f"{type(error).__name__}: {error}".splitlines()[0]
                    finds.append("\n  ".join([words, *error.__notes__]))
                    tell(finds[-1])
                finally:
                    shutil.rmtree(tmp_path, ignore_errors=True)
            if (seed + 1 - FROM) % SAID_EVERY == 0:
                cells, seconds = seed + 1 - FROM, time.monotonic() - begun
                tell(f"{cells} cells, {cells * len(RELATIONS)} asked in {seconds:.0f} s, {len(finds)} finds")
    except KeyboardInterrupt:
        tell(f"stopped at cell {seed}: {seed - FROM} cells, {len(finds)} finds")
    assert not finds, "\n".join(finds)
