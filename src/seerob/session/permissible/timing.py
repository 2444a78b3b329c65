r"""Timing of a smooth piece of path: as fast as the map and the joints' speed, acceleration and jerk allow.

1. Reachability analysis ([Pham2018]_, the library toppra): the fastest timing under the map and the joints'
   speeds and accelerations; its accelerations jump.
2. Averaged over a window (last), which bounds the jerk and keeps the path.
3. Where the average is beyond a limit at any of its breaks or every millisecond, the timing is made again
   with less speed there, a few times; of several windows, with and without short peaks of the map, the
   quickest counts.
4. What is still beyond is removed by stretching the time of the whole piece by the largest of
   :math:`r_v, r_{map}, \sqrt{r_a}, \sqrt[3]{r_j}`, the ratios to the limits.

After the last step no limit is exceeded at any instant that was looked at, whatever the steps before did.
The result is not the optimum under jerk limits: it is as near as a window of one length comes.

Averaged is a profile of constant accelerations, so that the jerk of the path coordinate is bounded:

.. math:: s_f(t) = \frac1w \int_{t-w}^{t} s(\tau)\, d\tau

of a profile s(t) that is a parabola on each interval and rests before and after. Speed, acceleration and
jerk of the average are differences,

.. math::
    \dot s_f = \frac{s(t) - s(t-w)}{w} \quad
    \ddot s_f = \frac{\dot s(t) - \dot s(t-w)}{w} \quad
    \dddot s_f = \frac{\ddot s(t) - \ddot s(t-w)}{w}

so speed and acceleration begin and end at 0, the acceleration is continuous, and the way is the same: only
the timing changes, never the path.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.transforms import Array
from seerob.session.permissible.joint_limits import JointLimits
from seerob.session.permissible.path import Piece
from seerob.session.permissible.speed_map import reference_speed


class Moment(NamedTuple):
    """Path coordinate and its first three derivatives by time, shape (k,) each."""

    s: Array
    speed: Array
    acceleration: Array
    jerk: Array


@dataclass(frozen=True, eq=False)
class Parabolas:
    """A profile of constant acceleration on each interval, at rest outside."""

    t: Array
    """From 0, shape (n,) [s]."""
    s: Array
    """Way at those instants, shape (n,)."""
    speed: Array
    """Speed at those instants, shape (n,); 0 at both ends."""
    acceleration: Array
    """On each interval, shape (n - 1,)."""
    area: Array
    """Integral of s up to each instant, shape (n,)."""

    @classmethod
    def of(cls, s: Array, speed: Array) -> Parabolas:
        """From speeds at path coordinates; between two of them the acceleration is constant."""
        width = 2 * np.diff(s) / np.maximum(speed[1:] + speed[:-1], 1e-300)
        t = np.concatenate([[0.0], np.cumsum(width)])
        a = np.diff(speed) / width
        part = width * (s[:-1] + width * (speed[:-1] / 2 + width * a / 6))
        return cls(t, s, speed, a, np.concatenate([[0.0], np.cumsum(part)]))

    def at(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Integral, coordinate, speed and acceleration at instants [s], shape (k,)."""
        last = len(self.t) - 1
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, last - 1)
        d = np.clip(t, 0.0, self.t[-1]) - self.t[k]
        s0, v0, a = self.s[k], self.speed[k], self.acceleration[k]
        inside = (t >= 0) & (t < self.t[-1])
        s = s0 + d * (v0 + d * a / 2)
        after = np.maximum(t - self.t[-1], 0.0)
        area = self.area[k] + d * (s0 + d * (v0 / 2 + d * a / 6)) + after * self.s[-1]
        return area, s, np.where(inside, v0 + d * a, 0.0), np.where(inside, a, 0.0)


@dataclass(frozen=True, eq=False)
class Profile:
    """Parabolas averaged over a window, and then stretched."""

    raw: Parabolas
    window: float
    """w [s]."""
    stretch: float = 1.0
    """All times are longer by this: speeds fall with it, accelerations and jerks with its square and cube."""

    @property
    def duration(self) -> float:
        """From rest to rest [s]."""
        return self.stretch * float(self.raw.t[-1] + self.window)

    def at(self, t: Array) -> Moment:
        """Where it is at instants from 0 to `duration` [s], shape (k,)."""
        k, w = self.stretch, self.window
        now, before = self.raw.at(np.asarray(t) / k), self.raw.at(np.asarray(t) / k - w)
        s, v, a, j = ((x - y) / w for x, y in zip(now, before, strict=True))
        end = self.raw.s[-1]
        return Moment(np.clip(s, 0.0, end), np.maximum(v, 0.0) / k, a / k**2, j / k**3)

    def breaks(self) -> Array:
        """Instants at which the jerk jumps, within its duration [s]."""
        return np.unique(np.concatenate([self.raw.t, self.raw.t + self.window])) * self.stretch


CHECK = 1e-3
"""Period at which limits are checked [s]; the instants at which the jerk jumps come on top."""
FEWEST, MOST = 100, 4000
"""Intervals of the path that toppra works on."""
PER_WAY = 0.005
"""Way of one of them in joint space [rad or m]."""
WINDOWS = (0.5, 1.0, 2.0)
"""Windows to try, as shares of the time in which the jerk limit reverses the acceleration limit."""
FLATTENED = (0.0, 0.2)
"""Peaks of the map narrower than twice these shares of a piece are also tried without: under a jerk limit a
short peak can cost more than it gives."""
ROUNDS = 6
MARGIN = 1e-9
"""Relative; rounding stays below it."""
SLOWEST = 1e-6
"""Shares of the reference speed below this are no motion."""

Ceiling = Callable[[Array], Array]
"""Permissible path speed at path coordinates, shape (k,)."""


@dataclass(frozen=True, eq=False)
class Use:
    """How much of each limit is used at instants; 1 is all of it. Shape (k,) each, or (k, d)."""

    map: Array
    velocity: Array
    acceleration: Array
    jerk: Array

    @property
    def stretch(self) -> Array:
        """By how much time must be stretched so that no limit is exceeded, shape (k,)."""
        return np.asarray(
            np.max(
                [
                    self.map,
                    self.velocity.max(axis=1),
                    np.sqrt(self.acceleration.max(axis=1)),
                    np.cbrt(self.jerk.max(axis=1)),
                ],
                axis=0,
            )
        )


@dataclass(frozen=True, eq=False)
class Timed:
    """A piece with a timing."""

    piece: Piece
    profile: Profile

    @property
    def duration(self) -> float:
        """[s]."""
        return self.profile.duration

    def at(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Positions and their first three derivatives by time, shape (k, d) each."""
        s, v, a, j = (x[:, None] for x in self.profile.at(t))
        q, q1, q2, q3 = self.piece.at(s[:, 0])
        return q, q1 * v, q1 * a + q2 * v**2, q1 * j + 3 * q2 * v * a + q3 * v**3

    def use(self, t: Array, ceiling: Ceiling, limits: JointLimits) -> Use:
        """How much of each limit is used at instants [s], shape (k,)."""
        _, qd, qdd, qddd = self.at(t)
        moment = self.profile.at(t)
        with np.errstate(divide="ignore", invalid="ignore"):
            of_map = moment.speed / ceiling(moment.s)
        return Use(
            of_map,
            np.abs(qd) / limits.velocity,
            np.abs(qdd) / limits.acceleration,
            np.abs(qddd) / limits.jerk,
        )

    def instants(self) -> Array:
        """When limits are checked [s]: every millisecond, and on both sides of every jump of the jerk."""
        every = np.arange(0.0, self.duration, CHECK / 2)
        # Where the spline's knots are passed its third derivative jumps.
        knots = np.interp(self.piece.spline.x, self.profile.at(every).s, every)
        breaks = np.concatenate([self.profile.breaks(), knots])
        beside = [breaks + shift for shift in (-1e-5, -1e-9, 1e-9, 1e-5)]
        found = np.concatenate([every, *beside, [self.duration]])
        return np.unique(np.clip(found, 0.0, self.duration))


def timed(piece: Piece, ceiling: Ceiling, limits: JointLimits) -> Timed:
    """The quickest timing that was found, from rest to rest.

    Args:
        piece: The path.
        ceiling: The map: permissible path speed, more than 0 everywhere.
        limits: Of the joints.

    Raises:
        InputError: No speed is permitted somewhere.
    """
    n = int(np.clip(np.ceil(piece.length / PER_WAY), FEWEST, MOST))
    s = np.linspace(0.0, piece.length, n + 1)
    # Above what the joints can do the map says nothing.
    top = np.minimum(ceiling(s), reference_speed(piece, s, limits)[0])
    if not (top > 0).all():
        raise _nowhere(piece, s[np.argmin(top > 0)])
    swing = float((limits.acceleration / limits.jerk).max())
    best: Timed | None = None
    for width in FLATTENED:
        flat = _opened(top, round(width * n))
        if width and np.allclose(flat, top, rtol=1e-3):
            continue
        for share in WINDOWS:
            found = _with_window(piece, ceiling, limits, s, flat, 2 * swing * share)
            if best is None or found.duration < best.duration:
                best = found
    assert best is not None
    return best


def _nowhere(piece: Piece, s: float) -> InputError:
    when = float(piece.when(np.array(s)))
    what = f"no speed is known to be permitted where the given motion is at {when:.3f} s"
    return InputError.at("permissible speed", "path", what, "change the path or the cell there")


def _opened(top: Array, width: int) -> Array:
    """Nowhere above ``top``, and without its peaks of up to twice so many neighbours."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    if width < 1:
        return top
    size = 2 * width + 1
    return np.asarray(maximum_filter1d(minimum_filter1d(top, size), size))


def _with_window(
    piece: Piece, ceiling: Ceiling, limits: JointLimits, s: Array, top: Array, window: float
) -> Timed:
    slower = np.ones(len(s))
    best: Timed | None = None
    for _ in range(ROUNDS):
        raw = Parabolas.of(s, fastest(piece, s, top * slower, limits))
        # A window that is longer than the motion would be all that one sees of it.
        now = Timed(piece, Profile(raw, min(window, float(raw.t[-1]))))
        t = now.instants()
        over = now.use(t, ceiling, limits).stretch
        if not np.isfinite(over).all():
            raise _nowhere(piece, now.profile.at(t).s[np.argmin(np.isfinite(over))])
        whole, more = now, float(over.max())
        # Stretched, it is looked at in other places, until none of them is beyond a limit.
        while more > 1.0:
            stretch = whole.profile.stretch * more * (1 + MARGIN)
            whole = Timed(piece, Profile(raw, now.profile.window, stretch))
            more = float(whole.use(whole.instants(), ceiling, limits).stretch.max())
        if best is None or whole.duration < best.duration:
            best = whole
        if over.max() <= 1 + 1e-3:
            break
        slower = slower / _spread(s, now, t, over)
    assert best is not None
    return best


def _spread(s: Array, now: Timed, t: Array, over: Array) -> Array:
    """By how much to be slower at each path coordinate: what the average mixes counts for all of it."""
    wanted = np.ones(len(s))
    w = now.profile.window
    at = np.flatnonzero(over > 1 + 1e-4)
    low, high = (np.searchsorted(s, now.profile.raw.at(when)[1]) for when in (t[at] - w, t[at]))
    for i, a, b in zip(at.tolist(), low.tolist(), high.tolist(), strict=True):
        part = slice(max(a - 1, 0), b + 1)
        wanted[part] = np.maximum(wanted[part], over[i])
    return wanted


def fastest(piece: Piece, s: Array, top: Array, limits: JointLimits) -> Array:
    """Fastest path speeds under the map and the joints' speeds and accelerations, by toppra; shape (n,)."""
    need("toppra")
    from toppra import algorithm, constraint, interpolator
    from toppra.constraint.linear_constraint import LinearConstraint

    class Along(interpolator.AbstractGeometricPath):  # type: ignore[misc, unused-ignore]
        """The piece, as toppra wants it."""

        dof = property(lambda _: len(limits.velocity))
        path_interval = property(lambda _: np.array([s[0], s[-1]]))

        def __call__(self, at: object, order: int) -> Array:
            return np.asarray(piece.spline(at, order))

    class Map(LinearConstraint):  # type: ignore[misc, unused-ignore]
        """Path speeds up to the map's."""

        def __init__(self) -> None:
            super().__init__()
            self.dof = len(limits.velocity)

        def compute_constraint_params(self, path: object, gridpoints: object) -> tuple[object, ...]:
            bound = np.column_stack([np.zeros(len(s)), top**2])
            return None, None, None, None, None, None, bound

    logging.getLogger("toppra").setLevel(logging.ERROR)
    both = (
        (constraint.JointVelocityConstraint, limits.velocity),
        (
            constraint.JointAccelerationConstraint,
            limits.acceleration,
        ),
    )
    joint = [kind(np.column_stack([-limit, limit])) for kind, limit in both]
    solver = algorithm.TOPPRA([*joint, Map()], Along(), gridpoints=s, solver_wrapper="seidel")
    _, speed, _ = solver.compute_parameterization(0.0, 0.0)
    if speed is None or not np.isfinite(speed).all():
        what = "no timing was found for a piece of the path"
        raise InputError.at("permissible speed", "toppra", what, "give a larger path tolerance")
    # Two neighbours at rest would take for ever.
    inner = np.maximum(speed[1:-1], SLOWEST * top[1:-1])
    return np.concatenate([[0.0], inner, [0.0]])
