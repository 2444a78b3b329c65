"""Asking the machine to let a thread compute as soon as a packet has come, ahead of others' longer work."""

from __future__ import annotations

import ctypes
import os
import platform
import sys

SLICE = 100_000
"""The shortest turn that the kernel grants [ns]: who asks for short turns is let in before a longer one of
somebody else is over."""
_CALLS = {"x86_64": 314, "aarch64": 274, "riscv64": 274}
"""Number of ``sched_setattr`` by machine; the C library has no name for it before 2.41."""


class _Attributes(ctypes.Structure):
    """``struct sched_attr`` of ``linux/sched/types.h``, in its first edition."""

    _fields_ = (
        ("size", ctypes.c_uint32),
        ("policy", ctypes.c_uint32),
        ("flags", ctypes.c_uint64),
        ("nice", ctypes.c_int32),
        ("priority", ctypes.c_uint32),
        ("runtime", ctypes.c_uint64),
        ("deadline", ctypes.c_uint64),
        ("period", ctypes.c_uint64),
    )


def wake_promptly() -> bool:
    """For this thread, and those that it starts; whether the machine took note of it.

    Linux does from 6.12 on, and asks for no privilege; before, it takes note and does nothing. Who was given
    a policy of its own (``chrt``) keeps it.
    """
    number = _CALLS.get(platform.machine())
    if sys.platform != "linux" or number is None or os.sched_getscheduler(0) != os.SCHED_OTHER:
        return False
    wanted = _Attributes(
        size=ctypes.sizeof(_Attributes),
        policy=os.SCHED_OTHER,
        nice=os.getpriority(os.PRIO_PROCESS, 0),
        runtime=SLICE,
    )
    return bool(ctypes.CDLL(None).syscall(number, 0, ctypes.byref(wanted), 0) == 0)
