"""Ctrl-C at every instant in turn: tests import it as ``from interrupted_anywhere import …``."""

from __future__ import annotations

import gc
import sys
import warnings


def interrupted_anywhere(work, *, step=1):
    """Yield after each attempt that was interrupted: at the first instant, one or ``step`` later, and so on.

    CPython looks for signals where a function begins and where one that is written in C has returned.
    """
    with warnings.catch_warnings():
        # What was opened and not yet taken is closed by nobody but the interpreter.
        warnings.simplefilter("ignore", ResourceWarning)
        k = 0
        while _interrupted(work, k):
            yield k
            k += step
        gc.collect()


def _interrupted(work, k):
    left = k

    def look(frame, event, arg):
        nonlocal left
        if event in ("call", "c_return"):
            left -= 1
            if left < 0:
                sys.setprofile(None)
                raise KeyboardInterrupt

    before = sys.getprofile()
    sys.setprofile(look)
    try:
        work()
    except BaseException:
        if left >= 0:
            raise
    finally:
        sys.setprofile(before)
    return left < 0  # what was interrupted may fail in a way of its own
