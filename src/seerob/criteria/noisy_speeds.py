r"""What noise of positions may change of a result that rests on speeds derived from them.

Errors of joints are independent (`seerob.twin.state.State.speed_error`). A criterion that does not say itself
how far its speeds may be off (`seerob.criteria.criterion.Criterion.by_speed`) is asked again with each joint
by itself as much faster and as much slower as it may be. What a margin m loses by that at most, with all
errors together, is (JCGM 100:2008 5.1.2, in the finite differences of 5.1.3, note 2)

.. math:: \Delta m = \sqrt{\sum_j \max(m - m_{j+},\; m - m_{j-},\; 0)^2}

to first order in the errors. What loses all that it has is not within, nor what is not within with a single
joint that is off.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from seerob.core.errors import Undecided
from seerob.core.snapshot import Result, Row, Verdict
from seerob.core.transforms import Array
from seerob.criteria.criterion import Criterion, Evaluate
from seerob.criteria.figure import Twin
from seerob.recording.answers import Flags
from seerob.twin.state import State

NOISE = "decided by the noise of positions that its speeds are derived from"
REMEMBERS = "its speeds are derived from noisy positions, and what they change is not known: it remembers"

_WITHIN = Verdict.WITHIN
Place = tuple[str, ...]
"""Where in a result a figure is: names from the outside inward."""


class Noise(NamedTuple):
    """What noise makes of a result."""

    reason: str = ""
    """Why it is not within; empty where it may be."""
    off: float = 0.0
    """How far its figure may be off against its limit, in its unit."""


def noisy(state: State) -> dict[str, Array]:
    """Of those whose speeds were asked, and of who carries them, how far speeds of joints may be off."""
    errors = state.speed_errors
    if not errors or not state.speeds_asked:
        return {}
    names = {above for name in state.speeds_asked for above in state.model.carriers_of(name)}
    names |= state.speeds_asked
    return {name: error for name, error in errors.items() if name in names}


def others_noisy(twin: Twin, names: Sequence[str]) -> Flags | bool:
    """Whether speeds of any of these follow from noisy positions, shape (...).

    A criterion that says how far its own speeds may be off asks it of what carries these, or rides on them:
    what that changes it does not say, so it is open (`Figure.open`).
    """
    if not names:
        return False
    found = np.zeros((), bool)
    for name in names:
        error = twin.speed_error(twin.model.mechanisms[name])
        if error is not None:
            found = found | error.any(axis=-1)
    return found


def shaken(result: Result, criterion: Criterion, again: Evaluate | None, state: State) -> Noise:
    """What errors of the speeds that a criterion has just asked may change of what it said.

    Args:
        result: What it said.
        criterion: Which does not say itself how far speeds may be off.
        again: Another one of it; None where it remembers.
        state: The twin, while it asks.
    """
    if result.verdict is not _WITHIN and not result.nothing:
        return Noise()
    errors = noisy(state)
    if not errors:
        return Noise()
    if again is None:
        return Noise(REMEMBERS)
    margins, lost = _margins(result), dict[Place, float]()
    for each in _one_by_one(errors):
        worst = dict[Place, float]()
        for name, by in each:
            try:
                with state.quicker(name, by):
                    moved = again(state)
            except Undecided as reason:
                return Noise(f"{NOISE}: {reason}")
            if type(moved) is not Result or not (moved.verdict is _WITHIN or moved.nothing):
                return Noise(NOISE)
            for place, margin in _margins(moved).items():
                if place in margins:
                    worst[place] = max(worst.get(place, 0.0), margins[place] - margin)
        for place, change in worst.items():
            lost[place] = lost.get(place, 0.0) + change**2
    off = math.sqrt(lost.get((result.name,), 0.0))
    for place, square in lost.items():
        # A margin that loses nothing is the criterion's own, rounding and all.
        if not (square == 0.0 or margins[place] >= math.sqrt(square)):
            return Noise(NOISE if len(place) == 1 else f"{NOISE}: {' '.join(filter(None, place[1:]))}", off)
    return Noise(off=off)


def _one_by_one(errors: Mapping[str, Array]) -> Iterator[tuple[tuple[str, Array], ...]]:
    """Each joint by itself, faster and slower."""
    for name, error in errors.items():
        for j in np.flatnonzero(error).tolist():
            by = np.zeros(len(error))
            by[j] = error[j]
            yield (name, by), (name, -by)


def _margins(result: Result) -> dict[Place, float]:
    """Distances to their limits of all figures of a result that are within, the least of equal names."""
    found: dict[Place, float] = {}

    def add(place: Place, figure: Result | Row, *, at_most: bool) -> None:
        if figure.verdict is _WITHIN and figure.value is not None and figure.limit is not None:
            ends = (figure.value, *(figure.interval or ()))
            far = figure.limit - max(ends) if at_most else min(ends) - figure.limit
            found[place] = min(far, found.get(place, math.inf))

    def follow(outer: Place, inner: Result) -> None:
        place = (*outer, inner.name)
        add(place, inner, at_most=inner.at_most)
        for row in inner.rows:
            add((*place, row.group, row.side, row.name), row, at_most=True)
        for part in inner.parts:
            follow(place, part)

    follow((), result)
    return found
