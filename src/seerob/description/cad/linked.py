"""Mechanisms that a CAD file states, as descriptions: links, joints and masses checked, nothing made up."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from seerob.core.errors import InputError
from seerob.core.shapes import Mesh, Solid
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array
from seerob.description import lint
from seerob.description.cad import standing
from seerob.description.cad.assembly import SINGLE, Assembly, Instance, Moving, Shape
from seerob.description.cad.names import plain_name, told_apart
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, Mimic, Quantity
from seerob.description.mesh import FARTHEST
from seerob.description.mesh_files import MeshSource
from seerob.description.shapes import mass_properties
from seerob.description.shapes.mesh_bodies import joined
from seerob.description.shapes.moments import Moments

MOST_TURNS = 1e3
"""Limits of a joint beyond this are none [rad or m]."""


def moving(source: MeshSource, row: Mapping[str, Any], meters: float, world_from_base: Array) -> Moving:
    """A mechanism of a file.

    Args:
        source: The file, which learns what was noticed.
        row: ``name`` and ``links``, each after its parent: ``name``, ``parent`` (number, -1 for the base),
            ``matrix`` (4, 4) from the parent, ``anchor`` (3,), ``joints`` (``name``, ``kind``, ``axis``,
            ``lower``, ``upper``, ``velocity``, ``effort``, ``value``, ``mimic``), ``inertial`` (``mass``,
            ``frame`` (4, 4), ``moments``) and ``meshes`` in metres.
        meters: Metres per unit of lengths in it.
        world_from_base: Where its base is, (4, 4) [m].
    """
    rows = row["links"]
    names = told_apart(plain_name(link["name"]) for link in rows)
    every = [joint for link in rows for joint in link["joints"]]
    told = told_apart(plain_name(joint["name"]) for joint in every)
    by_sid = {joint.get("sid", joint["name"]): name for joint, name in zip(every, told, strict=True)}
    names_of_joints = iter(told)
    links, values = [], []
    for number, link in enumerate(rows):
        joints = []
        for joint in link["joints"]:
            made = _joint(
                source, joint, next(names_of_joints), np.array(link["anchor"]) * meters, meters, by_sid
            )
            joints.append(made)
            if made.mimic is None:
                k = meters if made.kind is JointKind.PRISMATIC else 1.0
                values.append(float(joint["value"]) * k)
        matrix = np.array(link["matrix"], float)
        matrix[:3, 3] *= meters
        parent = None if link["parent"] < 0 else names[link["parent"]]
        solids, visual = shaped(link["meshes"])
        if link.get("collision"):
            solids = shaped(link["collision"])[0]
        shape = [solid.mesh for solid in solids if solid.mesh is not None]
        inertial = _inertial(source, names[number], link["inertial"], meters, shape)
        links.append(
            Link(names[number], parent, matrix, tuple(joints), inertial, visual=visual, solids=solids)
        )
    name = plain_name(row["name"]).replace("/", "_")
    description = Description(name, tuple(links), lint.guessed_tip(links), str(source.path))
    return Moving(description, world_from_base, tuple(values) if any(values) else ())


def assembled(
    source: MeshSource, told: Mapping[str, Any], form: str, world_from_file: Array, meters: float
) -> Assembly:
    """An assembly of what a reader of scenes tells in plain data.

    Args:
        source: The file.
        told: ``parts`` (``path``, ``pieces``, ``collision``, ``world``, ``inertial``), ``mechanisms`` as
            `moving` takes them, with ``pieces`` and ``collision`` for ``meshes``, ``left_out``, ``findings``
            and ``files``.
        form: What the file is.
        world_from_file: Axes of the file to z up, (3, 3), without a scale.
        meters: Metres per unit.

    Raises:
        InputError: There is nothing in it.
    """
    source.files.update(told["files"])
    source.findings += [Finding(level=a, subject=b, text=c) for a, b, c in told["findings"]]
    turned = np.eye(4)
    turned[:3, :3] = world_from_file

    def placed(matrix: Any) -> Array:
        world = np.array(matrix, float)
        world[:3, 3] *= meters
        if not np.isfinite(world).all() or np.abs(world[:3, 3]).max() > FARTHEST:
            source.fail(f"a place is {world[:3, 3].tolist()} m", "check its unit and its transforms")
        return np.asarray(turned @ world)

    shapes: list[Shape] = []
    known: dict[bytes, int] = {}
    instances: list[Instance] = []
    left_out = [(name, why) for name, why in told["left_out"]]
    for part in told["parts"]:
        label = part["path"][-1]
        seen, shown = (_meshes(part[which], meters) for which in ("collision", "pieces"))
        solids = tuple(Solid(mesh=mesh) for mesh in seen if len(mesh.faces))
        link = Link(label, None, np.eye(4), visual=shaped(shown)[1], solids=solids)
        pieces, deviation = standing.surface(link)
        if not pieces or not len(joined(pieces)[0].faces):
            stated = part["inertial"] or {}
            if stated.get("mass", 0.0) > lint.FRAME:
                left_out.append(("/".join(part["path"]), f"has a mass of {stated['mass']:g} kg but no shape"))
            elif part["pieces"] or part["collision"]:
                left_out.append(("/".join(part["path"]), "nothing but triangles without area"))
            continue
        key = hashlib.sha256(repr(deviation).encode())
        for mesh in pieces:
            key.update(mesh.vertices.round(9).tobytes() + mesh.faces.tobytes() + repr(mesh.color).encode())
        number = known.setdefault(key.digest(), len(shapes))
        if number == len(shapes):
            largest = max(float(np.abs(mesh.vertices).max()) for mesh in pieces)
            shapes.append(Shape(label, pieces, max(deviation, SINGLE * largest)))
        inertial = _inertial(source, "/".join(part["path"]), part["inertial"], meters, pieces)
        instances.append(Instance(tuple(part["path"]), number, placed(part["world"]), inertial=inertial))
    mechanisms = []
    for row in told["mechanisms"]:
        for link in row["links"]:
            shown = _meshes(link["pieces"], meters)
            link["collision"] = _meshes(link["collision"], meters)
            link["meshes"] = shown
        mechanisms.append(moving(source, row, meters, placed(row["world"])))
    if not instances and not mechanisms:
        why = f"; it refers to {', '.join(name for name, _ in left_out[:5])}" if left_out else ""
        source.fail(f"holds no surface{why}", "export meshes or simple shapes")
    return Assembly(
        form,
        f"{meters:g} m",
        tuple(shapes),
        tuple(instances),
        tuple(source.findings),
        tuple(left_out),
        dict(source.files),
        tuple(mechanisms),
    )


def _meshes(pieces: Any, meters: float) -> tuple[Mesh, ...]:
    return tuple(
        Mesh(
            np.frombuffer(v, "<f8").reshape(-1, 3) * meters, np.frombuffer(f, "<i4").reshape(-1, 3), tuple(c)
        )
        for v, f, c in pieces
    )


def shaped(meshes: Sequence[Mesh]) -> tuple[tuple[Solid, ...], tuple[Mesh, ...]]:
    """What is measured and what is shown of a link's meshes [m]."""
    kept = [mesh for mesh in meshes if len(mesh.faces)]
    if not kept:
        return (), ()
    whole = joined(kept)[0]
    deviation = SINGLE * float(np.abs(whole.vertices).max(initial=0.0))
    return (Solid(mesh=whole, deviation=deviation),), tuple(kept)


def _joint(
    source: MeshSource,
    row: Mapping[str, Any],
    name: str,
    anchor: Array,
    meters: float,
    names: Mapping[str, str],
) -> Joint:
    turns = row["kind"] == "revolute"
    k = 1.0 if turns else meters
    axis = np.array(row["axis"], float)
    length = float(np.linalg.norm(axis))
    if not (np.isfinite(length) and length > 1e-9):
        source.fail(f"the axis of joint {name} is {axis.tolist()}", "it must not be zero", name)
    ends = [
        None if row[end] is None or abs(row[end] * k) > MOST_TURNS else row[end] * k
        for end in ("lower", "upper")
    ]
    lower, upper = ends
    if lower is None or upper is None:
        lower = upper = None
        source.note(f"joint {name} has no limits", level="warning")
    elif lower > upper:
        source.note(f"the limits of joint {name} are swapped: {lower:g} above {upper:g}", level="warning")
        lower, upper = upper, lower
    mimic = row.get("mimic")
    followed = None
    if mimic is not None:
        joint, factor, offset = mimic
        followed = Mimic(names.get(joint, joint), float(factor), float(offset) * k)
    known: dict[str, Quantity | None] = {}
    for which in ("velocity", "effort"):
        value, text = lint.plausible_limit(which, row.get(which))
        if text:
            source.note(f"joint {name}: {text}", level="warning")
        known[which] = None if value is None else Quantity(value, Origin.STATED, str(source.path))
    kind = JointKind.REVOLUTE if turns else JointKind.PRISMATIC
    return Joint(
        name, kind, axis / length, anchor, lower, upper, known["velocity"], known["effort"], mimic=followed
    )


def _solids(row: Mapping[str, Any], meters: float) -> Moments | None:
    """Moments [m] of simple shapes together; None where there are others, or some may overlap."""
    told = row.get("solids")
    if not told:
        return None
    return mass_properties.combined(
        Moments(volume * meters**3, np.array(com) * meters, np.array(inertia) * meters**5)
        for volume, com, inertia in told
    )


def _inertial(
    source: MeshSource, link: str, row: Mapping[str, Any] | None, meters: float, shape: Sequence[Mesh]
) -> Inertial | None:
    if row is None:
        return None
    if row.get("density") is not None or row["moments"] is None:
        solids = _solids(row, meters)
        try:
            if solids is not None:
                findings: tuple[Finding, ...] = ()
                density = row.get("density")
                mass = density * solids.volume if density else row["mass"]
                if not (solids.volume > 0 and 0 < mass < math.inf):
                    raise InputError.at(link, "mass", f"{mass!r} kg in {solids.volume!r} m³")
                origin = Origin.ESTIMATED if density else Origin.GIVEN
                made = solids.inertial(mass=mass, origin=origin, source=str(source.path))
            else:
                made, findings = mass_properties.from_shape(
                    shape,
                    density=row.get("density"),
                    mass=None if row.get("density") else row["mass"],
                    deviation=row.get("off", 0.0) * meters,
                    subject=link,
                )
            if math.isinf(made.spread_error):
                source.findings += findings
                return None
        except InputError as error:
            source.note(f"link {link}: no inertia from its shape ({error}): unknown", level="warning")
            return None
        source.findings += findings
        text = f"link {link}: {made.mass:.4g} kg, inertia from its shape at uniform density"
        source.note(text, level="assumed")
        return made
    frame = np.array(row["frame"], float)
    rotation = frame[:3, :3]
    moments = np.array(row["moments"], float)
    # A moment of inertia has the unit of a mass times that of a length squared.
    with np.errstate(all="ignore"):  # what is no number, or too large, is told below
        inertia = rotation @ (np.diag(moments) if moments.ndim == 1 else moments) @ rotation.T
        inertia = 0.5 * (inertia + inertia.T) * meters**2
    made = Inertial(
        float(row["mass"]),
        frame[:3, 3] * meters,
        inertia,
        Origin.STATED,
        str(source.path),
    )
    kept, level, text = lint.plausible_inertial(made, body=True)
    if text:
        source.note(f"link {link}: {text}", level=level)
    return kept
