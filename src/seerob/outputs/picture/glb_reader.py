"""Meshes back from binary glTF: as much of the format as our own writer uses, read with care."""

from __future__ import annotations

import json
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.transforms import Array

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
