"""Meshes out: a small deterministic writer of binary glTF for the page and the recordings, and STL for CAD.

Coordinates are metres, z up, as everywhere inside; glTF itself says y up, so whoever shows these files turns
them once, in the root of the scene. Equal meshes give equal bytes, so their hash names them. Solids become
meshes for the screen; normals are smooth over gentle bends, sharp over creases.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_file
from seerob.core.shapes import Mesh, Solid
from seerob.core.transforms import Array
from seerob.description.shapes.mesh_bodies import tidied

Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])

_ROUND = 20
"""Segments of a full circle; a multiple of four."""


def solid_mesh(solid: Solid, *, color: tuple[float, float, float, float] | None = None) -> Mesh:
    """A solid's surface for the screen; every vertex of a rounded one lies on the true surface.

    Args:
        solid: Any solid. A mesh with an envelope is shown with its vertices moved out by the radius.
        color: Red, green, blue, alpha in 0…1; the mesh's own, or the default, when None.

    Returns:
        About 400 triangles for a capsule; 8 for a flat rectangle without radius.
    """
    if solid.mesh is not None:
        mesh = solid.mesh
        vertices = mesh.vertices + solid.radius * _vertex_normals(mesh) if solid.radius else mesh.vertices
        return Mesh(vertices, mesh.faces, color or mesh.color)
    assert solid.points is not None
    tessellated = _capsule if len(solid.points) == 2 else _rounded_rectangle
    vertices, faces = tessellated(solid.points, solid.radius)
    # Where a ring shrinks to the corners of its rectangle, quads lose their area.
    return tidied(Mesh(vertices, faces.astype(np.int32), color or Mesh.color))[0]


def _vertex_normals(mesh: Mesh) -> Array:
    corners = mesh.vertices[mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    summed = np.stack(
        [np.bincount(mesh.faces.ravel(), np.repeat(normal[:, i], 3), len(mesh.vertices)) for i in range(3)],
        axis=1,
    )
    return np.asarray(summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-300))


def _frame(axis: Array) -> Array:
    """Rotation (3, 3) whose third column is the axis' direction; the identity for no axis."""
    length = float(np.linalg.norm(axis))
    if length < 1e-12:
        return np.eye(3)
    z = axis / length
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _rings(rings: list[Array], bottom: Array, top: Array) -> tuple[Array, NDArray[np.int64]]:
    """Rings of equally many points, from the bottom up, joined by quads and closed by two fans."""
    n = len(rings[0])
    vertices = np.vstack([bottom[None], *rings, top[None]])
    here = np.arange(n)
    there = (here + 1) % n
    faces = [np.column_stack([np.zeros(n, int), 1 + there, 1 + here])]
    for k in range(len(rings) - 1):
        a, b = 1 + k * n, 1 + (k + 1) * n
        faces.append(np.column_stack([a + here, a + there, b + there]))
        faces.append(np.column_stack([a + here, b + there, b + here]))
    last = 1 + (len(rings) - 1) * n
    faces.append(np.column_stack([last + here, last + there, np.full(n, len(vertices) - 1)]))
    return vertices, np.vstack(faces)


def _capsule(points: Array, radius: float) -> tuple[Array, NDArray[np.int64]]:
    start, end = points
    frame = _frame(end - start)
    angle = 2 * np.pi * np.arange(_ROUND) / _ROUND
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_ROUND)]) @ frame.T
    latitudes = np.linspace(0, np.pi / 2, _ROUND // 4 + 1)[:-1]
    axis = frame[:, 2]
    lower = [start + radius * (np.cos(b) * circle - np.sin(b) * axis) for b in latitudes[::-1]]
    upper = [end + radius * (np.cos(b) * circle + np.sin(b) * axis) for b in latitudes]
    if np.linalg.norm(end - start) < 1e-12:
        upper = upper[1:]
    return _rings(lower + upper, start - radius * axis, end + radius * axis)


def _rounded_rectangle(points: Array, radius: float) -> tuple[Array, NDArray[np.int64]]:
    corner, u, v = points[0], points[1] - points[0], points[2] - points[0]
    if min(np.linalg.norm(u), np.linalg.norm(v)) < 1e-12:
        # As narrow as that it is a capsule: a person who is round there has such a trunk.
        return _capsule(np.array([corner, corner + u + v]), radius)
    frame = np.column_stack([u / np.linalg.norm(u), v / np.linalg.norm(v), np.zeros(3)])
    frame[:, 2] = np.cross(frame[:, 0], frame[:, 1])
    quarter = _ROUND // 4
    angles = np.concatenate([np.linspace(q, q + 1, quarter + 1) * np.pi / 2 for q in range(4)])
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))]) @ frame.T
    at = np.repeat([corner + u + v, corner + v, corner, corner + u], quarter + 1, axis=0)
    axis = frame[:, 2]
    latitudes = np.linspace(-np.pi / 2, np.pi / 2, _ROUND // 2 + 1)[1:-1]
    rings = [at + radius * (np.cos(b) * circle + np.sin(b) * axis) for b in latitudes]
    rings = [at - radius * axis, *rings, at + radius * axis]
    middle = corner + (u + v) / 2
    return _rings(rings, middle - radius * axis, middle + radius * axis)


CREASE = np.pi / 6
"""Edges that bend more than this [rad] are shown sharp."""


def shaded(mesh: Mesh, crease: float = CREASE) -> tuple[Array, Array, NDArray[np.int64]]:
    """Vertices split along creases, with the angle-weighted normal of the smooth patch around each.

    Returns:
        Vertices (k, 3) [m], unit normals (k, 3) and faces (m, 3) that index them.
    """
    from seerob.kernels.tree import component_of

    faces = mesh.faces.astype(np.int64)
    count = len(faces)
    corners = mesh.vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)

    # Corner c of face f has number 3 f + c. Two corners at one vertex belong together when their
    # faces share an edge there that bends less than the crease.
    at = np.arange(3 * count).reshape(-1, 3)
    begin, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    corner_begin, corner_end = at.ravel(), at[:, [1, 2, 0]].ravel()
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    corner_low = np.where(begin < end, corner_begin, corner_end)
    corner_high = np.where(begin < end, corner_end, corner_begin)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    first, second = order[:-1][same], order[1:][same]
    smooth = np.einsum("ij,ij->i", normal[first // 3], normal[second // 3]) > np.cos(crease)
    first, second = first[smooth], second[smooth]
    # Twice the second: an edge is a triangle without area.
    joined = np.concatenate(
        [
            np.column_stack([corner[first], corner[second], corner[second]])
            for corner in (corner_low, corner_high)
        ]
    )
    root = component_of(joined, 3 * count)
    # A root is the first corner of its group: numbered in that order, the order is the mesh's own.
    is_root = root == np.arange(3 * count)
    group = (np.cumsum(is_root) - 1)[root]
    vertices = mesh.vertices[faces.ravel()[is_root]]

    edges = corners[:, [1, 2, 0]] - corners
    edges /= np.maximum(np.linalg.norm(edges, axis=2, keepdims=True), 1e-300)
    cosine = -np.einsum("fci,fci->fc", edges, edges[:, [2, 0, 1]])
    weighted = (np.arccos(np.clip(cosine, -1, 1))[:, :, None] * normal[:, None, :]).reshape(-1, 3)
    summed = np.stack([np.bincount(group, weighted[:, i], len(vertices)) for i in range(3)], axis=1)
    size = np.linalg.norm(summed, axis=1, keepdims=True)
    normals = np.where(size > 1e-12, summed / np.maximum(size, 1e-300), [0.0, 0.0, 1.0])
    return vertices, normals, group.reshape(-1, 3)


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
        shapes = [None if array is None else (array.shape, array.dtype.str) for array in arrays]
        plain = None if solid is None else solid.radius, None if mesh is None else mesh.color
        content.update(repr((plain, shapes)).encode())
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
        materials.append(material_of(mesh.color))
    tree: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "seerob", "extras": {"up": "z", "unit": "m"}},
        "scene": 0,
        "scenes": [{"nodes": [0] if primitives else []}],
    }
    if not primitives:
        del tree["scenes"][0]["nodes"]
        return container(tree, b"")
    tree |= {
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
    }
    return container(tree, b"".join(chunks))


def material_of(color: tuple[float, float, float, float]) -> dict[str, object]:
    """A glTF material of a colour."""
    # glTF wants linear light; the colours of meshes, files and screens are sRGB.
    rgba = np.clip(color, 0, 1)
    linear = np.where(rgba <= 0.04045, rgba / 12.92, ((rgba + 0.055) / 1.055) ** 2.4)
    factor = [round(float(c), 6) for c in (*linear[:3], rgba[3])]
    material: dict[str, object] = {
        "pbrMetallicRoughness": {"baseColorFactor": factor, "metallicFactor": 0.0, "roughnessFactor": 0.7},
        "doubleSided": True,
    }
    if factor[3] < 1:
        material["alphaMode"] = "BLEND"
    return material


def container(tree: dict[str, object], binary: bytes) -> bytes:
    """A binary glTF file of its JSON and its buffer."""
    if binary:
        tree["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(tree, separators=(",", ":"), sort_keys=True).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


_RECORD = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])


def stl_bytes(mesh: Mesh) -> bytes:
    """Binary STL in metres, z up."""
    records = np.zeros(len(mesh.faces), _RECORD)
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    records["vertices"] = corners
    return b"seerob, metres, z up".ljust(80) + len(records).to_bytes(4, "little") + records.tobytes()


def glb_y_up(*meshes: Mesh) -> bytes:
    """Binary glTF as the format has it: metres, y up; one part, split by colour where there are several."""
    return glb_bytes([mesh.moved(Y_UP) for mesh in meshes])


WRITERS: dict[str, Callable[[Mesh], bytes]] = {".stl": stl_bytes, ".glb": glb_y_up}


def check_format(path: Path) -> None:
    """Refuse a file name whose ending is no format that can be written."""
    if path.suffix.lower() not in WRITERS:
        raise InputError.at(
            path, "", f"{path.suffix or 'no ending'} cannot be written", f"end it in {' or '.join(WRITERS)}"
        )


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Write a mesh in the format that the file's ending says; all of it or nothing.

    Raises:
        InputError: An ending that is no format, or a file that cannot be written.
    """
    check_format(path)
    data = WRITERS[path.suffix.lower()](mesh)
    try:
        with whole_file(path) as hidden:
            hidden.write_bytes(data)
    except OSError as error:
        raise InputError.at(
            path, "", f"cannot be written: {error.strerror or error}", "choose another place"
        ) from error
