"""The map drawn in the room: the way of the tool point in the colours of what is permitted there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

from seerob.core.markers import Polyline, Vec3
from seerob.core.verdict import Verdict

LABELLED = 8
"""Stretches that say their speeds, those above what is permitted first; more would hide the picture."""


class Place(NamedTuple):
    """A place of the way of the tool point; speeds are those of the tool point."""

    point: Vec3
    """[m], world."""
    permissible: float
    """[m/s]; NaN where it cannot be told."""
    given: float
    """[m/s]"""

    @property
    def verdict(self) -> Verdict:
        """Whether the given motion keeps to what is permitted here."""
        if math.isnan(self.permissible):
            return Verdict.UNDECIDED
        kept = self.given <= self.permissible * (1 + 1e-9) and (self.permissible > 0 or self.given == 0)
        return Verdict.WITHIN if kept else Verdict.EXCEEDED


def path_markers(pieces: Iterable[Sequence[Place]]) -> tuple[Polyline, ...]:
    """Lines along a path: within, exceeded or undecided against the given motion; the worst first."""
    stretches = [stretch for piece in pieces for stretch in _stretches(piece)]
    urgent = sorted((s for s in stretches if s[0].verdict is not Verdict.WITHIN), key=_urgency)
    # Where all is within, one label says how near it comes.
    shown = urgent[:LABELLED] or sorted(stretches, key=_urgency)[:1]
    chosen = {id(stretch) for stretch in shown}
    return tuple(
        Polyline(
            points=tuple(place.point for place in stretch),
            label=_label(stretch) if id(stretch) in chosen else "",
            verdict=stretch[0].verdict,
        )
        for stretch in sorted(stretches, key=_urgency)
    )


def _stretches(piece: Sequence[Place]) -> Iterator[Sequence[Place]]:
    for _, group in groupby(range(len(piece)), key=lambda k: piece[k].verdict):
        inside = list(group)
        # The first place of the next one too: no gap is left between two colours.
        stretch = piece[inside[0] : inside[-1] + 2]
        if len(stretch) > 1:
            yield stretch


def _own(stretch: Sequence[Place]) -> list[Place]:
    return [place for place in stretch if place.verdict is stretch[0].verdict]


def _slowest(stretch: Sequence[Place]) -> Place:
    return min(_own(stretch), key=lambda place: place.permissible - place.given)


def _urgency(stretch: Sequence[Place]) -> tuple[int, float]:
    order = (Verdict.EXCEEDED, Verdict.UNDECIDED, Verdict.WITHIN)
    place = _slowest(stretch)
    return order.index(place.verdict), place.permissible - place.given


def _label(stretch: Sequence[Place]) -> str:
    place = _slowest(stretch)
    if math.isnan(place.permissible):
        return "undecided"
    return f"{place.permissible:.2f} m/s permitted, {place.given:.2f} given"
