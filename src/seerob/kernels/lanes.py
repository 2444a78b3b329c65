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


def of_rows(m: int, n: int, formula: Callable[[list[Lanes], list[Lanes]], Lanes]) -> Any:
    """Compiled ``f(rows, i, given, cut, out)`` that writes what a formula gives of row i to ``out``.

    Args:
        m: By eight, the numbers of a row.
        n: The numbers given.
        formula: Of the row's numbers by eight, and of the numbers given, each in all lanes.

    It returns the lanes that do not exceed ``cut``, or are no number of single precision, as bits; rounding
    may add a lane that exceeds it by 1e-6 of it.
    Its arrays are contiguous and of single precision: ``rows`` of shape (k, 8·m), ``given`` of shape (n,),
    ``out`` of shape (8,). Nothing checks an index.
    """

    @intrinsic
    def written(_typing: Any, rows: Any, i: Any, given: Any, cut: Any, out: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            start = [
                context.make_array(kind)(context, builder, value).data
                if isinstance(kind, types.Array)
                else value
                for kind, value in zip(signature.args, values, strict=True)
            ]
            index = context.cast(builder, start[1], signature.args[1], types.intp)

            def at(base: Any, k: int) -> Any:
                return builder.gep(base, [context.get_constant(types.intp, k)])

            row = builder.gep(start[0], [builder.mul(index, context.get_constant(types.intp, WIDTH * m))])
            lanes = [
                Lanes(
                    builder, builder.load(builder.bitcast(at(row, WIDTH * k), _VECTOR.as_pointer()), align=4)
                )
                for k in range(m)
            ]
            scalars = []
            zero = ir.Constant(ir.IntType(32), 0)
            everywhere = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
            for k in range(n):
                one = builder.insert_element(
                    ir.Constant(_VECTOR, ir.Undefined), builder.load(at(start[2], k)), zero
                )
                scalars.append(Lanes(builder, builder.shuffle_vector(one, one, everywhere)))
            result = formula(lanes, scalars)
            builder.store(result.value, builder.bitcast(start[4], _VECTOR.as_pointer()), align=4)
            above = builder.fmul(start[3], ir.Constant(start[3].type, 1.0 + 1e-6))
            above = builder.insert_element(
                ir.Constant(_VECTOR, ir.Undefined), builder.fptrunc(above, _SINGLE), zero
            )
            limit = Lanes(builder, builder.shuffle_vector(above, above, everywhere))
            hits = builder.or_(
                builder.fcmp_unordered("<=", result.value, limit.value),
                builder.fcmp_unordered(">=", result.value, ir.Constant(_VECTOR, [HUGE] * WIDTH)),
            )
            bits = builder.zext(builder.bitcast(hits, ir.IntType(WIDTH)), ir.IntType(64))
            return bits

        return types.int64(rows, i, given, types.float64, out), generate

    return written


@intrinsic
def _first_lane(_typing: Any, hits: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), generate


first_lane: Any = _first_lane
"""The lowest bit that is set; of one bit at least."""
