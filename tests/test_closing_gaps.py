"""Gaps that are measured only where it matters say what all gaps measured at every instant say."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from seerob.clamping import clamps, pinch_pairs
from seerob.closing_gaps import ClosingGaps
from seerob.distance import Shapes
from seerob.geometry import Mesh, Solid, capsule

THICKNESS = np.array([0.05, 0.1, 0.3])
CAP = 0.4
N = 300
T = 0.01 * np.arange(N)


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
    positions = positions + 3 * steps[..., :3] * np.array([0.2, 0, 0, 1, 1, 1])[:, None]
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


@pytest.fixture(params=range(3), scope="module")
def case(request, shapes):
    R, x = wandering(request.param)
    neighbours = frozenset({(ARM, WRIST), (BASE, ARM)})
    pairs = pinch_pairs(shapes, [ARM, WRIST, HAND], [WALL, SHELL], neighbours, still=[BASE], cap=CAP)
    every = pairs.per_body(clamps(pairs.batch(R, x), T, THICKNESS, opened=pairs.opened))
    return R, x, pairs, every


def test_the_cases_have_something_to_say(case):
    every = case[3]
    assert 0.02 < every.mean() < 0.9
    assert (every[1:] != every[:-1]).sum() > 10


@pytest.mark.parametrize("share", [0.02, 0.3, 1.0])
def test_what_is_wanted_is_what_all_gaps_say(case, shapes, share):
    R, x, pairs, every = case
    wanted = np.random.default_rng(7).random(every.shape) < share
    gaps = ClosingGaps(shapes, pairs, THICKNESS, cap=CAP)
    found = np.array([gaps.clamped(*one) for one in zip(T.tolist(), R, x, wanted, strict=True)])
    np.testing.assert_array_equal(found, every & wanted)


def test_what_is_first_wanted_late_still_knows_what_was(case, shapes):
    R, x, pairs, every = case
    nothing, all_ = np.zeros(every.shape[1:], bool), np.ones(every.shape[1:], bool)
    gaps = ClosingGaps(shapes, pairs, THICKNESS, cap=CAP)
    for k in range(200):
        assert not gaps.clamped(T[k], R[k], x[k], nothing).any()
    np.testing.assert_array_equal(gaps.clamped(T[200], R[200], x[200], all_), every[200])


def test_asked_twice_it_says_the_same_and_set_back_it_begins_anew(case, shapes):
    R, x, pairs, every = case
    all_ = np.ones(every.shape[1:], bool)
    gaps = ClosingGaps(shapes, pairs, THICKNESS, cap=CAP)
    for k in range(60):
        some = np.random.default_rng(k).random(all_.shape) < 0.5
        np.testing.assert_array_equal(gaps.clamped(T[k], R[k], x[k], some), every[k] & some)
        np.testing.assert_array_equal(gaps.clamped(T[k], R[k], x[k], all_), every[k])
    again = [gaps.clamped(T[k], R[k], x[k], all_) for k in range(30)]
    np.testing.assert_array_equal(again, every[:30])


def test_without_gaps_nothing_is_clamped(shapes):
    pairs = pinch_pairs(shapes, [ARM], [], frozenset(), cap=CAP)
    gaps = ClosingGaps(shapes, pairs, THICKNESS, cap=CAP)
    R, x = np.tile(np.eye(3), (6, 1, 1)), np.zeros((6, 3))
    assert not gaps.clamped(0.0, R, x, np.ones((1, 3), bool)).any()
