"""The files of a workstation folder that an assembly becomes: parts with places, meshes, and the table."""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from seerob.core.errors import InputError
from seerob.core.files import bounded
from seerob.core.printable import printable
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array, wxyz_from_rotation
from seerob.description.cad.assembly import ASKED, NOTHING, Assembly, Instance, Moving, Shape
from seerob.description.cad.materials import Material, material
from seerob.description.cad.names import plain_name, told_apart
from seerob.description.description import Inertial
from seerob.description.formats.urdf_writing import written
from seerob.description.mesh_files import Color
from seerob.description.shapes.glb import glb_y_up
from seerob.description.shapes.mass_properties import from_shape
from seerob.description.shapes.mesh_bodies import is_closed, joined
from seerob.description.shapes.mesh_mending import sided
from seerob.description.shapes.moments import signed_volume
from seerob.files.tables.mapping import toml_value
from seerob.workstation.editing import literal

TABLE = "import.json"
"""What was found, mended, guessed and left out, beside the workstation file."""
LARGEST_TABLE = 1 << 20
"""Of densities [byte]."""
GRID = 8
"""Decimals of a coordinate [m] that are kept: what differs by less is one corner."""
INTEGRATED = 1e-6
"""Share of a mass, by integration, that is not written as a tolerance."""
NEGLIGIBLE = 1e-6
"""Deviations up to this are not written [m]; meshes are simplified by as much when they are read."""


LIBRARY = "library"
"""Instead of a density: those of materials that come with seerob."""


@dataclass(frozen=True, eq=False)
class Densities:
    """Densities that the user gave [kg/m³], before those that the file states, and those of the library."""

    of_all: float | None = None
    by_material: dict[str, float] = field(default_factory=dict)
    library: bool = False
    """Whether those of `seerob.description.cad.materials` count."""

    def of(self, shape: Shape) -> float | None:
        """Density of a shape; None when nobody gave it, nor does its file state it."""
        of_all = shape.density if self.of_all is None else self.of_all
        stated = self.by_material.get(shape.material, of_all)
        known = self.known(shape) if stated is None else None
        return stated if known is None else known.density

    def known(self, shape: Shape) -> Material | None:
        """What the library knows of a shape's material, where nobody states its density."""
        if not self.library or self.of_all is not None or shape.density is not None:
            return None
        return None if shape.material in self.by_material else material(shape.material)

    def weighed(self, shape: Shape) -> Inertial | None:
        """Mass properties of a shape: of its solids as the file has them, else of their triangles.

        None where nobody gave its density, or the triangles enclose no volume that is known.
        """
        density = self.of(shape)
        if density is None:
            return None
        known = self.known(shape)
        off = 0.0 if known is None else known.tolerance
        if shape.solid is not None:
            source = f"{density:g} kg/m³ × volume of the solids in the file"
            mass = density * shape.solid.volume
            return shape.solid.inertial(mass=mass, origin=Origin.ESTIMATED, source=source, error=off)
        try:
            found, _ = from_shape(
                shape.pieces, density=density, deviation=shape.deviation, subject=shape.name
            )
        except InputError:
            return None
        spread = (1 + found.spread_error) * (1 + off) - 1 if found.spread_error else 0.0
        return replace(found, error=(1 + found.error) * (1 + off) - 1, spread_error=spread)


@dataclass(frozen=True, eq=False)
class Files:
    """What is written."""

    texts: dict[str, str]
    meshes: dict[str, bytes]
    parts: tuple[dict[str, Any], ...]
    """Rows of the table: one for each part."""
    findings: tuple[Finding, ...]
    robots: tuple[dict[str, Any], ...] = ()
    """Rows of the table: one for each mechanism."""
    missing: tuple[dict[str, Any], ...] = ()
    """What the workstation file says is not in it: everything that became no part, by request or not."""

    def rows(self) -> dict[str, tuple[dict[str, Any], ...]]:
        """Rows by the table of the workstation file that they are written to."""
        return {"parts": self.parts, "robots": self.robots, "left_out": self.missing}


def files(
    assembly: Assembly,
    source: Path,
    densities: Densities,
    *,
    options: Mapping[str, Any],
    taken: Collection[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Files:
    """Content of each file of the folder by its name.

    Args:
        assembly: With rigid places.
        source: The CAD file.
        densities: For the masses.
        options: Of the command, for the next revision.
        taken: Names of mesh files that are the user's.
        progress: Told how far it is.
    """
    findings = list(assembly.findings)
    names = _mesh_names(assembly.shapes, taken)
    meshes, facts = {}, []
    for number, (shape, name) in enumerate(zip(assembly.shapes, names, strict=True)):
        progress(f"making meshes: {number} of {len(names)}")
        meshes[name], known = _measured(shape, findings)
        facts.append(known)
    parts: list[dict[str, Any]] = []
    weighed: dict[int, Inertial | None] = {}
    for full, instance in zip(assembly.names(), assembly.instances, strict=True):
        shape = assembly.shapes[instance.shape]
        density = densities.of(shape)
        row = {
            "name": full,
            "in_file": "/".join(instance.path),
            "product": shape.name,
            "mesh": names[instance.shape],
            **facts[instance.shape],
            "material": shape.material,
            "density": density,
            "box": _box(shape, instance),
            "world": instance.world_from_shape,
        }
        if instance.shape not in weighed:
            weighed[instance.shape] = densities.weighed(shape)
        inertial = weighed[instance.shape] if density is not None else instance.inertial
        family = densities.known(shape)
        row["mass"] = None if inertial is None else _number(inertial.mass, 12)
        row["mass_error"] = None if inertial is None else inertial.error
        row["written"] = part_values(row, instance.color)
        if family is not None:
            row["written"]["density_tolerance"] = _share(family.tolerance)
        if family is not None:
            text = (
                f"{printable(shape.material)[:200]} is taken for {family.name}, "
                f"{family.low:g} to {family.high:g} kg/m³ ({family.source})"
            )
            if all(finding.text != text for finding in findings):
                findings.append(Finding(level="assumed", subject=source.name, text=text))
        if options.get("triangles"):
            row["written"]["triangles"] = options["triangles"]
        # Where triangles are not the surface, the mass is that of the solid, which they do not tell.
        better = shape.solid is not None and shape.deviation > NEGLIGIBLE
        if inertial is not None and (density is None or better):
            row["written"].pop("density", None)
            row["written"].pop("density_tolerance", None)
            row["written"] |= _stated_mass(inertial)
        del row["world"]
        parts.append(row)
    robots = [
        _robot(moving, name, meshes)
        for moving, name in zip(assembly.mechanisms, _robot_names(assembly), strict=True)
    ]
    unknown = sorted(set(densities.by_material) - {shape.material for shape in assembly.shapes})
    if unknown:
        text = f"no part is of {', '.join(unknown)}: its density is not used"
        findings.append(Finding(level="warning", subject=source.name, text=text))
    missing = tuple(left_out_rows(assembly.left_out))
    table = {
        "file": source.name,
        "sha256": hashlib.sha256(assembly.files[source.name]).hexdigest(),
        "format": assembly.format,
        "unit": assembly.unit,
        "options": dict(options),
        "parts": parts,
        "robots": robots,
        "left_out": [{"name": name, "why": why} for name, why in assembly.left_out],
        "missing": missing,
        "findings": [{"level": f.level, "subject": f.subject, "text": f.text} for f in findings],
    }
    texts = {
        "workstation.toml": "\n".join(
            [
                *_head(assembly, source),
                "",
                *(table_text("robots", row["written"]) for row in robots),
                *(table_text("parts", row["written"]) for row in parts),
                *(table_text("left_out", row["written"]) for row in missing),
            ]
        ),
        TABLE: json.dumps(table, indent=1, ensure_ascii=False) + "\n",
    }
    return Files(texts, meshes, tuple(parts), tuple(findings), tuple(robots), missing)


def left_out_rows(left_out: Sequence[tuple[str, str]]) -> Iterator[dict[str, Any]]:
    """Rows of what became no part: one for each request of the user, which accepts it, and for each thing.

    Args:
        left_out: Full names and why, of which those on request begin with `ASKED`.
    """
    asked: dict[str, int] = {}
    known: set[str] = set()
    for name, why in left_out:
        if why.startswith(ASKED):
            option = why.removeprefix(ASKED).rpartition("; ")[0]
            asked[option] = asked.get(option, 0) + 1
        elif not why.startswith(NOTHING) and (label := printable(name)[:500]) not in known:
            known.add(label)
            yield _row(label, printable(why)[:1000], None)
    for option, count in asked.items():
        parts = "1 part, which" if count == 1 else f"{count} parts, which"
        yield _row(option[:500], f"{parts} {TABLE} lists", "asked for when the CAD file was brought")


def _row(name: str, why: str, accepted: str | None) -> dict[str, Any]:
    written = {"name": name, "why": why} | ({} if accepted is None else {"accepted": accepted})
    return {"name": name, "shape": "", "written": written}


def _robot_names(assembly: Assembly) -> list[str]:
    """Names of mechanisms, under which no part lies: links have full names, too."""
    tops = {name.partition("/")[0] for name in assembly.names()}
    wanted = (plain_name(moving.description.name) for moving in assembly.mechanisms)
    return told_apart(f"{name}_moving" if name in tops else name for name in wanted)


def _robot(moving: Moving, name: str, files: dict[str, bytes]) -> dict[str, Any]:
    """Row of a mechanism, whose files join those given."""
    folder = f"robots/{name}"
    text, meshes = written(replace(moving.description, name=name), mimics=True)
    own = {f"{folder}/{name}.urdf": text.encode(), **{f"{folder}/{k}": v for k, v in meshes.items()}}
    files.update(own)
    model = next(iter(own))
    values: dict[str, Any] = {"name": name, "model": model, "base": place(moving.world_from_base)}
    if moving.q:
        values["q"] = [_number(q, 12) for q in moving.q]
    links = moving.description.links
    masses = [link.inertial.mass for link in links if link.inertial is not None]
    digest = hashlib.sha256()
    for content in own.values():
        digest.update(hashlib.sha256(content).digest())
    return {
        "name": name,
        "joints": [joint.name for joint in moving.description.joints()],
        "links": len(links),
        "mass": sum(masses) if masses else None,
        "without_mass": [link.name for link in links if link.inertial is None and link.solids],
        "shape": digest.hexdigest()[:16],
        "files": list(own),
        "written": values,
    }


def _stated_mass(inertial: Inertial) -> dict[str, Any]:
    """Mass properties as a workstation file has them, with what is known of how far they are off.

    Where a shape tells centre and moments within bounds alone, they follow from it again.
    """
    values: dict[str, Any] = {"mass": _number(inertial.mass, 12)}
    if inertial.error > INTEGRATED:
        values["mass_tolerance"] = _share(inertial.error)
    if inertial.spread_error > inertial.error + INTEGRATED:
        return values | {"uniform_density": True}
    i = np.where(np.abs(inertial.inertia) > 1e-12 * np.trace(inertial.inertia), inertial.inertia, 0.0)
    six = (i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
    return values | {
        "com": [_number(x, 12) for x in inertial.com.round(12)],
        "inertia": [_number(x, 12) for x in six],
    }


def _share(share: float) -> float:
    """A share as it is written: no less, and no more than what a tolerance can be."""
    return min(math.ceil(share * 1e6) / 1e6, 0.999999)


def _head(assembly: Assembly, source: Path) -> list[str]:
    # Names are of others: as values they cannot end a comment.
    origin = f"{toml_value(source.name)} ({toml_value(assembly.format)}, unit {toml_value(assembly.unit)})"
    head = [f"# Made by `seerob import` from {origin}; {TABLE} lists what became of it."]
    return [*head, f"title = {toml_value(source.stem)}"]


def part_values(row: Mapping[str, Any], color: Color | None) -> dict[str, Any]:
    """What a part's table in the workstation file says."""
    values = {"name": row["name"], "mesh": row["mesh"], "at": place(row["world"])}
    if row["deviation"] > NEGLIGIBLE:
        values["deviation_mm"] = _number(math.ceil(row["deviation"] * 1e7) / 1e4)
    if color is not None:
        values["color"] = [_number(c) for c in color[:3]]
    if row["density"] is not None:
        values["density"] = _number(row["density"])
    return values


def table_text(group: str, values: Mapping[str, Any]) -> str:
    """One table of a group, as ``parts``, in the workstation file."""
    return "\n".join([f"[[{group}]]", *(f"{key} = {literal(value)}" for key, value in values.items()), ""])


def place(world: Array) -> dict[str, list[float]]:
    """A rigid place (4, 4) [m] as a workstation file has it."""
    position = [_number(x, 12) for x in world[:3, 3].round(12)]
    wxyz = wxyz_from_rotation(world[:3, :3])
    if abs(wxyz[0]) > 1 - 1e-14:
        return {"position": position}
    return {"position": position, "wxyz": [_number(x, 12) for x in wxyz]}


def _number(value: float, digits: int = 9) -> float:
    """A number with so many digits, whole where it is."""
    rounded = float(f"{value + 0.0:.{digits}g}")
    return int(rounded) if rounded.is_integer() else rounded


def _mesh_names(shapes: tuple[Shape, ...], given: Collection[str]) -> list[str]:
    taken = {PurePosixPath(name).stem.lower() for name in given}
    found = []
    for shape in shapes:
        stem = plain_name(shape.name)
        name, number = stem, 1
        while name.lower() in taken:  # some file systems know no case
            number += 1
            name = f"{stem}_{number}"
        taken.add(name.lower())
        found.append(f"cad/{name}.glb")
    return found


def _measured(shape: Shape, findings: list[Finding]) -> tuple[bytes, dict[str, Any]]:
    """A shape's mesh file, closed as far as it can be, and what is known of it."""
    pieces = [Mesh(_snapped(mesh.vertices), mesh.faces, mesh.color) for mesh in shape.pieces]
    whole, dropped = joined(pieces)
    _, turned = sided(whole)
    for said in filter(None, (dropped, turned)):
        findings.append(Finding(level="note", subject=shape.name, text=said))
    closed = is_closed(whole)
    if not closed:
        text = "its surface is open: what is inside of it is not known"
        findings.append(Finding(level="note", subject=shape.name, text=text))
    facts = {
        "triangles": len(whole.faces),
        "solids": shape.solids,
        "closed": closed,
        "volume": abs(signed_volume(whole)) if closed else None,
        "deviation": shape.deviation,
        "shape": _print(whole),
    }
    return glb_y_up(*pieces), facts


def _snapped(vertices: Array) -> Array:
    """Corners as a mesh file holds them, in four bytes; those that differ by rounding alone become one."""
    return vertices.round(GRID).astype(np.float32).astype(float) + 0.0


def _print(mesh: Mesh) -> str:
    """What tells shapes apart: a hash of their corners to 10 µm, in any order."""
    corners = np.unique((mesh.vertices * 1e5).round().astype(np.int64), axis=0)
    return hashlib.sha256(corners.tobytes()).hexdigest()[:16]


def _box(shape: Shape, instance: Instance) -> list[list[float]]:
    """Lowest and highest corner in the world [m]."""
    moved = np.vstack([mesh.moved(instance.world_from_shape).vertices for mesh in shape.pieces])
    return [[float(f"{x:.7g}") for x in corner] for corner in (moved.min(axis=0), moved.max(axis=0))]


def densities(words: list[str]) -> Densities:
    """What ``--density`` was given: ``2700`` for everything, ``S235JR=7850`` for a material, ``library``.

    Raises:
        InputError: One is no density.
    """
    of_all: float | None = None
    by_material: dict[str, float] = {}
    library = LIBRARY in words
    for word in words:
        if word == LIBRARY:
            continue
        name, _, figure = word.rpartition("=")
        try:
            density = float(figure)
        except ValueError:
            density = float("nan")
        if not 0 < density <= 1e5:
            what = f"{word!r} is no density"
            remedy = f"2700 for everything, S235JR=7850 [kg/m³], or {LIBRARY}"
            raise InputError.at("--density", "", what, remedy)
        if name:
            by_material[name] = density
        else:
            of_all = density
    return Densities(of_all, by_material, library)


def densities_of_table(file: Path) -> list[str]:
    """Words as of ``--density`` from a TOML file of densities by material name.

    Raises:
        InputError: It cannot be read, or something in it is no density.
    """
    try:
        table = tomllib.loads(bounded.content(file, LARGEST_TABLE).decode("utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError.at(file, "", f"cannot be read: {error}", 'lines such as "S235JR" = 7850') from error
    for name, density in table.items():
        if isinstance(density, bool) or not isinstance(density, int | float) or not 0 < density <= 1e5:
            what = f"{density!r} is no density"
            raise InputError.at(file, name, what, "a number in kg/m³, as 7850")
    return [f"{name}={density}" for name, density in table.items()]
