"""Mechanisms that a CAD file states, as descriptions: links, joints and masses checked, nothing made up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from seerob.core.shapes import Mesh, Solid
from seerob.core.snapshot import Origin
from seerob.core.transforms import Array
from seerob.description import lint
from seerob.description.cad.assembly import SINGLE, Moving
from seerob.description.cad.names import plain_name, told_apart
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, Mimic, Quantity
from seerob.description.mesh_files import MeshSource
from seerob.description.shapes.mesh_bodies import joined

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
        inertial = _inertial(source, names[number], link["inertial"], meters)
        solids, visual = shaped(link["meshes"])
        links.append(
            Link(names[number], parent, matrix, tuple(joints), inertial, visual=visual, solids=solids)
        )
    name = plain_name(row["name"]).replace("/", "_")
    description = Description(name, tuple(links), lint.guessed_tip(links), str(source.path))
    return Moving(description, world_from_base, tuple(values) if any(values) else ())


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


def _inertial(source: MeshSource, link: str, row: Mapping[str, Any] | None, meters: float) -> Inertial | None:
    if row is None:
        return None
    frame = np.array(row["frame"], float)
    if row["moments"] is None:
        source.note(f"link {link}: a mass of {row['mass']:g} kg without an inertia: unknown", level="warning")
        return None
    rotation = frame[:3, :3]
    moments = np.array(row["moments"], float)
    inertia = rotation @ (np.diag(moments) if moments.ndim == 1 else moments) @ rotation.T
    # A moment of inertia has the unit of a mass times that of a length squared.
    made = Inertial(
        float(row["mass"]),
        frame[:3, 3] * meters,
        0.5 * (inertia + inertia.T) * meters**2,
        Origin.STATED,
        str(source.path),
    )
    kept, level, text = lint.plausible_inertial(made, body=True)
    if text:
        source.note(f"link {link}: {text}", level=level)
    return kept
