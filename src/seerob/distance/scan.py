"""A laser scanner's plane: its beams, and what of a field they cover.

Rays into the scene: how far a beam gets and what stops it; see `seerob.kernels.rays`.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes import signed_area
from seerob.core.transforms import Array
from seerob.kernels.pairs import BoundSolids
from seerob.kernels.rays import CLOSE, STEPS, cast
from seerob.kernels.shapes import Shapes
from seerob.kernels.signed_distance import place
from seerob.workstation.tables.sensors import LaserScanner, MonitoredField

Indices = NDArray[np.int64]


class Rays:
    """What some bodies do to rays; bound once, asked at every tick."""

    def __init__(self, shapes: Shapes, bodies: Iterable[int]) -> None:
        """Of a model, and indices of the bodies that can stop a ray; none is allowed."""
        self.shapes, self.bodies = shapes, tuple(dict.fromkeys(bodies))
        self._bound = BoundSolids(shapes.arrays())
        self._solids = np.array([s for b in self.bodies for s in shapes.solids[b]], np.int64)

    def cast(
        self,
        rotations: Array,
        positions: Array,
        origins: Array,
        directions: Array,
        distance: Array,
        met: Indices,
    ) -> None:
        """Shorten rays to where they meet a body.

        Args:
            rotations: world_from_body of every body, shape (n, 3, 3).
            positions: Likewise [m], shape (n, 3).
            origins: World [m], shape (k, 3).
            directions: Unit vectors, shape (k, 3).
            distance: Length of each ray [m], shape (k,); shortened.
            met: Set to the body that a ray meets, where it does, shape (k,).
        """
        s = self.shapes
        if not len(self._solids):
            return
        # Of its own: threads of a batch ask one of these at the same time.
        world = np.empty((len(s.which), 12))
        place(
            np.ascontiguousarray(rotations, float), np.ascontiguousarray(positions, float), s.which, s.local,
            self._solids, world,
        )  # fmt: skip
        starts = np.ascontiguousarray(origins, float)
        along = np.ascontiguousarray(directions, float)
        cast(starts, along, self._solids, self._bound.table, world, distance, met)


def met_beside(length: float) -> float:
    """How far a ray of a length may run from a body that it counts as meeting [m].

    A dilated core is met within `kernels.rays.CLOSE`, or where as many steps as are made, each of the
    distance to it, end before the ray does.
    """
    return length / STEPS + CLOSE


DRAWN = 0.09
"""Angle between two points of the border of a field as drawn, where nothing stands in it [rad]."""
STEP = 0.03
"""Change of range from beam to beam that is drawn [m]."""


def beam_angles(scanner: LaserScanner) -> Array:
    """Angles of the beams about z, from x, symmetric to it [rad], shape (n,); n is odd."""
    half = int(np.floor(scanner.angle / 2 / scanner.resolution + 1e-9))
    # A scanner that looks all around has no beam twice.
    twice = np.isclose(2 * half * scanner.resolution, 2 * np.pi)
    return np.asarray(np.arange(-half, half + (0 if twice else 1)) * scanner.resolution, float)


def directions(angles: Array) -> Array:
    """Unit vectors in the scanner's plane, shape (n, 3)."""
    return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])


def spans(field: MonitoredField, angles: Array) -> Array:
    """Where each beam runs inside a field: entries and exits in pairs [m], inf-padded, shape (n, m)."""
    a = np.asarray(field.corners, float)
    edge = np.roll(a, -1, axis=0) - a
    u = directions(angles)[:, :2]
    # o + t u = a + s e, with u × e as the determinant.
    det = u[:, :1] * edge[:, 1] - u[:, 1:] * edge[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (a[:, 0] * edge[:, 1] - a[:, 1] * edge[:, 0]) / det
        s = (a[:, 0] * u[:, 1:] - a[:, 1] * u[:, :1]) / det
    crossed = np.where((s >= 0) & (s < 1) & (t > 0) & np.isfinite(t), t, np.inf)
    crossed.sort(axis=1)
    odd = np.isfinite(crossed).sum(axis=1) % 2 == 1
    out = np.where(odd[:, None], np.column_stack([np.zeros(len(u)), crossed[:, :-1]]), crossed)
    return out if out.shape[1] % 2 == 0 else np.column_stack([out, np.full(len(u), np.inf)])


def seen_area(within: Array, distance: Array, resolution: float) -> float:
    """Area of the part of a field that beams of a length reach [m²].

    Args:
        within: From `spans`.
        distance: How far each beam gets [m], shape (n,).
        resolution: Angle between beams [rad].
    """
    reached = np.where(np.isfinite(within), np.minimum(within, distance[:, None]), 0.0)
    return float(resolution / 2 * (reached[:, 1::2] ** 2 - reached[:, ::2] ** 2).sum())


class Coverage:
    """What of a field beams reach, and what is blind."""

    def __init__(self, field: MonitoredField, within: Array, resolution: float) -> None:
        """Of a field.

        Args:
            field: The field.
            within: From `spans`.
            resolution: Angle between beams [rad].
        """
        self.within, self.resolution = within, resolution
        self.whole = abs(signed_area(field.corners))
        """Area of the field [m²]."""
        self._unbounded = seen_area(within, np.full(len(within), np.inf), resolution)

    def blind(self, distance: Array) -> float:
        """Area of the part of the field that no beam reaches [m²]; not below 0.

        What rounding to beams makes of a whole circle sector is taken out of the difference by scaling the
        seen area with the area that beams of any length see, where they look all over the field.

        Args:
            distance: How far each beam gets [m], shape (n,).
        """
        unbounded = self._unbounded
        share = seen_area(self.within, distance, self.resolution) / unbounded if unbounded > 0 else 0.0
        return max(self.whole - share * min(unbounded, self.whole), 0.0)


def outline(within: Array, distance: Array, angles: Array) -> tuple[Array, NDArray[np.int64]]:
    """The part of a field that beams see from the scanner on, by as few of its beams as show its border.

    Returns:
        Ends of these beams in the scanner's plane, shape (n, 3) [m]; which beams they are, shape (n,).
    """
    first = within[:, 0]
    reach = np.where(first <= 0, np.minimum(within[:, 1], distance), 0.0)
    reach = np.where(np.isfinite(reach), reach, 0.0)
    every = max(int(DRAWN / max(float(angles[1] - angles[0]), 1e-9)), 1) if len(angles) > 1 else 1
    kept = np.zeros(len(angles), bool)
    kept[::every] = kept[-1] = True
    steps = np.flatnonzero(np.abs(np.diff(reach)) > STEP)
    kept[steps] = kept[np.minimum(steps + 1, len(angles) - 1)] = True
    return directions(angles[kept]) * reach[kept, None], np.flatnonzero(kept)
