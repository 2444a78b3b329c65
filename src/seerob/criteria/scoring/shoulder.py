"""Which angle stands for the flexion of the upper arm."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

import numpy as np

from seerob.core.transforms import Array
from seerob.criteria.scoring.edges import ROUNDING
from seerob.criteria.scoring.measured import Measured, turned
from seerob.criteria.scoring.published import Ints
from seerob.criteria.scoring.spans import Span, graded


class ArmPolicy(StrEnum):
    """How an arm that is raised neither forward nor sideways is read."""

    PROJECTION = "projection"
    """The arm as seen from the side, as the methods' pictures show it."""
    ELEVATION = "elevation"
    """The whole angle to the trunk while the arm points within 60° of forward; up to 90° the arm only
    counts as abducted; behind, the arm as seen from the side."""


WIDEST = np.pi / 3
"""Direction from forward up to which the elevation stands for the flexion [rad], a choice."""
BASE = (1, 4)
"""Least and greatest score of an upper arm without modifiers."""


def arm_score(measured: Measured, score: Callable[[Array], Ints], policy: ArmPolicy) -> Span:
    """Score of the upper arm without modifiers, shape (..., 2).

    Seen from the side, an arm that points sideways has no direction: with its angle λ out of the
    sagittal plane, an error δ turns the projection by up to ``arcsin(sin δ / cos λ)``. So does the
    direction in which an arm points, with its elevation θ, by ``arcsin(sin δ / sin θ)``.

    Args:
        measured: Angles of the postures; the accuracy of the flexion is that of the arm's direction.
        score: 1 to 4 of a flexion [rad], least at 0.
        policy: Which angle it is asked for.
    """
    angles = measured.angles
    accuracy = measured.error("shoulder_flexion", "shoulder_elevation")
    flexion, side = angles.shoulder_flexion, angles.shoulder_abduction
    spread = turned(accuracy, np.cos(side))
    rounding = turned(ROUNDING, np.cos(np.where(np.isnan(side), 0.0, side)))
    if ArmPolicy(policy) is ArmPolicy.PROJECTION:
        return _projected(flexion, score, spread, rounding)
    azimuth = np.abs(np.arctan2(np.sin(side), np.cos(side) * np.sin(flexion)))
    lever = np.sin(angles.shoulder_elevation)
    swing, off = turned(accuracy, lever), turned(ROUNDING, lever)
    ahead = graded(angles.shoulder_elevation, score, within=BASE, accuracy=accuracy)
    beside = graded(np.zeros_like(flexion), score, within=BASE)
    behind = _projected(flexion, score, spread, rounding)
    lowest, highest = np.full(flexion.shape, BASE[1]), np.full(flexion.shape, BASE[0])
    for span, first, last in (
        (ahead, -np.inf, WIDEST),
        (beside, WIDEST, np.pi / 2),
        (behind, np.pi / 2, np.inf),
    ):
        # An edge belongs to both: what is said of an arm exactly there is the worse of the two.
        possible = ~((azimuth + swing < first) | (azimuth - swing > last))
        rounded = ~((azimuth + swing + off < first) | (azimuth - swing - off > last))
        lowest = np.where(possible, np.minimum(lowest, span.low), lowest)
        highest = np.where(rounded, np.maximum(highest, span.high), highest)
    missing = np.isnan(flexion)
    return Span(lowest if np.any(accuracy) else np.where(missing, BASE[0], highest), highest)


def _projected(
    flexion: Array, score: Callable[[Array], Ints], spread: Array | float, rounding: Array | float
) -> Span:
    """Score of the flexion, which goes on at 270° where it ends at -90°."""
    span = graded(flexion, score, within=BASE, accuracy=spread, rounding=rounding)
    ends = score(np.array([-np.pi / 2, 3 * np.pi / 2]))

    def around(off: Array | float) -> Array:
        return np.asarray((flexion - off < -np.pi / 2) | (flexion + off > 3 * np.pi / 2))

    high = np.where(around(spread + rounding), np.maximum(span.high, ends.max()), span.high)
    if not np.any(spread):
        return Span(np.where(np.isnan(flexion), span.low, high), high)
    return Span(np.where(around(spread), np.minimum(span.low, ends.min()), span.low), high)
