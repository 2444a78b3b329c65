"""Eight numbers of single precision at a time, written as formulas and compiled to vector instructions.

Numba leaves it to the compiler to find loops that eight lanes could do at once; in loops of eight it does
not look. An intrinsic that makes its formula of `Lanes` needs nobody to find them, on any processor.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

WIDTH = 8
_SINGLE = ir.FloatType()
_VECTOR = ir.VectorType(_SINGLE, WIDTH)


class Lanes:
    """Eight numbers while their formula is written down; what it is combined with may be one number."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def _of(self, other: Lanes | float) -> Any:
        return other.value if isinstance(other, Lanes) else ir.Constant(_VECTOR, [float(other)] * WIDTH)

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

    def _where(self, comparison: str, other: Lanes | float) -> Lanes:
        bound = self._of(other)
        worse = self.builder.fcmp_ordered(comparison, self.value, bound)
        return Lanes(self.builder, self.builder.select(worse, bound, self.value))

    def _call(self, name: str, *given: Lanes) -> Lanes:
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * len(given))
        function: Any = cgutils.get_or_insert_function(self.builder.module, kind, f"{name}.v{WIDTH}f32")  # type: ignore[no-untyped-call]
        return Lanes(self.builder, self.builder.call(function, [one.value for one in given]))


def of_rows(m: int, n: int, formula: Callable[[list[Lanes], list[Lanes]], Lanes]) -> Any:
    """Compiled ``f(rows, i, given, out)`` that writes what a formula gives of row i to ``out``.

    Args:
        m: By eight, the numbers of a row.
        n: The numbers given.
        formula: Of the row's numbers by eight, and of the numbers given, each in all lanes.

    Its arrays are contiguous and of single precision: ``rows`` of shape (k, 8·m), ``given`` of shape (n,),
    ``out`` of shape (8,). Nothing checks an index.
    """

    @intrinsic
    def written(_typing: Any, rows: Any, i: Any, given: Any, out: Any) -> Any:
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
            builder.store(result.value, builder.bitcast(start[3], _VECTOR.as_pointer()), align=4)
            return context.get_dummy_value()

        return types.void(rows, i, given, out), generate

    return written
