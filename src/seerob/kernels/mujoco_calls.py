"""MuJoCo's own functions, called inside of compiled loops by their addresses.

A call from Python costs as much as what many of them compute. Numba keeps what it compiled and would keep an
address with it that is another one in the next process: so addresses are arguments.
What MuJoCo reports as an error inside of such a call ends the process, for only its Python functions turn it
into an exception. So nothing is called here that can fail in one state and not in another: kinematics take no
memory, Newton–Euler and passive forces the same in every state, and who calls these has called them from
Python once. A step of the physics takes as much memory as its contacts do: it is called from Python, but
where nothing can touch (`seerob.kernels.pull.STEP`).
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_POINTER = ir.IntType(8).as_pointer()


def _call(builder: Any, function: Any, arguments: list[Any]) -> None:
    kind = ir.FunctionType(ir.VoidType(), [one.type for one in arguments])
    builder.call(builder.inttoptr(function, kind.as_pointer()), arguments)


@intrinsic
def _updated(_typing: Any, function: Any, model: Any, data: Any) -> Any:
    def generate(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        _call(builder, values[0], [builder.inttoptr(one, _POINTER) for one in values[1:]])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


@intrinsic
def _newton_euler(_typing: Any, function: Any, model: Any, data: Any, torques: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        own = [builder.inttoptr(one, _POINTER) for one in values[1:3]]
        into = context.make_array(signature.args[3])(context, builder, values[3]).data
        _call(builder, values[0], [*own, ir.Constant(ir.IntType(32), 1), builder.bitcast(into, _POINTER)])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64, torques), generate


updated: Any = _updated
"""Compiled ``updated(function, model, data)``: calls what takes these two and gives nothing."""
newton_euler: Any = _newton_euler
"""Compiled ``newton_euler(mj_rne, model, data, torques)``: the torques that positions, velocities and
accelerations need, contiguous and of double precision, of shape (nv,) [N·m or N]."""
