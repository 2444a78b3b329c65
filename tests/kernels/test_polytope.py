"""Corners and faces of polytopes against brute force, Qhull and closed forms."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, product

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from seerob.criteria.polytope import SAME, Polytope, _hull, free_moment, torque_box, zero_moment
from seerob.kernels.polytope import largest, vertices


def brute_force(A: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Every point where three planes meet and that satisfies all the others."""
    found = []
    for triple in combinations(range(A.shape[1]), 3):
        N = A[:, triple].T
        if abs(np.linalg.det(N)) < 1e-9:
            continue
        for sides in product((0, 1), repeat=3):
            b = [(low, high)[side][i] for side, i in zip(sides, triple, strict=True)]
            f = np.linalg.solve(N, b)
            reach = 1e-9 * (np.abs(A).T @ np.abs(f)).max()
            if ((A.T @ f >= low - reach) & (A.T @ f <= high + reach)).all():
                found.append(f)
    return np.array(found).reshape(-1, 3)


def qhull(A: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    slabs = np.block([[A.T, -high[:, None]], [-A.T, low[:, None]]])
    # The centre of the largest ball inside.
    lengths = np.linalg.norm(slabs[:, :3], axis=1, keepdims=True)
    ball = np.hstack([slabs[:, :3], lengths])
    inside = linprog([0, 0, 0, -1], A_ub=ball, b_ub=-slabs[:, 3], bounds=[(None, None)] * 3 + [(0, None)]).x[
        :3
    ]
    return HalfspaceIntersection(slabs, inside).intersections


def random_case(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normals, and asymmetric bounds about a point that is not 0."""
    A = rng.normal(size=(3, n))
    middle = A.T @ rng.normal(scale=10, size=3)
    return A, middle - rng.uniform(5, 200, n), middle + rng.uniform(5, 200, n)


def same_points(a: np.ndarray, b: np.ndarray, relative: float) -> None:
    apart = np.linalg.norm(a[:, None] - b[None], axis=-1)
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) <= relative * np.linalg.norm(b, axis=1).max()


def volume(polytope: Polytope) -> float:
    a, b, c = (polytope.corners[polytope.triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def closed(polytope: Polytope) -> bool:
    """Whether each edge belongs to two triangles, once in each direction."""
    triangles = polytope.triangles
    edges = set(map(tuple, np.vstack([triangles[:, [i, (i + 1) % 3]] for i in range(3)]).tolist()))
    return len(edges) == 3 * len(triangles) and all((b, a) in edges for a, b in edges)


@pytest.mark.parametrize("n", [3, 4, 6, 7, 9])
def test_corners_are_those_of_brute_force(n: int) -> None:
    rng = np.random.default_rng(n)
    for _ in range(10):
        case = random_case(rng, n)
        same_points(zero_moment(*case).corners, brute_force(*case), 1e-10)


@pytest.mark.parametrize("n", [6, 7])
def test_farthest_corner_agrees_with_qhull_to_rounding(n: int) -> None:
    rng = np.random.default_rng(100 + n)
    for _ in range(100):
        case = random_case(rng, n)
        V = qhull(*case)
        assert zero_moment(*case).largest == pytest.approx(np.linalg.norm(V, axis=1).max(), rel=1e-12)


def test_surface_is_closed_faces_outward_and_has_the_hulls_volume() -> None:
    rng = np.random.default_rng(2)
    for n in (3, 5, 6, 7) * 5:
        p = zero_moment(*random_case(rng, n))
        assert closed(p)
        assert volume(p) == pytest.approx(ConvexHull(p.corners).volume, rel=1e-9)


def test_generic_polytope_satisfies_euler() -> None:
    p = zero_moment(*random_case(np.random.default_rng(3), 7))
    assert len(p.corners) - 3 * len(p.triangles) / 2 + len(p.triangles) == 2


def test_batch_is_the_single_one() -> None:
    rng = np.random.default_rng(4)
    cases = [random_case(rng, 7) for _ in range(20)]
    norm, point, radius = largest(*map(np.array, zip(*cases, strict=True)))
    for k, case in enumerate(cases):
        p = zero_moment(*case)
        np.testing.assert_allclose(norm[k], p.largest, rtol=1e-13)
        np.testing.assert_allclose(point[k], p.farthest, rtol=1e-12, atol=1e-9)
        assert radius[k] == p.inscribed


def test_vertices_of_a_batch_are_those_of_brute_force_and_none_of_an_empty_or_unbounded_one() -> None:
    rng = np.random.default_rng(14)
    for n in (4, 6, 7):
        cases = [random_case(rng, n) for _ in range(8)]
        A, low, high = map(np.array, zip(*cases, strict=True))
        low[2, 0], high[2, 0] = high[2].max() * 1e3, high[2].max() * 2e3
        A[2, :, 1], low[2, 1], high[2, 1] = -A[2, :, 0], low[2, 0], high[2, 0]  # contradicts joint 0
        A[5, 0] = 0.0  # no force along x is felt
        V, begin = vertices(A, low, high, 1e-9)
        for k in range(8):
            own = V[begin[k] : begin[k + 1]]
            if k in (2, 5):
                assert len(own) == 0
            else:
                same_points(own, brute_force(A[k], low[k], high[k]), 1e-10)
                assert len(own) == len(zero_moment(A[k], low[k], high[k]).corners)


def test_inscribed_force_is_possible_in_every_direction_and_a_little_more_is_not() -> None:
    rng = np.random.default_rng(5)
    A, low, high = rng.normal(size=(3, 7)), -rng.uniform(5, 200, 7), rng.uniform(5, 200, 7)
    r = zero_moment(A, low, high).inscribed
    u = rng.normal(size=(20000, 3))
    u = np.vstack([u, A.T, -A.T])
    u /= np.linalg.norm(u, axis=1, keepdims=True)

    def possible(f: np.ndarray) -> np.ndarray:
        return ((f @ A >= low) & (f @ A <= high)).all(axis=1)

    assert possible((1 - 1e-9) * r * u).all()
    assert not possible((1 + 1e-9) * r * u).all()


def test_origin_outside_has_a_negative_radius() -> None:
    p = zero_moment(np.eye(3), np.array([1.0, -1, -1]), np.array([2.0, 1, 1]))
    assert (p.inscribed, p.largest) == (-1.0, pytest.approx(np.sqrt(6)))


def test_cube() -> None:
    p = zero_moment(np.eye(3), np.full(3, -1.0), np.full(3, 1.0))
    assert sorted(map(tuple, p.corners.tolist())) == sorted(product((-1.0, 1.0), repeat=3))
    assert closed(p)
    assert volume(p) == pytest.approx(8)


def test_planes_through_one_corner_and_repeated_planes() -> None:
    # An octahedron: four planes through every corner; then the same planes a second time.
    A = np.array([[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, 1, -1]], float)
    for normals in (A, np.hstack([A, 2 * A])):
        bound = np.linalg.norm(normals, axis=0) / np.sqrt(3)
        p = zero_moment(normals, -bound, bound)
        assert len(p.corners) == 6
        assert closed(p)
        assert volume(p) == pytest.approx(4 / 3)


def test_joint_that_does_not_move_the_point_bounds_nothing_but_must_hold_itself() -> None:
    A, low, high = random_case(np.random.default_rng(6), 6)
    wide = np.hstack([A, np.zeros((3, 1))])
    same_points(
        zero_moment(wide, np.append(low, -1), np.append(high, 1)).corners, brute_force(A, low, high), 1e-10
    )
    assert zero_moment(wide, np.append(low, 0.5), np.append(high, 1)).empty


@pytest.mark.parametrize("rank", [0, 1, 2])
def test_singular_polytope_is_unbounded_exactly_across_its_driven_directions(rank: int) -> None:
    rng = np.random.default_rng(7)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    A = axes[:, :rank] @ rng.normal(size=(rank, 7)) if rank else np.zeros((3, 7))
    p = zero_moment(A, np.full(7, -10.0), np.full(7, 20.0))
    assert p.free.shape == (3, 3 - rank)
    np.testing.assert_allclose(A.T @ p.free, 0, atol=1e-12)
    assert p.largest == np.inf
    assert largest(A[None], np.full((1, 7), -10.0), np.full((1, 7), 20.0))[0][0] == np.inf
    # The section is the whole set modulo the free directions: its corners touch bounds, none is crossed.
    torques = p.corners @ A
    assert (torques > -10 - 1e-9).all()
    assert (torques < 20 + 1e-9).all()
    assert (np.isclose(torques, -10) | np.isclose(torques, 20)).sum(axis=1).min(initial=9) >= rank


def exactly_farthest(A: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Norm of the farthest corner in rational arithmetic, Cramer's rule on every three planes."""
    columns = [[Fraction(x) for x in column] for column in A.T.tolist()]
    bounds = [(Fraction(lo), Fraction(hi)) for lo, hi in zip(low.tolist(), high.tolist(), strict=True)]

    def cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    def dot(a: list[Fraction], b: list[Fraction]) -> Fraction:
        return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))

    best = Fraction(0)
    for i, j, k in combinations(range(len(columns)), 3):
        a, b, c = columns[i], columns[j], columns[k]
        volume, across = dot(a, cross(b, c)), (cross(b, c), cross(c, a), cross(a, b))
        if volume == 0:
            continue
        for sides in product(bounds[i], bounds[j], bounds[k]):
            f = [dot([v[r] for v in across], list(sides)) / volume for r in range(3)]
            if all(lo <= dot(n, f) <= hi for n, (lo, hi) in zip(columns, bounds, strict=True)):
                best = max(best, dot(f, f))
    return float(best) ** 0.5


@pytest.mark.parametrize("angle", [1e-2, 1e-4, 1e-6, 1e-8])
def test_nearly_parallel_planes_lose_no_digits_beyond_their_condition(angle: float) -> None:
    rng = np.random.default_rng(12)
    for _ in range(3):
        A = rng.normal(size=(3, 6))
        A[:, 1] = A[:, 0] + angle * rng.normal(size=3)
        A[:, 2] = A[:, 0] - angle * rng.normal(size=3)
        low, high = -rng.uniform(5, 200, 6), rng.uniform(5, 200, 6)
        p = zero_moment(A, low, high)
        assert closed(p)
        assert p.largest == pytest.approx(exactly_farthest(A, low, high), rel=1e-14 / angle)


def test_nearly_singular_force_grows_like_one_over_the_singular_value() -> None:
    sizes = [zero_moment(np.diag([1, 1, s]), -np.ones(3), np.ones(3)).largest for s in (1e-2, 1e-5, 1e-8)]
    np.testing.assert_allclose(sizes, [np.sqrt(2 + s**-2) for s in (1e-2, 1e-5, 1e-8)], rtol=1e-12)


def test_contradiction_is_empty() -> None:
    A = np.array([[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0]], float)
    low, high = np.array([0.0, 0, 0, 2]), np.array([1.0, 1, 1, 3])
    assert zero_moment(A, low, high).empty
    assert np.isnan(largest(A[None], low[None], high[None])[0][0])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_none_are_refused(bad: float) -> None:
    A, low, high = random_case(np.random.default_rng(8), 6)
    for k, array in enumerate((A, low, high)):
        changed = array.copy()
        changed.flat[1] = bad
        with pytest.raises(ValueError, match="not finite"):
            zero_moment(*[changed if i == k else a for i, a in enumerate((A, low, high))])
    with pytest.raises(ValueError, match="joint 0"):
        zero_moment(A, high, low)


# -- the other two sets -------------------------------------------------------------------------


def support(A_ub: np.ndarray, b_ub: np.ndarray, u: np.ndarray) -> float:
    """Largest u·f over wrenches that satisfy the bounds, by linear programming."""
    cost = np.concatenate([-u, np.zeros(A_ub.shape[1] - 3)])
    done = linprog(cost, A_ub=A_ub, b_ub=b_ub, bounds=(None, None))
    return -done.fun if done.status == 0 else np.inf


@pytest.mark.parametrize("n", [6, 7, 8])
def test_free_moment_set_has_the_support_of_linear_programming(n: int) -> None:
    rng = np.random.default_rng(20 + n)
    J = rng.normal(size=(6, n))
    low, high = -rng.uniform(5, 200, n), rng.uniform(5, 200, n)
    p = free_moment(J, low, high)
    assert closed(p)
    for u in rng.normal(size=(8, 3)):
        expected = support(np.vstack([J.T, -J.T]), np.concatenate([high, -low]), u)
        assert (p.corners @ u).max() == pytest.approx(expected, rel=1e-7)


def test_free_moment_set_of_few_joints_is_unbounded_where_linear_programming_is() -> None:
    rng = np.random.default_rng(9)
    J = rng.normal(size=(6, 4))
    p = free_moment(J, -np.ones(4), np.ones(4))
    assert p.free.shape[1] == 2
    for u in p.free.T:
        assert support(np.vstack([J.T, -J.T]), np.ones(8), u) == np.inf
    across = np.cross(*p.free.T)
    assert (p.corners @ across).max() == pytest.approx(
        support(np.vstack([J.T, -J.T]), np.ones(8), across), rel=1e-7
    )


def test_both_other_sets_contain_the_zero_moment_set_and_are_larger() -> None:
    rng = np.random.default_rng(10)
    J, high = rng.normal(size=(6, 7)), rng.uniform(5, 200, 7)
    inner = zero_moment(J[:3], -high, high)
    for outer in (free_moment(J, -high, high), torque_box(J[:3], -high, high)):
        planes = ConvexHull(outer.corners).equations
        assert (inner.corners @ planes[:, :3].T + planes[:, 3]).max() < 1e-9 * outer.largest
        assert outer.largest > inner.largest
        assert outer.inscribed >= inner.inscribed * (1 - 1e-9)


def test_torque_box_is_the_hull_of_every_extreme_torque() -> None:
    rng = np.random.default_rng(11)
    J_v, high = rng.normal(size=(3, 7)), rng.uniform(5, 200, 7)
    images = np.array(list(product((-1, 1), repeat=7))) * high @ np.linalg.pinv(J_v.T).T
    p = torque_box(J_v, -high, high)
    assert p.largest == pytest.approx(np.linalg.norm(images, axis=1).max(), rel=1e-12)
    assert volume(p) == pytest.approx(ConvexHull(images).volume, rel=1e-9)


def test_corners_that_rounding_parts_are_one_however_near_the_origin():
    corners = np.array(list(product((0.0, 40.0), repeat=3)))
    parted = np.concatenate([corners, corners + 40.0 * SAME / 10])
    whole = _hull(parted, np.zeros((3, 0)))
    assert len(whole.corners) == len(corners)
