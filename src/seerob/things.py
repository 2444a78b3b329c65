"""Tools, workpieces and parts: from a table of the file to named pieces with shape and mass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from seerob.geometry import Mesh, Solid, capsule
from seerob.model_io import detail, mass_properties, shapes
from seerob.model_io.description import Inertial
from seerob.model_io.mesh import load_meshes
from seerob.snapshot import Finding, Origin
from seerob.transforms import Array
from seerob.workstation import Body as BodyTable
from seerob.workstation import Shape, Thing

Color = tuple[float, float, float, float]
TOOL_COLOR: Color = (0.33, 0.38, 0.45, 1.0)
WORKPIECE_COLOR: Color = (0.80, 0.62, 0.36, 1.0)
PART_COLOR: Color = (0.55, 0.58, 0.62, 1.0)
AREA_COLOR: Color = (0.99, 0.92, 0.57, 0.25)

CYLINDER_SIDES = 96


@dataclass(frozen=True, eq=False)
class Piece:
    """One rigid piece of a thing, in the thing's frame."""

    name: str
    """Empty for a thing of one piece, else the mesh's name in the file."""
    visual: tuple[Mesh, ...]
    solids: tuple[Solid, ...]


@dataclass(frozen=True, eq=False)
class LoadedThing:
    """A thing that has been read."""

    pieces: tuple[Piece, ...]
    inertial: Inertial | None
    """Of all pieces together, in the thing's frame; None when nobody gave a mass or a density."""
    findings: tuple[Finding, ...]
    files: dict[str, bytes]


def load_thing(thing: Thing, folder: Path, color: Color, *, needs_mass: bool) -> LoadedThing:
    """Read a tool, a workpiece or a part.

    Args:
        thing: Its table.
        folder: What its mesh path is relative to.
        color: For what has no colour of its own.
        needs_mass: Whether it moves, so that a mass from the shape is worth computing.

    Raises:
        InputError: The mesh cannot be read, or a mass was asked for that the shape cannot give.
    """
    if thing.color is not None:
        color = (*thing.color, 1.0)
    findings: tuple[Finding, ...] = ()
    files: dict[str, bytes] = {}
    if thing.mesh is not None:
        path = folder / thing.mesh
        loaded = load_meshes(path, units=thing.units, up=thing.up)
        findings = tuple(replace_subject(f, thing.name) for f in loaded.findings)
        files = loaded.files
        single = len(loaded.meshes) == 1
        own_color = thing.color is not None
        meshes = [
            (m.name, Mesh(m.mesh.vertices, m.mesh.faces, color) if own_color else m.mesh)
            for m in loaded.meshes
        ]
        pieces = tuple(_piece("" if single else name, mesh) for name, mesh in meshes)
        source = f"shape of {thing.mesh}"
        whole = [mesh for _, mesh in meshes]
    else:
        assert thing.shape is not None
        piece, whole = _simple(thing.shape, color)
        pieces, source = (piece,), "shape in the workstation file"
    inertial = None
    if needs_mass and (thing.mass is not None or thing.density is not None):
        inertial, more = _inertial(thing, whole, source)
        findings += more
    return LoadedThing(pieces, inertial, findings, files)


def replace_subject(finding: Finding, subject: str) -> Finding:
    """The same finding about another subject."""
    return Finding(level=finding.level, subject=subject, text=finding.text)


def _piece(name: str, mesh: Mesh) -> Piece:
    display = detail.display_mesh(mesh)
    return Piece(name, (display,), (Solid(mesh=detail.physics_mesh(mesh), name=name),))


def _simple(shape: Shape, color: Color) -> tuple[Piece, list[Mesh]]:
    if shape.sphere is not None:
        solid = capsule(np.zeros(3), np.zeros(3), shape.sphere)
        from seerob.model_io.glb import solid_mesh

        mesh = solid_mesh(solid, color=color)
        return Piece("", (mesh,), (solid,)), [mesh]
    if shape.box is not None:
        half = np.array(shape.box) / 2
        mesh = shapes.box_mesh(-half, half, color=color)
        return Piece("", (mesh,), (Solid(mesh=mesh),)), [mesh]
    assert shape.cylinder is not None
    radius, height = shape.cylinder
    ends = np.array([[0, 0, -height / 2], [0, 0, height / 2]])
    # Corners outside the circle, sides on it: never nearer to the person than it looks.
    outer = radius / np.cos(np.pi / CYLINDER_SIDES)
    mesh = shapes.cylinder_mesh(ends[0], ends[1], outer, sides=CYLINDER_SIDES, color=color)
    note = f"prism around the cylinder, at most {(outer - radius) * 1e3:.2f} mm larger"
    return Piece("", (mesh,), (Solid(mesh=mesh, note=note),)), [mesh]


def _inertial(thing: Thing, meshes: list[Mesh], source: str) -> tuple[Inertial, tuple[Finding, ...]]:
    if thing.mass is not None and thing.com is not None and thing.inertia is not None:
        return by_hand(thing.mass, thing.com, thing.inertia, "workstation file"), ()
    if thing.shape is not None and thing.shape.sphere is not None:
        radius = thing.shape.sphere
        volume = 4 / 3 * np.pi * radius**3
        mass = thing.mass if thing.mass is not None else float(volume * (thing.density or 0.0))
        inertial = Inertial(
            mass, np.zeros(3), np.eye(3) * 0.4 * mass * radius**2, Origin.GIVEN, f"sphere, {source}"
        )
        findings: tuple[Finding, ...] = ()
    else:
        inertial, findings = mass_properties.from_shape(
            meshes, density=thing.density, mass=thing.mass, subject=thing.name
        )
    if thing.com is not None:
        inertial = replace(inertial, com=np.array(thing.com, float))
    if thing.mass is not None:
        # The mass itself was given; only how it is spread follows from the shape.
        inertial = replace(inertial, origin=Origin.GIVEN, error=0.0, source=f"workstation file; {source}")
    return inertial, findings


def by_hand(
    mass: float,
    com: tuple[float, float, float],
    inertia: tuple[float, float, float, float, float, float],
    source: str,
) -> Inertial:
    """Mass properties that the user wrote: kg, m, kg·m² as ixx, iyy, izz, ixy, ixz, iyz."""
    return Inertial(mass, np.array(com, float), symmetric(inertia), Origin.GIVEN, source)


def symmetric(six: tuple[float, float, float, float, float, float]) -> Array:
    """Matrix (3, 3) of ixx, iyy, izz, ixy, ixz, iyz."""
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def link_by_hand(table: BodyTable, solids: tuple[Solid, ...], subject: str) -> Inertial:
    """Mass properties of a link from its table; what the table leaves out follows from the shape.

    Raises:
        InputError: Something was left out and the link has no shape to compute it from.
    """
    if table.com is not None and table.inertia is not None:
        return by_hand(table.mass, table.com, table.inertia, table.source)
    from seerob.errors import InputError
    from seerob.model_io.glb import solid_mesh

    if not solids:
        raise InputError.at(subject, "masses", "has no shape to compute com and inertia from", "give both")
    inertial, _ = mass_properties.from_shape(
        [s.mesh if s.mesh is not None else solid_mesh(s) for s in solids], mass=table.mass, subject=subject
    )
    com = inertial.com if table.com is None else np.array(table.com, float)
    inertia = inertial.inertia if table.inertia is None else symmetric(table.inertia)
    return Inertial(table.mass, com, inertia, Origin.GIVEN, f"{table.source}; rest from the shape")
