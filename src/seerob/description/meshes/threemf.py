"""3MF core: objects, components and build items, with their colours and the unit of the model.

Read here and not by trimesh 5.2.0, which accepted a model with a document type and an entity; it is refused
here. The price: a sphere of 81 920 triangles takes 1197 ms here and 406 ms there.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from seerob.core.files.bounded import TooLarge, unpacked
from seerob.core.transforms import Array
from seerob.description.mesh_files import Color, MeshSource, RawFile, RawMesh

_METERS = {
    "micron": 1e-6,
    "millimeter": 1e-3,
    "centimeter": 1e-2,
    "inch": 0.0254,
    "foot": 0.3048,
    "meter": 1.0,
}
_MAX_INSTANCES = 100_000
_ROOT = "3D/3dmodel.model"


@dataclass(eq=False)
class _Object:
    name: str
    vertices: Array
    faces: NDArray[np.int64]
    color: Color | None
    components: list[tuple[str, str | None, Array]] = field(default_factory=list)


def read(source: MeshSource) -> RawFile:
    """Meshes of the build items, components followed into other parts of the package."""
    with source.parsing("3MF package"):
        package = zipfile.ZipFile(io.BytesIO(source.data))
        reader = _Package(source, package)
        root = reader.model(reader.start())
        unit = root.get("unit", "millimeter")
        if unit not in _METERS:
            source.fail(f"its unit is {unit[:40]!r}", "one of " + ", ".join(_METERS), "model/unit")
        meshes = reader.instances(root)
    return RawFile(tuple(meshes), _METERS[unit], "z")


class _Package:
    def __init__(self, source: MeshSource, package: zipfile.ZipFile) -> None:
        self.source, self.package = source, package
        self.entries = {name.lower(): name for name in package.namelist()}
        self.objects: dict[tuple[str, str | None], _Object] = {}
        self.models: dict[str, Element] = {}
        self.left = source.max_bytes
        """How much more of the package is unpacked [byte]."""

    def start(self) -> str:
        """The part that the package's relationships call its 3D model."""
        if "_rels/.rels" in self.entries:
            for relation in self._xml("_rels/.rels"):
                if relation.get("Type", "").endswith("/3dmodel"):
                    return str(relation.get("Target", _ROOT)).strip("/")
        return _ROOT

    def _xml(self, part: str) -> Element:
        from defusedxml.ElementTree import fromstring

        name = self.entries.get(part.lower())
        if name is None:
            self.source.fail(f"has no part {part[:200]!r}", "export it again")
        try:
            text = unpacked(self.package, name, self.left)
        except TooLarge as error:
            self.source.fail(f"{name[:200]}: {error}", "raise max_bytes")
        self.left -= len(text)
        root: Element = fromstring(text, forbid_dtd=True)
        return root

    def model(self, part: str) -> Element:
        """Root element of a model part; its objects are remembered."""
        if part in self.models:
            return self.models[part]
        root = self.models[part] = self._xml(part)
        colors: dict[tuple[str | None, int], Color] = {}
        for group in root.iterfind(".//{*}basematerials"):
            for number, base in enumerate(group.findall("{*}base")):
                colors[group.get("id"), number] = _color(base.get("displaycolor", ""))
        for element in root.iterfind(".//{*}object"):
            if element.get("type", "model") in {"support", "other"}:
                continue
            self.objects[part, element.get("id")] = self._object(part, element, colors)
        return root

    def _object(self, part: str, element: Element, colors: dict[tuple[str | None, int], Color]) -> _Object:
        vertices = [[v.get(k) for k in "xyz"] for v in element.iterfind("{*}mesh/{*}vertices/{*}vertex")]
        faces = [
            [t.get(k) for k in ("v1", "v2", "v3")]
            for t in element.iterfind("{*}mesh/{*}triangles/{*}triangle")
        ]
        color = colors.get((element.get("pid", ""), int(element.get("pindex", 0))))
        found = _Object(
            element.get("name") or f"object_{element.get('id')}",
            np.array(vertices, float).reshape(-1, 3),
            np.array(faces, np.int64).reshape(-1, 3),
            color,
        )
        for component in element.iterfind("{*}components/{*}component"):
            # The production extension puts objects into other parts of the package.
            path = next((v for k, v in component.items() if k.endswith("}path")), part)
            found.components.append((path.strip("/"), component.get("objectid"), self._matrix(component)))
        return found

    def _matrix(self, element: Element) -> Array:
        text = element.get("transform")
        if text is None:
            return np.eye(4)
        values = np.array(text.split(), float)
        if values.shape != (12,) or not np.isfinite(values).all():
            self.source.fail(f"a transform is {text[:80]!r}", "twelve numbers are expected")
        matrix = np.eye(4)
        # 3MF multiplies row vectors from the left.
        matrix[:3, :] = values.reshape(4, 3).T
        return matrix

    def instances(self, root: Element) -> list[RawMesh]:
        """Every mesh that the build holds, moved to where it is built."""
        items = list(root.iterfind("{*}build/{*}item"))
        if not items:
            self.source.fail("builds nothing: its <build> is empty", "export it again")
        start = next(part for part, model in self.models.items() if model is root)
        stack: list[tuple[str, str | None, Array, tuple[str, ...], tuple[tuple[str, str | None], ...]]] = []
        for item in reversed(items):
            path = next((v for k, v in item.items() if k.endswith("}path")), start)
            stack.append((path.strip("/"), item.get("objectid"), self._matrix(item), (), ()))
        meshes: list[RawMesh] = []
        seen = faces = 0
        while stack:
            part, identity, matrix, names, above = stack.pop()
            seen += 1
            if seen > _MAX_INSTANCES or faces > self.source.max_faces:
                self.source.fail("has too many instances: more triangles than are read", "raise max_faces")
            self.model(part)
            found = self.objects.get((part, identity))
            if found is None:
                self.source.fail(f"builds object {identity!r}, which does not exist", "export it again")
            if (part, identity) in above:
                self.source.fail(f"object {identity!r} contains itself", "export it again")
            path_names = (*names, found.name)
            if len(found.faces):
                name, label = "/".join(path_names), f"{found.name}#{part}.{identity}"
                meshes.append(RawMesh(name, found.vertices, found.faces, found.color, matrix, label))
                faces += len(found.faces)
            for p, i, below in reversed(found.components):
                stack.append((p, i, matrix @ below, path_names, (*above, (part, identity))))
        return meshes


def _color(text: str) -> Color:
    digits = text.lstrip("#")
    if len(digits) not in {6, 8}:
        return (0.7, 0.72, 0.75, 1.0)
    r, g, b, a = (int((digits + "ff")[i : i + 2], 16) / 255 for i in (0, 2, 4, 6))
    return r, g, b, a
