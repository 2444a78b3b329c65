r"""Squared distances between segments and triangles, with closest points.

Two planar convex shapes are nearest at a pair of points of which at least one lies on the edge of
its shape (two interior points mean parallel planes, along which the pair slides to an edge).
So the distance of a segment to a triangle is the least of: its ends to the face, its crossing with
the face, itself to the three edges; and of two triangles: corners to faces, edges crossing faces,
edges to edges.

Every candidate is a *feasible* pair of points, so that rounding in a thin triangle can only
lengthen a candidate, never invent a nearer one; edges are always candidates.
A value is a function of its two primitives alone: ``cut`` only lets a result above it be replaced
by infinity. Squared distances below `TOUCH` are returned as 0.

A triangle is a row of 13: corner, edge to the second corner, edge to the third, their cross
product, and how far its plane can be trusted (`FLAT`, `THIN`, `LINE`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from seerob.core.transforms import Array
from seerob.kernels.lanes import Lanes

_EDGES = ir.VectorType(ir.DoubleType(), 4)
_INDEX = ir.IntType(32)


_Points = list[Lanes]
"""By coordinate."""


def _dot(u: _Points, v: _Points) -> Lanes:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _within(x: Lanes) -> Lanes:
    return x.at_least(0.0).at_most(1.0)


def _inside(a: _Points, d: _Points, b: _Points, e: _Points) -> tuple[list[Lanes], Any, Any]:
    """Squared distance, s and t of ``a + s·d`` and ``b + t·e``; which are parallel, and which no points."""
    r = [x - y for x, y in zip(a, b, strict=True)]
    dd, ee, f, c, de = _dot(d, d), _dot(e, e), _dot(e, r), _dot(d, r), _dot(d, e)
    den = dd * ee - de * de
    s = _within((de * f - c * ee) / den)
    s = s.or_else(den.compared("<=", 0.0), 0.0)
    t = (de * s + f) / ee
    before, after = t.compared("<", 0.0), t.compared(">", 1.0)
    s = s.or_else(before, _within(c.negative() / dd)).or_else(after, _within((de - c) / dd))
    t = t.or_else(before, 0.0).or_else(after, 1.0)
    x = [u + s * v - t * w for u, v, w in zip(r, d, e, strict=True)]
    parallel = den.compared("<", dd * 1e-8 * ee)
    long = den.builder.and_(dd.compared(">=", 1e-30), ee.compared(">=", 1e-30))
    long = den.builder.and_(long, den.compared("==", den))
    return [_dot(x, x), s, t], parallel, long


def _with_ends(
    found: list[Lanes], parallel: Any, a: _Points, d: _Points, b: _Points, e: _Points
) -> list[Lanes]:
    """What is found of two segments, and of those that are parallel also by their four ends."""
    dd, ee = _dot(d, d), _dot(e, e)
    for end in (0.0, 1.0):
        for swapped, o, g, gg, p, q in ((False, b, e, ee, a, d), (True, a, d, dd, b, e)):
            r = [(x + y if end else x) - z for x, y, z in zip(p, q, o, strict=True)]
            w = _within(_dot(r, g) / gg)
            r = [x - w * y for x, y in zip(r, g, strict=True)]
            d2 = _dot(r, r)
            nearer = d2.builder.and_(parallel, d2.compared("<", found[0]))
            s, t = (w, end) if swapped else (end, w)
            found = [x.or_else(nearer, y) for x, y in zip(found, (d2, s, t), strict=True)]
    return found


class _Triangle:
    """A row of triangles while formulas of it are written."""

    def __init__(self, context: Any, builder: Any, kinds: tuple[Any, Any], values: tuple[Any, Any]) -> None:
        rows = context.make_array(kinds[0])(context, builder, values[0]).data
        index = context.cast(builder, values[1], kinds[1], types.intp)
        row = builder.gep(rows, [builder.mul(index, context.get_constant(types.intp, 13))])
        v, p, q = (
            [builder.load(builder.gep(row, [context.get_constant(types.intp, 3 * n + c)])) for c in range(3)]
            for n in range(3)
        )
        corner = [builder.fadd(v[c], p[c]) for c in range(3)]
        third = [builder.fsub(q[c], p[c]) for c in range(3)]
        self.starts, self.edges = [v, v, corner], [p, q, third]

    def in_lanes(self, builder: Any) -> tuple[list[Lanes], list[Lanes]]:
        """Where its edges begin, and they, by coordinate; the fourth lane is the first again."""
        return tuple(  # type: ignore[return-value]
            [_lanes(builder, [each[n][c] for n in (0, 1, 2, 0)]) for c in range(3)]
            for each in (self.starts, self.edges)
        )


def _lanes(builder: Any, four: list[Any]) -> Lanes:
    value = ir.Constant(_EDGES, ir.Undefined)
    for n in range(4):
        value = builder.insert_element(value, four[n], ir.Constant(_INDEX, n))
    return Lanes(builder, value)


def _nearest_of(
    context: Any, builder: Any, kind: Any, segments: list[tuple[list[Any], list[Any]]], other: _Triangle
) -> Any:
    """Squared distance of segments to the nearest edge of a triangle: settled, d², s, t, which.

    Of equal ones the first: by segment, then by edge.
    """
    b, e = other.in_lanes(builder)
    lines = [tuple([_lanes(builder, [one] * 4) for one in each] for each in segment) for segment in segments]
    begun = [_inside(a, d, b, e) for a, d in lines]
    four = ir.IntType(4)
    none, every = ir.Constant(four, 0), ir.Constant(four, -1)
    settled = every
    turned = none
    for _, parallel, long in begun:
        settled = builder.and_(settled, builder.bitcast(long, four))
        turned = builder.or_(turned, builder.bitcast(parallel, four))
    before = builder.block
    with builder.if_then(builder.icmp_signed("!=", turned, none), likely=False):
        more = [
            _with_ends(found, parallel, a, d, b, e)
            for (found, parallel, _), (a, d) in zip(begun, lines, strict=True)
        ]
        within = builder.block
    either = [
        [_either(builder, (x, before), (y, within)) for x, y in zip(found, ends, strict=True)]
        for (found, _, _), ends in zip(begun, more, strict=True)
    ]
    best: list[Lanes] = []
    for n, found in enumerate(either):
        found.append(Lanes(builder, ir.Constant(_EDGES, [3.0 * n, 3.0 * n + 1, 3.0 * n + 2, 3.0 * n])))
        less = found[0].compared("<", best[0]) if best else None
        best = [x.or_else(less, y) for x, y in zip(best, found, strict=True)] if best else found
    least = [builder.extract_element(one.value, ir.Constant(_INDEX, 0)) for one in best]
    for c in (1, 2):
        beside = [builder.extract_element(one.value, ir.Constant(_INDEX, c)) for one in best]
        tie = builder.and_(
            builder.fcmp_ordered("==", beside[0], least[0]), builder.fcmp_ordered("<", beside[3], least[3])
        )
        less = builder.or_(builder.fcmp_ordered("<", beside[0], least[0]), tie)
        least = [builder.select(less, x, y) for x, y in zip(beside, least, strict=True)]
    which = builder.fptosi(least[3], context.get_value_type(types.intp))
    known = builder.icmp_signed("==", settled, every)
    return context.make_tuple(builder, kind, [known, *least[:3], which])


def _either(builder: Any, *found: tuple[Lanes, Any]) -> Lanes:
    """What was found in the block that was gone through."""
    phi = builder.phi(_EDGES)
    for lanes, block in found:
        phi.add_incoming(lanes.value, block)
    return Lanes(builder, phi)


_FOUND = types.Tuple([types.boolean, types.float64, types.float64, types.float64, types.intp])  # type: ignore[no-untyped-call]


@intrinsic
def _nearest_in_lanes(
    _typing: Any, ax: Any, ay: Any, az: Any, dx: Any, dy: Any, dz: Any, T: Any, k: Any
) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        other = _Triangle(context, builder, signature.args[6:], values[6:])
        return _nearest_of(context, builder, _FOUND, [(values[:3], values[3:6])], other)

    points = [types.float64] * 6
    return _FOUND(*points, T, k), generate


@intrinsic
def _edges_in_lanes(_typing: Any, A: Any, i: Any, B: Any, j: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        one, other = (
            _Triangle(context, builder, signature.args[n : n + 2], values[n : n + 2]) for n in (0, 2)
        )
        segments = list(zip(one.starts, one.edges, strict=True))
        return _nearest_of(context, builder, _FOUND, segments, other)

    return _FOUND(A, i, B, j), generate


nearest_in_lanes: Any = _nearest_in_lanes
"""Squared distance of ``a + s·d`` to the nearest edge ``o + t·g`` of ``T[k]``: settled, d², s, t, edge.

Edges are those from the first corner and, last, that from the second corner to the third; the first of
equal ones is told. ``T`` is contiguous, of shape (n, 13); no index is checked.
"""
edges_in_lanes: Any = _edges_in_lanes
"""Squared distance of the edges of ``A[i]`` to those of ``B[j]``: settled, d², s, t, and which.

That is three times the edge of A plus that of B.
"""


index: Any = np.int64
"""An index of 64 bits that is no constant: for each constant a kernel would be compiled once more."""
TOUCH = 1e-24
"""Squared distance below which two primitives touch [m²]."""
FLAT = 2.0
"""The normal is accurate: the plane may be used to reject."""
THIN = 1.0
"""A sliver: its face is tried, its plane rejects nothing."""
LINE = 0.0
"""No face to speak of: its edges are all there is."""


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def point_segment(
    px: float,
    py: float,
    pz: float,
    ax: float,
    ay: float,
    az: float,
    dx: float,
    dy: float,
    dz: float,
    dd: float,
) -> tuple[float, float]:
    """Squared distance of ``p`` to ``a + t·d``, t in 0…1, and t; ``dd`` is d·d."""
    rx = px - ax
    ry = py - ay
    rz = pz - az
    t = (rx * dx + ry * dy + rz * dz) / dd if dd > 0.0 else 0.0
    t = min(max(t, 0.0), 1.0)
    rx -= t * dx
    ry -= t * dy
    rz -= t * dz
    return rx * rx + ry * ry + rz * rz, t


@njit(cache=True, nogil=True, error_model="numpy")
def segment_segment(
    ax: float,
    ay: float,
    az: float,
    dx: float,
    dy: float,
    dz: float,
    bx: float,
    by: float,
    bz: float,
    ex: float,
    ey: float,
    ez: float,
) -> tuple[float, float, float]:
    """Squared distance of ``a + s·d`` to ``b + t·e``, and s, t; either may be a point.

    Nearly parallel segments are settled by their four ends besides the interior solution, which
    cancellation makes unreliable there.
    """
    rx = ax - bx
    ry = ay - by
    rz = az - bz
    dd = dx * dx + dy * dy + dz * dz
    ee = ex * ex + ey * ey + ez * ez
    if dd < 1e-30:
        d2, t = point_segment(ax, ay, az, bx, by, bz, ex, ey, ez, ee)
        return d2, 0.0, t
    if ee < 1e-30:
        d2, s = point_segment(bx, by, bz, ax, ay, az, dx, dy, dz, dd)
        return d2, s, 0.0
    f = ex * rx + ey * ry + ez * rz
    c = dx * rx + dy * ry + dz * rz
    b = dx * ex + dy * ey + dz * ez
    den = dd * ee - b * b
    s = min(max((b * f - c * ee) / den, 0.0), 1.0) if den > 0.0 else 0.0
    t = (b * s + f) / ee
    if t < 0.0:
        t = 0.0
        s = min(max(-c / dd, 0.0), 1.0)
    elif t > 1.0:
        t = 1.0
        s = min(max((b - c) / dd, 0.0), 1.0)
    x = rx + s * dx - t * ex
    y = ry + s * dy - t * ey
    z = rz + s * dz - t * ez
    d2 = x * x + y * y + z * z
    if den < 1e-8 * dd * ee:
        for end in range(2):
            g, w = point_segment(ax + end * dx, ay + end * dy, az + end * dz, bx, by, bz, ex, ey, ez, ee)
            if g < d2:
                d2, s, t = g, float(end), w
            g, w = point_segment(bx + end * ex, by + end * ey, bz + end * ez, ax, ay, az, dx, dy, dz, dd)
            if g < d2:
                d2, s, t = g, w, float(end)
    return d2, s, t


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def over_face(
    rx: float,
    ry: float,
    rz: float,
    e0x: float,
    e0y: float,
    e0z: float,
    e1x: float,
    e1y: float,
    e1z: float,
    nx: float,
    ny: float,
    nz: float,
    nn: float,
) -> tuple[float, float]:
    """Barycentric u, v of the foot of ``r`` (from the first corner) in the plane; u < 0 when not inside."""
    u = ((ry * e1z - rz * e1y) * nx + (rz * e1x - rx * e1z) * ny + (rx * e1y - ry * e1x) * nz) / nn
    v = ((e0y * rz - e0z * ry) * nx + (e0z * rx - e0x * rz) * ny + (e0x * ry - e0y * rx) * nz) / nn
    if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
        return u, v
    return -1.0, 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _edge(T: Array, k: int, c: int) -> tuple[float, float, float, float, float, float]:
    """Where edge c of triangle ``T[k]`` begins, and the edge."""
    if c < 2:
        e = 3 + 3 * c
        return T[k, 0], T[k, 1], T[k, 2], T[k, e], T[k, e + 1], T[k, e + 2]
    return (
        T[k, 0] + T[k, 3], T[k, 1] + T[k, 4], T[k, 2] + T[k, 5],
        T[k, 6] - T[k, 3], T[k, 7] - T[k, 4], T[k, 8] - T[k, 5],
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _on_edge(T: Array, k: int, c: int, t: float) -> tuple[float, float, float]:
    """Point of edge c of triangle ``T[k]``."""
    ox, oy, oz, gx, gy, gz = _edge(T, k, c)
    return ox + t * gx, oy + t * gy, oz + t * gz


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_edge(
    ax: float, ay: float, az: float, dx: float, dy: float, dz: float, T: Array, k: int
) -> tuple[float, float, float, int]:
    """Squared distance of ``a + s·d`` to the first nearest edge of ``T[k]``, s and t there, which edge."""
    settled, best, bs, bt, bc = nearest_in_lanes(ax, ay, az, dx, dy, dz, T, k)
    if not settled:
        best = np.inf
        for c in range(3):
            ox, oy, oz, gx, gy, gz = _edge(T, k, c)
            g, s, t = segment_segment(ax, ay, az, dx, dy, dz, ox, oy, oz, gx, gy, gz)
            if g < best:
                best, bs, bt, bc = g, s, t, c
    return best, bs, bt, bc


@njit(cache=True, nogil=True, error_model="numpy")
def segment_triangle(
    ax: float, ay: float, az: float, dx: float, dy: float, dz: float, T: Array, k: int, cut: float
) -> tuple[float, float, float, float, float]:
    """Squared distance of ``a + s·d`` to triangle ``T[k]``, s, and the point of the triangle.

    Infinity when it is found to exceed ``cut``.
    """
    vx = T[k, 0]
    vy = T[k, 1]
    vz = T[k, 2]
    e0x = T[k, 3]
    e0y = T[k, 4]
    e0z = T[k, 5]
    e1x = T[k, 6]
    e1y = T[k, 7]
    e1z = T[k, 8]
    best = np.inf
    bs = px = py = pz = 0.0
    if T[k, 12] > LINE:
        nx = T[k, 9]
        ny = T[k, 10]
        nz = T[k, 11]
        nn = nx * nx + ny * ny + nz * nz
        rx = ax - vx
        ry = ay - vy
        rz = az - vz
        h0 = rx * nx + ry * ny + rz * nz
        h1 = h0 + dx * nx + dy * ny + dz * nz
        crossing = h0 * h1 < 0.0
        reject = T[k, 12] == FLAT
        if reject and not crossing:
            low = min(abs(h0), abs(h1))
            if low * low > cut * nn:
                return best, bs, px, py, pz
        for c in range(3):
            if c == 0:
                s = 0.0
                h = h0
            elif c == 1:
                s = 1.0
                h = h1
            elif crossing:
                s = h0 / (h0 - h1)
                h = 0.0
            else:
                break
            if reject and h * h > cut * nn:
                continue
            qx = rx + s * dx
            qy = ry + s * dy
            qz = rz + s * dz
            u, v = over_face(qx, qy, qz, e0x, e0y, e0z, e1x, e1y, e1z, nx, ny, nz, nn)
            if u >= 0.0:
                fx = u * e0x + v * e1x
                fy = u * e0y + v * e1y
                fz = u * e0z + v * e1z
                g = (qx - fx) ** 2 + (qy - fy) ** 2 + (qz - fz) ** 2
                if g < best:
                    best = g
                    bs = s
                    px = vx + fx
                    py = vy + fy
                    pz = vz + fz
    g, s, t, c = nearest_edge(ax, ay, az, dx, dy, dz, T, k)
    if g < best:
        best = g
        bs = s
        px, py, pz = _on_edge(T, k, c, t)
    return (0.0 if best < TOUCH else best), bs, px, py, pz


BESIDE, OVER, BEYOND = range(3)


@njit(cache=True, nogil=True, error_model="numpy")
def _side(A: Array, i: int, B: Array, j: int, cut: float) -> int:
    """Where ``B[j]`` is seen from the face of ``A[i]``.

    `BEYOND` when the plane shows that it is farther than ``cut``; `BESIDE` when nothing of it lies over the
    face, because all of it is beyond one of its three lines; else `OVER`, where something may.
    """
    if A[i, 12] == LINE:
        return BESIDE
    e0x, e0y, e0z = A[i, 3], A[i, 4], A[i, 5]
    e1x, e1y, e1z = A[i, 6], A[i, 7], A[i, 8]
    nx, ny, nz = A[i, 9], A[i, 10], A[i, 11]
    nn = nx * nx + ny * ny + nz * nz
    r0, r1, r2 = B[j, 0] - A[i, 0], B[j, 1] - A[i, 1], B[j, 2] - A[i, 2]
    h0 = r0 * nx + r1 * ny + r2 * nz
    h1 = h0 + B[j, 3] * nx + B[j, 4] * ny + B[j, 5] * nz
    h2 = h0 + B[j, 6] * nx + B[j, 7] * ny + B[j, 8] * nz
    low = max(min(h0, h1, h2), -max(h0, h1, h2))
    if A[i, 12] == FLAT and low > 0.0 and low * low > cut * nn:
        return BEYOND
    # Barycentric coordinates of the corners, times nn.
    px, py, pz = e1y * nz - e1z * ny, e1z * nx - e1x * nz, e1x * ny - e1y * nx
    qx, qy, qz = e0z * ny - e0y * nz, e0x * nz - e0z * nx, e0y * nx - e0x * ny
    u0 = r0 * px + r1 * py + r2 * pz
    v0 = r0 * qx + r1 * qy + r2 * qz
    u1 = u0 + B[j, 3] * px + B[j, 4] * py + B[j, 5] * pz
    v1 = v0 + B[j, 3] * qx + B[j, 4] * qy + B[j, 5] * qz
    u2 = u0 + B[j, 6] * px + B[j, 7] * py + B[j, 8] * pz
    v2 = v0 + B[j, 6] * qx + B[j, 7] * qy + B[j, 8] * qz
    # More than rounding can take of these and of `over_face`, which multiplies in another order.
    size = abs(r0) + abs(r1) + abs(r2)
    for c in range(3, 9):
        size += abs(B[j, c])
    turned = abs(px) + abs(py) + abs(pz) + abs(qx) + abs(qy) + abs(qz)
    away = 1e-6 * nn + 1e-14 * size * turned
    most = min(max(u0, u1, u2), max(v0, v1, v2), nn - min(u0 + v0, u1 + v1, u2 + v2))
    return BESIDE if most < -away else OVER


@njit(cache=True, nogil=True, error_model="numpy")
def _edges_through(A: Array, i: int, B: Array, j: int, cut: float, on_a: int, on_b: int, W: Array) -> float:
    """Corners of ``B[j]`` over the face of ``A[i]`` and edges of ``B[j]`` through it.

    Returns the least squared distance; writes the point on A to ``W`` from ``on_a`` on, that on B from
    ``on_b`` on.
    """
    best = np.inf
    nx = A[i, 9]
    ny = A[i, 10]
    nz = A[i, 11]
    nn = nx * nx + ny * ny + nz * nz
    r0 = B[j, 0] - A[i, 0]
    r1 = B[j, 1] - A[i, 1]
    r2 = B[j, 2] - A[i, 2]
    h0 = r0 * nx + r1 * ny + r2 * nz
    h1 = h0 + B[j, 3] * nx + B[j, 4] * ny + B[j, 5] * nz
    h2 = h0 + B[j, 6] * nx + B[j, 7] * ny + B[j, 8] * nz
    reject = A[i, 12] == FLAT
    for c in range(6):
        # Weights of B's two edges at the candidate: a corner, or where an edge meets the plane.
        if c == 0:
            p, q, h = 0.0, 0.0, h0
        elif c == 1:
            p, q, h = 1.0, 0.0, h1
        elif c == 2:
            p, q, h = 0.0, 1.0, h2
        else:
            h = 0.0
            if c == 3 and h0 * h1 < 0.0:
                p, q = h0 / (h0 - h1), 0.0
            elif c == 4 and h0 * h2 < 0.0:
                p, q = 0.0, h0 / (h0 - h2)
            elif c == 5 and h1 * h2 < 0.0:
                q = h1 / (h1 - h2)
                p = 1.0 - q
            else:
                continue
        if reject and h * h > cut * nn:
            continue
        x = r0 + p * B[j, 3] + q * B[j, 6]
        y = r1 + p * B[j, 4] + q * B[j, 7]
        z = r2 + p * B[j, 5] + q * B[j, 8]
        u, v = over_face(x, y, z, A[i, 3], A[i, 4], A[i, 5], A[i, 6], A[i, 7], A[i, 8], nx, ny, nz, nn)
        if u >= 0.0:
            fx = u * A[i, 3] + v * A[i, 6]
            fy = u * A[i, 4] + v * A[i, 7]
            fz = u * A[i, 5] + v * A[i, 8]
            g = (x - fx) ** 2 + (y - fy) ** 2 + (z - fz) ** 2
            if g < best:
                best = g
                W[on_a] = A[i, 0] + fx
                W[on_a + 1] = A[i, 1] + fy
                W[on_a + 2] = A[i, 2] + fz
                W[on_b] = A[i, 0] + x
                W[on_b + 1] = A[i, 1] + y
                W[on_b + 2] = A[i, 2] + z
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def triangles(A: Array, i: int, B: Array, j: int, cut: float, W: Array) -> tuple[float, float, float, int]:
    """Squared distance of triangles ``A[i]`` and ``B[j]`` in one frame; infinity when beyond ``cut``.

    With it, where on which edges their points are, for `on_edges`; -1 where those are in ``W[:6]``.
    ``W[6:]`` is scratch, shape (12,).
    """
    best, s, t, both = np.inf, 0.0, 0.0, -1
    of_a, of_b = _side(A, i, B, j, cut), _side(B, j, A, i, cut)
    if max(of_a, of_b) == BEYOND:
        return best, s, t, both
    if of_a == OVER:
        best = _edges_through(A, i, B, j, cut, index(0), index(3), W)
    if of_b == OVER:
        g = _edges_through(B, j, A, i, cut, index(9), index(6), W)
        if g < best:
            best = g
            for c in range(6):
                W[c] = W[6 + c]
    settled, g, p, q, which = edges_in_lanes(A, i, B, j)
    if not settled:
        g = np.inf
        for edges in range(9):
            ax, ay, az, dx, dy, dz = _edge(A, i, edges // 3)
            bx, by, bz, ex, ey, ez = _edge(B, j, edges % 3)
            h, x, y = segment_segment(ax, ay, az, dx, dy, dz, bx, by, bz, ex, ey, ez)
            if h < g:
                g, p, q, which = h, x, y, edges
    if g < best:
        best, s, t, both = g, p, q, which
    return (0.0 if best < TOUCH else best), s, t, both


@njit(cache=True, nogil=True, error_model="numpy")
def on_edges(A: Array, i: int, B: Array, j: int, s: float, t: float, both: int, W: Array) -> None:
    """Write the points that `triangles` found to ``W[:6]``, where it did not."""
    if both >= 0:
        W[0], W[1], W[2] = _on_edge(A, i, both // 3, s)
        W[3], W[4], W[5] = _on_edge(B, j, both % 3, t)
