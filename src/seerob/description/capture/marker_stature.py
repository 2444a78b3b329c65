"""The stature of a person of whom only markers on the skin are seen: that of the body which fits them best.

Between markers lies no bone's length. But bodies of several statures, with the usual proportions and the
markers at their nominal places, are fitted to frames of the recording; a parabola through the smallest mean
distance and its neighbours tells the stature. Parts of the recording, each by itself, tell the spread.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.capture.captured import Captured, CaptureFrame
from seerob.description.capture.fit_check import look, spread
from seerob.description.capture.observing import Observer
from seerob.description.description import Description
from seerob.description.humans.skeleton import without_side

LEGS, UPPER = ("thigh", "shank", "foot", "toes"), ("thorax", "neck", "head", "clavicle", "upper_arm")
"""Markers on both tell how tall somebody is; on one of them they tell the size of a limb."""
STATURES = np.arange(1.40, 2.11, 0.10)
"""Tried [m]."""
FRAMES, PARTS = 12, 3
"""Looked at, and parts that each tell the stature by themselves."""
WIDEST = 0.20
"""Parts that differ by more [m] tell nothing."""

Bound = Callable[[float], tuple[Description, Observer]]
"""Stature [m] → a person of it, and the recording's markers on that person."""


@dataclass(frozen=True)
class MarkerStature:
    """What markers tell."""

    stature: float
    """[m]"""
    lowest: float
    """Lowest stature of the parts of the recording [m]."""
    highest: float
    residual: float
    """Median distance of the markers from where the best body has them [m]."""

    def finding(self, name: str) -> Finding:
        """What is told of it."""
        text = (
            f"stature {self.stature:.2f} m estimated from markers (parts of the recording say "
            f"{self.lowest:.2f} to {self.highest:.2f} m; markers {1e3 * self.residual:.0f} mm off); unusual "
            "proportions or places of the markers are not in that spread: measure, and give --stature"
        )
        return Finding(level="assumed", subject=name, text=text)


def marker_stature(captured: Captured, bound: Bound, *, name: str) -> MarkerStature:
    """Estimate the stature.

    Args:
        captured: A recording of markers.
        bound: Makes a person and binds the markers.
        name: Of the person, for messages.

    Raises:
        InputError: Markers do not span the body, or do not agree on a stature.
    """
    _, observer = bound(float(STATURES[len(STATURES) // 2]))
    bones = {without_side(row.bone) for row in observer.rows}
    if not (bones & set(LEGS) and bones & set(UPPER)):
        what = f"markers on {', '.join(sorted(bones))} alone do not tell how tall the person is"
        raise InputError.at(name, "stature", what, "give --stature in metres, such as 1.75")
    frames = spread(captured, FRAMES)
    parts = [frames[k::PARTS] for k in range(PARTS)]
    bodies = [bound(float(s)) for s in STATURES]
    off = np.array([[_off(part, *body) for body in bodies] for part in parts])
    found = [_lowest(row) for row in (off.mean(axis=0), *off)]
    if not np.isfinite(found).all() or max(found) - min(found) > WIDEST:
        shown = ", ".join(f"{value:.2f}" if np.isfinite(value) else "none" for value in found[1:])
        what = f"markers do not agree on a stature (parts of the recording say {shown} m)"
        raise InputError.at(name, "stature", what, "give --stature in metres, such as 1.75")
    best, *each = found
    residual = float(np.interp(best, STATURES, off.mean(axis=0)))
    return MarkerStature(best, min(each), max(each), residual)


def _off(frames: Sequence[CaptureFrame], description: Description, observer: Observer) -> float:
    """Root mean square over the markers of their median distances [m]."""
    fit, _ = look(frames, observer, description, np.eye(4))
    return float(np.sqrt(np.mean(np.square(list(fit.away.values()))))) if fit.away else np.nan


def _lowest(off: Array) -> float:
    """Where a parabola through the smallest value and its neighbours is lowest [m]; NaN at the ends."""
    if not np.isfinite(off).all():
        return np.nan
    k = int(off.argmin())
    if k in (0, len(off) - 1):
        return np.nan
    before, here, after = off[k - 1 : k + 2]
    step = 0.5 * (before - after) / (before - 2 * here + after)
    return float(STATURES[k] + step * (STATURES[1] - STATURES[0]))
