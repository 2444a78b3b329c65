"""Several numbers at a time, written as formulas and compiled to vector instructions.

Numba leaves it to the compiler to find loops that eight lanes could do at once; in loops of eight it does
not look. An intrinsic that makes its formula of `Lanes` needs nobody to find them, on any processor.
Each lane rounds as its formula in scalars would: nothing is reordered or contracted but `plus_product`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

WIDTH = 8
HUGE = 1e30
"""A square from which on single precision means nothing."""
_SINGLE = ir.FloatType()
_VECTOR = ir.VectorType(_SINGLE, WIDTH)


class Lanes:
    """Numbers of one vector while their formula is written; what it is combined with may be one number."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def _of(self, other: Lanes | float) -> Any:
        kind = self.value.type
        return other.value if isinstance(other, Lanes) else ir.Constant(kind, [float(other)] * kind.count)

    def __add__(self, other: Lanes | float) -> Lanes:
        return Lanes(self.builder, self.builder.fadd(self.value, self._of(other)))

    def __sub__(self, other: Lanes | float) -> Lanes:
        return Lanes(self.builder, self.builder.fsub(self.value, self._of(other)))

    def __mul__(self, other: Lanes | float) -> Lanes:
        return Lanes(self.builder, self.builder.fmul(self.value, self._of(other)))

    def __truediv__(self, other: Lanes | float) -> Lanes:
        return Lanes(self.builder, self.builder.fdiv(self.value, self._of(other)))

    def __abs__(self) -> Lanes:
        return self._call("llvm.fabs", self)

    def negative(self) -> Lanes:
        """The opposite number."""
        return Lanes(self.builder, self.builder.fneg(self.value))

    def sqrt(self) -> Lanes:
        """The square root."""
        return self._call("llvm.sqrt", self)

    def at_least(self, other: Lanes | float) -> Lanes:
        """The larger; what is no number stays that."""
        return self._where("<", other)

    def at_most(self, other: Lanes | float) -> Lanes:
        """The smaller; what is no number stays that."""
        return self._where(">", other)

    def plus_product(self, a: Lanes, b: Lanes) -> Lanes:
        """``self + a·b``, rounded once where the processor can."""
        return self._call("llvm.fmuladd", a, b, self)

    def compared(self, comparison: str, other: Lanes | float) -> Any:
        """Truth by lane; false where either is no number."""
        return self.builder.fcmp_ordered(comparison, self.value, self._of(other))

    def or_else(self, where: Any, other: Lanes | float) -> Lanes:
        """Take ``other`` in the lanes where a comparison is true."""
        return Lanes(self.builder, self.builder.select(where, self._of(other), self.value))

    def _where(self, comparison: str, other: Lanes | float) -> Lanes:
        return self.or_else(self.compared(comparison, other), other)

    def _call(self, name: str, *given: Lanes) -> Lanes:
        vector = self.value.type
        kind = ir.FunctionType(vector, [vector] * len(given))
        name = f"{name}.v{vector.count}{'f32' if vector.element == _SINGLE else 'f64'}"
        function: Any = cgutils.get_or_insert_function(self.builder.module, kind, name)  # type: ignore[no-untyped-call]
        return Lanes(self.builder, self.builder.call(function, [one.value for one in given]))


def of_rows(m: int, n: int, formula: Callable[[list[Lanes], list[Lanes]], Lanes], *, rows: int = 1) -> Any:
    """Compiled ``f(table, i, given, cut, out)`` that writes what a formula gives of row i to ``out``.

    Args:
        m: By eight, the numbers of a row.
        n: The numbers given.
        formula: Of the row's numbers by eight, and of the numbers given, each in all lanes.
        rows: Of two, ``f(table, i, j, given, cut, out)`` does both at once: what a processor waits for in one
            row, it computes of the other meanwhile.

    What is no number of single precision becomes 0, which bounds nothing. It returns the lanes that do not
    exceed ``cut`` as bits; rounding may add a lane that exceeds it by 1e-6 of it.
    Its arrays are contiguous and of single precision: ``table`` of shape (k, 8·m), ``given`` of shape (n,),
    ``out`` of shape (8·rows,). Nothing checks an index.
    """
    width = WIDTH * rows
    vector = ir.VectorType(_SINGLE, width)
    whole = ir.IntType(32)
    zero = ir.Constant(whole, 0)

    def spread(builder: Any, number: Any) -> Lanes:
        one = builder.insert_element(ir.Constant(vector, ir.Undefined), number, zero)
        everywhere = ir.Constant(ir.VectorType(whole, width), [0] * width)
        return Lanes(builder, builder.shuffle_vector(one, one, everywhere))

    def written(context: Any, builder: Any, kinds: Any, values: Any) -> Any:
        start = [
            context.make_array(kind)(context, builder, value).data if isinstance(kind, types.Array) else value
            for kind, value in zip(kinds, values, strict=True)
        ]
        table, *indices, given, cut, out = start

        def at(base: Any, k: int) -> Any:
            return builder.gep(base, [context.get_constant(types.intp, k)])

        read = []
        for index, kind in zip(indices, kinds[1:], strict=False):
            i = builder.mul(
                context.cast(builder, index, kind, types.intp), context.get_constant(types.intp, WIDTH * m)
            )
            row = builder.gep(table, [i])
            read.append(
                [
                    builder.load(builder.bitcast(at(row, WIDTH * k), _VECTOR.as_pointer()), align=4)
                    for k in range(m)
                ]
            )
        every = ir.Constant(ir.VectorType(whole, width), [*range(width)])
        lanes = [
            Lanes(builder, each[0] if rows == 1 else builder.shuffle_vector(*each, every))
            for each in zip(*read, strict=True)
        ]
        scalars = [spread(builder, builder.load(at(given, k))) for k in range(n)]
        result = formula(lanes, scalars)
        nothing = ir.Constant(vector, [0.0] * width)
        told = builder.fcmp_ordered("<", result.value, ir.Constant(vector, [HUGE] * width))
        result = Lanes(builder, builder.select(told, result.value, nothing))
        builder.store(result.value, builder.bitcast(out, vector.as_pointer()), align=4)
        above = builder.fmul(cut, ir.Constant(cut.type, 1.0 + 1e-6))
        limit = spread(builder, builder.fptrunc(above, _SINGLE))
        hits = builder.fcmp_ordered("<=", result.value, limit.value)
        return builder.zext(builder.bitcast(hits, ir.IntType(width)), ir.IntType(64))

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return written(context, builder, signature.args, values)

    if rows == 1:

        @intrinsic
        def of_one(_typing: Any, table: Any, i: Any, given: Any, cut: Any, out: Any) -> Any:
            return types.int64(table, i, given, types.float64, out), generate

        return of_one

    @intrinsic
    def of_two(_typing: Any, table: Any, i: Any, j: Any, given: Any, cut: Any, out: Any) -> Any:
        return types.int64(table, i, j, given, types.float64, out), generate

    return of_two


@intrinsic
def _first_lane(_typing: Any, hits: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), generate


first_lane: Any = _first_lane
"""The lowest bit that is set; of one bit at least."""


def asked_soon(m: int) -> Any:
    """Compiled ``f(table, i)`` that asks memory for row i of `of_rows` ahead of when it is looked at."""

    @intrinsic
    def asked(_typing: Any, table: Any, i: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            base = context.make_array(signature.args[0])(context, builder, values[0]).data
            index = context.cast(builder, values[1], signature.args[1], types.intp)
            row = builder.mul(index, context.get_constant(types.intp, WIDTH * m))
            byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
            kind = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
            prefetch: Any = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")  # type: ignore[no-untyped-call]
            to_read, keep, data = (ir.Constant(number, k) for k in (0, 3, 1))
            for k in range(0, WIDTH * m, 16):  # lines of 64 bytes
                line = builder.gep(base, [builder.add(row, context.get_constant(types.intp, k))])
                builder.call(prefetch, [builder.bitcast(line, byte), to_read, keep, data])
            return context.get_dummy_value()

        return types.void(table, i), generate

    return asked
