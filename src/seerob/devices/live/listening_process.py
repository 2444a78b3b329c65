"""The process in which one live source listens, started by `seerob.devices.live.source_process`.

It is told on its standard input what to listen to, and ends when that is closed: with whoever started it. It
asks the machine to let its thread compute as soon as a packet has come, ahead of others' longer work.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import importlib.util
import logging
import os
import pickle
import platform
import select
import sys
from threading import Lock
from typing import BinaryIO

import msgspec

from seerob.devices.live.listening import Listener, LiveSource, stop
from seerob.devices.live.source_process import LINE_EVERY, Order, ProcessMessage, SharedMailbox
from seerob.workstation.source import Target

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


class _LogForwarder(logging.Handler):
    """Logs by telling the other process."""

    def __init__(self, to: BinaryIO) -> None:
        super().__init__()
        self._to, self._lines = to, Lock()
        self._encoder = msgspec.json.Encoder()

    def say(self, said: ProcessMessage) -> None:
        """One line.

        Raises:
            OSError: Nobody is left to be told.
        """
        with self._lines:
            self._to.write(self._encoder.encode(said) + b"\n")

    def emit(self, record: logging.LogRecord) -> None:
        """Called by the log."""
        try:
            trace = logging.Formatter().formatException(record.exc_info) if record.exc_info else None
            self.say(
                ProcessMessage(
                    logger=record.name, level=record.levelno, text=record.getMessage(), trace=trace
                )
            )
        except Exception:  # as every handler does: a log is no reason to end
            self.handleError(record)


def _listener(order: Order) -> Listener:
    """What it is to do.

    Raises:
        Exception: Whatever stands in the way of knowing that here.
    """
    sys.path[:] = order.path
    source: LiveSource
    target: Target | None
    source, target = pickle.loads(order.pair)  # noqa: S301 - of the process that started this one
    for module in source.loads:
        with contextlib.suppress(ImportError):  # the source itself will say so
            importlib.import_module(module)
    if importlib.util.find_spec("sniffio") is None:
        # httpcore, where it is loaded, looks for it in every folder of modules, several times a request.
        sys.modules["sniffio"] = None  # type: ignore[assignment]
    # All of this stays: it need not be looked through while somebody listens.
    gc.collect()
    gc.freeze()
    box = SharedMailbox(order.memory)
    return Listener(source, target, box.post, again=order.again, known=order.known, waits=box.waits)


def main() -> int:
    """Listen until nobody wants it any more; the exit code."""
    # What a library prints is no answer.
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0) as out:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        forwarder = _LogForwarder(out)
        try:
            order = Order(*pickle.load(sys.stdin.buffer))  # noqa: S301 - of the process that started this one
        except EOFError:  # nobody wants it already
            return 0
        logging.basicConfig(level=order.level, handlers=[forwarder])
        try:
            listener = _listener(order)
        except Exception:
            logging.getLogger("seerob.devices.live").exception(
                "a source cannot be listened to in a process of its own"
            )
            return 1
        os.close(order.memory)
        wake_promptly()
        listener.start()
        with contextlib.suppress(OSError):
            forwarder.say(ProcessMessage(ready=True))
            while not select.select([sys.stdin], [], [], LINE_EVERY)[0]:
                forwarder.say(ProcessMessage(line=listener.line()))
        stop((listener,))
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # a listener that does not end holds nobody up
