"""Separations of a tick's plan: in a tick in which nothing is in doubt, a stop of known time in one call."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from seerob.core import figures
from seerob.core.markers import drawn
from seerob.core.snapshot import Result, Segment
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING, Verdict
from seerob.criteria.body_parts import BodyPlaces
from seerob.criteria.stopping.models import MOVING, StopModel
from seerob.criteria.stopping.onset import Onset
from seerob.criteria.stopping.required import TOP
from seerob.criteria.stopping.terms import assumed_speed
from seerob.description.norms.iso_13855 import WALKING
from seerob.distance.least import Closests, Per
from seerob.kernels.separation import TimedStop, stops_in_time
from seerob.model.model import Gap, Model
from seerob.recording.series import CODES
from seerob.twin.state import State

_VERDICTS = {code: verdict for verdict, code in CODES.items()}


class OneOf(NamedTuple):
    """A separation, bound, whose S_p follows from the present speeds and has no tolerances."""

    gap: Gap
    stop: StopModel
    T_r: float
    """Reaction time [s]."""
    K: float
    """C + Z_d + Z_r, and how far shapes may lie outside [m]."""
    terms: tuple[Result, ...]
    """C, Z_d and Z_r."""
    human: str
    human_speed: float | None
    """v_h that is given [m/s]; None for that of ISO 13855."""
    same: Result
    """What of its result stays."""
    alone: Callable[[State, Closests], Result | None]
    """What it says of distances by whatever way to stop; None where that is undecided."""


class Stops:
    """Separations of robots from people at one instant.

    Args:
        every: Of the workstation.
        model: The workstation.
    """

    def __init__(self, every: Sequence[OneOf], model: Model) -> None:
        self._every = [(each, _InTime(each, model)) for each in every]
        self._asked = tuple((each.gap.query, Per.BODY) for each in every)

    def results(self, state: State) -> list[Result | None]:
        """Say of each whose parts are decided what governs, as `Separation.bind`."""
        every, begins = state.nearest(self._asked)
        results = list[Result | None]()
        for (one, in_time), row in zip(self._every, begins, strict=True):
            found = every.of(slice(row, row + len(one.gap.b)))
            result = in_time.result(state, found)
            results.append(one.alone(state, found) if result is None else result)
        return results


class _InTime:
    """One whose stop takes a known time."""

    def __init__(self, one: OneOf, model: Model) -> None:
        self._one, n = one, len(one.gap.b)
        self._bodies = [body.name for body in model.bodies]
        self._names = [self._bodies[i] for i in one.gap.b]
        self._places, self._rest = BodyPlaces(model), sum(term.value or 0.0 for term in one.terms)
        self._human_speed = assumed_speed(one.human_speed)
        self._stop: TimedStop | None = None
        if one.stop.in_time is not None:
            self._stop = TimedStop(one.T_r, *one.stop.in_time)
        self._found, self._verdicts, self._permitted = np.empty((2, n)), np.empty(n, np.uint8), np.empty(2)
        self._nearest: tuple[bytes, list[str]] = b"", []
        """To which bodies parts were nearest at the last instant, and their names."""

    def result(self, state: State, found: Closests) -> Result | None:
        """Say which part governs; None where that, or what it does until it brakes, is not known."""
        one, distance, (S_s, S_p), stop = self._one, found.distance, self._found, self._stop
        if stop is None:
            return None
        least, most = one.stop.reactions(state)
        onset: Onset = least(1.0)
        if most is not None or onset.unbounded_reason or not onset.linear:
            return None
        seen, permitted = state.fastest_speed(one.gap.a), self._permitted
        k = stops_in_time(
            onset.v_r, onset.S_r, onset.v_s, distance, stop, one.K, self._human_speed, seen, MOVING, ROUNDING,
            self._found, self._verdicts, permitted,
        )  # fmt: skip
        if k < 0 or not seen < np.inf:
            return None
        verdicts = [_VERDICTS[code] for code in self._verdicts.tolist()]
        verdict = verdicts[k]
        if verdict is Verdict.UNDECIDED:
            return None
        same, values, limits = one.same, distance.tolist(), S_p.tolist()
        unit, value, limit = same.unit, values[k], limits[k]
        places = found.body_a.tobytes()
        if places != self._nearest[0]:
            self._nearest = places, list(map(self._bodies.__getitem__, found.body_a.tolist()))
        parts = [
            Result(name=name, value=far, unit=unit, limit=S, at_most=False, verdict=said, reason=who)
            for name, far, S, said, who in zip(
                self._names, values, limits, verdicts, self._nearest[1], strict=True
            )
        ]
        S_r, S_b = onset.S_r.item(k), S_s.item(k)
        parts += terms(S_r, S_b, self._person(limit - (S_r + S_b), seen, stop))
        parts += one.terms
        speed, factor = permitted.tolist()
        parts += permissible(speed, None if math.isnan(factor) else factor)
        return Result(
            name=same.name, value=value, unit=unit, limit=limit, at_most=False, verdict=verdict,
            reason=self._where(state, found, k, seen), parts=tuple(parts),
            markers=drawn(line(value, limit, found.point_b[k], found.point_a[k], verdict)),
        )  # fmt: skip

    def _person(self, left: float, seen: float, stop: TimedStop) -> float:
        """S_h [m], which the ways of the robot and C, Z_d and Z_r leave of S_p, where v_h is not given."""
        one = self._one
        if one.human_speed is None:
            return left - self._rest
        return max(one.human_speed, seen, 0.0) * (stop.T_r + stop.T_s)

    def _where(self, state: State, found: Closests, k: int, seen: float) -> str:
        nearest = self._places.named(state, found.body_a.item(k), found.point_a[k])
        return f"{self._names[k]} ↔ {nearest}{faster(self._one.human, seen, self._one.human_speed)}"


def faster(human: str, seen: float, human_speed: float | None) -> str:
    """Say that a person is seen to be faster than v_h; empty where that is not so.

    Args:
        human: Name of the person.
        seen: [m/s].
        human_speed: v_h that is given [m/s]; None for that of ISO 13855.
    """
    v_h = human_speed or WALKING
    if not seen > v_h:
        return ""
    return f"; {human} is seen at {figures.worded(seen, v_h, 'm/s', at_most=True)}, faster than v_h"


def terms(S_r: float, S_s: float, S_h: float) -> tuple[Result, ...]:
    """Show the ways of robot and person that S_p is made of [m]."""
    return (
        Result(name="S_h", value=S_h, unit="m"),
        Result(name="S_r", value=S_r, unit="m"),
        Result(name="S_s", value=S_s, unit="m"),
    )


def permissible(speed: float | None, factor: float | None, reason: str = "") -> tuple[Result, ...]:
    """Show the largest permissible speed of the robot's fastest point.

    Args:
        speed: [m/s]; None where none is known.
        factor: On the present speeds; None where none is known, or at rest.
        reason: Why they are not, or what else is to be said.
    """
    beside = reason
    if factor is None:
        beside = reason or "stands still: no speed to compare with"
    elif factor > TOP:
        # Against next to no speed any factor comes out, and none says anything.
        factor, beside = None, f"more than {TOP:g} times the present speed"
    return (
        Result(name="largest permissible speed", value=speed, unit="m/s", at_most=False, reason=reason),
        Result(name="share of the present speed", value=factor, at_most=False, reason=beside),
    )


def line(
    value: float, limit: float, start: Array, end: Array, verdict: Verdict | None
) -> Callable[[], tuple[Segment, ...]]:
    """Draw the distance of the part that governs, when somebody looks.

    Args:
        value: The distance [m].
        limit: S_p [m].
        start: On the robot [m], shape (3,).
        end: On the person, likewise.
        verdict: Of the part.
    """
    return partial(_drawn, value, limit, start, end, verdict)


def _drawn(
    value: float, limit: float, start: Array, end: Array, verdict: Verdict | None
) -> tuple[Segment, ...]:
    shown = figures.against(value, limit, "m", at_most=False)
    label = f"{shown.value} m, S_p {shown.limit} m"
    return (Segment(start=tuple(start.tolist()), end=tuple(end.tolist()), label=label, verdict=verdict),)
