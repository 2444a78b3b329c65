"""Criteria about people of whom a device sees a part: an estimate never makes a verdict green.

A bone that no device sees, and that the bones beside it do not tell, may be elsewhere. What the bones that
are seen exceed by themselves is exceeded; everything else is undecided, unless the file accepts the estimate
and says how far it may be off (``unseen_uncertainty``): then that is in the interval.
"""

from __future__ import annotations

from collections.abc import Callable

from seerob.criterion import Evaluate
from seerob.model import Gap, Model
from seerob.snapshot import Result, Verdict
from seerob.state import State

MOST = 16
"""Sets of bones for which a question is kept."""


def partly_seen(model: Model, gap: Gap, bind: Callable[[Gap], Evaluate]) -> Evaluate:
    """Ask about the bones that are seen first, then about all.

    Args:
        model: The compiled workstation.
        gap: Between the two sets of bodies.
        bind: Makes the criterion for a part of the gap. It asks for distances with ``estimates`` and widens
            them by `seerob.tracking_error.TrackingError`.
    """
    bodies = (*gap.a, *gap.b)
    judge = bind(gap)
    parts: dict[tuple[int, ...], Evaluate] = {}

    def evaluate(state: State) -> Result:
        lost = state.lost_bodies(bodies)
        if not lost:
            return judge(state)
        a, b = (tuple(i for i in side if i not in lost) for side in (gap.a, gap.b))
        if a and b:
            if lost not in parts:
                if len(parts) == MOST:
                    del parts[next(iter(parts))]
                parts[lost] = bind(model.gap(a, b))
            result = parts[lost](state)
            if result.verdict is Verdict.EXCEEDED:
                return result
        return judge(state)

    return evaluate
