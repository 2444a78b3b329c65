"""Who was connected: role, address, since and until when, and what was refused to them.

Each goes to the log when it happens, and to whoever records the run. What one visitor or address can make
this remember is bounded.
"""

from __future__ import annotations

import logging
from collections import OrderedDict, deque
from datetime import UTC, datetime
from threading import Lock

from seerob.recording.format import Visitor

_log = logging.getLogger(__name__)

WAITING = 4096
"""Events that wait for whoever records; the oldest is dropped first."""
MOST_REASONS = 16
MOST_STRANGERS = 256
"""Addresses of which refusals before they came in are counted."""


class Visit:
    """One connected page.

    Args:
        visits: All of them.
        role: What it may do.
        address: Where it is from.
    """

    def __init__(self, visits: Visits, role: str, address: str) -> None:
        self._visits = visits
        self.role, self.address = role, address
        self.since = _now()
        self.refused: dict[str, int] = {}

    def refuse(self, what: str) -> None:
        """Note that something was asked for and not done; told when it is the first of its kind."""
        if what in self.refused:
            self.refused[what] += 1
        elif len(self.refused) < MOST_REASONS:
            self.refused[what] = 1
            _log.warning("page of %s (%s): refused: %s", self.address, self.role, what)
            self._visits.add(self.event("refused"))

    def leave(self) -> None:
        """The page is gone."""
        self._visits.leave(self)

    def event(self, what: str) -> Visitor:
        """What is recorded of it."""
        return Visitor(
            event=what,
            role=self.role,
            address=self.address,
            since=self.since,
            until=_now() if what == "left" else None,
            refused=dict(self.refused),
        )


class Visits:
    """All visitors of a server; written in the server's thread, read from any."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._events: deque[Visitor] = deque(maxlen=WAITING)
        self._present: set[Visit] = set()
        self._strangers: OrderedDict[str, Visit] = OrderedDict()

    def come(self, role: str, address: str) -> Visit:
        """Somebody is connected."""
        visit = Visit(self, role, address)
        with self._lock:
            self._present.add(visit)
            self._events.append(visit.event("came"))
        _log.info("page of %s (%s): connected", address, role)
        return visit

    def leave(self, visit: Visit) -> None:
        """Somebody is no longer connected."""
        with self._lock:
            self._present.discard(visit)
            self._events.append(visit.event("left"))
        _log.info("page of %s (%s): gone, refused %s", visit.address, visit.role, visit.refused or "nothing")

    def turn_away(self, address: str, why: str) -> None:
        """Somebody was not let in."""
        with self._lock:
            visit = self._strangers.get(address)
            if visit is None:
                visit = self._strangers[address] = Visit(self, "none", address)
                if len(self._strangers) > MOST_STRANGERS:
                    self._strangers.popitem(last=False)
        visit.refuse(why)

    def add(self, event: Visitor) -> None:
        """Keep an event for whoever records."""
        with self._lock:
            self._events.append(event)

    def take(self, *, end: bool = False) -> tuple[Visitor, ...]:
        """What happened since the last call; at the ``end`` also who is there still, and all refusals."""
        if not (end or self._events):
            return ()
        with self._lock:
            taken = list(self._events)
            self._events.clear()
            if end:
                taken += [visit.event("there") for visit in self._present]
                taken += [visit.event("refused") for visit in self._strangers.values()]
        return tuple(taken)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
