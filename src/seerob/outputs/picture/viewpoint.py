"""Choosing a view: the markers in sight, seen from the side, and everything named in the picture.

Views are compared by points scattered over the bodies on a coarse grid: exact enough to choose, and
a hundred times cheaper than drawing each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seerob.core.snapshot import Arrow, Highlight, Marker, Segment
from seerob.core.transforms import Array
from seerob.outputs.picture.camera import Camera, look_along
from seerob.outputs.picture.marker_shapes import points_of

PREFERRED = (float(np.deg2rad(-60)), float(np.deg2rad(22)))
"""Azimuth and elevation taken when nothing speaks for others [rad]."""
_VIEWS = [(float(np.deg2rad(a)), float(np.deg2rad(e))) for e in (18, 35) for a in range(-150, 210, 30)]
_GRID_WIDTH = 100


def scattered(vertices: Array, faces: NDArray[np.int32], n: int) -> tuple[Array, NDArray[np.int64]]:
    """``n`` points spread evenly over triangles: barycentric weights (n, 3) and triangle (n,)."""
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    total = np.cumsum(area)
    if not len(total) or not total[-1] > 0:
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    rng = np.random.default_rng(0)
    chosen = np.minimum(np.searchsorted(total, (np.arange(n) + 0.5) / n * total[-1]), len(faces) - 1)
    u, v = np.sqrt(rng.random(n)), rng.random(n)
    return np.stack([1 - u, u * (1 - v), u * v], -1), chosen.astype(np.int64)


def best_view(
    surface: Array,
    owner: NDArray[np.int64],
    markers: tuple[Marker, ...],
    names: list[str],
    focus: Array,
    size: tuple[int, int],
) -> Camera:
    """The camera that shows the markers best.

    Args:
        surface: Points on the bodies [m], shape (n, 3).
        owner: Index into ``names`` of the body each lies on, shape (n,).
        markers: What is to be seen; the preferred view when there is none.
        names: Of the bodies.
        focus: Points that must be in the picture [m], shape (m, 3).
        size: Width and height of the picture [px].
    """
    if not markers:
        return look_along(*PREFERRED, focus, size)
    grid = (_GRID_WIDTH, max(1, round(_GRID_WIDTH * size[1] / size[0])))
    azimuth, elevation = max(
        _VIEWS,
        key=lambda view: _worth(
            look_along(view[0], view[1], focus, grid), view, surface, owner, markers, names
        ),
    )
    return look_along(azimuth, elevation, focus, size)


def _worth(
    camera: Camera,
    view: tuple[float, float],
    surface: Array,
    owner: NDArray[np.int64],
    markers: tuple[Marker, ...],
    names: list[str],
) -> float:
    depth, body = _coarse(camera, surface, owner)
    worth = 0.15 * np.cos(view[0] - PREFERRED[0]) - 0.1 * abs(view[1] - PREFERRED[1])
    for marker in markers:
        if isinstance(marker, Highlight):
            if marker.body in names:
                share = np.count_nonzero(body == names.index(marker.body)) / body.size
                worth += min(10 * share, 0.5)
            continue
        points = np.array(points_of(marker)).reshape(-1, 3)
        if isinstance(marker, Segment | Arrow):
            along = points[1] - points[0]
            length = float(np.linalg.norm(along))
            if length > 1e-6:
                worth += 0.8 * float(np.linalg.norm(np.cross(along / length, camera.axes[2])))
            # The ends are where the figure comes from: a view that hides one is worth little.
            worth += 1.5 * _in_sight(camera, depth, points)
            points = points[0] + np.linspace(0, 1, 12)[:, None] * along
            worth += _in_sight(camera, depth, points)
        else:
            worth += 0.3 * _in_sight(camera, depth, points)
    return float(worth)


def _coarse(camera: Camera, surface: Array, owner: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Nearest 1/z and its body per cell of the camera's grid; 0 and -1 where there is nothing."""
    depth = np.zeros((camera.height, camera.width))
    body = np.full(depth.shape, -1, np.int64)
    screen, inverse = camera.project(surface)
    x, y = np.floor(screen).astype(np.int64).T
    inside = (inverse > 0) & (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
    order = np.argsort(inverse[inside], kind="stable")  # of several in a cell the nearest is written last
    cell = y[inside][order], x[inside][order]
    depth[cell] = inverse[inside][order]
    body[cell] = owner[inside][order]
    return depth, body


def _in_sight(camera: Camera, depth: Array, points: Array) -> float:
    """Share of points (n, 3) with nothing before them."""
    if not len(points):
        return 0.0
    screen, inverse = camera.project(points)
    x = np.clip(screen[:, 0].astype(int), 0, camera.width - 1)
    y = np.clip(screen[:, 1].astype(int), 0, camera.height - 1)
    # Points lie on surfaces, and cells are coarse: 2 % of slack.
    return float(((inverse > 0) & (inverse >= 0.98 * depth[y, x])).mean())
