"""Kinematics and branches of arms, against closed forms and a second library."""

import numpy as np
import pytest

from seerob.core.errors import UnknownName
from seerob.description.robots import library
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.inverse import (
    Branch,
    branch,
    factors,
    is_classic,
    parse,
    rotation_vectors,
    solutions,
)

D1, A2, A3, D4, D5, D6 = 0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922
"""Universal Robots, DH parameters of the UR10 [m]."""


def dh(theta, d, a, alpha):
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])


def ur10(q):
    rows = zip(q, (D1, 0, 0, D4, D5, D6), (0, A2, A3, 0, 0, 0), (1, 0, 0, 1, -1, 0), strict=True)
    T = np.eye(4)
    for theta, d, a, quarter in rows:
        T = T @ dh(theta, d, a, quarter * np.pi / 2)
    return T


def closed_form(T):
    """The eight solutions of a UR, by hand: shoulder, wrist, elbow."""
    found = []
    p = T @ np.array([0, 0, -D6, 1])
    for shoulder in (1, -1):
        q1 = np.arctan2(p[1], p[0]) + shoulder * np.arccos(D4 / np.hypot(p[0], p[1])) + np.pi / 2
        c5 = (T[0, 3] * np.sin(q1) - T[1, 3] * np.cos(q1) - D4) / D6
        for wrist in (1, -1):
            q5 = wrist * np.arccos(c5)
            q6 = np.arctan2(
                (-T[0, 1] * np.sin(q1) + T[1, 1] * np.cos(q1)) / np.sin(q5),
                (T[0, 0] * np.sin(q1) - T[1, 0] * np.cos(q1)) / np.sin(q5),
            )
            T14 = (
                np.linalg.inv(dh(q1, D1, 0, np.pi / 2))
                @ T
                @ np.linalg.inv(dh(q5, D5, 0, -np.pi / 2) @ dh(q6, D6, 0, 0))
            )
            p13 = T14 @ np.array([0, -D4, 0, 1])
            c3 = (p13[0] ** 2 + p13[1] ** 2 - A2**2 - A3**2) / (2 * A2 * A3)
            if abs(c3) > 1:
                continue
            for elbow in (1, -1):
                q3 = elbow * np.arccos(c3)
                q2 = np.arctan2(p13[1], p13[0]) - np.arctan2(A3 * np.sin(q3), A2 + A3 * np.cos(q3))
                T34 = np.linalg.inv(dh(q2, 0, A2, 0) @ dh(q3, 0, A3, 0)) @ T14
                found.append([q1, q2, q3, np.arctan2(T34[1, 0], T34[0, 0]), q5, q6])
    return np.array(found)


def apart(a, b):
    return np.abs((np.asarray(a) - np.asarray(b) + np.pi) % (2 * np.pi) - np.pi).max()


@pytest.fixture(scope="module")
def arm():
    return Arm(library.load("ur10"), base="base")


def test_forward_kinematics_of_a_ur10_are_those_of_its_dh_parameters(arm):
    for q in np.random.default_rng(1).uniform(-3, 3, (20, 6)):
        at = arm.posture(q)
        T = ur10(q)
        # The library has the figures of the newer description; both round to the millimetre.
        np.testing.assert_allclose(at.position, T[:3, 3], atol=2e-3)
        np.testing.assert_allclose(at.rotation, T[:3, :3], atol=1e-6)


def test_many_postures_at_once_are_those_one_by_one(arm):
    q = np.random.default_rng(2).uniform(-3, 3, (7, 6))
    together = arm.posture(q)
    for i in range(7):
        np.testing.assert_array_equal(together.jacobian()[i], arm.posture(q[i]).jacobian())


@pytest.mark.parametrize("name", ["ur3e", "iiwa7", "niryo_one"])
def test_jacobian_is_the_derivative_of_the_posture(name):
    arm = Arm(
        library.load(name), link_from_tcp=[[1, 0, 0, 0.1], [0, 1, 0, 0.02], [0, 0, 1, 0.3], [0, 0, 0, 1]]
    )
    q, h = np.random.default_rng(3).uniform(-1, 1, arm.n), 1e-6
    J = arm.posture(q).jacobian()
    for i in range(arm.n):
        step = h * np.eye(arm.n)[i]
        a, b = arm.posture(q - step), arm.posture(q + step)
        np.testing.assert_allclose((b.position - a.position) / (2 * h), J[:3, i], atol=1e-8)
        turn = rotation_vectors(b.rotation @ a.rotation.T) / (2 * h)
        np.testing.assert_allclose(turn, J[3:, i], atol=1e-8)


@pytest.mark.parametrize("name", ["ur3", "ur5", "ur10", "ur3e", "ur5e", "ur10e", "ur16e"])
def test_determinant_is_a_constant_times_the_three_factors(name):
    arm = Arm(library.load(name))
    assert is_classic(arm)
    at = arm.posture(np.random.default_rng(4).uniform(-3, 3, (200, 6)))
    ratio = np.linalg.det(at.jacobian()) / factors(at).prod(axis=-1)
    assert np.ptp(ratio) < 1e-8 * np.abs(ratio).mean()


def test_all_eight_solutions_are_found_each_on_a_branch_of_its_own(arm):
    for q in np.random.default_rng(5).uniform(-1.5, 1.5, (5, 6)):
        at = arm.posture(q)
        found = solutions(arm, at.rotation, at.position, q)
        assert apart(found[0].q, q) < 1e-9
        assert found[0].branch == branch(at)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = at.rotation, at.position
        expected = closed_form(T)
        assert len({s.branch for s in found}) == len(found) == len(expected)
        for row in expected:
            # 2 mm of difference between the two sets of lengths, on arms of half a metre.
            assert min(apart(row, s.q) for s in found) < 0.05


def test_solutions_reach_the_pose_within_the_limits_and_the_nearest_turn_is_taken(arm):
    q = np.array([3.0, -1.0, 1.2, -1.4, 1.5, -3.0])
    at = arm.posture(q)
    for near in (q, q - np.array([2 * np.pi, 0, 0, 0, 0, -2 * np.pi])):
        found = solutions(arm, at.rotation, at.position, near)
        np.testing.assert_allclose(found[0].q, near, atol=1e-8)
        for s in found:
            assert (s.q >= arm.lower - 1e-9).all()
            assert (s.q <= arm.upper + 1e-9).all()
            np.testing.assert_allclose(arm.posture(s.q).position, at.position, atol=1e-8)


def test_what_is_out_of_reach_has_no_solution(arm):
    assert solutions(arm, np.eye(3), np.array([2.0, 0, 0]), np.zeros(6)) == ()


def test_seven_joints_have_no_branches_and_one_answer():
    arm = Arm(library.load("iiwa14"))
    assert not is_classic(arm)
    q = np.array([0.1, 0.5, 0.2, -1.4, 0.1, 1.2, 0.3])
    at = arm.posture(q)
    (only,) = solutions(arm, at.rotation, at.position, q)
    assert only.branch is None


def test_a_branch_is_written_as_signs():
    assert parse("+-+") == Branch(1, -1, 1)
    assert parse("+ − -") == Branch(1, -1, -1)
    with pytest.raises(ValueError, match="signs of shoulder"):
        parse("up")


def test_a_link_that_is_not_there_is_named():
    with pytest.raises(UnknownName, match="tool0"):
        Arm(library.load("ur10"), link="tool")


def test_rotation_vectors_turn_back_what_they_came_from():
    from scipy.spatial.transform import Rotation

    vectors = np.random.default_rng(6).normal(size=(50, 3))
    vectors *= np.linspace(0, np.pi, 50)[:, None] / np.linalg.norm(vectors, axis=1, keepdims=True)
    got = rotation_vectors(Rotation.from_rotvec(vectors).as_matrix())
    # Half a turn has two axes.
    assert min(np.abs(got[-1] - vectors[-1]).max(), np.abs(got[-1] + vectors[-1]).max()) < 1e-6
    np.testing.assert_allclose(got[:-1], vectors[:-1], atol=1e-7)
