"""Which joint leads out of a singularity: against the twin, and against products of rotations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from made_cell import FLOATING, made, results_at, state_at
from seerob.criteria.safety.manipulability import STEP, least_value_after


def test_the_joint_that_leads_out_of_a_singularity_is_named(tmp_path):
    """A stretched elbow; and σ₃ once a joint has moved is that of the twin in the pose it has moved to."""
    text = FLOATING + '[[robots]]\nname = "arm"\nmodel = "library:ur5e"\n'
    text += '[[safety]]\nkind = "manipulability"\nname = "m"\nat = "arm/wrist_3_link"\nlimit = 0.1\n'
    station = made(tmp_path, text)
    q = np.array([0.3, -1.1, 1e-4, -0.4, 0.8, 0.2])
    found = results_at(station, arm=(q, np.zeros(6)))["m"]
    assert (found.verdict, "elbow" in found.reason) == ("exceeded", True)
    away = np.array([0.3, -1.1, 0.9, -0.4, 0.8, 0.2])
    assert results_at(station, arm=(away, np.zeros(6)))["m"].reason == ""
    robot, frame = station.model.robot("arm"), station.model.frame("arm/wrist_3_link")

    def J(q):
        return state_at(station, arm=(q, np.zeros(6))).jacobian(frame, robot)

    for pose in (q, away, np.zeros(6)):
        after = [[np.linalg.svd(J(pose + d * e)[:3])[1][2] for d in (0.3, -0.3)] for e in np.eye(6)]
        np.testing.assert_allclose(least_value_after(J(pose), 0.3), after, atol=1e-12)


def test_where_two_singular_values_vanish_the_joints_that_lead_out_are_still_told():
    """An arm stretched along two of its axes: σ₃ after each turn is that of the pose it leads to."""
    axes = np.array([[1.0, 0, 0], [0, 0, 1], [0, 0, 1], [1, 0, 0]])
    origins = np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0]])
    tip = np.array([3.0, 0, 0])

    def jacobian(q):
        """By products of rotations, from the base outward."""
        turned, where, point = axes.copy(), origins.copy(), tip
        for j in reversed(range(4)):
            R = Rotation.from_rotvec(q[j] * axes[j]).as_matrix()
            turned[j + 1 :] = turned[j + 1 :] @ R.T
            where[j + 1 :] = origins[j] + (where[j + 1 :] - origins[j]) @ R.T
            point = origins[j] + R @ (point - origins[j])
        return np.vstack([np.cross(turned, point - where).T, turned.T])

    assert np.linalg.svd(jacobian(np.zeros(4))[:3])[1][1] < 1e-15
    assert least_value_after(jacobian(np.zeros(4))).max(axis=1).argmax() == 2
    for step in (0.01, 0.5):
        after = [[np.linalg.svd(jacobian(d * e)[:3])[1][2] for d in (step, -step)] for e in np.eye(4)]
        np.testing.assert_allclose(least_value_after(jacobian(np.zeros(4)), step), after, atol=1e-12)


def test_slides_and_joints_that_move_at_a_rate_of_their_own_lead_out_as_they_move():
    """A turn about z, a slide along (3, 0, 4)/5 and a turn about y; the last two geared by 0.5 and 2."""
    axes = np.array([[0, 0, 1.0], [0.6, 0, 0.8], [0, 1.0, 0]])
    origins, tip, rates = np.array([[0, 0, 0], [0, 0, 0], [1.0, 0, 0]]), np.array([2, 0, 0.3]), (1, 0.5, 2)

    def jacobian(q):
        turned, where, point = axes.copy(), origins.copy(), tip
        for j in reversed(range(3)):
            R = Rotation.from_rotvec(q[j] * rates[j] * axes[j]).as_matrix() if j != 1 else np.eye(3)
            slid = q[j] * rates[j] * axes[j] * (j == 1)
            turned[j + 1 :] = turned[j + 1 :] @ R.T
            where[j + 1 :] = origins[j] + (where[j + 1 :] - origins[j]) @ R.T + slid
            point = origins[j] + R @ (point - origins[j]) + slid
        columns = np.vstack([np.cross(turned, point - where).T, turned.T])
        columns[:, 1] = [*turned[1], 0, 0, 0]
        return columns * rates

    after = [[np.linalg.svd(jacobian(d * e)[:3])[1][2] for d in (0.3, -0.3)] for e in np.eye(3)]
    # The slide comes at its rate by itself: 0.5 m/m is how its column says it moves.
    np.testing.assert_allclose(least_value_after(jacobian(np.zeros(3)), 0.3), after, atol=1e-12)
    assert math.degrees(STEP) == pytest.approx(1)
