"""How much of something one may have: so much at once, and so much per second from then on."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from time import monotonic


class Allowance:
    """A bucket that fills at a steady rate; what is taken beyond it is owed, and has to be waited for.

    Args:
        rate: What comes back [1/s].
        burst: What may be had at once.
        now: Monotonic time [s].
    """

    def __init__(self, rate: float, burst: float, now: Callable[[], float] = monotonic) -> None:
        self._rate, self._burst, self._now = rate, burst, now
        self._left, self._then = burst, now()

    def take(self, amount: float = 1.0) -> float:
        """Take some; how long to wait until that was allowed [s]."""
        now = self._now()
        self._left = min(self._burst, self._left + (now - self._then) * self._rate) - amount
        self._then = now
        return max(0.0, -self._left / self._rate)

    def wait(self) -> float:
        """How long it takes until nothing is owed [s]."""
        return max(0.0, -self._left / self._rate - (self._now() - self._then))


MOST_KNOWN = 1024


class Allowances:
    """One allowance per name, of the names that asked last.

    Args:
        rate: What comes back, of each [1/s].
        burst: What each may have at once.
    """

    def __init__(self, rate: float, burst: float) -> None:
        self._rate, self._burst = rate, burst
        self._of: OrderedDict[str, Allowance] = OrderedDict()

    def of(self, name: str) -> Allowance:
        """The allowance of a name."""
        found = self._of.get(name)
        if found is None:
            found = self._of[name] = Allowance(self._rate, self._burst)
            if len(self._of) > MOST_KNOWN:
                self._of.popitem(last=False)
        else:
            self._of.move_to_end(name)
        return found
