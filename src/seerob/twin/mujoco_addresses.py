"""Where MuJoCo's functions are in memory, for `seerob.kernels.mujoco_calls`."""

from __future__ import annotations

import ctypes
import os
from functools import cache
from importlib import import_module
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

POSES = "mj_kinematics", "mj_comPos", "mj_comVel"
"""What follows from positions and velocities, in this order."""


@cache
def _library() -> ctypes.CDLL:
    own = import_module("mujoco._functions").__file__
    assert own is not None
    # Its names are found through what was linked with it; Windows looks at one file alone.
    return ctypes.CDLL(str(Path(own).parent / "mujoco.dll") if os.name == "nt" else own)


def addresses(mj: mujoco.MjModel, data: mujoco.MjData, *functions: str) -> NDArray[np.int64]:
    """Addresses of a model, of its data and of functions of MuJoCo; valid as long as both are there.

    Args:
        mj: The `mujoco.MjModel`.
        data: The `mujoco.MjData`.
        functions: Their names in C.

    Raises:
        AttributeError: MuJoCo has no such function.
    """
    found = (ctypes.cast(getattr(_library(), name), ctypes.c_void_p).value for name in functions)
    return np.array([mj._address, data._address, *found], np.int64)
