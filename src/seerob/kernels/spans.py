r"""How fast joints and points get within a span of time, and how quickly that changes, compiled.

Joints move along cubics from knot to knot, with the positions and velocities there. A point is moved by a
chain of joints, from base to tip: segment k, of length :math:`l_k`, is fixed behind joint k, whatever the
joints do. With bounds :math:`v, a, c` of a joint's speed, of its acceleration and of the total variation of
that over the span of length T, the frame behind joint k turns with at most

.. math::
    \Omega_k &= \Omega_{k-1} + v_k, \qquad \Omega'_k = \Omega'_{k-1} + a_k + v_k \Omega_{k-1}, \\
    \Omega''_k &= \Omega''_{k-1} + c_k + T (2 a_k \Omega_{k-1} + v_k (\Omega'_{k-1} + \Omega_{k-1}^2)),

and a vector of length l fixed to it changes by at most :math:`\Omega l`, :math:`(\Omega' + \Omega^2) l`, the
latter of which varies over the span by at most :math:`(\Omega'' + T (3 \Omega \Omega' + \Omega^3)) l`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, types
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import Layout, tuple_type

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

_ROW, _ROWS = "f8[::1]", "f8[:,::1]"
_ONE, _TWO, _WHOLE = types.float64[::1], types.float64[:, ::1], types.int64[::1]


class Chains(NamedTuple):
    """Joints that move p points, k in all: of one point after the other, each from base to tip."""

    start: Indices
    """Where the joints of each point begin, shape (p + 1,)."""
    joints: Indices
    """Which they are, shape (k,)."""
    turns: Flags
    """Whether each turns; otherwise it slides, shape (k,)."""
    lengths: Array
    """Of the segment behind each [m], shape (k,)."""


CHAINS = tuple_type(Chains, (_WHOLE, _WHOLE, types.boolean[::1], _ONE))


@njit(f"void({_ROW}, {_ROWS}, {_ROWS}, f8, f8, {_ROW}, {_ROWS})", cache=True, nogil=True, error_model="numpy")
def joint_bounds(t: Array, q: Array, v: Array, begin: float, end: float, home: Array, found: Array) -> None:
    """Bounds on the motion of joints within a span; writes into the last argument.

    Args:
        t: Knots, increasing [s], shape (k,), k >= 2.
        q: Positions there [rad or m], shape (k, n).
        v: Velocities there, shape (k, n).
        begin: Of the span [s].
        end: Likewise.
        home: Positions in the model as compiled, shape (n,).
        found: Largest absolute speed and acceleration, total variation of the latter, and farthest from
            ``home``, shape (4, n).
    """
    n = q.shape[1]
    speed, change, varies, away = found[0], found[1], found[2], found[3]
    found[:] = 0.0
    before = np.zeros(n)
    some = False
    for k in range(len(t) - 1):
        T = t[k + 1] - t[k]
        low, high = max(begin, t[k]), min(end, t[k + 1])
        if T <= 0.0 or high <= low:
            continue
        a, b = (low - t[k]) / T, (high - t[k]) / T
        for i in range(n):
            chord = q[k + 1, i] - q[k, i]
            c1, last = T * v[k, i], T * v[k + 1, i]
            c2, c3 = 3 * chord - 2 * c1 - last, c1 + last - 2 * chord
            fast = max(abs(c1 + a * (2 * c2 + a * 3 * c3)), abs(c1 + b * (2 * c2 + b * 3 * c3)))
            if c3 != 0.0:
                x = -c2 / (3 * c3)
                if a < x < b:
                    fast = max(fast, abs(c1 + x * (2 * c2 + x * 3 * c3)))
            fast /= T
            first, then = (2 * c2 + 6 * c3 * a) / (T * T), (2 * c2 + 6 * c3 * b) / (T * T)
            varies[i] += abs(then - first)
            if some:
                varies[i] += abs(first - before[i])
            before[i] = then
            speed[i] = max(speed[i], fast)
            change[i] = max(change[i], abs(first), abs(then))
            start = q[k, i] + a * (c1 + a * (c2 + a * c3)) - home[i]
            away[i] = max(away[i], abs(start) + fast * (high - low))
        some = True


@njit(types.void(_TWO, types.float64, CHAINS, _TWO), cache=True, nogil=True, error_model="numpy")
def point_bounds(bounds: Array, T: float, chains: Chains, found: Array) -> None:
    """Bound the motion of points at the ends of chains within a span; writes into the last argument.

    Args:
        bounds: Of the joints, from `joint_bounds`, shape (4, nv); how far only those get counts that slide.
        T: Length of the span [s].
        chains: The joints that move each point.
        found: Largest speed [m/s] and acceleration [m/s²], and how far the velocity gets from the straight
            line between those at both ends [m/s], shape (3, p).
    """
    speed, change, varies, away = bounds[0], bounds[1], bounds[2], bounds[3]
    fast, quick, bend = found[0], found[1], found[2]
    start, joints, turns, lengths = chains
    for p in range(len(fast)):
        W, W1, W2 = 0.0, 0.0, 0.0
        V, A, J = 0.0, 0.0, 0.0
        for k in range(start[p], start[p + 1]):
            j = joints[k]
            v, a, c = speed[j], change[j], varies[j]
            if turns[k]:
                W2 += c + T * (2 * a * W + v * (W1 + W * W))
                W1 += a + v * W
                W += v
            else:
                s = away[j]
                V += v + s * W
                A += a + 2 * v * W + s * (W1 + W * W)
                J += c + T * (3 * a * W + 3 * v * (W1 + W * W))
                J += s * (W2 + T * (3 * W * W1 + W * W * W))
            V += W * lengths[k]
            A += (W1 + W * W) * lengths[k]
            J += (W2 + T * (3 * W * W1 + W * W * W)) * lengths[k]
        fast[p], quick[p], bend[p] = V, A, 0.25 * T * J


@njit(f"void({_ROW}, {_ROWS}, {_ROWS}, f8, {_ROW}, {_ROW})", cache=True, nogil=True, error_model="numpy")
def joints_at(t: Array, q: Array, v: Array, when: float, position: Array, velocity: Array) -> None:
    """Where joints are on their cubics at an instant; writes into the last two arguments.

    Args:
        t: Knots, increasing [s], shape (k,), k >= 2.
        q: Positions there [rad or m], shape (k, n).
        v: Velocities there, shape (k, n).
        when: [s], from the first knot to the last.
        position: Shape (n,).
        velocity: Shape (n,).
    """
    k = 0
    while k < len(t) - 2 and t[k + 1] <= when:
        k += 1
    T = t[k + 1] - t[k]
    x = (when - t[k]) / T
    for i in range(q.shape[1]):
        chord = q[k + 1, i] - q[k, i]
        c1, last = T * v[k, i], T * v[k + 1, i]
        c2, c3 = 3 * chord - 2 * c1 - last, c1 + last - 2 * chord
        position[i] = q[k, i] + x * (c1 + x * (c2 + x * c3))
        velocity[i] = (c1 + x * (2 * c2 + x * 3 * c3)) / T


@njit(
    f"void({_ROW}, {_ROWS}, {_ROWS}, i8[::1], i8[::1], {_ROW}, {_ROWS}, {_ROWS})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def joints_on_ways(
    t: Array,
    q: Array,
    v: Array,
    first: Indices,
    ways: Indices,
    when: Array,
    positions: Array,
    velocities: Array,
) -> None:
    """Where joints are at m instants, each on one of many ways (`joints_at`); writes the last two arguments.

    Args:
        t: Knots of all ways, increasing [s], shape (k,).
        q: Positions there [rad or m], shape (k, n).
        v: Velocities there, shape (k, n).
        first: At which knot each way begins and the one before ends, shape (w + 1,).
        ways: On which each instant is, shape (m,).
        when: [s], shape (m,).
        positions: Shape (m, n).
        velocities: Shape (m, n).
    """
    for i in range(len(when)):
        begin, end = first[ways[i]], first[ways[i] + 1] + 1
        joints_at(t[begin:end], q[begin:end], v[begin:end], when[i], positions[i], velocities[i])


@njit(f"void({_ROW}, {_ROW}, f8, {', '.join([_ROW] * 5)})", cache=True, nogil=True, error_model="numpy")
def slowest_and_fastest(
    before: Array,
    after: Array,
    T: float,
    quick: Array,
    bend: Array,
    fast: Array,
    ends: Array,
    slow: Array,
) -> None:
    """Take into account how fast bodies are at both ends of a span; writes into the last three arguments.

    Args:
        before: Speed of the fastest point of each body at the begin [m/s], shape (n,).
        after: Speed at the end [m/s], shape (n,).
        T: Length of the span [s].
        quick: Of points, those of bodies first, from `point_bounds` [m/s²], shape (p,).
        bend: Likewise [m/s].
        fast: Likewise, from which what is faster than that is taken off [m/s].
        ends: Larger speed of both ends [m/s], shape (n,).
        slow: Least speed [m/s], shape (n,).
    """
    for i in range(len(before)):
        ends[i] = np.maximum(before[i], after[i])
        changes = quick[i] * T
        # Along the straight line between two velocities no speed is larger than at both ends.
        most = np.minimum((before[i] + after[i] + changes) / 2, ends[i] + bend[i])
        fast[i] = np.minimum(fast[i], most)
        slow[i] = np.maximum((before[i] + after[i] - changes) / 2, 0.0)


@njit(f"f8({_ROW}, i8[::1])", cache=True, nogil=True, error_model="numpy")
def greatest(values: Array, rows: Indices) -> float:
    """Largest of some values that are not negative; 0 of none, NaN where one is not a number."""
    found = 0.0
    for row in rows:
        found = np.maximum(found, values[row])
    return found


@njit(f"f8({', '.join([_ROW] * 4)}, f8, {_ROW})", cache=True, nogil=True, error_model="numpy")
def least_margins(one: Array, off: Array, other: Array, also: Array, fall: float, bend: Array) -> float:
    """Bound the least of the margins of n figures between two ends, tolerances taken off.

    Args:
        one: Margins at one end, shape (n,).
        off: What their tolerances take of these, shape (n,).
        other: Margins at the other end, shape (n,).
        also: What their tolerances take there, shape (n,).
        fall: How much each can lose from any instant to any other.
        bend: How much below the lesser margin of both ends, shape (n,).

    Returns:
        Infinity of none; NaN where one is not a number.
    """
    least = np.inf
    for i in range(len(one)):
        low = np.maximum((one[i] + other[i] - fall) / 2, np.minimum(one[i], other[i]) - bend[i])
        least = np.minimum(least, low - np.maximum(off[i], also[i]))
    return least


@njit(
    f"void(i8[::1], b1[::1], {_ROW}, {_ROW}, {_ROW}, b1[::1], {_ROWS}, {_ROW})",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def column_changes(
    joints: Indices,
    turns: Flags,
    lengths: Array,
    qd: Array,
    away: Array,
    moves: Flags,
    shares: Array,
    found: Array,
) -> None:
    r"""How quickly columns of a point's linear Jacobian change at most; writes into the last argument.

    A column, :math:`z_j \times r_j` of a joint that turns and :math:`z_j` of one that slides, turns with
    all joints before it, and :math:`r_j` changes with joint j and all after it.

    Args:
        joints: That move the point, from base to tip, shape (k,).
        turns: Whether each turns; otherwise it slides.
        lengths: Of the segment behind each [m].
        qd: Largest speeds of all joints [rad/s or m/s], shape (nv,).
        away: Their largest ways from the model's pose, shape (nv,).
        moves: Which of them count, shape (nv,).
        shares: Of each, the shares of the columns' joints, not negative, shape (nv, n).
        found: Per second, shape (n,).
    """
    found[:] = 0.0
    k = len(joints)
    reaches, onwards = np.empty(k), np.empty(k)
    reach, onward, spun = 0.0, 0.0, 0.0
    for i in range(k - 1, -1, -1):
        reach += lengths[i] + (0.0 if turns[i] else away[joints[i]])
        onward += qd[joints[i]] * (reach if turns[i] else 1.0)
        reaches[i], onwards[i] = reach, onward
    for i in range(k):
        spin = qd[joints[i]] if turns[i] else 0.0
        spun += spin
        before = spun - spin
        change = before * reaches[i] + onwards[i] if turns[i] else before
        if moves[joints[i]]:
            for c in range(len(found)):
                found[c] += change * shares[joints[i], c]


class Figures(NamedTuple):
    """Figures that can fall: n distances and speeds of sets of points, and singular values of m Jacobians."""

    start: Indices
    """Where the points of each set begin, shape (2 n + 1,): two sets for each distance or speed, of which the
    second is that of whom a distance is to."""
    rows: Indices
    """The points of all sets."""
    nears: Flags
    """Whether each is a distance; otherwise a speed, shape (n,)."""
    points: Indices
    """Of which Jacobians are, shape (m,)."""
    moves: Flags
    """Which joints count, see `column_changes`, shape (m, nv)."""
    shares: Array
    """The shares of the columns' joints in each joint, 0 in columns that there are not, shape (m, nv, c)."""


FIGURES = Layout(
    Figures,
    [(np.int64, 1), (np.int64, 1), (np.bool_, 1), (np.int64, 1), (np.bool_, 2), (np.float64, 3)],
)
_figures_in = FIGURES.read


@njit(
    types.void(types.int64[:, ::1], CHAINS, _TWO, _TWO, types.float64, types.float64, _TWO),
    cache=True,
    nogil=True,
    error_model="numpy",
)
def all_falls(
    table: Indices, chains: Chains, joints: Array, moved: Array, T: float, rounding: float, falls: Array
) -> None:
    """How far figures can fall within a span; writes the last argument.

    Args:
        table: Of `FIGURES`.
        chains: The joints that move each point.
        joints: From `joint_bounds`, of largest speeds, shape (4, nv).
        moved: Of the points, from `point_bounds`, shape (3, p).
        T: Length of the span [s].
        rounding: Added to each bound.
        falls: From any instant to any other [m, m/s or m/rad], and below the lesser of both ends, infinite
            where no more is known, shape (2, n + m).
    """
    of, (starts, every, turns, lengths) = _figures_in(table, 0), chains
    fast, quick, bend, qd, away = moved[0], moved[1], moved[2], joints[0], joints[3]
    fall, below = falls[0], falls[1]
    n, found = len(of.nears), np.empty(of.shares.shape[2])
    for i in range(n):
        begin, middle, end = of.start[2 * i], of.start[2 * i + 1], of.start[2 * i + 2]
        first, second = of.rows[begin:middle], of.rows[middle:end]
        if of.nears[i]:
            one, other = greatest(fast, first) * T + rounding, greatest(fast, second) * T + rounding
            fall[i], below[i] = one + other, np.inf
        else:
            fall[i], below[i] = greatest(quick, first) * T + rounding, greatest(bend, first) + rounding
    for i in range(len(of.moves)):
        # Singular values change by no more than the norm of how much the matrix does.
        a, b = starts[of.points[i]], starts[of.points[i] + 1]
        column_changes(every[a:b], turns[a:b], lengths[a:b], qd, away, of.moves[i], of.shares[i], found)
        square = 0.0
        for change in found:
            square += change * change
        fall[n + i], below[n + i] = np.sqrt(square) * T, np.inf
