"""Brute-force distance from points to triangles, the yardstick of these tests (Ericson 2005, 5.1.5)."""

import numpy as np
from numba import njit


@njit(cache=True)
def squared(p, a, b, c):
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = ab @ ap, ac @ ap
    if d1 <= 0 and d2 <= 0:
        return ap @ ap
    bp = p - b
    d3, d4 = ab @ bp, ac @ bp
    if d3 >= 0 and d4 <= d3:
        return bp @ bp
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        q = ap - d1 / (d1 - d3) * ab
        return q @ q
    cp = p - c
    d5, d6 = ab @ cp, ac @ cp
    if d6 >= 0 and d5 <= d6:
        return cp @ cp
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        q = ap - d2 / (d2 - d6) * ac
        return q @ q
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        q = bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)
        return q @ q
    n = 1 / (va + vb + vc)
    q = ap - vb * n * ab - vc * n * ac
    return q @ q


@njit(cache=True)
def farthest(points, triangles):
    worst = 0.0
    for i in range(len(points)):
        best = np.inf
        for t in range(len(triangles)):
            # The corner's distance bounds nothing from below, but a box test per axis does.
            skip = False
            for k in range(3):
                lo = min(triangles[t, 0, k], triangles[t, 1, k], triangles[t, 2, k]) - points[i, k]
                hi = points[i, k] - max(triangles[t, 0, k], triangles[t, 1, k], triangles[t, 2, k])
                gap = max(lo, hi)
                if gap > 0 and gap * gap >= best:
                    skip = True
                    break
            if not skip:
                best = min(best, squared(points[i], triangles[t, 0], triangles[t, 1], triangles[t, 2]))
                if best <= worst:
                    break
        worst = max(worst, best)
    return np.sqrt(worst)


def samples(mesh, count, rng):
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(corners), count, p=area / area.sum())
    w = rng.dirichlet(np.ones(3), count)
    chosen = rng.choice(len(mesh.vertices), min(count, len(mesh.vertices)), replace=False)
    return np.vstack([np.einsum("ij,ijk->ik", w, corners[face]), mesh.vertices[chosen]])


def hausdorff(a, b, count=1000, seed=0):
    """Sampled Hausdorff distance, the larger of both ways."""
    rng = np.random.default_rng(seed)
    ab = farthest(samples(a, count, rng), b.vertices[b.faces])
    return max(ab, farthest(samples(b, count, rng), a.vertices[a.faces]))
