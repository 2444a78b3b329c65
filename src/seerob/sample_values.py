"""The numbers of a sample that drives a robot or a person, and which of them can be."""

from __future__ import annotations

import numpy as np

from seerob.model import Mechanism
from seerob.samples import JointSample, PoseSample
from seerob.transforms import Array

LARGEST_SPEED = {"rad": 30.0, "m": 10.0}
"""Above it two samples are a jump [rad/s or m/s]: no arm and no person at work moves like that."""


def torques_of(sample: JointSample | PoseSample) -> Array | None:
    """Measured joint torques [N·m or N], shape (n,); None when there are none or one is not finite."""
    if isinstance(sample, PoseSample) or sample.tau is None or not np.isfinite(sample.tau).all():
        return None
    return np.array(sample.tau)


def is_finite(sample: JointSample | PoseSample) -> bool:
    """Whether instant, positions and velocities are finite."""
    if isinstance(sample, JointSample):
        return bool(np.isfinite([sample.t, *sample.q, *(sample.qd or ())]).all())
    return bool(np.isfinite([sample.t, *sample.position, *sample.wxyz]).all())


def largest_speed(mechanism: Mechanism) -> Array:
    """Above it two samples are a jump [rad/s or m/s], shape (n,)."""
    return np.array([LARGEST_SPEED[unit] for unit in mechanism.units])
