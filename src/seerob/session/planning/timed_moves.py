r"""Straight moves of a robot in joint space from rest to rest, with limited speed, acceleration and jerk.

A move of length 1 is a step that is averaged over three windows, :math:`T_v \ge T_a + T_j` and
:math:`T_a \ge T_j`:

.. math::
    s(t) = \frac{1}{6\, T_v T_a T_j} \sum_{\sigma} \pm (t - \sigma)_+^3,\qquad
    |\dot s| \le \frac{1}{T_v},\; |\ddot s| \le \frac{1}{T_v T_a},\; |\dddot s| \le \frac{1}{T_v T_a T_j}

over the sums σ of none to all of the windows. So a motion is a cubic from one such instant to the next, and
rows with positions and velocities there say it without loss. Moves that overlap are added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from seerob.core.transforms import Array
from seerob.session.permissible.joint_limits import JointLimits
from seerob.session.permissible.path import largest_on

SHARE = 0.99
"""Of the limits: rounding must not lead beyond them."""
TWO = 0.5
"""Share of the jerk that each of two moves may have: they may overlap."""
PERIOD = 0.02
"""Between two rows, at most [s]."""
NEAR = 1e-4
"""Rows are no nearer [s]."""


@dataclass(frozen=True, eq=False)
class Move:
    """From one posture to another."""

    begin: float
    """[s]"""
    start: Array
    """Joint positions [rad or m], shape (n,)."""
    goal: Array
    windows: tuple[float, float, float]
    """Of the averages, longest first [s]."""

    @classmethod
    def of(cls, begin: float, start: Array, goal: Array, limits: JointLimits) -> Move:
        """The quickest within limits."""
        way = np.maximum(np.abs(goal - start), 1e-12)
        v, a, j = (
            SHARE * share * float(np.min(limit / way))
            for limit, share in ((limits.velocity, 1.0), (limits.acceleration, 1.0), (limits.jerk, TWO))
        )
        if v * (v / a + a / j) > 1.0 or v / a < a / j:  # too short for its largest speed, or acceleration
            third = a / j
            second = (-third + np.sqrt(third * third + 4.0 / a)) / 2
            if second < third:
                second = third = (0.5 / j) ** (1 / 3)
            slow = 1.0 / (second + third) > v
            if slow:  # its largest speed is reached, and its largest acceleration is not
                second = third = np.sqrt(v / j) if v / a < a / j else v / a
                third = third if v / a < a / j else a / j
            first = 1.0 / v if slow else second + third
        else:
            first, second, third = 1.0 / v, v / a, a / j
        return cls(begin, start, goal, (float(first), float(second), float(third)))

    @property
    def duration(self) -> float:
        """Of the move [s]."""
        return sum(self.windows)

    @property
    def end(self) -> float:
        """When it is over [s]."""
        return self.begin + self.duration

    @property
    def breaks(self) -> Array:
        """Instants between which it is a cubic [s], shape (8,)."""
        sums = [float(np.dot(chosen, self.windows)) for chosen in product((0, 1), repeat=3)]
        return self.begin + np.array(sums)

    def at(self, t: Array) -> tuple[Array, Array]:
        """Way from the start and velocity at instants [s], shape (m,); shape (m, n) each."""
        s, v = np.zeros(len(t)), np.zeros(len(t))
        for chosen in product((0, 1), repeat=3):
            since = np.maximum(t - self.begin - float(np.dot(chosen, self.windows)), 0.0)
            sign = 1.0 if sum(chosen) % 2 == 0 else -1.0
            s += sign * since**3 / 6
            v += sign * since**2 / 2
        scale = float(np.prod(self.windows))
        over = t >= self.end
        s, v = np.where(over, 1.0, s / scale), np.where(over, 0.0, v / scale)
        way = self.goal - self.start
        return s[:, None] * way, v[:, None] * way

    def earlier(self, by: float) -> Move:
        """A move that begins earlier by a time [s]."""
        return replace(self, begin=self.begin - by)


@dataclass(frozen=True, eq=False)
class Rows:
    """A motion as rows, between which it is a cubic."""

    t: Array
    """[s], shape (k,)."""
    q: Array
    """[rad or m], shape (k, n)."""
    qd: Array

    def powers(self) -> tuple[Array, Array, Array]:
        """Coefficients of each cubic by the share of its time, from the first power on, (k - 1, n) each."""
        T = np.diff(self.t)[:, None]
        a, b, c = T * self.qd[:-1], T * self.qd[1:], np.diff(self.q, axis=0)
        return a, 3 * c - 2 * a - b, a + b - 2 * c

    def within(self, limits: JointLimits) -> bool:
        """Whether no speed and no acceleration of it is beyond its limit at any instant."""
        a, b, c = self.powers()
        T = np.diff(self.t)[:, None]
        speed = largest_on(a, 2 * b, 3 * c, 0.0, 1.0) / T
        acceleration = np.maximum(np.abs(2 * b), np.abs(2 * b + 6 * c)) / T**2
        return bool((speed <= limits.velocity).all() and (acceleration <= limits.acceleration).all())


def at(moves: Sequence[Move], start: Array, t: Array) -> tuple[Array, Array]:
    """Positions and velocities of moves that follow one another, at instants [s]; shape (m, n) each."""
    q, qd = np.tile(start, (len(t), 1)), np.zeros((len(t), len(start)))
    for move in moves:
        way, v = move.at(t)
        q, qd = q + way, qd + v
    return q, qd


def rows(moves: Sequence[Move], start: Array, begin: float, end: float) -> Rows:
    """The motion from one instant to another [s], with rows wherever another cubic begins."""
    breaks = [x for move in moves for x in move.breaks.tolist() if begin < x < end]
    grid = np.linspace(begin, end, max(2, int(np.ceil((end - begin) / PERIOD)) + 1))[1:-1]
    kept = [begin]
    for x in sorted(breaks):
        if x - kept[-1] > NEAR and end - x > NEAR:
            kept.append(x)
    kept.append(end)
    near = np.array(kept)
    gap = np.abs(grid[:, None] - near).min(axis=1) if len(grid) else grid
    t = np.sort(np.concatenate([near, grid[gap > 10 * NEAR]]))
    return Rows(t, *at(moves, start, t))
