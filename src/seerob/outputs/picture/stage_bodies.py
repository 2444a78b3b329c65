"""The bodies of a scene as arrays: read once, placed for any snapshot, coloured to be told apart.

Meshes back from binary glTF: as much of the format as our own writer uses, read with care.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding, Scene, Snapshot
from seerob.core.transforms import Array, rotation_from_wxyz

MAX_BYTES = 512 * 2**20
_COMPONENTS: dict[int, str] = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3}


class Primitive(NamedTuple):
    """Triangles of one colour."""

    vertices: Array
    """[m], z up, shape (n, 3)."""
    normals: Array
    """Unit, shape (n, 3)."""
    faces: NDArray[np.int32]
    """Shape (m, 3)."""
    color: tuple[float, float, float]
    """sRGB, 0…1."""
    alpha: float = 1.0
    """Opacity, 0…1."""


def read_glb(data: bytes, name: str) -> tuple[Primitive, ...]:
    """Triangles of a file; node transforms are not in use and must be absent.

    Raises:
        InputError: Cut off, not binary glTF 2, or it uses something that our writer does not.
    """
    try:
        return _read(data)
    except (KeyError, IndexError, TypeError, ValueError, struct.error, RecursionError) as error:
        what = f"is not a mesh that seerob wrote: {type(error).__name__} {error}"
        raise InputError.at(name, "mesh", what, "record again") from error


def _read(data: bytes) -> tuple[Primitive, ...]:
    magic, version, total = struct.unpack_from("<4sII", data)
    if magic != b"glTF" or version != 2 or total > len(data) or total > MAX_BYTES:
        raise ValueError("header")
    length, kind = struct.unpack_from("<I4s", data, 12)
    if kind != b"JSON" or 20 + length > total:
        raise ValueError("JSON chunk")
    document: dict[str, Any] = json.loads(data[20 : 20 + length])
    blob = b""
    if 20 + length + 8 <= total:
        size, kind = struct.unpack_from("<I4s", data, 20 + length)
        blob = data[28 + length : 28 + length + size]
        if kind != b"BIN\0" or len(blob) != size:
            raise ValueError("binary chunk")
    primitives = []
    for node in document.get("nodes", ()):
        if {"matrix", "translation", "rotation", "scale"} & set(node):
            raise ValueError("node with a transform")
    for mesh in document.get("meshes", ()):
        for primitive in mesh["primitives"]:
            if primitive.get("mode", 4) != 4:
                raise ValueError("primitive that is not triangles")
            primitives.append(_primitive(document, blob, primitive))
    return tuple(primitives)


def _primitive(document: dict[str, Any], blob: bytes, primitive: dict[str, Any]) -> Primitive:
    vertices = _accessor(document, blob, primitive["attributes"]["POSITION"], "VEC3").astype(np.float64)
    faces = _accessor(document, blob, primitive["indices"], "SCALAR").reshape(-1, 3).astype(np.int64)
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise ValueError("index out of range")
    if not np.isfinite(vertices).all():
        raise ValueError("vertex that is not finite")
    normals = None
    if "NORMAL" in primitive["attributes"]:
        normals = _accessor(document, blob, primitive["attributes"]["NORMAL"], "VEC3").astype(np.float64)
    if normals is None or normals.shape != vertices.shape or not np.isfinite(normals).all():
        corners = vertices[faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        vertices, normals = corners.reshape(-1, 3), np.repeat(normal, 3, axis=0)
        faces = np.arange(len(vertices)).reshape(-1, 3)
    factor, alpha = [0.7, 0.7, 0.7, 1.0], 1.0
    if "material" in primitive:
        material = document["materials"][primitive["material"]]
        factor = [float(x) for x in material.get("pbrMetallicRoughness", {}).get("baseColorFactor", factor)]
        if len(factor) != 4 or not np.isfinite(factor).all():
            raise ValueError("base colour")
        # In glTF the fourth number counts only where blending is asked for.
        if material.get("alphaMode") == "BLEND":
            alpha = min(max(factor[3], 0.0), 1.0)
    linear = np.clip(np.array(factor[:3], float), 0, 1)
    r, g, b = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055).tolist()
    return Primitive(vertices, normals, faces.astype(np.int32), (r, g, b), alpha)


def _accessor(document: dict[str, Any], blob: bytes, index: int, kind: str) -> NDArray[Any]:
    accessor = document["accessors"][index]
    if accessor["type"] != kind or "sparse" in accessor:
        raise ValueError("accessor")
    view = document["bufferViews"][accessor["bufferView"]]
    if view.get("byteStride") or view.get("buffer", 0) != 0:
        raise ValueError("buffer view")
    dtype = np.dtype(_COMPONENTS[accessor["componentType"]])
    offset = int(view.get("byteOffset", 0)) + int(accessor.get("byteOffset", 0))
    count = int(accessor["count"]) * _WIDTHS[kind]
    if offset < 0 or count < 0 or offset + count * dtype.itemsize > len(blob):
        raise ValueError("accessor beyond the data")
    return np.frombuffer(blob, dtype, count, offset).reshape(-1, _WIDTHS[kind])


Ints = NDArray[np.int32]

MOVERS = ("robot", "human", "tool", "workpiece")
"""Roles that a picture is about; the others are pale."""
SKIN = np.array([0.84, 0.71, 0.61])
"""A person, whatever the colour of the mesh: warm, unlike any machine."""
_BYSTANDER = np.array([0.86, 0.87, 0.88])
_SHADES = (1.0, 0.86)
"""Neighbouring links and bones alternate between these."""
_CREASE = np.cos(np.deg2rad(30))


@dataclass(frozen=True, eq=False)
class Clear:
    """A translucent body, such as a safety area."""

    node: int
    """Index in `Scene.nodes`."""
    vertices: Array
    """In the body's frame [m], shape (n, 3)."""
    faces: Ints
    edges: NDArray[np.int64]
    """Creases, as pairs of vertices, shape (k, 2)."""
    color: tuple[float, float, float]
    alpha: float


@dataclass(frozen=True, eq=False)
class Bodies:
    """Opaque triangles of all nodes in one set of arrays, and the translucent bodies by themselves."""

    vertices: Array
    """In the frame of its node [m], shape (n, 3)."""
    normals: Array
    node: NDArray[np.int64]
    """Index in `Scene.nodes` per vertex, shape (n,)."""
    faces: Ints
    ids: Ints
    """Row of ``colors`` per triangle."""
    colors: Array
    """sRGB, shape (k, 3)."""
    color_node: NDArray[np.int64]
    """Index in `Scene.nodes` per color, shape (k,)."""
    clear: tuple[Clear, ...]
    findings: tuple[Finding, ...]
    """Nodes whose mesh cannot be read."""

    def placed(self, snapshot: Snapshot) -> tuple[Array, Array]:
        """Vertices [m] and normals in the world."""
        position, rotation = poses(snapshot)
        turned = rotation[self.node]
        vertices = np.einsum("nij,nj->ni", turned, self.vertices) + position[self.node]
        return vertices, np.einsum("nij,nj->ni", turned, self.normals)


def poses(snapshot: Snapshot) -> tuple[Array, Array]:
    """Positions [m] (n, 3) and rotations (n, 3, 3) of the nodes."""
    each = np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7).astype(float)
    # A node that nobody placed has no orientation; it stays where it was drawn.
    wxyz = np.where(np.linalg.norm(each[:, 3:], axis=1, keepdims=True) > 0, each[:, 3:], [1.0, 0, 0, 0])
    return each[:, :3], rotation_from_wxyz(wxyz)


def read_bodies(scene: Scene, meshes: dict[str, bytes]) -> Bodies:
    """Read the mesh of every node; one that cannot be read becomes a finding."""
    solid: list[tuple[int, Primitive, Array]] = []
    clear: list[Clear] = []
    findings: list[Finding] = []
    read: dict[str, tuple[Primitive, ...]] = {}
    count: dict[str, int] = {}
    for i, node in enumerate(scene.nodes):
        data = meshes.get(node.mesh or "")
        if data is None or node.mesh is None:
            continue
        try:
            primitives = read.get(node.mesh) or read_glb(data, node.name)
        except InputError as error:
            text = f"its mesh cannot be shown in pictures: {error.problems[0].what}"
            findings.append(Finding(level="warning", subject=node.name, text=text))
            continue
        read[node.mesh] = primitives
        nth = count[node.owner] = count.get(node.owner, -1) + 1
        for p in primitives:
            if p.alpha < 1:
                clear.append(Clear(i, p.vertices, p.faces, creases(p.vertices, p.faces), p.color, p.alpha))
            else:
                solid.append((i, p, tone(node.role, np.array(p.color), nth)))
    starts = np.cumsum([0, *(len(p.vertices) for _, p, _ in solid)])
    sizes = [len(p.vertices) for _, p, _ in solid]
    return Bodies(
        vertices=np.concatenate([np.zeros((0, 3)), *(p.vertices for _, p, _ in solid)]),
        normals=np.concatenate([np.zeros((0, 3)), *(p.normals for _, p, _ in solid)]),
        node=np.repeat(np.array([i for i, _, _ in solid], np.int64), sizes),
        faces=np.concatenate(
            [np.zeros((0, 3)), *(p.faces + at for (_, p, _), at in zip(solid, starts, strict=False))]
        ).astype(np.int32),
        ids=np.repeat(np.arange(len(solid), dtype=np.int32), [len(p.faces) for _, p, _ in solid]),
        colors=np.array([color for _, _, color in solid]).reshape(-1, 3),
        color_node=np.array([i for i, _, _ in solid], np.int64),
        clear=tuple(clear),
        findings=tuple(findings),
    )


def tone(role: str, color: Array, nth: int) -> Array:
    """Colour of the ``nth`` body of its owner, sRGB, shape (3,)."""
    if role == "human":
        return np.asarray(SKIN * (1.0, 0.93)[nth % 2])
    if role == "robot":
        return np.asarray(color * _SHADES[nth % 2])
    return color if role in MOVERS else np.asarray(0.55 * color + 0.45 * _BYSTANDER)


def creases(vertices: Array, faces: Ints) -> NDArray[np.int64]:
    """Edges where a surface bends by more than 30° or ends, as pairs of vertices, shape (k, 2).

    Vertices at one place count as one, for shading doubles them along creases.
    """
    _, first, place = np.unique(np.round(vertices, 6), axis=0, return_index=True, return_inverse=True)
    corner = place.reshape(-1)[faces.astype(np.int64)]
    # A triangle without area bends nothing; poles of spheres are made of them.
    corner = corner[(corner != np.roll(corner, -1, axis=1)).all(axis=1)]
    at = vertices[first][corner]
    normal = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    sides = np.sort(np.stack([corner, np.roll(corner, -1, axis=1)], -1).reshape(-1, 2), axis=1)
    pairs, which, times = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    total = np.zeros((len(pairs), 3))
    np.add.at(total, which.reshape(-1), np.repeat(normal, 3, axis=0))
    # |a + b|² = 2 + 2 cos of the bend, for two unit normals.
    smooth = (times == 2) & ((total**2).sum(axis=1) > 2 + 2 * _CREASE)
    return np.asarray(first[pairs[~smooth]], np.int64).reshape(-1, 2)
