"""Principal axes and mobility against LAPACK, and where LAPACK is not accurate."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.kernels.axes import half_axes, mobility, principal_axes

random = np.random.default_rng(5)


def axes_of(A):
    values, axes = np.empty((len(A), 3)), np.empty((len(A), 3, 3))
    principal_axes(A.copy(), values, axes)
    alone = np.empty((len(A), 3))
    half_axes(A, alone)
    np.testing.assert_allclose(alone, values, rtol=1e-12, atol=1e-14 * values.max())
    return values, axes


@pytest.mark.parametrize("n", [1, 2, 3, 6, 9])
def test_they_are_the_singular_values_in_a_right_handed_frame(n):
    A = random.normal(size=(200, 3, n)) * 10.0 ** random.integers(-3, 3, size=(200, 1, 1))
    values, axes = axes_of(A)
    k = min(3, n)
    expected = np.linalg.svd(A, compute_uv=False)
    np.testing.assert_allclose(values[:, :k], expected[:, :k], rtol=1e-12)
    assert values[:, k:].max(initial=0.0) <= 1e-14 * values.max()
    np.testing.assert_allclose(np.linalg.det(axes), 1.0, atol=1e-13)
    squares = axes @ (values[..., None] ** 2 * np.swapaxes(axes, 1, 2))
    np.testing.assert_allclose(
        squares, A @ np.swapaxes(A, 1, 2), atol=1e-13 * np.square(values).max(), rtol=0
    )


def test_a_small_value_is_as_accurate_as_a_large_one():
    """Rows of very different lengths; the smallest value is known from the determinant."""
    A = random.normal(size=(100, 3, 3)) * np.array([1.0, 1e-6, 1e-12])[:, None]
    values, _ = axes_of(A)
    scaled = np.abs(np.linalg.det(A * np.array([1.0, 1e6, 1e12])[:, None])) * 1e-18
    np.testing.assert_allclose(values.prod(axis=1), scaled, rtol=1e-12)


def test_nothing_and_not_a_number_come_to_an_end():
    assert axes_of(np.zeros((1, 3, 4)))[0].tolist() == [[0.0, 0.0, 0.0]]
    assert np.isnan(axes_of(np.full((1, 3, 4), np.nan))[0]).all()


@pytest.mark.parametrize("n", [1, 4, 7])
def test_mobility_is_that_of_a_solver(n):
    J, root = random.normal(size=(50, 3, n)), random.normal(size=(50, n, n))
    M = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(n)
    found = np.empty((50, 3, 3))
    assert mobility(J, M, found)
    np.testing.assert_allclose(found, J @ np.linalg.solve(M, np.swapaxes(J, 1, 2)), rtol=1e-9, atol=1e-12)
    assert (found == np.swapaxes(found, 1, 2)).all()


def test_a_matrix_that_is_not_positive_definite_is_told():
    found = np.empty((2, 3, 3))
    assert not mobility(np.ones((2, 3, 2)), np.stack([np.eye(2), np.diag([1.0, -1.0])]), found)
