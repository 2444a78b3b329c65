"""Meshes out: a small deterministic writer of binary glTF for the page and the recordings.

Coordinates are metres, z up, as everywhere inside; glTF itself says y up, so whoever shows these files
turns them once, in the root of the scene. Equal meshes give equal bytes, so their hash names them.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes.geometry import Mesh, Solid
from seerob.description.shapes.shading import CREASE, shaded
from seerob.description.shapes.tessellation import solid_mesh

__all__ = ["Shown", "glb_bytes", "mesh_hash", "shown", "solid_mesh"]

_FLOAT, _USHORT, _UINT = 5126, 5123, 5125
_ARRAY, _ELEMENTS = 34962, 34963


@dataclass(frozen=True)
class Shown:
    """What the page and recordings show of a body."""

    content: bytes
    """Binary glTF."""
    digest: str
    """`mesh_hash` of it."""
    triangles: int


KEPT = 500
"""Bodies whose file is kept for as long as the process lives."""
_kept: dict[bytes, Shown] = {}


def shown(solids: Sequence[Solid], visual: Sequence[Mesh]) -> Shown:
    """The display meshes of a body, or without any its solids; made once for bodies that are equal."""
    key = _content(solids, visual)
    found = _kept.get(key)
    if found is None:
        display = list(visual) or [solid_mesh(solid) for solid in solids]
        content = glb_bytes(display)
        found = Shown(content, mesh_hash(content), sum(len(mesh.faces) for mesh in display))
        if len(_kept) >= KEPT:
            _kept.clear()
        _kept[key] = found
    return found


def _content(solids: Sequence[Solid], visual: Sequence[Mesh]) -> bytes:
    """Hash of all that `shown` looks at."""
    content = hashlib.sha256()
    for each in visual or solids:
        solid = None if isinstance(each, Mesh) else each
        mesh = each if isinstance(each, Mesh) else each.mesh
        arrays: tuple[NDArray[Any] | None, ...] = (
            None if mesh is None else mesh.vertices,
            None if mesh is None else mesh.faces,
            None if solid is None else solid.points,
        )
        told = [None if array is None else (array.shape, array.dtype.str) for array in arrays]
        plain = None if solid is None else solid.radius, None if mesh is None else mesh.color
        content.update(repr((plain, told)).encode())
        for array in arrays:
            if array is not None:
                content.update(array.tobytes())
    return content.digest()


def mesh_hash(glb: bytes) -> str:
    """SHA-256 of the file's bytes, hexadecimal."""
    return hashlib.sha256(glb).hexdigest()


def glb_bytes(meshes: Sequence[Mesh], *, crease: float = CREASE) -> bytes:
    """One binary glTF file with a primitive and a double-sided material per mesh.

    Args:
        meshes: Meshes in one frame [m], z up; those without triangles are left out.
        crease: Normals are smooth across edges that bend less than this [rad].

    Returns:
        The file; a valid one without a mesh when there are no triangles.
    """
    chunks: list[bytes] = []
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    primitives: list[dict[str, Any]] = []
    materials: list[dict[str, Any]] = []

    def add(array: NDArray[Any], kind: str, component: int, target: int, **extra: object) -> int:
        data = array.tobytes()
        offset = sum(map(len, chunks))
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(data), "target": target})
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": component,
                "count": len(array),
                "type": kind,
                **extra,
            }
        )
        chunks.append(data + bytes(-len(data) % 4))
        return len(accessors) - 1

    for mesh in meshes:
        if not len(mesh.faces):
            continue
        vertices, normals, faces = shaded(mesh, crease)
        position = vertices.astype("<f4")
        small = len(position) < 65535
        primitives.append(
            {
                "attributes": {
                    "POSITION": add(
                        position,
                        "VEC3",
                        _FLOAT,
                        _ARRAY,
                        min=[float(x) for x in position.min(axis=0)],
                        max=[float(x) for x in position.max(axis=0)],
                    ),
                    "NORMAL": add(normals.astype("<f4"), "VEC3", _FLOAT, _ARRAY),
                },
                "indices": add(
                    faces.ravel().astype("<u2" if small else "<u4"),
                    "SCALAR",
                    _USHORT if small else _UINT,
                    _ELEMENTS,
                ),
                "material": len(materials),
            }
        )
        materials.append(_material(mesh.color))
    tree: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "seerob", "extras": {"up": "z", "unit": "m"}},
        "scene": 0,
        "scenes": [{"nodes": [0] if primitives else []}],
    }
    if not primitives:
        del tree["scenes"][0]["nodes"]
        return _container(tree, b"")
    tree |= {
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
    }
    return _container(tree, b"".join(chunks))


def _material(color: tuple[float, float, float, float]) -> dict[str, Any]:
    # glTF wants linear light; the colours of meshes, files and screens are sRGB.
    rgba = np.clip(color, 0, 1)
    linear = np.where(rgba <= 0.04045, rgba / 12.92, ((rgba + 0.055) / 1.055) ** 2.4)
    factor = [round(float(c), 6) for c in (*linear[:3], rgba[3])]
    material: dict[str, Any] = {
        "pbrMetallicRoughness": {"baseColorFactor": factor, "metallicFactor": 0.0, "roughnessFactor": 0.7},
        "doubleSided": True,
    }
    if factor[3] < 1:
        material["alphaMode"] = "BLEND"
    return material


def _container(tree: dict[str, Any], binary: bytes) -> bytes:
    if binary:
        tree["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(tree, separators=(",", ":"), sort_keys=True).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
