"""Where a visitor's room lies in the cell: simulated touches against what the covariance says of them."""

import numpy as np
import pytest
from scipy.stats import f as fisher

from seerob.core.transforms import inverse, transform
from seerob.description.capture import registration as reg

TOOL = np.array([0.5, 0.5, 1.0])
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], float)
BOX = np.vstack([SQUARE, np.add(SQUARE, [0, 0, 0.6])])
NOISE = 0.004
TRIALS = 1000
DEGREE = np.pi / 180


def trials(cell, *, tilt=0.0, level=0.0, noise=NOISE, place=0.0, seed=0, n=TRIALS, judge=False, **more):
    """Registrations of n rooms from noisy touches, and the errors at the tool [m], shape (n, 3)."""
    rng = np.random.default_rng(seed)
    yaw = np.zeros((n, 3))
    yaw[:, 2] = rng.uniform(-np.pi, np.pi, n)
    lean = np.concatenate([rng.normal(0, tilt, (n, 2)), np.zeros((n, 1))], -1)
    R, t = reg.turn(lean) @ reg.turn(yaw), rng.normal(size=(n, 3))
    there = cell + rng.normal(0, place, (n, len(cell), 3)) if place else np.tile(cell, (n, 1, 1))
    room = np.einsum("nji,nmj->nmi", R, there - t[:, None]) + rng.normal(0, noise, (n, len(cell), 3))
    found = reg.touched(
        room,
        np.tile(cell, (n, 1, 1)),
        place_error=np.full(len(cell), place),
        level=level,
        judge=judge,
        **more,
    )
    return found, reg.put(found, np.einsum("nji,nj->ni", R, TOOL - t)) - TOOL


def covered(found, error):
    """Share of the trials in which the region of 95 % holds the true error."""
    S = reg.at(found, np.broadcast_to(TOOL, error.shape))
    return (np.einsum("ni,nij,nj->n", error, np.linalg.inv(S), error) < reg.CHI**2).mean()


@pytest.mark.parametrize(
    "told",
    [
        {"level": 0.0},
        {"level": 0.0, "touch_error": NOISE},
        {"tilt": 0.1 * DEGREE, "level": 0.1 * DEGREE},
    ],
)
def test_touches_with_4_mm_noise_put_the_tool_within_5_mm_and_say_how_well(told):
    found, error = trials(BOX, **told)
    assert np.percentile(np.linalg.norm(error, axis=1), 95) <= 5e-3
    assert covered(found, error) >= 0.93
    stated = reg.bound(found.covariance, found.about, np.broadcast_to(TOOL, error.shape), 0.0)
    assert (np.linalg.norm(error, axis=1) <= stated).mean() >= 0.93


@pytest.mark.parametrize("cell", [SQUARE[:3], SQUARE, BOX], ids=["3", "4", "8"])
@pytest.mark.parametrize("level", [0.0, 0.3 * DEGREE, np.inf])
def test_the_covariance_covers_whoever_says_what_is_level(cell, level):
    found, error = trials(cell, tilt=level if level < 1 else 0.1, level=level, seed=3)
    assert covered(found, error) >= 0.93


def test_places_that_are_known_badly_count():
    found, error = trials(BOX, place=0.006, seed=5, touch_error=NOISE)
    assert covered(found, error) >= 0.93
    exact = trials(BOX, seed=5, touch_error=NOISE)[0]
    assert (reg.at(found, TOOL).trace(0, 1, 2) > reg.at(exact, TOOL).trace(0, 1, 2)).all()


def test_fewer_nearer_or_noisier_touches_never_state_less():
    def stated(cell, **told):
        found, _ = trials(cell, touch_error=told.pop("touch_error", NOISE), n=1, **told)
        return float(reg.bound(found.covariance, found.about, TOOL, 0.1)[0])

    plain = stated(BOX)
    assert stated(SQUARE) > plain
    assert stated(0.3 * BOX) > plain
    assert stated(BOX, touch_error=2 * NOISE) > 1.9 * plain
    assert stated(BOX, level=0.01) > plain
    assert stated(BOX, level=np.inf) > stated(BOX, level=0.01)
    far, _ = trials(BOX, touch_error=NOISE, n=1)
    assert reg.bound(far.covariance, far.about, np.add(TOOL, [5, 0, 0]), 0.1)[0] > 2 * plain


def test_a_touch_of_another_place_is_found_and_honest_ones_are_not():
    honest, _ = trials(BOX, seed=7, n=300, judge=True)
    assert (honest.strange.max(-1) > 1).mean() < 0.02
    rng = np.random.default_rng(1)
    room = BOX + rng.normal(0, NOISE, (50, *BOX.shape))
    room[:, 3] += [0.06, 0, 0]
    found = reg.touched(room, np.tile(BOX, (50, 1, 1)), place_error=np.zeros(8))
    assert (found.strange[:, 3] > 1).mean() > 0.9
    assert (found.strange.argmax(-1) == 3).mean() > 0.98


@pytest.mark.parametrize(
    ("cell", "level"),
    [(SQUARE[:1], 0.0), (SQUARE[:2], 0.1), (np.array([[0, 0, z] for z in range(4)], float), 0.0),
     (np.array([[x, 0, 0] for x in range(4)], float), np.inf)],
)  # fmt: skip
def test_touches_that_tell_no_registration_are_refused(cell, level):
    with pytest.raises(ValueError, match=r"touch"):
        reg.touched(cell, cell, place_error=np.zeros(len(cell)), level=level)


def test_fishers_f_is_that_of_scipy():
    nu = np.array([1.0, 2.5, 8, 60, 1500])
    for p in (0.95, 0.999):
        np.testing.assert_allclose(reg.fisher_quantile(p, nu), fisher.ppf(p, 3, nu), rtol=2e-3)


def sweep(rng, tip, cone=30 * DEGREE, n=200, noise=0.002):
    way = np.linspace(0, 4 * np.pi, n)
    lean = cone * np.stack([np.cos(way), np.sin(way), 0 * way], -1) * np.linspace(0.2, 1, n)[:, None]
    R = reg.turn(lean) @ reg.turn(rng.normal(size=3))
    p = rng.normal(size=3) - R @ tip + rng.normal(0, noise, (n, 3))
    return R @ reg.turn(rng.normal(0, 0.25 * DEGREE, (n, 3))), p


def test_the_tip_of_a_controller_is_found_by_turning_about_it():
    rng, tip = np.random.default_rng(2), np.array([0.01, -0.03, -0.12])
    found = [reg.pivot(*sweep(rng, tip)) for _ in range(100)]
    off = np.array([t - tip for t, _, _ in found])
    assert np.percentile(np.linalg.norm(off, axis=1), 95) < 2e-3
    inside = [e @ np.linalg.inv(C) @ e < reg.CHI**2 for e, (_, C, _) in zip(off, found, strict=True)]
    assert np.mean(inside) >= 0.93
    with pytest.raises(ValueError, match=r"turn the controller about its tip"):
        reg.pivot(*sweep(rng, tip, cone=2 * DEGREE))


def test_an_error_of_the_tip_that_all_touches_share_is_stated_though_no_residual_shows_it():
    rng, n = np.random.default_rng(4), 400
    spread = 0.006
    grips = np.tile(reg.turn(np.array([0.3, -0.2, 0.5])), (n, len(BOX), 1, 1))
    shared = np.einsum("ij,nj->ni", grips[0, 0], rng.normal(0, spread, (n, 3)))
    room = BOX + rng.normal(0, 1e-3, (n, *BOX.shape)) + shared[:, None]
    cell = np.tile(BOX, (n, 1, 1))
    told = {"place_error": np.zeros(8), "judge": False}
    blind = reg.touched(room, cell, **told)
    found = reg.touched(room, cell, **told, grips=grips, tip_covariance=spread**2 * np.eye(3))
    error = reg.put(found, np.broadcast_to(TOOL, (n, 3))) - TOOL
    assert covered(found, error) >= 0.93 > 0.2 > covered(blind, error)


def poses(rng, n, turns, places):
    T = np.tile(np.eye(4), (n, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = reg.turn(rng.normal(0, turns, (n, 3))), rng.uniform(-places, places, (n, 3))
    return T


def test_a_controller_strapped_to_the_flange():
    rng, errors, inside = np.random.default_rng(6), [], []
    for _ in range(100):
        X, Y = poses(rng, 2, 1.0, 1.0)
        F = np.add(poses(rng, 12, 0.6, 0.4), transform(None, [0.5, 0, 0.6]) - np.eye(4))
        G = inverse(X) @ F @ Y
        G[:, :3, 3] += rng.normal(0, NOISE, (12, 3))
        G[:, :3, :3] = G[:, :3, :3] @ reg.turn(rng.normal(0, 0.5 * DEGREE, (12, 3)))
        found, _ = reg.strapped(F, G, place_error=0.0)
        e = reg.put(found, (inverse(X) @ [*TOOL, 1])[:3]) - TOOL
        errors.append(np.linalg.norm(e))
        inside.append(e @ np.linalg.inv(reg.at(found, TOOL)) @ e < reg.CHI**2)
    assert np.mean(errors) <= 5e-3
    assert np.mean(inside) >= 0.9  # of 100: three standard deviations below 0.95
    with pytest.raises(ValueError, match="two axes"):
        reg.strapped(F[:, :, :] * 0 + F[0], G, place_error=0.0)
    # Where the flange is off at all poses alike, the room is off as much: no residual shows it.
    known, _ = reg.strapped(F, G, place_error=0.003)
    np.testing.assert_allclose(known.covariance[:3, :3] - found.covariance[:3, :3], 9e-6 * np.eye(3))


def test_a_tracker_at_a_known_place_and_both_verticals():
    rng, errors, inside = np.random.default_rng(8), {0.01: [], np.inf: []}, []
    known = transform(reg.turn(np.array([0, 0, 0.4])), [1, 0, 0.8])
    for level, into in errors.items():
        for _ in range(300):
            lean = np.array([*rng.normal(0, min(level, 0.3), 2), rng.uniform(-3, 3)])
            X = transform(reg.turn(np.array([*lean[:2], 0])) @ reg.turn(np.array([0, 0, lean[2]])), [1, 2, 0])
            seen = inverse(X) @ known @ transform(reg.turn(rng.normal(0, 0.01, 3)), rng.normal(0, 2e-3, 3))
            found = reg.placed(known, seen[None], place_error=(0, 0), pose_error=(2e-3, 0.01), level=level)
            e = reg.put(found, (inverse(X) @ [*TOOL, 1])[:3]) - TOOL
            into.append(np.linalg.norm(e))
            inside.append(e @ np.linalg.inv(reg.at(found, TOOL)) @ e < reg.CHI**2)
    assert np.mean(errors[0.01]) < np.mean(errors[np.inf])
    assert np.mean(inside) >= 0.93


def test_what_is_moved_by_hand_was_off_by_as_much_and_a_check_notices_what_moved():
    found = reg.touched(BOX, BOX, place_error=np.full(8, 1e-3), touch_error=NOISE)
    by = np.array([0.02, 0, 0, 0, 0, 0.01])
    moved = reg.nudged(found, by)
    np.testing.assert_allclose(reg.put(moved, found.about), found.about + by[:3], atol=1e-12)
    assert reg.bound(moved.covariance, moved.about, TOOL, 0) > reg.bound(
        found.covariance, found.about, TOOL, 0
    )
    off, may = reg.contradiction(found, BOX[0] + [1e-3, 0, 0], BOX[0], NOISE)
    assert off < may
    off, may = reg.contradiction(found, BOX[0] + [0.03, 0, 0], BOX[0], NOISE)
    assert off > may
