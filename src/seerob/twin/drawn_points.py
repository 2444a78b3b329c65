"""Where points of frames were at one tick, worked out when somebody draws them, maybe ticks later."""

from __future__ import annotations

import numpy as np

from seerob.core.transforms import Array
from seerob.model.model import Frame

MOST = 512
"""Points of frames that are kept from tick to tick."""
Local = tuple[Frame, int, float, float, float]
"""A frame, MuJoCo's body that it is on, and a point of it as that body has it [m]."""


class DrawnPoints:
    """Where MuJoCo's bodies were at one tick, for what is drawn later.

    Args:
        xmat: World from body, row by row, shape (m, 9).
        xpos: [m], shape (m, 3).
        local: What of the points that are drawn is the same at all ticks.
    """

    def __init__(self, xmat: Array, xpos: Array, local: dict[tuple[int, bytes], Local]) -> None:
        # MuJoCo writes through its own at the next tick.
        self._xmat, self._xpos = xmat.copy(), xpos.copy()
        self._local = local
        self._points: dict[tuple[int, bytes], tuple[Frame, Array]] = {}

    def point(self, frame: Frame, offset: Array) -> Array:
        """Where a point of a frame was [m], shape (3,): worked out once for all that draw there."""
        key = id(frame), offset.tobytes()
        kept = self._points.get(key)
        if kept is None:
            bound = self._local.get(key)
            if bound is None or bound[0] is not frame:
                ox, oy, oz = offset.tolist()
                x, y, z = (a * ox + b * oy + c * oz + d for a, b, c, d in frame.body_from_frame[:3].tolist())
                if len(self._local) >= MOST:
                    self._local.clear()
                bound = self._local[key] = frame, frame.mj, x, y, z
            _, body, x, y, z = bound
            a, b, c, d, e, f, g, h, i = self._xmat[body].tolist()
            px, py, pz = self._xpos[body].tolist()
            found = np.array(
                (px + (a * x + b * y + c * z), py + (d * x + e * y + f * z), pz + (g * x + h * y + i * z))
            )
            found.setflags(write=False)
            # With the frame itself: another one may get the id of one that is forgotten.
            kept = self._points[key] = frame, found
        return kept[1]
