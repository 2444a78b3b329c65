"""Rows of a result: one per component and side with its angles and bands, and one per total.

A band of a method is what an angle falls into, for whoever reads the score.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import pairwise

from seerob.core.snapshot import Aspect, Row, RowState, Verdict
from seerob.criteria.scoring.spans import Thresholds, fallen, reached
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


def band_of(angle: float, edges: Sequence[float], neutral: float = 0.0) -> str:
    """``20° to 45°`` of an angle [rad]; empty for one that is not measured or has no bands."""
    if not edges or math.isnan(angle):
        return ""
    # An edge belongs to the stricter side, which is the one away from the neutral posture.
    at = sum(reached(angle, edge) if edge >= neutral else not fallen(angle, edge) for edge in edges)
    return _bands(tuple(edges))[at]


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


def component_rows(
    components: Ends,
    spread: Ends | None,
    angles: Angles,
    *,
    human: str,
    least: Mapping[str, int],
    most: Mapping[str, int],
    edges: Edges,
) -> tuple[Row, ...]:
    """A row per component and side.

    Args:
        components: Scores as they were measured.
        spread: The same within the accuracy, in the same order; None when that is not known.
        angles: Of the posture.
        human: Whose bones.
        least: Least score of each component.
        most: Greatest score of each component.
        edges: Bands of the angles.
    """
    rows = []
    for (key, lows, highs), (_, widest, highest) in zip(components, spread or components, strict=True):
        sided = len(lows) > 1
        for i, (low, high) in enumerate(zip(lows, highs, strict=True)):
            side = SIDES[i] if sided else ""
            known = low == high
            rows.append(
                Row(
                    name=key,
                    side=side,
                    state=RowState.JUDGED if known else RowState.NOT_ASSESSED,
                    value=float(low) if known else None,
                    scale=(float(least[key]), float(most[key])),
                    interval=None if spread is None and known else (float(widest[i]), float(highest[i])),
                    reason="" if known else "not measured or not entered",
                    bones=_bones(human, key, side),
                    aspects=aspects(angles, ANGLES_OF.get(key, ()), i if sided else None, edges),
                )
            )
    return tuple(rows)


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
    found = []
    for name in names:
        values = angles.listed[name]
        label = name.replace("_", " ")
        if name not in SIDED:
            pairs = [(label, values)]
        elif side is not None:
            pairs = [(label, values[side])]
        else:
            pairs = [(f"{own} {label}", x) for own, x in zip(SIDES, values, strict=True)]
        for text, value in pairs:
            measured = value == value  # noqa: PLR0124 - not a NaN
            found.append(
                Aspect(
                    name=text,
                    value=value if measured else None,
                    unit="rad",
                    band=band_of(value, edges.get(name, ()), NEUTRAL.get(name, 0.0)),
                )
            )
    return tuple(found)
