"""Gaps that are measured only where it matters say what all gaps measured at every instant say."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from seerob.core.shapes import Mesh, Solid, capsule
from seerob.criteria.contact.clamped_regions import ClosingGaps
from seerob.criteria.contact.clamping import clamps, pinch_pairs
from seerob.distance.least import Shapes

THICKNESS = np.array([0.05, 0.1, 0.3])
CAP, TICK = 0.45, 0.01
N = 300
T = TICK * np.arange(N)


def solid(mesh: trimesh.Trimesh, *, keep: int | None = None) -> Solid:
    return Solid(mesh=Mesh(np.array(mesh.vertices), np.array(mesh.faces[:keep], np.int32)))


BODIES = [
    ("wall", [solid(trimesh.creation.box([0.1, 1, 1]))]),
    ("shell", [solid(trimesh.creation.icosphere(radius=0.2, subdivisions=1), keep=70)]),
    ("base", [solid(trimesh.creation.box([0.2, 0.2, 0.1]))]),
    ("arm", [capsule(np.zeros(3), np.array([0.0, 0, 0.3]), 0.04)]),
    ("wrist", [solid(trimesh.creation.cylinder(0.05, 0.2, sections=8))]),
    ("hand", [solid(trimesh.creation.box([0.05, 0.1, 0.08])), capsule(np.zeros(3), np.ones(3) * 0.1, 0.01)]),
]
WALL, SHELL, BASE, ARM, WRIST, HAND = range(6)


def wandering(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Smooth, with stretches of rest; the wall moves too."""
    rng = np.random.default_rng(seed)
    steps = np.cumsum(rng.normal(0, 1, (N, 6, 6)), axis=0)
    steps = np.cumsum(steps * 4e-5, axis=0)
    steps[100:140] = steps[100]
    positions = np.array([[0.5, 0, 0], [-0.5, 0, 0], [0, 0, 0], [0, 0, 0.2], [0.1, 0.1, 0.4], [0.2, 0, 0.2]])
    positions = positions + 3 * steps[..., :3] * np.array([0.2, 0.15, 0, 1, 1, 1])[:, None]
    turns = 5 * steps[..., 3:] * np.array([0, 0, 0, 1, 1, 1])[:, None]
    angle = np.linalg.norm(turns, axis=-1)
    x, y, z = np.moveaxis(turns / np.maximum(angle, 1e-12)[..., None], -1, 0)
    zero = np.zeros_like(x)
    K = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(N, 6, 3, 3)
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K), positions


@pytest.fixture(scope="module")
def shapes() -> Shapes:
    return Shapes.build(BODIES)


def velocities(R: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By difference to the instant before: linear and angular, shape (N, n, 3) each."""
    dt = T[1] - T[0]
    linear, angular = np.zeros_like(x), np.zeros_like(x)
    linear[1:] = np.diff(x, axis=0) / dt
    W = (R[1:] - R[:-1]) @ np.swapaxes(R[1:], -1, -2) / dt
    angular[1:] = np.stack([W[..., 2, 1], W[..., 0, 2], W[..., 1, 0]], axis=-1)
    return linear, angular


def core_corners(mesh_or_points: Solid) -> np.ndarray:
    points = mesh_or_points.mesh.vertices if mesh_or_points.mesh is not None else mesh_or_points.points
    low, high = points.min(axis=0), points.max(axis=0)
    box = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    return box if mesh_or_points.mesh is not None else points


def brute_force(pairs, R, x, linear, angular):
    """Relative speeds of every gap, shape (N, g), and speeds of every moving body."""
    points = [np.concatenate([core_corners(s) for s in solids]) for _, solids in BODIES]

    def speed(n, i, j):
        p = points[j] @ R[n, j].T + x[n, j]
        v = [linear[n, k] + np.cross(angular[n, k], p - x[n, k]) for k in (i, j)] if i >= 0 else [0, None]
        if i < 0:
            v[1] = linear[n, j] + np.cross(angular[n, j], p - x[n, j])
        turn = angular[n, j] - (angular[n, i] if i >= 0 else 0)
        around = max(s.radius for s in BODIES[j][1])
        return np.linalg.norm(v[1] - v[0], axis=1).max() + np.linalg.norm(turn) * around

    moving = np.array([[speed(n, -1, i) for i in pairs.moving] for n in range(N)])
    found = moving[:, pairs.first]
    for g in np.flatnonzero(pairs.across >= 0):
        found[:, g] = [speed(n, pairs.across[g], pairs.moving[pairs.first[g]]) for n in range(N)]
    return found, moving


def thickness_of(pairs):
    """As thick as the body parts at surfaces; between own parts less, and of one nothing."""
    found = np.tile(THICKNESS, (len(pairs.first), 1))
    found[pairs.inner] -= 0.02
    found[pairs.inner, 0] = -np.inf
    return found


@pytest.fixture(params=range(3), scope="module")
def case(request, shapes):
    R, x = wandering(request.param)
    v = velocities(R, x)
    left_out = frozenset({(ARM, WRIST), (BASE, ARM)})
    pairs = pinch_pairs(shapes, [ARM, WRIST, HAND], [SHELL], left_out, others=[WALL], still=[BASE], cap=CAP)
    speed, moving = brute_force(pairs, R, x, *v)
    flags = clamps(pairs.batch(R, x), speed, thickness_of(pairs))
    fastest = np.array([pairs.fastest(f, v) for f, v in zip(flags, speed, strict=True)])
    return (R, x, np.stack(v, axis=1), moving), pairs, pairs.per_body(flags), fastest


def test_the_cases_have_something_to_say(case):
    every = case[-2]
    assert 0.02 < every.mean() < 0.95
    assert (every[1:] != every[:-1]).sum() > 10


@pytest.mark.parametrize("share", [0.02, 0.3, 1.0])
def test_what_is_wanted_is_what_all_gaps_say(case, shapes, share):
    instants, pairs, every, fastest = case
    wanted = np.random.default_rng(7).random(every.shape) < share
    gaps = ClosingGaps(shapes, pairs, thickness_of(pairs))
    found = [gaps.clamped(*one) for one in zip(*instants, wanted, strict=True)]
    np.testing.assert_array_equal([flags for flags, _ in found], every & wanted)
    speeds = np.array([speed for _, speed in found])
    if share == 1.0:
        np.testing.assert_allclose(speeds, fastest, rtol=1e-9)
        assert (fastest > 0).any()
    assert (speeds[~wanted] == 0).all()


def test_the_answer_is_that_of_the_instant_whatever_was_asked_before(case, shapes):
    """From any instant on, backwards, and one alone: a recording that begins later says the same."""
    instants, pairs, every, _ = case
    all_ = np.ones(every.shape[1:], bool)

    def asked(gaps, k):
        return gaps.clamped(*(of[k] for of in instants), all_)[0]

    order = [*range(200, 260), *range(60, 0, -1), 299, 0]
    gaps = ClosingGaps(shapes, pairs, thickness_of(pairs))
    np.testing.assert_array_equal([asked(gaps, k) for k in order], every[order])
    for k in range(0, N, 60):
        alone = ClosingGaps(shapes, pairs, thickness_of(pairs))
        np.testing.assert_array_equal(asked(alone, k), every[k])


def test_without_gaps_nothing_is_clamped(shapes):
    pairs = pinch_pairs(shapes, [ARM], [], frozenset(), cap=CAP)
    gaps = ClosingGaps(shapes, pairs, thickness_of(pairs))
    R, x = np.tile(np.eye(3), (6, 1, 1)), np.zeros((6, 3))
    v = np.zeros((2, 6, 3))
    flags, speeds = gaps.clamped(R, x, v, np.ones(1), np.ones((1, 3), bool))
    assert not flags.any()
    assert not speeds.any()


@pytest.mark.parametrize(("farther", "clamps_it"), [(-1e-9, True), (1e-9, False)])
def test_a_gap_counts_up_to_the_thickness_of_a_body_part(shapes, farther, clamps_it):
    """0.39 m from the wall's face to the capsule's axis less its radius."""
    pairs = pinch_pairs(shapes, [ARM], [WALL], frozenset(), cap=CAP)
    thin = np.array([[True, False, False]])
    place = np.zeros((6, 3))
    place[WALL, 0], place[ARM, 0] = 0.5, 0.36 - farther
    R = np.tile(np.eye(3), (6, 1, 1))
    assert pairs.gaps(R, place)[0] == pytest.approx(THICKNESS[0] + farther, abs=1e-12)
    gaps = ClosingGaps(shapes, pairs, thickness_of(pairs))
    found, _ = gaps.clamped(R, place, np.zeros((2, 6, 3)), np.array([2.0]), thin)
    assert found.tolist() == [[clamps_it, False, False]]
