"""The robot library: figures of common cobots, each with its source; geometry is an envelope made here.

A robot is one TOML file in ``robots/``; its name there is its name in ``library:<name>``. Each link carries
the joint to its parent. What a file does not say is unknown and stays so: of a link with a mass but without
``com`` and ``inertia`` the mass may be anywhere within its envelope, and ``error`` of ``[inertials]`` is the
share by which masses may be off.

An envelope is made of convex pieces that contain the maker's shape. A piece is a ``box = [[min], [max]]``, a
``tube = [[start], [end]]`` with a ``radius``, or a ``slot = [[[start], [end]], [[start], [end]]]`` with two
radii, the convex hull of two parallel tubes; all in metres in the link's frame. Distances see the box, the
16-sided prism around the tube, or the hull of two prisms; the screen sees a rounded body that never leaves
it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from seerob.core import quantities, transforms
from seerob.core.errors import UnknownName
from seerob.core.shapes import Mesh, Solid
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array
from seerob.description import lint
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, Quantity
from seerob.description.robots import library_names
from seerob.description.shapes import mass_properties, moments, shapes

NOTE = "envelope made by seerob, not the maker's mesh"

COLORS: Mapping[str, shapes.Color] = {
    "grey": (0.78, 0.80, 0.82, 1.0),
    "blue": (0.42, 0.62, 0.80, 1.0),
    "dark": (0.33, 0.35, 0.38, 1.0),
    "orange": (0.93, 0.50, 0.16, 1.0),
}
CAP = 0.14
"""Length of a coloured cap, relative to that of its tube."""
ROUNDING = 0.25
"""Radius of a rounded rim, relative to that of its tube."""


def shapes_for(pieces: Sequence[Mapping[str, Any]]) -> tuple[tuple[Solid, ...], tuple[Mesh, ...]]:
    """Solids and display meshes of a link's pieces."""
    solids = tuple(
        Solid(mesh=outer(piece), name=f"envelope_{i}", note=NOTE) for i, piece in enumerate(pieces)
    )
    return solids, tuple(mesh for piece in pieces for mesh in look(piece))


def outer(piece: Mapping[str, Any]) -> Mesh:
    """The convex mesh of a piece that distances see."""
    if "tube" in piece:
        start, end = piece["tube"]
        return shapes.prism_mesh(start, end, float(piece["radius"]))
    if "slot" in piece:
        tubes = zip(piece["slot"], piece["radius"], strict=True)
        return shapes.hull_mesh([shapes.prism_mesh(start, end, radius) for (start, end), radius in tubes])
    lower, upper = piece["box"]
    return shapes.box_mesh(lower, upper)


def look(piece: Mapping[str, Any]) -> list[Mesh]:
    """What the screen shows of a piece: inside its outer mesh, rounded, with coloured caps where asked."""
    color = COLORS[piece.get("color", "grey")]
    if "tube" in piece:
        start, end = (np.array(p, float) for p in piece["tube"])
        radius, length = float(piece["radius"]), float(np.linalg.norm(end - start))
        profile = shapes.rounded_profile(radius, length, ROUNDING * radius)
        if "caps" not in piece:
            return [shapes.lathe_mesh(start, end, profile, sides=48, color=color)]
        cap = COLORS[piece["caps"]]
        low, middle, high = _in_three(profile, max(CAP * length, 1.01 * profile[len(profile) // 2 - 1][1]))
        parts = ((low, cap), (middle, color), (high, cap))
        return [shapes.lathe_mesh(start, end, part, sides=48, color=c) for part, c in parts]
    if "slot" in piece:
        tubes = zip(piece["slot"], piece["radius"], strict=True)
        return [shapes.hull_mesh([look({"tube": tube, "radius": r})[0] for tube, r in tubes], color)]
    lower, upper = (np.array(p, float) for p in piece["box"])
    return [_rounded_in_box(lower, upper, color)]


def _in_three(profile: list[tuple[float, float]], cap: float) -> tuple[list[tuple[float, float]], ...]:
    """A symmetric profile cut at ``cap`` [m] from both ends, or in the middle when it is too short."""
    half = len(profile) // 2
    radius, length = profile[half - 1][0], profile[-1][1]
    cap = min(cap, 0.45 * length)
    low = [point for point in profile[:half] if point[1] < cap] + [(radius, cap)]
    high = [(radius, length - cap)] + [point for point in profile[half:] if point[1] > length - cap]
    return low, [(radius, cap), (radius, length - cap)], high


def _rounded_in_box(lower: Array, upper: Array, color: shapes.Color) -> Mesh:
    """A box with rounded corners that touches all sides of the given one."""
    size = upper - lower
    axis = int(size.argmin())
    corner = 0.35 * float(np.delete(size, axis).min())
    profile = shapes.rounded_profile(corner, float(size[axis]), ROUNDING * corner)
    inset = np.full(3, corner)
    inset[axis] = 0.0
    tubes = []
    for bits in range(4):
        start = lower + inset
        for bit, side in enumerate(np.delete(np.arange(3), axis)):
            if bits >> bit & 1:
                start[side] = upper[side] - corner
        end = start.copy()
        end[axis] = upper[axis]
        tubes.append(shapes.lathe_mesh(start, end, profile, sides=32))
    return shapes.hull_mesh(tubes, color)


Table = Mapping[str, Any]
names = library_names.names


@dataclass(frozen=True)
class Entry:
    """What the library says of a robot besides its links."""

    title: str
    maker: str
    payload: Quantity | None
    """Rated [kg]; None when no source was read."""
    reach: Quantity | None
    """Its maker's figure [m]; None when no source was read."""


def entry(robot: str) -> Entry:
    """What the library says of a robot besides its links.

    Args:
        robot: One of `names`.
    """
    _, table, _ = _read(robot)

    def quantity(key: str) -> Quantity | None:
        if key not in table:
            return None
        block = table[key]
        return Quantity(float(block["value"]), Origin(block["origin"]), block["source"])

    return Entry(table["title"], table["maker"], quantity("payload"), quantity("reach"))


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
        suffixed = quantities.split(key)
        if suffixed is None:
            result[key] = _si(value) if isinstance(value, dict) else value
        else:
            stem, _, factor = suffixed
            result[stem] = [v * factor for v in value] if isinstance(value, list) else value * factor
    return result


def _link(entry: Table, robot: Table) -> Link:
    solids, visual = shapes_for(entry.get("envelope", ()))
    return Link(
        name=entry["name"],
        parent=entry.get("parent"),
        parent_from_link=transforms.transform(
            transforms.rotation_from_rpy(entry.get("rpy", (0, 0, 0))), entry.get("xyz", (0, 0, 0))
        ),
        joints=(_joint(entry["joint"], robot),) if "joint" in entry else (),
        inertial=_inertial(entry, robot["inertials"], solids) if "mass" in entry else None,
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


def _inertial(entry: Table, block: Table, solids: Sequence[Solid]) -> Inertial:
    """What a link weighs; where only its mass is known, as if its shape were of one density, and bounded."""
    mass, origin, source = entry["mass"], Origin(block["origin"]), block["source"]
    error = float(block.get("error", 0.0))
    if "inertia" not in entry:
        known = moments.combined(map(moments.of_solid, solids))
        found = known.inertial(mass=float(mass), origin=origin, source=source, error=error)
        corners = np.vstack([solid.mesh.vertices for solid in solids if solid.mesh is not None])
        return mass_properties.anywhere(found, corners, 0.0)
    xx, yy, zz, xy, xz, yz = entry["inertia"]
    return Inertial(
        mass=float(mass),
        com=np.array(entry["com"], float),
        inertia=np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], float),
        origin=origin,
        source=source,
        error=error,
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
        found.append(Finding(level="warning", subject=name, text=NOTE + ": " + table["geometry"]["source"]))
    if any(joint.armature is None for link in links for joint in link.joints):
        found.append(Finding(level="assumed", subject=name, text=lint.ROTOR))
    return found
