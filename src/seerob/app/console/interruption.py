"""Ctrl-C: asked for once it ends a run, insisted on it interrupts; inside libraries it may be lost."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from types import FrameType, TracebackType
from typing import Any, Self

EXIT = 3
"""Exit code of a program that Ctrl-C ended."""
_LATER = 0.002
"""After which a lost interrupt comes again [s]: whatever destroyed the object is over by then, mostly."""


class Interrupts:
    """Ctrl-C while a command works: it raises KeyboardInterrupt, and is remembered.

    What it leaves half-done fails in ways of its own, also in compiled libraries that say nothing of where
    their error came from. Where it comes while an object is destroyed, in ``__del__`` or a callback of a weak
    reference, Python would report it and go on; it comes again shortly after. In the end signals are handled
    as before, whatever the command asked for.

    Attributes:
        came: Whether there was one.
    """

    def __init__(self) -> None:
        self.came = False
        self._over = False
        self._deaf = False

    def __enter__(self) -> Self:
        self._hook = sys.unraisablehook
        self._before: dict[signal.Signals, Any] = {}
        if threading.current_thread() is threading.main_thread():  # only it may ask for signals
            self._before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
        # A program in the background of a shell ignores Ctrl-C.
        if self._before.get(signal.SIGINT, signal.SIG_IGN) is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, self._raise)
        sys.unraisablehook = self._lost
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over = True
        sys.unraisablehook = self._hook
        for number, handler in self._before.items():
            if handler is not None:  # asked for by something else than Python
                signal.signal(number, handler)

    def _raise(self, number: int, frame: FrameType | None) -> None:
        self.came = True
        if self._deaf:
            _thread.start_new_thread(self._again, ())
        else:
            raise KeyboardInterrupt

    def _lost(self, what: sys.UnraisableHookArgs) -> None:
        if not isinstance(what.exc_value, KeyboardInterrupt):
            self._hook(what)
            return
        self._deaf = True  # in here it would be lost once more
        _thread.start_new_thread(self._again, ())
        self._deaf = False

    def _again(self) -> None:
        time.sleep(_LATER)
        main = threading.main_thread().ident
        if self._over or main is None:
            return
        if hasattr(signal, "pthread_kill"):
            signal.pthread_kill(main, signal.SIGINT)  # wakes it, too, where it waits for a lock
        else:
            _thread.interrupt_main()


class Stopped:
    """Whether the user asked to stop. A second Ctrl-C does not wait."""

    def __init__(self) -> None:
        self._asked = False
        self._interrupt = signal.signal(signal.SIGINT, self._ask)
        signal.signal(signal.SIGTERM, self._ask)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self._asked:
            if callable(self._interrupt):
                self._interrupt(number, frame)
            raise KeyboardInterrupt
        self._asked = True

    def __call__(self) -> bool:
        """Whether to stop."""
        return self._asked


def stopped() -> int:
    """Say that the program was stopped; its exit code."""
    # An interrupt inside text that a library had run makes the interpreter end by a signal instead of with
    # our exit code, until other text is run.
    eval("0")  # noqa: S307
    sys.stderr.write("stopped\n")
    return EXIT
