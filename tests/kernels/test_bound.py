"""Arrays whose addresses a kernel is given once: what does not fit is refused, and copies stand alone."""

from __future__ import annotations

import copy
import pickle
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit

from seerob.core.shapes import Solid, capsule
from seerob.distance.least import Per, Query, Shapes
from seerob.kernels.bound import Layout


class Two(NamedTuple):
    numbers: np.ndarray
    flags: np.ndarray


LAYOUT = Layout(Two, [(np.float64, 3), (np.bool_, 1)])
read = LAYOUT.read


@njit
def taken(table, row, i, j, k):
    two = read(table, row)
    two.numbers[i, j, k] += 1.0
    two.flags[j] = True
    return two.numbers[i, j, k], two.numbers.shape, len(two.flags), two.numbers[i, j].sum()


def test_a_kernel_reads_and_writes_the_arrays_themselves():
    two = Two(np.arange(24.0).reshape(2, 3, 4), np.zeros(5, bool))
    table = np.concatenate([np.zeros((3, 4), np.int64), LAYOUT.rows(two)])
    assert taken(table, 3, 1, 2, 1) == (22.0, (2, 3, 4), 5, 20.0 + 22.0 + 22.0 + 23.0)
    assert two.numbers[1, 2, 1] == 22.0
    assert two.flags.tolist() == [False, False, True, False, False]


@pytest.mark.parametrize(
    "wrong",
    [
        Two(np.zeros((2, 3, 4), np.float32), np.zeros(5, bool)),
        Two(np.zeros((2, 3)), np.zeros(5, bool)),
        Two(np.zeros((2, 3, 8))[:, :, ::2], np.zeros(5, bool)),
        Two(np.zeros((2, 3, 4)), np.zeros(5, np.int64)),
        (np.zeros((2, 3, 4)), np.zeros(5, bool)),
    ],
)
def test_what_is_not_of_the_layout_is_refused(wrong):
    with pytest.raises(TypeError, match="expected"):
        LAYOUT.rows(wrong)


def rods(n):
    shape = Solid(points=np.array([[0, 0, 0], [0.4, 0, 0], [0, 0.3, 0]]))
    return Shapes.build(
        [("plate", [shape]), *((f"rod {k}", [capsule(np.zeros(3), np.eye(3)[2], 0.1)]) for k in range(n))]
    )


def test_an_answer_that_is_kept_stays_that_of_its_tick():
    query = Query(rods(3), [0], [1, 2, 3])
    R, x = np.tile(np.eye(3), (4, 1, 1)), np.arange(12.0).reshape(4, 3)
    kept = query.per_body(R, x)
    before = copy.deepcopy(kept)
    one = query.minimum(R, x)
    assert not np.array_equal(query.per_body(R, 2 * x).distance, kept.distance)
    query.minimum(R, 3 * x)
    for name in ("distance", "point_a", "point_b", "body_a", "body_b", "kind"):
        assert np.array_equal(getattr(kept, name), getattr(before, name))
    assert np.array_equal(one.point_a, kept.at(0).point_a)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda query: pickle.loads(pickle.dumps(query))])
def test_a_copy_of_a_query_has_a_memory_of_its_own(copied):
    query = Query(rods(3), [0], [1, 2, 3])
    R, x = np.tile(np.eye(3), (4, 1, 1)), np.arange(12.0).reshape(4, 3)
    query.per_body(R, x)
    other = copied(query)
    mine, theirs = query._survey(Per.BODY)._memory.table, other._survey(Per.BODY)._memory.table
    assert not np.intersect1d(mine[:, 0], theirs[:, 0]).size
    expected = query.per_body(R, 2 * x).distance
    del query
    assert np.array_equal(other.per_body(R, 2 * x).distance, expected)
