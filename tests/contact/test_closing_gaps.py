"""Gaps that are measured only where it matters say what all gaps measured at every instant say."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from seerob.contact.clamping import clamps, pinch_pairs
from seerob.contact.closing_gaps import ClosingGaps
from seerob.distances.least import Shapes
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
    """Displacements since the instant before and relative speeds of every gap, shape (N, g) each."""
    points = [np.concatenate([core_corners(s) for s in solids]) for _, solids in BODIES]

    def seen(n, i, points_now):
        """World points as of body i at instant n; -1 is the world."""
        return points_now if i < 0 else (points_now - x[n, i]) @ R[n, i]

    def way(n, i, j):
        now, then = (points[j] @ R[k, j].T + x[k, j] for k in (n, n - 1))
        return np.linalg.norm(seen(n, i, now) - seen(n - 1, i, then), axis=1).max()

    def speed(n, i, j):
        p = points[j] @ R[n, j].T + x[n, j]
        v = [linear[n, k] + np.cross(angular[n, k], p - x[n, k]) for k in (i, j)]
        return np.linalg.norm(v[1] - v[0], axis=1).max()

    own = [(q.a[i], q.b[0]) for q, _ in pairs.queries[1:] for i in range(len(q.a))]
    surfaces = len(pairs.first) - len(own)
    moved, speeds = np.zeros((N, len(pairs.first))), np.full((N, len(pairs.first)), np.inf)
    for n in range(1, N):
        others = max(way(n, -1, i) for i in sorted({i for q, _ in pairs.queries for i in q.a}))
        for g in range(surfaces):
            moved[n, g] = way(n, -1, pairs.moving[pairs.first[g]]) + others
        for g, (i, j) in enumerate(own, surfaces):
            moved[n, g] = way(n, i, j)
    for n in range(N):
        speeds[n, surfaces:] = [speed(n, i, j) for i, j in own]
    return moved, speeds


@pytest.fixture(params=range(3), scope="module")
def case(request, shapes):
    R, x = wandering(request.param)
    v = velocities(R, x)
    neighbours = frozenset({(ARM, WRIST), (BASE, ARM)})
    pairs = pinch_pairs(shapes, [ARM, WRIST, HAND], [WALL, SHELL], neighbours, still=[BASE], cap=CAP)
    found = brute_force(pairs, R, x, *v)
    every = pairs.per_body(clamps(pairs.batch(R, x), *found, THICKNESS, opened=pairs.opened))
    return (R, x, np.stack(v, axis=1)), pairs, every


def test_the_cases_have_something_to_say(case):
    every = case[-1]
    assert 0.02 < every.mean() < 0.95
    assert (every[1:] != every[:-1]).sum() > 10


@pytest.mark.parametrize("share", [0.02, 0.3, 1.0])
def test_what_is_wanted_is_what_all_gaps_say(case, shapes, share):
    (R, x, v), pairs, every = case
    wanted = np.random.default_rng(7).random(every.shape) < share
    gaps = ClosingGaps(shapes, pairs, THICKNESS, cap=CAP)
    found = np.array([gaps.clamped(*one) for one in zip(T.tolist(), R, x, v, wanted, strict=True)])
    np.testing.assert_array_equal(found, every & wanted)


def test_what_is_first_wanted_late_still_knows_what_was(case, shapes):
    (R, x, v), pairs, every = case
    nothing, all_ = np.zeros(every.shape[1:], bool), np.ones(every.shape[1:], bool)
    gaps = ClosingGaps(shapes, pairs, THICKNESS, cap=CAP)
    for k in range(200):
        assert not gaps.clamped(T[k], R[k], x[k], v[k], nothing).any()
    np.testing.assert_array_equal(gaps.clamped(T[200], R[200], x[200], v[200], all_), every[200])


def test_asked_twice_it_says_the_same_and_set_back_it_begins_anew(case, shapes):
    (R, x, v), pairs, every = case
    all_ = np.ones(every.shape[1:], bool)
    gaps = ClosingGaps(shapes, pairs, THICKNESS, cap=CAP)
    for k in range(60):
        some = np.random.default_rng(k).random(all_.shape) < 0.5
        np.testing.assert_array_equal(gaps.clamped(T[k], R[k], x[k], v[k], some), every[k] & some)
        np.testing.assert_array_equal(gaps.clamped(T[k], R[k], x[k], v[k], all_), every[k])
    again = [gaps.clamped(T[k], R[k], x[k], v[k], all_) for k in range(30)]
    np.testing.assert_array_equal(again, every[:30])


def test_other_poses_at_the_same_instant_are_judged_by_themselves(shapes):
    """The map of permissible speeds asks about many places at one time."""
    pairs = pinch_pairs(shapes, [ARM], [WALL], frozenset(), cap=CAP)
    gaps = ClosingGaps(shapes, pairs, THICKNESS, cap=CAP)
    R, v, all_ = np.tile(np.eye(3), (6, 1, 1)), np.zeros((2, 6, 3)), np.ones((1, 3), bool)
    far, near = np.zeros((2, 6, 3))
    far[ARM, 0], near[ARM, 0] = 2.0, 0.1
    assert not gaps.clamped(0.0, R, far, v, all_).any()
    assert gaps.clamped(0.0, R, near, v, all_).all()


def test_without_gaps_nothing_is_clamped(shapes):
    pairs = pinch_pairs(shapes, [ARM], [], frozenset(), cap=CAP)
    gaps = ClosingGaps(shapes, pairs, THICKNESS, cap=CAP)
    R, x = np.tile(np.eye(3), (6, 1, 1)), np.zeros((6, 3))
    assert not gaps.clamped(0.0, R, x, np.zeros((2, 6, 3)), np.ones((1, 3), bool)).any()


def in_turn(shapes, pairs, instants, wanted, v):
    """Flags of the last of some instants (R, x), 10 ms apart."""
    gaps = ClosingGaps(shapes, pairs, THICKNESS, cap=CAP)
    return [gaps.clamped(0.01 * k, R, x, v, wanted) for k, (R, x) in enumerate(instants)][-1]


@pytest.mark.parametrize(("farther", "clamps_it"), [(0.5e-9, True), (5e-9, False)])
def test_a_gap_counts_up_to_rounding_where_it_may_close_by_the_next_instant(shapes, farther, clamps_it):
    """0.41 m from the wall's face to the capsule's axis less its radius; it moved by 0.02 m."""
    pairs = pinch_pairs(shapes, [ARM], [WALL], frozenset(), cap=CAP)
    thin = np.array([[True, False, False]])
    instants = []
    for x in (0.32, 0.34):
        place = np.zeros((6, 3))
        place[WALL, 0], place[ARM, 0] = 0.5, x - farther
        instants.append((np.tile(np.eye(3), (6, 1, 1)), place))
    assert pairs.gaps(*instants[-1])[0] == pytest.approx(THICKNESS[0] + 0.02 + farther, abs=1e-12)
    assert in_turn(shapes, pairs, instants, thin, np.zeros((2, 6, 3))).tolist() == [[clamps_it, False, False]]


@pytest.mark.parametrize("was_far", [True, False])
def test_own_parts_that_were_far_apart_a_moment_ago_had_room(shapes, was_far):
    pairs = pinch_pairs(shapes, [ARM, HAND], [], frozenset(), cap=CAP)
    far, near, v = np.zeros((6, 3)), np.zeros((6, 3)), np.zeros((2, 6, 3))
    far[HAND, 0], near[HAND, 0], v[0, HAND, 0] = 2.0, 0.08, -1.0
    R, all_ = np.tile(np.eye(3), (6, 1, 1)), np.ones((2, 3), bool)
    found = in_turn(shapes, pairs, [(R, far if was_far else near), (R, near)], all_, v)
    assert found.all() if was_far else not found.any()


@pytest.mark.parametrize(("gap", "clamps_it"), [(0.08, False), (0.054, True)])
def test_what_turns_about_itself_moves_little_wherever_its_frame_is(gap, clamps_it):
    """A plate of 0.1 m, 1 m from the origin of its body, by 0.1 rad: by 5 mm, its frame by 0.1 m."""
    middle = np.array([1.0, 0.0, 0.0])
    square = middle + 0.05 * np.array([[0, -1, -1], [0, 1, -1], [0, -1, 1]])
    shapes = Shapes.build([BODIES[WALL], ("plate", [Solid(points=square, radius=0.01)])])
    pairs = pinch_pairs(shapes, [1], [0], frozenset(), cap=CAP)
    c, s = np.cos(0.1), np.sin(0.1)
    turned = np.array([np.eye(3), [[c, -s, 0], [s, c, 0], [0, 0, 1]]])

    def instants(x):
        return [
            (np.array([np.eye(3), R]), np.array([[0.5, 0, 0], np.array([x, 0, 0]) - R @ middle]))
            for R in turned
        ]

    x = 0.2 + float(pairs.gaps(*instants(0.2)[-1])[0][0]) - gap
    assert pairs.gaps(*instants(x)[-1])[0] == pytest.approx(gap)
    found = in_turn(shapes, pairs, instants(x), np.ones((1, 3), bool), np.zeros((2, 2, 3)))
    assert found.tolist() == [[clamps_it, True, True]]


def test_what_comes_out_of_an_open_box_by_its_lid_had_room_at_once():
    """Inside and outside meet in the opening, far from all walls: a gap may change its sign in 2 cm."""
    box = trimesh.creation.box([0.6] * 3)
    box.update_faces(box.triangles_center[:, 2] < 0.29)
    ball = capsule(np.zeros(3), np.array([0.0, 0.0, 1e-3]), 0.005)
    shapes = Shapes.build([("box", [solid(box)]), ("ball", [ball])])
    pairs = pinch_pairs(shapes, [1], [], frozenset(), still=[0], cap=CAP)
    R, v = np.tile(np.eye(3), (2, 1, 1)), np.ones((2, 2, 3))
    instants = [
        (R, np.array([np.zeros(3), place])) for place in ((0, 0, 0.29), (0, 0, 0.31), (0.27, 0, 0.31))
    ]
    inside, outside, near = (pairs.gaps(*instant)[0][0] for instant in instants)
    assert inside < -0.2
    assert outside > 0.2
    assert 0 < near < THICKNESS[0]
    assert in_turn(shapes, pairs, instants, np.ones((1, 3), bool), v).tolist() == [[True, True, False]]
