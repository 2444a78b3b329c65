"""Posture screening in the style of the EAWS form, sections 0 and 1: lines, points over time, asymmetry.

This is not the EAWS: its figures come from one public code and from memory, sections 2 to 4 are not public.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from functools import cache
from typing import NamedTuple

import numpy as np
from msgspec import Struct

from seerob.core.domains import number
from seerob.core.errors import UnknownName
from seerob.criteria.scoring.edges import ROUNDING, reached
from seerob.criteria.scoring.measured import Accuracy, Measured
from seerob.criteria.scoring.published import published
from seerob.criteria.scoring.spans import Span
from seerob.criteria.scoring.thresholds import Angle
from seerob.description.humans.angles import Angles
from seerob.workstation.tables.task_phase import Stance

_ROUNDING = 1e-9


class Interpolation(StrEnum):
    """What lies between two columns of the form."""

    LINEAR = "linear"
    """Linear between columns, proportional below the first, the last column beyond it."""
    STEP = "step"
    """The column that was reached; 0 below the first."""


class EawsThresholds(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Angles at which a posture belongs to a line."""

    bent: Angle = math.radians(20)
    """Trunk bent forward from here on [rad]."""
    far_bent: Angle = math.radians(60)
    """Trunk strongly bent forward beyond [rad]."""
    overhead: Angle = math.radians(40)
    """Elbow or wrist above the horizontal through the shoulder by more: hands above head [rad]; a choice."""
    crouching: Angle = math.radians(60)
    """Both knees bent beyond [rad]: crouching; a choice."""
    kneeling: Angle = math.radians(60)
    """Shank from the vertical beyond [rad]: kneeling; a choice."""


class Line(NamedTuple):
    """One line of the form."""

    id: str
    name: str
    position: str
    points: tuple[float, ...]
    confidence: str


@cache
def lines() -> dict[str, Line]:
    """The lines by their number."""
    rows = published("eaws_posture")["lines"]
    return {row["id"]: Line(**{**row, "points": tuple(map(float, row["points"]))}) for row in rows}


POSITIONS: Mapping[Stance, str] = {
    "sitting": "sitting",
    "standing": "standing",
    "one_leg": "standing",
    "walking": "walking",
    "both_knees_bent": "kneeling",
    "one_knee_bent": "kneeling",
    "kneeling": "kneeling",
    "lying": "lying",
    "climbing": "climbing",
}
"""How the legs are used → group of lines."""


def line_points(line: str, share: float, interpolation: Interpolation = Interpolation.LINEAR) -> float:
    """Points of a posture that lasts for a share of the time, 0 to 1."""
    if line not in lines():
        raise UnknownName("line of the form", line, lines())
    number("share", share, 0, 1 + _ROUNDING)
    points = lines()[line].points
    shares = published("eaws_posture")["shares"][: len(points)]
    if Interpolation(interpolation) is Interpolation.STEP:
        reached = int(np.searchsorted(shares, share + _ROUNDING, side="right"))
        return points[reached - 1] if reached else 0.0
    return float(np.interp(share, [0.0, *shares], [0.0, *points]))


def asymmetry_points(at_least: tuple[float, ...]) -> float:
    """Points of a trunk that is turned, or bent sideways.

    Args:
        at_least: Share of the time at or beyond each of the form's three angles.
    """
    table = published("eaws_posture")
    number("share", at_least, 0, 1 + _ROUNDING)
    best = 0.0
    for share, points in zip(at_least, table["asymmetry_points"], strict=True):
        reached = int(np.searchsorted(table["asymmetry_shares"], share + _ROUNDING, side="right"))
        factor = table["asymmetry_factors"][reached - 1] if reached else 0.0
        best = max(best, points * factor)
    return float(min(best, table["asymmetry_most"]))


def possible_lines(
    angles: Angles,
    *,
    legs: Stance | None,
    supported: bool | None,
    thresholds: EawsThresholds,
    accuracy: Accuracy = 0.0,
) -> tuple[str, ...]:
    """Lines that a posture may belong to; one when it is known.

    Of several that fit, a posture belongs to the one with the most points: bent or arms raised.

    Args:
        angles: Of one posture.
        legs: How they are used; ``posture`` tells standing, crouching and kneeling apart.
        supported: Whether the trunk is well supported; None when nobody said.
        thresholds: Of the lines.
        accuracy: Of each angle [rad].
    """
    t, m = thresholds, Measured(angles, accuracy)
    bent = m.graded(
        "trunk_flexion",
        lambda x: reached(x, t.bent).astype(np.int64) + reached(x, t.far_bent),
        within=(0, 2),
        neutral=-math.inf,
    )
    arms = _highest(
        m.graded(
            "arm_rise",
            lambda x: (x >= -ROUNDING).astype(np.int64) + reached(x, t.overhead),
            within=(0, 2),
            neutral=-math.inf,
        )
    )
    positions = _positions(m, legs, t)
    held = [supported] if supported is not None else [True, False]
    found: dict[str, None] = {}
    for position in positions:
        for b in range(int(bent.low), int(bent.high) + 1):
            for a in range(int(arms.low), int(arms.high) + 1):
                for support in held:
                    found[_line(position, b, a, support)] = None
    return tuple(sorted(found, key=_weight))


def _highest(span: Span) -> Span:
    return Span(span.low.max(axis=-1), span.high.max(axis=-1))


def _positions(measured: Measured, legs: Stance | None, t: EawsThresholds) -> tuple[str, ...]:
    if legs is None:
        return tuple(dict.fromkeys(POSITIONS.values()))
    if legs != "posture":
        return (POSITIONS[legs],)
    folded = measured.beyond("knee_flexion", t.crouching)
    flat = measured.beyond("shank_tilt", t.kneeling)
    low = folded.low.min() == 1 or flat.low.max() == 1
    high = folded.high.min() == 1 or flat.high.max() == 1
    return ("kneeling",) if low else ("standing", "kneeling") if high else ("standing",)


def _line(position: str, bent: int, arms: int, supported: bool) -> str:
    if position in ("lying", "climbing"):
        return {"lying": "15", "climbing": "16"}[position]
    if position == "sitting":
        upright = "9" if bent else "7" if supported else "8"
        return (upright, "10", "11")[arms]
    if position == "kneeling":
        upright = "13" if bent else "12"
        return upright if arms == 0 else "14"
    upright = "1" if supported or position == "walking" else "2"
    trunk = (upright, "3b" if supported else "3a", "4b" if supported else "4a")[bent]
    return max((trunk, (trunk, "5", "6")[arms]), key=_weight)


def _weight(line: str) -> float:
    return line_points(line, 0.66)
