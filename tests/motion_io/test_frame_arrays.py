"""What every reader checks: time advances, quaternions turn, what cannot be is not seen."""

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.core.transforms import (
    left_product,
    right_product,
    rotation_from_rpy,
    rotation_from_wxyz,
    transform,
    turned,
)
from seerob.files.motion_capture.frame_arrays import FrameArrays, check_size, checked


def test_quaternions_are_turned_as_their_rotations():
    rng = np.random.default_rng(1)
    wxyz = rng.normal(size=(5, 4))
    wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
    turn = rotation_from_rpy((0.3, -1.2, 2.0))
    found = rotation_from_wxyz(turned(turn, wxyz))
    np.testing.assert_allclose(found, turn @ rotation_from_wxyz(wxyz), atol=1e-12)
    assert np.isnan(turned(turn, [np.nan] * 4)).all()
    one, other = wxyz[:2]
    np.testing.assert_allclose(left_product(one) @ other, right_product(other) @ one, atol=1e-12)
    both = rotation_from_wxyz(one) @ rotation_from_wxyz(other)
    np.testing.assert_allclose(rotation_from_wxyz(left_product(one) @ other), both, atol=1e-12)


def test_frames_that_do_not_advance_and_values_that_cannot_be_are_left_out():
    t = np.array([0.0, 0.1, 0.1, 0.05, 0.2, np.nan, np.inf, 0.3, 0.9])
    positions = np.zeros((9, 2, 3))
    positions[0, 0] = np.inf
    positions[4, 1] = 1e5
    wxyz = np.tile([2.0, 0, 0, 0], (9, 2, 1))
    wxyz[:, 1] = 1.0, 0, 0, 0.02
    frames, rate, findings = checked(FrameArrays(t, positions, wxyz), file="f", subject="s")
    assert frames.t.tolist() == [0.0, 0.1, 0.2, 0.3, 0.9]
    assert rate == pytest.approx(10.0)
    assert np.isnan(frames.positions).any(axis=2).nonzero()[0].tolist() == [0, 2]
    assert np.isnan(frames.orientations[:, 0]).all()
    np.testing.assert_allclose(np.linalg.norm(frames.orientations[:, 1], axis=1), 1.0)
    told = "\n".join(f.text for f in findings)
    assert "4 of 9 frames were left out" in told
    assert "2 points further than 100 m" in told
    assert "5 orientations are no unit quaternions" in told
    assert "about 5 frames are missing, in 1 places" in told


def test_another_world_moves_points_and_turns_axes_alike():
    rng = np.random.default_rng(2)
    positions = rng.normal(size=(3, 4, 3))
    frames = FrameArrays(
        np.arange(3.0), positions, np.tile([1.0, 0, 0, 0], (3, 4, 1)), subjects=["a", "b", "c"]
    )
    move = transform(rotation_from_rpy((0.1, 0.2, 0.3)), (1.0, 2.0, 3.0))
    moved = frames.turned(move)
    np.testing.assert_allclose(moved.positions, positions @ move[:3, :3].T + move[:3, 3])
    np.testing.assert_allclose(rotation_from_wxyz(moved.orientations[0, 0]), move[:3, :3], atol=1e-12)
    assert [f.subject for f in moved] == ["a", "b", "c"]
    assert len(list(moved)) == len(list(moved)) == 3


def test_what_does_not_fit_or_holds_nothing_is_refused():
    with pytest.raises(InputError, match="split the recording"):
        check_size("f", 10**7, 100)
    with pytest.raises(InputError, match="nobody is seen in any frame"):
        checked(FrameArrays(np.arange(3.0), np.full((3, 1, 3), np.nan)), file="f", subject="")
    with pytest.raises(InputError, match="1 frames with a time of their own"):
        checked(FrameArrays(np.zeros(3), np.zeros((3, 1, 3))), file="f", subject="")
