"""Axes of headsets: OpenVR, OpenXR and WebXR have x right, y up, -z forward; the world here has z up."""

from __future__ import annotations

import numpy as np

from seerob.core.transforms import Array, turned

WORLD_FROM_XR = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""x forward, y left, z up from x right, y up, z backward; a rotation."""


def world_positions(positions: Array) -> Array:
    """Positions with z up [m], shape (..., 3), of a headset's [m]."""
    return np.asarray(positions @ WORLD_FROM_XR.T)


def world_turns(wxyz: Array) -> Array:
    """World (z up) from device, w first, shape (..., 4), of a headset's rotations w first."""
    return turned(WORLD_FROM_XR, wxyz)


def xr_positions(positions: Array) -> Array:
    """Inverse of `world_positions`."""
    return np.asarray(positions @ WORLD_FROM_XR)


def xr_turns(wxyz: Array) -> Array:
    """Inverse of `world_turns`."""
    return turned(WORLD_FROM_XR.T, wxyz)
