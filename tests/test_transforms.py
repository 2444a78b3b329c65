"""Rotations against scipy, and the identities that define them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from seerob.core import transforms as tf

RNG = np.random.default_rng(5)
RANDOM = Rotation.random(200, random_state=5)
angles = st.floats(-7, 7)


def test_quaternions_to_matrices_in_batch_and_of_any_length():
    wxyz = RANDOM.as_quat(scalar_first=True)
    np.testing.assert_allclose(tf.rotation_from_wxyz(wxyz), RANDOM.as_matrix(), atol=1e-15)
    np.testing.assert_allclose(tf.rotation_from_wxyz(-3.7 * wxyz), RANDOM.as_matrix(), atol=1e-14)


def test_matrices_to_quaternions_and_back_at_every_half_turn():
    half_turns = Rotation.from_rotvec(np.pi * np.vstack([np.eye(3), [[0.6, 0.8, 0], [0, -0.6, 0.8]]]))
    for matrix in [*RANDOM.as_matrix(), *half_turns.as_matrix(), np.eye(3)]:
        wxyz = tf.wxyz_from_rotation(matrix)
        assert wxyz[0] >= 0
        assert np.linalg.norm(wxyz) == pytest.approx(1, abs=1e-15)
        np.testing.assert_allclose(tf.rotation_from_wxyz(wxyz), matrix, atol=1e-14)


@given(angles, angles, angles)
def test_rpy_is_fixed_axes_x_y_z_and_comes_back(roll, pitch, yaw):
    matrix = tf.rotation_from_rpy((roll, pitch, yaw))
    np.testing.assert_allclose(matrix, Rotation.from_euler("xyz", (roll, pitch, yaw)).as_matrix(), atol=1e-12)


@given(angles)
def test_axis_and_angle_of_any_length_of_axis(angle):
    axis = np.array([1.0, -2.0, 0.5])
    expected = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    np.testing.assert_allclose(tf.rotation_from_axis_angle(3 * axis, angle), expected, atol=1e-12)


def test_transforms_chain_right_to_left_and_invert():
    a_from_b, b_from_c = (tf.transform(RANDOM[i].as_matrix(), RNG.uniform(-2, 2, 3)) for i in (0, 1))
    points = RNG.uniform(-1, 1, (10, 3))
    np.testing.assert_allclose(
        tf.apply(a_from_b @ b_from_c, points), tf.apply(a_from_b, tf.apply(b_from_c, points)), atol=1e-14
    )
    np.testing.assert_allclose(tf.inverse(a_from_b) @ a_from_b, np.eye(4), atol=1e-15)
    stack = np.stack([a_from_b, b_from_c])
    np.testing.assert_allclose(tf.inverse(stack) @ stack, np.broadcast_to(np.eye(4), (2, 4, 4)), atol=1e-15)
    np.testing.assert_array_equal(tf.transform(), np.eye(4))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e308])
@pytest.mark.parametrize("place", range(4))
def test_a_quaternion_without_direction_becomes_nan_and_changes_no_other(bad, place):
    rotation = Rotation.from_rotvec([0.3, -0.4, 0.5])
    broken = np.array([bad if k == place else -bad if k == (place + 1) % 4 else 0.5 for k in range(4)])
    found = tf.turned(rotation.as_matrix(), [[1, 0, 0, 0], broken])
    assert found[0] == pytest.approx(rotation.as_quat(scalar_first=True))
    assert np.isnan(found[1]).all()
