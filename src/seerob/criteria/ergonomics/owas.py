"""OWAS: its codes as pure functions, and the rule on the twin: posture code and action category, every tick.

Karhu et al. 1977, action categories of Louhevaara and Suurnäkki 1992.
The category does not grow with each code, so what is not known is a set of codes, not a span.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from enum import StrEnum
from functools import partial
from typing import Any, ClassVar, Literal, NamedTuple, cast

import numpy as np
from msgspec import Struct
from numpy.typing import ArrayLike, NDArray

from seerob.core.domains import number, whole
from seerob.core.figures import whatever_is_missing
from seerob.core.snapshot import Basis, Highlight, Input, Level, Origin, Result, Row, RowState, Verdict
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.scoring.basis import ACCURACY_NOTE, chosen, entered, posture_quality
from seerob.criteria.scoring.handled import NOTE, NOTHING, Handled, bind_handled, load_range
from seerob.criteria.scoring.measured import Accuracy, Measured
from seerob.criteria.scoring.phases import Kilograms, Phase, TaskPhase, shared_phases
from seerob.criteria.scoring.rule import PostureRule, bind_posture, by_phase
from seerob.criteria.scoring.score_rows import aspects, total_row
from seerob.criteria.scoring.spans import ROUNDING, Angle, Ints, Span, cells, either, published
from seerob.description.humans.angles import Angles
from seerob.description.humans.skeleton import SIDES
from seerob.model import provenance
from seerob.model.model import Model

CODES = {"back": 4, "arms": 3, "legs": 7, "load": 3}
"""Components in the order of `owas`, and how many codes each has."""
Possible = NDArray[np.bool_]
"""Whether each code is possible, shape (..., number of codes)."""


class Legs(StrEnum):
    """How the legs are used: the seven codes in their order, or an estimate."""

    SITTING = "sitting"
    STANDING = "standing"
    ONE_LEG = "one_leg"
    BOTH_KNEES_BENT = "both_knees_bent"
    ONE_KNEE_BENT = "one_knee_bent"
    """On one bent knee."""
    KNEELING = "kneeling"
    WALKING = "walking"
    POSTURE = "posture"
    """Not a code: estimated for somebody who stands or kneels."""


class OwasThresholds(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Angles that OWAS leaves to whoever applies it; all are choices."""

    bent: Angle = math.radians(20)
    """Back bent forward or backward beyond [rad]."""
    twisted: Angle = math.radians(20)
    """Back twisted beyond [rad]."""
    side_bent: Angle = math.radians(20)
    """Back bent sideways beyond [rad]."""
    knee_bent: Angle = math.radians(30)
    """Knee bent beyond [rad]."""
    foot_rise: Angle = math.radians(7)
    """One foot above the other, over the length of the leg, beyond [rad]: on one leg."""
    kneeling: Angle = math.radians(60)
    """Shank from the vertical beyond [rad] with its foot down: kneeling."""


def owas(back: ArrayLike, arms: ArrayLike, legs: ArrayLike, load: ArrayLike) -> Ints:
    """Action category, 1 to 4, of a posture code.

    Args:
        back: 1 to 4, shape (...); all others broadcast with it.
        arms: 1 to 3.
        legs: 1 to 7.
        load: 1 to 3.

    Raises:
        ValueError: A code that the method does not have.
    """
    given = (back, arms, legs, load)
    codes = [whole(name, code, 1, CODES[name]) for name, code in zip(CODES, given, strict=True)]
    return np.asarray(cells("owas", "category")[tuple(code - 1 for code in codes)])


def _together(back: Possible, arms: Possible, legs: Possible, load: Possible) -> Possible:
    """Whether each combination of codes is possible, shape (..., 4, 3, 7, 3)."""
    return np.asarray(
        back[..., :, None, None, None]
        & arms[..., None, :, None, None]
        & legs[..., None, None, :, None]
        & load[..., None, None, None, :]
    )


def category_span(back: Possible, arms: Possible, legs: Possible, load: Possible) -> Span:
    """Least and greatest category of all codes that are possible, shape (...)."""
    every, table = _together(back, arms, legs, load), cells("owas", "category")
    axes = (-4, -3, -2, -1)
    low = np.where(every, table, table.max()).min(axis=axes)
    return Span(low, np.where(every, table, table.min()).max(axis=axes))


def settled(codes: Mapping[str, Possible], around: Mapping[str, Possible]) -> dict[str, Possible]:
    """Codes of postures at a threshold: those of the greatest category, which does not grow with each code.

    Args:
        codes: Possible codes by component, in the order of `owas`, shape (..., number of codes) each.
        around: The same with every angle off by rounding.
    """
    table = cells("owas", "category")
    several = {key: own.sum(axis=-1, keepdims=True) > 1 for key, own in codes.items()}
    found = np.where(_together(*(np.where(several[key], codes[key], around[key]) for key in CODES)), table, 0)
    worst = np.unravel_index(found.reshape(*found.shape[:-4], -1).argmax(axis=-1), table.shape)
    return {
        key: np.where(several[key], codes[key], np.arange(CODES[key]) == worst[k][..., None])
        for k, key in enumerate(CODES)
    }


def only(code: int, of: int) -> Possible:
    """The set of one code."""
    return np.asarray(np.arange(1, int(whole("of", of, 1, 99)) + 1) == whole("code", code, 1, of))


def load_codes(kg: float | None, least: float = 0.0) -> Possible:
    """1 below 10 kg, 2 up to 20 kg, 3 beyond; when nobody said, all from that of ``least`` [kg] on."""
    if kg is not None:
        number("load", kg, 0, unit="kg")
    lowest = least if kg is None else kg
    code = 1 + (lowest >= 10) + (lowest > 20)
    return np.arange(1, 4) >= code if kg is None else only(code, 3)


def back_codes(angles: Angles, thresholds: OwasThresholds, accuracy: Accuracy = 0.0) -> Possible:
    """1 straight, 2 bent, 3 twisted or bent sideways, 4 both."""
    m = Measured(angles, accuracy)
    bent = m.beyond("trunk_flexion", thresholds.bent)
    turned = either(
        m.beyond("trunk_twist", thresholds.twisted), m.beyond("trunk_side_bend", thresholds.side_bent)
    )
    pairs = [_may(bent, b) & _may(turned, t) for t in (False, True) for b in (False, True)]
    return np.stack(pairs, axis=-1)


def arm_codes(angles: Angles, accuracy: Accuracy = 0.0) -> Possible:
    """1 both below shoulder level, 2 one at or above it, 3 both; elbow or wrist, whichever is higher."""
    up = Measured(angles, accuracy).graded(
        "arm_rise", lambda x: (x >= -ROUNDING).astype(np.int64), within=(0, 1), neutral=-math.inf
    )
    low, high = up.low.sum(axis=-1), up.high.sum(axis=-1)
    return np.stack([(low <= n) & (n <= high) for n in range(3)], axis=-1)


BOTH = tuple(itertools.product((False, True), repeat=2))
"""Whether something is so of the right leg and of the left one."""


def leg_codes(angles: Angles, thresholds: OwasThresholds, accuracy: Accuracy = 0.0) -> Possible:
    """Codes 2 to 6 of somebody who stands or kneels; sitting and walking cannot be seen from one posture."""
    t, m = thresholds, Measured(angles, accuracy)
    high = m.beyond("foot_rise", t.foot_rise)
    bent = m.beyond("knee_flexion", t.knee_bent)
    flat = m.beyond("shank_tilt", t.kneeling)
    may_raise, may_fold, may_lie = map(_both_may, (high, bent, flat))
    found = np.zeros((*angles.trunk_flexion.shape, 7), bool)
    for raised, folded in itertools.product(BOTH, repeat=2):
        legs = may_raise[raised] & may_fold[folded]
        for lying in BOTH:
            found[..., _leg_code(raised, folded, lying) - 1] |= legs & may_lie[lying]
    return found


def _leg_code(raised: tuple[bool, ...], bent: tuple[bool, ...], lying: tuple[bool, ...]) -> int:
    down = [side for side in range(2) if not raised[side]]
    if any(lying[side] for side in down):
        return 6
    if len(down) == 1:
        return 5 if bent[down[0]] else 3
    return 4 if any(bent) else 2


def _may(span: Span, value: bool) -> Possible:
    return np.asarray(span.high == 1 if value else span.low == 0)


def _both_may(span: Span) -> dict[tuple[bool, ...], Possible]:
    """Where the right leg may be so and the left one, by what each is."""
    right, left = (Span(span.low[..., side], span.high[..., side]) for side in range(2))
    return {both: _may(right, both[0]) & _may(left, both[1]) for both in BOTH}


NEUTRAL = {"back": 1, "arms": 1, "legs": 2, "load": 1}
"""The code of somebody who stands upright with empty hands."""
BONES_OF = {
    "back": ("lumbar", "thorax"),
    "arms": tuple(f"{side}_upper_arm" for side in SIDES),
    "legs": tuple(f"{side}_{bone}" for side in SIDES for bone in ("thigh", "shank")),
    "load": (),
}
ANGLES_OF = {
    "back": ("trunk_flexion", "trunk_twist", "trunk_side_bend"),
    "arms": ("arm_rise",),
    "legs": ("knee_flexion", "foot_rise", "shank_tilt"),
    "load": (),
}


class OwasPhase(Phase, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What OWAS asks and no posture shows, from `start` on; what is left out is not assessed."""

    load: Kilograms | None = None
    """Handled mass, or a force divided by 9.81 m/s² [kg]; 0 for none."""
    legs: Legs | None = None
    """How the legs are used; ``posture`` estimates it for somebody who stands or kneels."""

    @classmethod
    def read(cls, task: TaskPhase) -> Mapping[str, Any]:
        """Return the fields of the phase that this rule has words of its own for, by name."""
        return {"legs": next((code for code in Legs if code == task.legs), None)}


class Coded(NamedTuple):
    """What a category of one instant was looked up by."""

    angles: Angles
    measured: Mapping[str, Possible]
    spread: Mapping[str, Possible] | None
    """Codes within the accuracy; None when that is not known."""
    span: Span
    ends: tuple[int, int]
    """Of the category within the accuracy."""
    missing: tuple[str, ...]


class Owas(PostureRule, frozen=True, kw_only=True):
    """OWAS action category of a person's posture."""

    weighs_hands: ClassVar[bool] = True

    action_category: Literal[1, 2, 3, 4] | None = None
    """Highest admissible action category."""
    phases: tuple[OwasPhase, ...] = ()
    """Phases of the task, each from its `start` on; without any, those of ``[[phases]]``."""
    thresholds: OwasThresholds = OwasThresholds()
    """Where a posture counts as bent, twisted and so on."""

    @property
    def limit(self) -> int | None:
        """Greatest admissible action category."""
        return self.action_category

    @property
    def levels(self) -> tuple[Level, ...]:
        """Action categories, the lowest first."""
        return tuple(Level(up_to=k, name=f"action category {k}") for k in range(1, 5))

    def entered(self, model: Model) -> tuple[OwasPhase, ...]:
        """Phases of the rule, or else those that every rule shares."""
        return shared_phases(model, self.human, self.phases, OwasPhase.from_task)

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes the category."""
        read, held = bind_posture(model, self.human, self.unmeasured), bind_handled(model, self.human)
        phases, unknown, error = self.entered(model), OwasPhase(), self.error(model)

        def category(handled: Handled, angles: Angles, phase: OwasPhase) -> Figure:
            codes = partial(self.codes, angles, phase, handled=handled)
            measured = settled(codes(), codes(ROUNDING))
            spread = None if error is None else codes(error)
            span = category_span(**measured)
            reach = span if spread is None else category_span(**spread)
            if span.low.ndim:
                several = np.any([codes.sum(axis=-1)[..., 0] > 1 for codes in measured.values()], axis=0)
                value = np.where(span.low == span.high, span.high, np.nan)[:, 0]
                ends = reach.low[:, 0].astype(float), reach.high[:, 0].astype(float)
                return Figure(value, self.limit, interval=ends, open=several, exact=True)
            missing = tuple(key for key, possible in measured.items() if possible.sum() > 1)
            low, high = int(reach.low), int(reach.high)
            return Figure(
                int(span.high) if span.known else None,
                self.limit,
                interval=None if spread is None and not missing else (low, high),
                open=bool(missing),
                beside=Coded(angles, measured, spread, span, (low, high), missing),
            )

        def compute(twin: Twin) -> Figure:
            return by_phase(twin.t, read(twin), phases, unknown, partial(category, held(twin)))

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says and colours what drives the category."""
        return lambda state, figure, verdict: self._shown(figure, verdict)

    def one_by_one(self, model: Model) -> str:
        """Nothing: the category is of one posture."""
        return ""

    def codes(
        self, angles: Angles, phase: OwasPhase, accuracy: Accuracy = 0.0, handled: Handled = NOTHING
    ) -> dict[str, Possible]:
        """Possible codes of postures in a phase, each of shape (..., number of codes)."""
        least, most = load_range(phase.load, handled)
        if phase.legs is None:
            legs = np.ones(7, bool)
        elif phase.legs == Legs.POSTURE:
            legs = leg_codes(angles, self.thresholds, accuracy)
        else:
            legs = only(list(Legs).index(phase.legs) + 1, 7)
        return {
            "back": back_codes(angles, self.thresholds, accuracy),
            "arms": arm_codes(angles, accuracy),
            "legs": legs,
            "load": load_codes(None if most == math.inf else most, least),
        }

    def _shown(self, figure: Figure, verdict: Verdict | None) -> Shown:
        angles, measured, spread, span, (low, high), missing = cast("Coded", figure.beside)
        drivers = self._drivers(measured, span)
        value = None if figure.value is None else int(figure.value)
        reasons = []
        if missing:
            said = whatever_is_missing("category", low, high)
            reasons.append(f"not assessed: {', '.join(missing)}; {said}")
        elif verdict is Verdict.UNDECIDED:
            reasons.append(f"the accuracy leaves it open: the category lies between {low} and {high}")
        if drivers:
            reasons.append(", ".join(f"{key} {_text(measured[key])}" for key in drivers))
        if value is not None:
            reasons.append(f"action category {value:.0f}: {published('owas')['actions'][int(value) - 1]}")
        return Shown(
            "; ".join(reasons),
            lambda: tuple(
                Highlight(body=f"{self.human}/{bone}", verdict=verdict)
                for key in drivers
                for bone in BONES_OF[key]
            ),
            parts=tuple(
                _part(key, measured[key], None if spread is None else spread[key]) for key in measured
            ),
            rows=(
                total_row(
                    "",
                    (int(span.low), int(span.high)),
                    None if spread is None else (low, high),
                    (1, 4),
                    self.limit,
                    verdict,
                ),
                *(
                    self._row(key, angles, measured[key], None if spread is None else spread[key])
                    for key in measured
                ),
            ),
        )

    def _row(self, key: str, angles: Angles, measured: Possible, spread: Possible | None) -> Row:
        part, t = _part(key, measured, spread), self.thresholds
        edges = {
            "trunk_flexion": (-t.bent, t.bent),
            "trunk_twist": (-t.twisted, t.twisted),
            "trunk_side_bend": (-t.side_bent, t.side_bent),
            "arm_rise": (0.0,),
            "knee_flexion": (t.knee_bent,),
            "foot_rise": (t.foot_rise,),
            "shank_tilt": (t.kneeling,),
        }
        return Row(
            name=key,
            state=RowState.NOT_ASSESSED if part.value is None else RowState.JUDGED,
            value=part.value,
            scale=(1.0, float(CODES[key])),
            interval=part.interval,
            reason=part.reason,
            bones=tuple(f"{self.human}/{bone}" for bone in BONES_OF[key]),
            aspects=aspects(angles, ANGLES_OF[key], None, edges),
        )

    def _drivers(self, measured: Mapping[str, Possible], span: Span) -> list[str]:
        """Parts that alone, put back to upright, would lower the category most."""
        gains = {}
        for key, possible in measured.items():
            if possible.sum() == 1:
                instead = {**measured, key: only(NEUTRAL[key], CODES[key])}
                gains[key] = int(span.low - category_span(**instead).low)
        best = max(gains.values(), default=0)
        return [key for key, gain in gains.items() if gain == best] if best > 0 else []

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        return Basis(
            formula="action category of the code of back, arms, legs and load",
            source="Karhu et al. 1977, categories of Louhevaara and Suurnäkki 1992; each as at least three "
            "of five public implementations have it (2+), the papers were not read",
            inputs=(
                *provenance.motion(model, self.human),
                *entered(self.entered(model), OwasPhase()),
                *chosen(self.thresholds, OwasThresholds()),
                *posture_quality(self.accuracy, self.joint_accuracy, self.unmeasured, model, self.human),
                Input(
                    name="arm at or above shoulder level",
                    value="elbow or wrist at the height of the shoulder's joint or above",
                    origin=Origin.CHOICE,
                    source="a choice of seerob",
                ),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                "categories of the shares of time of single codes: the category is of one posture",
                NOTE,
                *((ACCURACY_NOTE,) if self.error(model) is not None else ()),
            ),
        )


def _text(possible: Possible) -> str:
    return " or ".join(str(code) for code in np.flatnonzero(possible) + 1)


def _part(key: str, measured: Possible, spread: Possible | None) -> Result:
    codes = np.flatnonzero(measured) + 1
    wide = codes if spread is None else np.flatnonzero(spread) + 1
    known = len(codes) == 1
    return Result(
        name=key,
        value=float(codes[0]) if known else None,
        verdict=None if known else Verdict.UNDECIDED,
        reason="" if known else f"not assessed: {_text(measured)}",
        interval=None if spread is None and known else (float(wide[0]), float(wide[-1])),
    )
