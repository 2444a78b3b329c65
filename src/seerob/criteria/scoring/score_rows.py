"""Rows of a result: one per component and side with its angles and bands, and one per total.

A band of a method is what an angle falls into, for whoever reads the score.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

from seerob.core.snapshot import Aspect, Result, Row, RowState, Verdict
from seerob.criteria.scoring.spans import ROUNDING, Thresholds
from seerob.description.humans.angles import SIDED, Angles
from seerob.description.humans.skeleton import SIDES

Edges = Mapping[str, tuple[float, ...]]
"""Name of an angle → where its bands end [rad], increasing."""


def degrees(*edges: float) -> tuple[float, ...]:
    """Return edges that are given in degrees [rad]."""
    return tuple(math.radians(edge) for edge in edges)


def modifier_edges(thresholds: Thresholds) -> dict[str, tuple[float, ...]]:
    """Bands of the angles that only add to a score."""
    t = thresholds
    both = {
        "trunk_twist": t.trunk_twist,
        "trunk_side_bend": t.trunk_side_bend,
        "neck_twist": t.neck_twist,
        "neck_side_bend": t.neck_side_bend,
        "wrist_deviation": t.wrist_deviation,
        "forearm_rotation": t.forearm_rotation,
        "shoulder_rotation": t.arm_rotated,
    }
    outward = {
        "shoulder_abduction": t.arm_abducted,
        "clavicle_elevation": t.shoulder_raised,
        "forearm_out": t.forearm_out,
        "wrist_across": t.wrist_across,
        "foot_rise": t.foot_rise,
    }
    return {
        **{name: (-edge, edge) for name, edge in both.items()},
        **{name: (edge,) for name, edge in outward.items()},
    }


NEUTRAL = {"elbow_flexion": math.radians(80)}
"""Name of an angle → the posture away from which its bands get stricter [rad], where that is not 0."""


class _Banded(NamedTuple):
    """Bands of an angle.

    An edge belongs to the stricter side, which is the one away from the neutral posture, as `reached` and
    `fallen` have it.
    """

    at: list[float]
    """Where a band begins that has its edge [rad], increasing."""
    past: list[float]
    """Where one begins that has not."""
    names: tuple[str, ...]

    def of(self, angle: float) -> str:
        """Band of an angle that is measured [rad]."""
        return self.names[bisect_right(self.at, angle) + bisect_left(self.past, angle)]


@cache
def _banded(edges: tuple[float, ...], neutral: float) -> _Banded:
    # What `reached(angle, edge)` and `not fallen(angle, edge)` compare with.
    at = sorted(edge - ROUNDING if edge else ROUNDING for edge in edges if edge >= neutral)
    past = sorted(edge + ROUNDING if edge else -ROUNDING for edge in edges if edge < neutral)
    return _Banded(at, past, _bands(edges))


@cache
def _bands(edges: tuple[float, ...]) -> tuple[str, ...]:
    shown = [f"{math.degrees(edge):.4g}°".replace("-", "−") for edge in sorted(edges)]
    return f"below {shown[0]}", *(f"{a} to {b}" for a, b in pairwise(shown)), f"beyond {shown[-1]}"


BONES_OF: dict[str, tuple[str, ...]] = {
    "upper arm": ("{side}_upper_arm",),
    "lower arm": ("{side}_forearm",),
    "wrist": ("{side}_hand",),
    "wrist twist": ("{side}_hand", "{side}_forearm"),
    "neck": ("neck", "head"),
    "trunk": ("lumbar", "thorax"),
    "legs": ("right_thigh", "right_shank", "left_thigh", "left_shank"),
}
"""Component → bones that are coloured."""
ANGLES_OF: dict[str, tuple[str, ...]] = {
    "upper arm": ("shoulder_flexion", "shoulder_abduction", "clavicle_elevation"),
    "lower arm": ("elbow_flexion", "forearm_out", "wrist_across"),
    "wrist": ("wrist_flexion", "wrist_deviation"),
    "wrist twist": ("forearm_rotation",),
    "neck": ("neck_flexion", "neck_side_bend", "neck_twist"),
    "trunk": ("trunk_flexion", "trunk_side_bend", "trunk_twist"),
    "legs": ("knee_flexion", "foot_rise"),
}
"""Component → angles that it is made of, for whoever reads the result."""


Ends = tuple[tuple[str, tuple[int, ...], tuple[int, ...]], ...]
"""Components with their least and greatest score: of both sides, or one for both."""


class Seen(NamedTuple):
    """An angle of one side, as it is shown."""

    name: str
    side: int | None
    """Index of its side; None of an angle that has none."""
    label: str
    """``right knee flexion``."""
    bands: _Banded | None


class Component(NamedTuple):
    """What is shown of a component and side, but for its angles."""

    row: Row
    part: Result
    missing: str
    """What the reason of the part begins with."""
    angles: tuple[Seen, ...]


def components_of(
    components: Ends,
    spread: Ends | None,
    *,
    human: str,
    least: Mapping[str, int],
    most: Mapping[str, int],
    edges: Edges,
) -> tuple[Component, ...]:
    """What is shown of each component and side, as long as its scores stay.

    Args:
        components: Scores as they were measured.
        spread: The same within the accuracy, in the same order; None when that is not known.
        human: Whose bones.
        least: Least score of each component.
        most: Greatest score of each component.
        edges: Bands of the angles.
    """
    found = []
    for (key, lows, highs), (_, widest, highest) in zip(components, spread or components, strict=True):
        sided = len(lows) > 1
        for i, (low, high) in enumerate(zip(lows, highs, strict=True)):
            side = SIDES[i] if sided else ""
            known = low == high
            value = float(low) if known else None
            interval = None if spread is None and known else (float(widest[i]), float(highest[i]))
            row = Row(
                name=key,
                side=side,
                state=RowState.JUDGED if known else RowState.NOT_ASSESSED,
                value=value,
                scale=(float(least[key]), float(most[key])),
                interval=interval,
                reason="" if known else "not measured or not entered",
                bones=_bones(human, key, side),
            )
            part = Result(
                name=f"{SIDES[i]} {key}" if sided else key,
                value=value,
                verdict=None if known else Verdict.UNDECIDED,
                interval=interval,
            )
            seen = _seen(ANGLES_OF.get(key, ()), i if sided else None, edges)
            found.append(Component(row, part, "" if known else "not assessed", seen))
    return tuple(found)


def component_rows(components: Sequence[Component], angles: Angles) -> tuple[list[Result], list[Row]]:
    """Parts of a result and its rows, one per component and side.

    Args:
        components: What is shown of them whatever the angles.
        angles: Of the posture.
    """
    parts, rows, listed = list[Result](), list[Row](), angles.listed
    for row, part, missing, seen in components:
        shown, words = _aspects(listed, seen), [missing] if missing else []
        said = ", ".join([f"{each.name} {_degrees(each.value)}" for each in shown])
        words += [said] if said else []
        parts.append(
            Result(
                name=part.name, value=part.value, verdict=part.verdict, interval=part.interval,
                reason="; ".join(words),
            )
        )  # fmt: skip
        rows.append(
            Row(
                name=row.name, side=row.side, state=row.state, value=row.value, scale=row.scale,
                interval=row.interval, reason=row.reason, bones=row.bones, aspects=shown,
            )
        )  # fmt: skip
    return parts, rows


def _degrees(angle: float | None) -> str:
    return "not measured" if angle is None else f"{round(math.degrees(angle))}°"


@cache
def _bones(human: str, component: str, side: str) -> tuple[str, ...]:
    return tuple(f"{human}/{bone.format(side=side)}" for bone in BONES_OF.get(component, ()))


def total_row(
    side: str,
    ends: tuple[float, float],
    reach: tuple[float, float] | None,
    scale: tuple[float, float],
    limit: float | None,
    verdict: Verdict | None,
) -> Row:
    """The row of a total.

    Args:
        side: ``right``, ``left`` or empty for the whole.
        ends: Least and greatest score as measured.
        reach: The same within the accuracy; None when that is not known.
        scale: Best and worst score of the method.
        limit: Greatest admissible score.
        verdict: Of the score.
    """
    known = ends[0] == ends[1]
    shown = None if reach is None and known else ends if reach is None else reach
    return Row(
        name="score",
        side=side,
        state=RowState.JUDGED if known else RowState.NOT_ASSESSED,
        value=float(ends[0]) if known else None,
        limit=limit,
        scale=(float(scale[0]), float(scale[1])),
        interval=None if shown is None else (float(shown[0]), float(shown[1])),
        verdict=verdict,
        reason="" if known else "not assessed in full",
    )


def aspects(angles: Angles, names: Sequence[str], side: int | None, edges: Edges) -> tuple[Aspect, ...]:
    """Angles with the bands that they fall into; of both sides where a component has none."""
    return _aspects(angles.listed, _seen(names, side, edges))


def _seen(names: Sequence[str], side: int | None, edges: Edges) -> tuple[Seen, ...]:
    found = []
    for name in names:
        label, ends = name.replace("_", " "), edges.get(name, ())
        bands = _banded(tuple(ends), NEUTRAL.get(name, 0.0)) if ends else None
        if name not in SIDED:
            found.append(Seen(name, None, label, bands))
        elif side is not None:
            found.append(Seen(name, side, label, bands))
        else:
            found += [Seen(name, i, f"{own} {label}", bands) for i, own in enumerate(SIDES)]
    return tuple(found)


def _aspects(listed: Mapping[str, Any], seen: Sequence[Seen]) -> tuple[Aspect, ...]:
    found = []
    for name, side, label, bands in seen:
        value = listed[name] if side is None else listed[name][side]
        if value != value:  # noqa: PLR0124 - a NaN
            found.append(Aspect(name=label, unit="rad"))
        else:
            band = "" if bands is None else bands.of(value)
            found.append(Aspect(name=label, value=value, unit="rad", band=band))
    return tuple(found)
