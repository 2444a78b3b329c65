"""Contacts, only where the workstation file asks for them.

MuJoCo makes contacts between convex shapes, so a concave body is decomposed first; distances
never use these pieces. Each asked pair of sets gets one bit of MuJoCo's contact masks: bodies of
one set never touch each other.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from seerob.core.errors import InputError, UnknownName
from seerob.core.shapes import Mesh, Solid
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, wxyz_from_rotation
from seerob.model.model import Body
from seerob.model.mounting.specification import Mounting
from seerob.workstation.workstation import Contact

FLOOR = "floor of loose workpieces"
MAX_PAIRS = 31
"""MuJoCo's masks have 32 bits; the sign bit is left alone."""


def add_contacts(
    mounting: Mounting,
    bodies: Sequence[Body],
    contacts: Sequence[Contact],
    *,
    file: str,
    cache: Path | None,
    loose: Mapping[str, float],
    conveyors: Collection[str] = (),
) -> None:
    """Give the bodies that may touch their contact shapes.

    Loose workpieces touch the floor, one another and everything but people, whose hands hold them.

    Args:
        mounting: Gets them.
        bodies: Of the workstation.
        contacts: What the file asks for.
        file: The workstation file, for messages.
        cache: Folder that keeps convex pieces.
        loose: Coefficient of friction of each loose workpiece, by name.
        conveyors: Parts whose surface runs: the twin says how they drag (`seerob.twin.machines.loose`).

    Raises:
        InputError: More pairs than there are bits, or a name that means no body.
    """
    most = MAX_PAIRS - bool(loose)
    if len(contacts) > most:
        raise InputError.at(file, "contacts", f"{len(contacts)} pairs", f"give at most {most}")
    masks: dict[int, list[int]] = {}
    for i, contact in enumerate(contacts):
        for side, name in enumerate(contact.between):
            try:
                chosen = select(bodies, name)
            except UnknownName as error:
                raise InputError.at(file, f"contacts[{i}].between[{side}]", str(error)) from error
            for body in chosen:
                masks.setdefault(body.index, [0, 0])[side] |= 1 << i
    if loose:
        bit = 1 << (MAX_PAIRS - 1)
        for body in bodies:
            if body.role == "workpiece" and body.owner in loose:
                masks[body.index] = [bit, bit]
            elif body.role not in ("area", "human") and not body.holder:
                masks.setdefault(body.index, [0, 0])[1] |= bit
        mounting.spec.worldbody.add_geom(
            name=FLOOR, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=0, conaffinity=bit, group=3
        )
        text = "loose workpieces fall onto z = 0, and pass through people; robots touch them as hulls"
        mounting.findings.append(Finding(level="note", subject=next(iter(loose)), text=text))
    for index, (contype, conaffinity) in masks.items():
        body = bodies[index]
        friction = loose.get(body.owner) if body.role == "workpiece" else None
        hull = bool(loose) and body.role == "robot" and not contype and conaffinity == bit
        runs = body.role == "part" and body.owner in conveyors
        _add_geoms(mounting, body, contype, conaffinity, cache, friction=friction, hull=hull, runs=runs)


def select(bodies: Sequence[Body], name: str) -> list[Body]:
    """Bodies that a name means: a carrier with all it carries, or everything below a name."""
    chosen = [
        b
        for b in bodies
        if b.role != "area"
        and not b.holder
        and (name in (b.carrier, b.owner, b.name) or b.name.startswith(name + "/"))
    ]
    if not chosen:
        raise UnknownName("robot, human, tool or part with a shape", name, {b.owner for b in bodies})
    return chosen


def _add_geoms(
    mounting: Mounting,
    body: Body,
    contype: int,
    conaffinity: int,
    cache: Path | None,
    *,
    friction: float | None = None,
    hull: bool = False,
    runs: bool = False,
) -> None:
    mj_body = mounting.get(body.name)
    for i, solid in enumerate(body.solids):
        name = f"{body.name}#{i}"
        masks: dict[str, Any] = {"contype": contype, "conaffinity": conaffinity, "mass": 0.0, "group": 3}
        if friction is not None:
            # Its own coefficient counts, whatever it touches.
            masks |= {"friction": [friction, 0.005, 0.0001], "priority": 1, "condim": 4}
        if runs:
            masks |= {"priority": 2, "condim": 1}
        if solid.points is not None and len(solid.points) == 2:
            _capsule(mj_body, name, solid, masks)
        else:
            whole = (solid.mesh,) if hull and solid.mesh is not None else None
            for k, mesh in enumerate(whole or _convex(mounting, body, solid, cache)):
                _mesh(mounting, mj_body, f"{name}.{k}", mesh, masks)


def _capsule(mj_body: mujoco.MjsBody, name: str, solid: Solid, masks: dict[str, Any]) -> None:
    assert solid.points is not None
    start, end = solid.points
    length = float(np.linalg.norm(end - start))
    if length < 1e-9:
        mj_body.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[solid.radius, 0, 0], pos=start, **masks
        )
        return
    mj_body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[solid.radius, length / 2, 0],
        pos=(start + end) / 2,
        quat=wxyz_from_rotation(_along((end - start) / length)),
        **masks,
    )


def _along(z: Array) -> Array:
    x = np.cross(z, [1.0, 0, 0] if abs(z[0]) < 0.9 else [0, 1.0, 0])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _convex(mounting: Mounting, body: Body, solid: Solid, cache: Path | None) -> Sequence[Mesh]:
    if solid.mesh is None:
        from seerob.description.shapes.glb import solid_mesh

        return (solid_mesh(solid),)
    from seerob.description.shapes.decomposition import convex_parts

    parts = convex_parts(solid.mesh, cache=cache)
    meshes = tuple(getattr(parts, "meshes", parts))
    if len(meshes) > 1:
        excess = getattr(parts, "excess", None)
        more = f", {100 * excess:.1f} % more volume" if isinstance(excess, float) else ""
        text = f"touches as {len(meshes)} convex pieces{more}; distances use the exact mesh"
        mounting.findings.append(Finding(level="note", subject=body.name, text=text))
    return meshes


def _mesh(mounting: Mounting, mj_body: mujoco.MjsBody, name: str, mesh: Mesh, masks: dict[str, Any]) -> None:
    mounting.spec.add_mesh(
        name=name,
        uservert=np.ascontiguousarray(mesh.vertices, np.float32).ravel(),
        userface=np.ascontiguousarray(mesh.faces, np.int32).ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
    )
    mj_body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **masks)
