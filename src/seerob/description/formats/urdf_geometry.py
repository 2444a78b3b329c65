"""Shapes of a URDF link: what the screen shows and what distances see."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from xml.etree.ElementTree import Element

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.shapes import Mesh, Solid, capsule
from seerob.core.transforms import Array, apply
from seerob.description.formats.resolve import Resolver
from seerob.description.mesh import LoadedMeshes, load_meshes
from seerob.description.shapes import shapes
from seerob.description.shapes.detail import physics_mesh
from seerob.description.shapes.mesh_mending import with_insides
from seerob.description.xml_values import FARTHEST, SMALLEST, Reader

SHAPES = ("mesh", "box", "cylinder", "sphere", "capsule")
WITHOUT_UNIT = {".stl", ".obj", ".ply", ".off"}


@dataclass
class Shapes:
    """Reads the geometry of one URDF; each mesh file once."""

    reader: Reader
    resolver: Resolver
    colors: dict[str, shapes.Color] = field(default_factory=dict)
    files: dict[str, bytes] = field(default_factory=dict)
    loaded: dict[tuple[str, tuple[float, float, float]], LoadedMeshes | None] = field(default_factory=dict)

    def read_colors(self, robot: Element) -> None:
        """Remembers the materials that the robot declares for all its links."""
        for i, material in enumerate(robot.findall("material")):
            self._color(material, f"material[{i}]")

    def visual(self, link: Element, name: str) -> tuple[Mesh, ...]:
        """Everything in the link's ``<visual>`` elements, in the link's frame."""
        found: list[Mesh] = []
        for key, element, kind, link_from_shape in self._elements(link, name, "visual"):
            color = self._color(element.find("material"), key)
            if kind.tag == "mesh":
                meshes = [mesh for _, mesh in self._meshes(kind, key, name)]
            else:
                solid = self._primitive(kind, key)
                meshes = [] if solid is None else [solid[1]]
            for mesh in meshes:
                shown = mesh.moved(link_from_shape)
                found.append(replace(shown, color=color) if color else shown)
        return tuple(found)

    def solids(self, link: Element, name: str, tag: str) -> tuple[Solid, ...]:
        """Everything in the link's ``<collision>`` (or ``<visual>``) elements, for distances."""
        found: list[Solid] = []
        for i, (key, element, kind, link_from_shape) in enumerate(self._elements(link, name, tag)):
            label = element.get("name") or (f"{tag}_{i}" if i else tag)
            if kind.tag == "mesh":
                for part, mesh in self._meshes(kind, key, name):
                    exact = physics_mesh(mesh.moved(link_from_shape))
                    found.append(Solid(mesh=exact, name=f"{label}/{part}"))
            else:
                solid = self._primitive(kind, key)
                if solid is not None:
                    found.append(moved(replace(solid[0], name=label), link_from_shape))
        return with_insides(found)

    def _elements(self, link: Element, name: str, tag: str) -> Iterator[tuple[str, Element, Element, Array]]:
        for i, element in enumerate(link.findall(tag)):
            key = f"link[{name}].{tag}[{i}]"
            geometry = element.find("geometry")
            kinds = [] if geometry is None else [child for child in geometry if child.tag in SHAPES]
            if len(kinds) != 1:
                there = (
                    "nothing" if geometry is None else ", ".join(str(c.tag) for c in geometry) or "nothing"
                )
                self.reader.problem(
                    f"{key}.geometry", f"holds {there}", f"must hold one of {', '.join(SHAPES)}"
                )
                continue
            yield key, element, kinds[0], self.reader.origin(element, key)

    def _primitive(self, kind: Element, key: str) -> tuple[Solid, Mesh] | None:
        key = f"{key}.{kind.tag}"
        if kind.tag == "box":
            half = 0.5 * self._sizes(kind, "size", key, 3)
            mesh = shapes.box_mesh(-half, half)
            return (Solid(mesh=mesh), mesh) if half.all() else None
        radius = float(self._sizes(kind, "radius", key, 1)[0])
        if kind.tag == "sphere":
            return (
                (shapes.sphere_solid(np.zeros(3), radius), shapes.sphere_mesh(np.zeros(3), radius))
                if radius
                else None
            )
        length = float(self._sizes(kind, "length", key, 1)[0])
        if not radius or not length:
            return None
        end = np.array([0, 0, 0.5 * length])
        if kind.tag == "capsule":
            return capsule(-end, end, radius), shapes.capsule_mesh(-end, end, radius)
        return shapes.cylinder_solid(-end, end, radius), shapes.cylinder_mesh(-end, end, radius)

    def _sizes(self, kind: Element, attribute: str, key: str, count: int) -> Array:
        if kind.get(attribute) is None:
            self.reader.problem(f"{key}.{attribute}", "is missing", "say it in metres")
            return np.zeros(count)
        before = len(self.reader.problems)
        values = self.reader.numbers(kind, attribute, key, (0.0,) * count)
        if len(self.reader.problems) == before and not (values > 0).all():
            self.reader.problem(f"{key}.{attribute}", f"is {kind.get(attribute)}", "must be greater than 0 m")
            return np.zeros(count)
        if values.all() and not ((values >= SMALLEST) & (values <= FARTHEST)).all():
            remedy = f"must be from {SMALLEST:g} m to {FARTHEST:g} m"
            self.reader.problem(f"{key}.{attribute}", f"is {kind.get(attribute)}", remedy)
            return np.zeros(count)
        return values

    def _meshes(self, kind: Element, key: str, link: str) -> list[tuple[str, Mesh]]:
        uri = kind.get("filename", "")
        scale = self.reader.numbers(kind, "scale", f"{key}.mesh", (1.0, 1.0, 1.0))
        x, y, z = scale.tolist()
        if not uri or not (x and y and z):
            what = f"scale is {kind.get('scale')}" if uri else "has no filename"
            self.reader.problem(f"{key}.mesh", what, "a scale is not 0" if uri else "name a mesh file")
            return []
        if (uri, (x, y, z)) not in self.loaded:
            self.loaded[uri, (x, y, z)] = self._load(uri, (x, y, z), key, link)
        loaded = self.loaded[uri, (x, y, z)]
        return [] if loaded is None else [(named.name, named.mesh) for named in loaded.meshes]

    def _load(self, uri: str, scale: tuple[float, float, float], key: str, link: str) -> LoadedMeshes | None:
        found = self.resolver.find(uri)
        if isinstance(found, Problem):
            self.reader.problem(f"{key}.mesh", f"{uri}: {found.what}", found.remedy)
            return None
        if found.remark:
            self.reader.finding("warning", link, found.remark)
        unitless = found.path.suffix.lower() in WITHOUT_UNIT
        try:
            # URDF lengths are metres; formats that state their unit are believed.
            loaded = load_meshes(
                found.path, units="m" if unitless else None, up="z" if unitless else None, scale=scale
            )
        except InputError as error:
            for problem in error.problems:
                self.reader.problem(f"{key}.mesh", f"{uri}: {problem.key} {problem.what}", problem.remedy)
            return None
        for finding in loaded.findings:
            self.reader.finding(finding.level, link, f"{uri}: {finding.text}")
        folder = uri.rpartition("/")[0]
        for name, content in loaded.files.items():
            key = uri if name == found.path.name else f"{folder}/{PurePosixPath(name)}".lstrip("/")
            self.files[key] = content
        return loaded

    def _color(self, material: Element | None, key: str) -> shapes.Color | None:
        if material is None:
            return None
        name, color = material.get("name", ""), material.find("color")
        if color is None:
            return self.colors.get(name)
        r, g, b, a = np.clip(
            self.reader.numbers(color, "rgba", f"{key}.color", (0.7, 0.72, 0.75, 1.0)), 0, 1
        ).tolist()
        if name:
            self.colors[name] = (r, g, b, a)
        return (r, g, b, a)


def moved(solid: Solid, a_from_b: Array) -> Solid:
    """Return the solid expressed in frame ``a``, given the transform (4, 4) from its own frame ``b``."""
    if solid.mesh is not None:
        return replace(solid, mesh=solid.mesh.moved(a_from_b))
    assert solid.points is not None
    return replace(solid, points=apply(a_from_b, solid.points))
