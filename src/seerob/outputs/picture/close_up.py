"""A close-up in a corner, for what decides and is too small to see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seerob.core.snapshot import Marker, Segment
from seerob.outputs.picture.camera import Camera, look_along
from seerob.outputs.picture.canvas import OVERSAMPLING, Canvas

SHORT = 0.11
"""A segment shorter than this part of the picture's width gets a close-up."""
_PART = 0.3
_SMALLEST = 0.06
_RIM = (58, 68, 80)


def close_up(camera: Camera, markers: tuple[Marker, ...]) -> Camera | None:
    """The view of the first segment from nearby; None when it is long enough as it is."""
    segment = next((m for m in markers if isinstance(m, Segment)), None)
    if segment is None:
        return None
    ends = np.array([segment.start, segment.end], float)
    screen, inverse = camera.project(ends)
    if not (inverse > 0).all() or np.hypot(*(screen[1] - screen[0])) > SHORT * camera.width:
        return None
    forward = camera.axes[2]
    azimuth = float(np.arctan2(-forward[1], -forward[0]))
    elevation = float(np.arcsin(np.clip(-forward[2], -1, 1)))
    reach = max(float(np.linalg.norm(ends[1] - ends[0])), _SMALLEST)
    middle = ends.mean(axis=0)
    around = middle + reach * np.concatenate([np.eye(3), -np.eye(3)])
    side = round(_PART * camera.width)
    return look_along(azimuth, elevation, around, (side, round(0.8 * side)))


def inset(image: NDArray[np.uint8], canvas: Canvas, small: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """``small`` with a rim in the corner of ``image`` where it hides the least of the bodies."""
    height, width = small.shape[:2]
    gap = 10
    down, across = image.shape[0] - height - gap, image.shape[1] - width - gap
    if down < gap or across < gap:
        return image

    def hidden(corner: tuple[int, int]) -> int:
        y, x = corner[0] * OVERSAMPLING, corner[1] * OVERSAMPLING
        window = canvas.owner[y : y + height * OVERSAMPLING, x : x + width * OVERSAMPLING]
        return int(np.count_nonzero(window >= 0))

    y, x = min([(gap, gap), (gap, across), (down, gap), (down, across)], key=hidden)
    result = image.copy()
    result[y - 2 : y + height + 2, x - 2 : x + width + 2] = _RIM
    result[y : y + height, x : x + width] = small
    return result
