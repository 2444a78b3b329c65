"""Shapes of a compiled MuJoCo model, and which of them are for the screen and which for distances.

A geom whose contype and conaffinity are both 0 never touches anything: it is for the screen. The
others are for contacts and distances; they are also drawn where a body has nothing else.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from seerob.core.shapes.geometry import Mesh, Solid, capsule
from seerob.core.transforms import rotation_from_wxyz, transform
from seerob.description.formats.urdf_geometry import moved
from seerob.description.shapes import shapes
from seerob.description.shapes.detail import physics_mesh
from seerob.description.shapes.split_surfaces import with_insides
from seerob.description.xml_values import Reader


def shapes_of_body(
    reader: Reader, model: Any, body: int, name: str
) -> tuple[tuple[Mesh, ...], tuple[Solid, ...]]:
    """Display meshes and solids of one body, in its frame.

    Args:
        reader: Collects findings.
        model: A `mujoco.MjModel`.
        body: Index of the body.
        name: Its name, for messages.
    """
    drawn: list[Mesh] = []
    touched: list[tuple[Solid, Mesh]] = []
    for geom in range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]):
        made = _geom(reader, model, geom, name)
        if made is None:
            continue
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            touched.append(made)
        else:
            drawn.append(made[1])
    if not touched and drawn:
        reader.finding(
            "note", name, "nothing that collides in the file: distances and contacts use what is drawn"
        )
        solids = tuple(Solid(mesh=physics_mesh(mesh), name=f"visual_{i}") for i, mesh in enumerate(drawn))
        return tuple(drawn), with_insides(solids)
    solids = tuple(replace(solid, name=solid.name or f"geom_{i}") for i, (solid, _) in enumerate(touched))
    return tuple(drawn) or tuple(mesh for _, mesh in touched), with_insides(solids)


def _geom(reader: Reader, model: Any, geom: int, body: str) -> tuple[Solid, Mesh] | None:
    import mujoco

    kinds = mujoco.mjtGeom
    kind = kinds(int(model.geom_type[geom]))
    name = model.geom(geom).name
    body_from_geom = transform(rotation_from_wxyz(model.geom_quat[geom]), model.geom_pos[geom])
    material = int(model.geom_matid[geom])
    default = np.allclose(model.geom_rgba[geom], 0.5 * np.array([1, 1, 1, 2]))
    rgba = model.mat_rgba[material] if material >= 0 and default else model.geom_rgba[geom]
    r, g, b, a = (float(v) for v in np.clip(rgba, 0, 1))
    size = model.geom_size[geom].astype(float)
    end = np.array([0.0, 0.0, size[1]])
    if kind == kinds.mjGEOM_MESH:
        shown = _mesh(model, int(model.geom_dataid[geom]))
        solid = Solid(mesh=physics_mesh(shown))
        name = name or model.mesh(int(model.geom_dataid[geom])).name
    elif kind == kinds.mjGEOM_BOX:
        shown = shapes.box_mesh(-size, size)
        solid = Solid(mesh=shown)
    elif kind == kinds.mjGEOM_SPHERE:
        shown = shapes.sphere_mesh(np.zeros(3), size[0])
        solid = shapes.sphere_solid(np.zeros(3), float(size[0]))
    elif kind == kinds.mjGEOM_CAPSULE:
        shown = shapes.capsule_mesh(-end, end, size[0])
        solid = capsule(-end, end, float(size[0]))
    elif kind == kinds.mjGEOM_CYLINDER:
        shown = shapes.cylinder_mesh(-end, end, size[0])
        solid = shapes.cylinder_solid(-end, end, float(size[0]))
    elif kind == kinds.mjGEOM_ELLIPSOID:
        shown, solid = _ellipsoid(size)
    else:
        what = str(kind.name).removeprefix("mjGEOM_").lower()
        reader.finding("warning", body, f"a {what} cannot be part of a robot here: left out")
        return None
    placed = moved(solid, body_from_geom)
    return replace(placed, name=name), replace(shown.moved(body_from_geom), color=(r, g, b, a))


def _mesh(model: Any, mesh: int) -> Mesh:
    v, n = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    f, m = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return Mesh(model.mesh_vert[v : v + n].astype(float), model.mesh_face[f : f + m].astype(np.int32))


def _ellipsoid(radii: Any) -> tuple[Mesh, Solid]:
    """A sphere's mesh stretched; the solid is enlarged until it contains the ellipsoid."""
    unit = shapes.sphere_mesh(np.zeros(3), 1.0)
    a, b, c = (unit.vertices[unit.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    inner = float((np.einsum("ij,ij->i", normals, a) / np.linalg.norm(normals, axis=1)).min())
    factor = 1 / inner
    note = f"ellipsoid as a mesh around it, at most {(factor - 1) * float(max(radii)) * 1e3:.2g} mm larger"
    if not math.isfinite(factor):
        raise ValueError(f"not an ellipsoid: {radii}")
    outer = Mesh(unit.vertices * radii * factor, unit.faces)
    return Mesh(unit.vertices * radii, unit.faces), Solid(mesh=outer, note=note)
