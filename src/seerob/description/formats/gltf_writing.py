"""A cell as one binary glTF file: a node for each body, named as it is, y up as the format has it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from seerob.core.shapes import Mesh
from seerob.core.transforms import Array, wxyz_from_rotation
from seerob.description.description import Description
from seerob.description.shapes.glb import Y_UP, container, material_of, shaded, solid_mesh

_FLOAT, _UINT = 5126, 5125
_ARRAY, _ELEMENTS = 34962, 34963


def written(cell: Description, world: Mapping[str, Array]) -> bytes:
    """The file.

    Args:
        cell: Its first link is the world.
        world: Pose of each link in the world (4, 4); joints stay as they are there.
    """
    made = _Binary()
    children: dict[tuple[str, ...], list[int]] = {(): []}
    nodes: list[dict[str, Any]] = []

    def group(names: tuple[str, ...]) -> list[int]:
        if names not in children:
            above = group(names[:-1])
            children[names] = []
            above.append(len(nodes))
            nodes.append({"name": names[-1], "children": children[names]})
        return children[names]

    for link in cell.links[1:]:
        meshes = link.visual or tuple(solid_mesh(solid) for solid in link.solids)
        meshes = tuple(mesh for mesh in meshes if len(mesh.faces))
        if not meshes:
            continue
        names = tuple(link.name.split("/"))
        at = Y_UP @ world[link.name] @ Y_UP.T
        w, x, y, z = map(float, wxyz_from_rotation(at[:3, :3]))
        node: dict[str, Any] = {
            "name": names[-1],
            "mesh": made.mesh(meshes, names[-1]),
            "translation": [float(v) for v in at[:3, 3]],
            "rotation": [x, y, z, w],
        }
        above = group(names[:-1])
        above.append(len(nodes))
        nodes.append(node)
    tree: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "seerob"},
        "scene": 0,
        "scenes": [{"name": cell.name, "nodes": children[()]}],
        "nodes": nodes,
        **made.tree(),
    }
    return container({key: value for key, value in tree.items() if value or key == "scene"}, made.content())


class _Binary:
    """Meshes of a file, each content once."""

    def __init__(self) -> None:
        self.chunks: list[bytes] = []
        self.size = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []
        self.materials: list[dict[str, object]] = []
        self._colors: dict[tuple[float, ...], int] = {}
        self._known: dict[bytes, int] = {}

    def mesh(self, meshes: tuple[Mesh, ...], name: str) -> int:
        """Number of a mesh of several colours."""
        key = b"".join(m.vertices.tobytes() + m.faces.tobytes() + repr(m.color).encode() for m in meshes)
        if key not in self._known:
            self._known[key] = len(self.meshes)
            self.meshes.append({"name": name, "primitives": [self._primitive(mesh) for mesh in meshes]})
        return self._known[key]

    def _primitive(self, mesh: Mesh) -> dict[str, Any]:
        vertices, normals, faces = shaded(mesh.moved(Y_UP))
        position = vertices.astype("<f4")
        low, high = ([float(x) for x in end] for end in (position.min(axis=0), position.max(axis=0)))
        if mesh.color not in self._colors:
            self._colors[mesh.color] = len(self.materials)
            self.materials.append(material_of(mesh.color))
        return {
            "attributes": {
                "POSITION": self._add(position, "VEC3", _FLOAT, _ARRAY, min=low, max=high),
                "NORMAL": self._add(normals.astype("<f4"), "VEC3", _FLOAT, _ARRAY),
            },
            "indices": self._add(faces.ravel().astype("<u4"), "SCALAR", _UINT, _ELEMENTS),
            "material": self._colors[mesh.color],
        }

    def _add(self, array: NDArray[Any], kind: str, component: int, target: int, **extra: object) -> int:
        data = array.tobytes()
        view = {"buffer": 0, "byteOffset": self.size, "byteLength": len(data), "target": target}
        self.views.append(view)
        number = len(self.accessors)
        said = {"bufferView": number, "componentType": component, "count": len(array), "type": kind, **extra}
        self.accessors.append(said)
        padded = data + bytes(-len(data) % 4)
        self.chunks.append(padded)
        self.size += len(padded)
        return number

    def tree(self) -> dict[str, Any]:
        """What of the file's JSON is about meshes."""
        return {
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
        }

    def content(self) -> bytes:
        """The buffer."""
        return b"".join(self.chunks)
