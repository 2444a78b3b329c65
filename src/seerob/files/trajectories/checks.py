r"""What a trajectory must pass before it may drive a robot.

One robot's joint trajectory may drive any robot with the same number of joints ([Weistroffer2022]_
2.1.3.1), after these checks: joint count, position limits, speed limits, wrapped angles, and whether
the velocity columns are the derivative of the position columns.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from math import pi

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.files.trajectories.trajectory import Timed, Trajectory
from seerob.workstation.source import Target

TOLERANCE = 1e-6
"""Beyond a limit by less than this is the rounding of a printed number [rad or m]."""

MOVES = {"rad": 0.02, "m": 0.002}
"""A joint whose positions span less than this stands still: its noise says nothing of velocities."""

RESTS = 0.05
"""Angles that stay below it say nothing of their unit: the robot rests at its zero [as stated]."""
OFF = 0.02
"""Velocity columns that differ from the positions by a larger share disagree with them: of samples close
enough to tell a motion, differences alone are off by less than 1 %."""
STARTS = 5e-4
"""A first instant nearer to 0 is 0 [s]."""


class Beyond(StrEnum):
    """What to do with positions beyond a limit of the robot."""

    REFUSE = "refuse"
    REPORT = "report"
    """Go on; the result carries a warning."""


def joint_count_check(trajectory: Trajectory, target: Target) -> None:
    """InputError when the file and the robot do not have the same number of joints."""
    if trajectory.dof != len(target.joints):
        what = f"{trajectory.dof} joints, but {target.name!r} has {len(target.joints)}"
        remedy = f"name {len(target.joints)} joint columns, one for each of: {', '.join(target.joints)}"
        raise InputError.at(
            trajectory.file, f"sheet {trajectory.sheet!r}" * bool(trajectory.sheet), what, remedy
        )


def limit_check(
    trajectory: Trajectory, target: Target, *, beyond: Beyond = Beyond.REFUSE
) -> tuple[Finding, ...]:
    """Positions and speeds against the limits of the robot that is to be driven.

    The speed of a joint is the largest of the given velocities and of the slopes between samples:
    by the mean value theorem the motion was at least that fast somewhere in between.

    Args:
        trajectory: The motion.
        target: The robot it is to drive.
        beyond: Whether positions beyond a limit stop here or become warnings.

    Returns:
        Warnings for speeds beyond a limit (and positions, when reported) and for degrees that look
        like radians; a note for joints of which nobody stated a limit.

    Raises:
        InputError: Another number of joints, a wrapped angle, or a position beyond a limit.
    """
    joint_count_check(trajectory, target)
    slopes = _slopes(trajectory)
    problems, findings = [], list(_degrees_for_radians(trajectory, target))
    for j, joint in enumerate(target.joints):
        unit = target.units[j]
        wrapped = _wrapped(trajectory, slopes, j) if unit == "rad" else None
        if wrapped is not None:
            problems.append(wrapped._replace(what=f"{joint} {wrapped.what}"))
            continue
        position = _position(trajectory, target, j)
        if position is not None and beyond is Beyond.REFUSE:
            remedy = 'correct the file or the unit, or set beyond_limits = "report"'
            problems.append(Problem(trajectory.file, position[0], position[1], remedy))
        elif position is not None:
            findings.append(
                Finding(level="warning", subject=target.name, text=f"{position[1]} ({position[0]})")
            )
        findings += _speed(trajectory, target, slopes, j)
    if problems:
        raise InputError(problems)
    unknown = [name for name, limit in zip(target.joints, target.velocity, strict=True) if limit is None]
    if unknown:
        text = f"no speed limit is known for {', '.join(unknown)}: speeds were not checked"
        findings.append(Finding(level="note", subject=target.name, text=text))
    free = [
        name
        for name, low, high in zip(target.joints, target.lower, target.upper, strict=True)
        if not (np.isfinite(low) or np.isfinite(high))
    ]
    if free:
        text = f"no position limit is known for {', '.join(free)}: positions were not checked"
        findings.append(Finding(level="note", subject=target.name, text=text))
    return tuple(findings)


def _judged(trajectory: Trajectory) -> NDArray[np.bool_]:
    """Rows that the file does not itself call invalid, shape (n,)."""
    if trajectory.invalid is None:
        return np.ones(len(trajectory.t), bool)
    return ~trajectory.invalid


def _slopes(trajectory: Trajectory) -> Array:
    """Mean velocity of each interval [rad/s or m/s], shape (n - 1, dof); 0 beside an invalid row."""
    with np.errstate(over="ignore"):  # two instants may be as near as numbers can be
        slopes = np.diff(trajectory.q, axis=0) / np.diff(trajectory.t)[:, None]
    judged = _judged(trajectory)
    return np.asarray(np.where((judged[1:] & judged[:-1])[:, None], slopes, 0.0))


def _degrees_for_radians(trajectory: Trajectory, target: Target) -> Iterator[Finding]:
    """A warning when every angle that is said to be in degrees would be plausible in radians."""
    angular = [j for j, unit in enumerate(target.units) if unit == "rad"]
    judged = _judged(trajectory)
    if not trajectory.degrees or not angular or not judged.any():
        return
    stated = np.degrees(trajectory.q[judged][:, angular])
    largest, span = float(np.abs(stated).max()), float(np.ptp(stated, axis=0).max())
    if not RESTS < largest < 2 * pi:
        return
    text = (
        f"angles are read as degrees, but none exceeds {largest:.3g} and the whole motion spans "
        f"{span:.2g}°: is the column in radians?"
    )
    yield Finding(level="warning", subject=target.name, text=text)


def _position(trajectory: Trajectory, target: Target, j: int) -> tuple[str, str] | None:
    """Place and text of the worst position beyond a limit of joint ``j``."""
    q = trajectory.q[:, j]
    over = np.where(_judged(trajectory), np.maximum(q - target.upper[j], target.lower[j] - q), -np.inf)
    worst = int(np.argmax(over))
    if not over[worst] > TOLERANCE:
        return None
    low = q[worst] < target.lower[j]
    limit = target.lower[j] if low else target.upper[j]
    unit = target.units[j]
    value, bound = _shown(float(q[worst]), unit), _shown(limit, unit)
    first = int(np.argmax(over > TOLERANCE))
    text = (
        f"joint {target.joints[j]!r} of {target.name!r} at {value}, {'below' if low else 'above'} its limit "
        f"{bound}, at {trajectory.instant(worst):.3f} s (first beyond at {trajectory.instant(first):.3f} s)"
    )
    return trajectory.place(worst), text


def _speed(trajectory: Trajectory, target: Target, slopes: Array, j: int) -> list[Finding]:
    limit = target.velocity[j]
    if limit is None:
        return []
    k = int(np.argmax(np.abs(slopes[:, j])))
    fastest, at = abs(float(slopes[k, j])), trajectory.instant(k)
    if trajectory.qd is not None:
        given = np.where(_judged(trajectory), np.abs(trajectory.qd[:, j]), 0.0)
        i = int(np.argmax(given))
        if given[i] > fastest:
            fastest, at = float(given[i]), trajectory.instant(i)
    if fastest <= limit * (1 + TOLERANCE):
        return []
    per_s = target.units[j] + "/s"
    text = (
        f"joint {target.joints[j]!r} reaches {_shown(fastest, per_s)} at {at:.3f} s, "
        f"beyond its limit {_shown(limit, per_s)}"
    )
    return [Finding(level="warning", subject=target.name, text=text)]


def _wrapped(trajectory: Trajectory, slopes: Array, j: int) -> Problem | None:
    """A jump of about one turn within one short step is an angle folded into ±180°, not a motion."""
    step = np.abs(np.diff(trajectory.q[:, j]))
    turn = np.abs(step - 2 * pi) < 0.2 * pi
    jumps = np.flatnonzero(turn & (np.abs(slopes[:, j]) > 4 * pi))
    if not jumps.size:
        return None
    i = int(jumps[0]) + 1
    before, after = trajectory.q[i - 1, j], trajectory.q[i, j]
    what = f"jumps from {_shown(before, 'rad')} to {_shown(after, 'rad')} in one step: folded into one turn"
    return Problem(trajectory.file, trajectory.place(i), what, "export continuous joint angles")


def larger_velocities(
    trajectory: Trajectory, target: Target, derived: Array
) -> tuple[Array, tuple[Finding, ...]]:
    """The velocity columns after their check; of joints whose columns disagree, at each row the faster.

    Args:
        trajectory: With velocity columns.
        target: The robot it is to drive.
        derived: Velocities from its positions [rad/s or m/s], shape (n, dof).

    Raises:
        InputError: See `velocity_check`.
    """
    assert trajectory.qd is not None
    found = _compared(trajectory, target)
    qd = trajectory.qd.copy()
    for j in found:
        qd[:, j] = np.where(np.abs(derived[:, j]) > np.abs(qd[:, j]), derived[:, j], qd[:, j])
    return qd, tuple(finding for each in found.values() for finding in each)


def velocity_check(trajectory: Trajectory, target: Target) -> tuple[Finding, ...]:
    r"""Whether the velocity columns are the derivative of the position columns.

    Per joint that moves, the regression :math:`r = \sum s\,\bar v h^2 / \sum \bar v^2 h^2` of the slopes
    :math:`s = \Delta q / h` on the mean velocity :math:`\bar v` of each interval is 1 when they agree,
    :math:`\pi/180` when velocities are in deg/s and positions in rad, and so on.

    Returns:
        Warnings where the columns are off by more than `OFF`, and where single intervals disagree by more
        than a tenth of the largest speed.

    Raises:
        InputError: The columns differ by a factor, a sign or altogether; a velocity column that is
            too small would flatter every result.
    """
    return tuple(finding for each in _compared(trajectory, target).values() for finding in each)


def _compared(trajectory: Trajectory, target: Target) -> dict[int, list[Finding]]:
    """Joints whose velocity columns are not quite the derivative of their positions, and what is off."""
    judged = _judged(trajectory)
    if trajectory.qd is None or judged.sum() < 2:
        return {}
    slopes = _slopes(trajectory)
    pairs = judged[1:] & judged[:-1]
    h = np.where(pairs, np.diff(trajectory.t), 0.0)
    means = np.where(pairs[:, None], trajectory.qd[1:] + trajectory.qd[:-1], 0.0) / 2
    problems: list[Problem] = []
    found: dict[int, list[Finding]] = {}

    def say(j: int, text: str) -> None:
        text = f"velocity of {target.joints[j]!r} in the file {text}; the faster of both counts"
        found.setdefault(j, []).append(Finding(level="warning", subject=target.name, text=text))

    for j, joint in enumerate(target.joints):
        q, unit = trajectory.q[judged, j], target.units[j]
        s, v, w = slopes[:, j], means[:, j], h**2
        if np.ptp(q) < MOVES[unit] and np.sum(np.abs(v) * h) < 10 * MOVES[unit]:
            continue
        power_s, power_v, cross = (float(np.sum(w * a * b)) for a, b in ((s, s), (v, v), (s, v)))
        reason = disagreement(power_s, power_v, cross)
        if reason:
            remedy = 'correct the unit or the columns, or set velocities = "derive" to use the positions'
            problems.append(Problem(trajectory.file, f"velocity of {joint!r}", reason, remedy))
            continue
        if abs(cross / power_v - 1) > OFF:
            say(j, f"is {power_v / cross - 1:+.1%} off what positions move at")
        gap = np.abs(s - v)
        worst = int(np.argmax(gap))
        # The median is the noise of positions; a peak far above it is a disagreement.
        if gap[worst] > 0.1 * max(np.abs(s).max(), np.abs(v).max()) + 5 * float(np.median(gap)):
            here, there = _shown(v[worst], unit + "/s"), _shown(s[worst], unit + "/s")
            say(j, f"is {here} at {trajectory.instant(worst):.3f} s where positions move at {there}")
    if problems:
        raise InputError(problems)
    return found


def disagreement(power_s: float, power_v: float, cross: float) -> str:
    """What is wrong between slopes and velocities; empty when they agree.

    Args:
        power_s: Sum of the squares of the slopes.
        power_v: Of the velocities.
        cross: Of their products.
    """
    if power_v <= 1e-9 * power_s:
        return "is zero while the joint moves"
    if power_s <= 1e-9 * power_v:
        return "is not zero while the joint stands still"
    ratio = cross / power_v
    correlation = cross / np.sqrt(power_s * power_v)
    if correlation < -0.9:
        return f"has the opposite sign of the motion (positions move at {ratio:.3g} × the velocity)"
    if abs(correlation) < 0.5:
        return f"does not follow the positions (correlation {correlation:.2f})"
    if 0.8 < ratio < 1.25 or correlation < 0.9:
        return ""
    known = {pi / 180: "deg/s read as rad/s", 180 / pi: "rad/s read as deg/s", 1e-3: "mm/s read as m/s"}
    known[1e3] = "a time or length unit off by 1000"
    for factor, name in known.items():
        if abs(ratio / factor - 1) < 0.2:
            return f"looks like {name}: positions move at {ratio:.4g} × the velocity"
    return f"is off by a factor: positions move at {ratio:.4g} × the velocity"


def sampling_findings(trajectory: Timed, target: str, timeout: float) -> tuple[Finding, ...]:
    """Gaps longer than the time-out, sampling so odd that the time unit is doubtful, a start not at 0."""
    step = np.diff(trajectory.t)
    median, worst = float(np.median(step)), int(np.argmax(step))
    findings = []
    if step[worst] > timeout:
        text = (
            f"gap of {step[worst]:.3g} s after {trajectory.instant(worst):.3f} s is longer than the "
            f"time-out of {timeout:g} s ({int((step > timeout).sum())} such gaps)"
        )
        findings.append(Finding(level="warning", subject=target, text=text))
    if not 2e-4 <= median <= 1.0:
        text = f"samples are {median:.3g} s apart (median): is the time unit right?"
        findings.append(Finding(level="warning", subject=target, text=text))
    start = float(trajectory.t[0])
    if abs(start) >= STARTS:
        text = f"starts at {start:.3f} s on its own clock; shifted to 0 ({trajectory.file})"
        findings.append(Finding(level="note", subject=target, text=text))
    return tuple(findings)


def _shown(value: float, unit: str) -> str:
    """A quantity with its unit; angles in degrees too, as people read them."""
    if unit.startswith("rad"):
        return f"{value:.4g} {unit} ({np.degrees(value):.4g} {unit.replace('rad', 'deg')})"
    return f"{value:.4g} {unit}"
