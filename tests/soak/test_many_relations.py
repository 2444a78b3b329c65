"""The relations between verdicts on as many random cells as there is time for."""

import inspect
import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "relations"))
import test_relations as relations

CELLS = int(os.environ.get("SEEROB_SOAK_CELLS", "100000"))
ASKED = {
    f"{name}-{what}": (check, {"what": what} if what else {})
    for name, check in vars(relations).items()
    if name.startswith("test_")
    for what in (relations.SAME if "what" in inspect.signature(check).parameters else ("",))
}
"""Each relation; `test_nothing_changes` is one for each thing that is done to a cell."""


@pytest.mark.soak
@pytest.mark.parametrize("relation", ASKED)
def test_many_cells(relation, tmp_path):
    check, more = ASKED[relation]
    wrong = []
    for seed in range(relations.EACH, relations.EACH + CELLS // len(ASKED)):
        try:
            check(seed=seed, tmp_path=tmp_path / str(seed), **more)
        except AssertionError as error:
            wrong.append(f"cell {seed}: {str(error).splitlines()[0]}")
    assert not wrong, "\n".join(wrong[:20])
