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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.pull import SLACK, aim, along, follow, greatest, join

Indices = NDArray[np.int64]
Knots = tuple[Array, Array, Array, NDArray[np.bool_]]

MAX_KEPT = 4096
"""Samples kept at most: many times what a fast source sends within one tick."""
ROWS = 64
"""Samples for which there is room at first."""


class Course(NamedTuple):
    """Where every joint of the workstation is to be at each step of a tick and at its end, in rows."""

    q: Array
    """[rad or m]"""
    v: Array
    """Half a step earlier, as `mujoco.mj_step` counts."""
    a: Array


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
        self._largest = np.broadcast_to(np.asarray(largest_speed, float), len(home)).copy()
        self._coast = coast
        self._landings: list[float] = []
        self._zero = np.zeros(len(home))
        self._times: list[float] = []
        """Of the samples that are kept; what else is known of them is in rows from ``_first`` on."""
        self._guessed = [True]
        self._first, self._end = 0, 1
        self._room: Knots = self._rows(ROWS)
        # Before the first sample it waits at home.
        self._room[0][0], self._room[1][0] = np.inf, home

    def _rows(self, count: int) -> Knots:
        n = len(self._zero)
        return np.zeros(count), np.zeros((count, n)), np.zeros((count, n)), np.zeros(count, bool)

    @property
    def newest(self) -> Array:
        """Position of the newest sample, or the home position, shape (n,) [rad or m]."""
        return np.array(self._room[1][self._end - 1])

    @property
    def leaves_at(self) -> float:
        """Largest speed of a joint at the newest sample [rad/s or m/s]; 0 before the first."""
        return float(greatest(self._room[2][self._end - 1]))

    def between(self, begin: float, end: float) -> Array:
        """Instants of samples, and of its rest after the newest, between two others [s], shape (k,).

        Between two of them, which increase, the motion is one cubic.
        """
        first, last = bisect_right(self._times, begin), bisect_left(self._times, end)
        if first >= last and not self._coast:
            return np.zeros(0)
        found = self._known()[0][first:last] if self._times else np.zeros(0)
        rests = self.until + self._coast
        return np.append(found, rests) if self._coast and begin < rests < end else found.copy()

    @property
    def waits(self) -> bool:
        """Whether nothing was heard yet, so that it stays at home."""
        return not self._times

    @property
    def once(self) -> bool:
        """Whether all that is known is one position: a second one, or a velocity, tells how fast it is."""
        return len(self._times) == 1 and self._guessed[0]

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
            self._times, self._guessed = [], []
            self._first = self._end = 0
        elif t <= self._times[-1]:
            return False
        self._add(t, q, qd)
        if len(self._times) > 1:
            self._drop(len(self._times) - MAX_KEPT)
            self._join()
        return True

    def _add(self, t: float, q: Array, qd: Array | None) -> None:
        count = self._end - self._first
        if self._end == len(self._room[0]):
            room = self._rows(max(ROWS, 2 * count))
            for new, old in zip(room, self._known(), strict=True):
                new[:count] = old
            self._room, self._first, self._end = room, 0, count
        times, points, velocities, jumps = self._room
        times[self._end], points[self._end], jumps[self._end] = t, q, False
        velocities[self._end] = self._zero if qd is None else qd
        self._end += 1
        self._times.append(t)
        self._guessed.append(qd is None)

    def _join(self) -> None:
        """Velocities of the newest two samples where none were given, unless only a jump joins them."""
        before, last = self._guessed[-2:]
        if join(*self._known(), before, last, self._largest):
            self._landings.append(self._times[-1])

    @property
    def jumped(self) -> bool:
        """Whether a jump led to the newest sample."""
        return bool(self._room[3][self._end - 1])

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
        self._drop(bisect_right(self._times, t) - 1)

    def _drop(self, count: int) -> None:
        if count > 0:
            self._first += count
            del self._times[:count], self._guessed[:count]

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Position [rad or m], velocity and acceleration at ``t`` [s], each of shape (n,)."""
        q, v, a = self.course(np.array([t]))
        return q[0], v[0], a[0]

    def said_speeds(self, t: float) -> tuple[Array, Array, float] | None:
        """Two speeds that samples say [rad/s or m/s], shape (n,) each, and where ``t`` [s] is between them.

        The slope of the cubic through both is another one than the straight line between these where their
        positions are noisy. None where no sample says any, or a jump leads there.
        """
        times, guessed = self._times, self._guessed
        k = bisect_right(times, t + SLACK) - 1
        if k < 0 or guessed[k]:
            return None
        _, _, speeds, jumps = self._room
        row = self._first + k
        if k == len(times) - 1:
            return (speeds[row], speeds[row], 0.0) if t - times[k] <= self._coast + SLACK else None
        if guessed[k + 1] or jumps[row + 1]:
            return None
        return speeds[row], speeds[row + 1], (t - times[k]) / (times[k + 1] - times[k])

    def put(self, t: float, places: tuple[Indices, Indices], qpos: Array, qvel: Array, before: Array) -> None:
        """Put it on its motion at an instant, among everybody.

        Args:
            t: [s]
            places: Of its positions and of its velocities among all, shape (n,) each.
            qpos: Positions of everybody [rad or m], written, shape (nq,).
            qvel: Velocities, written, shape (nv,).
            before: Velocities a step earlier, written, shape (nv,).
        """
        follow(*self._known(), self._coast, t, *places, qpos, qvel, before)

    def course(self, t: Array) -> tuple[Array, Array, Array]:
        """Position [rad or m], velocity and acceleration at many instants [s] (m,), each of shape (m, n)."""
        found = np.empty((3, len(t), self._zero.shape[0]))
        along(*self._known(), self._coast, t, found[0], found[1], found[2])
        return found[0], found[1], found[2]

    def aim(
        self,
        t: Array,
        dt: float,
        places: tuple[Indices, Indices],
        own: tuple[Array, Array, Array],
        of: Course,
    ) -> None:
        """Write `course` at the steps of a tick into arrays; arguments as of `seerob.kernels.pull.aim`.

        Args:
            t: When they are, and when the tick ends [s], shape (m,).
            dt: Timestep [s].
            places: Of its positions and of its velocities among all, shape (n,) each.
            own: Where its positions, velocities and accelerations are written, shape (m, n) each.
            of: Where those of everybody are.
        """
        aim(*self._known(), self._coast, t, dt, *places, *own, *of)

    def _known(self) -> Knots:
        """Instants, positions, velocities and whether nothing but a jump leads there, of samples kept."""
        t, q, v, jumps = self._room
        kept = slice(self._first, self._end)
        return t[kept], q[kept], v[kept], jumps[kept]
