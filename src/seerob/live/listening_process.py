"""The process in which live sources listen, started by `seerob.live.apart`.

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
from collections.abc import Iterable
from threading import Lock
from typing import BinaryIO

import msgspec

from seerob.live.apart import Order, Pair, Said
from seerob.live.listening import PROMPT, Listeners
from seerob.live.shared_mailbox import SharedMailbox


class _Told(logging.Handler):
    """Logs by telling the other process."""

    def __init__(self, to: BinaryIO) -> None:
        super().__init__()
        self._to, self._lines = to, Lock()
        self._encoder = msgspec.json.Encoder()

    def say(self, said: Said) -> None:
        """One line."""
        with self._lines:
            self._to.write(self._encoder.encode(said) + b"\n")

    def emit(self, record: logging.LogRecord) -> None:
        """Called by the log."""
        trace = logging.Formatter().formatException(record.exc_info) if record.exc_info else None
        text = record.getMessage()
        try:
            self.say(Said(logger=record.name, level=record.levelno, text=text, trace=trace))
        except OSError:  # nobody is left to be told
            self.handleError(record)


def _load(modules: Iterable[str]) -> None:
    for module in modules:
        with contextlib.suppress(ImportError):  # whoever needs it will say so
            importlib.import_module(module)
    # All of this stays: it need not be looked through while somebody listens.
    gc.collect()
    gc.freeze()


def main() -> int:
    """Listen until nobody wants it any more; the exit code."""
    # What a library prints is no answer.
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0) as out:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        told = _Told(out)
        try:
            order = Order(*pickle.load(sys.stdin.buffer))  # noqa: S301 - of our own process
        except EOFError:  # nobody wants it already
            return 0
        logging.basicConfig(level=order.level, handlers=[told])
        sys.path[:] = order.path
        try:
            sources: list[Pair] = pickle.loads(order.sources)  # noqa: S301
            _load(name for source, _ in sources for name in source.loads)
            listeners = Listeners(sources, SharedMailbox(order.memory).post)
        except Exception:
            logging.getLogger("seerob.live").exception("what is to be listened to is not known there")
            return 1
        os.close(order.memory)
        sys.setswitchinterval(PROMPT)
        listeners.start()
        told.say(Said(ready=True))
        sys.stdin.buffer.read(1)
        listeners.stop()
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # a listener that does not end holds nobody up
