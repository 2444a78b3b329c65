r"""A camera: how points of the cell come into its picture, and how far off that may be.

Pinhole with the distortion of Brown (1966) and Conrady (1919), as OpenCV has it (docs.opencv.org, *Camera
Calibration and 3D Reconstruction*): with :math:`x = X/Z`, :math:`y = Y/Z`, r² = x² + y²,

.. math:: x' = x (1 + k_1 r^2 + k_2 r^4 + k_3 r^6) + 2 p_1 x y + p_2 (r^2 + 2 x^2)

and :math:`u = f_x x' + c_x`, likewise for y. The camera's frame has x to the right, y down, z ahead.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta

from seerob.core.errors import InputError
from seerob.core.files.toml_file import read_toml
from seerob.core.quantities import Metres3, Table
from seerob.core.transforms import Array, inverse, rotation_from_wxyz, transform

Pixels = Annotated[float, Meta(gt=0, le=1e5)]
Five = tuple[float, float, float, float, float]


class Camera(Table, frozen=True, kw_only=True):
    """A camera that was calibrated, as ``seerob calibrate camera`` writes it."""

    width: Annotated[int, Meta(ge=16, le=16384)]
    """Of its pictures [px]."""
    height: Annotated[int, Meta(ge=16, le=16384)]
    """[px]"""
    fx: Pixels
    """Focal length [px]."""
    fy: Pixels
    cx: float
    """Principal point [px]."""
    cy: float
    distortion: Five = (0.0, 0.0, 0.0, 0.0, 0.0)
    """k1, k2, p1, p2, k3."""
    position: Metres3 = (0.0, 0.0, 0.0)
    """Where it is in the cell [m]."""
    wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """World from camera: x to the right, y down, z ahead of it."""
    on: str | None = None
    """Full name of the link, tool, part or machine that carries it: its pose is in the frame of that."""
    error_px: float | None = None
    """Root mean square of what corners of boards are off in its pictures [px]."""
    error: float | None = None
    """What 95 % of the error at ``tool`` stay within, across the line of sight [m]."""
    tool: str = ""
    """Where that is: a robot's point of interest, or the board."""
    board: str = ""
    """What was printed."""

    @property
    def lens(self) -> Array:
        """fx, fy, cx, cy, k1, k2, p1, p2, k3, shape (9,)."""
        return np.array([self.fx, self.fy, self.cx, self.cy, *self.distortion])

    @property
    def world_from_camera(self) -> Array:
        """Shape (4, 4); of one that is carried, in the frame of what carries it."""
        return transform(rotation_from_wxyz(self.wxyz), self.position)


def project(lens: Array, points: Array) -> Array:
    """Where points in the camera's frame come to be in the picture [px], shape (..., 2).

    Args:
        lens: fx, fy, cx, cy, k1, k2, p1, p2, k3.
        points: [m], shape (..., 3), ahead of the camera.
    """
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens
    x, y = points[..., 0] / points[..., 2], points[..., 1] / points[..., 2]
    r = x * x + y * y
    radial = 1 + r * (k1 + r * (k2 + r * k3))
    u = x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x)
    v = y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y
    return np.stack([fx * u + cx, fy * v + cy], -1)


def seen(camera: Camera, points: Array) -> Array:
    """Where points of the cell [m], shape (..., 3), come to be in its picture [px], shape (..., 2)."""
    T = inverse(camera.world_from_camera)
    return project(camera.lens, np.asarray(points, float) @ T[:3, :3].T + T[:3, 3])


def read(path: Path) -> Camera:
    """A file that ``seerob calibrate camera`` wrote.

    Raises:
        InputError: It is none.
    """
    tables, _ = read_toml(path)
    try:
        return msgspec.convert(tables.get("camera"), Camera)
    except msgspec.ValidationError as error:
        raise InputError.at(path, "camera", str(error), "calibrate it: seerob calibrate camera") from error
