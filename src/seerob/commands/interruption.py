"""Ctrl-C: asked for once it ends a run, insisted on it interrupts; inside libraries it may be lost."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from types import FrameType, TracebackType
from typing import Self

_LATER = 0.002
"""After which a lost interrupt comes again [s]: whatever destroyed the object is over by then, mostly."""


class Interrupts:
    """Ctrl-C while a command works: it raises KeyboardInterrupt, and is remembered.

    What it leaves half-done fails in ways of its own, also in compiled libraries that say nothing of where
    their error came from. Where it comes while an object is destroyed, in ``__del__`` or a callback of a weak
    reference, Python would report it and go on; it comes again shortly after.

    Attributes:
        came: Whether there was one.
    """

    def __init__(self) -> None:
        self.came = False
        self._over = False

    def __enter__(self) -> Self:
        self._hook = sys.unraisablehook
        # Only the main thread may ask for signals; a program in the background of a shell ignores this one.
        mine = threading.current_thread() is threading.main_thread()
        self._asks = mine and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN
        if self._asks:
            self._handler = signal.signal(signal.SIGINT, self._raise)
        sys.unraisablehook = self._lost
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over = True
        sys.unraisablehook = self._hook
        if self._asks:
            signal.signal(signal.SIGINT, self._handler)

    def _raise(self, number: int, frame: FrameType | None) -> None:
        self.came = True
        raise KeyboardInterrupt

    def _lost(self, what: sys.UnraisableHookArgs) -> None:
        if isinstance(what.exc_value, KeyboardInterrupt):
            again = threading.Timer(_LATER, self._again)
            again.daemon = True
            again.start()
        else:
            self._hook(what)

    def _again(self) -> None:
        if not self._over:
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
