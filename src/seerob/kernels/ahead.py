"""Bounds on a robot's speeds along a motion that is known ahead, from tick to tick, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, types
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import Layout, tuple_type
from seerob.kernels.mujoco_calls import updated
from seerob.kernels.pull import size_of, ticks_ahead
from seerob.kernels.spans import CHAINS, Chains, joint_bounds, point_bounds
from seerob.kernels.speed import fastest_of

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]
_ROW, _ROWS, _PAIR = "f8[::1]", "f8[:,::1]", "f8[:,:,::1]"
_ONE, _TWO, _THREE = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
_WHOLES, _TABLE = types.int64[::1], types.int64[:, ::1]
UNKNOWN = -(1 << 62)
"""Instead of the number of a tick: it is that of none, nor is the next one."""


class Reaction(NamedTuple):
    """From now until a robot brakes."""

    begin: float
    """Now [s]."""
    end: float
    """From now, after which nothing counts [s]: ``T_r + lead`` at most."""
    T_r: float
    """Reaction time [s]."""
    lead: float
    """A reaction begins until then [s]."""
    slack: float
    """Instants nearer than this are one [s]."""


REACTION = tuple_type(Reaction, [types.float64] * 5)


class Window(NamedTuple):
    """What is known of a motion, tick by tick: room for s ticks, r instants of each, n parts and j joints.

    A tick lies where its number modulo s says, with its first and its last instant.
    """

    number: Indices
    """Which tick is known there, `UNKNOWN` where none is, shape (s,)."""
    instants: Indices
    """How many instants it has, shape (s,)."""
    q: Array
    """Positions of the joints at them [rad or m], shape (s r, j)."""
    qd: Array
    """Velocities there [rad/s or m/s], shape (s r, j)."""
    parts: Array
    """Largest speed of each part from instant to instant, and the larger of both instants [m/s], shape
    (s r, 2, n)."""
    joints: Array
    """Those of each joint, likewise [rad/s or m/s], shape (s r, 2, j)."""
    last: Array
    """Speed of each part at its end [m/s], shape (s, n)."""
    speeds: Array
    """Work: speeds of the parts at the instants of a tick [m/s], shape (r, n)."""


class Parts(NamedTuple):
    """Parts of a robot: where MuJoCo has them, and the d joints that move them; r joints of the robot."""

    calls: Indices
    """Addresses of the `mujoco.MjModel`, of its data, and of what makes the next four follow from positions
    and velocities of joints (`seerob.twin.mujoco_addresses.POSES`), shape (5,)."""
    xmat: Array
    """World from body, row by row, shape (m, 9)."""
    xpos: Array
    """[m], shape (m, 3)."""
    cvel: Array
    """Twists: rotation first, at the centre of mass of the whole tree, shape (m, 6)."""
    subtree_com: Array
    """Centre of mass of the tree below each body [m], shape (m, 3)."""
    ids: Indices
    """MuJoCo's body of each part, shape (n,)."""
    roots: Indices
    """The first body of its tree, shape (n,)."""
    corners: Array
    """Points of all parts in their own frames, by coordinate [m], shape (3, k)."""
    start: Indices
    """Where each part's corners start, shape (n + 1,)."""
    reach: Array
    """How far a part may lie outside its corners' hull [m], shape (n,)."""
    home: Array
    """Positions of the joints in the model as compiled [rad or m], shape (d,)."""
    chain: Indices
    """Where the joints of each part begin, shape (n + 1,)."""
    joints: Indices
    """All chains one after the other, each from base to tip, shape (c,)."""
    turns: Flags
    """Whether each turns; otherwise it slides, shape (c,)."""
    lengths: Array
    """Of the segment behind each [m], shape (c,)."""
    dofs: Indices
    """Of these joints, where they are among all, shape (d,)."""
    own: Indices
    """Which of the robot's each is, -1 for those of others, shape (d,)."""
    goes: Flags
    """Whether each of others goes on as it does, shape (d,)."""
    qpos: Array
    """MuJoCo's: positions of all joints [rad or m], of which the robot's are written, shape (nq,)."""
    qvel: Array
    """Velocities of all, likewise, shape (nv,)."""
    q_address: Indices
    """Where the robot's joints are among the former, shape (r,)."""
    v_address: Indices
    """Where they are among the latter, likewise."""
    coupling: Array
    """They from those that are commanded, shape (r, j)."""
    offset: Array
    """Added to their positions [rad or m], shape (r,)."""


_FLOAT, _WHOLE, _FLAG = np.float64, np.int64, np.bool_
WINDOW = Layout(
    Window,
    [
        (_WHOLE, 1), (_WHOLE, 1), (_FLOAT, 2), (_FLOAT, 2), (_FLOAT, 3), (_FLOAT, 3), (_FLOAT, 2),
        (_FLOAT, 2),
    ],
)  # fmt: skip
PARTS = Layout(
    Parts,
    [
        (_WHOLE, 1), (_FLOAT, 2), (_FLOAT, 2), (_FLOAT, 2), (_FLOAT, 2), (_WHOLE, 1), (_WHOLE, 1),
        (_FLOAT, 2), (_WHOLE, 1), (_FLOAT, 1), (_FLOAT, 1), (_WHOLE, 1), (_WHOLE, 1), (_FLAG, 1), (_FLOAT, 1),
        (_WHOLE, 1), (_WHOLE, 1), (_FLAG, 1), (_FLOAT, 1), (_FLOAT, 1), (_WHOLE, 1), (_WHOLE, 1), (_FLOAT, 2),
        (_FLOAT, 1),
    ],
)  # fmt: skip
_window_in, _parts_in = WINDOW.read, PARTS.read


def window(ticks: int, instants: int, parts: int, joints: int) -> Window:
    """Room for so many ticks, and instants of each; nothing is known."""
    s, m, n, j = ticks, ticks * instants, parts, joints
    return Window(
        np.full(s, UNKNOWN), np.zeros(s, np.int64), np.empty((m, j)), np.empty((m, j)),
        np.empty((m, 2, n)), np.empty((m, 2, j)), np.empty((s, n)), np.empty((instants, n)),
    )  # fmt: skip


@njit(
    types.void(_ONE, _TWO, _TWO, _TWO, _ONE, CHAINS, types.float64, _THREE),
    cache=True,
    nogil=True,
    error_model="numpy",
)
def part_speeds(
    t: Array, q: Array, v: Array, speeds: Array, home: Array, chains: Chains, rounding: float, bounds: Array
) -> None:
    """Bound the speeds of parts on cubics from instant to instant; writes into the last argument.

    Args:
        t: Instants, increasing [s], shape (k,).
        q: Positions of all joints that move a part [rad or m], shape (k, d).
        v: Velocities there, shape (k, d).
        speeds: Of the fastest point of each part at the instants [m/s], shape (k, n).
        home: Positions of the joints in the model as compiled, shape (d,).
        chains: The joints that move each part.
        rounding: Added to each bound [m/s].
        bounds: Largest from instant to instant, and the larger of both instants [m/s], shape (k - 1, 2, n).
    """
    d, n = q.shape[1], speeds.shape[1]
    joints, parts = np.empty((4, d)), np.empty((3, n))
    for i in range(len(t) - 1):
        a, b = t[i], t[i + 1]
        joint_bounds(t[i : i + 2], q[i : i + 2], v[i : i + 2], a, b, home, joints)
        point_bounds(joints, b - a, chains, parts)
        for c in range(n):
            ends = np.maximum(speeds[i, c], speeds[i + 1, c])
            # Along the straight line between two velocities no speed is larger than at both ends.
            most = np.minimum(parts[0, c], ends + parts[2, c]) + rounding
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
    types.void(_ONE, REACTION, types.float64[:, :], _ONE, _ONE, _ONE),
    cache=True,
    nogil=True,
    error_model="numpy",
)
def farthest(t: Array, reaction: Reaction, most: Array, now: Array, way: Array, top: Array) -> None:
    """Bound how far and fast parts or joints get until they brake; writes into the last two arguments.

    Args:
        t: Instants, increasing [s], shape (k,).
        reaction: When it is.
        most: Largest speeds from instant to instant, shape (k - 1, n).
        now: Speeds now, which may be larger, shape (n,).
        way: In any stretch of the reaction time that begins within its lead [m or rad], shape (n,).
        top: Largest speed until then, shape (n,).
    """
    begin, end, T_r, lead, slack = reaction
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
    types.void(_ONE, _THREE, _WHOLES, _WHOLES, _TWO, REACTION, _TWO, _TWO),
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
    reaction: Reaction,
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
        reaction: The reaction, from whenever it begins.
        ways: Receives them [m], shape (N, n).
        tops: Receives the largest speeds [m/s], shape (N, n).
    """
    for k in range(len(first)):
        a, b = first[k], last[k]
        one = Reaction(t[a], reaction.end, reaction.T_r, reaction.lead, reaction.slack)
        farthest(t[a : b + 1], one, bounds[a:b, 0], now[k], ways[k], tops[k])


@njit(cache=True, nogil=True)
def _same(a: Array, b: Array) -> bool:
    """Whether two rows are the same by their bits."""
    one, other = a.view(np.int64), b.view(np.int64)
    for j in range(len(one)):
        if one[j] != other[j]:
            return False
    return True


@njit(
    f"i8(i8[:,::1], b1, i8, i8[::1], {_ROWS}, {_ROWS})",
    cache=True,
    nogil=True,
)
def moved_on(window: Indices, again: bool, first: int, rows: Indices, q: Array, qd: Array) -> int:
    """Keep what is known of ticks at which the motion is still the same, by its bits, and forget the others.

    Args:
        window: Table of a `Window`, written.
        again: Whether anything of it is to be kept.
        first: Number of the first tick.
        rows: Which instants are ticks, shape (s + 1,).
        q: Positions of the joints at the instants [rad or m], shape (m, j).
        qd: Velocities there [rad/s or m/s], shape (m, j).

    Returns:
        Of how many ticks that is not known; -1 where there is no room for so many ticks or instants.
    """
    now = _window_in(window, 0)
    s, missing = len(now.number), 0
    r = len(now.q) // max(s, 1)
    if len(rows) > s:
        return -1
    if not again:
        now.number[:] = UNKNOWN
    for i in range(len(rows) - 1):
        slot = (first + i) % s
        begin, count = slot * r, rows[i + 1] - rows[i] + 1
        if count > r:
            return -1
        same = now.number[slot] == first + i and now.instants[slot] == count
        for row in range(count):
            k, at = rows[i] + row, begin + row
            same = same and _same(q[k], now.q[at]) and _same(qd[k], now.qd[at])
        if same:
            continue
        missing += 1
        now.number[slot], now.instants[slot] = UNKNOWN, count
        for row in range(count):
            for j in range(q.shape[1]):
                now.q[begin + row, j], now.qd[begin + row, j] = q[rows[i] + row, j], qd[rows[i] + row, j]
    return missing


@njit(cache=True, nogil=True)
def _coupled(of: Parts, k: int, q: Array) -> float:
    """What a joint of the robot, of all of them, has of positions or velocities that are commanded."""
    found = 0.0
    for j in range(len(q)):
        found += of.coupling[k, j] * q[j]
    return found


@njit(cache=True, nogil=True)
def _bound_tick(of: Parts, now: Window, tick: int, t: Array, rounding: float, of_joints: bool) -> None:
    """Bound how fast parts and joints are in a tick, with all others as they are or go on.

    Args:
        of: The robot.
        now: What is known of its motion, written.
        tick: Number of the tick.
        t: Its instants [s], shape (k,).
        rounding: As `part_speeds` takes it [m/s].
        of_joints: Whether joints are asked for, too.
    """
    s, d = len(now.number), len(of.dofs)
    slot, before, r = tick % s, (tick - 1) % s, len(now.q) // s
    q, qd = now.q[slot * r : slot * r + len(t)], now.qd[slot * r : slot * r + len(t)]
    every_q, every_v = np.empty((len(t), d)), np.empty((len(t), d))
    for row in range(len(t)):
        for c in range(d):
            dof, k = of.dofs[c], of.own[c]
            if k >= 0:
                every_q[row, c] = _coupled(of, k, q[row]) + of.offset[k]
                every_v[row, c] = _coupled(of, k, qd[row])
                continue
            # Who goes on as they do is where that brings them: all of their joints turn or slide.
            every_q[row, c], every_v[row, c] = of.qpos[dof], of.qvel[dof]
            if of.goes[c]:
                every_q[row, c] += (t[row] - t[0]) * of.qvel[dof]
    # How fast parts are at its begin is mostly known, by the tick before it.
    last = before * r + now.instants[before] - 1
    known = now.number[before] == tick - 1 and _same(now.q[last], q[0]) and _same(now.qd[last], qd[0])
    for row in range(len(t)):
        if known and row == 0:
            for c in range(now.last.shape[1]):
                now.speeds[0, c] = now.last[before, c]
            continue
        for k in range(len(of.offset)):
            of.qpos[of.q_address[k]] = _coupled(of, k, q[row]) + of.offset[k]
            of.qvel[of.v_address[k]] = _coupled(of, k, qd[row])
        for function in of.calls[2:]:
            updated(function, of.calls[0], of.calls[1])
        fastest_of(
            of.xmat, of.xpos, of.cvel, of.subtree_com, of.ids, of.roots, of.corners, of.start, of.reach,
            now.speeds[row],
        )  # fmt: skip
    begin, end = slot * r, slot * r + len(t) - 1
    chains = Chains(of.chain, of.joints, of.turns, of.lengths)
    part_speeds(t, every_q, every_v, now.speeds[: len(t)], of.home, chains, rounding, now.parts[begin:end])
    if of_joints:
        joint_speeds(t, q, qd, now.joints[begin:end])
    for c in range(now.last.shape[1]):
        now.last[slot, c] = now.speeds[len(t) - 1, c]
    now.number[slot] = tick


@njit(cache=True, nogil=True)
def _until_braking(
    now: Window, bounds: Array, ticks: tuple[int, int], side: int, t: Array, reaction: Reaction, found: Array
) -> None:
    s, k = len(now.number), 0
    r = len(now.q) // s
    most = np.empty((len(t) - 1, found.shape[1]))
    for tick in range(ticks[0], ticks[1]):
        slot = tick % s
        for row in range(slot * r, slot * r + now.instants[slot] - 1):
            for c in range(most.shape[1]):
                most[k, c] = bounds[row, side, c]
            k += 1
    farthest(t, reaction, most, found[0], found[1], found[2])


@njit(
    types.void(_TABLE, _TABLE, types.int64, _WHOLES, _ONE, types.int64, REACTION, types.float64, _TWO, _TWO),
    cache=True,
    nogil=True,
)
def until_braking(
    parts: Indices,
    window: Indices,
    first: int,
    rows: Indices,
    t: Array,
    side: int,
    reaction: Reaction,
    rounding: float,
    points: Array,
    joints: Array,
) -> None:
    """Bound how far and fast parts and joints get until they brake; writes into the last two arguments.

    Args:
        parts: Table of `Parts`.
        window: Table of a `Window`, in which bounds of ticks are found that are not known.
        first: As of `moved_on`, with the next.
        rows: Likewise.
        t: Ticks, and the knots between them [s], shape (m,).
        side: 0 for the largest speeds from instant to instant, 1 for the larger one of both instants.
        reaction: When they brake.
        rounding: As `part_speeds` takes it [m/s].
        points: Speeds of the parts now [m/s], which are given, ways [m] and largest speeds, shape (3, n).
        joints: Those of joints [rad/s or m/s, rad or m], shape (3, j); of none where they are not asked for.
    """
    now, of = _window_in(window, 0), _parts_in(parts, 0)
    count, of_joints = len(rows) - 1, joints.shape[1] > 0
    for i in range(count):
        if now.number[(first + i) % len(now.number)] != first + i:
            _bound_tick(of, now, first + i, t[rows[i] : rows[i + 1] + 1], rounding, of_joints)
    ticks = first, first + count
    _until_braking(now, now.parts, ticks, side, t, reaction, points)
    if of_joints:
        _until_braking(now, now.joints, ticks, side, t, reaction, joints)


@njit(
    types.int64(
        _TABLE, _TABLE, _TABLE, types.boolean, types.int64, types.int64, types.int64, REACTION, types.float64,
        _ONE, _TWO,
    ),
    cache=True,
    nogil=True,
)  # fmt: skip
def braking_along(
    parts: Indices,
    window: Indices,
    samples: Indices,
    again: bool,
    first: int,
    last: int,
    side: int,
    reaction: Reaction,
    rounding: float,
    now: Array,
    points: Array,
) -> int:
    """Bound how far and fast parts get until they brake, going through samples; writes the last argument.

    Args:
        parts: As of `until_braking`, with the next.
        window: Likewise.
        samples: Table of `seerob.kernels.pull.KNOTS`: those that the motion goes through.
        again: As of `moved_on`.
        first: Number of the first tick.
        last: Number of the last one.
        side: As of `until_braking`.
        reaction: When they brake; its lead is the period of a tick.
        rounding: As `part_speeds` takes it [m/s].
        now: Speeds of the parts now [m/s], shape (n,).
        points: As of `until_braking`, shape (3, n).

    Returns:
        As of `moved_on`; where that is -1, nothing is bounded.
    """
    rows, (kept, joints) = np.empty(1 + last - first, np.int64), size_of(samples)
    room = len(rows) + kept + 1
    t, q, qd, qdd = (
        np.empty(room),
        np.empty((room, joints)),
        np.empty((room, joints)),
        np.empty((room, joints)),
    )
    count = ticks_ahead(samples, reaction.begin, first, reaction.lead, t, rows, q, qd, qdd)
    missing = moved_on(window, again, first, rows, q[:count], qd[:count])
    if missing < 0:
        return missing
    for c in range(len(now)):
        points[0, c] = now[c]
    until_braking(parts, window, first, rows, t[:count], side, reaction, rounding, points, np.empty((3, 0)))
    return missing
