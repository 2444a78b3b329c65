r"""Strain of hand and wrist by the Revised Strain Index: force, frequency, time, wrist, hours per day.

Garg, Moore, Kapellusch 2017: :math:`RSI = IM \cdot EM \cdot DM \cdot PM \cdot HM`, and for exertions that
differ the Composite Strain Index of the same authors. Angles are in rad, times in s unless a name says
otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, NamedTuple, cast

import numpy as np
from msgspec import Meta
from msgspec.structs import replace
from numpy.typing import ArrayLike

from seerob.core.domains import number
from seerob.core.snapshot import Basis, Highlight, Input, Origin, Result
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin, verdict_of
from seerob.criteria.scoring.basis import ACCURACY_NOTE, posture_quality
from seerob.criteria.scoring.exertions import (
    Exertion,
    ExertionPhase,
    HandWork,
    exertion_inputs,
    hand_work,
    hours_input,
)
from seerob.criteria.scoring.measured import Measured
from seerob.criteria.scoring.rule import PostureRule, bind_posture, by_phase
from seerob.description.humans.angles import Angles
from seerob.description.humans.skeleton import SIDES
from seerob.model import provenance
from seerob.model.model import Model

DAY = 86400.0
FARTHEST = math.pi / 2
"""No wrist is flexed or extended beyond [rad]."""
STRAIGHT_TO = math.radians(30)
"""Extension up to which the wrist costs nothing [rad]."""


def intensity_multiplier(borg: ArrayLike) -> Array:
    """IM of the force on Borg's CR-10 scale, 0 to 10, of which the equation takes a tenth."""
    part = number("exertion", borg, 0.0, 10.0) / 10
    easy = 30.0 * part**3 - 15.6 * part**2 + 13.0 * part + 0.4
    hard = 36.0 * part**3 - 33.3 * part**2 + 24.77 * part - 1.86
    return np.where(part <= 0.4, easy, hard)


def frequency_multiplier(per_minute: ArrayLike) -> Array:
    """EM of exertions per minute; beyond 90 it grows faster.

    Where the pieces of a multiplier meet they differ by 0.01 %; the larger holds, so that none ever falls.
    """
    rate = number("exertions", per_minute, 0.0, unit="per minute")
    return np.maximum(0.10 + 0.25 * np.minimum(rate, 90.0), 0.00334 * rate**1.96 * (rate > 90.0))


def time_multiplier(time: ArrayLike) -> Array:
    """DM of the time of one exertion [s]."""
    lasts = number("exertion_time", time, 0.0, unit="s")
    long = np.maximum(19.17 * np.log(np.maximum(lasts, 60.0)) - 59.44, 0.45 + 0.31 * 60.0)
    return np.where(lasts <= 60.0, 0.45 + 0.31 * lasts, long)


def wrist_multiplier(wrist: ArrayLike) -> Array:
    """PM of the flexion of the wrist [rad], extension negative, up to 90°; NaN stays so."""
    angle = np.asarray(wrist, float)
    number("wrist", angle[~np.isnan(angle)], -FARTHEST, FARTHEST, "rad")
    degrees = np.degrees(angle)
    beyond = np.maximum(-degrees - 30.0, 0.0)
    bent: Array = np.where(degrees > 0, 1.2 * np.exp(0.009 * degrees) - 0.2, 1.0 + 0.00028 * beyond**2)
    return bent


def daily_multiplier(daily: ArrayLike) -> Array:
    """HM of the time per day for which the task is done [s]."""
    hours = number("daily", daily, 0.0, DAY, "s") / 3600
    return np.where(hours <= 0.05, 0.20, 0.042 * hours + 0.090 * np.log(np.maximum(hours, 0.05)) + 0.477)


def composite(strain: ArrayLike, per_minute: ArrayLike) -> Array:
    r"""Composite Strain Index of exertions that differ, the greatest that any order of them gives.

    :math:`\sum_k R_k (EM(E_{1..k}) - EM(E_{1..k-1}))`, the first term :math:`R_1 EM(E_1)`. The authors take
    the exertions by falling index; then a harder exertion may lower the sum, as another one comes first.

    Args:
        strain: R, the index without EM, of each exertion, shape (..., n), n at least 1.
        per_minute: E of each, shape (n,).
    """
    R = number("strain", strain, 0.0)
    rates = number("exertions", per_minute, 0.0, unit="per minute")
    if rates.shape != R.shape[-1:]:
        raise ValueError(f"{rates.size} exertions per minute for an index of shape {R.shape}")
    E = np.broadcast_to(rates, R.shape)
    order = np.argsort(R, axis=-1, kind="stable")
    R, E = np.take_along_axis(R, order, -1), np.take_along_axis(E, order, -1)
    grown = np.diff(frequency_multiplier(np.cumsum(E, axis=-1)) - 0.10, axis=-1, prepend=0.0)
    return np.asarray(0.10 * R[..., -1] + (R * grown).sum(axis=-1))


class Strained(NamedTuple):
    """What an index of one instant was made of."""

    low: tuple[float, float]
    """Least index of the right hand and the left one."""
    high: tuple[float, float]
    reason: str
    measured: tuple[float | None, float | None] = (None, None)
    """Index of each hand with the wrists as they were measured; None where one was not."""


class StrainIndex(PostureRule, frozen=True, kw_only=True):
    """Revised Strain Index of the worse hand (Garg, Moore, Kapellusch 2017), exertions being entered."""

    adults: ClassVar[bool] = True

    daily: Annotated[float, Meta(gt=0, le=DAY, extra={"unit": "s"})] | None = None
    """How long the task is done per day [s]."""
    limit: Annotated[float, Meta(gt=0)] | None = None
    """Greatest admissible index; the authors call more than 10 hazardous, as far as we remember."""

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the index.

        Raises:
            InputError: Exertions last longer than their phase.
        """
        read, error = bind_posture(model, self.human, self.unmeasured), self.error(model)
        phases, work = hand_work(model, self.human, self.name)
        absent = work.missing if self.daily is not None else (*work.missing, "daily (the time per day)")
        limit, daily = self.limit, self.daily
        busy = {each.phase for each in work.exertions}

        def scored(angles: Angles, phase: ExertionPhase) -> Figure:
            shape = angles.trunk_flexion.shape[:1]
            if busy and phase not in busy:
                none, said = np.full(shape, np.nan), "no exertion in this phase"
                return Figure(
                    none, limit, interval=(none, none), nothing=np.ones(shape, bool),
                    open=np.zeros(shape, bool), beside=Strained((0, 0), (0, 0), said),
                )  # fmt: skip
            assert daily is not None
            low, high = ends = self._ends(work, daily, angles, 0.0)
            wide = ends
            if error is not None:
                off = Measured(angles, error).error("wrist_flexion")
                wide = self._ends(work, daily, angles, off)
            unseen = low != high
            open_ = unseen.any(axis=-1)
            said = ""
            if not shape and open_:
                said = f"not measured: {' and '.join(SIDES[i] for i in np.flatnonzero(unseen))} wrist"
            least, most = (end.max(axis=-1) for end in wide)
            value = np.where(open_, np.nan, low.max(axis=-1))
            beside = None
            if not shape:
                right, left = (None if lost else x for x, lost in zip(low.tolist(), unseen, strict=True))
                said = said or _largest(work.exertions)
                beside = Strained(_hands(wide[0]), _hands(wide[1]), said, (right, left))
            return Figure(
                value, limit, interval=(least, most), nothing=np.zeros(shape, bool), open=open_, beside=beside
            )

        def compute(twin: Twin) -> Figure:
            angles = read(twin)
            if absent:
                said = f"not entered: {', '.join(absent)}"
                return Figure(None, limit, undecided=True, beside=Strained((0, 0), (math.inf,) * 2, said))
            figure = by_phase(twin.t, angles, phases, ExertionPhase(), scored)
            return figure if twin.many else _of_one(figure, spread=error is not None)

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says which hand is strained, and colours it."""
        return lambda state, figure, verdict: self._shown(figure, verdict)

    def one_by_one(self, model: Model) -> str:
        """Nothing: an index takes the wrist of its instant."""
        return ""

    def _ends(self, work: HandWork, daily: float, angles: Angles, off: float) -> tuple[Array, Array]:
        """Least and greatest index of right and left hands whose wrists may be off [rad], (..., 2) each."""
        seen = angles.wrist_flexion.reshape(*angles.trunk_flexion.shape[:1], 2)
        low, high = np.zeros_like(seen), np.zeros_like(seen)
        for side in range(2):
            exertions = work.of(side)
            if not exertions:
                continue
            own = _wrist_span(seen[..., side], off)
            forces, times = [each.force for each in exertions], [each.time for each in exertions]
            rates = [each.per_minute for each in exertions]
            rest = intensity_multiplier(forces) * time_multiplier(times) * daily_multiplier(daily)
            for found, wrist in zip((low, high), own, strict=True):
                wrists = [
                    wrist if each.wrist is None else np.full_like(wrist, each.wrist) for each in exertions
                ]
                found[..., side] = composite(rest * wrist_multiplier(np.stack(wrists, axis=-1)), rates)
        return low, high

    def _shown(self, figure: Figure, verdict: Verdict | None) -> Shown:
        low, high, reason, measured = cast("Strained", figure.beside)
        if figure.undecided or figure.nothing:
            return Shown(reason)
        parts = []
        for side, name in enumerate(SIDES):
            index = measured[side]
            interval = None if low[side] == high[side] else (low[side], high[side])
            own = Figure(index, self.limit, interval=interval, open=index is None)
            parts.append(
                Result(
                    name=f"{name} hand",
                    value=index,
                    limit=self.limit,
                    interval=interval,
                    verdict=verdict_of(own, at_most=True),
                    nothing=index is None and self.limit is None,
                )
            )
        worst = SIDES[int(high[1] > high[0])]
        return Shown(
            reason,
            lambda: (Highlight(body=f"{self.human}/{worst}_hand", verdict=verdict),),
            parts=tuple(parts),
        )

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        phases, work = hand_work(model, self.human, self.name)
        rates = tuple(
            Input(
                name=f"exertions per minute, {each.phase.title or f'from {each.phase.start:g} s'}",
                value=each.per_minute,
                unit="1/min",
                origin=Origin.COMPUTED,
                source="exertions of the phase, once a cycle",
            )
            for each in work.exertions
        )
        return Basis(
            formula="RSI = IM · EM · DM · PM · HM of force, exertions per minute, time of one, wrist and "
            "hours per day; of exertions that differ Σ R_k ΔEM_k, R = IM · DM · PM · HM, in the order that "
            "gives most",
            source="Garg, Moore, Kapellusch, Ergonomics 60(7), 2017, 912-922 and 60(8), 1033-1041; "
            "multipliers of one public implementation, as we remember them, and they join where their pieces "
            "meet (1); the papers were not read",
            inputs=(
                *provenance.motion(model, self.human),
                *exertion_inputs(phases, wrist=True),
                *rates,
                hours_input(self.daily),
                *posture_quality(self.accuracy, self.joint_accuracy, self.unmeasured, model, self.human),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                "wrists of other phases: the index of an instant takes all exertions with the wrist of that "
                "instant, so that of a run the worst wrist counts",
                "ulnar and radial deviation, which the index leaves out",
                "several tasks per day (the Cumulative Strain Index)",
                *((ACCURACY_NOTE,) if self.error(model) is not None else ()),
            ),
        )


def _hands(ends: Array) -> tuple[float, float]:
    right, left = ends.tolist()
    return right, left


def _of_one(figure: Figure, *, spread: bool) -> Figure:
    """The figure of one instant, in numbers.

    Args:
        figure: As computed, in arrays of the shape ().
        spread: Whether an accuracy of angles makes an interval of what is known.
    """
    low, high = cast("tuple[Array, Array]", figure.interval)
    known = not (figure.open or figure.nothing)
    return replace(
        figure,
        value=float(cast("Array", figure.value)) if known else None,
        interval=None if figure.nothing or (known and not spread) else (float(low), float(high)),
        nothing=bool(figure.nothing),
        open=bool(figure.open),
    )


def _wrist_span(flexion: ArrayLike, off: float) -> tuple[Array, Array]:
    """Wrists of the least and the greatest multiplier [rad] of ones that may be off.

    Args:
        flexion: [rad], extension negative, shape (...); NaN where nobody knows: any.
        off: How far they may be off [rad].
    """
    seen = np.asarray(flexion, float)
    first, last = (np.clip(seen + d, -FARTHEST, FARTHEST) for d in (-abs(off), abs(off)))
    # Least between an extension of 30° and straight.
    bends = ((first <= 0) & (last >= 0)) | (first < -STRAIGHT_TO)
    best = np.where(bends, np.minimum(np.maximum(first, -STRAIGHT_TO), 0.0), first)
    least = np.minimum(np.maximum(best, first), last)
    most = np.where(wrist_multiplier(last) >= wrist_multiplier(first), last, first)
    unknown = np.isnan(seen)
    return np.where(unknown, 0.0, least), np.where(unknown, FARTHEST, most)


def _largest(exertions: Sequence[Exertion]) -> str:
    """The exertion that strains most, in words."""
    if not exertions:
        return "no exertion in the whole cycle"
    worst = max(exertions, key=lambda each: each.force)
    title = worst.phase.title or f"from {worst.phase.start:g} s on"
    return f"hardest exertion {title}: {worst.force:g} of 10, {worst.per_minute:.3g} per minute"
