"""Puts the parts of an MVN sample together again: split, swapped, doubled, late or lost on the way.

Per character and kind the newest sample wins. A part of an older one may still come; what is older than
the last whole sample is late and dropped, and so is, as lost, what stays in pieces. A counter that goes far
back is a recording that began anew.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from seerob.protocols.tracking.mvn import Header, Items

LATE = 64
"""Samples back that are late; further back it is a new start."""
MAX_PARTS = 16
"""Of one sample: 67 segments of 44 bytes fill two."""
MAX_WAITING = 32
"""Samples in pieces, of all characters and kinds; then the oldest is given up."""
_TURN = 1 << 32


class _Key(NamedTuple):
    character: int
    kind: int


@dataclass
class Losses:
    """What did not become a whole sample."""

    late: int = 0
    """Datagrams of samples older than one that was whole already."""
    doubled: int = 0
    """Datagrams that had been heard."""
    incomplete: int = 0
    """Samples of which a part never came."""
    skipped: int = 0
    """Samples that the sender left out, or of which no part came, by their counter."""

    def __bool__(self) -> bool:
        return any((self.late, self.doubled, self.incomplete, self.skipped))


@dataclass
class _Waiting:
    parts: dict[int, Items] = field(default_factory=dict)
    count: int | None = None


class Assembly:
    """Whole samples from datagrams of numbers.

    Attributes:
        losses: Counted since the start.
    """

    def __init__(self) -> None:
        self.losses = Losses()
        self._newest: dict[_Key, int] = {}
        self._waiting: OrderedDict[tuple[_Key, int], _Waiting] = OrderedDict()

    def feed(self, datagram: Items) -> Items | None:
        """The whole sample that this datagram completes, its items in order; None while parts lack."""
        header = datagram.header
        key = _Key(header.character, -1 if header.kind is None else int(header.kind))
        newest = self._newest.get(key)
        if newest is not None:
            back = (newest - header.sample) % _TURN
            if back == 0:
                self.losses.doubled += 1
                return None
            if back <= LATE:
                self.losses.late += 1
                return None
        if header.last and header.part == 0:
            self._done(key, header)
            return datagram
        whole = self._part(key, datagram)
        if whole is not None:
            self._done(key, header)
        return whole

    def _part(self, key: _Key, datagram: Items) -> Items | None:
        header = datagram.header
        if header.part >= MAX_PARTS:
            self.losses.incomplete += 1
            return None
        at = (key, header.sample)
        waiting = self._waiting.setdefault(at, _Waiting())
        if header.part in waiting.parts:
            self.losses.doubled += 1
            return None
        waiting.parts[header.part] = datagram
        if header.last:
            waiting.count = header.part + 1
        if waiting.count is None or any(k not in waiting.parts for k in range(waiting.count)):
            while len(self._waiting) > MAX_WAITING:
                self._waiting.popitem(last=False)
                self.losses.incomplete += 1
            return None
        parts = [waiting.parts[k] for k in range(waiting.count)]
        whole = header._replace(part=0, last=True, items=sum(len(p.values) for p in parts) & 0xFF)
        ids, values = (np.concatenate([getattr(p, name) for p in parts]) for name in ("ids", "values"))
        return Items(whole, ids, values)

    def _done(self, key: _Key, header: Header) -> None:
        """A sample is whole: it is the newest, and what waits that is older is lost."""
        before = self._newest.get(key)
        if before is not None and (ahead := (header.sample - before) % _TURN) < _TURN // 2:
            self.losses.skipped += ahead - 1
        self._newest[key] = header.sample
        self._waiting.pop((key, header.sample), None)
        if self._waiting:
            old = [
                at for at in self._waiting if at[0] == key and (header.sample - at[1]) % _TURN < _TURN // 2
            ]
            for at in old:
                del self._waiting[at]
                self.losses.incomplete += 1
