"""One question among many bodies: what was asked before, order, caps and frames change nothing."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from concave import made_crowd, said, walk
from seerob.core.errors import InputError, SimulationDiverged, UnknownName
from seerob.distance.least import DistanceKind, Per, Query


@pytest.fixture(scope="module")
def crowd():
    return made_crowd()


SETS = (0, 1, 2), (3, 4, 6)


@pytest.mark.parametrize("cap", [np.inf, 0.3])
def test_the_answer_is_a_function_of_the_poses_alone(crowd, cap):
    """Fresh, in order, shuffled, in one call or after other questions: the same bits."""
    R, x = walk(150, 7, 0.6)
    once = Query(crowd, *SETS, cap=cap)
    in_order = [once.per_body(R[k], x[k]) for k in range(len(R))]
    batch = Query(crowd, *SETS, cap=cap).batch(R, x, Per.BODY)
    mixed = Query(crowd, *SETS, cap=cap)
    for k in np.random.default_rng(4).permutation(len(R)):
        mixed.minimum(R[k], x[k])
        if k % 3 == 0:
            mixed.per_pair(R[k], x[k])
        fresh = Query(crowd, *SETS, cap=cap).per_body(R[k], x[k])
        answers = [in_order[k], mixed.per_body(R[k], x[k]), fresh]
        for answer in answers:
            for one, other in zip(said(answer), said(batch), strict=True):
                np.testing.assert_array_equal(one, other[k])


def test_the_least_of_all_is_the_least_of_each(crowd):
    R, x = walk(200, 7, 0.6, 1)
    query = Query(crowd, *SETS)
    pairs = query.batch(R, x, Per.PAIR)
    by_body = query.batch(R, x, Per.BODY)
    least = query.batch(R, x)
    assert (pairs.distance.reshape(-1, 3, 3).min(1) == by_body.distance).all()
    assert (by_body.distance.min(1) == least.distance[:, 0]).all()
    assert (pairs.kind == DistanceKind.DEPTH_AT_LEAST).any()
    assert (pairs.body_a == np.repeat(SETS[0], 3)).all()
    assert (pairs.body_b == np.tile(SETS[1], 3)).all()


def test_a_cap_changes_nothing_below_it(crowd):
    R, x = walk(200, 7, 1.5, 2)
    free = Query(crowd, *SETS).batch(R, x, Per.BODY)
    capped = Query(crowd, *SETS, cap=0.2).batch(R, x, Per.BODY)
    near = free.distance < 0.2
    assert 50 < near.sum() < near.size - 50
    for one, other in zip(said(free), said(capped), strict=True):
        np.testing.assert_array_equal(one[near], other[near])
    assert (capped.distance[~near] == 0.2).all()
    assert (capped.kind[~near] == DistanceKind.BEYOND_CAP).all()
    assert (capped.body_a[~near] == -1).all()
    assert np.isnan(capped.point_a[~near]).all()


def test_swapping_the_sets_swaps_the_points(crowd):
    R, x = walk(100, 7, 0.6, 3)
    one = Query(crowd, *SETS).batch(R, x)
    other = Query(crowd, *SETS[::-1]).batch(R, x)
    assert (one.distance == other.distance).all()
    single = one.kind[:, 0] == DistanceKind.EXACT
    np.testing.assert_array_equal(one.point_a[single], other.point_b[single])
    np.testing.assert_array_equal(one.body_a[single], other.body_b[single])


def test_a_common_motion_changes_nothing(crowd):
    R, x = walk(100, 7, 0.6, 4)
    turn, shift = Rotation.random(rng=5).as_matrix(), np.array([3.0, -2.0, 1.0])
    one = Query(crowd, *SETS).batch(R, x, Per.PAIR)
    moved = Query(crowd, *SETS).batch(turn @ R, x @ turn.T + shift, Per.PAIR)
    np.testing.assert_allclose(moved.distance, one.distance, atol=1e-12)
    exact = one.kind == DistanceKind.EXACT
    away = exact & (abs(one.distance) > 1e-6)
    close = abs(one.point_a @ turn.T + shift - moved.point_a).max(-1)[away]
    assert (close < 1e-9).mean() > 0.99  # The rest: two equally near points.


def test_sets_that_cannot_be_are_told_apart(crowd):
    for a, b, words in [
        ([], [1], "an empty set"),
        ([0], [5], "none of ghost has a shape"),
        ([0], [99], "no body has index 99"),
        ([0, 1], [1], "'link 1' is in both sets"),
    ]:
        with pytest.raises(InputError, match=words):
            Query(crowd, a, b)
    with pytest.raises(InputError, match="nan is not a distance"):
        Query(crowd, [0], [1], cap=np.nan)
    with pytest.raises(UnknownName, match="did you mean 'link 1'"):
        crowd.index("link1")
    assert crowd.index("hand") == 3


def test_a_pose_that_is_not_finite_is_refused_and_forgotten(crowd):
    R, x = walk(3, 7, 0.6, 5)
    query = Query(crowd, *SETS)
    query.minimum(R[0], x[0])
    broken = x[1].copy()
    broken[4, 2] = np.nan
    with pytest.raises(SimulationDiverged, match="'chest'"):
        query.minimum(R[1], broken)
    assert query.minimum(R[2], x[2]).distance == Query(crowd, *SETS).minimum(R[2], x[2]).distance
    with pytest.raises(ValueError, match="poses of 7 bodies"):
        query.minimum(R[0, :6], x[0, :6])
