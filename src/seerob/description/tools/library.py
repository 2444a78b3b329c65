"""The library of tools: common grippers by an envelope over their stroke, with published masses and tips.

A tool is one TOML file beside this module; its name there is its name in ``library:<name>``. Its frame lies
on the flange, z away from the robot. Pieces of its envelope are those of the robot library. What a file does
not say is unknown and stays so.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from seerob.core.errors import UnknownName
from seerob.core.shapes import Mesh, Solid
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array, rotation_from_rpy, transform
from seerob.description.description import Inertial
from seerob.description.robots.library import NOTE, shapes_for
from seerob.description.shapes import mass_properties


@dataclass(frozen=True, eq=False)
class LibraryTool:
    """A tool of the library, in its own frame."""

    title: str
    maker: str
    solids: tuple[Solid, ...]
    visual: tuple[Mesh, ...]
    inertial: Inertial | None
    """None where no mass is published; where a mass alone is, anywhere in the envelope."""
    tcp: Array | None
    """Its working point, shape (4, 4) [m]; None where no source says one."""
    findings: tuple[Finding, ...]
    content: bytes
    """Its file."""


def names() -> tuple[str, ...]:
    """Names of the tools in the library, sorted."""
    files = resources.files(__package__).iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml")))


@cache
def load(tool: str) -> LibraryTool:
    """A tool of the library, which nobody changes.

    Raises:
        UnknownName: The library has no such tool.
    """
    if tool not in names():
        raise UnknownName("tool in the library", tool, names())
    content = (resources.files(__package__) / f"{tool}.toml").read_bytes()
    table = tomllib.loads(content.decode())
    solids, visual = shapes_for(table["envelope"])
    findings = [
        Finding(level=entry["level"], subject=tool, text=entry["text"]) for entry in table.get("findings", ())
    ]
    text = f"{NOTE}: {table['geometry']['source']}"
    findings.append(Finding(level="warning", subject=tool, text=text))
    tip = table.get("tcp")
    return LibraryTool(
        table["title"],
        table["maker"],
        solids,
        visual,
        _inertial(table["inertial"], solids, tool) if "inertial" in table else None,
        None if tip is None else transform(rotation_from_rpy(tip["rpy"]), tip["position"]),
        tuple(findings),
        content,
    )


def _inertial(table: dict[str, Any], solids: tuple[Solid, ...], tool: str) -> Inertial:
    origin, source, mass = Origin(table["origin"]), table["source"], float(table["mass"])
    meshes = [solid.mesh for solid in solids if solid.mesh is not None]
    spread, _ = mass_properties.from_shape(meshes, mass=mass, subject=tool)
    if "inertia" in table:
        xx, yy, zz, xy, xz, yz = table["inertia"]
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], float)
        return Inertial(mass, np.array(table["com"], float), inertia, origin, source)
    # Who gives a mass instead is not told of these: a file says itself what its source has not.
    points = np.vstack([mesh.vertices for mesh in meshes])
    if "com" in table:
        inertial = mass_properties.about_its_centre(spread, table["com"], points, 0.0)
    else:
        inertial = mass_properties.anywhere(spread, points, 0.0)
    return replace(inertial, origin=origin, source=f"{source}; anyhow in the envelope")
