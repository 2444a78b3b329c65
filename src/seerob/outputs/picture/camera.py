"""Where to look from: a pinhole camera, and the distance from which everything named fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seerob.core.transforms import Array

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

    @property
    def focal(self) -> float:
        """Focal length [px]."""
        return float(self.height / 2 / np.tan(FIELD_OF_VIEW / 2))

    def local(self, points: Array) -> Array:
        """Points (n, 3) of the world in the camera's right, down, forward [m]."""
        return np.asarray((np.asarray(points, float).reshape(-1, 3) - self.eye) @ self.axes.T)

    def project(self, points: Array) -> tuple[Array, Array]:
        """Screen position [px] (n, 2) and 1/z [1/m] (n,) of points (n, 3); 0 for those not in front."""
        x, y, z = self.local(points).T
        inverse = np.where(z > NEAR, 1 / np.where(z > NEAR, z, 1.0), 0.0)
        middle = np.array([self.width / 2, self.height / 2])
        return middle + self.focal * np.stack([x, y], -1) * inverse[:, None], inverse

    def scaled(self, factor: int) -> Camera:
        """Return a camera with this view and ``factor`` times as many pixels each way."""
        return Camera(self.eye, self.axes, self.width * factor, self.height * factor)


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
    x = np.asarray(points, float).reshape(-1, 3) @ axes.T
    # A camera at c (right, down) and depth d sees x when |x_i - c_i| <= reach_i (z - d), for each of
    # the two directions: the largest d for which an interval of c remains.
    low = (x[:, :2] + reach * -x[:, 2:]).max(axis=0)
    high = (x[:, :2] + reach * x[:, 2:]).min(axis=0)
    depth = min(float(((high - low) / (2 * reach)).min()), float(x[:, 2].min()) - 0.3)
    center = (low + high) / 2
    return Camera(np.array([*center, depth]) @ axes, axes, width, height)
