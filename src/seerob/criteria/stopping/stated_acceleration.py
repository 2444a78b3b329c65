r"""Whether a robot's own motion contradicts the accelerations that the file states.

S_p of a stated acceleration a is right as long as no point gets faster than with a while the robot reacts:

.. math:: v(t) \le v(t_0) + a\,(t - t_0), \qquad t_0 \le t \le t_0 + T_r.

A motion in which a moving part does is held against it: of a file before the run, over all of it; of whom
only the run shows, when it is seen, from then on.

So with the ``acceleration_limits`` of its joints, on which S_p rests where nobody knows what comes next:

.. math:: |\dot q_j(t) - \dot q_j(t_0)| \le a_j\,(t - t_0),

whether it gets faster or slower, as a joint that brakes may make a point faster that others move. Of a motion
from a file here; live sources are looked at where they are heard (`seerob.devices.live.contradictions`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.domains import agree, at_least, number
from seerob.core.errors import Undecided
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.devices.live.contradictions import SHARE, SPEED_NOISE
from seerob.model.model import Mechanism, Model
from seerob.twin.speed_noise import SpeedNoise
from seerob.twin.state import State
from seerob.twin.states import Bench, Motion, Questions
from seerob.workstation.plausibility.ranges import Quantity, confirmation, how_to_confirm

NOISE = 0.02
"""By so much a part may get faster without contradicting anything [m/s]: speeds that controllers measure are
noisy by up to 0.01 rad/s (`seerob.devices.live.contradictions`), either way, one metre from the axis."""
STRETCH = 1024
"""Instants whose speeds are computed together."""
CLOSE = 1e-3
"""To which the least acceleration that explains a motion is found, relative."""


class Gain(NamedTuple):
    """A part that gets faster than stated."""

    part: int
    begin: float
    """Since when [s]."""
    end: float
    """Until when [s]."""
    gained: float
    """Speed that it gained meanwhile [m/s]."""
    least: float = math.inf
    """Acceleration that would explain all gains [m/s²]."""


def largest_gain(
    t: Array, v: Array, a: Array | float, window: float, noise: Array | float = 0.0
) -> Gain | None:
    """The largest gain of speed within a window beyond what an acceleration explains; None for none.

    Args:
        t: Instants, increasing [s], shape (m,).
        v: Speeds of parts, shape (m, n) [m/s].
        a: Acceleration [m/s²], shape (n,) or a number.
        window: [s].
        noise: Of a gain, which is allowed for [m/s], shape (n,) or a number.
    """
    _check(a=a)
    number("window", window, 0.0, unit="s")
    _check(t=t, v=v, noise=noise)
    agree(m=(len(t), len(v)))
    if not v.size:
        return None
    left = v - np.asarray(a) * t[:, None]
    first = np.searchsorted(t, t - window * (1 + 1e-9))
    beyond = left - _least_since(left, first) - noise
    j, part = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    if not beyond[j, part] > 0:
        return None
    i = first[j] + int(np.argmin(left[first[j] : j + 1, part]))
    return Gain(int(part), float(t[i]), float(t[j]), float(v[j, part] - v[i, part]))


def _check(**given: Array | float) -> None:
    for name, value in given.items():
        if not np.isfinite(at_least(name, value, unit={"t": "s", "a": "m/s²"}.get(name, "m/s"))).all():
            raise ValueError(f"{name} is not a finite number everywhere")


def _least_since(x: Array, first: NDArray[np.int64]) -> Array:
    """Least of each column from a row of its own to each row, shape as ``x``: minima of doubled lengths."""
    least, found, length = x, np.empty_like(x), 1
    lengths = np.arange(len(x)) - first + 1
    while length <= int(lengths.max()):
        rows = np.flatnonzero((lengths >= length) & (lengths < 2 * length))
        found[rows] = np.minimum(least[first[rows]], least[rows - length + 1])
        least = np.vstack([np.minimum(least[:-length], least[length:]), least[-length:]])
        length *= 2
    return found


def explains(t: Array, v: Array, window: float, noise: Array | float = 0.0) -> float:
    """The least acceleration that leaves no gain beyond it [m/s²], from above; as `largest_gain`."""
    _check(t=t, v=v, noise=noise)
    agree(m=(len(t), len(v)))
    low, high = 0.0, float((np.diff(v, axis=0) / np.diff(t)[:, None]).max(initial=0.0))
    while high - low > CLOSE * high:
        middle = (low + high) / 2
        low, high = (middle, high) if largest_gain(t, v, middle, window, noise) else (low, middle)
    return high


class StatedAcceleration:
    """The claim of a criterion that its robot gets no faster than stated while it reacts.

    Args:
        model: The compiled workstation.
        bodies: The moving parts of the robot.
        a: As stated [m/s²].
        T_r: Reaction time [s].
        key: Where a stands in the file.
        holds: Names of what rests on it.
    """

    def __init__(
        self, model: Model, bodies: tuple[int, ...], a: float, T_r: float, key: str, holds: tuple[str, ...]
    ) -> None:
        self._model, self._bodies = model, bodies
        self._a, self._T_r, self.holds = a, T_r, holds
        self._quantity = Quantity(
            key, "safety.separation.stop.acceleration", "m/s²", (a,), holds, of=holds[0]
        )
        self._confirmed, self._other = confirmation(self._quantity, model.workstation.confirmed)
        self._seen: deque[tuple[float, Array]] = deque()

    def of_motion(self, motion: Motion, what: str = "") -> Finding | None:
        """What a motion contradicts, anywhere in it; None for nothing.

        Args:
            motion: Of everybody, each instant after the other.
            what: Where it is from.
        """
        movers = {self._model.bodies[i].carrier for i in self._bodies}
        if any(self._model.bodies[i].holder for i in self._bodies):
            return None  # what is picked up moves with the hand, which only the run shows
        bench = Bench(self._model, Questions(self._model))
        rows, shape = np.array(self._bodies, np.int64), SpeedNoise(self._model)
        noise, speeds = np.zeros(len(rows)), []
        for k in range(0, len(motion.t), STRETCH):
            part = replace(motion, ways=None).part(k, k + STRETCH)
            states = bench.place(part)
            speeds.append(states.largest_speeds()[:, rows])
            if part.speed_errors:
                R, x = states.everywhere()
                errors = {name: found.max(axis=0) for name, found in part.speed_errors.items()}
                bench.data.qpos[:] = part.q[0]
                mujoco.mj_kinematics(bench.mj, bench.data)
                off = shape.of_bodies(bench.data, bench.ids, R[0], x[0], rows, errors)
                noise = np.maximum(noise, off)
        v = np.concatenate(speeds)
        known = np.all(
            [motion.invalid_reasons[name] == "" for name in movers if name in motion.invalid_reasons], axis=0
        )
        gains = [self._gain(motion.t[run], v[run], 2 * noise) for run in _runs(known)]
        worst = max(filter(None, gains), key=lambda found: found.least, default=None)
        return None if worst is None else self._finding(worst, what)

    def __call__(self, state: State) -> Finding | None:
        """What the run shows to contradict it, at a tick; None for nothing new."""
        if self._confirmed:
            return None
        try:
            v = state.fastest_speeds(self._bodies)
        except Undecided:
            self._seen.clear()
            return None
        if self._seen and not state.t > self._seen[-1][0]:
            self._seen.clear()
        self._seen.append((state.t, v))
        while state.t - self._seen[0][0] > self._T_r * (1 + 1e-9):
            self._seen.popleft()
        t, speeds = (np.array(each) for each in zip(*self._seen, strict=True))
        since = v - speeds - self._a * (state.t - t)[:, None]
        if not since.max() > NOISE:
            return None
        found = self._gain(t, speeds, 2 * state.speed_noise(self._bodies))
        return None if found is None else self._finding(found, "")

    def _gain(self, t: Array, v: Array, noise: Array) -> Gain | None:
        gain = largest_gain(t, v, self._a, self._T_r, NOISE + noise)
        return gain and gain._replace(least=explains(t, v, self._T_r, NOISE + noise))

    def _finding(self, gain: Gain, what: str) -> Finding:
        part = self._model.bodies[self._bodies[gain.part]].name
        right = math.ceil(100 * gain.least) / 100
        text = (
            f"{self._quantity.key} = {self._a:g} m/s² is contradicted by the robot's own motion: {what}"
            f"{part} gets faster by {gain.gained:.3g} m/s from {gain.begin:.3f} s to {gain.end:.3f} s, "
            "within the reaction time"
        )
        if self._confirmed:
            text = f"{text}; confirmed: {self._confirmed}"
            return Finding(level="note", subject=self.holds[0], text=text)
        text = f"{text}; give {right:g} or more, or leave it out{self._other}"
        text = f"{text}; {how_to_confirm(self._quantity)}"
        return Finding(level="warning", subject=self.holds[0], text=text, holds=self.holds)


class JointAccelerations:
    """The claim that no joint of a robot gets faster or slower than its ``acceleration_limits`` say.

    Args:
        model: The compiled workstation.
        robot: The robot.
        limits: Of its joints [rad/s² or m/s²], shape (j,).
        T_r: Reaction time [s].
        holds: Names of what rests on it.
    """

    def __init__(
        self, model: Model, robot: Mechanism, limits: Array, T_r: float, holds: tuple[str, ...]
    ) -> None:
        self._robot, self._limits, self._T_r, self.holds = robot, limits, T_r, holds
        i, table = next((i, r) for i, r in enumerate(model.workstation.robots) if r.name == robot.name)
        kind = "robots.acceleration_limits"
        self._quantity = Quantity(
            f"robots[{i}].acceleration_limits", kind, "rad/s²", tuple(table.acceleration_limits or ()), holds,
            of=robot.name,
        )  # fmt: skip
        self._confirmed, self._other = confirmation(self._quantity, model.workstation.confirmed)

    def of_motion(self, motion: Motion, what: str = "") -> Finding | None:
        """What a motion contradicts, anywhere in it; None for nothing.

        Args:
            motion: Of everybody, each instant after the other.
            what: Where it is from.
        """
        robot, units = self._robot, self._robot.units
        qd = motion.v[:, robot.v_address[robot.own]]
        noise = np.array([SPEED_NOISE[unit] for unit in units])
        errors = motion.speed_errors.get(robot.name)
        if errors is not None and len(errors):
            noise = noise + 2 * errors.max(axis=0)
        known = (
            np.asarray(motion.invalid_reasons[robot.name] == "")
            if robot.name in motion.invalid_reasons
            else np.ones(len(qd), bool)
        )
        both = np.hstack([qd, -qd]) + float(np.abs(qd).max(initial=0.0))
        most, off = np.tile((1 + SHARE) * self._limits, 2), np.tile(noise, 2)
        gains = [largest_gain(motion.t[run], both[run], most, self._T_r, off) for run in _runs(known)]
        worst = max(filter(None, gains), key=lambda gain: gain.gained, default=None)
        if worst is None:
            return None
        k = worst.part % len(units)
        unit, rate = units[k], worst.gained / (worst.end - worst.begin)
        text = (
            f"{self._quantity.key} is contradicted by the robot's own motion: {what}"
            f"{robot.joints[k].name} changes its speed by {worst.gained:.3g} {unit}/s from "
            f"{worst.begin:.3f} s to {worst.end:.3f} s, which is {rate:.3g} {unit}/s², "
            f"and the limit {self._limits[k]:g}"
        )
        if self._confirmed:
            text = f"{text}; confirmed: {self._confirmed}"
            return Finding(level="note", subject=self.holds[0], text=text)
        text = f"{text}; give what the joints can do{self._other}; {how_to_confirm(self._quantity)}"
        return Finding(level="warning", subject=self.holds[0], text=text, holds=self.holds)

    def __call__(self, state: State) -> Finding | None:
        """Nothing: who is heard live is held against his limits where he is heard."""
        return None


def _runs(valid: NDArray[np.bool_]) -> Iterator[slice]:
    """Stretches of instants that are valid."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], valid, [False]]).astype(int)))
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield slice(begin, end)
