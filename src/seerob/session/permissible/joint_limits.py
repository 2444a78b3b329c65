"""Speed, acceleration and jerk that each joint may have; none of them is ever invented."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.snapshot import Input, Origin
from seerob.core.transforms import Array
from seerob.model.model import Mechanism, Model

Given = Sequence[float] | float | None
"""One value for all joints, or one for each; None: not given."""


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits of the joints of one robot, all positive and finite, shape (n,) each."""

    joints: tuple[str, ...]
    units: tuple[str, ...]
    """``rad`` or ``m`` per joint."""
    velocity: Array
    """[rad/s or m/s]"""
    acceleration: Array
    """[rad/s² or m/s²]"""
    jerk: Array
    """[rad/s³ or m/s³]"""
    inputs: tuple[Input, ...]
    """These limits as inputs, each with where it is from."""


def limits_of(
    model: Model, robot: Mechanism, *, velocity: Given = None, acceleration: Given = None, jerk: Given = None
) -> JointLimits:
    """Limits of a robot's joints as given, else those of its description and of the workstation file.

    Raises:
        InputError: See `joint_limits`.
    """
    station = model.workstation
    own = next(r for r in station.robots if r.name == robot.name)
    return joint_limits(
        robot,
        velocity=velocity,
        acceleration=own.acceleration_limits if acceleration is None else acceleration,
        jerk=own.jerk_limits if jerk is None else jerk,
        file=next(iter(station.files), "workstation"),
        written=[k for k, given in (("acceleration", acceleration), ("jerk", jerk)) if given is None],
    )


def joint_limits(
    robot: Mechanism,
    *,
    velocity: Given = None,
    acceleration: Given = None,
    jerk: Given = None,
    file: str = "",
    written: Collection[str] = (),
) -> JointLimits:
    """Collect the limits of a robot's joints.

    Args:
        robot: The robot.
        velocity: Instead of its description's [rad/s or m/s].
        acceleration: [rad/s² or m/s²]
        jerk: [rad/s³ or m/s³]
        file: The workstation file, for messages.
        written: Which of ``acceleration`` and ``jerk`` that file gives.

    Raises:
        InputError: A limit that nobody gave, another number of them than joints, or one that is not
            positive; every one of them.
    """
    n = len(robot.joints)
    problems: list[Problem] = []
    inputs: list[Input] = []
    found: list[Array] = []
    kinds = (("velocity", velocity, "s"), ("acceleration", acceleration, "s²"), ("jerk", jerk, "s³"))
    for kind, given, per in kinds:
        values = np.full(n, np.nan)
        if given is not None:
            wrong = list(_wrong(f"{kind}_limits", given, robot, file))
            problems += wrong
            values = values if wrong else np.broadcast_to(np.asarray(given, float), n).copy()
            source = "workstation file" if kind in written else "with the command or the call"
            origins = [(Origin.GIVEN, source)] * n
        elif kind == "velocity":
            stated = robot.velocity_limits
            values = np.array([np.nan if v is None else v.value for v in stated])
            origins = [(Origin.MISSING, "") if v is None else (v.origin, v.source) for v in stated]
        if given is None and not np.isfinite(values).all():
            names = ", ".join(robot.joints[i].name for i in np.flatnonzero(~np.isfinite(values)))
            where = f"robots.{robot.name}.{kind}_limits"
            what = f"nobody gave the {kind} limit of {names}"
            how = "in the workstation file, or with" if kind == "velocity" else "with"
            remedy = f"give one per joint [rad/{per} or m/{per}] {how} --{kind} (no figure is assumed)"
            problems.append(Problem(file or "workstation", where, what, remedy))
        else:
            inputs += [
                Input(
                    name=f"{kind} limit of {j.name}", value=float(v), unit=f"{u}/{per}", origin=o, source=src
                )
                for j, v, u, (o, src) in zip(robot.joints, values, robot.units, origins, strict=True)
            ]
        found.append(values)
    if problems:
        raise InputError(problems)
    joints = tuple(j.name for j in robot.joints)
    return JointLimits(joints, robot.units, found[0], found[1], found[2], tuple(inputs))


def _wrong(key: str, given: Sequence[float] | float, robot: Mechanism, file: str) -> Iterator[Problem]:
    values = np.atleast_1d(np.asarray(given, float))
    where = f"robots.{robot.name}.{key}"
    if values.ndim != 1 or len(values) not in (1, len(robot.joints)):
        what = f"{values.size} values for {len(robot.joints)} joints"
        yield Problem(file or "workstation", where, what, "give one for all joints, or one for each")
    elif not (np.isfinite(values).all() and (values > 0).all()):
        yield Problem(file or "workstation", where, f"{values.tolist()}", "every limit is a number above 0")
