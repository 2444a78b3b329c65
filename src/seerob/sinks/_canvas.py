"""A picture being drawn: opaque bodies first, then what lies over them, then words."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from seerob.kernels.raster import raster
from seerob.sinks._camera import NEAR, Camera
from seerob.transforms import Array

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont

Color = tuple[float, float, float]

PAPER: Color = (0.955, 0.965, 0.975)
INK: Color = (0.10, 0.13, 0.17)
OVERSAMPLING = 2
_LIGHT = np.array([0.35, -0.45, 0.82]) / np.linalg.norm([0.35, -0.45, 0.82])
"""Toward the light, in the world."""


class Canvas:
    """Buffers of one view, drawn at `OVERSAMPLING` times the size and averaged at the end."""

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self.fine = camera.scaled(OVERSAMPLING)
        shape = (self.fine.height, self.fine.width)
        self.depth = np.zeros(shape)
        self.owner = np.full(shape, -1, np.int32)
        ramp = np.linspace(1.0, 0.93, shape[0])[:, None, None]
        self.rgb: Array = np.broadcast_to(np.array(PAPER) * ramp, (*shape, 3)).copy()

    def bodies(
        self, vertices: Array, normals: Array, faces: NDArray[np.int32], ids: NDArray[np.int32], colors: Array
    ) -> None:
        """Draw opaque triangles with their outlines.

        Args:
            vertices: World [m], shape (n, 3).
            normals: World, unit, shape (n, 3).
            faces: Shape (m, 3).
            ids: Row of ``colors`` per triangle, shape (m,).
            colors: sRGB 0…1 per id, shape (k, 3).
        """
        screen, inverse = self.fine.project(vertices)
        lit = np.zeros_like(self.depth)
        shade = brightness(vertices, normals, self.camera.eye)
        raster(screen, inverse, shade, faces, ids, self.depth, lit, self.owner)
        drawn = self.owner >= 0
        self.rgb[drawn] = np.clip(colors[self.owner[drawn]] * lit[drawn, None], 0, 1)
        self._outline()

    def shadow(self, vertices: Array, faces: NDArray[np.int32], floor: float) -> None:
        """Darken the floor at a height [m] below the bodies, lit almost from above; call before `bodies`."""
        height = np.maximum(vertices[:, 2] - floor, 0.0)
        flat = vertices - height[:, None] * np.array([0.15, -0.2, 1.0])
        screen, inverse = self.fine.project(flat)
        depth, owner = np.zeros_like(self.depth), np.full(self.owner.shape, -1, np.int32)
        ids = np.zeros(len(faces), np.int32)
        raster(screen, inverse, np.zeros(len(flat)), faces, ids, depth, np.zeros_like(depth), owner)
        self.rgb[owner >= 0] *= 0.9

    def _outline(self) -> None:
        """A thin dark line where one body ends and another, or the floor, begins."""
        edge = np.zeros(self.depth.shape, bool)
        for axis in (0, 1):
            a = np.take(self.owner, range(1, self.owner.shape[axis]), axis)
            b = np.take(self.owner, range(self.owner.shape[axis] - 1), axis)
            za, zb = (
                np.take(self.depth, range(1, self.depth.shape[axis]), axis),
                np.take(self.depth, range(self.depth.shape[axis] - 1), axis),
            )
            jump = (a != b) | (np.abs(za - zb) > 0.03 * np.maximum(za, zb))
            lower: tuple[slice, ...] = (slice(1, None), slice(None))
            upper: tuple[slice, ...] = (slice(None, -1), slice(None))
            if axis == 1:
                lower, upper = lower[::-1], upper[::-1]
            edge[lower] |= jump & (za >= zb)
            edge[upper] |= jump & (zb > za)
        self.rgb[edge & (self.owner >= 0)] *= 0.45

    def veil(self, vertices: Array, faces: NDArray[np.int32], color: Color, alpha: float) -> None:
        """Draw a translucent surface, world [m], where nothing opaque is before it."""
        corners = vertices[faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        points = corners.reshape(-1, 3)
        screen, inverse = self.fine.project(points)
        depth, lit = np.zeros_like(self.depth), np.zeros_like(self.depth)
        owner = np.full(self.owner.shape, -1, np.int32)
        index = np.arange(len(points), dtype=np.int32).reshape(-1, 3)
        shade = brightness(points, np.repeat(normal, 3, axis=0), self.camera.eye)
        raster(screen, inverse, shade, index, np.zeros(len(index), np.int32), depth, lit, owner)
        shown = (owner >= 0) & (depth >= self.depth)
        tint = np.clip(np.array(color) * (0.5 + 0.5 * lit[shown, None]), 0, 1)
        self.rgb[shown] = (1 - alpha) * self.rgb[shown] + alpha * tint

    def line(
        self, start: Array, end: Array, color: Color, *, width: float, alpha: float = 1.0, hidden: float = 0.0
    ) -> None:
        """Draw a line between two points of the world [m].

        Args:
            start: Shape (3,).
            end: Shape (3,).
            color: sRGB.
            width: [px]
            alpha: Opacity where it is in sight.
            hidden: Opacity where a body is before it; drawn dashed there.
        """
        ends = clipped(self.camera, np.array([start, end], float))
        if ends is None:
            return
        screen, inverse = self.fine.project(ends)
        along = screen[1] - screen[0]
        length = float(np.hypot(*along))
        if length < 1e-9:
            return
        half = width * OVERSAMPLING / 2
        low = np.floor(np.clip(screen.min(axis=0) - half - 1, 0, [self.fine.width, self.fine.height])).astype(int)
        high = np.ceil(np.clip(screen.max(axis=0) + half + 1, 0, [self.fine.width, self.fine.height])).astype(int)
        if (high <= low).any():
            return
        ys, xs = np.mgrid[low[1] : high[1], low[0] : high[0]] + 0.5
        s = ((xs - screen[0, 0]) * along[0] + (ys - screen[0, 1]) * along[1]) / length**2
        s = np.clip(s, 0, 1)
        off = np.hypot(xs - screen[0, 0] - s * along[0], ys - screen[0, 1] - s * along[1])
        cover = np.clip(half + 0.5 - off, 0, 1)
        window = (slice(low[1], high[1]), slice(low[0], high[0]))
        # Lies on the surface where it ends: a little slack keeps its ends in sight.
        seen = inverse[0] + s * (inverse[1] - inverse[0]) >= self.depth[window] * 0.995
        dash = np.mod(s * length, 14 * OVERSAMPLING) < 8 * OVERSAMPLING
        opacity = cover * np.where(seen, alpha, hidden * dash)
        self.rgb[window] += opacity[..., None] * (np.array(color) - self.rgb[window])

    def dot(self, point: Array, color: Color, *, radius: float) -> None:
        """A filled disc of ``radius`` [px] with a light rim, never hidden."""
        screen, inverse = self.fine.project(point)
        if inverse[0] <= 0:
            return
        reach = (radius + 3) * OVERSAMPLING
        edge = np.array([self.fine.width, self.fine.height])
        low = np.clip(np.floor(screen[0] - reach), 0, edge).astype(int)
        high = np.clip(np.ceil(screen[0] + reach), 0, edge).astype(int)
        if (high <= low).any():
            return
        ys, xs = np.mgrid[low[1] : high[1], low[0] : high[0]] + 0.5
        window = (slice(low[1], high[1]), slice(low[0], high[0]))
        off = np.hypot(xs - screen[0, 0], ys - screen[0, 1])
        for size, paint in ((radius + 1.5, (1.0, 1.0, 1.0)), (radius, color)):
            cover = np.clip(size * OVERSAMPLING + 0.5 - off, 0, 1)[..., None]
            self.rgb[window] += cover * (np.array(paint) - self.rgb[window])

    def pixels(self) -> NDArray[np.uint8]:
        """The picture so far, shape (height, width, 3)."""
        n = OVERSAMPLING
        mean = self.rgb.reshape(self.camera.height, n, self.camera.width, n, 3).mean(axis=(1, 3))
        return np.asarray(np.clip(mean * 255 + 0.5, 0, 255), np.uint8)


def brightness(vertices: Array, normals: Array, eye: Array) -> Array:
    """Lambert's law with a soft sky and a weak light at the eye, both sides lit; shape (n,)."""
    toward = eye - vertices
    toward /= np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-12)
    facing = np.einsum("ij,ij->i", normals, toward)
    outward = normals * np.where(facing < 0, -1.0, 1.0)[:, None]
    key = np.maximum(outward @ _LIGHT, 0)
    return np.asarray(0.42 + 0.10 * outward[:, 2] + 0.42 * key + 0.16 * np.abs(facing))


def clipped(camera: Camera, ends: Array) -> Array | None:
    """The part of a segment (2, 3) in front of the camera; None when nothing is."""
    z = camera.local(ends)[:, 2] - 2 * NEAR
    if (z <= 0).all():
        return None
    if (z > 0).all():
        return ends
    at = z[0] / (z[0] - z[1])
    cut = ends[0] + at * (ends[1] - ends[0])
    return np.array([cut, ends[1]]) if z[0] <= 0 else np.array([ends[0], cut])


def font(size: int) -> FreeTypeFont:
    """A font that has ✓, ✕ and ↔, which comes along with matplotlib."""
    from pathlib import Path

    import matplotlib
    from PIL import ImageFont

    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts/ttf/DejaVuSans-Bold.ttf", size)


def words(draw: ImageDraw, at: tuple[float, float], text: str, color: Color, type_: FreeTypeFont) -> None:
    """Text centred at a pixel, with a light rim that keeps it readable on anything."""
    fill = tuple(round(255 * c) for c in color)
    draw.text(at, text, fill=fill, font=type_, anchor="mm", stroke_width=3, stroke_fill=(255, 255, 255))


def png(pixels: NDArray[np.uint8]) -> bytes:
    """PNG of an image (height, width, 3)."""
    from PIL import Image

    out = BytesIO()
    Image.fromarray(pixels).save(out, "PNG", optimize=True)
    return out.getvalue()
