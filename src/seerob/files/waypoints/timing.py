r"""Jerk-limited timing along a way, by ruckig ([Berscheid2021]_): how far along it one is at each instant.

Where pieces meet without a stop the acceleration along the way is 0. A change of speed by
:math:`\Delta v` then takes at least :math:`T = 2\sqrt{\Delta v / j}` where it never reaches the largest
acceleration, else :math:`T = \Delta v / a + a / j`, and a way of :math:`T (v_0 + v_1) / 2`.

What joints may do, and how much a way has to be slowed so that none exceeds it.

Along a way :math:`q(s)` a joint has the acceleration :math:`q'' v^2 + q' a` and the jerk
:math:`q''' v^3 + 3 q'' v a + q' j`. With the largest speed, acceleration and jerk along the way in place of
:math:`v, a, j`, and every term by its size, both are bounds at each place, whatever the timing. Time that
is stretched by *k* divides them by :math:`k^2` and :math:`k^3`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.transforms import Array
from seerob.files.waypoints.pieces import Piece

BETWEEN = 4
"""Places that are looked at from knot to knot of a curve."""
SHARE = 0.99
"""Share of the limits that is used at those places; the rest is for what lies between them."""


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Largest speed, acceleration and jerk of each joint, (n,) each; infinite where nobody stated one."""

    speed: Array
    """[rad/s or m/s]"""
    acceleration: Array
    """[rad/s² or m/s²]"""
    jerk: Array
    """[rad/s³ or m/s³]"""

    @classmethod
    def of(
        cls,
        n: int,
        *,
        speed: Sequence[float | None] = (),
        acceleration: Sequence[float] = (),
        jerk: Sequence[float] = (),
    ) -> Self:
        """Limits of ``n`` joints: one for each, one for all, or none."""

        def each(values: Sequence[float | None]) -> Array:
            found = [np.inf if v is None else v for v in values] or [np.inf]
            return np.broadcast_to(np.array(found, float), (n,))

        return cls(each(speed), each(acceleration), each(jerk))

    def stretch(self, piece: Piece, limits: Limits) -> tuple[float, str, int]:
        """How much longer a way has to take, at least 1; which limit that is for, and of which joint.

        Args:
            piece: The way.
            limits: Along it.
        """
        if np.isinf(self.acceleration).all() and np.isinf(self.jerk).all():
            return 1.0, "", 0
        s = piece.places(BETWEEN)
        first, second, third = (np.abs(piece.derivative(s, order)) for order in (1, 2, 3))
        v, a, j = limits.speed, limits.acceleration, limits.jerk
        needs = {
            "acceleration": ((second * v**2 + first * a).max(axis=0) / self.acceleration / SHARE) ** (1 / 2),
            "jerk": ((third * v**3 + 3 * second * v * a + first * j).max(axis=0) / self.jerk / SHARE)
            ** (1 / 3),
        }
        what = max(needs, key=lambda name: float(needs[name].max()))
        joint = int(np.argmax(needs[what]))
        return max(1.0, float(needs[what][joint])), what, joint

    def rate(self, sizes: Sequence[Array]) -> float:
        """Largest rate of a curve whose parameter advances evenly.

        Args:
            sizes: Largest of each joint's first, second and third derivative by the parameter, (n,) each.
        """
        given = (self.speed, self.acceleration, self.jerk)
        return min(
            float(np.min(limit / np.maximum(size, 1e-12)) ** (1 / order))
            for order, (limit, size) in enumerate(zip(given, sizes, strict=True), start=1)
        )


@dataclass(frozen=True)
class Limits:
    """Along a way whose unit is m, or rad or m in joint space."""

    speed: float
    acceleration: float
    jerk: float


@dataclass(frozen=True)
class Profile:
    """Place and speed on a way over time."""

    duration: float
    """[s]"""
    at: Callable[[float], tuple[float, float]]
    """Place and speed at a time from its begin [s]."""


def needed(v0: float, v1: float, limits: Limits) -> float:
    """Shortest way on which a speed changes into another, with no acceleration at either end."""
    change = abs(v1 - v0)
    if change <= limits.acceleration**2 / limits.jerk:
        T = 2 * math.sqrt(change / limits.jerk)
    else:
        T = change / limits.acceleration + limits.acceleration / limits.jerk
    return (v0 + v1) / 2 * T


def reachable(v0: float, wanted: float, length: float, limits: Limits) -> float:
    """The largest speed, at most ``wanted``, that a way allows from ``v0`` (or to it, which is the same)."""
    if wanted <= v0 or needed(v0, wanted, limits) <= length:
        return wanted
    low, high = v0, wanted
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if needed(v0, middle, limits) <= length else (low, middle)
    return low


def profile(
    length: float, v0: float, v1: float, limits: Limits, *, duration: float | None, file: str, place: str
) -> Profile:
    """The quickest way through a piece, or one that takes a given time.

    Args:
        length: Of the piece.
        v0: Speed at its begin.
        v1: At its end.
        limits: On it.
        duration: Time that it is to take [s].
        file: For messages.
        place: For messages.

    Raises:
        InputError: The time is too short.
    """
    need("ruckig")
    from ruckig import InputParameter, Result, Ruckig, Trajectory

    asked = InputParameter(1)
    asked.current_position, asked.current_velocity, asked.current_acceleration = [0.0], [v0], [0.0]
    asked.target_position, asked.target_velocity, asked.target_acceleration = [length], [v1], [0.0]
    asked.max_velocity = [max(limits.speed, v0, v1)]
    asked.max_acceleration, asked.max_jerk = [limits.acceleration], [limits.jerk]
    found = Trajectory(1)
    result = Ruckig(1).calculate(asked, found)
    if result not in (Result.Working, Result.Finished):
        what = f"no timing for a way of {length:.4g} from {v0:.4g} to {v1:.4g} per s ({result})"
        raise InputError.at(file, place, what, "correct speed, acceleration and jerk")
    quickest = float(found.duration)
    stretch = 1.0
    if duration is not None:
        if duration < quickest * (1 - 1e-9):
            what = f"{duration:g} s is too short: the limits allow {quickest:.3f} s"
            raise InputError.at(file, place, what, "give more time or higher limits")
        stretch = duration / quickest

    def at(t: float) -> tuple[float, float]:
        position, velocity, _ = found.at_time(min(max(t / stretch, 0.0), quickest))
        return float(position[0]), float(velocity[0]) / stretch

    return Profile(quickest * stretch, at)
