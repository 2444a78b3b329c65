"""What is compiled of contacts, against the formulae of `seerob.criteria.contact.collision` and a search."""

import numpy as np

from seerob.core.verdict import ROUNDING
from seerob.criteria.contact import collision
from seerob.kernels.axes import reciprocals
from seerob.kernels.contact_forces import drawn_corners
from seerob.kernels.contact_speeds import governing, permissible_speeds, ranks, reached
from seerob.kernels.speed import carried, directions
from seerob.recording.answers import keep_many


def test_speeds_are_those_of_the_formulae():
    rng = np.random.default_rng(0)
    b, r = 40, 13
    m_R, m_H = rng.uniform(0.1, 50, b), rng.uniform(0.5, 75, r)
    forces = rng.uniform(0, 500, (b, 2, r))
    forces[rng.random(forces.shape) < 0.2] = np.nan
    forces[rng.random(forces.shape) < 0.1] = 0.0
    clamped = rng.random((b, r)) < 0.4
    F, multiplier, k = rng.uniform(50, 300, r), rng.choice([1.0, 2.0], r), rng.uniform(1e4, 1e5, r)
    energy = np.where(np.arange(r) % 3, rng.uniform(0.1, 2, r), np.nan)
    found = permissible_speeds(m_R, forces, clamped, F, multiplier, k, m_H, energy)
    m = np.broadcast_to(m_R[:, None], (b, r))
    mu = np.where(clamped, m, collision.reduced_mass(m_H, m))
    most = F * np.where(clamped, 1.0, multiplier)
    stored = collision.energy_limit(most, k, np.where(clamped, np.nan, energy))
    v_F = collision.speed_at_force(most, mu, k)
    v_P = collision.speed_at_force(np.where(clamped, forces[:, 1], forces[:, 0]), mu, k)
    v_E = collision.speed_at_energy(stored, mu)
    least, which = collision.permissible_speed(v_F, v_P, v_E)
    for ours, theirs in zip(found, (least, which, v_F, v_P, v_E, mu), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_worst_surface_is_that_of_a_search():
    rng = np.random.default_rng(1)
    b, k, columns = 6, 9, np.array([7, 0, 3, 4])
    for _ in range(50):
        v, permissible = rng.uniform(0, 2, (b, k)), rng.uniform(0, 2, (b, 4))
        near, known = rng.random((b, k)) < 0.6, rng.integers(0, 3, (b, 4))
        rows, found = governing(v, near, columns, permissible, known, 1e6)
        for j in range(k):
            hit = np.flatnonzero(near[:, j])
            if not len(hit):
                continue
            rank, worse = np.zeros(b, int), v[:, j]
            if j in columns:
                c = columns.tolist().index(j)
                rank, worse = known[:, c], v[:, j] - permissible[:, c]
            assert rows[j] == hit[np.lexsort((worse[hit], rank[hit]))[-1]]
            assert found[j] == rank[rows[j]]


def test_what_is_not_a_number_governs():
    rows, found = governing(
        np.array([[1.0], [np.nan], [2.0]]), np.ones((3, 1), bool), np.array([0]),
        np.ones((3, 1)), np.array([[2], [1], [2]]), 1e6,
    )  # fmt: skip
    assert (rows[0], found[0]) == (1, 1)


def test_speeds_rank_as_the_verdict_s_own_rule_has_it():
    rng, odd = np.random.default_rng(2), [0.0, 1.0, 1 - 1e-9, 1 + 1e-9, 1e6, np.inf, np.nan]
    v, pressure, low, high = (rng.choice([*odd, *rng.uniform(0, 2, 5)], (60, 14)) for _ in range(4))
    found = np.empty(v.shape, np.int64)
    ranks(v, pressure, low, high, ROUNDING, found)
    beyond = ~(keep_many(v, high) | np.isnan(v) | np.isnan(high))
    open_ = np.isnan(pressure) | ~keep_many(v, low)
    np.testing.assert_array_equal(found, np.where(beyond, 2, np.where(open_, 1, 0)))
    assert np.bincount(found.ravel()).min() > 20


def test_what_is_reached_is_what_any_of_its_bones_is_near_to():
    rng, within = np.random.default_rng(3), 3
    b, n, k = 5, 9, 6
    for _ in range(50):
        kinds, member = rng.integers(0, 4, b * n).astype(np.int8), rng.random((n, k)) < 0.3
        fast = rng.choice([0.0, 1.0, np.inf, *rng.uniform(0, 2, 4)], n)
        near, close, speeds = np.ones((b, k), bool), np.ones(n, bool), np.ones(k)
        reached(kinds, within, member, fast, near, close, speeds)
        hit = kinds.reshape(b, n) == within
        np.testing.assert_array_equal(near, hit.astype(int) @ member > 0)
        np.testing.assert_array_equal(close, hit.any(axis=0))
        moving = np.where(member & close[:, None], fast[:, None], 0.0)
        np.testing.assert_array_equal(speeds, moving.max(axis=0))
    # What is not a number is none that may be left out.
    kinds = np.full(b * n, within, np.int8)
    reached(kinds, within, np.ones((n, k), bool), np.full(n, np.nan), near, close, speeds)
    assert np.isnan(speeds).all()


def test_directions_have_length_one_or_none():
    v = np.array([[3.0, 0, 4], [0, 0, 1e-3], [0, 0, 0]])
    some, u = directions(v, 1e-3)
    assert some
    np.testing.assert_allclose(u[0], [0.6, 0, 0.8])
    assert np.isnan(u[1:]).all()
    assert not directions(v[1:], 1e-3)[0]


def test_reciprocals_of_nothing_are_infinite():
    found = reciprocals(np.array([2.0, 0.0, -1.0, np.nan]))
    np.testing.assert_array_equal(found, [0.5, np.inf, np.inf, np.nan])


def test_corners_are_drawn_along_their_direction_and_not_farther_than_the_largest():
    at, corners = np.array([1.0, 2, 3]), np.array([[100.0, 0, 0], [0, -3000.0, 0]])
    drawn, cut = drawn_corners(corners, at, 0.001, 2.0)
    np.testing.assert_allclose(drawn - at, [[0.1, 0, 0], [0, -2.0, 0]])
    assert cut
    assert not drawn_corners(corners[:1], at, 0.001, 2.0)[1]


def test_a_carried_frame_is_the_product_of_poses():
    rng = np.random.default_rng(2)
    xmat, xpos, T = rng.normal(size=(4, 9)), rng.normal(size=(4, 3)), rng.normal(size=(4, 4))
    rotation, position = carried(xmat, xpos, 2, T)
    R = xmat[2].reshape(3, 3)
    np.testing.assert_allclose(rotation, R @ T[:3, :3], rtol=1e-13)
    np.testing.assert_allclose(position, xpos[2] + R @ T[:3, 3], rtol=1e-13)
