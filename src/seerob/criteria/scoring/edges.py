"""An angle at a threshold: one rule for all methods, on the stricter side.

What is measured is never exactly 45°. What is computed may be, and then the last bit decides, which changes
with where a person stands and faces. So an angle within rounding of a threshold counts as beyond it, away
from the neutral posture, whatever side a method's wording gives the edge itself to.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array

ROUNDING = 1e-6
"""Angles that differ by less [rad] are the same: no device is as good, and no rounding of ours as bad."""


def reached(angle: Array | float, edge: float) -> NDArray[np.bool_]:
    """Whether an angle is at an edge or beyond it [rad]; at an edge of 0, which is neutral, only beyond.

    What is not a number is, so that it never scores least.
    """
    return np.asarray(~(np.asarray(angle) < (edge - ROUNDING if edge else ROUNDING)))


def fallen(angle: Array | float, edge: float) -> NDArray[np.bool_]:
    """Whether an angle is at an edge or below it [rad]; at an edge of 0 only below."""
    return reached(-np.asarray(angle), -edge)
