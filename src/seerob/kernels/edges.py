"""A segment and the three edges of a triangle, in four lanes of double precision.

Three of four lanes hold an edge, the last the first edge again. Where an edge or the segment is a point, or
where they are nearly parallel, lanes settle nothing, and `seerob.kernels.primitives` does it one by one.
What they do settle is, bit for bit, what `seerob.kernels.primitives.segment_segment` gives.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from seerob.kernels.lanes import Lanes

_EDGES = ir.VectorType(ir.DoubleType(), 4)
_INDEX = ir.IntType(32)


def _formula(a: list[Lanes], d: list[Lanes], b: list[Lanes], e: list[Lanes]) -> tuple[Any, list[Lanes]]:
    """Where lanes settle it, and squared distance, s and t of ``a + s·d`` and ``b + t·e``."""

    def dot(u: list[Lanes], v: list[Lanes]) -> Lanes:
        return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]

    def within(x: Lanes) -> Lanes:
        return x.at_least(0.0).at_most(1.0)

    r = [x - y for x, y in zip(a, b, strict=True)]
    dd, ee, f, c, de = dot(d, d), dot(e, e), dot(e, r), dot(d, r), dot(d, e)
    den = dd * ee - de * de
    s = within((de * f - c * ee) / den)
    t = (de * s + f) / ee
    before, after = t.compared("<", 0.0), t.compared(">", 1.0)
    s = s.or_else(before, within(c.negative() / dd)).or_else(after, within((de - c) / dd))
    t = t.or_else(before, 0.0).or_else(after, 1.0)
    x = [u + s * v - t * w for u, v, w in zip(r, d, e, strict=True)]
    builder = den.builder
    settled = builder.and_(
        den.compared(">=", dd * 1e-8 * ee),
        builder.and_(dd.compared(">=", 1e-30), ee.compared(">=", 1e-30)),
    )
    return settled, [dot(x, x), s, t]


@intrinsic
def _nearest_in_lanes(
    _typing: Any, ax: Any, ay: Any, az: Any, dx: Any, dy: Any, dz: Any, T: Any, k: Any
) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows = context.make_array(signature.args[6])(context, builder, values[6]).data
        index = context.cast(builder, values[7], signature.args[7], types.intp)
        row = builder.gep(rows, [builder.mul(index, context.get_constant(types.intp, 13))])
        v, p, q = (
            [builder.load(builder.gep(row, [context.get_constant(types.intp, 3 * n + c)])) for c in range(3)]
            for n in range(3)
        )
        corner = [builder.fadd(v[c], p[c]) for c in range(3)]
        third = [builder.fsub(q[c], p[c]) for c in range(3)]

        def lanes(*four: Any) -> Lanes:
            value = ir.Constant(_EDGES, ir.Undefined)
            for n in range(4):
                value = builder.insert_element(value, four[n], ir.Constant(_INDEX, n))
            return Lanes(builder, value)

        a, d = ([lanes(*[one] * 4) for one in values[n : n + 3]] for n in (0, 3))
        b = [lanes(v[c], v[c], corner[c], v[c]) for c in range(3)]
        e = [lanes(p[c], q[c], third[c], p[c]) for c in range(3)]
        settled, found = _formula(a, d, b, e)
        four = ir.IntType(4)
        every = builder.icmp_signed("==", builder.bitcast(settled, four), ir.Constant(four, -1))
        best = [builder.extract_element(one.value, ir.Constant(_INDEX, 0)) for one in found]
        edge = context.get_constant(types.intp, 0)
        for n in (1, 2):
            other = [builder.extract_element(one.value, ir.Constant(_INDEX, n)) for one in found]
            less = builder.fcmp_ordered("<", other[0], best[0])
            best = [builder.select(less, x, y) for x, y in zip(other, best, strict=True)]
            edge = builder.select(less, context.get_constant(types.intp, n), edge)
        return context.make_tuple(builder, signature.return_type, [every, *best, edge])

    kind = types.Tuple([types.boolean, types.float64, types.float64, types.float64, types.intp])  # type: ignore[no-untyped-call]
    points = [types.float64] * 6
    return kind(*points, T, k), generate


nearest_in_lanes: Any = _nearest_in_lanes
"""Squared distance of ``a + s·d`` to the nearest edge ``o + t·g`` of ``T[k]``: settled, d², s, t, edge.

Edges are those from the first corner and, last, that from the second corner to the third; the first of
equal ones is told. ``T`` is contiguous, of shape (n, 13); no index is checked.
"""
