"""A motion that was logged, reduced to waypoints between which lines are near enough to it.

Between places where the robot stood, rows are taken by the algorithm of [Douglas1973]_, with the largest
difference of any joint as the distance.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.files.trajectories.trajectory import Trajectory
from seerob.files.waypoints.waypoint import MAX_WAYPOINTS, Program, Waypoint

STANDS = 2e-3
"""A joint that is slower stands [rad/s or m/s]."""
SHORTEST_STAND = 0.1
"""Standing for less is a passage or a turning point [s]."""


def reduced(motion: Trajectory, tolerance: float) -> Program:
    """Waypoints whose joint moves are nowhere farther from a motion than a tolerance.

    Where the robot stood it stops and stands as long; through the others it passes, rounding them off.

    Args:
        motion: The log.
        tolerance: Largest difference of any joint [rad or m].

    Raises:
        InputError: It never moves, or too many waypoints would be needed.
    """
    # Half for leaving rows out, half for standing at the begin of a stand until its end.
    half = tolerance / 2
    stands = _stands(motion, half)
    ends = sorted({0, len(motion.t) - 1, *(k for pair in stands for k in pair)})
    kept = set(ends)
    for a, b in pairwise(ends):
        if (a, b) not in stands:
            kept |= _kept(motion.q[a : b + 1], half, a)
        if len(kept) > MAX_WAYPOINTS:
            what = f"needs more than {MAX_WAYPOINTS} waypoints for a tolerance of {tolerance:g} rad or m"
            raise InputError.at(motion.file, "tolerance", what, "give a larger one")
    pause = {a: float(motion.t[b] - motion.t[a]) for a, b in stands}
    # Of a stand its begin is the waypoint.
    rows = [k for k in sorted(kept) if k not in {b for _, b in stands} or k in pause]
    if len(rows) < 2:
        raise InputError.at(motion.file, "", "nothing moves", "give a log of a motion")
    waypoints = tuple(
        Waypoint(
            place=f"row {k + 1 if motion.rows is None else int(motion.rows[k])}",
            q=tuple(motion.q[k].tolist()),
            blend=0.0 if k in pause or k == rows[-1] else math.inf,
            pause=pause.get(k, 0.0),
        )
        for k in rows
    )
    said = (
        f"{len(waypoints)} waypoints of {len(motion.t)} rows: joint moves between them are within "
        f"{tolerance:g} rad or m of the log in every joint, but for roundings; speeds are not the log's",
        f"stops where all joints were slower than {STANDS:g} rad/s or m/s for {SHORTEST_STAND:g} s: "
        f"{len(pause)}",
    )
    return Program(motion.file, waypoints, said)


def _stands(motion: Trajectory, tolerance: float) -> set[tuple[int, int]]:
    """First and last row of every stand, on which nothing moved by more than a tolerance."""
    t, q = motion.t, motion.q
    rows = np.arange(len(t))
    # Over a while, not from row to row, where noise looks like speed.
    later = np.searchsorted(t, t + SHORTEST_STAND)
    rows = rows[later < len(t)]
    later = later[rows]
    slow = np.abs(q[later] - q[rows]).max(axis=1) < STANDS * (t[later] - t[rows])
    change = np.zeros(len(t) + 1, int)
    np.add.at(change, rows[slow], 1)
    np.add.at(change, later[slow], -1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.cumsum(change) > 0])))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return {(a, b) for a, b in pairs if np.abs(q[a : b + 1] - q[a]).max() <= tolerance}


def _kept(q: Array, tolerance: float, first: int) -> set[int]:
    """Rows between the ends that have to be kept, counted from ``first``."""
    kept: set[int] = set()
    spans = [(0, len(q) - 1)]
    while spans and len(kept) <= MAX_WAYPOINTS:
        a, b = spans.pop()
        if b - a < 2:
            continue
        along = q[b] - q[a]
        inside = q[a + 1 : b] - q[a]
        share = np.clip(inside @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
        off = np.abs(inside - share[:, None] * along).max(axis=1)
        k = int(np.argmax(off))
        if off[k] > tolerance:
            middle = a + 1 + k
            kept.add(first + middle)
            spans += [(a, middle), (middle, b)]
    return kept
