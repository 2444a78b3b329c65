"""OWAS as pure functions: Karhu et al. 1977, action categories of Louhevaara and Suurnäkki 1992.

The category does not grow with each code, so what is not known is a set of codes, not a span.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from enum import StrEnum

import numpy as np
from msgspec import Struct
from numpy.typing import ArrayLike, NDArray

from seerob.core.domains import number, whole
from seerob.criteria.scoring.edges import ROUNDING
from seerob.criteria.scoring.measured import Accuracy, Measured
from seerob.criteria.scoring.published import Ints, cells
from seerob.criteria.scoring.spans import Span, either
from seerob.criteria.scoring.thresholds import Angle
from seerob.description.humans.angles import Angles

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


def category_span(back: Possible, arms: Possible, legs: Possible, load: Possible) -> Span:
    """Least and greatest category of all codes that are possible, shape (...)."""
    every = (
        back[..., :, None, None, None]
        & arms[..., None, :, None, None]
        & legs[..., None, None, :, None]
        & load[..., None, None, None, :]
    )
    table = cells("owas", "category")
    axes = (-4, -3, -2, -1)
    low = np.where(every, table, table.max()).min(axis=axes)
    return Span(low, np.where(every, table, table.min()).max(axis=axes))


def settled(codes: Mapping[str, Possible], around: Mapping[str, Possible]) -> dict[str, Possible]:
    """Codes of a posture at a threshold: those of the greatest category, which does not grow with each code.

    Args:
        codes: Possible codes by component, in the order of `owas`, shape (number of codes) each.
        around: The same with every angle off by rounding.
    """
    sets = {key: own if own.sum() > 1 else around[key] for key, own in codes.items()}
    every = np.ix_(*(np.flatnonzero(sets[key]) for key in CODES))
    found = cells("owas", "category")[every]
    worst = np.unravel_index(found.argmax(), found.shape)
    picked = {key: int(every[k].ravel()[i]) for (k, key), i in zip(enumerate(CODES), worst, strict=True)}
    return {key: own if own.sum() > 1 else only(picked[key] + 1, len(own)) for key, own in codes.items()}


def only(code: int, of: int) -> Possible:
    """The set of one code."""
    return np.asarray(np.arange(1, of + 1) == whole("code", code, 1, of))


def load_codes(kg: float | None) -> Possible:
    """1 below 10 kg, 2 up to 20 kg, 3 beyond; all when nobody said."""
    if kg is None:
        return np.ones(3, bool)
    number("load", kg, 0, unit="kg")
    return only(1 + (kg >= 10) + (kg > 20), 3)


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
