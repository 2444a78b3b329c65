"""Where what visitors do in the room, and the source that waits for it, find each other.

The server's thread says what pages do, a source's thread takes it. Hands are those of people whose headset a
page is; controls may be pulled by any page that may say what it tracks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from threading import Lock
from typing import NamedTuple

from seerob.core.snapshot import Grab, Pull

LONGEST_NAME = 64


class Doing(NamedTuple):
    """What a visitor does."""

    visitor: object
    what: Grab | Pull | None
    """None when they leave."""


Take = Callable[[Doing], str]
"""Takes a doing in the server's thread, without blocking; says why not."""


class Doings:
    """The place where they meet; safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._waiting: dict[object, Take] = {}

    def wait(self, key: object, take: Take) -> None:
        """Have everything that visitors do given to ``take``."""
        with self._lock:
            self._waiting[key] = take

    def leave(self, key: object) -> None:
        """Wait no longer."""
        with self._lock:
            self._waiting.pop(key, None)

    def do(self, visitor: object, what: Grab | Pull) -> str:
        """Give what a visitor does to whoever waits for it; why nobody takes it, empty when somebody does.

        Raises:
            ValueError: It is too long, or no number.
        """
        names = (what.hand, what.piece) if isinstance(what, Grab) else (what.control,)
        if max(map(len, names)) > LONGEST_NAME:
            raise ValueError(f"a name of more than {LONGEST_NAME} characters")
        if isinstance(what, Pull) and not math.isfinite(what.value):
            raise ValueError("pull needs a finite value")
        with self._lock:
            takers = list(self._waiting.values())
        if not takers:
            return "nothing in this run waits for what people do: it has no source of kind room"
        refusals = [take(Doing(visitor, what)) for take in takers]
        return "" if "" in refusals else refusals[0]

    def gone(self, visitor: object) -> None:
        """A page has left: what it held is let go."""
        with self._lock:
            takers = list(self._waiting.values())
        for take in takers:
            take(Doing(visitor, None))
