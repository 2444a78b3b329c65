"""Bounds on a robot's speeds along a motion that is known ahead, from tick to tick, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.spans import joint_bounds, point_bounds

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

_ROW, _ROWS, _PAIR = "f8[::1]", "f8[:,::1]", "f8[:,:,::1]"
_WINDOW = f"i8[::1], {_ROWS}, {_ROWS}, {_PAIR}, {_PAIR}, {_ROWS}"


@njit(f"i8(f8, i8, f8, f8[:], f8, {_ROW}, i8[::1])", cache=True, nogil=True)
def instants(
    begin: float, first: int, period: float, knots: Array, slack: float, found: Array, rows: Indices
) -> int:
    """Put ticks, and the knots that are none of them, in one order; writes into the last two arguments.

    Args:
        begin: The first tick, between two of the clock [s].
        first: Number of the clock's tick before it.
        period: Of the clock [s].
        knots: Not decreasing [s], shape (k,).
        slack: A knot that is nearer to a tick is that tick [s].
        found: Shape (s + k,).
        rows: Where each tick is, shape (s,).

    Returns:
        How many there are.
    """
    count, i, tick, before = 0, 0, begin, -np.inf
    for t in knots:
        while i < len(rows) and tick < t:
            found[count], rows[i], before = tick, count, tick
            count, i, tick = count + 1, i + 1, period * (first + i + 1)
        near = (i < len(rows) and abs(t - tick) <= slack) or (i > 0 and abs(t - before) <= slack)
        if not near and (count == 0 or found[count - 1] < t):
            found[count] = t
            count += 1
    while i < len(rows):
        found[count], rows[i] = tick, count
        count, i, tick = count + 1, i + 1, period * (first + i + 1)
    return count


@njit(f"i8(i8, {_WINDOW}, {_WINDOW}, b1[::1])", cache=True, nogil=True)
def kept(
    shift: int,
    rows_before: Indices,
    q_before: Array,
    qd_before: Array,
    parts_before: Array,
    joints_before: Array,
    last_before: Array,
    rows: Indices,
    q: Array,
    qd: Array,
    parts: Array,
    joints: Array,
    last: Array,
    known: Flags,
) -> int:
    """Take over what is known of ticks at which the motion is still the same, by its bits.

    Writes into the last four arguments; a window of s ticks has m instants, n parts and j joints.

    Args:
        shift: By how many ticks the window has moved on.
        rows_before: Of the window before: which instants are ticks, shape (s' + 1,).
        q_before: Positions of the joints [rad or m], shape (m', j).
        qd_before: Velocities [rad/s or m/s], shape (m', j).
        parts_before: Bounds on the speeds of parts [m/s], shape (m' - 1, 2, n).
        joints_before: Bounds on those of joints, shape (m' - 1, 2, j).
        last_before: Speeds of the parts at the end of each tick [m/s], shape (s', n).
        rows: Of the window now, as the others.
        q: Likewise.
        qd: Likewise.
        parts: Likewise.
        joints: Likewise.
        last: Likewise.
        known: Of which ticks that was known, shape (s,).

    Returns:
        How many ticks are not known.
    """
    own_q, own_qd = q.view(np.int64), qd.view(np.int64)
    other_q, other_qd = q_before.view(np.int64), qd_before.view(np.int64)
    missing = 0
    for i in range(len(known)):
        k = i + shift
        same = 0 <= k < len(rows_before) - 1 and rows[i + 1] - rows[i] == rows_before[k + 1] - rows_before[k]
        if same:
            a, b = rows[i], rows_before[k]
            for r in range(rows[i + 1] - a + 1):
                for j in range(q.shape[1]):
                    if own_q[a + r, j] != other_q[b + r, j] or own_qd[a + r, j] != other_qd[b + r, j]:
                        same = False
        known[i] = same
        if not same:
            missing += 1
            continue
        for r in range(rows[i + 1] - a):
            for side in range(2):
                for c in range(parts.shape[2]):
                    parts[a + r, side, c] = parts_before[b + r, side, c]
                for c in range(joints.shape[2]):
                    joints[a + r, side, c] = joints_before[b + r, side, c]
        for c in range(last.shape[1]):
            last[i, c] = last_before[k, c]
    return missing


@njit(
    f"void({_ROW}, {_ROWS}, {_ROWS}, {_ROWS}, {_ROW}, i8[::1], i8[::1], b1[::1], {_ROW}, f8, {_PAIR})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def part_speeds(
    t: Array,
    q: Array,
    v: Array,
    speeds: Array,
    home: Array,
    start: Indices,
    joints: Indices,
    turns: Flags,
    lengths: Array,
    rounding: float,
    bounds: Array,
) -> None:
    """Bound the speeds of parts on cubics from instant to instant; writes into the last argument.

    Args:
        t: Instants, increasing [s], shape (k,).
        q: Positions of all joints that move a part [rad or m], shape (k, d).
        v: Velocities there, shape (k, d).
        speeds: Of the fastest point of each part at the instants [m/s], shape (k, n).
        home: Positions of the joints in the model as compiled, shape (d,).
        start: As `seerob.kernels.spans.point_bounds` takes it of the parts, with the next three.
        joints: Likewise.
        turns: Likewise.
        lengths: Likewise.
        rounding: Added to each bound [m/s].
        bounds: Largest from instant to instant, and the larger of both instants [m/s], shape (k - 1, 2, n).
    """
    d, n = q.shape[1], speeds.shape[1]
    speed, change, varies, away = np.empty(d), np.empty(d), np.empty(d), np.empty(d)
    fast, quick, bend = np.empty(n), np.empty(n), np.empty(n)
    for i in range(len(t) - 1):
        a, b = t[i], t[i + 1]
        joint_bounds(t[i : i + 2], q[i : i + 2], v[i : i + 2], a, b, home, speed, change, varies, away)
        point_bounds(
            speed, change, varies, away, b - a, start, joints, turns, lengths, fast, quick, bend
        )  # fmt: skip
        for c in range(n):
            ends = np.maximum(speeds[i, c], speeds[i + 1, c])
            # Along the straight line between two velocities no speed is larger than at both ends.
            most = np.minimum(fast[c], ends + bend[c]) + rounding
            bounds[i, 0, c], bounds[i, 1, c] = np.maximum(most, ends), ends


@njit(f"void({_ROW}, {_ROWS}, {_ROWS}, {_PAIR})", cache=True, nogil=True, error_model="numpy")
def joint_speeds(t: Array, q: Array, qd: Array, bounds: Array) -> None:
    """Find the largest speeds of joints on each cubic from instant to instant; writes the last argument.

    Args:
        t: Instants, increasing [s], shape (k,).
        q: Positions there [rad or m], shape (k, j).
        qd: Velocities there [rad/s or m/s], shape (k, j).
        bounds: Largest from instant to instant, and the larger of both instants, shape (k - 1, 2, j).
    """
    for i in range(len(t) - 1):
        T = t[i + 1] - t[i]
        for j in range(q.shape[1]):
            chord = q[i + 1, j] - q[i, j]
            c_1, last = T * qd[i, j], T * qd[i + 1, j]
            c_2, c_3 = 3 * chord - 2 * c_1 - last, c_1 + last - 2 * chord
            x = 0.0 if c_3 == 0.0 else np.minimum(np.maximum(-c_2 / (3 * c_3), 0.0), 1.0)
            peak = abs(c_1 + x * (2 * c_2 + x * 3 * c_3)) / T
            ends = np.maximum(abs(qd[i, j]), abs(qd[i + 1, j]))
            bounds[i, 0, j], bounds[i, 1, j] = np.maximum(peak, ends), ends


@njit(
    f"void({_ROW}, f8, f8, f8[:,:], {_ROW}, f8, f8, f8, {_ROW}, {_ROW})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def farthest(
    t: Array,
    begin: float,
    end: float,
    most: Array,
    now: Array,
    T_r: float,
    lead: float,
    slack: float,
    way: Array,
    top: Array,
) -> None:
    """Bound how far and fast parts or joints get until they brake; writes into the last two arguments.

    Args:
        t: Instants, increasing [s], shape (k,).
        begin: Now [s].
        end: After which nothing counts [s], ``T_r + lead`` from now at most.
        most: Largest speeds from instant to instant, shape (k - 1, n).
        now: Speeds now, which may be larger, shape (n,).
        T_r: Reaction time [s].
        lead: A reaction begins until then [s].
        slack: Instants nearer than this are one [s].
        way: In any stretch of T_r that begins within ``lead`` [m or rad], shape (n,).
        top: Largest speed until then, shape (n,).
    """
    for c in range(len(now)):
        outside, far, fastest = np.inf, 0.0, 0.0
        a = np.minimum(t[0] - begin, end)
        for i in range(len(t) - 1):
            b = np.minimum(t[i + 1] - begin, end)
            fast = most[i, c] if i else np.maximum(most[i, c], now[c])
            far += (b - a) * fast
            fastest = np.maximum(fastest, fast)
            if a < lead - slack or b > T_r + slack:
                outside = np.minimum(outside, fast)
            a = b
        # What lies outside of the stretch is at its ends.
        way[c] = np.maximum(np.maximum(far - lead * outside, 0.0), now[c] * T_r)
        top[c] = fastest


@njit(
    f"void({_ROW}, {_PAIR}, i8[::1], i8[::1], {_ROWS}, f8, f8, f8, {_ROWS}, {_ROWS})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def reactions(
    t: Array,
    bounds: Array,
    first: Indices,
    last: Indices,
    now: Array,
    T_r: float,
    lead: float,
    slack: float,
    ways: Array,
    tops: Array,
) -> None:
    """Bound ways and speeds of parts until braking begins, from each of many instants on.

    Args:
        t: Instants of a motion, increasing [s], shape (m,).
        bounds: Largest speeds from instant to instant, as of `part_speeds`, shape (m - 1, 2, n).
        first: At which of them each reaction begins, shape (N,).
        last: At which it ends, ``T_r + lead`` later, shape (N,).
        now: Speeds when it begins, which may be larger [m/s], shape (N, n).
        T_r: Reaction time [s].
        lead: A reaction begins until then [s].
        slack: Instants nearer than this are one [s].
        ways: Receives them [m], shape (N, n).
        tops: Receives the largest speeds [m/s], shape (N, n).
    """
    for k in range(len(first)):
        a, b = first[k], last[k]
        farthest(
            t[a : b + 1], t[a], T_r + lead, bounds[a:b, 0], now[k], T_r, lead, slack, ways[k], tops[k]
        )  # fmt: skip
