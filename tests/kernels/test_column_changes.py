"""How quickly a Jacobian's columns change is what the formula says, of arrays and of motions."""

import numpy as np
import pytest

from seerob.kernels.spans import column_changes


def formula(turns, lengths, speeds, away, shares):
    """Of all columns, array by array."""
    reach = np.cumsum((lengths + np.where(turns, 0.0, away))[::-1])[::-1]
    onward = np.cumsum((speeds * np.where(turns, reach, 1.0))[::-1])[::-1]
    spin = np.where(turns, speeds, 0.0)
    before = np.cumsum(spin) - spin
    return np.where(turns, before * reach + onward, before) @ shares


@pytest.mark.parametrize("seed", range(6))
def test_changes_are_those_of_the_formula(seed):
    rng = np.random.default_rng(seed)
    k, nv, n = 5, 8, 3
    joints, turns, lengths = rng.choice(nv, k, replace=False), rng.random(k) < 0.6, rng.random(k)
    qd, away, moves = rng.random(nv), rng.random(nv), rng.random(nv) < 0.8
    shares, found = np.where(moves[:, None], rng.random((nv, n)), np.inf), np.empty(n)
    column_changes(joints, turns, lengths, qd, away, moves, shares, found)
    counted = np.where(moves[joints, None], shares[joints], 0.0)
    np.testing.assert_allclose(
        found, formula(turns, lengths, qd[joints], away[joints], counted), rtol=1e-14, atol=0
    )


def test_no_column_of_a_planar_arm_changes_more_quickly():
    """Both joints turn at their largest speeds: finite differences of the columns stay below."""
    rng = np.random.default_rng(7)
    lengths, found = np.array([0.7, 0.4]), np.empty(2)

    def columns(q):
        both = np.cumsum(q)
        ends = lengths * np.exp(1j * both)
        return 1j * np.array([ends.sum(), ends[1]])

    for _ in range(200):
        q, qd, h = rng.uniform(-3, 3, 2), rng.uniform(-2, 2, 2), 1e-6
        column_changes(
            np.arange(2),
            np.ones(2, bool),
            lengths,
            np.abs(qd),
            np.zeros(2),
            np.ones(2, bool),
            np.eye(2),
            found,
        )
        changed = np.abs(columns(q + h * qd) - columns(q - h * qd)) / (2 * h)
        assert (changed <= found + 1e-8).all()
