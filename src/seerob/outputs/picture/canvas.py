"""A picture being drawn: opaque bodies first, then what lies over them.

Where to look from: a pinhole camera, and the distance from which everything named fits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.paint import averaged, cover, darken, glaze, outline, raster, solid, stroke

FIELD_OF_VIEW = np.deg2rad(32.0)
"""Vertical [rad]."""
NEAR = 0.02
"""Nothing nearer than this is drawn [m]."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera in the world; z of the world is up in the picture."""

    eye: Array
    """[m], shape (3,)."""
    axes: Array
    """Rows: right, down, forward; shape (3, 3)."""
    width: int
    """[px]"""
    height: int
    """[px]"""
    field_of_view: float = FIELD_OF_VIEW
    """Vertical [rad]."""

    @property
    def focal(self) -> float:
        """Focal length [px]."""
        return float(self.height / 2 / np.tan(self.field_of_view / 2))

    def local(self, points: Array) -> Array:
        """Points (n, 3) of the world in the camera's right, down, forward [m]."""
        return self._rows(points).T

    def _rows(self, points: Array) -> Array:
        """`local` by coordinate, shape (3, n): a row is passed over several times as fast as a column."""
        return np.asarray(self.axes @ (np.asarray(points, float).reshape(-1, 3) - self.eye).T)

    def project(self, points: Array) -> tuple[Array, Array]:
        """Screen position [px] (n, 2) and 1/z [1/m] (n,) of points (n, 3); 0 for those not in front."""
        x, y, z = self._rows(points)
        front = z > NEAR
        inverse = np.where(front, 1 / np.where(front, z, 1.0), 0.0)
        screen = np.empty((len(z), 2))
        for k, (along, middle) in enumerate(((x, self.width / 2), (y, self.height / 2))):
            screen[:, k] = middle + self.focal * along * inverse
        return screen, inverse

    def scaled(self, factor: int) -> Camera:
        """Return a camera with this view and ``factor`` times as many pixels each way."""
        return Camera(self.eye, self.axes, self.width * factor, self.height * factor, self.field_of_view)


def look_along(
    azimuth: float, elevation: float, points: Array, size: tuple[int, int], *, margin: float = 0.08
) -> Camera:
    """The camera nearest to ``points`` that sees all of them.

    Args:
        azimuth: Where the camera stands, about z from x [rad].
        elevation: Above the horizon [rad].
        points: What must be seen [m], shape (n, 3).
        size: Width and height [px].
        margin: Part of the picture kept free on each side.
    """
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    forward = -np.array([ca * ce, sa * ce, se])
    right = np.array([-sa, ca, 0.0])
    axes = np.stack([right, np.cross(forward, right), forward])
    width, height = size
    tangent = np.tan(FIELD_OF_VIEW / 2) * (1 - 2 * margin)
    reach = np.array([tangent * width / height, tangent])
    x, y, z = axes @ np.asarray(points, float).reshape(-1, 3).T
    # A camera at c (right, down) and depth d sees x when |x_i - c_i| <= reach_i (z - d), for each of
    # the two directions: the largest d for which an interval of c remains.
    low = np.array([(each - part * z).max() for each, part in zip((x, y), reach, strict=True)])
    high = np.array([(each + part * z).min() for each, part in zip((x, y), reach, strict=True)])
    depth = min(float(((high - low) / (2 * reach)).min()), float(z.min()) - 0.3)
    center = (low + high) / 2
    return Camera(np.array([*center, depth]) @ axes, axes, width, height)


Color = tuple[float, float, float]

PAPER: Color = (0.955, 0.965, 0.975)
OVERSAMPLING = 2
_LIGHT = np.array([0.35, -0.45, 0.82]) / np.linalg.norm([0.35, -0.45, 0.82])
"""Toward the light, in the world."""


class Room:
    """Memory for one canvas after the other: some 110 MB."""

    def __init__(self) -> None:
        self._arrays: dict[str, NDArray[Any]] = {}

    def array(self, name: str, shape: tuple[int, ...], kind: type[np.generic]) -> NDArray[Any]:
        """Return the array of a name, with whatever is in it."""
        found = self._arrays.get(name)
        if found is None or found.shape != shape or found.dtype != kind:
            found = self._arrays[name] = np.empty(shape, kind)
        return found


class Canvas:
    """Buffers of one view, drawn at `OVERSAMPLING` times the size and averaged at the end.

    Args:
        camera: The view.
        room: Where the buffers are, which no other canvas uses meanwhile.
    """

    def __init__(self, camera: Camera, room: Room | None = None) -> None:
        self.camera = camera
        self.fine = camera.scaled(OVERSAMPLING)
        self._room = Room() if room is None else room
        shape = (self.fine.height, self.fine.width)
        self.depth: Array = self._room.array("depth", shape, np.float64)
        self.owner: NDArray[np.int32] = self._room.array("owner", shape, np.int32)
        self.rgb: NDArray[np.float32] = self._room.array("rgb", (*shape, 3), np.float32)
        ramp = np.linspace(1.0, 0.93, shape[0], dtype=np.float32)[:, None]
        self.depth.fill(0)
        self.owner.fill(-1)
        # Row by row: pixel by pixel it takes four times as long.
        np.multiply(ramp, np.tile(np.array(PAPER, np.float32), shape[1]), out=self.rgb.reshape(shape[0], -1))

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
        lit = self._room.array("lit", self.depth.shape, np.float64)  # read only where a body is
        shade = brightness(vertices, normals, self.camera.eye)
        raster(screen, inverse, shade, faces, ids, self.depth, lit, self.owner)
        solid(self.rgb, self.owner, lit, np.ascontiguousarray(colors, float).reshape(-1, 3))
        outline(self.rgb, self.owner, self.depth)

    def shadow(self, vertices: Array, faces: NDArray[np.int32], floor: float) -> None:
        """Darken the floor at a height [m] below the bodies, lit almost from above; call before `bodies`."""
        height = np.maximum(vertices[:, 2] - floor, 0.0)
        flat = vertices - height[:, None] * np.array([0.15, -0.2, 1.0])
        screen, inverse = self.fine.project(flat)
        _, _, owner = self._layer()
        cover(screen, inverse, faces, owner)
        darken(self.rgb, owner, 0.9)

    def veil(self, vertices: Array, faces: NDArray[np.int32], color: Color, alpha: float) -> None:
        """Draw a translucent surface, world [m], where nothing opaque is before it."""
        corners = in_front(self.camera, vertices[faces])
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        points = corners.reshape(-1, 3)
        screen, inverse = self.fine.project(points)
        depth, lit, owner = self._layer()
        index = np.arange(len(points), dtype=np.int32).reshape(-1, 3)
        shade = brightness(points, np.repeat(normal, 3, axis=0), self.camera.eye)
        raster(screen, inverse, shade, index, np.zeros(len(index), np.int32), depth, lit, owner)
        glaze(self.rgb, self.depth, owner, depth, lit, np.array(color, float), alpha)

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
        if float(np.hypot(*(screen[1] - screen[0]))) < 1e-9:
            return
        half, dash = width * OVERSAMPLING / 2, 14.0 * OVERSAMPLING
        stroke(self.rgb, self.depth, screen, inverse, np.array(color, float), half, alpha, hidden, dash)

    def _layer(self) -> tuple[Array, Array, NDArray[np.int32]]:
        """Empty buffers (1/z, brightness, owner) for one surface; the next call takes them back."""
        shape = self.depth.shape
        depth = self._room.array("depth of a layer", shape, np.float64)
        owner = self._room.array("owner of a layer", shape, np.int32)
        depth.fill(0)
        owner.fill(-1)
        return depth, self._room.array("lit", shape, np.float64), owner

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
            self.rgb[window] += (cover * (np.array(paint) - self.rgb[window])).astype(np.float32)

    def pixels(self) -> NDArray[np.uint8]:
        """The picture so far, shape (height, width, 3)."""
        return np.asarray(averaged(self.rgb, OVERSAMPLING))


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


def in_front(camera: Camera, corners: Array) -> Array:
    """The part of triangles (m, 3, 3) in front of the camera, as triangles (k, 3, 3)."""
    z = camera.local(corners)[:, 2].reshape(-1, 3) - 2 * NEAR
    whole = corners[(z > 0).all(axis=1)]
    cut = (z > 0).any(axis=1) & (z <= 0).any(axis=1)
    made = []
    for triangle, depth in zip(corners[cut], z[cut], strict=True):
        kept = []
        for k in range(3):
            a, b = depth[k], depth[k - 2]
            if a > 0:
                kept.append(triangle[k])
            if (a > 0) != (b > 0):
                kept.append(triangle[k] + a / (a - b) * (triangle[k - 2] - triangle[k]))
        made += [[kept[0], kept[k], kept[k + 1]] for k in range(1, len(kept) - 1)]
    return np.concatenate([whole, np.array(made, float).reshape(-1, 3, 3)])
