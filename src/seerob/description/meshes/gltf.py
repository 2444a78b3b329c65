"""glTF 2.0, text or binary: geometry, base colours and the tree of nodes; metres, y up by definition.

Read here and not by trimesh 5.2.0, which accepted a file that requires an extension it cannot honour
(KHR_draco_mesh_compression) and nodes in a circle; both are refused here. A sphere of 81 920 triangles as GLB
takes 1 ms here and 2 ms there.
"""

from __future__ import annotations

import base64
import binascii
import json
from typing import Any

import numpy as np

from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.description.mesh_files import Color, MeshSource, RawFile, RawMesh

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_mesh_quantization", "KHR_lights_")
_MAX_DEPTH = 200
_MAX_ZEROS = 5_000_000
"""Elements that an accessor may have without data of its own."""


def read(source: MeshSource) -> RawFile:
    """Meshes of the default scene, one per primitive, named by their path in the tree of nodes.

    The primitives of one node are one part, split by material.
    """
    tree, binary = _split(source)
    with source.parsing("glTF file"):
        if not isinstance(tree, dict) or not str(tree.get("asset", {}).get("version", "")).startswith("2."):
            source.fail("is not glTF 2.0", "export it as glTF 2.0")
        for extension in tree.get("extensionsRequired", ()):
            if not str(extension).startswith(_HARMLESS):
                source.fail(f"needs the extension {str(extension)[:80]}", "export it without compression")
        return RawFile(tuple(_Reader(source, tree, binary).meshes()), 1.0, "y")


def _split(source: MeshSource) -> tuple[Any, bytes]:
    """The JSON tree and the binary chunk."""
    data = source.data
    if data[:4] != b"glTF":
        if source.path.suffix.lower() == ".glb":
            source.fail("is not binary glTF: it does not begin with 'glTF'", "export it again")
        return _json(source, data), b""
    length = int.from_bytes(data[8:12], "little")
    if len(data) < 20 or length > len(data):
        source.fail(f"is truncated: {length} bytes announced, {len(data)} are there", "export it again")
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        if at + 8 + size > length:
            source.fail(f"is truncated: a chunk of {size} bytes does not fit", "export it again")
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    return _json(source, chunks.get(b"JSON", b"")), chunks.get(b"BIN\0", b"")


def _json(source: MeshSource, data: bytes) -> Any:
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        source.fail(f"its JSON cannot be read ({str(error)[:120]})", "export it again")


class _Reader:
    def __init__(self, source: MeshSource, tree: dict[str, Any], binary: bytes) -> None:
        self.source, self.tree, self.binary = source, tree, binary
        self.buffers: dict[int, bytes] = {}
        self.arrays: dict[int, Any] = {}

    def item(self, table: str, index: Any) -> dict[str, Any]:
        rows = self.tree.get(table, [])
        if not isinstance(index, int) or not 0 <= index < len(rows):
            self.source.fail(f"names {table}[{index}] of {len(rows)}", "export it again")
        found: dict[str, Any] = rows[index]
        return found

    def meshes(self) -> list[RawMesh]:
        nodes = self.tree.get("nodes", [])
        if self.tree.get("scenes"):
            roots = self.item("scenes", self.tree.get("scene", 0)).get("nodes", [])
            if len(self.tree["scenes"]) > 1:
                self.source.note(f"only the default one of {len(self.tree['scenes'])} scenes was read")
        else:
            children = {c for n in nodes for c in n.get("children", ())}
            roots = [i for i in range(len(nodes)) if i not in children]
        found: list[RawMesh] = []
        visited = faces = 0
        stack: list[tuple[Any, Array, tuple[str, ...]]] = [(i, np.eye(4), ()) for i in reversed(roots)]
        while stack:
            index, above, names = stack.pop()
            visited += 1
            if visited > len(nodes) or len(names) > _MAX_DEPTH:
                self.source.fail("its nodes do not form a tree", "export it again", f"nodes[{index}]")
            node = self.item("nodes", index)
            matrix = above @ self.matrix(node, index)
            path = (*names, str(node.get("name") or f"node_{index}"))
            if "mesh" in node:
                if "skin" in node:
                    self.source.note(f"{'/'.join(path)}: skinned; read in its bind pose", level="warning")
                for mesh in self.primitives(node["mesh"], matrix, "/".join(path), visited):
                    faces += len(mesh.faces)
                    if faces > self.source.max_faces:
                        self.source.fail(
                            f"has more than {self.source.max_faces} triangles", "raise max_faces"
                        )
                    found.append(mesh)
            stack.extend((c, matrix, path) for c in reversed(node.get("children", ())))
        return found

    def matrix(self, node: dict[str, Any], index: int) -> Array:
        matrix = np.eye(4)
        if "matrix" in node:
            matrix = np.array(node["matrix"], float).reshape(4, 4).T
        else:
            x, y, z, w = node.get("rotation", (0, 0, 0, 1))
            scale = np.array(node.get("scale", (1, 1, 1)), float)
            matrix[:3, :3] = rotation_from_wxyz((w, x, y, z)) * scale
            matrix[:3, 3] = node.get("translation", (0, 0, 0))
        if not np.isfinite(matrix).all():
            self.source.fail("a transform is not finite", "export it again", f"nodes[{index}]")
        return matrix

    def primitives(self, index: Any, matrix: Array, name: str, part: int) -> list[RawMesh]:
        meshes = []
        for number, primitive in enumerate(self.item("meshes", index).get("primitives", ())):
            mode = primitive.get("mode", 4)
            if mode not in {4, 5, 6}:
                self.source.note(f"{name}: points or lines are not a surface and were left out")
                continue
            if primitive.get("targets"):
                self.source.note(f"{name}: morph targets ignored", level="warning")
            position = self.array(primitive["attributes"]["POSITION"])
            if position.shape[1:] != (3,):
                self.source.fail("positions are not triples", "export it again", name)
            corners = (
                self.array(primitive["indices"]).ravel().astype(np.int64)
                if "indices" in primitive
                else np.arange(len(position))
            )
            faces, color = _triangles(corners, mode), self.color(primitive.get("material"), name)
            label = f"{self.item('meshes', index).get('name') or ''}#{index}.{number}"
            meshes.append(RawMesh(name, position.astype(float), faces, color, matrix, label, part))
        return meshes

    def color(self, index: Any, name: str) -> Color | None:
        if index is None:
            return None
        material = self.item("materials", index)
        surface = material.get("pbrMetallicRoughness", {})
        if "baseColorTexture" in surface:
            self.source.note(f"{name}: its texture is not used: a plain colour instead")
        linear = np.clip(np.array(surface.get("baseColorFactor", (1, 1, 1, 1)), float), 0, 1)
        srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        alpha = float(linear[3]) if material.get("alphaMode") == "BLEND" else 1.0
        return float(srgb[0]), float(srgb[1]), float(srgb[2]), alpha

    def array(self, index: Any) -> Any:
        if index not in self.arrays:
            self.arrays[index] = self.accessor(self.item("accessors", index), index)
        return self.arrays[index]

    def accessor(self, accessor: dict[str, Any], index: int) -> Any:
        component, width = accessor["componentType"], _WIDTHS[accessor["type"]]
        count = int(accessor["count"])
        dtype = np.dtype(_COMPONENTS[component])
        if count < 0 or ("bufferView" not in accessor and count > _MAX_ZEROS):
            self.source.fail(f"accessors[{index}] has {count} elements", "export it again")
        if "bufferView" in accessor:
            values = self.view(accessor["bufferView"], accessor.get("byteOffset", 0), dtype, count, width)
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            at, new, many = sparse["indices"], sparse["values"], int(sparse["count"])
            integer = np.dtype(_COMPONENTS[at["componentType"]])
            where = self.view(at["bufferView"], at.get("byteOffset", 0), integer, many, 1).ravel()
            values = values.copy()
            values[where] = self.view(new["bufferView"], new.get("byteOffset", 0), dtype, many, width)
        if accessor.get("normalized") and dtype.kind != "f":
            values = np.maximum(values / float(np.iinfo(dtype).max), -1.0)
        return values

    def view(self, index: Any, offset: int, dtype: np.dtype[Any], count: int, width: int) -> Any:
        view = self.item("bufferViews", index)
        data = self.buffer(view["buffer"])
        start, size = int(view.get("byteOffset", 0)), int(view["byteLength"])
        stride = int(view.get("byteStride", dtype.itemsize * width))
        needed = offset + (count - 1) * stride + dtype.itemsize * width if count else 0
        if (
            min(start, size, offset, stride - dtype.itemsize * width) < 0
            or start + size > len(data)
            or needed > size
        ):
            self.source.fail(f"bufferViews[{index}] reaches past its data: truncated?", "export it again")
        return np.ndarray((count, width), dtype, data, start + offset, (stride, dtype.itemsize))

    def buffer(self, index: Any) -> bytes:
        if index not in self.buffers:
            uri = self.item("buffers", index).get("uri")
            self.buffers[index] = self.binary if uri is None else self.fetched(str(uri))
        return self.buffers[index]

    def fetched(self, uri: str) -> bytes:
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except binascii.Error as error:
                self.source.fail(f"a data URI is broken ({error})", "export it again")
        data = self.source.beside(uri)
        if data is None:
            self.source.fail(f"its data, {uri[:200]!r}, is not beside it", "copy it there or export a GLB")
        return data


def _triangles(corners: Any, mode: int) -> Any:
    if mode == 4:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if len(corners) < 3:
        return np.empty((0, 3), np.int64)
    if mode == 6:
        return np.column_stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]])
    strip = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
    # Every other triangle of a strip runs backward.
    strip[1::2] = strip[1::2, [1, 0, 2]]
    return strip
