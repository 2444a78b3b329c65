from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seerob.core.transforms import is_convention, wxyz_from

ANGLES = np.random.default_rng(0).uniform(-3, 3, (50, 3))
SEQUENCES = ["".join(s) for s in product("xyz", repeat=3) if s[0] != s[1] != s[2]]


@pytest.mark.parametrize("sequence", SEQUENCES + [s.upper() for s in SEQUENCES])
def test_all_24_euler_conventions_equal_scipys(sequence):
    assert is_convention(sequence)
    ours = Rotation.from_quat(np.roll(wxyz_from(sequence, ANGLES), -1, axis=1))
    theirs = Rotation.from_euler(sequence, ANGLES)
    assert (ours * theirs.inv()).magnitude().max() < 1e-12


def test_rotation_vectors_equal_scipys_down_to_zero():
    vectors = np.vstack([ANGLES, np.zeros(3), [1e-12, 0, 0]])
    ours = Rotation.from_quat(np.roll(wxyz_from("rotation_vector", vectors), -1, axis=1))
    assert (ours * Rotation.from_rotvec(vectors).inv()).magnitude().max() < 1e-12


def test_rpy_is_the_fixed_axes_of_urdf():
    from seerob.core.transforms import rotation_from_rpy, rotation_from_wxyz

    for angles, wxyz in zip(ANGLES, wxyz_from("rpy", ANGLES), strict=True):
        np.testing.assert_allclose(rotation_from_wxyz(wxyz), rotation_from_rpy(angles), atol=1e-12)


def test_quaternion_orders_and_lengths():
    q = np.array([[0.5, -0.5, 0.5, 0.5], [-2.0, 0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(wxyz_from("wxyz", q), [[0.5, -0.5, 0.5, 0.5], [1, 0, 0, 0]])
    np.testing.assert_array_equal(wxyz_from("xyzw", np.roll(q, -1, axis=1)), wxyz_from("wxyz", q))
    with pytest.raises(ValueError, match="row 1"):
        wxyz_from("wxyz", np.array([[1.0, 0, 0, 0], [0, 0, 0, 0]]))


@pytest.mark.parametrize(("convention", "columns"), [("wxyz", 4), ("rotation_vector", 3), ("ZYX", 3)])
def test_what_is_beyond_all_bounds_is_refused_before_anything_overflows(convention, columns):
    values = np.full((3, columns), 0.5)
    values[2, 1] = -1e200
    with pytest.raises(ValueError, match=r"beyond 1e\+06 in sample 2"):
        wxyz_from(convention, values)


@pytest.mark.parametrize("text", ["ZYx", "XXY", "zy", "ABC", "", "zyxz", "RPY"])
def test_what_is_no_convention(text):
    assert not is_convention(text)
