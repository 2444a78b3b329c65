r"""How far a robot and a person come while the robot stops: the terms of the separation distance.

.. math:: S_p = S_h + S_r + S_s + C + Z_d + Z_r

ISO/TS 15066:2016 5.5.4.2.3, whose structure public sources agree on (2S), with

.. math::
    S_h = v_h (T_r + T_s), \qquad S_r = v_r T_r, \qquad
    S_s = v_r T_s \text{ (bound)} \quad\text{or}\quad \tfrac12 v_r T_s \text{ (constant deceleration)}

Speeds count as positive whatever their direction, so that what recedes never shrinks S_p.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from msgspec import Struct

from seerob.core.domains import at_least, number
from seerob.core.transforms import Array
from seerob.criteria.stopping.onset import Onset
from seerob.description.norms.iso_13855 import ARM_REACH, REACHING, WALKING
from seerob.kernels import separation as kernel
from seerob.kernels.separation import HumanSpeed
from seerob.twin.state import State

BOUND, CONSTANT = 1.0, 0.5
"""Share of v_r T_s that is travelled at full speed until standstill, and at constant deceleration."""


class Course(Struct, frozen=True, eq=False):
    """What each moving part of the robot does from now until it stands; n parts."""

    v_r: Array
    """Speed now [m/s], shape (n,)."""
    S_r: Array
    """Way during the reaction time [m], shape (n,)."""
    S_s: Array
    """Way while braking [m], shape (n,)."""
    T_s: float
    """Stopping time [s]."""
    unbounded_reason: str = ""
    """Why it may be more than this."""
    most: Course | None = None
    """A bound from above, where this is one from below."""
    more: str = ""
    """When it is up to ``most``, in words."""


At = Callable[[float], Course]
"""The course with all speeds multiplied by a factor."""
Braking = Callable[[State], Callable[[Onset, float], Course]]
"""From a state to what follows from an onset, with the factor on the present speeds that it has."""


LEAST = 1e-9
"""A deceleration is greater [m/s²]."""


def _check(**given: float) -> None:
    for name, value in given.items():
        number(name, value, 0)


def assumed_speed(human_speed: float | None) -> HumanSpeed:
    """How fast a person is assumed to come: v_h that is given [m/s], or as ISO 13855 has it."""
    return HumanSpeed(math.nan if human_speed is None else human_speed, REACHING, WALKING, ARM_REACH)


def way_of_person(v_h: Array | float, T_r: float, T_s: Array | float) -> Array:
    """S_h of a person who comes near at constant speed [m]; a person who recedes counts as standing."""
    time = at_least("T_r", T_r, unit="s") + at_least("T_s", T_s, unit="s")
    return np.asarray(np.maximum(v_h, 0.0) * time)


def braking(onset: Onset, T_s: float, share: float = BOUND) -> Course:
    """Course of parts that do something known before a stop that takes a known time; as `course`."""
    v_s = onset.v_s if share == BOUND else share * onset.v_s
    return Course(onset.v_r, onset.S_r, v_s * T_s, T_s, onset.unbounded_reason)


def course(v_r: Array, T_r: float, T_s: float, share: float = BOUND) -> Course:
    """Course of parts whose stop takes a known time.

    Args:
        v_r: Speed of each part now [m/s], shape (n,).
        T_r: Reaction time [s].
        T_s: Stopping time [s].
        share: `BOUND` or `CONSTANT`.
    """
    _check(T_r=T_r, T_s=T_s)
    number("share", share, 0.0, 1.0)
    v = np.maximum(np.asarray(v_r, float), 0.0)
    return Course(v, v * T_r, share * v * T_s, T_s)


def separation_distance(course: Course, v_h: Array | float, T_r: float, K: float) -> Array:
    """S_p [m] of each part, shape (n,).

    Args:
        course: Of the robot.
        v_h: Speed of the person [m/s].
        T_r: Reaction time [s].
        K: C + Z_d + Z_r [m].
    """
    return way_of_person(v_h, T_r, course.T_s) + course.S_r + course.S_s + K


def decelerating(v: Array | float, v_h: float, T_r: float, a: float, K: float) -> Array:
    r"""S_p with a constant deceleration, :math:`v_h (T_r + v/a) + v T_r + v^2 / 2a + K` [m].

    Args:
        v: Speed of the part [m/s], shape (...).
        v_h: Speed of the person [m/s].
        T_r: Reaction time [s].
        a: Deceleration [m/s²].
        K: C + Z_d + Z_r [m].
    """
    _check(T_r=T_r, v_h=v_h, K=K)
    number("a", a, LEAST, unit="m/s²")
    v = np.maximum(v, 0.0)
    return np.asarray(v_h * (T_r + v / a) + v * T_r + v**2 / (2 * a) + K)


def largest_speed_decelerating(d: Array | float, v_h: Array | float, T_r: float, a: float, K: float) -> Array:
    r"""Inverse of `decelerating`: the largest speed for which S_p is at most ``d`` [m/s].

    :math:`\sqrt{b^2 + 2a(d - K - v_h T_r)} - b` with :math:`b = a T_r + v_h`; 0 where no speed is.
    """
    _check(T_r=T_r, K=K)
    number("a", a, LEAST, unit="m/s²")
    at_least("v_h", v_h, unit="m/s")
    b = a * T_r + np.asarray(v_h)
    left = np.asarray(d) - K - np.asarray(v_h) * T_r
    return np.asarray(np.sqrt(b**2 + 2 * a * np.maximum(left, 0.0)) - b)


def largest_speed_in_time(
    d: Array | float, v_h: Array | float, T_r: float, T_s: float, K: float, share: float = BOUND
) -> Array:
    """Largest speed for which S_p with a stopping time that does not depend on it is at most ``d`` [m/s].

    0 where no speed is, also when S_p is larger than ``d`` at standstill.
    """
    _check(T_r=T_r, T_s=T_s, K=K)
    number("share", share, 0.0, 1.0)
    at_least("v_h", v_h, unit="m/s")
    left = np.asarray(d) - K - np.asarray(v_h) * (T_r + T_s)
    return np.asarray(np.maximum(left, 0.0) / (T_r + share * T_s))


def largest_factor(c: Array, b: Array, a: Array | float = 0.0) -> float:
    r"""Largest factor s of all speeds with :math:`a_i s^2 + b_i s + c_i \le 0` for every part i.

    Args:
        c: S_p at standstill less the distance [m], shape (n,).
        b: What grows with the speeds [m], not negative, shape (n,).
        a: What grows with their squares [m], not negative, shape (n,).

    Returns:
        0 where no factor is; inf where nothing grows.
    """
    squares = np.zeros(len(c)) + a
    return float(kernel.largest_factor(np.ascontiguousarray(c), np.ascontiguousarray(b), squares))


def worst_case(S_p: Array) -> Array:
    """Fixed separation distance of each part over a trajectory: its largest; shape (N, n) to (n,) [m]."""
    return np.asarray(np.max(S_p, axis=0))


def largest_scale(holds: Callable[[float], bool], top: float, halvings: int) -> float:
    """Largest factor of all speeds for which something holds, from below; 0 when it does not at 0.

    Args:
        holds: Whether it does at a factor; once it does not, it does not for larger ones.
        top: Largest factor to be considered.
        halvings: The answer is at most ``top / 2**halvings`` too small.
    """
    if holds(top):
        return top
    low, high = 0.0, top
    if not holds(low):
        return 0.0
    for _ in range(halvings):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def travel(turns: Sequence[bool], ways: Array, levers: Array) -> float:
    r"""Bound on the path of any point of a body while the joints of its chain travel given ways.

    A joint that turns by :math:`\theta` moves the point by at most :math:`\theta (\rho + D)`:
    :math:`\rho` is how far the point is from the axis now, :math:`D` how far joints farther out
    may carry it, in whatever order or overlap they move.

    Args:
        turns: Of each joint from the base outward, whether it is revolute.
        ways: How far each travels [rad or m], shape (k,).
        levers: Largest distance of the body from each axis now [m], shape (k,); of no meaning for
            joints that slide.

    Returns:
        [m]
    """
    at_least("ways", ways, unit="rad or m")
    way = 0.0
    for turn, angle, lever in zip(reversed(turns), ways[::-1], levers[::-1], strict=True):
        way += float(angle) * (float(lever) + way) if turn else float(angle)
    return way
