"""The process in which one live source listens, started by `seerob.devices.live.source_process`.

It is told on its standard input what to listen to, and ends when that is closed: with whoever started it.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import logging
import os
import pickle
import sys
from threading import Lock
from typing import BinaryIO

import msgspec

from seerob.devices.live.listening import Listener, LiveSource, stop
from seerob.devices.live.shared_mailbox import SharedMailbox
from seerob.devices.live.source_process import Order, Said
from seerob.devices.live.wake_promptly import wake_promptly
from seerob.workstation.source import Target


class _Told(logging.Handler):
    """Logs by telling the other process."""

    def __init__(self, to: BinaryIO) -> None:
        super().__init__()
        self._to, self._lines = to, Lock()
        self._encoder = msgspec.json.Encoder()

    def say(self, said: Said) -> None:
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
            self.say(Said(logger=record.name, level=record.levelno, text=record.getMessage(), trace=trace))
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
    # All of this stays: it need not be looked through while somebody listens.
    gc.collect()
    gc.freeze()
    return Listener(source, target, SharedMailbox(order.memory).post, again=order.again, known=order.known)


def main() -> int:
    """Listen until nobody wants it any more; the exit code."""
    # What a library prints is no answer.
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0) as out:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        told = _Told(out)
        try:
            order = Order(*pickle.load(sys.stdin.buffer))  # noqa: S301 - of the process that started this one
        except EOFError:  # nobody wants it already
            return 0
        logging.basicConfig(level=order.level, handlers=[told])
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
            told.say(Said(ready=True))
            sys.stdin.buffer.read(1)
        stop((listener,))
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # a listener that does not end holds nobody up
