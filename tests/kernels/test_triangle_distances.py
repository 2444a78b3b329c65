from fractions import Fraction

import numpy as np
import pytest

from seerob.kernels.primitives import (
    FLAT,
    LINE,
    nearest_edge,
    on_edges,
    over_face,
    segment_segment,
    segment_triangle,
)
from seerob.kernels.primitives import triangles as nearest_of_triangles
from seerob.kernels.tree import triangle_rows

RNG = np.random.default_rng(1)


def triangles(n: int, scale: float = 1.0) -> np.ndarray:
    """Random triangles, a third of them thin, flat to a line, or shrunk to a point: shape (n, 3, 3)."""
    made = RNG.normal(size=(n, 3, 3)) * scale
    for k in range(0, n, 12):
        made[k, 2] = made[k, 0] + RNG.uniform() * (made[k, 1] - made[k, 0])
        made[k + 1] = made[k + 1, 0]
        made[k + 2, 2] = made[k + 2, 1]
        made[k + 3, 2] = made[k + 3, :2].mean(0) + 1e-9 * RNG.normal(size=3)
    return made


def rows(made: np.ndarray) -> np.ndarray:
    return triangle_rows(made.reshape(-1, 3), np.arange(made.shape[0] * 3, dtype=np.int32).reshape(-1, 3))


def triangle_triangle(A: np.ndarray, i: int, B: np.ndarray, j: int, cut: float, W: np.ndarray) -> float:
    """Squared distance of two triangles; their points to ``W[:6]``."""
    d2, s, t, both = nearest_of_triangles(A, i, B, j, cut, W)
    on_edges(A, i, B, j, s, t, both, W)
    return d2


def gap(a: np.ndarray, b: np.ndarray, p: np.ndarray, q: np.ndarray) -> float:
    """Width of the slab across ``q - p`` between the convex hulls of ``a`` and ``b``: proves p, q nearest."""
    n = (q - p) / np.linalg.norm(q - p)
    return float((b @ n).min() - (a @ n).max())


def on_hull(points: np.ndarray, p: np.ndarray) -> float:
    """How far p is from the hull of one to three points: least squares over its corners and edges."""
    from scipy.optimize import nnls

    weights = 1e3 * np.ones(len(points))
    solution, _ = nnls(np.vstack([points.T, weights]), np.append(p, 1e3))
    return float(np.linalg.norm(points.T @ solution - p))


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_nearest_points_of_two_triangles_are_separated_by_their_own_distance(scale):
    A, B = triangles(1200), triangles(1200) * scale + RNG.normal(size=(1200, 1, 3))
    ra, rb = rows(A), rows(B)
    W = np.zeros(12)
    apart = 0
    for k in range(len(A)):
        d = np.sqrt(triangle_triangle(ra, k, rb, k, np.inf, W))
        assert np.linalg.norm(W[3:6] - W[:3]) == pytest.approx(d, abs=2e-12)
        if k % 10 == 0:
            assert on_hull(A[k], W[:3]) < 1e-8
            assert on_hull(B[k], W[3:6]) < 1e-8
        if d > 0:
            apart += 1
            assert gap(A[k], B[k], W[:3], W[3:6]) == pytest.approx(d, abs=1e-9)
        swapped = triangle_triangle(rb, k, ra, k, np.inf, W)
        assert np.sqrt(swapped) == pytest.approx(d, abs=1e-12)
    assert 200 < apart < 1200 or scale < 1


def test_a_segment_is_a_triangle_of_no_width():
    T = triangles(600)
    a, b = RNG.normal(size=(2, 600, 3))
    S = rows(np.stack([a, b, b], axis=1))
    rt, W = rows(T), np.zeros(12)
    for k in range(len(T)):
        d2, s, *p = segment_triangle(*a[k], *(b[k] - a[k]), rt, k, np.inf)
        assert np.sqrt(d2) == pytest.approx(np.sqrt(triangle_triangle(rt, k, S, k, np.inf, W)), abs=1e-12)
        assert np.linalg.norm(a[k] + s * (b[k] - a[k]) - p) == pytest.approx(np.sqrt(d2), abs=2e-12)


def test_an_upper_bound_changes_no_bit_of_what_lies_below_it():
    ra, rb = rows(triangles(600)), rows(triangles(600) + 0.5)
    V, W = np.zeros(12), np.zeros(12)
    for k in range(len(ra)):
        free = triangle_triangle(ra, k, rb, k, np.inf, V)
        bound = free * (1 + 1e-9) + 1e-18
        assert triangle_triangle(ra, k, rb, k, bound, W) == free
        assert (V[:6] == W[:6]).all()
        assert triangle_triangle(ra, k, rb, k, free / 2, W) >= free


def test_three_edges_at_once_are_the_three_one_by_one_bit_for_bit():
    T = triangles(1200)
    rt = rows(T)
    for k in range(len(T)):
        a, d = RNG.normal(size=(2, 3)) * (1.0, 1e-3, 1e-20, 1e60)[k % 4]
        if k % 3 == 0:
            d = T[k, 1] - T[k, 0] + (k % 2) * 1e-6 * RNG.normal(size=3)  # parallel to an edge, or nearly
        origins = rt[k, :3], rt[k, :3], rt[k, :3] + rt[k, 3:6]
        edges = rt[k, 3:6], rt[k, 6:9], rt[k, 6:9] - rt[k, 3:6]
        one_by_one = [segment_segment(*a, *d, *o, *e) for o, e in zip(origins, edges, strict=True)]
        least = min(range(3), key=lambda c: one_by_one[c][0])
        found = nearest_edge(*a, *d, rt, k)
        assert found == (*one_by_one[least], least)


def over(a: list[float], b: list[float]) -> float:
    """Least squared distance of corners of b, and of where its edges meet the plane, over the face of a."""
    v, e, f, n, n2 = a[:3], a[3:6], a[6:9], a[9:12], a[9] * a[9] + a[10] * a[10] + a[11] * a[11]
    r, p, q = [x - y for x, y in zip(b[:3], v, strict=True)], b[3:6], b[6:9]
    h0 = r[0] * n[0] + r[1] * n[1] + r[2] * n[2]
    h1, h2 = (h0 + g[0] * n[0] + g[1] * n[1] + g[2] * n[2] for g in (p, q))
    weights = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
    if h0 * h1 < 0:
        weights.append((h0 / (h0 - h1), 0.0))
    if h0 * h2 < 0:
        weights.append((0.0, h0 / (h0 - h2)))
    if h1 * h2 < 0:
        weights.append((1.0 - h1 / (h1 - h2), h1 / (h1 - h2)))
    least = np.inf
    for s, t in weights if a[12] != LINE else ():
        x = [i + s * j + t * k for i, j, k in zip(r, p, q, strict=True)]
        u, w = over_face(*x, *e, *f, *n, n2)
        if u >= 0:
            y = [u * i + w * j for i, j in zip(e, f, strict=True)]
            g = [i - j for i, j in zip(x, y, strict=True)]
            least = min(least, g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
    return least


def test_what_is_skipped_of_two_triangles_changes_no_bit_of_their_distance():
    # Above one another, far away above, and of edges that are parallel: what lies over a face is looked for.
    n = 3000
    T = triangles(n) * 10.0 ** RNG.uniform(-4, 0, (n, 1, 1))
    S = T @ np.linalg.qr(RNG.normal(size=(n, 3, 3)))[0]
    S[::2] = T[::2]
    away = np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0])
    away /= np.linalg.norm(away, axis=1, keepdims=True) + 1e-300
    S += (away * 10.0 ** RNG.uniform(-5, 1, (n, 1)) + 0.3 * (T[:, 1] - T[:, 0]) * RNG.normal(size=(n, 1)))[
        :, None
    ]
    ra, rb, W = rows(T), rows(S), np.zeros(12)
    faces = 0
    for k, (a, b) in enumerate(zip(ra.tolist(), rb.tolist(), strict=True)):
        edges = [
            [(row[:3], row[3:6]), (row[:3], row[6:9]), ([*map(sum, zip(row[:3], row[3:6], strict=True))],
             [y - x for x, y in zip(row[3:6], row[6:9], strict=True)])]
            for row in (a, b)
        ]  # fmt: skip
        edge = min(segment_segment(*o, *d, *p, *e)[0] for o, d in edges[0] for p, e in edges[1])
        face = min(over(a, b), over(b, a))
        least = min(face, edge)
        faces += face < edge
        assert triangle_triangle(ra, k, rb, k, np.inf, W) == (0.0 if least < 1e-24 else least), k
    assert faces > n / 10
    assert (ra[:, 12] < FLAT).any()


def exact_square(a, d, b, e) -> float:
    """Squared distance of two segments in rational arithmetic: the interior solution or an end of either."""
    a, d, b, e = ([Fraction(float(v)) for v in x] for x in (a, d, b, e))

    def dot(x, y):
        return sum(u * v for u, v in zip(x, y, strict=True))

    def at(s, t):
        x = [i + s * j - k - t * m for i, j, k, m in zip(a, d, b, e, strict=True)]
        return dot(x, x)

    r = [i - k for i, k in zip(a, b, strict=True)]
    dd, ee, de, dr, er = dot(d, d), dot(e, e), dot(d, e), dot(d, r), dot(e, r)
    found = []
    for end in (0, 1):
        found.append(at(end, min(max((er + end * de) / ee, 0), 1)))
        found.append(at(min(max((end * de - dr) / dd, 0), 1), end))
    if den := dd * ee - de * de:
        s, t = (de * er - dr * ee) / den, (dd * er - de * dr) / den
        if 0 <= s <= 1 and 0 <= t <= 1:
            found.append(at(s, t))
    return float(min(found))


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3])
def test_nearly_parallel_segments_keep_their_precision(angle):
    for _ in range(200):
        a, d = RNG.normal(size=(2, 3))
        e = (d + angle * RNG.normal(size=3)) * RNG.choice([-1, 1]) * RNG.uniform(0.1, 3)
        b = a + RNG.uniform(-1, 1) * d + RNG.choice([0, 1e-6, 0.1]) * RNG.normal(size=3)
        d2, s, t = segment_segment(*a, *d, *b, *e)
        assert np.linalg.norm(a + s * d - b - t * e) == pytest.approx(np.sqrt(d2), abs=1e-14)
        assert np.sqrt(d2) == pytest.approx(np.sqrt(exact_square(a, d, b, e)), abs=1e-10)


def test_points_are_segments_of_no_length():
    a, b = RNG.normal(size=(2, 3))
    zero = np.zeros(3)
    assert segment_segment(*a, *zero, *b, *zero)[0] == pytest.approx(((a - b) ** 2).sum(), rel=1e-15)
    assert segment_segment(*a, *zero, *(a - b), *(2 * b))[0] < 1e-30
