"""COLLADA 1.4 through pycollada: geometry, colours, unit and up axis of the visual scene."""

from __future__ import annotations

import io
import math
import warnings
from typing import Any

import numpy as np

from seerob.core.transforms import Array
from seerob.description.mesh_files import Color, MeshSource, RawFile, RawMesh

_MAX_DEPTH = 200
_MAX_NODES = 200_000


def read(source: MeshSource) -> RawFile:
    """Meshes of the visual scene, one per primitive of each geometry instance, which is one part.

    Raises:
        InputError: with a document type or entities, which no honest COLLADA file has.
    """
    import collada
    from defusedxml.ElementTree import fromstring

    with source.parsing("COLLADA file"):
        root = fromstring(source.data, forbid_dtd=True)
    meters, up = _unit_and_axis(source, root)
    ignored = [collada.common.DaeUnsupportedError, collada.common.DaeBrokenRefError]
    with source.parsing("COLLADA file"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        document = collada.Collada(io.BytesIO(_with_own_ids(source.data, root)), ignore=ignored)
        for error in document.errors:
            source.note(f"ignored: {type(error).__name__}: {str(error)[:200]}", level="warning")
        meshes: list[RawMesh] = []
        count = visited = 0
        # A stack instead of recursion: depth is the file's choice.
        stack: list[tuple[object, Array, tuple[str, ...], tuple[str, ...]]] = (
            [] if document.scene is None else [(n, np.eye(4), (), ()) for n in reversed(document.scene.nodes)]
        )
        while stack:
            node, matrix, names, nodes = stack.pop()
            visited += 1
            if len(names) > _MAX_DEPTH or visited > _MAX_NODES:
                source.fail(f"has more than {_MAX_NODES} nodes, or nests them deeper than {_MAX_DEPTH}")
            if isinstance(node, collada.scene.GeometryNode):
                for mesh in _meshes(source, node, matrix, names, nodes, visited):
                    count += len(mesh.faces)
                    if count > source.max_faces:
                        source.fail(f"has more than {source.max_faces} triangles", "raise max_faces")
                    meshes.append(mesh)
            elif isinstance(node, collada.scene.Node | collada.scene.NodeNode):
                inner = node.node if isinstance(node, collada.scene.NodeNode) else node
                below = matrix @ np.asarray(inner.matrix, float)
                label = inner.xmlnode.get("name") or inner.id or ""
                path = (*names, label) if label else names
                ids = (*nodes, inner.id) if inner.id else nodes
                stack.extend((child, below, path, ids) for child in reversed(inner.children))
            elif isinstance(node, collada.scene.ControllerNode):
                source.note("a skinned or morphed geometry was left out", level="warning")
    return RawFile(tuple(meshes), meters, up)


def _with_own_ids(data: bytes, root: Any) -> bytes:
    """The document with identifiers for vertices that COLLADA 1.5 may name as ``#geometry/vertices``."""
    from xml.etree.ElementTree import tostring

    changed = False
    for geometry in root.iter(f"{{{root.tag[1:].partition('}')[0]}}}geometry"):
        prefix = f"#{geometry.get('id')}/"
        inputs = [e for e in geometry.iter() if e.get("source", "").startswith(prefix)]
        named = {e.get("source")[len(prefix) :] for e in inputs}
        own = {name: f"{geometry.get('id')}-{name}" for name in named}
        for element in geometry.iter() if named else ():
            if element.get("id") in own or element.get("sid") in own:
                element.set("id", own.get(element.get("id")) or own[element.get("sid")])
        for element in inputs:
            element.set("source", f"#{own[element.get('source')[len(prefix) :]]}")
            changed = True
    return tostring(root) if changed else data


def _unit_and_axis(source: MeshSource, root: Any) -> tuple[float, str]:
    asset = root.find("{*}asset")
    unit = None if asset is None else asset.find("{*}unit")
    axis = None if asset is None else asset.find("{*}up_axis")
    meters = 1.0
    if unit is None:
        source.note("the file does not say its unit: metres, as COLLADA has it", level="assumed")
    else:
        text = unit.get("meter", "1")
        try:
            meters = float(text)
        except ValueError:
            meters = math.nan
        if not (math.isfinite(meters) and meters > 0):
            source.fail(f"its unit is {text!r} metres", "a positive number is expected", "asset/unit/meter")
    if axis is None or not axis.text:
        source.note("the file does not say which axis points up: y, as COLLADA has it", level="assumed")
        return meters, "y"
    up = axis.text.strip().removesuffix("_UP").lower()
    if up not in {"x", "y", "z"}:
        source.fail(f"its up axis is {axis.text[:40]!r}", "X_UP, Y_UP or Z_UP", "asset/up_axis")
    return meters, up


def _meshes(
    source: MeshSource,
    node: Any,
    matrix: Array,
    names: tuple[str, ...],
    nodes: tuple[str, ...],
    part: int,
) -> list[RawMesh]:
    import collada

    materials = {m.symbol: m.target for m in node.materials}
    name = "/".join(names) or node.geometry.name or node.geometry.id or ""
    meshes: list[RawMesh] = []
    for primitive in node.geometry.primitives:
        if isinstance(primitive, collada.lineset.LineSet):
            source.note(f"{name}: lines are not a surface and were left out")
            continue
        surface = primitive
        if isinstance(primitive, collada.polylist.Polylist):
            surface = primitive.triangleset()
        if not isinstance(surface, collada.triangleset.TriangleSet) or surface.vertex is None:
            continue
        vertices = np.asarray(surface.vertex, float)
        faces = np.asarray(surface.vertex_index, np.int64).reshape(-1, 3)
        color = _color(materials.get(primitive.material))
        label = f"{node.geometry.name or ''}#{node.geometry.id}.{len(meshes)}.{color}"
        meshes.append(RawMesh(name, vertices, faces, color, matrix, label, part, nodes))
    return meshes


def _color(material: object) -> Color | None:
    diffuse = getattr(getattr(material, "effect", None), "diffuse", None)
    if not isinstance(diffuse, tuple) or len(diffuse) < 3:
        return None
    r, g, b = (min(max(float(c), 0.0), 1.0) for c in diffuse[:3])
    return r, g, b, 1.0
