"""Criteria about people of whom a device sees a part: an estimate never makes a verdict green.

A bone that no device sees, and that the bones beside it do not tell, may be elsewhere. What the bones that
are seen exceed by themselves is exceeded; everything else is undecided, unless the file accepts the estimate
and says how far it may be off (``unseen_uncertainty``): then that is in the interval.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec.structs import replace

from seerob.core.snapshot import Result, Verdict
from seerob.criteria.criterion import Evaluate
from seerob.model.model import Gap, Model
from seerob.twin.state import State

MOST = 16
"""Sets of bones for which a question is kept."""


def seen_first(
    bodies: tuple[int, ...],
    judge: Evaluate,
    without: Callable[[tuple[int, ...]], Evaluate | None],
) -> Evaluate:
    """Ask about what is known first: the worst that is known is enough for exceeded, never for within.

    Args:
        bodies: That the question is about, by index.
        judge: The whole question; undecided while bones are in doubt, unless the file accepts estimates.
        without: Makes the question about the rest of the bodies; None when nothing of it is left.
    """
    parts: dict[tuple[int, ...], Evaluate | None] = {}

    def evaluate(state: State) -> Result:
        lost = state.invalid_bodies(bodies)
        if not lost:
            return judge(state)
        if lost not in parts:
            if len(parts) == MOST:
                del parts[next(iter(parts))]
            parts[lost] = without(lost)
        part = parts[lost]
        if part is not None:
            result = part(state)
            if result.verdict is Verdict.EXCEEDED:
                names = [state.model.bodies[i].name for i in lost]
                shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
                return replace(result, reason=f"{result.reason}; without {shown}, which may be elsewhere")
        return judge(state)

    return evaluate


def partly_seen(model: Model, gap: Gap, bind: Callable[[Gap], Evaluate]) -> Evaluate:
    """Judge a gap of which bones may be elsewhere: the worst that is known is enough for exceeded.

    Args:
        model: The compiled workstation.
        gap: Between the two sets of bodies.
        bind: Makes the criterion for a part of the gap. It asks for distances with ``allow_estimated`` and
            widens them by `seerob.twin.accuracy.tracking_error.TrackingError`.
    """

    def without(lost: tuple[int, ...]) -> Evaluate | None:
        a, b = (tuple(i for i in side if i not in lost) for side in (gap.a, gap.b))
        return bind(model.gap(a, b)) if a and b else None

    return seen_first(gap.bodies, bind(gap), without)
