"""What exists in the real cell (``real = true``): said to the page, and of no weight for any figure."""

import numpy as np
import pytest

from made_cell import FLOATING, UR10, made, person, results_at

CELL = (
    FLOATING
    + UR10
    + person("op", 1.0, 0, 0)
    + '[[parts]]\nname = "wall"\nshape = { box = [0.1, 1, 1] }\nat = { position = [0.7, 0, 0.5] }\n'
    + '[[safety]]\nkind = "minimum_distance"\nbetween = ["arm", "op"]\nlimit = 0.2\n'
    + '[[safety]]\nkind = "minimum_distance"\nname = "wall"\nbetween = ["arm", "wall"]\nlimit = 0.2\n'
)
HEADERS = {"arm": "[[robots]]", "load": "[[tools]]", "op": "[[humans]]", "wall": "[[parts]]"}
STILL = {"arm": (np.array([0, -1.2, 1.4, -1.5, -1.5, 0]), np.zeros(6))}


@pytest.mark.parametrize("name", HEADERS)
def test_what_is_real_says_so_and_counts_as_before(tmp_path, name):
    there = CELL.replace(HEADERS[name] + "\n", HEADERS[name] + "\nreal = true\n")
    virtual, real = made(tmp_path / "virtual", CELL), made(tmp_path / "real", there)
    nodes = real.scene().nodes
    assert {node.owner for node in nodes if node.real} == {name}
    assert all(node.real for node in nodes if node.owner == name)
    assert not any(node.real for node in virtual.scene().nodes)
    before, after = results_at(virtual, **STILL), results_at(real, **STILL)
    assert [(r.value, r.interval, r.verdict) for r in before.values()] == [
        (r.value, r.interval, r.verdict) for r in after.values()
    ]
    assert all(r.value is not None for r in after.values())


def test_an_area_cannot_be_real(tmp_path):
    area = '[[areas]]\nname = "near"\nreal = true\nshape = { box = [1, 1, 1] }\n'
    with pytest.raises(Exception, match="real"):
        made(tmp_path, CELL + area)
