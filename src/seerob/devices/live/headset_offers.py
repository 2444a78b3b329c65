"""Where pages that offer what a headset sees, and sources that wait for it, find each other.

The server's thread offers, a source's thread takes; the run that has both hands the server's `Offers` to its
sources. One page per person: whoever offers first, until it falls silent or leaves.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

import numpy as np

from seerob.core.snapshot import Grab, Pull, Tracking
from seerob.core.transforms import Array
from seerob.devices.live.doings import Doings

if TYPE_CHECKING:
    from seerob.devices.live.listening import LiveSource

HELD = 2.0
"""A page that offers nothing for so long loses its place [s]."""
SHORTEST = 0.003
"""Offers of a page that follow one another faster are left out [s]; headsets do 60 to 144 Hz."""
MOST_NAMES = 160
LONGEST_NAME = 64


class Offer(NamedTuple):
    """What a headset sees at one instant, as it came: y up."""

    arrived: float
    """Host's monotonic time [s]."""
    t: float
    """On the page's clock [s]."""
    names: tuple[str, ...]
    positions: Array
    """[m], shape (n, 3)."""
    wxyz: Array
    """Shape (n, 4)."""
    guessed: tuple[bool, ...]


class Held(NamedTuple):
    """Who offers for a person."""

    visitor: object
    last: float


def read(tracking: Tracking, now: float) -> Offer:
    """The offer in a message.

    Raises:
        ValueError: It contradicts itself, or is too large.
    """
    n = len(tracking.names)
    if not 0 < n <= MOST_NAMES or len(set(tracking.names)) < n:
        raise ValueError(f"tracking of {n} names: 1 to {MOST_NAMES} different ones are expected")
    if max(map(len, (tracking.human, *tracking.names))) > LONGEST_NAME:
        raise ValueError(f"a name of more than {LONGEST_NAME} characters")
    if len(tracking.poses) != 28 * n or len(tracking.guessed) not in (0, n):
        raise ValueError(f"tracking of {n} names with {len(tracking.poses)} bytes of poses")
    if not (math.isfinite(tracking.t) and tracking.t >= 0):
        raise ValueError("tracking without a time")
    with np.errstate(invalid="ignore"):  # a signalling NaN is one more NaN
        rows = np.frombuffer(tracking.poses, "<f4").reshape(n, 7).astype(float)
    guessed = tuple(map(bool, tracking.guessed)) or (False,) * n
    return Offer(now, tracking.t, tracking.names, rows[:, :3], rows[:, 3:], guessed)


class Offers:
    """The place where they meet; safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._waiting: dict[str, dict[object, Callable[[Offer], None]]] = {}
        self._held: dict[str, Held] = {}
        self.doings = Doings()
        """What visitors do besides."""

    def wait(self, human: str, key: object, take: Callable[[Offer], None]) -> None:
        """Have every offer for a person given to ``take``, in the server's thread; it must not block."""
        with self._lock:
            self._waiting.setdefault(human, {})[key] = take

    def leave(self, human: str, key: object) -> None:
        """Wait no longer."""
        with self._lock:
            takers = self._waiting.get(human, {})
            takers.pop(key, None)
            if not takers:
                self._waiting.pop(human, None)

    def offer(self, human: str, visitor: object, offer: Offer) -> str:
        """Give an offer to whoever waits for it.

        Args:
            human: Name of the person.
            visitor: The page.
            offer: What it says.

        Returns:
            Why nobody takes it; empty when somebody does.
        """
        with self._lock:
            takers = list(self._waiting.get(human, {}).values())
            if not takers:
                return f"nothing in this run waits for a headset of {human!r}"
            held = self._held.get(human)
            if held is not None and held.visitor is not visitor and offer.arrived - held.last < HELD:
                return f"another page is the headset of {human!r}"
            if held is not None and held.visitor is visitor and offer.arrived - held.last < SHORTEST:
                return ""
            self._held[human] = Held(visitor, offer.arrived)
        for take in takers:
            take(offer)
        return ""

    def do(self, visitor: object, what: Grab | Pull) -> str:
        """Give what a visitor does in the room to whoever waits for it.

        Returns:
            Why nobody takes it; empty when somebody does.

        Raises:
            ValueError: It is too long, or no number.
        """
        if isinstance(what, Grab):
            human = what.hand.partition("/")[0]
            with self._lock:
                held = self._held.get(human)
            if held is None or held.visitor is not visitor:
                return f"this page is not the headset of {human!r}, whose hand that is"
        return self.doings.do(visitor, what)

    def gone(self, visitor: object) -> None:
        """A page has left: its places are free."""
        self.doings.gone(visitor)
        with self._lock:
            self._held = {human: held for human, held in self._held.items() if held.visitor is not visitor}


@runtime_checkable
class HasOffers(Protocol):
    """A writer of a run whose pages may offer what a headset sees."""

    offers: Offers


@runtime_checkable
class TakesOffers(Protocol):
    """A source that hears what such pages offer."""

    def taking(self, offers: Offers) -> LiveSource:
        """This source, which takes what is offered there."""


def now() -> float:
    """Host's monotonic time [s]."""
    return time.monotonic()
