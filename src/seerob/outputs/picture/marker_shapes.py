"""Markers as lines and surfaces of a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes import ear_clipping
from seerob.core.snapshot import (
    Arrow,
    Box,
    Ellipsoid,
    Highlight,
    Hull,
    Label,
    Marker,
    Polyline,
    Prism,
    Rays,
    Segment,
    Sphere,
    Vec3,
)
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.outputs.palette import DARK, FILL, MARK
from seerob.outputs.picture.canvas import Canvas

_VEIL = 0.38
_CUBE = np.array(
    [
        [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
        [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5],
    ],
    np.int32,
)  # fmt: skip

_EDGES = [(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]


def draw_marker(canvas: Canvas, marker: Marker) -> None:
    """Draw one marker over the bodies; highlights are the bodies' own colour and not drawn here."""
    dark, fill = DARK[marker.verdict], FILL[marker.verdict]
    match marker:
        case Segment(start=start, end=end):
            canvas.line(np.array(start), np.array(end), (1, 1, 1), width=6, alpha=0.85, hidden=0.4)
            canvas.line(np.array(start), np.array(end), dark, width=3.2, hidden=0.65)
            for point in (start, end):
                canvas.dot(np.array(point), dark, radius=4.5)
        case Arrow(origin=origin, vector=vector):
            _arrow(canvas, np.array(origin, float), np.array(vector, float), dark)
        case Sphere(center=center, radius=radius):
            vertices, faces = ball()
            canvas.veil(vertices * radius + center, faces, fill, _VEIL)
        case Ellipsoid(center=center, wxyz=wxyz, radii=radii):
            vertices, faces = ball()
            canvas.veil(vertices * radii @ rotation_from_wxyz(wxyz).T + center, faces, fill, _VEIL)
        case Box():
            points = corners(marker)
            canvas.veil(points, _CUBE, fill, _VEIL)
            for a, b in _EDGES:
                canvas.line(points[a], points[b], dark, width=1.6, hidden=0.35)
        case Hull(vertices=points, faces=hull_faces):
            inside = [f for f in hull_faces if all(0 <= i < len(points) for i in f)]
            if inside:
                canvas.veil(np.array(points, float), np.array(inside, np.int32), fill, _VEIL)
        case Polyline():
            for start, end in marker.legs():
                canvas.line(np.array(start), np.array(end), dark, width=2.4, hidden=0.5)
        case Prism():
            points, prism_faces, prism_edges = prism(marker)
            if len(prism_faces):
                canvas.veil(points, prism_faces, fill, _VEIL)
            for a, b in prism_edges:
                canvas.line(points[a], points[b], dark, width=1.6, hidden=0.35)
        case Rays():
            for k, (start, end) in enumerate(marker.beams()):
                solid = k in marker.hits
                canvas.line(
                    np.array(start),
                    np.array(end),
                    dark,
                    width=1.6 if solid else 0.8,
                    alpha=1.0 if solid else 0.3,
                )
        case Label() | Highlight():
            pass


def points_of(marker: Marker) -> list[Vec3]:
    """Points of the world [m] that must be in the picture."""
    match marker:
        case Segment(start=start, end=end):
            return [start, end]
        case Arrow(origin=(x, y, z), vector=(u, v, w)):
            return [(x, y, z), (x + u, y + v, z + w)]
        case Sphere(center=center) | Ellipsoid(center=center):
            return [center]
        case Box():
            return [(float(x), float(y), float(z)) for x, y, z in corners(marker)]
        case Hull(vertices=vertices):
            return list(vertices)
        case Polyline(points=points):
            return list(points)
        case Prism():
            return [(float(x), float(y), float(z)) for x, y, z in prism(marker)[0]]
        case Rays(starts=starts, ends=ends):
            return [*starts, *ends]
        case Label(position=position):
            return [position]
        case Highlight():
            return []


def label_of(marker: Marker) -> tuple[str, Vec3]:
    """Text with the verdict's mark, and where it belongs [m]; empty text for none."""
    points = points_of(marker)
    text = marker.text if isinstance(marker, Label) else getattr(marker, "label", "")
    if not text or not points:
        return "", (0.0, 0.0, 0.0)
    mark = "" if marker.verdict is None else MARK[marker.verdict] + " "
    middle = np.mean(
        points if isinstance(marker, Segment | Box | Hull | Polyline | Prism) else points[:1], axis=0
    )
    return mark + text, (float(middle[0]), float(middle[1]), float(middle[2]))


def corners(box: Box) -> Array:
    """Corners of a box marker in the world [m], shape (8, 3)."""
    signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return np.asarray(signs * box.size @ rotation_from_wxyz(box.wxyz).T + box.center)


def prism(marker: Prism) -> tuple[Array, NDArray[np.int32], list[tuple[int, int]]]:
    """Vertices in the world [m], shape (2 n, 3), the lower ones first; faces, shape (m, 3); edges.

    The faces are none when the outline encloses nothing.
    """
    n = len(marker.outline)
    outline = np.array(marker.outline, float).reshape(-1, 2)
    points = np.array([[x, y, z] for z in (marker.lower, marker.upper) for x, y in outline])
    placed = points.reshape(-1, 3) @ rotation_from_wxyz(marker.wxyz).T + marker.position
    ring = [(i, (i + 1) % n) for i in range(n)]
    sides = [face for a, b in ring for face in ((a, b, b + n), (a, b + n, a + n))]
    caps = ear_clipping(outline)
    faces = [*((c, b, a) for a, b, c in caps), *((a + n, b + n, c + n) for a, b, c in caps), *sides]
    edges = [*ring, *((a + n, b + n) for a, b in ring), *((i, i + n) for i in range(n))]
    return np.asarray(placed), np.array(faces if caps else [], np.int32).reshape(-1, 3), edges


def ball(rings: int = 16) -> tuple[Array, NDArray[np.int32]]:
    """A unit sphere: vertices (n, 3), faces (m, 3)."""
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1), indexing="ij"
    )
    vertices = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], -1)
    i = np.arange(vertices[..., 0].size).reshape(polar.shape)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return vertices.reshape(-1, 3), faces.astype(np.int32)


def _arrow(canvas: Canvas, origin: Array, vector: Array, color: tuple[float, float, float]) -> None:
    tip = origin + vector
    canvas.line(origin, tip, color, width=3, hidden=0.5)
    screen, inverse = canvas.camera.project(np.array([origin, tip]))
    along = screen[1] - screen[0]
    length = float(np.hypot(*along))
    if length < 4 or not (inverse > 0).all():
        canvas.dot(origin, color, radius=3)
        return
    # Barbs in the plane that faces the camera, as long on the screen for any arrow.
    barb = min(12.0, 0.5 * length) / length * float(np.linalg.norm(vector))
    across = np.cross(vector, canvas.camera.axes[2])
    across /= max(float(np.linalg.norm(across)), 1e-12)
    back = vector / max(float(np.linalg.norm(vector)), 1e-12)
    for side in (across, -across):
        canvas.line(tip, tip - barb * (back - 0.5 * side), color, width=3, hidden=0.5)
