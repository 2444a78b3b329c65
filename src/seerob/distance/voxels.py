"""Voxels: which cubes of a regular grid are marked, their volume, and a closed mesh around them.

The border of what is nearer to a convex set of points than a distance, as a closed surface to draw.
"""

from __future__ import annotations

import math
import os
import sys
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.shapes import Faces, Mesh
from seerob.core.transforms import Array
from seerob.description.shapes.hull import convex_hull
from seerob.kernels import surface_nets as nets
from seerob.kernels.fields import Cells
from seerob.kernels.voxels import TOP, Voxels

Triangles = tuple[tuple[int, int, int], ...]


@cache
def _directions() -> tuple[Array, Triangles]:
    """Corners of an icosahedron whose edges are halved, as unit vectors (42, 3), and its 80 triangles."""
    g = (1 + 5**0.5) / 2
    twelve = np.array([np.roll([0.0, a, b], k) for k in range(3) for a in (-1, 1) for b in (-g, g)])
    apart = np.linalg.norm(twelve[:, None] - twelve, axis=2)
    i, j = np.nonzero(np.triu(np.isclose(apart, 2.0)))
    u = np.vstack([twelve, twelve[i] + twelve[j]])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    faces = convex_hull(u)
    assert faces is not None
    return u, tuple((int(p), int(q), int(r)) for p, q, r in faces)


def offset_shell(points: Array, distance: float) -> tuple[Array, Triangles]:
    """A surface around the convex hull of points, at a distance from it.

    It touches the true border at 42 points and lies inside it between them, by at most a twentieth of the
    distance: for the eye, no verdict hangs on it.

    Args:
        points: Shape (k, 3) [m].
        distance: [m]; not below 0.

    Returns:
        Vertices, shape (42, 3) [m]; triangles, outward.
    """
    u, faces = _directions()
    farthest = points[np.argmax(points @ u.T, axis=0)]
    return farthest + distance * u, faces


def dilated(cells: Cells, radius: float) -> NDArray[np.bool_]:
    """The cells of a grid whose centre is within a radius of that of a marked one.

    Args:
        cells: Marked where not 0, shape (a, b, c).
        radius: [cells], finite.
    """
    far = np.iinfo(np.int32).max // 4
    reach = math.floor(radius)
    squared: NDArray[np.int32] = np.where(cells != 0, 0, far).astype(np.int32)
    for axis in range(3):
        # Of the nearest marked cell by axes so far, the least over all steps along one axis more.
        lines = np.moveaxis(squared, axis, 0)
        nearest = lines.copy()
        for step in range(1, min(reach, len(lines) - 1) + 1):
            np.minimum(nearest[step:], lines[:-step] + step * step, out=nearest[step:])
            np.minimum(nearest[:-step], lines[step:] + step * step, out=nearest[:-step])
        squared = np.moveaxis(nearest, 0, axis)
    return np.asarray(np.sqrt(squared) <= radius)


SMOOTHING = 20
"""Rounds of relaxation of the surface."""
GROWTH = 0.25
"""Share of its size that a grid grows by at least, so that it rarely has to."""
SHARE = 0.5
"""Share of the memory that is free which a grid may take; the rest is for its mesh and everyone else."""
MARGIN = 2
"""Layers around what is marked that stay free [voxels]."""


class VoxelGrid:
    """Cubes of one size at multiples of it, marked or not; grows where asked to, within its memory."""

    def __init__(self, pitch: float, *, memory: float | None = None) -> None:
        """An empty grid.

        Args:
            pitch: Edge of a voxel [m].
            memory: Most bytes that it may take; by default a share of what is free.

        Raises:
            InputError: A pitch that is not a length.
        """
        check_pitch(pitch)
        self.pitch = pitch
        self.memory = available_memory() * SHARE if memory is None else memory
        self.first = np.zeros(3, np.int64)
        """Index of the first voxel: it begins at ``first * pitch``."""
        self.cells: Cells = np.zeros((0, 0, 0), np.uint8)
        """1 where marked, shape (nx, ny, nz)."""
        self.full = np.zeros((0, 0, 0), np.int16)
        """How many are marked in each block of `TOP`³."""
        self.count = 0
        """How many are marked."""

    @property
    def origin(self) -> Array:
        """Lower corner of the first voxel [m], shape (3,)."""
        return np.asarray(self.first * self.pitch, float)

    def arrays(self) -> Voxels:
        """The grid as kernels take it."""
        return Voxels(self.cells, self.full, self.origin, self.pitch)

    @property
    def volume(self) -> float:
        """Volume of the marked voxels [m³]."""
        return self.count * self.pitch**3

    def cover(self, low: Array, high: Array) -> None:
        """Grow until everything between two corners (3,) [m] lies inside, with a margin.

        Raises:
            InputError: It would take more memory than it may.
        """
        first, last = _indices(low, high, self.pitch)
        if self.cells.size:
            end = self.first + self.cells.shape
            if (first >= self.first).all() and (last < end).all():
                return
            spare = np.ceil(GROWTH * np.array(self.cells.shape)).astype(np.int64)
            first = np.where(first < self.first, np.minimum(first, self.first - spare), self.first)
            first = self.first - -(-(self.first - first) // TOP) * TOP
            last = np.where(last >= end, np.maximum(last, end + spare), end - 1)
        check_memory(last - first + 1, self.pitch, self.memory - self.cells.nbytes)
        cells: Cells = np.zeros(last - first + 1, np.uint8)
        full = np.zeros(-(-np.array(cells.shape) // TOP), np.int16)
        if self.cells.size:
            # Whole blocks, so that the counts stay right.
            for old, new, at in (
                (self.cells, cells, self.first - first),
                (self.full, full, (self.first - first) // TOP),
            ):
                i, j, k = at
                nx, ny, nz = old.shape
                new[i : i + nx, j : j + ny, k : k + nz] = old
        self.first, self.cells, self.full = first, cells, full

    def clear(self) -> None:
        """Mark none."""
        self.cells[:], self.full[:], self.count = 0, 0, 0

    def contains(self, points: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Whether each point (n, 3) [m] lies in a marked voxel."""
        index = np.floor(points / self.pitch).astype(np.int64) - self.first
        inside = ((index >= 0) & (index < self.cells.shape)).all(axis=1)
        marked = np.zeros(len(points), bool)
        marked[inside] = self.cells[tuple(index[inside].T)] != 0
        return marked

    def mesh(self, *, smoothing: int = SMOOTHING, most: int | None = None) -> Mesh:
        """A closed surface with all marked voxels inside.

        Args:
            smoothing: Rounds of relaxation; 0 for the faces of the voxels.
            most: Triangles, about; voxels are merged until there are no more. All of them stay inside.
        """
        (marked, first), pitch, factor = self.marked(), self.pitch, 1
        origin = first * pitch
        while True:
            made = marked.copy() if factor == 1 else nets.coarser(marked, factor)
            corner = origin - (0.0 if factor == 1 else factor * pitch)
            nets.fill_pinches(made)
            points, quads, normals = nets.boundary(made)
            if most is None or 2 * len(quads) <= most:
                break
            factor = max(factor + 1, math.floor(factor * math.sqrt(2 * len(quads) / most)))
        relaxed = nets.relax(points, quads, normals, smoothing)
        faces: Faces = nets.triangles(relaxed, quads)
        return Mesh(relaxed * (pitch * factor) + corner, faces)

    def marked(self, layers: int = 1) -> tuple[Cells, Array]:
        """A copy of the part that is marked, free layers around it, and the index where it begins (3,)."""
        low, high = self.bounds()
        cells: Cells = np.zeros(high - low + 1 + 2 * layers, np.uint8)
        a, b = low - self.first, high - self.first + 1
        cells[layers:-layers, layers:-layers, layers:-layers] = self.cells[
            a[0] : b[0], a[1] : b[1], a[2] : b[2]
        ]
        return cells, (low - layers).astype(float)

    def centres(self) -> Array:
        """Centres of the marked voxels [m], shape (n, 3)."""
        return (np.argwhere(self.cells) + (self.first + 0.5)) * self.pitch

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest index of a marked voxel, shape (3,) each.

        Raises:
            InputError: Nothing is marked.
        """
        spans = []
        for axis in range(3):
            others = tuple(a for a in range(3) if a != axis)
            spans.append(np.flatnonzero(self.cells.any(axis=others)))
        if not spans[0].size:
            raise InputError.at("voxels", "", "none is marked", "sweep something first")
        return (
            self.first + np.array([s[0] for s in spans]),
            self.first + np.array([s[-1] for s in spans]),
        )


def check_pitch(pitch: float, *, file: str = "swept volume", key: str = "voxel") -> None:
    """Refuse what is no edge of a voxel [m]."""
    if not (math.isfinite(pitch) and pitch > 0):
        raise InputError.at(
            file, key, f"{pitch} is not a length", "give the edge of a voxel in m, such as 0.01"
        )


def check_room(low: Array, high: Array, pitch: float, memory: float | None = None) -> None:
    """Refuse a grid between two corners (3,) [m] that would take more memory than it may.

    Corners that are not finite (a slide without limits) cannot be checked before.

    Raises:
        InputError: It would; says how much, and which voxel size fits.
    """
    check_pitch(pitch)
    span = (np.asarray(high, float) - np.asarray(low, float)) / pitch
    if not np.isfinite(span).all():
        return
    check_memory(span + 2 * MARGIN + 1, pitch, available_memory() * SHARE if memory is None else memory)


def check_memory(shape: Array, pitch: float, memory: float) -> None:
    """Refuse a grid of a shape (3,) that would take more bytes than ``memory``."""
    wanted = math.prod(float(n) for n in shape)
    if wanted <= memory:
        return
    fits = pitch * (wanted / max(memory, 1.0)) ** (1 / 3)
    digit = 10.0 ** math.floor(math.log10(fits)) / 10 if math.isfinite(fits) else 1.0
    size = " × ".join(f"{float(n) * pitch:.2f}" for n in shape)
    raise InputError.at(
        "swept volume",
        "voxel",
        f"{pitch:g} m needs {wanted / 1e6:,.0f} MB for {size} m, and {memory / 1e6:,.0f} MB may be taken",
        f"use voxels of {math.ceil(fits / digit) * digit:.3g} m or more, or fewer bodies",
    )


def _indices(low: Array, high: Array, pitch: float) -> tuple[np.ndarray, np.ndarray]:
    return (
        np.floor(np.asarray(low) / pitch).astype(np.int64) - MARGIN,
        np.floor(np.asarray(high) / pitch).astype(np.int64) + MARGIN,
    )


def available_memory() -> float:
    """Bytes that may still be taken without swapping; 2 GB where the system does not tell."""
    found = []
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                found.append(float(line.split()[1]) * 1024)
        most = Path("/sys/fs/cgroup/memory.max")
        if most.exists() and (limit := most.read_text(encoding="ascii").strip()).isdigit():
            used = Path("/sys/fs/cgroup/memory.current").read_text(encoding="ascii")
            found.append(max(float(limit) - float(used), 0.0))
    except (OSError, ValueError):
        pass
    if not found and sys.platform != "win32" and "SC_PHYS_PAGES" in os.sysconf_names:
        found.append(0.5 * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return min(found, default=2e9)
