"""A joint trajectory read from a file: plain arrays in SI units, checked once, then sampled.

Nothing is resampled: every sample is a row of the file. Velocities that the file does not give are
derived by second-order central differences, and the result says so.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.samples import LARGEST, JointSample, Quality
from seerob.core.transforms import Array

THREE = 3.0
"""Standard deviations that are told: 99.7 % lie within."""
UNEVEN = 0.05
"""Share of the step that steps of even samples may differ by."""
MOST_DIFFERENCES = 100_000
"""Third differences that the noise of uneven samples is told by; of more, evenly."""
LEAST = 50
"""Samples that tell noise."""
BETWEEN = 2.77
"""Noise of the speed half way between two samples, as a multiple of that at a sample: of the cubic through
them √(2 (11/8)² + 2 (1/8)²) against √½."""
AT_END = math.sqrt(13.0)
"""Noise of the speed at the first and the last sample, as a multiple of that at a sample between: the
difference is one-sided there, (−3, 4, −1)/2."""
QUIET = 0.005
"""Noise of derived speeds below it is not followed [rad/s or m/s]: 5 mm/s at a metre, a fiftieth of the
250 mm/s of a reduced speed."""
MAX_SAMPLES = 5_000_000
"""More rows than this are refused: 80 minutes at 1 kHz."""
LATEST = 1e12
"""A time beyond it is no time in seconds, but a stamp in another unit [s]."""


class Timed:
    """What every motion read from a file has: instants, and places in the file for messages."""

    file: str
    t: Array
    rows: NDArray[np.int64] | None
    sheet: str

    def __post_init__(self) -> None:
        problems = list(self._shape_problems()) or list(self._value_problems())
        if problems:
            raise InputError(problems)

    def _shape_problems(self) -> Iterator[Problem]:
        """Whether the arrays belong together."""
        raise NotImplementedError

    def _value_problems(self) -> Iterator[Problem]:
        """What is wrong in arrays that do."""
        raise NotImplementedError

    @property
    def duration(self) -> float:
        """From the first to the last sample [s]."""
        return float(self.t[-1] - self.t[0])

    def instant(self, index: int) -> float:
        """Run time of a sample [s], from 0."""
        return float(self.t[index] - self.t[0])

    def place(self, index: int, column: str = "") -> str:
        """Where a sample stands in the file: ``sheet 'Joints' row 17 column 'J3'``."""
        row = f"row {self.rows[index]}" if self.rows is not None else f"sample {index}"
        sheet = f"sheet {self.sheet!r} " if self.sheet else ""
        return sheet + row + (f" column {column!r}" if column else "")

    def _count_problems(self) -> Iterator[Problem]:
        n = len(self.t)
        if n < 2:
            what = f"{n} sample{'s' * (n != 1)}; a trajectory has at least 2"
            yield Problem(self.file, f"sheet {self.sheet!r}" if self.sheet else "", what, "export more rows")
        if n > MAX_SAMPLES:
            yield Problem(self.file, "", f"{n} samples, more than {MAX_SAMPLES}", "split the file")

    def _width_problems(self, wanted: dict[str, int]) -> Iterator[Problem]:
        n = len(self.t)
        for name, width in wanted.items():
            array = getattr(self, name)
            if array is not None and array.shape != (n, width):
                yield Problem(self.file, name, f"shape {array.shape} where {(n, width)} is needed")

    def _time_problems(self) -> Iterator[Problem]:
        finite_time = np.isfinite(self.t)
        if not finite_time.all():
            i = int(np.argmin(finite_time))
            yield Problem(self.file, self.place(i), f"time is {self.t[i]}", "give every row a time")
            return
        late = np.abs(self.t) > LATEST
        if late.any():
            i = int(np.argmax(late))
            what = f"time {self.t[i]:.4g} s is beyond {LATEST:g} s ({int(late.sum())} such rows)"
            yield Problem(self.file, self.place(i), what, "correct the time unit or the row")
            return
        step = np.diff(self.t)
        wrong = np.flatnonzero(step <= 0)
        if wrong.size:
            i = int(wrong[0]) + 1
            kind = "repeats" if step[i - 1] == 0 else "goes back"
            what = f"time {kind}: {self.t[i]:.9g} s after {self.t[i - 1]:.9g} s ({wrong.size} such rows)"
            yield Problem(self.file, self.place(i), what, "remove the rows, or export one motion per file")

    def _number_problems(self, names: Iterable[str]) -> Iterator[Problem]:
        """Values that are not finite or so large that nothing can be computed with them."""
        for name in names:
            array = getattr(self, name)
            if array is None:
                continue
            array = array.reshape(len(array), -1)
            bad = ~np.isfinite(array)
            if bad.any():
                i, j = (int(k) for k in np.argwhere(bad)[0])
                what = f"{name}[{j}] is {array[i, j]} ({int(bad.sum())} such values)"
                yield Problem(self.file, self.place(i), what, "every value must be a finite number")
                continue
            far = np.abs(array) > LARGEST
            if far.any():
                i, j = (int(k) for k in np.argwhere(far)[0])
                what = f"{name}[{j}] is {array[i, j]:.4g}, beyond {LARGEST:g} ({int(far.sum())} such values)"
                yield Problem(self.file, self.place(i), what, "correct the row, the unit or the columns")


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Timed):
    """Joint values over time, one row per sample of the file.

    Raises:
        InputError: Values that are not finite or too large, time that does not strictly increase,
            shapes that do not fit, fewer than two samples; every kind of mistake once, with its
            first place.
    """

    file: str
    """The file, as the user named it; for messages."""
    t: Array
    """Instants on the file's own clock [s], shape (n,), strictly increasing."""
    q: Array
    """Joint positions [rad or m], shape (n, dof)."""
    qd: Array | None = None
    """Joint velocities as the file gives them [rad/s or m/s], shape (n, dof)."""
    tau: Array | None = None
    """Measured joint torques [N·m or N], shape (n, dof)."""
    current: Array | None = None
    """Measured motor currents, where the file says no torques [A], shape (n, dof)."""
    tcp_position: Array | None = None
    """Tool centre point in whatever frame the file uses [m], shape (n, 3)."""
    tcp_said: NDArray[np.bool_] | None = None
    """Rows in which the file says where that is, shape (n,); all of them when not given."""
    tcp_wxyz: Array | None = None
    """Orientation of the tool in whatever frame the file uses, unit quaternions, shape (n, 4)."""
    tcp_speed: Array | None = None
    """Speed of that point as the file gives it [m/s], shape (n,)."""
    payload: Array | None = None
    """What the file has at the robot's flange [kg], shape (n,)."""
    tcp_in_base: bool = False
    """Whether that frame is the base of the robot's controller."""
    degrees: bool = False
    """Whether angles were converted from degrees because a table or its mapping says so."""
    invalid: NDArray[np.bool_] | None = None
    """Rows of which the file itself says that they are not the robot's state, shape (n,)."""
    rows: NDArray[np.int64] | None = None
    """Row numbers in the file, from 1, shape (n,); for messages."""
    sheet: str = ""
    """Sheet of a workbook; for messages."""

    def __repr__(self) -> str:
        return f"Trajectory({self.file!r}, {len(self.t)} samples of {self.dof} joints, {self.duration:g} s)"

    @property
    def dof(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    def _shape_problems(self) -> Iterator[Problem]:
        if self.t.ndim != 1 or self.q.ndim != 2 or self.q.shape[1] == 0:
            yield Problem(self.file, "", f"time {self.t.shape} and joints {self.q.shape} are not a table")
            return
        yield from self._count_problems()
        widths = {"q": self.dof, "qd": self.dof, "tau": self.dof, "current": self.dof}
        widths |= {"tcp_position": 3, "tcp_wxyz": 4}
        yield from self._width_problems(widths)

    def _value_problems(self) -> Iterator[Problem]:
        yield from self._time_problems()
        every = ("q", "qd", "tau", "current", "tcp_position", "tcp_wxyz", "tcp_speed", "payload")
        yield from self._number_problems(every)


@dataclass(frozen=True, eq=False)
class Derived:
    """Velocities from positions."""

    qd: Array
    """[rad/s or m/s], shape (n, dof)."""
    error: float | None
    """Largest estimated error [rad/s or m/s]; None when there are too few samples to tell."""


def derive_velocities(
    t: Array,
    q: Array,
    *,
    largest: Array | float = np.inf,
    known: NDArray[np.bool_] | None = None,
) -> Derived:
    r"""Second-order differences, central ones but at the ends and beside a gap, for any spacing.

    Beside a gap :math:`h_1` of rows that are :math:`h_0` apart a one-sided difference is off by
    :math:`(h_0 + h_0') h_0` times what a central one is by :math:`h_0 h_1`, and is taken where that is less
    than half. Nothing is differentiated across a jump or a row that is not known: there a motion ends and
    another begins. A row between two of them has no velocity, and gets 0.

    The error is Richardson's estimate :math:`|\dot q_h - \dot q_{2h}| / 3` where every other sample
    is left out; noise in the positions raises it, as it should.

    Args:
        t: Instants [s], shape (n,), strictly increasing, n >= 2.
        q: Positions [rad or m], shape (n, dof).
        largest: Above it two rows are a jump [rad/s or m/s], shape (dof,) or one for all.
        known: Whether each row says where it is, shape (n,); all do when not given.
    """
    known = np.ones(len(t), bool) if known is None else known
    with np.errstate(over="ignore"):  # two instants may be as near as numbers can be
        slopes = np.abs(np.diff(q, axis=0)) / np.diff(t)[:, None]
    apart = (slopes > largest).any(axis=1) | ~known[1:] | ~known[:-1]
    starts = np.concatenate([[0], np.flatnonzero(apart) + 1, [len(t)]])
    qd, errors = np.zeros_like(q, dtype=float), []
    for a, b in pairwise(starts.tolist()):
        if b - a < 2:
            continue
        qd[a:b] = np.gradient(q[a:b], t[a:b], axis=0, edge_order=2 if b - a > 2 else 1)
        step = np.diff(t[a:b])
        wide = 2 * (step[:-2] + step[1:-1])
        for k in a + 2 + np.flatnonzero(step[2:] > wide):
            qd[k] = np.gradient(q[k - 2 : k + 1], t[k - 2 : k + 1], axis=0, edge_order=2)[-1]
        wide = 2 * (step[1:-1] + step[2:])
        for k in a + 1 + np.flatnonzero(step[:-2] > wide):
            qd[k] = np.gradient(q[k : k + 3], t[k : k + 3], axis=0, edge_order=2)[0]
        if b - a >= 7:
            coarse = np.gradient(q[a:b:2], t[a:b:2], axis=0, edge_order=2)
            # The ends are one-sided there; the estimate holds inside.
            errors.append(float(np.abs(coarse - qd[a:b:2])[1:-1].max()) / 3)
    return Derived(qd, max(errors, default=None))


def position_noise(q: Array) -> Array:
    r"""Standard deviation of the noise of evenly sampled positions [rad or m], shape (n,).

    Third differences :math:`q_{k+2} - 3 q_{k+1} + 3 q_k - q_{k-1}` of a smooth motion are nearly nothing, of
    noise they are √20 σ; the median of their size is that of whatever the motion does most of the time.

    Args:
        q: [rad or m], shape (N, n), N >= 4.
    """
    return np.asarray(np.median(np.abs(np.diff(q, n=3, axis=0)), axis=0) * 1.4826 / np.sqrt(20))


def derived_noise(t: Array, q: Array, known: NDArray[np.bool_] | None = None) -> Array | None:
    """How far speeds that were derived from noisy positions may be off [rad/s or m/s], shape (n,).

    Three standard deviations of a central difference, of uneven samples as it is for half of them; None of
    few samples.

    Args:
        t: [s], shape (N,).
        q: [rad or m], shape (N, n).
        known: Whether each row says where it is, shape (N,); all do when not given.
    """
    known = np.ones(len(t), bool) if known is None else known
    t, q, step = t[known], q[known], np.diff(t[known])
    if len(t) < LEAST:
        return None
    if is_even(t):
        return np.asarray(THREE * position_noise(q) / (np.sqrt(2) * float(np.median(step))))
    return np.asarray(THREE * _uneven_noise(t, q) * float(np.median(_weights(t, np.ones(len(t), bool)))))


def is_even(t: Array) -> bool:
    """Whether samples are evenly apart, but for what a clock jitters."""
    step = np.diff(t)
    return bool(np.ptp(step) <= UNEVEN * float(np.median(step)))


def _uneven_noise(t: Array, q: Array) -> Array:
    """What `position_noise` says of even samples, by divided differences; t (N,), q (N, n)."""
    some = slice(None, None, -(-len(t) // MOST_DIFFERENCES))
    quadruples = np.lib.stride_tricks.sliding_window_view(t, 4)[some]
    apart = quadruples[:, :, None] - quadruples[:, None, :] + np.eye(4)
    with np.errstate(all="ignore"):  # two instants may be as near as numbers can be
        weights = 1 / apart.prod(axis=2)
        weights /= np.linalg.norm(weights, axis=1)[:, None]
    found = np.einsum("ki,kni->kn", weights, np.lib.stride_tricks.sliding_window_view(q, 4, axis=0)[some])
    return np.asarray(1.4826 * np.median(np.nan_to_num(np.abs(found), nan=np.inf), axis=0))


def _weights(t: Array, known: NDArray[np.bool_]) -> Array:
    """Noise of each derived speed per noise of a position [1/s], shape (N,)."""
    # Three rows in a row make each: of every third one that is 1 a speed has the weight of its own.
    probes = (np.arange(len(t))[:, None] % 3 == np.arange(3)).astype(float)
    return np.asarray(np.linalg.norm(derive_velocities(t, probes, known=known).qd, axis=1))


def handed_on(t: Array, known: NDArray[np.bool_] | None = None) -> Array:
    """Noise of speeds at samples and about them, as a multiple of `derived_noise`, shape (N,).

    Half way between two samples the cubic through them has one and a half times the slope of its chord, less
    a quarter of both speeds; of uneven samples all three are added up as if they were off together.
    """
    known = np.ones(len(t), bool) if known is None else known
    if is_even(t[known]):
        found = np.full(len(t), BETWEEN)
        found[[0, -1]] = AT_END
        return found
    at = _weights(t, known)
    halfway = np.where(known[1:] & known[:-1], 1.5 * np.sqrt(2) / np.diff(t) + 0.25 * (at[1:] + at[:-1]), 0.0)
    most = np.maximum(at, np.maximum(np.append(halfway, 0.0), np.insert(halfway, 0, 0.0)))
    return np.asarray(most / float(np.median(_weights(t[known], np.ones(int(known.sum()), bool)))))


@dataclass(frozen=True, eq=False)
class TrajectorySamples:
    """The rows of a trajectory as samples, ``t`` from 0; can be iterated again and again."""

    trajectory: Trajectory
    source: str
    target: str
    qd: Array | None = field(repr=False)
    """Velocities to hand on: the file's own or derived [rad/s or m/s], shape (n, dof)."""
    qd_error: Array | None = field(default=None, repr=False)
    """Of those that are derived, see `derived_noise`, shape (dof,)."""

    def __len__(self) -> int:
        return len(self.trajectory.t)

    def __iter__(self) -> Iterator[JointSample]:
        motion = self.trajectory
        start = float(motion.t[0])
        tcp = motion.tcp_position if motion.tcp_in_base else None
        said = np.ones(len(motion.t), bool) if motion.tcp_said is None else motion.tcp_said
        off, about = self.qd_error, np.zeros(0)
        if off is not None:
            about = handed_on(motion.t, None if motion.invalid is None else ~motion.invalid)
        for i, t in enumerate(motion.t.tolist()):
            yield JointSample(
                source=self.source,
                target=self.target,
                seq=i,
                t=t - start,
                t_device=t,
                quality=Quality.GOOD if motion.invalid is None or not motion.invalid[i] else Quality.INVALID,
                q=tuple(motion.q[i].tolist()),
                qd=None if self.qd is None else tuple(self.qd[i].tolist()),
                qd_error=None if off is None else tuple((about[i] * off).tolist()),
                tau=None if motion.tau is None else tuple(motion.tau[i].tolist()),
                tcp=None if tcp is None or not said[i] else tuple(tcp[i].tolist()),
                tcp_speed=None if motion.tcp_speed is None else float(motion.tcp_speed[i]),
                payload=None if motion.payload is None else float(motion.payload[i]),
            )
