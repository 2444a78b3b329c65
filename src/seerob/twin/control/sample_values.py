"""The numbers of a sample that drives a robot or a person, and which of them can be."""

from __future__ import annotations

import math

import numpy as np

from seerob.core.samples import LARGEST_SPEED, JointSample, PoseSample
from seerob.core.transforms import Array
from seerob.model.model import Mechanism

LARGEST = 1e6
"""No position and no speed is larger [rad or m, per second]."""
BEYOND = 0.1
"""A controller may let a joint go so much farther than its description says [rad or m]."""


def torques_of(sample: JointSample | PoseSample) -> Array | None:
    """Measured joint torques [N·m or N], shape (n,); None when there are none, or one cannot be."""
    if isinstance(sample, PoseSample) or sample.tau is None or not _are_possible(sample.tau):
        return None
    return np.array(sample.tau)


def is_possible(sample: JointSample | PoseSample) -> bool:
    """Whether the instant is finite, and positions and velocities are no larger than anything that is."""
    said = (
        (*sample.q, *(sample.qd or ())) if isinstance(sample, JointSample) else sample.position + sample.wxyz
    )
    return math.isfinite(sample.t) and _are_possible(said)


def _are_possible(said: tuple[float, ...]) -> bool:
    # What is not a number may hide from both ends, and not from the sum.
    return not said or (min(said) >= -LARGEST and max(said) <= LARGEST and math.isfinite(sum(said)))


def beyond_limits(sample: JointSample, mechanism: Mechanism) -> str:
    """Which joint is said to be where it cannot be; empty when none is."""
    if not any(
        (joint.lower is not None and joint.lower - value > BEYOND)
        or (joint.upper is not None and value - joint.upper > BEYOND)
        for joint, value in zip(mechanism.joints, sample.q, strict=True)
    ):
        return ""
    q = np.array(sample.q)
    over = np.maximum(mechanism.lower - q, q - mechanism.upper)
    k = int(np.argmax(over))
    limit = mechanism.lower[k] if q[k] < mechanism.lower[k] else mechanism.upper[k]
    unit = mechanism.units[k]
    return (
        f"{mechanism.joints[k].name} is said to be at {q[k]:.4g} {unit}, its limit is {limit:.4g} {unit}: "
        "is the unit right, and the robot?"
    )


def largest_speed(mechanism: Mechanism) -> Array:
    """Above it two samples are a jump [rad/s or m/s], shape (n,)."""
    return np.array([LARGEST_SPEED[unit] for unit in mechanism.units])
