r"""What is where in a picture, and colours onto its pixels.

Over is :math:`c \leftarrow (1 - \alpha) c + \alpha c_{new}`. A line of half width :math:`h` covers the
pixel centre at distance :math:`d` from it by :math:`\mathrm{clip}(h + 1/2 - d, 0, 1)`. Depth is kept as
1/z, which is linear on the screen.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Ints = NDArray[np.int32]


Corners = tuple[float, float, float, float, float, float]


@njit(cache=True, nogil=True, error_model="numpy")
def _around(corners: Corners, width: int, height: int) -> tuple[int, int, int, int, float]:
    """First and last column and row of the pixels that a triangle may cover, none without area; 1/area."""
    ax, ay, bx, by, cx, cy = corners
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if not abs(area) > 1e-12:
        return 0, -1, 0, -1, 0.0
    # Pixel centres lie at half integers.
    return (
        int(max(0.0, np.ceil(min(ax, bx, cx) - 0.5))),
        int(min(width - 1.0, np.floor(max(ax, bx, cx) - 0.5))),
        int(max(0.0, np.ceil(min(ay, by, cy) - 0.5))),
        int(min(height - 1.0, np.floor(max(ay, by, cy) - 0.5))),
        1.0 / area,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _weights(corners: Corners, inverse_area: float, px: float, py: float) -> tuple[float, float, float]:
    """Of the corners at a place: all at least 0 inside."""
    ax, ay, bx, by, cx, cy = corners
    wa = ((cx - bx) * (py - by) - (cy - by) * (px - bx)) * inverse_area
    wb = ((ax - cx) * (py - cy) - (ay - cy) * (px - cx)) * inverse_area
    return wa, wb, 1.0 - wa - wb


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
        corners = (points[a, 0], points[a, 1], points[b, 0], points[b, 1], points[c, 0], points[c, 1])
        x0, x1, y0, y1, inverse_area = _around(corners, width, height)
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                wa, wb, wc = _weights(corners, inverse_area, x + 0.5, y + 0.5)
                if wa < 0 or wb < 0 or wc < 0:
                    continue
                z = wa * za + wb * zb + wc * zc
                if z > depth[y, x]:
                    depth[y, x] = z
                    lit[y, x] = wa * shade[a] + wb * shade[b] + wc * shade[c]
                    owner[y, x] = ids[f]


@njit(cache=True, nogil=True, error_model="numpy")
def cover(points: Array, inverse_depth: Array, faces: Ints, owner: Ints) -> None:
    """Find what triangles cover, whichever is nearest.

    Args:
        points: As of `raster`, shape (n, 2).
        inverse_depth: As of `raster`, shape (n,).
        faces: Corners, shape (m, 3).
        owner: Buffer, shape (height, width); 0 is written where a triangle is.
    """
    height, width = owner.shape
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if not (inverse_depth[a] > 0 and inverse_depth[b] > 0 and inverse_depth[c] > 0):
            continue
        corners = (points[a, 0], points[a, 1], points[b, 0], points[b, 1], points[c, 0], points[c, 1])
        x0, x1, y0, y1, inverse_area = _around(corners, width, height)
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                if owner[y, x] >= 0:
                    continue
                wa, wb, wc = _weights(corners, inverse_area, x + 0.5, y + 0.5)
                if not (wa < 0 or wb < 0 or wc < 0):
                    owner[y, x] = 0


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_of(
    points: Array, inverse_depth: Array, names: NDArray[np.int64], depth: Array, owner: NDArray[np.int64]
) -> None:
    """Find the nearest of some points in each cell of a grid, the later of two that are as near.

    Args:
        points: Screen position [cell], x right, y down, shape (n, 2).
        inverse_depth: 1/z [1/m], shape (n,); one of 0 or less is left out.
        names: What each belongs to, shape (n,).
        depth: Buffer of 1/z, 0 where nothing is, shape (height, width); written.
        owner: Buffer of names, same shape; written.
    """
    height, width = depth.shape
    for i in range(len(points)):
        x, y, z = np.floor(points[i, 0]), np.floor(points[i, 1]), inverse_depth[i]
        if z > 0 and 0 <= x < width and 0 <= y < height and z >= depth[int(y), int(x)]:
            depth[int(y), int(x)] = z
            owner[int(y), int(x)] = names[i]


Colors = NDArray[np.float32]

JUMP = 0.03
"""Relative step of 1/z between neighbours that is an edge of a body."""
RIM = 0.45
"""What is left of the light on an edge."""
SLACK = 0.995
"""A line that lies on a surface is before it: 1/z is compared with this part of the surface's."""


@njit(cache=True, nogil=True, error_model="numpy")
def solid(rgb: Colors, owner: Ints, lit: Array, colors: Array) -> None:
    """Give every pixel that a body owns the body's colour times its brightness.

    Args:
        rgb: Shape (height, width, 3); written.
        owner: Row of ``colors``, -1 for none, shape (height, width).
        lit: Brightness, same shape.
        colors: 0…1, shape (k, 3).
    """
    for y in range(owner.shape[0]):
        for x in range(owner.shape[1]):
            k = owner[y, x]
            if k >= 0:
                for c in range(3):
                    rgb[y, x, c] = min(max(colors[k, c] * lit[y, x], 0.0), 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def outline(rgb: Colors, owner: Ints, depth: Array) -> None:
    """Darken the nearer of two neighbours where one body ends and another, or nothing, begins."""
    height, width = owner.shape
    for y in range(height):
        for x in range(width):
            if owner[y, x] < 0:
                continue
            here = depth[y, x]
            edge = False
            for k in range(4):
                v = y + (k == 0) - (k == 1)
                u = x + (k == 2) - (k == 3)
                if v < 0 or u < 0 or v >= height or u >= width:
                    continue
                there = depth[v, u]
                apart = owner[v, u] != owner[y, x] or abs(here - there) > JUMP * max(here, there)
                if apart and here >= there:
                    edge = True
            if edge:
                for c in range(3):
                    rgb[y, x, c] *= RIM


@njit(cache=True, nogil=True, error_model="numpy")
def darken(rgb: Colors, owner: Ints, factor: float) -> None:
    """Multiply every pixel that has an owner."""
    for y in range(owner.shape[0]):
        for x in range(owner.shape[1]):
            if owner[y, x] >= 0:
                for c in range(3):
                    rgb[y, x, c] *= factor


@njit(cache=True, nogil=True, error_model="numpy")
def glaze(
    rgb: Colors, behind: Array, owner: Ints, depth: Array, lit: Array, color: Array, alpha: float
) -> None:
    """Lay a translucent surface over the picture, with its outline.

    Args:
        rgb: Shape (height, width, 3); written.
        behind: 1/z of the opaque bodies, shape (height, width); where it is larger nothing is laid.
        owner: At least 0 where the surface is.
        depth: 1/z of the surface.
        lit: Brightness of the surface.
        color: 0…1, shape (3,).
        alpha: Opacity, 0…1.
    """
    height, width = owner.shape
    for y in range(height):
        for x in range(width):
            if owner[y, x] < 0 or depth[y, x] < behind[y, x]:
                continue
            edge = (
                (y > 0 and owner[y - 1, x] < 0)
                or (x > 0 and owner[y, x - 1] < 0)
                or (y < height - 1 and owner[y + 1, x] < 0)
                or (x < width - 1 and owner[y, x + 1] < 0)
            )
            weight = min(1.0, 2.5 * alpha) if edge else alpha
            light = 0.5 + 0.5 * lit[y, x]
            if edge:
                light *= RIM
            for c in range(3):
                tint = min(max(color[c] * light, 0.0), 1.0)
                rgb[y, x, c] = (1.0 - weight) * rgb[y, x, c] + weight * tint


@njit(cache=True, nogil=True, error_model="numpy")
def stroke(
    rgb: Colors,
    behind: Array,
    ends: Array,
    inverse: Array,
    color: Array,
    half: float,
    alpha: float,
    hidden: float,
    dash: float,
) -> None:
    """Draw a line with soft edges; dashed where a body is before it.

    Args:
        rgb: Shape (height, width, 3); written.
        behind: 1/z of the opaque bodies, shape (height, width).
        ends: [px], shape (2, 2), not at one place.
        inverse: 1/z of the ends, shape (2,).
        color: 0…1, shape (3,).
        half: Half its width [px].
        alpha: Opacity where it is in sight.
        hidden: Opacity of the dashes where it is not.
        dash: Length of a dash with the gap after it [px].
    """
    height, width = behind.shape
    ax, ay = ends[0, 0], ends[0, 1]
    dx, dy = ends[1, 0] - ax, ends[1, 1] - ay
    square = dx * dx + dy * dy
    length = np.sqrt(square)
    reach = half + 1.0
    y0 = int(min(max(np.floor(min(ay, ay + dy) - reach), 0.0), float(height)))
    y1 = int(min(max(np.ceil(max(ay, ay + dy) + reach), 0.0), float(height)))
    for y in range(y0, y1):
        # The part of this row that is within reach of the line.
        low, high = min(ax, ax + dx), max(ax, ax + dx)
        if abs(dy) > 1e-9:
            s0, s1 = (y - reach - ay) / dy, (y + 1 + reach - ay) / dy
            first, last = max(min(s0, s1), 0.0), min(max(s0, s1), 1.0)
            if first > last:
                continue
            low, high = min(ax + first * dx, ax + last * dx), max(ax + first * dx, ax + last * dx)
        x0 = int(min(max(np.floor(low - reach), 0.0), float(width)))
        x1 = int(min(max(np.ceil(high + reach), 0.0), float(width)))
        for x in range(x0, x1):
            px, py = x + 0.5 - ax, y + 0.5 - ay
            s = min(max((px * dx + py * dy) / square, 0.0), 1.0)
            off = np.sqrt((px - s * dx) ** 2 + (py - s * dy) ** 2)
            cover = min(max(half + 0.5 - off, 0.0), 1.0)
            if cover <= 0.0:
                continue
            if inverse[0] + s * (inverse[1] - inverse[0]) >= behind[y, x] * SLACK:
                weight = cover * alpha
            elif (s * length) % dash < 4 * dash / 7:
                weight = cover * hidden
            else:
                continue
            for c in range(3):
                rgb[y, x, c] += weight * (color[c] - rgb[y, x, c])


@njit(cache=True, nogil=True, error_model="numpy")
def averaged(rgb: Colors, n: int) -> NDArray[np.uint8]:
    """Mean of every n × n pixels as bytes, shape (height / n, width / n, 3)."""
    height, width = rgb.shape[0] // n, rgb.shape[1] // n
    out = np.empty((height, width, 3), np.uint8)
    for y in range(height):
        for x in range(width):
            for c in range(3):
                total = 0.0
                for v in range(n):
                    for u in range(n):
                        total += rgb[y * n + v, x * n + u, c]
                out[y, x, c] = np.uint8(min(max(255.0 * total / (n * n) + 0.5, 0.0), 255.0))
    return out
