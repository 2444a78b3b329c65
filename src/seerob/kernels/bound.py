"""Named arrays whose addresses a kernel is given once, instead of every array at every call.

To take one array out of its Python object costs a call as much as measuring a distance does, and what a
kernel takes so it counts references of. So they are bound: a `Layout` writes addresses and lengths of a named
tuple of arrays to a table, and inside of a kernel its `read` gives the named tuple again, for nothing.
Who made the table keeps the arrays as long as it is used: nothing else does.

Named tuples that are given at every call are as they are in Python: `tuple_type` is their type.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import from_dtype, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array
from numpy.typing import DTypeLike, NDArray

COLUMNS = 4
"""Of a table: address, and up to three lengths."""


def tuple_type(kind: type, fields: Sequence[Any]) -> Any:
    """Numba's type of a named tuple, by the types of its fields."""
    return types.BaseTuple.from_types(fields, kind)  # type: ignore[no-untyped-call]


class Layout:
    """How a named tuple of arrays lies in rows of a table.

    Args:
        kind: The named tuple.
        arrays: Type of the numbers and number of dimensions of each of its fields, in their order.
    """

    def __init__(self, kind: type, arrays: Sequence[tuple[DTypeLike, int]]) -> None:
        self.kind = kind
        self.arrays = [(np.dtype(number), ndim) for number, ndim in arrays]
        self.read = _reader(kind, self.arrays)
        """Compiled ``read(table, row)``: the named tuple whose first array is in that row."""

    def rows(self, given: tuple[Any, ...]) -> NDArray[np.int64]:
        """Rows of a table that bind these arrays.

        Raises:
            TypeError: Another named tuple, or an array that is not contiguous or not of this layout.
        """
        if type(given) is not self.kind or len(given) != len(self.arrays):
            raise TypeError(f"a {self.kind.__name__} is expected, not {type(given).__name__}")
        rows = np.zeros((len(self.arrays), COLUMNS), np.int64)
        for row, array, (number, ndim) in zip(rows, tuple(given), self.arrays, strict=True):
            if array.dtype != number or array.ndim != ndim or not array.flags.c_contiguous:
                raise TypeError(f"a contiguous array of {ndim} dimensions of {number} is expected")
            row[0] = array.ctypes.data
            row[1 : 1 + ndim] = array.shape
        return rows


def _reader(kind: type, arrays: list[tuple[np.dtype[Any], int]]) -> Any:
    kinds = [types.Array(from_dtype(number), ndim, "C") for number, ndim in arrays]
    result = tuple_type(kind, kinds)

    @intrinsic
    def read(_typing: Any, table: Any, row: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            base = context.make_array(signature.args[0])(context, builder, values[0]).data
            first = builder.mul(
                context.cast(builder, values[1], signature.args[1], types.intp),
                context.get_constant(types.intp, COLUMNS),
            )

            def entry(n: int) -> Any:
                return builder.load(
                    builder.gep(base, [builder.add(first, context.get_constant(types.intp, n))])
                )

            made = []
            for n, array in enumerate(kinds):
                one = context.make_array(array)(context, builder)
                size = context.get_abi_sizeof(context.get_data_type(array.dtype))
                shape = [entry(COLUMNS * n + 1 + k) for k in range(array.ndim)]
                strides = [context.get_constant(types.intp, size)]
                for length in shape[:0:-1]:
                    strides.insert(0, builder.mul(strides[0], length))
                populate_array(  # type: ignore[no-untyped-call]
                    one,
                    data=builder.inttoptr(entry(COLUMNS * n), one.data.type),
                    shape=cgutils.pack_array(builder, shape),  # type: ignore[no-untyped-call]
                    strides=cgutils.pack_array(builder, strides),  # type: ignore[no-untyped-call]
                    itemsize=context.get_constant(types.intp, size),
                    meminfo=None,
                )
                made.append(one._getvalue())
            return context.make_tuple(builder, result, made)

        return result(table, row), generate

    return read
