"""The robot library: figures of common cobots, each with its source; geometry is an envelope made here.

A robot is one TOML file in ``robots/``; its name there is its name in ``library:<name>``. Each link
carries the joint to its parent. What a file does not say is unknown and stays so.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from seerob.core import transforms, units
from seerob.core.errors import UnknownName
from seerob.core.snapshot import Finding, Origin
from seerob.description import lint
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, Quantity
from seerob.description.robots import envelope

Table = Mapping[str, Any]


def names() -> tuple[str, ...]:
    """Names of the robots in the library, sorted."""
    files = resources.files(__package__).iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml")))


def load(robot: str, *, name: str | None = None) -> Description:
    """A robot of the library.

    Args:
        robot: One of `names`.
        name: Name of the description; ``robot`` when not given.

    Raises:
        UnknownName: The library has no such robot.
    """
    if robot not in names():
        raise UnknownName("robot in the library", robot, names())
    content, table, links = _read(robot)
    name = name or robot
    return Description(
        name=name,
        links=links,
        tip=table["tip"],
        source=f"library:{robot} ({table['kinematics']['source']})",
        findings=tuple(_findings(name, table, links)),
        files={f"library/{robot}.toml": content},
    )


@cache
def _read(robot: str) -> tuple[bytes, Table, tuple[Link, ...]]:
    """File, table and links, which nobody changes: the same for each cell that has the robot."""
    content = (resources.files(__package__) / f"{robot}.toml").read_bytes()
    table = tomllib.loads(content.decode())
    return content, table, tuple(_link(_si(entry), table) for entry in table["links"])


def _si(table: Table) -> dict[str, Any]:
    """The table with ``rpy_deg`` and the like converted to SI under their plain names."""
    result: dict[str, Any] = {}
    for key, value in table.items():
        suffixed = units.split(key)
        if suffixed is None:
            result[key] = _si(value) if isinstance(value, dict) else value
        else:
            stem, _, factor = suffixed
            result[stem] = [v * factor for v in value] if isinstance(value, list) else value * factor
    return result


def _link(entry: Table, robot: Table) -> Link:
    solids, visual = envelope.shapes_for(entry.get("envelope", ()))
    return Link(
        name=entry["name"],
        parent=entry.get("parent"),
        parent_from_link=transforms.transform(
            transforms.rotation_from_rpy(entry.get("rpy", (0, 0, 0))), entry.get("xyz", (0, 0, 0))
        ),
        joints=(_joint(entry["joint"], robot),) if "joint" in entry else (),
        inertial=_inertial(entry, robot["inertials"]) if "mass" in entry else None,
        visual=visual,
        solids=solids,
    )


def _joint(entry: Table, robot: Table) -> Joint:
    def quantity(key: str) -> Quantity | None:
        if key not in entry:
            return None
        return Quantity(float(entry[key]), Origin(robot[key]["origin"]), robot[key]["source"])

    return Joint(
        name=entry["name"],
        kind=JointKind(entry["kind"]),
        axis=np.array(entry["axis"], float),
        lower=entry.get("lower"),
        upper=entry.get("upper"),
        velocity=quantity("velocity"),
        effort=quantity("effort"),
    )


def _inertial(entry: Table, block: Table) -> Inertial:
    xx, yy, zz, xy, xz, yz = entry["inertia"]
    return Inertial(
        mass=float(entry["mass"]),
        com=np.array(entry["com"], float),
        inertia=np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], float),
        origin=Origin(block["origin"]),
        source=block["source"],
    )


def _findings(name: str, table: Table, links: tuple[Link, ...]) -> list[Finding]:
    found = [
        Finding(
            level=entry["level"],
            subject=f"{name}/{entry['subject']}" if "subject" in entry else name,
            text=entry["text"],
        )
        for entry in table.get("findings", ())
    ]
    if any(link.solids for link in links):
        found.append(
            Finding(level="warning", subject=name, text=envelope.NOTE + ": " + table["geometry"]["source"])
        )
    if any(joint.armature is None for link in links for joint in link.joints):
        found.append(Finding(level="assumed", subject=name, text=lint.ROTOR))
    return found
