"""Protective separation distances of the parts of a robot, and speeds at which they are kept, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, types

from seerob.core.transforms import Array
from seerob.kernels.bound import tuple_type
from seerob.kernels.pull import greatest
from seerob.kernels.spans import Indices
from seerob.kernels.spans import greatest as greatest_of
from seerob.kernels.verdicts import Codes, judged

_ROW, _ROWS = "f8[::1]", "f8[:,::1]"
_ONE, _TWO, _FLOAT = types.float64[::1], types.float64[:, ::1], types.float64


class HumanSpeed(NamedTuple):
    """How fast a person is assumed to come."""

    v_h: float
    """Speed that is given [m/s]; NaN for that of ISO 13855, by the next three."""
    reaching: float
    """Speed up to ``arm`` [m/s]."""
    walking: float
    """Speed beyond [m/s]."""
    arm: float
    """Distance up to which the former counts, and below which the latter leads to none [m]."""


class TimedStop(NamedTuple):
    """A stop that takes a known time."""

    T_r: float
    """Reaction time [s]."""
    T_s: float
    """Stopping time [s]."""
    share: float
    """Of speed times stopping time that is travelled."""


HUMAN_SPEED, TIMED_STOP = tuple_type(HumanSpeed, [_FLOAT] * 4), tuple_type(TimedStop, [_FLOAT] * 3)


@njit(
    types.void(_ONE, _ONE, _FLOAT, _FLOAT, HUMAN_SPEED, _FLOAT, _ONE),
    cache=True,
    nogil=True,
    error_model="numpy",
)
def separation(
    S_r: Array, S_s: Array, time: float, K: float, human_speed: HumanSpeed, seen: float, found: Array
) -> None:
    """Find S_p of each part at one instant, shape (n,); arguments as of `separations`."""
    v_h, reaching, walking, arm = human_speed
    given = not math.isnan(v_h)
    own = np.maximum(np.maximum(v_h, seen), 0.0) * time
    near, far = np.maximum(reaching, 0.0) * time, np.maximum(walking, 0.0) * time
    faster = np.maximum(seen, 0.0) * time
    for i in range(len(S_r)):
        if given:
            found[i] = own + S_r[i] + S_s[i] + K
            continue
        least = near + S_r[i] + S_s[i] + K
        if not least <= arm:
            least = np.maximum(far + S_r[i] + S_s[i] + K, arm)
        # A speed that is not a number is none that may be left out.
        if not seen <= walking:
            least = np.maximum(least, faster + S_r[i] + S_s[i] + K)
        found[i] = least


@njit(
    f"void(f8, {_ROW}, {_ROW}, f8, {_ROW}, {_ROW}, f8, {_ROW})", cache=True, nogil=True, error_model="numpy"
)
def rise(
    S_h: float,
    S_r: Array,
    S_s: Array,
    S_h_then: float,
    S_r_then: Array,
    S_s_then: Array,
    more: float,
    found: Array,
) -> None:
    """Find by how much S_p of each part is longer after another course; writes the last argument.

    Args:
        S_h: Way of the person [m].
        S_r: Ways while the robot reacts [m], shape (n,).
        S_s: Ways while it brakes [m], shape (n,).
        S_h_then: After the other course, with the next two.
        S_r_then: Likewise.
        S_s_then: Likewise.
        more: What is added [m].
        found: [m], shape (n,).
    """
    for i in range(len(S_r)):
        found[i] = ((S_h_then + S_r_then[i] + S_s_then[i]) - (S_h + S_r[i] + S_s[i])) + more


@njit(types.void(_ONE, HUMAN_SPEED, _FLOAT, _ONE), cache=True, nogil=True, error_model="numpy")
def approach_speeds(distance: Array, human_speed: HumanSpeed, seen: float, found: Array) -> None:
    """Find the speed of the person that counts for each part at its distance; writes the last argument.

    Args:
        distance: Of each part [m], shape (n,).
        human_speed: How fast the person is assumed to come.
        seen: As of `separations`, of one instant.
        found: [m/s], shape (n,).
    """
    v_h, reaching, walking, arm = human_speed
    for i in range(len(distance)):
        assumed = v_h if not math.isnan(v_h) else walking if distance[i] >= arm else reaching
        found[i] = np.maximum(assumed, seen)


@njit(
    types.void(_TWO, _TWO, _FLOAT, _FLOAT, HUMAN_SPEED, _ONE, _TWO),
    cache=True,
    nogil=True,
    error_model="numpy",
)
def separations(
    S_r: Array, S_s: Array, time: float, K: float, human_speed: HumanSpeed, seen: Array, found: Array
) -> None:
    r"""Find S_p of each part at many instants; writes into the last argument.

    It is :math:`v_h (T_r + T_s) + S_r + S_s + K`.

    Args:
        S_r: Ways while the robot reacts [m], shape (N, n).
        S_s: Ways while it brakes [m], shape (N, n).
        time: T_r + T_s [s].
        K: C + Z_d + Z_r [m].
        human_speed: How fast the person is assumed to come.
        seen: Speed that the person is seen to have, which counts where it is larger [m/s], shape (N,).
        found: S_p [m], shape (N, n).
    """
    for k in range(S_r.shape[0]):
        separation(S_r[k], S_s[k], time, K, human_speed, seen[k], found[k])


@njit(f"f8({_ROW}, {_ROW}, {_ROW})", cache=True, nogil=True, error_model="numpy")
def largest_factor(c: Array, b: Array, a: Array) -> float:
    r"""Largest factor s of all speeds with :math:`a_i s^2 + b_i s + c_i \le 0` for every part i.

    Args:
        c: S_p at standstill less the distance [m], shape (n,).
        b: What grows with the speeds [m], not negative, shape (n,).
        a: What grows with their squares [m], not negative, shape (n,).

    Returns:
        0 where no factor is; inf where nothing grows; NaN where something is not a number.
    """
    least = math.inf
    for i in range(len(c)):
        if c[i] > 0:
            return 0.0
    for i in range(len(c)):
        left = -c[i]
        # The root that stays exact when the square is small.
        down = b[i] + math.sqrt(b[i] * b[i] + 4 * a[i] * left)
        if math.isnan(down):
            return math.nan
        if down > 0:
            least = min(least, 2 * left / down)
        elif a[i] != 0:
            least = 0.0
    return least


@njit(
    types.float64(*[_ONE] * 6, TIMED_STOP, _FLOAT),
    cache=True,
    nogil=True,
    error_model="numpy",
)
def largest_factor_in_time(
    distance: Array,
    v_h: Array,
    S_rest: Array,
    S_now: Array,
    v_rest: Array,
    v_now: Array,
    stop: TimedStop,
    K: float,
) -> float:
    """Find the largest factor of all speeds with no part nearer than its S_p, for a stop of known time.

    Args:
        distance: Of each part [m], shape (n,).
        v_h: Speed of the person that counts for each part [m/s], shape (n,).
        S_rest: Ways while the robot reacts that is at rest now [m], shape (n,).
        S_now: Ways at the present speeds, likewise.
        v_rest: Speeds at which it begins to brake, at rest now [m/s], shape (n,).
        v_now: At the present speeds, likewise.
        stop: The stop.
        K: C + Z_d + Z_r [m].

    Returns:
        As `largest_factor`.
    """
    T_r, T_s, share = stop
    n = len(distance)
    c, b = np.empty(n), np.empty(n)
    for i in range(n):
        c[i] = v_h[i] * (T_r + T_s) + K - distance[i] + S_rest[i] + share * v_rest[i] * T_s
        b[i] = (S_now[i] - S_rest[i]) + share * (v_now[i] - v_rest[i]) * T_s
    return largest_factor(c, b, np.zeros(n))


@njit(
    types.int64(*[_ONE] * 4, TIMED_STOP, _FLOAT, HUMAN_SPEED, *[_FLOAT] * 3, _TWO, types.uint8[::1], _ONE),
    cache=True,
    nogil=True,
    error_model="numpy",
)
def stops_in_time(
    v_r: Array,
    S_r: Array,
    v_s: Array,
    distance: Array,
    stop: TimedStop,
    K: float,
    human_speed: HumanSpeed,
    seen: float,
    moving: float,
    rounding: float,
    found: Array,
    verdicts: Codes,
    permitted: Array,
) -> int:
    """Judge the distances of parts of a robot whose stop takes a known time; writes the last three arguments.

    Args:
        v_r: Speed of each part now [m/s], shape (n,).
        S_r: Way until braking begins [m], shape (n,).
        v_s: Largest speed until then [m/s], shape (n,).
        distance: Of each part [m], shape (n,).
        stop: The stop.
        K: C + Z_d + Z_r [m].
        human_speed: How fast the person is assumed to come.
        seen: As of `separations`, of the instant [m/s].
        moving: Speed above which the robot moves [m/s].
        rounding: As of `seerob.kernels.verdicts.judged`.
        found: Ways while it brakes and S_p [m], shape (2, n).
        verdicts: Of each part, shape (n,).
        permitted: Largest speed of the fastest part with no part nearer than its S_p [m/s], and as a factor
            of the present speeds, NaN at rest, shape (2,).

    Returns:
        Which part governs; -1 where a distance, or S_p, is not finite.
    """
    n, (T_r, T_s, share) = len(distance), stop
    S_s, S_p, v_h, rest = found[0], found[1], np.empty(n), np.empty((2, n))
    for i in range(n):
        S_s[i] = (v_s[i] if share == 1.0 else share * v_s[i]) * T_s
        rest[0, i], rest[1, i] = 0.0 * S_r[i], 0.0 * v_s[i]
    separation(S_r, S_s, T_r + T_s, K, human_speed, seen, S_p)
    for i in range(n):
        if not (math.isfinite(distance[i]) and math.isfinite(S_p[i])):
            return -1
    approach_speeds(distance, human_speed, seen, v_h)
    top = greatest(v_r)
    if top < moving:
        # At rest nobody knows which part will be fastest: each may be.
        least = math.inf
        for i in range(n):
            more, faster = S_r[i] - v_r[i] * T_r, v_s[i] - v_r[i]
            left = distance[i] - more - share * faster * T_s
            left = left - K - v_h[i] * (T_r + T_s)
            least = min(least, np.maximum(left, 0.0) / (T_r + share * T_s))
        permitted[0], permitted[1] = least, math.nan
    else:
        factor = largest_factor_in_time(distance, v_h, rest[0], S_r, rest[1], v_s, stop, K)
        permitted[0], permitted[1] = factor * top, factor
    return judged(distance, distance, distance, S_p, rounding, False, False, verdicts)


@njit(
    types.void(_ONE, _ONE, types.int64[::1], types.int64[::1], _FLOAT, TIMED_STOP, *[_FLOAT] * 3, _ONE),
    cache=True,
    nogil=True,
    error_model="numpy",
)
def lost_in_time(
    fast: Array,
    slow: Array,
    people: Indices,
    parts: Indices,
    T: float,
    stop: TimedStop,
    least: float,
    most: float,
    rounding: float,
    lost: Array,
) -> None:
    """Bound what margins lose within a span, of parts that stop in a known time; writes the last argument.

    Args:
        fast: Largest speed of each point within the span [m/s], shape (p,).
        slow: Least speed of the fastest point of each body, those of bodies first [m/s], shape (b,).
        people: Points of people, shape (k,).
        parts: Of the robot, shape (n,).
        T: Length of the span [s].
        stop: The stop.
        least: Speed of the person that S_p assumes at least [m/s].
        most: Speed up to which it assumes so at most [m/s].
        rounding: Added to the way of people [m].
        lost: By how much each may be less above its S_p, then how much nearer each may be [m], shape (2 n,).
    """
    n, (T_r, T_s, share) = len(parts), stop
    time = T_r + T_s
    slowest, fastest = greatest_of(slow, people), greatest_of(fast, people)
    way, v_h = greatest_of(fast, people) * T + rounding, max(least, fastest)
    more = max(fastest - max(most, slowest), 0.0) * time
    for i in range(n):
        low, high, nearer = slow[parts[i]], fast[parts[i]], way + fast[parts[i]] * T
        S_s = (low if share == 1.0 else share * low) * T_s
        S_s_then = (high if share == 1.0 else share * high) * T_s
        longer = ((v_h * time + high * T_r + S_s_then) - (v_h * time + low * T_r + S_s)) + more
        lost[i], lost[n + i] = nearer + longer, nearer
