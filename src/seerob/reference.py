r"""What the twin is pulled toward: a smooth motion through the samples.

Between two samples the reference is the cubic that has their positions and velocities,

.. math:: q(s) = h_{00} q_0 + h_{10} T \dot q_0 + h_{01} q_1 + h_{11} T \dot q_1,\quad s = (t - t_0)/T

so velocity is continuous and acceleration is known, which feed-forward needs. Samples without
velocities get that of the chord. After the newest sample the reference holds its position.
"""

from __future__ import annotations

import numpy as np

from seerob.transforms import Array


class Reference:
    """Motion of one robot or human through its three newest samples.

    Three, because the newest may lie ahead of the tick that is being computed.
    """

    def __init__(self, home: Array) -> None:
        self._zero = np.zeros(len(home))
        self._times: list[float] = []
        self._points: list[Array] = [home.astype(float).copy()]
        self._velocities: list[Array] = [self._zero]

    @property
    def newest(self) -> Array:
        """Position of the newest sample, or the home position, shape (n,) [rad or m]."""
        return self._points[-1]

    def take(self, t: float, q: Array, qd: Array | None) -> None:
        """Make a sample the newest one; one that is not newer than the last is dropped."""
        if not self._times:
            self._times, self._points = [t], [q]
            self._velocities = [self._zero if qd is None else qd]
            return
        if t <= self._times[-1]:
            return
        chord = (q - self._points[-1]) / (t - self._times[-1])
        self._times = [*self._times[-2:], t]
        self._points = [*self._points[-2:], q]
        self._velocities = [*self._velocities[-2:], chord if qd is None else qd]

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Position [rad or m], velocity and acceleration at ``t`` [s], each of shape (n,)."""
        times = self._times
        if len(times) < 2 or t >= times[-1] or t < times[0]:
            k = 0 if times and t < times[0] else -1
            moving = bool(times) and t == times[k]
            return self._points[k], self._velocities[k] if moving else self._zero, self._zero
        k = 1 if len(times) == 3 and t >= times[1] else 0
        T = times[k + 1] - times[k]
        s = (t - times[k]) / T
        q0, chord = self._points[k], self._points[k + 1] - self._points[k]
        # The cubic in powers of s about q0.
        a, b = T * self._velocities[k], T * self._velocities[k + 1]
        c2, c3 = 3 * chord - 2 * a - b, a + b - 2 * chord
        q = q0 + s * (a + s * (c2 + s * c3))
        v = (a + s * (2 * c2 + s * 3 * c3)) / T
        return q, v, (2 * c2 + 6 * s * c3) / (T * T)
