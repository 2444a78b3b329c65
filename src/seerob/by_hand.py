"""A robot's description with what the workstation file says instead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from seerob.errors import InputError, UnknownName
from seerob.model_io.description import Description, Quantity
from seerob.snapshot import Origin
from seerob.things import link_by_hand
from seerob.workstation import Robot


def by_hand(description: Description, robot: Robot, file: str) -> Description:
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
    known = {link.name for link in description.links}
    for name in robot.masses:
        if name not in known:
            wrong = UnknownName(f"link of {robot.name}", name, known)
            raise InputError.at(file, f"masses.{name}", str(wrong))
    links = []
    for link in description.links:
        joints = tuple(replace(j, **changes[j.name]) if changes.get(j.name) else j for j in link.joints)
        inertial = link.inertial
        if link.name in robot.masses:
            inertial = link_by_hand(robot.masses[link.name], link.solids, f"{robot.name}/{link.name}")
        links.append(replace(link, joints=joints, inertial=inertial))
    return replace(description, links=tuple(links))


def _check(table: str, values: Sequence[float], names: Sequence[str], file: str) -> None:
    if len(values) != len(names) or min(values) < 0:
        remedy = f"give one value of 0 or more for each of {', '.join(names)}"
        raise InputError.at(file, table, f"{list(values)} does not fit", remedy)
