"""The shipped tables are the published ones: check sums, hashes, monotonicity."""

import hashlib
import json
from itertools import pairwise

import numpy as np
import pytest

from seerob.criteria.scoring.spans import cells, published


def digest(value):
    return hashlib.sha256(json.dumps(value, separators=(",", ":")).encode()).hexdigest()[:16]


@pytest.mark.parametrize(
    ("name", "keys", "sums", "expected"),
    [
        ("rula", "ABC", (705, 438, 269), "a2741e4a9097e76e"),
        ("reba", "ABC", (321, 177, 1192), "512bb534ac7a4746"),
    ],
)
def test_sums_and_hash(name, keys, sums, expected):
    tables = [published(name)[key] for key in keys]
    assert tuple(int(np.sum(t)) for t in tables) == sums
    assert digest(tables) == expected


def test_owas_counts_and_hash():
    table = cells("owas", "category")
    assert np.bincount(table.ravel()).tolist() == [0, 72, 53, 55, 72]
    assert digest(published("owas")["category"]) == "87edcd54f6a1f33f"


@pytest.mark.parametrize(
    "table",
    [
        cells("rula", "A").reshape(6, 3, 4, 2),
        cells("rula", "B").reshape(6, 6, 2),
        cells("rula", "C"),
        *(cells("reba", key) for key in "ABC"),
    ],
    ids=["rula A", "rula B", "rula C", "reba A", "reba B", "reba C"],
)
def test_no_table_falls_in_any_argument(table):
    for axis in range(table.ndim):
        assert (np.diff(table, axis=axis) >= 0).all()


def test_the_quirk_of_rulas_table_b_is_kept():
    assert cells("rula", "B")[:2, :4].tolist() == [[1, 3, 2, 3], [2, 3, 2, 3]]


def test_frequency_multipliers_never_grow_with_frequency_and_duration():
    table = np.array(published("niosh")["frequency_multiplier"])
    assert table.shape == (len(published("niosh")["frequencies"]), 6)
    assert all(a < b for a, b in pairwise(published("niosh")["frequencies"]))
    assert (np.diff(table, axis=0) <= 0).all()
    assert (table[:, 2:] <= table[:, :-2]).all()
    assert (table[:, 1::2] >= table[:, ::2]).all()
    assert table.sum() == pytest.approx(47.15, abs=0.001)


@pytest.mark.parametrize(("name", "count"), [("rula", 4), ("reba", 5)])
def test_every_score_has_one_action(name, count):
    table = published(name)
    assert len(table["actions"]) == len(table["levels"]) == count
    most = int(cells(name, "C").max()) + (3 if name == "reba" else 0)
    assert table["levels"][-1] == most
