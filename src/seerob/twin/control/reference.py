r"""What the twin is pulled toward: a smooth motion through the samples.

Between two samples the reference is the cubic that has their positions and velocities,

.. math:: q(s) = h_{00} q_0 + h_{10} T \dot q_0 + h_{01} q_1 + h_{11} T \dot q_1,\quad s = (t - t_0)/T

so velocity is continuous and acceleration is known, which feed-forward needs. Samples without
velocities get that of the parabola through them and their neighbours, of the two before for the newest.
Of samples with velocities noise of positions makes the slope of that cubic another one than the velocities
say, by :math:`6 s (1 - s)` times the difference of the chord's slope and their mean. After the newest sample
the reference holds its position, of a live source once it has coasted; before the oldest it waits there.

Two samples that only an impossible speed could join are a jump, not a motion: the reference stays
where it was until the later one, and the twin is put there instead of being pulled.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.bound import COLUMNS
from seerob.kernels.pull import KNOTS, SLACK, Knots, along, take

Indices = NDArray[np.int64]

MAX_KEPT = 4096
"""Samples kept at most: many times what a fast source sends within one tick."""
ROWS = 64
"""Samples for which there is room at first."""


class Reference:
    """Motion of one robot or human through its newest samples, several of which may lie ahead."""

    def __init__(self, home: Array, largest_speed: Array | float = np.inf, *, coast: float = 0.0) -> None:
        """Rest at home.

        Args:
            home: Position before the first sample [rad or m], shape (n,).
            largest_speed: Above it a motion is a jump [rad/s or m/s], shape (n,) or one for all.
            coast: How long it goes on at its speed after the newest sample [s]: the next one of a live
                source may be late, and a robot in motion does not stop for that.
        """
        largest = np.broadcast_to(np.asarray(largest_speed, float), len(home)).copy()
        self._limits = np.array([coast]), largest
        self._coast = coast
        self._landings: list[float] = []
        self._zero = np.zeros(len(home))
        self._times: list[float] = []
        """Of the samples that are kept; what else is known of them is in rows from ``_first`` on."""
        self._first, self._end = 0, 1
        self.table = np.zeros((len(KNOTS.arrays), COLUMNS), np.int64)
        """Of `seerob.kernels.pull.KNOTS`; what takes its place is written again when there is more room."""
        self._room: Knots
        self._make_room(ROWS)
        # Before the first sample it waits at home.
        self._room.instants[0], self._room.points[0] = np.inf, home
        self._room.kept[:] = self._first, self._end

    def _make_room(self, count: int) -> None:
        n = len(self._zero)
        rows = np.zeros(count), np.zeros((count, n)), np.zeros((count, n))
        jumps, said = np.zeros((2, count), bool)
        self._room = Knots(*rows, jumps, said, np.zeros(2, np.int64), *self._limits, np.zeros(1))
        self.table[:] = KNOTS.rows(self._room)

    def bind(self, table: Indices) -> None:
        """Have its samples in rows of a table of `seerob.kernels.pull.KNOTS`, shape (9, 4), from now on."""
        table[:] = self.table
        self.table = table

    @property
    def newest(self) -> Array:
        """Position of the newest sample, or the home position, shape (n,) [rad or m]."""
        return np.array(self._room.points[self._end - 1])

    @property
    def leaves_at(self) -> float:
        """Largest speed of a joint at the newest sample [rad/s or m/s]; 0 before the first."""
        return float(self._room.leaves_at[0])

    def between(self, begin: float, end: float) -> Array:
        """Instants of samples, and of its rest after the newest, between two others [s], shape (k,).

        Between two of them, which increase, the motion is one cubic.
        """
        first, last = bisect_right(self._times, begin), bisect_left(self._times, end)
        if first >= last and not self._coast:
            return np.zeros(0)
        found = self._room.instants[self._first + first : self._first + last]
        rests = self.until + self._coast
        return np.append(found, rests) if self._coast and begin < rests < end else found.copy()

    @property
    def waits(self) -> bool:
        """Whether nothing was heard yet, so that it stays at home."""
        return not self._times

    @property
    def once(self) -> bool:
        """Whether all that is known is one position: a second one, or a velocity, tells how fast it is."""
        return len(self._times) == 1 and not self._room.said[self._first]

    @property
    def until(self) -> float:
        """Instant of the newest sample [s]; -inf before the first."""
        return self._times[-1] if self._times else -np.inf

    def take(self, t: float, q: Array, qd: Array | None, *, anew: bool = False) -> bool:
        """Make a sample the newest one; False for one that is not newer than the last, which is dropped.

        Args:
            t: Its instant [s].
            q: Position [rad or m], shape (n,).
            qd: Velocity [rad/s or m/s], shape (n,); derived when None.
            anew: After a silence: nobody knows how it came there, so the twin is put there at once and
                set in motion when its instant has come.
        """
        if anew and t > self.until:
            self._times, self._landings = [], [-np.inf, t]
        if not self._times:
            self._first = self._end = 0
        elif t <= self._times[-1]:
            return False
        if self._end == len(self._room.instants):
            old, kept, count = self._room, slice(self._first, self._end), self._end - self._first
            self._make_room(max(ROWS, 2 * count))
            for new, before in zip(self._room[:5], old[:5], strict=True):
                new[:count] = before[kept]
            self._first, self._end = 0, count
        speeds = self._zero if qd is None else qd
        if take(self.table, self._first, self._end, t, q, speeds, qd is not None):
            self._landings.append(t)
        self._end += 1
        self._times.append(t)
        if (count := len(self._times) - MAX_KEPT) > 0:
            self._drop(count)
        return True

    @property
    def jumped(self) -> bool:
        """Whether a jump led to the newest sample."""
        return bool(self._room.jumps[self._end - 1])

    def land(self, t: float) -> None:
        """Let the twin be put there at ``t`` [s]: it is elsewhere, for it was not known before."""
        self._landings.append(t)

    @property
    def landing(self) -> bool:
        """Whether a jump is still to end."""
        return bool(self._landings)

    def lands(self, t: float) -> bool:
        """Whether a jump ended by ``t`` [s]; told once."""
        due = [jump for jump in self._landings if jump <= t + SLACK]
        del self._landings[: len(due)]
        return bool(due)

    def forget(self, t: float) -> None:
        """Drop what is not needed any more from ``t`` [s] on."""
        if (count := bisect_right(self._times, t) - 1) > 0:
            self._drop(count)

    def _drop(self, count: int) -> None:
        self._first += count
        self._room.kept[0] = self._first
        del self._times[:count]

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Position [rad or m], velocity and acceleration at ``t`` [s], each of shape (n,)."""
        q, v, a = self.course(np.array([t]))
        return q[0], v[0], a[0]

    def course(self, t: Array) -> tuple[Array, Array, Array]:
        """Position [rad or m], velocity and acceleration at many instants [s] (m,), each of shape (m, n)."""
        found = np.empty((3, len(t), self._zero.shape[0]))
        room, kept = self._room, slice(self._first, self._end)
        along(
            room.instants[kept], room.points[kept], room.speeds[kept], room.jumps[kept], self._coast,
            t, found[0], found[1], found[2],
        )  # fmt: skip
        return found[0], found[1], found[2]
