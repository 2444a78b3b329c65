"""Which inner loops nearly every run needs, and a process that compiles them before they are asked for.

    python -m seerob.kernels._beforehand

Numba compiles one loop at a time in a process, and a run needs its loops one after the other: on a machine
where none is kept yet, several of these processes share them. Each reads lines ``module function`` and
answers each with a line. A loop that is not listed, or asked with other types, is compiled when it is called.
"""

from __future__ import annotations

import gc
import sys
from importlib import import_module

LOOPS = {
    "nearest nearest": ("(f8[:,:,::1], f8[:,::1], i8, i8[:,::1], f8[::1], f8[:,::1], i8[:,::1], i1[::1])"),
    "depth deepest": ("(i8[:,::1], f8[:,:,::1], f8[:,::1], i8[:,::1], f8, i8, f8[:,::1], f8[::1], f8[::1])"),
    "tree build_tree": "(f8[:,::1], i4[:,::1])",
    "tree component_of": "(i8[:,::1], i8)",
    "hull quickhull": "(f8[:,::1], i8[::1], f8)",
    "wide widen": "(f8[:,::1], i4[:,::1], f8[:,::1])",
    "axes felt": "",
    "chain at_point": "",
    "moving move_points": "",
    "spans joint_bounds": "",
    "separation separations": "",
    "verdicts judged_many": "",
    "ahead farthest": "",
    "speed fastest": "",
    "speed carried": "(f8[:,::1], f8[:,::1], i8, f8[:,::1])",
    "pull along": "",
    "paint raster": "(f8[:,::1], f8[::1], f8[::1], i4[:,::1], i4[::1], f8[:,::1], f8[:,::1], i4[:,::1])",
    "approach relative_speeds": (
        "(f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,::1], i8[:,::1], f8[:,::1], i8[::1], f8[::1], f8[::1])"
    ),
    "approach lowest_points": "(i8[::1], f8[:,:,::1], f8[:,::1], f8[:,::1], i8[::1], f8[::1], f8[::1])",
    "contact_speeds permissible_speeds": (
        "(f8[::1], f8[:,:,::1], b1[:,::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1])"
    ),
    "contact_speeds governing": "(f8[:,::1], b1[:,::1], i8[::1], f8[:,::1], i8[:,::1], f8)",
    "arm postures": (
        "(f8[:,::1], f8[:,::1], f8[:,:,::1], i8[::1], i8[::1], f8[:,::1], f8[:,::1], b1[::1],"
        " f8[:,:,::1], f8[:,::1], f8[:,:,::1], f8[:,:,::1])"
    ),
    "arm nearest_point": "(f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1], f8[:,::1], f8[::1])",
    "posture_angles directions": "(f8[:,:,:,::1], f8[:,:,::1], i8[::1], f8[:,:,::1], f8[:,::1])",
    "posture_angles in_range": "(f8[:,::1], f8[:,::1], f8[:,::1])",
    "paint cover": "(f8[:,::1], f8[::1], i4[:,::1], i4[:,::1])",
    "paint nearest_of": "(f8[:,::1], f8[::1], i8[::1], f8[:,::1], i8[:,::1])",
    "paint stroke": "(f4[:,:,::1], f8[:,::1], f8[:,::1], f8[::1], f8[::1], f8, f8, f8, f8)",
    "paint averaged": "(f4[:,:,::1], i8)",
    "paint glaze": "(f4[:,:,::1], f8[:,::1], i4[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8)",
    "paint outline": "(f4[:,:,::1], i4[:,::1], f8[:,::1])",
    "paint solid": "(f4[:,:,::1], i4[:,::1], f8[:,::1], f8[:,::1])",
    "paint darken": "(f4[:,:,::1], i4[:,::1], f8)",
}
"""Module and function, those that take longest first, and the types that it is called with; no types where
its decorator has them, and those of its module are compiled by importing it."""


PLANNING = {
    "ways connect": (
        "(f8[:,:,::1], i8[:,::1], i8[::1], u8[::1], f8[::1], f8[::1], f8, i8, f8[::1], f8, b1, i8[:,::1])"
    ),
    "ways least_on": "(f8[:,::1], f8[::1], f8, i8[:,::1])",
    "ways is_clear": "(f8[::1], f8[::1], f8[::1], f8, b1, i8[:,::1])",
    "ways too_near": "(f8[::1], f8[::1], i8[:,::1])",
}
"""Of plans alone, likewise; a wheel does not bring them: they and the next would add 1.5 MB."""

PLANNING_IN_TIME = {
    "ways clear_at": (
        "(f8[:,::1], f8[:,:,:,::1], f8[:,:,::1], i8[::1], i8[::1], f8[::1], b1[::1], b1, i8[:,::1])"
    ),
    "ways judged": (
        "(f8[::1], f8[:,:,::1], f8[:,::1], i8[::1], i8[::1], i8[::1], f8[::1], f8[::1], i1[::1], i8[:,::1])"
    ),
    "ways stand": "(f8[:,:,::1], f8[:,::1], i8[::1], i8[::1], i8[:,::1])",
}
"""Of plans beside others who move, beside `PLANNING`."""


def compile_loop(name: str) -> None:
    """Compile one of `LOOPS`, `PLANNING` and `PLANNING_IN_TIME`, or load it."""
    from numba.core.sigutils import normalize_signature

    module, function = name.split()
    loop = getattr(import_module(f"seerob.kernels.{module}"), function)
    if types := {**LOOPS, **PLANNING, **PLANNING_IN_TIME}[name]:
        # Types, not text: Numba keeps it under what it is given, and a call gives types.
        loop.compile(normalize_signature(types)[0])  # type: ignore[no-untyped-call]


def main() -> None:
    """Compile what is asked for, until nothing is asked for any more."""
    gc.disable()  # what is made lives on, and looking through it took 4 to 7 % of the time
    for line in sys.stdin:
        compile_loop(line.strip())
        print(line.strip(), flush=True)  # noqa: T201 - to whoever asked


if __name__ == "__main__":
    main()
