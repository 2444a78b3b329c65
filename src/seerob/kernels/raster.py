r"""Triangles onto pixels with a depth buffer.

A triangle with screen corners :math:`p_0, p_1, p_2` covers the pixel centre :math:`p` when the three
edge functions :math:`e_i(p) = (p_{i+1} - p_i) \times (p - p_i)` have the sign of its area
:math:`A = e_0 + e_1 + e_2`; the barycentric weights are :math:`e_i / A`. What is linear in space over
depth is linear on the screen, so :math:`1/z` is interpolated there and the largest wins.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Ints = NDArray[np.int32]


@njit(cache=True, nogil=True, error_model="numpy")
def raster(
    points: Array,
    inverse_depth: Array,
    shade: Array,
    faces: Ints,
    ids: Ints,
    depth: Array,
    lit: Array,
    owner: Ints,
) -> None:
    """Draw opaque triangles into the three buffers.

    Args:
        points: Screen position of the vertices [px], x right, y down, shape (n, 2).
        inverse_depth: 1/z of the vertices [1/m], z > 0 in front of the camera, shape (n,). A triangle
            with a corner at or behind the camera (value <= 0) is left out.
        shade: Brightness of the vertices, shape (n,).
        faces: Corners, shape (m, 3).
        ids: What a triangle belongs to, at least 0, shape (m,).
        depth: Buffer of 1/z, 0 where nothing is drawn, shape (height, width); written.
        lit: Buffer of brightness, same shape; written.
        owner: Buffer of ids, same shape; written.
    """
    height, width = depth.shape
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        za, zb, zc = inverse_depth[a], inverse_depth[b], inverse_depth[c]
        if not (za > 0 and zb > 0 and zc > 0):
            continue
        ax, ay = points[a, 0], points[a, 1]
        bx, by = points[b, 0], points[b, 1]
        cx, cy = points[c, 0], points[c, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if not abs(area) > 1e-12:
            continue
        # Pixel centres lie at half integers.
        x0 = int(max(0.0, np.ceil(min(ax, bx, cx) - 0.5)))
        x1 = int(min(width - 1.0, np.floor(max(ax, bx, cx) - 0.5)))
        y0 = int(max(0.0, np.ceil(min(ay, by, cy) - 0.5)))
        y1 = int(min(height - 1.0, np.floor(max(ay, by, cy) - 0.5)))
        inverse_area = 1.0 / area
        for y in range(y0, y1 + 1):
            py = y + 0.5
            for x in range(x0, x1 + 1):
                px = x + 0.5
                wa = ((cx - bx) * (py - by) - (cy - by) * (px - bx)) * inverse_area
                wb = ((ax - cx) * (py - cy) - (ay - cy) * (px - cx)) * inverse_area
                wc = 1.0 - wa - wb
                if wa < 0 or wb < 0 or wc < 0:
                    continue
                z = wa * za + wb * zb + wc * zc
                if z > depth[y, x]:
                    depth[y, x] = z
                    lit[y, x] = wa * shade[a] + wb * shade[b] + wc * shade[c]
                    owner[y, x] = ids[f]
