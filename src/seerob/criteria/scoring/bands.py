"""Which band of a method an angle falls into, for whoever reads the score."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from seerob.criteria.scoring.edges import fallen, reached
from seerob.criteria.scoring.thresholds import Thresholds

Edges = Mapping[str, tuple[float, ...]]
"""Name of an angle → where its bands end [rad], increasing."""


def _deg(*edges: float) -> tuple[float, ...]:
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


def rula_edges(thresholds: Thresholds) -> Edges:
    """Bands of RULA's angles."""
    t = thresholds
    return {
        **modifier_edges(t),
        "shoulder_flexion": _deg(-20, 20, 45, 90),
        "elbow_flexion": _deg(60, 100),
        "wrist_flexion": (*_deg(-15), -t.wrist_neutral, t.wrist_neutral, *_deg(15)),
        "neck_flexion": (-t.neck_extension, *_deg(10, 20)),
        "trunk_flexion": (-t.trunk_upright, t.trunk_upright, *_deg(20, 60)),
    }


def reba_edges(thresholds: Thresholds) -> Edges:
    """Bands of REBA's angles."""
    t = thresholds
    return {
        **modifier_edges(t),
        "shoulder_flexion": _deg(-20, 20, 45, 90),
        "elbow_flexion": _deg(60, 100),
        "wrist_flexion": _deg(-15, 15),
        "neck_flexion": (-t.neck_extension, *_deg(20)),
        "trunk_flexion": (*_deg(-20), -t.trunk_upright, t.trunk_upright, *_deg(20, 60)),
        "knee_flexion": _deg(30, 60),
    }


NEUTRAL = {"elbow_flexion": math.radians(80)}
"""Name of an angle → the posture away from which its bands get stricter [rad], where that is not 0."""


def band_of(angle: float, edges: Sequence[float], neutral: float = 0.0) -> str:
    """``20° to 45°`` of an angle [rad]; empty for one that is not measured or has no bands."""
    if not edges or math.isnan(angle):
        return ""
    shown = [f"{math.degrees(edge):.4g}°".replace("-", "−") for edge in sorted(edges)]
    # An edge belongs to the stricter side, which is the one away from the neutral posture.
    at = sum(bool(reached(angle, edge) if edge >= neutral else not fallen(angle, edge)) for edge in edges)
    if at == 0:
        return f"below {shown[0]}"
    return f"beyond {shown[-1]}" if at == len(shown) else f"{shown[at - 1]} to {shown[at]}"
