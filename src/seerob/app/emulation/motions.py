"""Motions that an emulated robot plays: one that was recorded, or a calm swing; tables of a PLC's values.

The program of an emulated PLC: a belt that brings parts and stops, a light curtain, a sliding door.

Every emulated PLC plays it, whatever it speaks; times are from its start, so a restart begins anew.
"""

from __future__ import annotations

import csv
import math
import re
import time
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from seerob.core.errors import InputError
from seerob.core.files.bounded import content
from seerob.core.files.toml_file import MAX_FILE_SIZE

CYCLE = 10.0
"""Of the belt [s]."""
RUN = 6.0
"""Of it, how long the belt runs [s]."""
SPEED = 250.0
"""Of the belt [mm/s]."""
INTERRUPTED = (17.0, 18.0)
"""When the light curtain is interrupted within each `ROUND` [s]."""
ROUND = 20.0
"""[s]"""


def running(t: float) -> bool:
    """Whether the belt runs at ``t`` [s]."""
    return t % CYCLE < RUN


def speed(t: float) -> float:
    """Of the belt [mm/s]."""
    return SPEED if running(t) else 0.0


def position(t: float) -> float:
    """How far the belt has run [mm]."""
    return SPEED * (RUN * (t // CYCLE) + min(t % CYCLE, RUN))


def clear(t: float) -> bool:
    """Whether the light curtain is free."""
    return not INTERRUPTED[0] <= t % ROUND < INTERRUPTED[1]


def door_open(t: float) -> bool:
    """Whether the door is told to be open: while the belt stands."""
    return not running(t)


Joints = tuple[float, ...]
Motion = Callable[[float], tuple[Joints, Joints]]
"""Joint positions [rad or m] and speeds [rad/s or m/s] at a time [s]."""

CLOSED = 1e-3
"""A motion whose ends differ by no more [rad or m] is played round and round."""
SWING, SWING_PERIOD = 0.25, 8.0
"""Amplitude [rad] and period [s]."""
STANDS = 8.0
"""Who works in rounds stands still so long at first, at least [s]."""
T = TypeVar("T")


def swing(home: Sequence[float]) -> Motion:
    """Every joint to and fro about a pose, each with a phase of its own.

    Args:
        home: Joint positions [rad], shape (n,).
    """
    omega = 2 * math.pi / SWING_PERIOD

    def motion(t: float) -> tuple[Joints, Joints]:
        phases = [omega * t + k for k in range(len(home))]
        q = tuple(h + SWING * math.sin(p) for h, p in zip(home, phases, strict=True))
        return q, tuple(SWING * omega * math.cos(p) for p in phases)

    return motion


def played(
    times: Sequence[float], q: Sequence[Joints], qd: Sequence[Joints], *, once: bool = False
) -> Motion:
    """A recorded motion: round and round when its ends meet, else it stands still at its end.

    Between samples it is the cubic that has their positions and speeds.

    Args:
        times: Ascending, from 0 [s], shape (m,).
        q: Joint positions [rad or m], shape (m, n).
        qd: Joint speeds [rad/s or m/s], shape (m, n).
        once: It stands still at its end in any case, until somebody begins it anew.
    """
    closed = not once and max((abs(a - b) for a, b in zip(q[0], q[-1], strict=True)), default=0.0) <= CLOSED

    def motion(t: float) -> tuple[Joints, Joints]:
        if t >= times[-1] and not (closed and times[-1] > 0):
            return q[-1], (0.0,) * len(q[-1])
        t = t % times[-1] if closed and times[-1] > 0 else max(t, 0.0)
        k = min(bisect_right(times, t), len(times) - 1) - 1
        length = times[k + 1] - times[k]
        s = (t - times[k]) / length
        rows = zip(q[k], q[k + 1], qd[k], qd[k + 1], strict=True)
        both = [_cubic(s, length, *row) for row in rows]
        return tuple(x for x, _ in both), tuple(v for _, v in both)

    return motion


def _cubic(s: float, T: float, q0: float, q1: float, v0: float, v1: float) -> tuple[float, float]:
    """Position and speed of the cubic Hermite polynomial at a share ``s`` of the interval ``T`` [s]."""
    a, b, chord = T * v0, T * v1, q1 - q0
    c2, c3 = 3 * chord - 2 * a - b, a + b - 2 * chord
    return q0 + s * (a + s * (c2 + s * c3)), (a + s * (2 * c2 + s * 3 * c3)) / T


def in_step(motion: Motion, period: float) -> Motion:
    """A motion that goes round and round, begun with the clock of this machine: such motions are in step.

    Its time 0 is at whole multiples of the period of the clock's seconds, whenever it was begun.

    Args:
        motion: What it is.
        period: Of a round [s].
    """
    ahead: list[float] = []

    def stepped(t: float) -> tuple[Joints, Joints]:
        if not ahead:
            ahead.append(time.time() - t)
        return motion((t + ahead[0]) % period)

    return stepped


def in_rounds(seen: Callable[[float], T], period: float) -> Callable[[float], T]:
    """What a person does, in rounds that begin at whole multiples of a period of this machine's clock.

    At first they stand as at its beginning, for `STANDS` and until the next round, as calibrations ask for.

    Args:
        seen: What a device sees of them at a time since the beginning of a round [s].
        period: Of a round [s].
    """
    ahead: list[float] = []

    def at(t: float) -> T:
        if not ahead:
            ahead.append(time.time() - t)
        return seen(round_time(t + ahead[0], period, ahead[0]))

    return at


def round_time(clock: float, period: float, begun: float) -> float:
    """How far a round has come [s], as of `in_rounds`; of the clock's seconds, as ``begun`` is."""
    first = math.ceil((begun + STANDS) / period) * period
    return clock % period if clock >= first else 0.0


@dataclass(frozen=True)
class ValueTable:
    """Values of variables over time, round and round; read from a table by `values`."""

    times: tuple[float, ...]
    """Ascending, from 0 to the period [s]."""
    columns: dict[str, tuple[str, tuple[float, ...]]]
    """By path: unit, or ``bool``, and a value at each instant."""

    def value(self, path: str, t: float) -> float | bool:
        """Between two rows on the line between them; a bool as in the row before."""
        unit, values = self.columns[path]
        t %= self.times[-1]
        k = bisect_right(self.times, t) - 1
        if unit == "bool":
            return bool(values[k])
        share = (t - self.times[k]) / (self.times[k + 1] - self.times[k])
        return values[k] + share * (values[k + 1] - values[k])


def values(path: Path) -> ValueTable:
    """Read a table: ``t [s]`` and a column for each variable, ``Belt/speed [mm/s]``, ``Door/open [bool]``.

    Raises:
        InputError: With the row or the header that is wrong.
    """
    rows = list(csv.reader(content(path, MAX_FILE_SIZE).decode("utf-8-sig").splitlines()))
    heads = [re.fullmatch(r"(\S+) \[(\S+)\]", head.strip()) for head in rows[0]] if rows else []
    if len(rows) < 3 or not all(heads) or (heads[0] and heads[0].groups() != ("t", "s")):
        what, remedy = "no table of values", "begin with t [s],Belt/speed [mm/s],… and two rows or more"
        raise InputError.at(str(path), "", what, remedy)
    found: list[list[float]] = []
    for number, row in enumerate(rows[1:], 2):
        try:
            found.append([float(cell) for cell in row])
        except ValueError:
            found.append([])
        late = len(found) > 1 and len(found[-1]) == len(heads) and not found[-1][0] > found[-2][0]
        if len(found[-1]) != len(heads) or late or not all(map(math.isfinite, found[-1])):
            remedy = "a number in every cell, times ascending"
            raise InputError.at(str(path), f"row {number}", ",".join(row), remedy)
    if found[0][0] != 0:
        raise InputError.at(str(path), "row 2", f"t = {found[0][0]:g}", "begin at t = 0")
    times, *columns = zip(*found, strict=True)
    named = [head.groups() for head in heads if head][1:]
    return ValueTable(times, {name: (unit, c) for (name, unit), c in zip(named, columns, strict=True)})
