"""Bounds along a motion that is known ahead hold on it, and are kept only where it stays what it was."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from seerob.criteria.stopping.onset import accelerated, by_speed, farthest
from seerob.kernels.ahead import WINDOW, joint_speeds, moved_on, window
from seerob.kernels.pull import instants


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


def asked(first, rows, q, qd, *, kept, again=True):
    """Which ticks of a window are known when it is asked for, and of how many nothing is.

    Args:
        first: Number of the first tick.
        rows: Which instants are ticks.
        q: Positions at the instants.
        qd: Velocities.
        kept: Of another window, of which all is known: the same, number of its first tick in front.
        again: As `moved_on` takes it.
    """
    now = window(6, 3, 1, q.shape[1])
    table = WINDOW.rows(now)
    moved_on(table, False, *kept)
    for tick in range(kept[0], kept[0] + len(kept[1]) - 1):
        now.number[tick % 6], now.parts[tick % 6 * 3 :][:3], now.last[tick % 6] = tick, tick, tick
    missing = moved_on(table, again, first, rows, q, qd)
    known = [now.number[tick % 6] == tick for tick in range(first, first + len(rows) - 1)]
    for tick in np.arange(first, first + len(rows) - 1)[known]:
        assert (now.parts[tick % 6 * 3 :][:3] == tick).all()
        assert (now.last[tick % 6] == tick).all()
    return known, missing


def test_a_window_that_moves_on_keeps_what_is_the_same_by_its_bits():
    rows, now = np.array([0, 1, 3, 4, 6]), np.array([0, 2, 3, 5, 6])
    _, q, qd = motion(1, 7)
    before, new_q, new_qd = (4, rows, q, qd), np.vstack([q[1:], q[:1]]), np.vstack([qd[1:], qd[:1]])
    assert asked(5, now, new_q, new_qd, kept=before) == ([True, True, True, False], 1)
    # A last bit, of a position or a velocity at a tick or a knot, is another motion on both sides of it.
    for row, ticks in ((0, [0]), (1, [0]), (2, [0, 1]), (4, [2]), (5, [2])):
        for which in (0, 1):
            other = [new_q.copy(), new_qd.copy()]
            other[which][row, 2] = np.nextafter(other[which][row, 2], 9)
            known, missing = asked(5, now, *other, kept=before)
            assert [i for i in range(3) if not known[i]] == ticks
            assert missing == len(ticks) + 1
    # Another number of knots is another motion.
    knots = np.array([0, 1, 3, 5, 6])
    assert asked(5, knots, new_q, new_qd, kept=before) == ([False, False, True, False], 3)
    assert asked(13, now, new_q, new_qd, kept=before) == ([False] * 4, 4)
    assert asked(5, now, new_q, new_qd, kept=before, again=False) == ([False] * 4, 4)
    assert asked(4, rows, q, qd, kept=before) == ([True] * 4, 0)


def test_a_window_without_room_says_so():
    _, q, qd = motion(1, 8)
    before = 0, np.array([0, 1]), q[:2], qd[:2]
    assert asked(1, np.arange(7), q[:7], qd[:7], kept=before)[1] == -1
    assert asked(1, np.array([0, 3]), q[:4], qd[:4], kept=before)[1] == -1
    assert asked(1, np.array([0, 2]), q[:3], qd[:3], kept=before)[1] == 1
