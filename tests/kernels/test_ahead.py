"""Bounds along a motion that is known ahead hold on it, and are kept only where it stays what it was."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from seerob.criteria.stopping.onset import accelerated, by_speed, farthest
from seerob.kernels.ahead import instants, joint_speeds, kept


def motion(seed, m=9, j=3):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.002, 0.02, m))
    return t, rng.uniform(-2, 2, (m, j)), rng.uniform(-3, 3, (m, j))


@pytest.mark.parametrize("seed", range(5))
def test_joints_get_as_fast_between_two_instants_as_scipys_cubics(seed):
    t, q, qd = motion(seed)
    bounds = np.empty((len(t) - 1, 2, q.shape[1]))
    joint_speeds(t, q, qd, bounds)
    speed = CubicHermiteSpline(t, q, qd).derivative()
    for i, (a, b) in enumerate(pairwise(t)):
        most = np.abs(speed(np.linspace(a, b, 20001)[1:-1])).max(axis=0)
        assert (bounds[i, 0] >= most * (1 - 1e-12)).all()
        np.testing.assert_allclose(bounds[i, 0], np.maximum(most, bounds[i, 1]), rtol=1e-6)
        np.testing.assert_array_equal(bounds[i, 1], np.abs(qd[i : i + 2]).max(axis=0))


def test_no_stretch_of_a_reaction_is_longer_than_the_farthest():
    rng = np.random.default_rng(1)
    T_r, lead = 0.1, 0.01
    for _ in range(50):
        t = np.unique(np.concatenate([[0.0, lead, T_r, T_r + lead], rng.uniform(0, T_r + lead, 8)]))
        most, now = rng.uniform(0, 2, (len(t) - 1, 2)), rng.uniform(0, 2, 2)
        way, top = farthest(t, most, now, T_r, lead)
        each = np.vstack([np.maximum(most[:1], now), most[1:]])
        np.testing.assert_array_equal(top, each.max(axis=0))
        for begin in np.linspace(0, lead, 11):
            part = np.diff(np.clip(t, begin, begin + T_r)) @ each
            assert (way >= part - 1e-15).all()
        assert (way >= now * T_r).all()


def test_instants_are_ticks_of_the_clock_and_every_knot_that_is_none_of_them():
    rng, period, slack = np.random.default_rng(2), 0.01, 1e-9
    for _ in range(200):
        first, count = int(rng.integers(0, 9)), int(rng.integers(1, 6))
        ticks = period * np.arange(first, first + count)
        begin = ticks[0] = ticks[0] + rng.choice([0.0, 0.004])
        near = rng.choice(
            [*ticks, *(ticks + 5e-10), *(ticks - 5e-10), *rng.uniform(begin, ticks[-1] + 1e-6, 4)]
        )
        knots = np.sort(np.append(rng.uniform(begin, ticks[-1] + 1e-3, rng.integers(0, 5)), near))
        found, rows = np.empty(count + len(knots)), np.empty(count, np.int64)
        n = instants(begin, first, period, knots, slack, found, rows)
        own = [t for t in np.unique(knots) if np.abs(ticks - t).min() > slack]
        np.testing.assert_array_equal(found[:n], np.sort([*ticks, *own]))
        np.testing.assert_array_equal(found[rows], ticks)


@pytest.mark.parametrize("a", [0.0, 0.7])
def test_what_follows_from_speeds_alone_is_what_accelerates(a):
    v = np.random.default_rng(3).uniform(0, 2, 5)
    found, wanted = by_speed(0.1, a)(v), accelerated(v, 0.1, a, np.zeros(0))
    for ours, theirs in ((found.v_r, wanted.v_r), (found.S_r, wanted.S_r), (found.v_s, wanted.v_s)):
        assert ours.tobytes() == theirs.tobytes()
    assert (found.ways is None) == (wanted.ways is None)


def window(seed, rows):
    _, q, qd = motion(seed, rows[-1] + 1)
    rng, m, n, j = np.random.default_rng(seed), len(q) - 1, 2, q.shape[1]
    return (
        np.array(rows), q, qd, rng.random((m, 2, n)), rng.random((m, 2, j)), rng.random((len(rows) - 1, n))
    )  # fmt: skip


def test_a_window_that_moves_on_keeps_what_is_the_same_by_its_bits():
    before = window(1, [0, 1, 3, 4, 6])
    _, q, qd, parts, joints, last = before
    new_q, new_qd = np.vstack([q[1:], q[:1]]), np.vstack([qd[1:], qd[:1]])
    now = (
        np.array([0, 2, 3, 5, 6]), new_q, new_qd, np.zeros((6, 2, 2)), np.zeros((6, 2, 3)), np.zeros((4, 2))
    )  # fmt: skip
    known = np.empty(4, bool)
    assert kept(1, *before, *now, known) == 1
    assert known.tolist() == [True, True, True, False]
    np.testing.assert_array_equal(now[3][:5], parts[1:])
    np.testing.assert_array_equal(now[4][:5], joints[1:])
    np.testing.assert_array_equal(now[5][:3], last[1:])
    # A last bit, of a position or a velocity at a tick or a knot, is another motion on both sides of it.
    for row, ticks in ((0, [0]), (1, [0]), (2, [0, 1]), (4, [2]), (5, [2])):
        for which in (1, 2):
            other = [each.copy() for each in now]
            other[which][row, 2] = np.nextafter(other[which][row, 2], 9)
            kept(1, *before, *other, known)
            assert [i for i in range(3) if not known[i]] == ticks
    # Another number of knots is another motion.
    assert kept(1, *before, np.array([0, 1, 3, 5, 6]), *now[1:], known) == 3
    assert known.tolist() == [False, False, True, False]
    assert kept(9, *before, *now, known) == 4
    assert kept(-1, *before, *now, known) == 4
