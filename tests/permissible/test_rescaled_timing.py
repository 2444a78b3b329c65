"""Timing of a path: closed forms on a line, limits kept everywhere, the path that of the given motion."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.session.permissible.ceilings import By, Ceiling
from seerob.session.permissible.joint_limits import JointLimits
from seerob.session.permissible.path import (
    STEP,
    GivenMotion,
    _dense,
    _piece,
    _smooth,
    _stands,
    _stray,
    largest_hermite,
    largest_on,
    path_of,
)
from seerob.session.permissible.rescaled import Rescaled, _governs, ceiling, check, rescale, spent
from seerob.session.permissible.speed_map import SpeedMap, Stations, reference_speed
from seerob.session.permissible.timing import Parabolas, Profile, Timed, Use, _opened, _spread, timed


def motion(t, q, qd):
    q, qd = (np.asarray(x, float).reshape(len(t), -1) for x in (q, qd))
    return GivenMotion("arm", np.asarray(t, float), q, qd, np.ones(len(t), bool))


def line(length=1.0):
    t = np.linspace(0, 1, 51)
    return motion(t, length * t, np.full(51, length))


def wave(rate=100):
    t = np.arange(0, 1.5 + 1e-9, 1 / rate)
    q = np.stack([np.sin(2 * t), 0.5 * np.cos(3 * t), -0.6 * np.sin(2 * t)], 1)
    qd = np.stack([2 * np.cos(2 * t), -1.5 * np.sin(3 * t), -1.2 * np.cos(2 * t)], 1)
    return motion(t, q, qd)


def limits(v, a, j, n=1):
    return JointLimits(("j",) * n, ("rad",) * n, np.full(n, v), np.full(n, a), np.full(n, j), ())


def free(s):
    return np.full(len(s), 1e9)


@pytest.mark.parametrize(
    ("v", "a", "j", "duration"),
    [
        (0.5, 2.0, 1e6, 1 / 0.5 + 0.5 / 2.0),  # trapezoid: way / v + v / a
        (10.0, 2.0, 1e6, 2 * np.sqrt(1 / 2.0)),  # bang-bang: 2 sqrt(way / a)
        (0.5, 2.0, 20.0, 1 / 0.5 + 0.5 / 2.0 + 2.0 / 20.0),  # seven segments: … + a / j
    ],
)
def test_a_straight_line_takes_as_long_as_by_hand(v, a, j, duration):
    """By its first joint; the second, which goes back as far, can do anything."""
    t = np.linspace(0, 1, 51)
    given = motion(t, np.stack([t, -t], 1), np.full((51, 2), [1.0, -1.0]))
    (piece,) = path_of(given, tolerance=1e-3).pieces
    found = timed(piece, free, limits((v, 99.0), (a, 900.0), (j, 1e9), 2))
    assert found.duration == pytest.approx(duration, rel=2e-4)


def test_where_the_map_is_low_the_line_takes_as_long_as_by_hand_and_elsewhere_no_longer():
    """At 1 rad/s, and on 0.05 rad at half of it: each change by dv takes dv / a + a / j at its mean speed."""
    (piece,) = path_of(line(2.0), tolerance=1e-3).pieces
    found = timed(piece, lambda s: np.where(np.abs(s - 1) < 0.025, 0.5, 1.0), limits(9.0, 2.0, 20.0))
    least = 2 + (0.5 + 0.1) + 2 * (0.25 + 0.1) * 0.25 + 0.05
    assert least <= found.duration <= 1.01 * least


def test_a_short_peak_of_the_map_costs_no_time():
    (piece,) = path_of(line(), tolerance=1e-3).pieces

    def ceiling(s):
        return np.where(s < 0.5, 0.3, 0.6)

    with_peak, without = (
        timed(piece, top, limits(9.0, 9.0, 20.0)).duration
        for top in (lambda s: np.where(np.abs(s - 0.25) < 0.02, 9.0, ceiling(s)), ceiling)
    )
    assert with_peak <= without * (1 + 1e-9)
    top = np.array([1, 1, 5, 5, 1, 1, 3, 3, 3, 1, 2, 2, 0, 2], float)
    np.testing.assert_array_equal(_opened(top, 0), top)
    np.testing.assert_array_equal(_opened(top, 1), [1, 1, 1, 1, 1, 1, 3, 3, 3, 1, 1, 1, 0, 0])


def test_a_ceiling_on_a_line_is_a_smaller_speed():
    piece = path_of(line(), tolerance=1e-3).pieces[0]
    by_map = timed(piece, lambda s: np.full(len(s), 0.4), limits(2.0, 2.0, 20.0)).duration
    assert by_map == pytest.approx(timed(piece, free, limits(0.4, 2.0, 20.0)).duration, rel=1e-3)
    # So slow that it is at its speed nearly everywhere, be it a millionth of what it could be.
    (short,) = path_of(line(1e-3), tolerance=1e-5).pieces
    slow = timed(short, lambda s: np.full(len(s), 1e-4), limits(2.0, 2.0, 20.0)).duration
    assert 10 <= slow <= 10 * 1.04


def test_no_limit_is_exceeded_at_any_millisecond():
    """By differences of positions, which know nothing of how the timing was made."""
    piece = path_of(wave(), tolerance=5e-4).pieces[0]
    top = limits(2.0, 8.0, 80.0, 3)

    def ceiling(s):
        return np.where(s < piece.length / 2, 1.5, 0.5)

    found = timed(piece, ceiling, top)
    t = np.arange(0, found.duration, 1e-3)
    q = found.at(t)[0]
    # A mean over a step is never above the largest in it; the jerk is a difference of third order.
    assert np.abs(np.diff(q, axis=0) / 1e-3).max() <= 2.0
    assert np.abs(np.diff(q, 2, axis=0) / 1e-6).max() <= 8.0 + 1e-6
    assert np.abs(np.diff(q, 3, axis=0) / 1e-9).max() <= 80.0 + 1e-3
    s = found.profile.at(t).s
    assert (np.diff(s) >= 0).all()
    inside = (s < piece.length / 2 - 0.01) | (s > piece.length / 2 + 0.01)
    assert (np.diff(s)[inside[1:]] / 1e-3 <= ceiling(s[1:][inside[1:]]) + 1e-9).all()
    use = found.use(t, ceiling, top)
    assert max(x.max() for x in (use.map, use.velocity, use.acceleration, use.jerk)) <= 1.0


@cache
def wave_in_time():
    return timed(path_of(wave(), tolerance=5e-4).pieces[0], free, limits(2.0, 8.0, 80.0, 3))


def test_each_limit_is_used_by_its_worst_joint_to_either_side():
    found, top = wave_in_time(), limits(2.0, 8.0, 80.0, 3)
    t = found.instants()
    use = found.use(t, free, top)
    for used, of, most in zip(
        (use.velocity, use.acceleration, use.jerk), found.at(t)[1:], (2, 8, 80), strict=True
    ):
        np.testing.assert_allclose(used, np.maximum(of, -of) / most)
        assert (of < 0).any()
    worst = np.array([[0.2, 0.1], [0.1, 0.9], [0.1, 0.1], [0.1, 0.1], [0.1, 0.1]])
    one = Use(
        np.array([0.3, 0.1, 0.1, 0.1, 0.1]),
        worst,
        np.roll(worst, 1, axis=0) ** 2,
        np.roll(worst, 2, axis=0) ** 3,
    )
    np.testing.assert_allclose(one.stretch, [0.3, 0.9, 0.9, 0.9, 0.1])


def test_whatever_a_window_mixes_is_to_be_slower_where_one_instant_in_it_is_beyond_a_limit():
    """At a² / 2 = t² of the raw profile, from 0.3 s before the instant to it; a place more on either side."""
    raw = Parabolas.of(np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 0.0]))
    (piece,) = path_of(line(2.0), tolerance=1e-3).pieces
    now, s = Timed(piece, Profile(raw, 0.3)), np.linspace(0, 2, 21)
    wanted = _spread(s, now, np.array([0.1, 0.9, 1.0, 1.1]), np.array([1.001, 1 + 5e-5, 1.3, 1.2]))
    at = np.round(s, 2)
    expected = np.where((at >= 0.4) & (at <= 1.0), 1.3, np.where((at >= 0.6) & (at <= 1.2), 1.2, 1.0))
    expected[at <= 0.1] = 1.001
    np.testing.assert_array_equal(wanted, expected)


@pytest.mark.parametrize("seed", range(3))
def test_stretched_in_time_no_limit_is_exceeded_where_it_is_looked_at_then(seed):
    """Of these motions, by up to 1.5e-6 of a limit after they were stretched once."""
    rng, top, t = np.random.default_rng(seed), limits(2.0, 8.0, 80.0, 3), np.arange(0, 1 + 1e-9, 0.01)
    f, begun, wide = rng.uniform(2, 9, 3), rng.uniform(0, 6, 3), rng.uniform(0.1, 0.5, 3)
    at = f * t[:, None] + begun
    given = motion(t, wide * np.sin(at), wide * f * np.cos(at))
    found = timed(path_of(given, tolerance=5e-4).pieces[0], free, top)
    for when in (found.instants(), np.arange(0, found.duration, 1e-4)):
        assert found.use(when, free, top).stretch.max() <= 1.0


def test_limits_are_checked_every_half_millisecond_and_on_both_sides_of_every_jump_of_the_jerk():
    found = wave_in_time()
    t = found.instants()
    assert (t[0], t[-1]) == (0.0, found.duration)
    assert np.diff(t).max() == pytest.approx(5e-4)
    breaks = found.profile.breaks()
    inner = breaks[(breaks > 1e-3) & (breaks < found.duration - 1e-3)]
    assert len(inner) > 3
    for shift in (-1e-5, -1e-9, 1e-9, 1e-5):
        assert np.abs(t[:, None] - (inner + shift)).min(axis=0).max() < 1e-12


def test_derivatives_are_those_of_the_positions():
    found = wave_in_time()
    t, h = np.linspace(0.1, found.duration - 0.1, 37), 1e-5
    for order in range(3):
        numeric = (found.at(t + h)[order] - found.at(t - h)[order]) / (2 * h)
        np.testing.assert_allclose(found.at(t)[order + 1], numeric, atol=2e-3 * 10**order)


def test_it_starts_and_ends_at_rest_where_the_given_motion_does():
    found = wave_in_time()
    q, qd, qdd, _ = found.at(np.array([0.0, found.duration]))
    np.testing.assert_allclose(q, wave().q[[0, -1]], atol=1e-12)
    np.testing.assert_allclose([qd, qdd], 0, atol=1e-9)


@pytest.mark.parametrize("none", [0.0, np.nan])
@pytest.mark.parametrize(
    ("where", "at"), [(lambda s: s > 0.5, r"0\.505"), (lambda s: np.abs(s - 0.5025) < 2e-3, r"0\.50[1-4]")]
)
def test_where_no_speed_is_known_to_be_permitted_is_said(none, where, at):
    """Also where it lies between the places that a timing is searched at."""
    piece = path_of(line(), tolerance=1e-3).pieces[0]
    with pytest.raises(InputError, match=f"no speed is known.* at {at} s"):
        timed(piece, lambda s: np.where(where(s), none, 0.3), limits(1.0, 1.0, 1.0))


def test_a_timing_that_is_found_only_in_part_is_none():
    (piece,) = path_of(wave(), tolerance=5e-4).pieces
    with pytest.raises(InputError, match="no timing was found"):
        timed(piece, free, limits(1.0, 1e-9, 1e9, 3))


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_the_path_is_nowhere_farther_than_it_says(noise):
    given = wave()
    rough = given.q + noise * np.random.default_rng(0).normal(size=given.q.shape)
    given = motion(given.t, rough, given.qd)
    path = path_of(given, tolerance=5e-4)
    (piece,) = path.pieces
    assert path.deviation.max() <= 5e-4
    dense = piece.at(np.linspace(0, piece.length, 20_001))[0]
    for t in np.linspace(0, 1.5, 151):
        q, _ = given.at(np.array([t]))
        assert np.abs(dense - q).max(axis=1).min() <= path.deviation.max() + 2e-4


def test_a_path_of_pieces_is_as_far_off_as_the_farthest_of_them():
    path = path_of(wave(), tolerance=5e-4)
    (piece,) = path.pieces
    off = np.array([[1e-4, 4e-4, 2e-4], [3e-4, 1e-4, 2e-4]])
    two = replace(path, pieces=tuple(replace(piece, deviation=each) for each in off))
    np.testing.assert_array_equal(two.deviation, [3e-4, 4e-4, 2e-4])
    stands = replace(two, stray=np.array([1e-4, 5e-4, 3e-4]))
    np.testing.assert_array_equal(stands.deviation, [3e-4, 5e-4, 3e-4])


@pytest.mark.parametrize("speeds", [(2.0, 0.0), (0.0, 2.0), (1.0, 1.0), (-3.0, -3.0), (2.345, 0.1)])
def test_a_spline_is_compared_at_steps_that_no_joint_exceeds(speeds):
    """Wherever between two samples it is fastest."""
    both = np.array([[0.0, 3.0], [1.0, 3.0]]), np.stack([speeds, [0.0, 0.0]], 1)
    t, q, _ = _dense(motion([0.0, 1.0], *both))
    # As few as need be: by the largest slope of the cubic, over the whole of it.
    x = np.linspace(0, 1, 10_001)
    slope = np.gradient(motion([0.0, 1.0], *both).at(x)[0][:, 0], x)
    assert len(t) - 1 == np.ceil(np.abs(slope).max() / STEP - 1e-3)
    assert np.abs(np.diff(q, axis=0)).max() <= STEP * (1 + 1e-9)
    assert (np.diff(t) > 0).all()
    assert (t[0], t[-1]) == (0.0, 1.0)
    assert len(_dense(line(0.5))[0]) == 51


def test_stands_and_turns_cut_the_path_and_stands_are_kept():
    x = np.linspace(0, 1, 51)
    way, speed = 10 * x**3 - 15 * x**4 + 6 * x**5, 30 * x**2 - 60 * x**3 + 30 * x**4
    t = np.concatenate([x, 1.5 + x, 2.5 + x[1:]])
    q, qd = np.concatenate([way, 1 + way, 2 - way[1:]]), np.concatenate([speed, speed, -speed[1:]])
    path = path_of(motion(t, q, qd), tolerance=1e-3)
    assert len(path.pieces) == 3  # on, on again after a stand, and back
    # Slower than the tolerance shows is a stand too.
    np.testing.assert_allclose(path.stands, [0, 0.5, 0, 0], atol=0.2)
    assert path.stands.sum() + sum(p.t[-1] - p.t[0] for p in path.pieces) == pytest.approx(3.5)


def parts(*each):
    """One after another: duration [s], way [rad] by the share of it that is over, and its derivative."""
    t, q, qd = [0.0], [0.0], [0.0]
    for duration, way, slope in each:
        x = np.linspace(0, 1, round(duration * 100) + 1)[1:]
        t += (t[-1] + duration * x).tolist()
        q += (q[-1] + way(x)).tolist()
        qd += (slope(x) / duration).tolist()
    return motion(t, q, qd)


MOVES = (1.0, lambda x: 10 * x**3 - 15 * x**4 + 6 * x**5, lambda x: 30 * x**2 - 60 * x**3 + 30 * x**4)
STANDS = (0.5, lambda x: 0 * x, lambda x: 0 * x)
CREEPS = (4.0, lambda x: 2e-3 * x, lambda x: 2e-3 + 0 * x)
BLINKS = (0.02, lambda x: np.where(x < 1, 1.8e-3, 0.0), lambda x: 0 * x)
SINKS = (4.0, lambda x: -2e-3 * x, lambda x: -2e-3 + 0 * x)
SHIVERS = (0.2, lambda x: 0 * x, lambda x: 0.4 * np.cos(10 * np.pi * x))


@pytest.mark.parametrize("between", [CREEPS, SINKS, BLINKS, SHIVERS])
def test_no_way_is_lost_where_the_given_motion_hardly_moves(between):
    """Two milliradians in 4 s, up or down, and as far and back between two samples and in one."""
    given = parts(MOVES, STANDS, between, STANDS, MOVES)
    path = path_of(given, tolerance=5e-4)
    assert path.stands.sum() + sum(p.t[-1] - p.t[0] for p in path.pieces) == pytest.approx(given.duration)
    ends = [piece.at(np.array([0.0, piece.length]))[0] for piece in path.pieces]
    np.testing.assert_allclose([b[0] for b in ends], [path.first, *(a[1] for a in ends[:-1])], atol=1e-12)
    # When it is where: on its piece at the coordinate of then, between two pieces where the last one ended.
    t = np.linspace(0, given.duration, 4001)
    at, stands = np.tile(path.first, (len(t), 1)), np.ones(len(t), bool)
    for piece in path.pieces:
        begun = t >= piece.t[0]
        at[begun] = piece.at(np.interp(t[begun], piece.t, piece.s))[0]
        stands &= ~begun | (t > piece.t[-1])
    off = np.abs(given.at(t)[0] - at)
    assert (off.max(axis=0) <= path.deviation + 1e-12).all()
    np.testing.assert_allclose(path.stray, off[stands].max(axis=0), rtol=0.1)
    assert path.stray > 1e-6
    assert (path.deviation <= 5e-4).all() or between is SHIVERS


def test_how_far_it_strays_while_it_stands_is_its_farthest_at_any_instant():
    given = motion([0, 0.5, 2], [[3, -1], [3.1, -1], [3, -1.2]], [[1, 0], [-1, 0.1], [0.2, -2]])
    place, t = np.array([2.95, -1.1]), np.linspace(0, 2, 20_001)
    expected = np.abs(given.at(t)[0] - place).max(axis=0)
    np.testing.assert_allclose(_stray(given.t, given.q, given.qd, place), expected, rtol=1e-6)
    np.testing.assert_array_equal(_stray(given.t[:1], given.q[:1], given.qd[:1], place), 0)


@pytest.mark.parametrize("shift", [4e-5, -4e-5])
def test_where_a_piece_begins_beside_the_given_motion_it_is_off_by_that(shift):
    given = line()
    piece = _piece(given.t, given.q, given.qd, np.array([shift]), 5e-4)
    assert 4e-5 <= piece.deviation[0] <= 4.7e-5
    np.testing.assert_allclose(piece.at(np.array([0.0, piece.length]))[0], [[shift], [1]], atol=1e-12)
    np.testing.assert_array_equal(piece.t, given.t)
    np.testing.assert_allclose(piece.speed, np.gradient(piece.s, given.t))
    assert piece.length == pytest.approx(1 - shift)


def test_a_stand_lasts_a_twentieth_of_a_second_in_a_box():
    t, near = 0.025 * np.arange(12), 0.5
    q = np.array([0, 0.5, 0.25, 9, 9, 8, 8, 8.5, 8.6, 8.6, 8.5, 8.1])
    # Two places in one box and a third, two only, three and those that follow, whose box is another one.
    assert _stands(t, np.stack([q, 0 * q], 1), near) == [(0, 2), (5, 7), (8, 11)]
    assert _stands(t, np.stack([0 * q, -q], 1), near) == [(0, 2), (5, 7), (8, 11)]
    assert _stands(t * 0.99, q[:, None], near) == [(7, 11)]
    assert _stands(np.array([0, 1, 1.05]), np.array([[0], [9], [9]]), near) == [(1, 2)]


def test_where_the_direction_turns_by_more_than_half_a_right_angle_is_a_corner():
    def way(*turns):
        angles = np.radians(np.cumsum(turns))
        steps = 0.01 * np.stack([np.cos(angles), np.sin(angles)], 1)
        return np.cumsum(np.concatenate([np.zeros((1, 2)), steps]), axis=0)

    q = way(0, 44, 0, 46, 0, -44, -46, 180, 1)
    assert list(_smooth(q, 0, 9)) == [(0, 3), (3, 6), (6, 7), (7, 9)]
    assert list(_smooth(q, 3, 6)) == [(3, 6)]
    assert list(_smooth(way(0, 100, 0), 0, 3)) == [(0, 1), (1, 3)]
    # What goes less than two milliradians in each joint has every direction, from one kept place on.
    noisy = np.array([0, 1.9e-3, 0, 2.1e-3, 2.2e-3, 0.3e-3, 4.2e-3, 4.1e-3])[:, None]
    assert list(_smooth(noisy, 0, 7)) == [(0, 7)]
    back = np.array([0, 2.1e-3, 4.2e-3, 2.1e-3, 0])[:, None]
    assert list(_smooth(back, 0, 4)) == [(0, 2), (2, 4)]
    assert list(_smooth(np.array([[0], [1.8e-3], [0]]), 0, 2)) == [(0, 2)]  # there again: no direction


@pytest.mark.parametrize("wrong", [0.0, -1e-3, np.inf, np.nan])
def test_a_tolerance_of_the_path_is_a_width(wrong):
    with pytest.raises(InputError, match="give more than 0"):
        path_of(line(), tolerance=wrong)


def test_a_motion_has_positions_and_velocities_at_two_instants_or_more():
    good = {"t": [0, 1], "q": np.zeros((2, 3)), "qd": np.zeros((2, 3)), "good": [True, True]}
    for name, short in (("t", [0]), ("q", np.zeros((2, 2))), ("qd", np.zeros((1, 3))), ("good", [True])):
        with pytest.raises(ValueError, match="are no motion"):
            GivenMotion("arm", **{k: np.array(v) for k, v in {**good, name: short}.items()})
    with pytest.raises(ValueError, match="are no motion"):
        GivenMotion("arm", **{k: np.array(v)[:1] for k, v in good.items()})


def test_a_motion_is_a_cubic_from_sample_to_sample_and_rests_outside():
    """Of t³ − t there is nothing else; at its ends it still moves."""
    t = np.array([-1.0, 0.5, 2.0, 2.25])
    given = motion(t, t**3 - t, 3 * t**2 - 1)
    at = np.linspace(-1, 2.25, 53)
    q, qd = given.at(at)
    np.testing.assert_allclose(q[:, 0], at**3 - at, atol=1e-12)
    np.testing.assert_allclose(qd[:, 0], 3 * at**2 - 1, atol=1e-12)
    q, qd = given.at(np.array([-2.0, -1.001, 2.251, 9.0]))
    np.testing.assert_allclose(q[:, 0], [0, 0, t[-1] ** 3 - t[-1], t[-1] ** 3 - t[-1]], atol=1e-12)
    np.testing.assert_array_equal(qd, 0)
    assert given.duration == 3.25
    assert given.interval(np.array([-9, -1, 0.4, 0.5, 1.9, 2, 2.2, 2.25, 9])).tolist() == [
        0,
        0,
        0,
        1,
        1,
        2,
        2,
        2,
        2,
    ]


def test_what_never_moves_is_refused():
    for t in ([0, 1, 2], [0, 0.01, 0.02]):
        with pytest.raises(InputError, match="never moves"):
            path_of(motion(t, [1, 1, 1], [0, 0, 0]), tolerance=1e-3)


def test_largest_values_of_polynomials():
    x, many = np.linspace(0, 1, 4001)[:, None], np.random.default_rng(1).normal(size=(4, 500))
    d0, d1, e0, e1 = many
    c2, c3 = 3 * (d1 - d0) - 2 * e0 - e1, e0 + e1 - 2 * (d1 - d0)
    for found, dense in (
        (largest_hermite(d0, d1, e0, e1), np.abs(d0 + x * (e0 + x * (c2 + x * c3)))),
        (largest_on(d0, e0, c2, 0.0, 1.0), np.abs(d0 + x * (e0 + x * c2))),
    ):
        assert (dense.max(axis=0) <= found + 1e-12).all()
        np.testing.assert_allclose(found, dense.max(axis=0), rtol=1e-5)
    # A parabola has one turn, found without a difference of what is alike.
    assert largest_hermite(*np.array([0.0, 0.0, 1.0, -1.0])) == 0.25


def test_an_averaged_profile_has_the_same_way_and_its_own_derivatives():
    profile = Profile(Parabolas.of(np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 0.0])), 0.3, 1.2)
    t = np.linspace(-0.1, profile.duration + 0.1, 4001)
    now = profile.at(t)
    assert (now.s[0], now.s[-1]) == pytest.approx((0.0, 2.0))
    np.testing.assert_allclose(np.gradient(now.s, t), now.speed, atol=2e-3)
    np.testing.assert_allclose(np.gradient(now.speed, t)[5:-5], now.acceleration[5:-5], atol=2e-2)
    assert np.abs(np.diff(now.acceleration)).max() < 0.05  # no jump
    # The jerk jumps where the raw acceleration does, and a window later.
    exact = replace(profile, window=0.25, stretch=2.0)
    np.testing.assert_array_equal(exact.breaks(), [0, 0.5, 2, 2.5, 4, exact.duration])
    np.testing.assert_array_equal(exact.at(exact.breaks()).jerk, [1, 0, -2, 0, 1, 0])


HALF = Ceiling("S", 0.5, governs="distance")


def mapped(*each, most=(HALF, None, None), begun=0.0, top=(2.0, 8.0, 80.0)):
    """The map of a motion of stations at even places; what governs the parts of each piece, first to last."""
    given = parts(*each)
    path, top = path_of(replace(given, t=given.t + begun), tolerance=5e-4), limits(*top)
    stations = []
    for piece in path.pieces:
        s = np.linspace(0, piece.length, 41)
        reference, joint = reference_speed(piece, s, top)
        governs = tuple((c,) if (c := most[int(i)]) else () for i in np.linspace(0, len(most) - 0.01, 41))
        speed, q = np.interp(s, piece.s, piece.speed), piece.at(s)[0]
        stations.append(
            Stations(s, piece.when(s), reference, joint, speed, governs, By.ALL, q, np.zeros((41, 3)), s)
        )
    return SpeedMap("arm", path, top, tuple(stations), By.ALL, ("S",), {})


BACK = (1.0, lambda x: -MOVES[1](x), lambda x: -MOVES[2](x))


def by_hand(*stretch, each=(STANDS, MOVES, STANDS, BACK, STANDS), top=(2.0, 8.0, 80.0)):
    """On, a stand, and back, begun at 3 s of its clock; each way within 3 s, and stretched."""
    found, pieces = mapped(*each, begun=3.0, top=top), []
    for piece, k in zip(found.path.pieces, stretch, strict=True):
        s = np.linspace(0, piece.length, 41)
        raw = Parabolas.of(s, np.sin(np.pi * np.linspace(0, 1, 41)).round(12))
        pieces.append(Timed(piece, Profile(raw, 0.1, k)))
    return Rescaled(found, tuple(pieces), False, 0.1)


def test_a_rescaled_motion_moves_and_stands_in_turn():
    motion = by_hand(1.0, 1.1)
    (one, two), path = motion.pieces, motion.of.path
    before, between, after = path.stands
    assert path.stands == pytest.approx(0.5, abs=0.1)
    assert motion.before == pytest.approx(3.5)
    assert motion.duration == pytest.approx(before + one.duration + between + two.duration + after)
    np.testing.assert_allclose(motion.starts, [before, before + one.duration + between])
    t = np.array([0, before / 2, before + one.duration + between / 2, motion.duration, motion.duration + 1])
    q, *moves = motion.at(t)
    np.testing.assert_allclose(q[:, 0], [0, 0, 1, 0, 0], atol=1e-4)
    np.testing.assert_array_equal(moves, 0)
    for piece, start in zip(motion.pieces, motion.starts, strict=True):
        local = np.linspace(0.01, piece.duration - 0.01, 7)
        np.testing.assert_allclose(motion.at(start + local), piece.at(local), atol=1e-9)
        assert motion.at([start])[3] == pytest.approx(piece.at(np.zeros(1))[3]) != 0
        for late in (0.0, 0.1):
            own = motion.own_instant(float(piece.piece.t[-1]) + late)
            assert own == pytest.approx(start + piece.duration + late)
        # Both motions are in one place then, by the clock of each.
        for s in (0.2, 0.7):
            own = motion.own_instant(float(piece.piece.when(s)))
            assert piece.profile.at(np.array([own - start])).s == pytest.approx(s, abs=1e-4)
    assert motion.own_instant(3.0) == 0
    assert motion.own_instant(3.0 + before / 2) == pytest.approx(before / 2, abs=1e-6)
    assert motion.own_instant(6.5) == pytest.approx(motion.duration)


def test_a_rescaled_motion_is_sampled_to_its_last_instant():
    motion = by_hand(1.0, 1.1)
    for period in (0.008, motion.duration / 100, motion.duration):
        found = motion.trajectory(period)
        np.testing.assert_allclose(np.diff(found.t)[:-1], period)
        assert 0 < found.t[-1] - found.t[-2] <= period * (1 + 1e-9)
        assert (found.t[0], found.t[-1]) == (0, motion.duration)
        np.testing.assert_array_equal((found.q, found.qd), motion.at(found.t)[:2])
    assert len(motion.trajectory(motion.duration / 100).t) == 101
    for wrong in (0.0, -1.0, motion.duration * 1.01, np.nan):
        with pytest.raises(InputError, match="more than 0, such as"):
            motion.trajectory(wrong)


@pytest.mark.parametrize(
    ("share", "what"),
    [(0.0, "is none at 14 .* first at 0.000 s"), (np.nan, "cannot be told at 14 .* 0.000 s")],
)
def test_where_nothing_is_permitted_there_is_no_rescaled_motion(share, what):
    for region in ("", "Face"):
        why = Ceiling("S", share, region=region, reason="too near")
        about = f"S, {region}: too near" if region else "S: too near"
        with pytest.raises(InputError, match=f"{what}.*{about}"):
            rescale(mapped(MOVES, most=(why, None, None)), not_faster=False, margin=0.0)


def test_a_rescaled_motion_uses_what_its_map_leaves_it():
    """Halved by a criterion at first, and then as fast as its joint may: less the margin each."""
    found = mapped(MOVES)
    motion = rescale(found, not_faster=False, margin=0.02)
    use = check(motion)
    assert 0.979 < use.map <= 0.98
    assert max(vars(use).values()) <= 1
    assert rescale(found, not_faster=False, margin=0.0).duration < motion.duration
    for wrong in (-0.01, 1.0, np.nan):
        with pytest.raises(InputError, match="margin"):
            rescale(found, not_faster=False, margin=wrong)


@pytest.mark.parametrize("stretch", [(0.5, 1.0), (1.0, 0.5)])
def test_of_each_limit_the_worst_use_in_any_piece_is_said(stretch):
    motion, most = by_hand(*stretch), []
    for piece, stations in zip(motion.pieces, motion.of.stations, strict=True):
        use = piece.use(piece.instants(), stations.between, motion.of.limits)
        most.append([np.max(x) for x in (use.map, use.velocity, use.acceleration, use.jerk)])
    assert (np.argmax(most, axis=0) == np.argmin(stretch)).all()
    np.testing.assert_allclose(list(vars(check(motion)).values()), np.max(most, axis=0))


def test_not_faster_than_the_given_motion_around_each_place():
    (stations,) = mapped(MOVES, most=(HALF,)).stations
    stations.given[20:23] = 0
    s = np.concatenate([stations.s, (stations.s[1:] + stations.s[:-1]) / 2])
    free, held = (ceiling(stations, not_faster=x, margin=0.1)(s) for x in (False, True))
    np.testing.assert_allclose(free, 0.9)
    least = 0.01 * stations.given.max()
    for at, now in zip(s, held, strict=True):
        k = min(np.searchsorted(stations.s, at, side="right") - 1, 39)
        assert now == pytest.approx(min(0.9, max(*stations.given[[k, k + 1]], least)))
    rests = ceiling(replace(stations, given=np.zeros(41)), not_faster=True, margin=0.0)(s)
    np.testing.assert_allclose(rests, 1e-14)


@pytest.mark.parametrize(
    ("each", "stretch", "stands"), [((MOVES, STANDS, BACK), (0.25, 0.3), 0.5), ((MOVES,), (0.25,), 0.0)]
)
def test_where_the_time_goes_is_all_of_it_by_what_governs(each, stretch, stands):
    motion = by_hand(*stretch, each=each, top=(4.0, 16.0, 1e3))
    times = spent(motion)
    assert [one.time for one in times] == sorted((one.time for one in times), reverse=True)
    by = {one.what: one.time for one in times}
    assert sum(by.values()) == pytest.approx(motion.duration)
    assert ("stands as the given motion does" in by) is (stands > 0)
    assert by.pop("stands as the given motion does", 0) == pytest.approx(stands, abs=0.05)
    assert by.pop("transition between limits") > 0.2
    # At the map's speed less the margin, or above it, which is halved by a criterion or not; or speeding up.
    expected = np.zeros(3)
    for piece, stations in zip(motion.pieces, motion.of.stations, strict=True):
        t = np.linspace(0, piece.duration, 20_001)
        now = piece.profile.at(t)
        top = stations.between(now.s)
        at_top, halved = now.speed >= 0.98 * 0.9 * top, np.isclose(top, 2.0)
        quick = ~at_top & (np.abs(piece.at(t)[2][:, 0]) >= 0.98 * 16)
        expected += np.array([at_top & halved, at_top & ~halved, quick]).mean(axis=1) * piece.duration
    assert expected.min() > 0.02
    assert by == pytest.approx(
        dict(
            zip(
                ("S: distance", "speed of the given motion, or of a joint", "acceleration of j"),
                expected,
                strict=True,
            )
        ),
        abs=4e-3,
    )


def test_what_governs_is_what_is_used_most_in_the_order_of_the_limits():
    (free,) = mapped(MOVES, most=(None,)).stations
    stations = replace(free, ceilings=tuple((HALF,) if i in (0, 20, 40) else () for i in range(41)))
    low, names, first = np.zeros(2), ("j1", "j2"), stations.s[20]
    step, end = stations.s[1], stations.s[-1]

    def governs(of_map, s, *joints):
        return _governs(of_map, *(np.array(x) for x in joints or (low,) * 3), stations, s, names)

    for s in (0.0, step / 2, first - step / 2, first, first + step / 2, end - step / 2, end):
        assert governs(0.98, s) == "S: distance"
    for s in (1.5 * step, first - 1.5 * step, first + 1.5 * step, end - 1.5 * step):
        assert governs(0.98, s, (1, 0), (1, 0), (1, 0)) == "speed of the given motion, or of a joint"
    assert governs(0.97, first) == "transition between limits"
    assert governs(0.97, first, (0.97, 0.98), (1, 0), (1, 0)) == "speed of j2"
    assert governs(0.97, first, (0, 0.97), (0.99, 0.98), (0, 1)) == "acceleration of j1"
    assert governs(0.97, first, (0, 0.97), (0, 0.97), (0, 0.98)) == "jerk of j2"
