"""Forces of a grip and of a torque box: linear programs and closed forms, also where joints do nothing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from seerob.criteria.polytope import Polytope, free_moment, torque_box, zero_moment

LOW, HIGH = np.array([-3.0, -5, -2, -4, -1, -2, -6]), np.array([4.0, 2, 3, 1, 2, 5, 1])


def reach(J: np.ndarray, low: np.ndarray, high: np.ndarray, u: np.ndarray) -> float:
    """How far along u a force may be when some moment goes with it, by a linear program."""
    found = linprog(
        -np.append(u, np.zeros(3)),
        A_ub=np.vstack([J.T, -J.T]),
        b_ub=np.append(high, -low),
        bounds=[(None, None)] * 6,
    )
    return float(-found.fun) if found.status == 0 else np.inf


def corners_reach(found: Polytope, u: np.ndarray) -> float:
    return float((found.corners @ u).max())


@pytest.mark.parametrize("n", [6, 7])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_grip_bears_what_a_linear_program_allows(n: int, scale: float) -> None:
    rng = np.random.default_rng(n)
    J = scale * rng.normal(size=(6, n))
    J[:, 2] = -np.abs(J[:, 2])
    found = free_moment(J, LOW[:n], HIGH[:n])
    assert found.free.shape == (3, 0)
    for u in np.vstack([np.eye(3), -np.eye(3), rng.normal(size=(3, 3))]):
        assert corners_reach(found, u) == pytest.approx(reach(J, LOW[:n], HIGH[:n], u), rel=1e-6)


def test_of_five_joints_the_wrench_across_them_has_no_end_and_the_rest_is_bounded() -> None:
    rng = np.random.default_rng(3)
    J = rng.normal(size=(6, 5))
    found = free_moment(J, LOW[:5], HIGH[:5])
    across = np.linalg.svd(J)[0][:3, 5]
    assert found.free.shape == (3, 1)
    assert abs(found.free[:, 0] @ across) == pytest.approx(np.linalg.norm(across))
    assert found.largest == np.inf
    np.testing.assert_allclose(found.corners @ found.free, 0, atol=1e-9)
    for u in rng.normal(size=(4, 3)):
        beside = u - found.free[:, 0] * (found.free[:, 0] @ u)
        assert corners_reach(found, beside) == pytest.approx(reach(J, LOW[:5], HIGH[:5], beside), rel=1e-6)
        assert reach(J, LOW[:5], HIGH[:5], u) == np.inf


@pytest.mark.parametrize("column", [0.0, 1e-13, -1e-13])
@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_joint_that_does_nothing_bounds_nothing_but_must_hold_itself(column: float, scale: float) -> None:
    J = scale * np.random.default_rng(6).normal(size=(6, 6))
    wide = np.column_stack([J, np.full(6, column * scale)])
    for bounds in ((-1.0, 1.0), (0.0, 0.5), (-0.5, 0.0)):
        low, high = np.append(LOW[:6], bounds[0]), np.append(HIGH[:6], bounds[1])
        for some in (free_moment, torque_box):
            rows = 6 if some is free_moment else 3
            plain, found = some(J[:rows], LOW[:6], HIGH[:6]), some(wide[:rows], low, high)
            np.testing.assert_allclose(found.corners, plain.corners, rtol=1e-9)
    for bounds in ((0.1, 1.0), (-1.0, -0.1)):
        assert free_moment(wide, np.append(LOW[:6], bounds[0]), np.append(HIGH[:6], bounds[1])).empty


def test_a_grip_whose_torques_contradict_each_other_bears_nothing() -> None:
    J = np.random.default_rng(1).normal(size=(6, 6))
    J = np.column_stack([J, -J[:, 0]])
    low, high = np.append(LOW[:6], 5.0), np.append(HIGH[:6], 6.0)
    low[0], high[0] = 1.0, 2.0
    found = free_moment(J, low, high)
    assert found.empty
    assert np.isnan(found.largest)
    assert np.isnan(found.inscribed)
    assert (found.corners.shape, found.triangles.shape, found.free.shape) == ((0, 3), (0, 3), (3, 0))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_torque_box_is_the_image_of_its_corners(scale: float) -> None:
    J = np.diag([1.0, 2.0, 4.0])
    found = torque_box(J, scale * LOW[:3], scale * HIGH[:3])
    ends = scale * np.array([LOW[:3], HIGH[:3]]) / np.diag(J)
    np.testing.assert_allclose([found.corners.min(axis=0), found.corners.max(axis=0)], ends)
    assert len(found.corners) == 8
    # The nearest face is that of the third force, -2/4, or of the second up, 2/2.
    assert found.inscribed == pytest.approx(0.5 * scale)
    assert found.largest == pytest.approx(scale * np.sqrt(16 + 2.5**2 + 0.75**2))
    for triangle in found.triangles:
        a, b, c = found.corners[triangle]
        middle = found.corners.mean(axis=0)
        assert np.cross(b - a, c - a) @ (a - middle) > 0


def test_a_box_across_a_direction_that_nothing_drives_is_flat_and_has_no_end_there() -> None:
    J = np.array([[1.0, 0, 1], [0, 1, 0], [0, 0, 0]])
    found = torque_box(J, LOW[:3], HIGH[:3])
    np.testing.assert_allclose(np.abs(found.free), [[0], [0], [1]])
    assert (found.largest, len(found.triangles)) == (np.inf, 0)
    # Pseudo-inverse of (1, 1): the mean of both torques.
    np.testing.assert_allclose(found.corners.max(axis=0), [(4 + 3) / 2, 2, 0], atol=1e-12)
    assert np.isnan(found.inscribed)


def test_a_set_of_one_force_is_flat_and_has_an_end() -> None:
    found = torque_box(np.eye(3), np.ones(3), np.ones(3))
    np.testing.assert_allclose(found.corners, [[1, 1, 1]])
    assert (found.inscribed, found.free.shape, len(found.triangles)) == (0.0, (3, 0), 0)
    assert found.largest == pytest.approx(np.sqrt(3))


def test_without_any_joint_that_moves_it_no_force_has_an_end() -> None:
    for some, rows in ((free_moment, 6), (torque_box, 3), (zero_moment, 3)):
        found = some(np.zeros((rows, 2)), -np.ones(2), np.ones(2))
        assert (found.free.shape, found.largest) == ((3, 3), np.inf)


@pytest.mark.parametrize("some", [free_moment, torque_box])
def test_ten_joints_are_not_too_many_and_eleven_are(some) -> None:
    """Those that move the point; all columns point to one side."""
    rows = 6 if some is free_moment else 3
    J = -np.abs(np.random.default_rng(2).normal(size=(rows, 11)))
    low, high = -np.ones(11), np.ones(11)
    with pytest.raises(ValueError, match="11 driven joints"):
        some(J, low, high)
    ten = some(J[:, :10], low[:10], high[:10])
    for scale in (1e-3, 1e3):
        J[:, 10] = 1e-13
        found = some(scale * J, low, high)
        assert found.largest * scale == pytest.approx(ten.largest)


def test_bounds_may_meet_and_not_cross() -> None:
    J = np.eye(3)
    assert torque_box(J, np.array([0.0, 1, 0]), np.array([0.0, 1, 1])).largest == pytest.approx(np.sqrt(2))
    with pytest.raises(ValueError, match="joint 1: the lower"):
        torque_box(J, np.array([0.0, 2, 0]), np.array([0.0, 1, 1]))


@pytest.mark.parametrize("some", [free_moment, torque_box])
@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_torques_and_lengths_in_other_units_are_the_same_forces(some, scale: float) -> None:
    J = np.random.default_rng(4).normal(size=(6 if some is free_moment else 3, 7))
    plain = some(J, LOW, HIGH)
    for found, factor in (
        (some(scale * J, LOW, HIGH), scale),
        (some(J, LOW * scale, HIGH * scale), 1 / scale),
    ):
        assert (len(found.corners), found.free.shape) == (len(plain.corners), (3, 0))
        assert found.largest * factor == pytest.approx(plain.largest)
        assert found.inscribed * factor == pytest.approx(plain.inscribed)


def test_a_second_joint_like_the_first_changes_nothing() -> None:
    """Every corner is then on a bound of both, to rounding."""
    for seed in range(5):
        J = np.random.default_rng(seed).normal(size=(6, 6))
        low, high = LOW[:6].copy(), HIGH[:6].copy()
        low[3] = 0.0
        plain = free_moment(J, low, high)
        twice = free_moment(np.column_stack([J, J[:, 0]]), np.append(low, low[0]), np.append(high, high[0]))
        assert len(twice.corners) == len(plain.corners)
        assert twice.inscribed == pytest.approx(plain.inscribed)


@pytest.mark.parametrize("some", [free_moment, torque_box])
@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_near_a_singular_pose_to_rounding_a_force_has_no_end(some, scale: float) -> None:
    rows = 6 if some is free_moment else 3
    J = scale * np.random.default_rng(9).normal(size=(rows, 6))
    J[-1] = J[0] - 2 * J[1]
    found = some(J, LOW[:6], HIGH[:6])
    across = np.zeros(rows)
    across[[0, 1, -1]] = 1, -2, -1
    assert found.free.shape == (3, 1)
    assert abs(found.free[:, 0] @ across[:3]) == pytest.approx(np.linalg.norm(across[:3]))


def test_a_flat_set_that_nothing_balances_is_flat() -> None:
    """Of which the third force is always -2: all corners on one side, far from 0."""
    found = torque_box(np.eye(3), np.array([-5.0, -9, -2]), np.array([-4.0, -8, -2]))
    assert (found.corners.shape, found.triangles.shape, found.inscribed) == ((4, 3), (0, 3), 0.0)
    near = torque_box(np.eye(3), np.array([-5.0, -9, -2]), np.array([-4.0, -8, -1.9]))
    assert (len(near.corners), len(near.triangles)) == (8, 12)
    assert near.inscribed == pytest.approx(-8)
