"""A robot's description with what the workstation file says instead.

The body of a person as the workstation file describes it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array
from seerob.description.description import Description, Joint, JointKind, Quantity
from seerob.description.humans import manikin
from seerob.description.humans.anthropometry import Body, body, stature_given
from seerob.model.mounting.things import overridden_link
from seerob.workstation.workstation import Human, Robot

SLIPS = (
    "follow = task with contacts: hands that are pushed against something hard may slip through it; "
    "follow = posture holds there"
)


def describe(human: Human, *, touches: bool) -> tuple[Description, tuple[Finding, ...]]:
    """Tree of bones and joints, and what is to be said of it beside its own findings.

    Args:
        human: The table of the file.
        touches: Whether the file asks for contacts.

    Raises:
        InputError: A value is not a plausible adult's, or not known.
    """
    stature, findings = stature_given(human.stature, human.sex, name=human.name)
    if touches and human.follow == "task":
        findings = (*findings, Finding(level="warning", subject=human.name, text=SLIPS))
    description = manikin.build(
        name=human.name,
        stature=stature,
        mass=human.mass,
        sex=human.sex,
        lengths=human.lengths if isinstance(human.lengths, str) else "drillis",
        masses=human.masses if isinstance(human.masses, str) else "deleva",
        own_lengths=None if isinstance(human.lengths, str) else human.lengths,
        own_masses=None if isinstance(human.masses, str) else human.masses,
        hand=human.hand,
        adult=human.adult,
    )
    return description, findings


def size(human: Human) -> Body:
    """Lengths of the person."""
    return body(
        name=human.name,
        stature=stature_given(human.stature, human.sex, name=human.name)[0],
        mass=human.mass,
        sex=human.sex,
        lengths=human.lengths if isinstance(human.lengths, str) else "drillis",
        own_lengths=None if isinstance(human.lengths, str) else human.lengths,
        adult=human.adult,
    )


ROUNDING = 1e-6
"""Beyond a limit by less than this is the rounding of a printed number [rad or m]."""


def overridden(description: Description, robot: Robot, file: str) -> Description:
    """The description with the rotor inertias, limits and masses that a robot's table gives.

    Args:
        description: As read.
        robot: Its table.
        file: The workstation file, for messages.

    Raises:
        InputError: A value per joint is missing or negative, or a link does not exist.
    """
    names = [joint.name for joint in description.joints()]
    changes: dict[str, dict[str, Any]] = {name: {} for name in names}
    for table, key, values in (
        ("rotor_inertia", "armature", robot.rotor_inertia),
        ("torque_limits", "effort", robot.torque_limits),
        ("velocity_limits", "velocity", robot.velocity_limits),
    ):
        if values is not None:
            _check(table, values, names, file)
            for name, value in zip(names, values, strict=True):
                changes[name][key] = Quantity(float(value), Origin.GIVEN, "workstation file")
    for table, values in (
        ("acceleration_limits", robot.acceleration_limits),
        ("jerk_limits", robot.jerk_limits),
    ):
        # One for all joints will do: they are read where motions are timed, not by the model.
        if values is not None and (len(values) not in (1, len(names)) or min(values) <= 0):
            what = f"{list(values)} does not fit"
            remedy = f"give one value above 0, or one for each of {', '.join(names)}"
            raise InputError.at(file, table, what, remedy)
    known = {link.name for link in description.links}
    for name in robot.masses:
        if name not in known:
            wrong = UnknownName(f"link of {robot.name}", name, known)
            raise InputError.at(file, f"masses.{name}", str(wrong))
    links = []
    problems: list[Problem] = []
    findings = list(description.findings)
    for link in description.links:
        joints = tuple(replace(j, **changes[j.name]) if changes.get(j.name) else j for j in link.joints)
        inertial, refused, impossible = link.inertial, link.refused_mass, link.impossible_mass
        if link.name in robot.masses:
            refused, impossible = "", None
            try:
                inertial, more = overridden_link(
                    robot.masses[link.name],
                    link,
                    robot=robot.name,
                    file=file,
                    com_tolerance=robot.com_tolerance or 0.0,
                )
                findings += more
            except InputError as error:
                problems += error.problems
        links.append(
            replace(link, joints=joints, inertial=inertial, refused_mass=refused, impossible_mass=impossible)
        )
    if problems:
        raise InputError(problems)
    return replace(description, links=tuple(links), findings=tuple(findings))


def home(description: Description, robot: Robot, file: str) -> Array:
    """Where a robot stands when nothing drives it, shape (n,) [rad or m]; zeros when its table is silent.

    Args:
        description: With n joints.
        robot: Its table.
        file: The workstation file, for messages.

    Raises:
        InputError: Another number of values than joints, or values beyond position limits.
    """
    joints = description.joints()
    if robot.q is None:
        return np.zeros(len(joints))
    if len(robot.q) != len(joints):
        remedy = f"{robot.name} has {len(joints)} joints: give {len(joints)}"
        raise InputError.at(file, "q", f"{len(robot.q)} values", remedy)
    beyond = [_beyond(joint, value, file) for joint, value in zip(joints, robot.q, strict=True)]
    if any(beyond):
        raise InputError(filter(None, beyond))
    return np.array(robot.q, float)


def _beyond(joint: Joint, value: float, file: str) -> Problem | None:
    low = -np.inf if joint.lower is None else joint.lower
    high = np.inf if joint.upper is None else joint.upper
    if low - ROUNDING <= value <= high + ROUNDING:
        return None
    side, limit = ("below", low) if value < low else ("above", high)
    what = f"joint {joint.name!r} at {_shown(value, joint)}, {side} its limit {_shown(limit, joint)}"
    turning = joint.kind is JointKind.REVOLUTE
    return Problem(
        file,
        "q",
        what,
        f"give {_shown(low, joint)} to {_shown(high, joint)}"
        + ("; degrees go into q_deg" if turning else ""),
    )


def _shown(value: float, joint: Joint) -> str:
    if joint.kind is JointKind.REVOLUTE:
        return f"{value:.4g} rad ({np.degrees(value):.1f}°)"
    return f"{value:.4g} m"


def _check(table: str, values: Sequence[float], names: Sequence[str], file: str) -> None:
    if len(values) != len(names) or min(values) < 0:
        remedy = f"give one value of 0 or more for each of {', '.join(names)}"
        raise InputError.at(file, table, f"{list(values)} does not fit", remedy)
