"""Wavefront OBJ with the colours of its material libraries; it knows neither unit nor axes.

Read here because trimesh 5.2.0 changes surfaces without a word: it cuts a concave face into a fan that leaves
it (an arrow head of 0.5 m² becomes triangles of 2 m² and 1.5 m² the other way round), drops a face with too
few corners behind good ones, reads index 0, which no file can mean, as a vertex, and joins objects of one
material. `tests/model_io/test_mesh_formats.py` shows each. Price: a sphere of 81 920
triangles took 440 ms here and 168 ms there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seerob.core.transforms import Array
from seerob.description.mesh_files import Color, MeshSource, RawFile, RawMesh, triangles

_Key = tuple[str, str]


def read(source: MeshSource) -> RawFile:
    """One mesh per object (or group, in files without objects) and material."""
    text = source.text(source.data).replace("\\\n", " ").replace("\\\r\n", " ")
    points: list[list[str]] = []
    objects: dict[_Key, list[list[str]]] = {}
    groups: dict[_Key, list[list[str]]] = {}
    libraries: list[str] = []
    name = group = material = ""
    has_objects = False
    faces: list[list[str]] | None = None
    for line in text.splitlines():
        words = line.split()
        if not words:
            continue
        keyword = words[0]
        if keyword == "v":
            points.append(words[1:])
        elif keyword == "f":
            if faces is None:
                key = (name if has_objects else group, material)
                faces = (objects if has_objects else groups).setdefault(key, [])
            faces.append(_absolute(words[1:], len(points)) if "-" in line else words[1:])
        elif keyword in {"o", "g", "usemtl"}:
            rest = line.split(None, 1)[1].strip() if len(words) > 1 else ""
            faces = None
            if keyword == "o":
                name, has_objects = rest, True
            elif keyword == "g":
                group = rest
            else:
                material = rest
        elif keyword == "mtllib":
            libraries.append(line.split(None, 1)[1].strip() if len(words) > 1 else "")
    vertices = _vertices(source, points)
    colors: dict[str, Color] = {}
    for library in libraries:
        _read_library(source, library, colors)
    parts = {**groups, **objects}
    several = len({material for _, material in parts}) > 1
    meshes = []
    for (part, material_name), polygons in parts.items():
        label = "/".join(filter(None, (part, material_name if several else "")))
        meshes.append(_mesh(source, label, vertices, polygons, colors.get(material_name)))
    return RawFile(tuple(meshes))


def _absolute(words: list[str], count: int) -> list[str]:
    """Indices counted back from the last vertex so far, made into indices from the first."""
    heads = [w.partition("/")[0] for w in words]
    return [str(count + 1 + int(h)) if h.startswith("-") and h[1:].isdigit() else h for h in heads]


def _vertices(source: MeshSource, points: list[list[str]]) -> Array:
    try:
        vertices = np.array([p[:3] for p in points], float)
    except ValueError:
        number = next(i for i, p in enumerate(points) if len(p) < 3 or not all(map(_is_number, p[:3])))
        shown = " ".join(points[number])[:80]
        source.fail(f"vertex {number + 1} is {shown!r}", "three numbers are expected")
    if points and vertices.shape[1:] != (3,):
        source.fail(f"its vertices have {vertices.shape[1]} coordinates", "three are expected")
    return vertices.reshape(-1, 3)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _mesh(
    source: MeshSource, name: str, vertices: Array, polygons: Sequence[list[str]], color: Color | None
) -> RawMesh:
    try:
        indices = [[int(w.partition("/")[0]) - 1 for w in p] for p in polygons]
    except ValueError as error:
        source.fail(f"a face's index is not a number ({error})", "export it again", name)
    for p in indices:
        if len(p) < 3:
            source.fail(f"a face has {len(p)} corners: truncated?", "export it again", name)
        if min(p) < 0 or max(p) >= len(vertices):
            source.fail(f"a face names vertex {max(p) + 1} of {len(vertices)}", "export it again", name)
    return RawMesh(name, vertices, triangles(vertices, indices), color)


def _read_library(source: MeshSource, name: str, colors: dict[str, Color]) -> None:
    data = source.beside(name) if name else None
    if data is None:
        return
    material = None
    textures = set()
    for line in source.text(data).splitlines():
        words = line.split()
        if len(words) < 2:
            continue
        keyword = words[0].lower()
        if keyword == "newmtl":
            material = line.split(None, 1)[1].strip()
            colors[material] = (0.7, 0.72, 0.75, 1.0)
        elif material is None:
            continue
        elif keyword == "kd" and len(words) >= 4 and all(map(_is_number, words[1:4])):
            r, g, b = (min(max(float(w), 0.0), 1.0) for w in words[1:4])
            colors[material] = (r, g, b, colors[material][3])
        elif keyword in {"d", "tr"} and _is_number(words[-1]):
            value = min(max(float(words[-1]), 0.0), 1.0)
            # Some writers put d's value into Tr: a wholly invisible part is never meant.
            alpha = value if keyword == "d" else 1 - value
            colors[material] = (*colors[material][:3], alpha or 1.0)
        elif keyword == "map_kd":
            textures.add(words[-1])
    if textures:
        source.note(f"{len(textures)} textures are not used: plain colours instead")
