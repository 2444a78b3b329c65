"""SDF (Gazebo): worlds and models with links, joints, masses, shapes; poses by ``relative_to``, includes.

A model that is static or has no joint of one axis is parts; any other is a mechanism for each tree of joints.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.files.bounded import TooLarge, content
from seerob.core.shapes import Mesh
from seerob.core.transforms import Array, inverse, rotation_from_rpy, rotation_from_wxyz, transform
from seerob.description.cad.assembly import Assembly, link_row
from seerob.description.cad.containing import ball, cylinder, rounded
from seerob.description.cad.linked import assembled
from seerob.description.formats.resolve import Resolver
from seerob.description.mesh import load_meshes
from seerob.description.mesh_files import MeshSource
from seerob.description.shapes.shapes import box_mesh
from seerob.description.xml_values import MAX_BYTES, NUMBER, parse_xml

MAX_LINKS = 100_000
MAX_DEPTH = 20
COLOR = (0.7, 0.72, 0.75, 1.0)
_WITHOUT_UNIT = {".stl", ".obj", ".ply", ".off"}
_KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": None}
_ENDLESS = 1e15
"""SDF writes joints without limits with numbers beyond this."""


def read(source: MeshSource) -> Assembly:
    """The assembly of an SDF file.

    Raises:
        InputError: It cannot be read, or holds no surface.
    """
    file = _File(source)
    root = parse_xml(source.data, str(source.path))
    with source.parsing("SDF file"):
        file.version = tuple(int(word) for word in root.get("version", "1.9").split(".")[:2])
        for world in root.findall("world"):
            for child in world:
                file.child(child, np.eye(4), (), 0, source.path.parent)
        for child in root:
            file.child(child, np.eye(4), (), 0, source.path.parent)
        told = file.described()
    return assembled(source, told, f"SDF {root.get('version', '')}".strip(), np.eye(3), 1.0)


@dataclass
class _Link:
    path: tuple[str, ...]
    element: Element
    world: Array
    static: bool
    folder: Path


@dataclass
class _File:
    source: MeshSource
    version: tuple[int, ...] = (1, 9)
    links: dict[str, _Link] = field(default_factory=dict)
    joints: list[tuple[str, Element, str, str, Array, Array]] = field(default_factory=list)
    """Name, element, parent, child, place of the joint and of its model in the world."""
    left_out: list[tuple[str, str]] = field(default_factory=list)
    loaded: dict[Path, tuple[Mesh, ...]] = field(default_factory=dict)

    def child(
        self, element: Element, above: Array, path: tuple[str, ...], depth: int, folder: Path, name: str = ""
    ) -> None:
        """Takes over a model or an include; passes over lights, physics and plug-ins."""
        if depth > MAX_DEPTH:
            self.source.fail(f"nests models deeper than {MAX_DEPTH}", "flatten it")
        if element.tag == "include":
            self._include(element, above, path, depth, folder)
        elif element.tag == "model":
            self._model(element, above @ _pose(element.find("pose")), path, depth, folder, name)

    def _include(
        self, element: Element, above: Array, path: tuple[str, ...], depth: int, folder: Path
    ) -> None:
        uri = (element.findtext("uri") or "").strip()
        found = Resolver(str(self.source.path), folder, {}, within=(self.source.path.parent,)).find(uri)
        candidates = self._model_files(uri, folder) if isinstance(found, Problem) else [found.path]
        if not candidates:
            self.left_out.append((uri[:200], "a model that is not beside it or below"))
            return
        try:
            text = content(candidates[0], MAX_BYTES)
        except (OSError, TooLarge) as error:
            self.left_out.append((uri[:200], f"a model that cannot be read ({error})"))
            return
        self.source.files[candidates[0].relative_to(self.source.path.parent.resolve()).as_posix()] = text
        root = parse_xml(text, str(candidates[0]))
        for model in root.findall("model"):
            at = above @ (
                _pose(element.find("pose")) if element.find("pose") is not None else _pose(model.find("pose"))
            )
            static = element.findtext("static")
            if static is not None and model.find("static") is None:
                flag = Element("static")
                flag.text = static
                model.append(flag)
            self._model(
                model, at, path, depth + 1, candidates[0].parent, (element.findtext("name") or "").strip()
            )

    def _model_files(self, uri: str, folder: Path) -> list[Path]:
        """The SDF file of a folder that an include names, inside the file's own folder."""
        inside = self.source.path.parent.resolve()
        name = uri.removeprefix("model://").removeprefix("file://")
        for base in (folder, *folder.parents):
            if not base.resolve().is_relative_to(inside):
                break
            try:
                at = (base / name).resolve()
                if not at.is_relative_to(inside):
                    continue
                if at.is_dir():
                    return sorted(at.glob("model*.sdf"), reverse=True)[:1] or sorted(at.glob("*.sdf"))[:1]
            except (OSError, ValueError):
                return []
        return []

    def _model(
        self, element: Element, world: Array, path: tuple[str, ...], depth: int, folder: Path, name: str
    ) -> None:
        own = (*path, name or element.get("name") or "model")
        frames = _Frames(element)
        placement = element.get("placement_frame")
        if placement:
            world = world @ inverse(frames.pose(placement))
        static = (element.findtext("static") or "").strip().lower() in ("true", "1")
        label = "::".join(own)
        for link in element.findall("link"):
            if len(self.links) >= MAX_LINKS:
                self.source.fail(f"has more than {MAX_LINKS} links", "export the cell alone")
            full = f"{label}::{link.get('name', '')}"
            at = world @ frames.pose(link.get("name", ""))
            self.links[full] = _Link((*own, link.get("name", "link")), link, at, static, folder)
        for joint in element.findall("joint"):
            ends = []
            for tag in ("parent", "child"):
                end = joint.find(tag)
                text = (
                    ""
                    if end is None
                    else (end.text or "").strip() or (end.findtext("link_name") or "").strip()
                )
                ends.append("" if text == "world" else f"{label}::{frames.body(text)}")
            at = world @ frames.pose(joint.get("name", ""))
            self.joints.append((joint.get("name", "joint"), joint, ends[0], ends[1], at, world))
        for other in element:
            if other.tag == "model":
                at = world @ frames.pose(other.get("name", ""))
                self._model(other, at, own, depth + 1, folder, "")
            elif other.tag == "include":
                self._include(other, world, own, depth + 1, folder)

    # -- plain data ---------------------------------------------------------------------------

    def described(self) -> dict[str, Any]:
        """What `assembled` takes."""
        below: dict[str, list[int]] = {}
        above: dict[str, int] = {}
        for number, (name, _, parent, child, _, _) in enumerate(self.joints):
            if child not in self.links or (parent and parent not in self.links):
                self.left_out.append((name, "a joint of a link that is not there"))
            elif self.links[child].static:
                continue
            elif child in above:
                self.left_out.append(
                    (name, "closes a loop of joints, which a tree of links has no place for")
                )
            else:
                above[child] = number
                below.setdefault(parent, []).append(number)
        mechanisms, taken = [], set()
        begins = [(name, "") for name in self.links if name not in above]
        begins += [(self.joints[number][3], "world") for number in below.get("", ())]
        for name, base in begins:
            rows, names = self._tree(name, base, below, above)
            if any(row["joints"] for row in rows):
                taken |= names
                first = self.links[name]
                world = np.eye(4) if base else first.world
                mechanisms.append({"name": "_".join(first.path[:-1]), "world": world.tolist(), "links": rows})
        parts = [
            {
                "path": _named(link),
                "pieces": self._pieces(link, "visual"),
                "collision": self._pieces(link, "collision"),
                "world": link.world.tolist(),
                "inertial": _inertial(link),
            }
            for name, link in self.links.items()
            if name not in taken
        ]
        return {
            "parts": parts,
            "mechanisms": mechanisms,
            "left_out": self.left_out,
            "findings": [],
            "files": {},
        }

    def _tree(
        self, begin: str, base: str, below: dict[str, list[int]], above: dict[str, int]
    ) -> tuple[list[dict[str, Any]], set[str]]:
        rows: list[dict[str, Any]] = []
        if base:
            rows.append(link_row("world_link", -1))
        waiting = [(begin, len(rows) - 1)]
        names: set[str] = set()
        while waiting:
            name, parent = waiting.pop(0)
            link = self.links[name]
            row = link_row(link.path[-1], parent)
            row["inertial"] = _inertial(link)
            row["pieces"], row["collision"] = self._pieces(link, "visual"), self._pieces(link, "collision")
            row["pieces"] = row["pieces"] or row["collision"]
            if parent >= 0:
                self._join(row, self.joints[above[name]], link)
            names.add(name)
            rows.append(row)
            waiting += [(self.joints[number][3], len(rows) - 1) for number in below.get(name, ())]
        return rows, names

    def _join(
        self, row: dict[str, Any], joint: tuple[str, Element, str, str, Array, Array], link: _Link
    ) -> None:
        name, element, parent, _, at, model = joint
        world = self.links[parent].world if parent else np.eye(4)
        row["matrix"] = (inverse(world) @ link.world).tolist()
        kind = element.get("type", "")
        if _KINDS.get(kind, "") is None:
            return
        if kind not in _KINDS:
            text = f"joint {name}: {kind!r} is no joint of one axis: taken as fixed"
            self.source.note(text, level="warning")
            return
        axis = element.find("axis")
        direction = _numbers(None if axis is None else axis.findtext("xyz"), 3, (0.0, 0.0, 1.0))
        xyz = None if axis is None else axis.find("xyz")
        in_model = self.version < (1, 5) or (
            axis is not None and _flag(axis.findtext("use_parent_model_frame"))
        )
        expressed = "" if xyz is None else xyz.get("expressed_in", "")
        if expressed == "__model__" or (in_model and not expressed):
            rotation = model[:3, :3]
        elif expressed:
            rotation = self._expressed(expressed, name, at, model)
        else:
            rotation = at[:3, :3]
        link_from_joint = inverse(link.world) @ at
        limit = None if axis is None else axis.find("limit")

        def value(key: str) -> float | None:
            word = "" if limit is None else (limit.findtext(key) or "").strip()
            if word.lower().lstrip("+-") in ("inf", "infinity") or not NUMBER.fullmatch(word):
                return None
            number = float(word)
            return number if math.isfinite(number) and abs(number) < _ENDLESS else None

        lower, upper = (None, None) if kind == "continuous" else (value("lower"), value("upper"))
        row["anchor"] = link_from_joint[:3, 3].tolist()
        row["joints"] = [
            {
                "name": name,
                "kind": _KINDS[kind],
                "axis": (link.world[:3, :3].T @ rotation @ direction).tolist(),
                "lower": lower,
                "upper": upper,
                "velocity": _positive(value("velocity")),
                "effort": _positive(value("effort")),
                "value": 0.0,
            }
        ]

    def _expressed(self, frame: str, joint: str, at: Array, model: Array) -> Array:
        same = [link for name, link in self.links.items() if name.rpartition("::")[2] == frame]
        if len(same) == 1:
            return same[0].world[:3, :3]
        text = (
            f"joint {joint}: its axis is expressed in {frame!r}, which is no link: taken in the model's frame"
        )
        self.source.note(text, level="warning")
        return model[:3, :3]

    # -- shapes -------------------------------------------------------------------------------

    def _pieces(self, link: _Link, tag: str) -> list[tuple[bytes, bytes, Any]]:
        found = []
        for element in link.element.findall(tag):
            geometry = element.find("geometry")
            at = _Frames(link.element).shape(element)
            color = _color(element)
            for kind in () if geometry is None else geometry:
                for mesh in self._meshes(kind, link, f"{'/'.join(_named(link))}/{element.get('name', tag)}"):
                    moved = mesh.moved(at)
                    own = color or (mesh.color if kind.tag == "mesh" else COLOR)
                    found.append((moved.vertices.tobytes(), moved.faces.astype(np.int32).tobytes(), own))
        return found

    def _meshes(self, kind: Element, link: _Link, label: str) -> Iterator[Mesh]:
        def size(key: str, default: float | None = None) -> float:
            value = float(_numbers(kind.findtext(key), 1, None if default is None else (default,))[0])
            if not 1e-9 <= value <= 1e6:
                self.source.fail(f"{label}: {kind.tag}/{key} is {value:g}", "from 1e-9 m to 1e6 m")
            return value

        if kind.tag == "box":
            half = _numbers(kind.findtext("size"), 3) / 2
            if not (half > 0).all():
                self.source.fail(f"{label}: a box of size {(2 * half).tolist()}", "all greater than 0")
            yield box_mesh(-half, half)
        elif kind.tag == "sphere":
            yield ball(size("radius"))
        elif kind.tag == "ellipsoid":
            yield Mesh(ball(1.0).vertices * _numbers(kind.findtext("radii"), 3), ball(1.0).faces)
        elif kind.tag in ("cylinder", "capsule", "cone"):
            end = np.array([0.0, 0.0, size("length") / 2])
            radius = size("radius")
            if kind.tag == "capsule":
                yield rounded(-end, end, radius)
            else:
                yield cylinder(-end, end, radius, 0.0 if kind.tag == "cone" else None)
        elif kind.tag == "mesh":
            yield from self._mesh_file(kind, link, label)
        elif kind.tag != "empty":
            self.left_out.append((label, f"<{kind.tag}> has no surface that is read here"))

    def _mesh_file(self, kind: Element, link: _Link, label: str) -> Iterator[Mesh]:
        uri = (kind.findtext("uri") or "").strip()
        resolver = Resolver(str(self.source.path), link.folder, {}, within=(self.source.path.parent,))
        found = resolver.find(uri)
        if isinstance(found, Problem):
            self.left_out.append((label, f"{uri[:120]}: {found.what}"))
            return
        if found.path not in self.loaded:
            unitless = found.path.suffix.lower() in _WITHOUT_UNIT
            try:
                loaded = load_meshes(
                    found.path, units="m" if unitless else None, up="z" if unitless else None
                )
            except InputError as error:
                self.left_out.append((label, str(error)))
                return
            self.loaded[found.path] = loaded.drawn()
            self.source.findings += [f for f in loaded.findings if f.level != "note"]
            self.source.files.update(loaded.files)
        scale = _numbers(kind.findtext("scale"), 3, (1.0, 1.0, 1.0))
        mirrored = np.prod(scale) < 0
        for mesh in self.loaded[found.path]:
            yield Mesh(mesh.vertices * scale, mesh.faces[:, ::-1] if mirrored else mesh.faces, mesh.color)


class _Frames:
    """Frames of one model, by the pose that each states relative to another."""

    def __init__(self, model: Element) -> None:
        self.elements: dict[str, tuple[Element, str]] = {}
        for child in model:
            name = child.get("name", "")
            if child.tag in ("link", "model"):
                self.elements.setdefault(name, (child, "__model__"))
            elif child.tag == "frame":
                self.elements.setdefault(name, (child, child.get("attached_to") or "__model__"))
            elif child.tag == "joint":
                below = child.find("child")
                link = "" if below is None else (below.text or "").strip()
                self.elements.setdefault(name, (child, link or "__model__"))
        self.known: dict[str, Array] = {"__model__": np.eye(4), "world": np.eye(4), "": np.eye(4)}

    def pose(self, name: str, depth: int = 0) -> Array:
        """Model from a frame (4, 4).

        Raises:
            ValueError: Frames are relative to each other in a circle, or there is none of that name.
        """
        if name in self.known:
            return self.known[name]
        if depth > 100:
            raise ValueError(f"frame {name!r} is relative to itself")
        first, _, rest = name.partition("::")
        if rest and first in self.elements:
            return self.pose(first, depth + 1) @ _Frames(self.elements[first][0]).pose(rest, depth + 1)
        if name not in self.elements:
            raise ValueError(f"there is no frame {name!r}")
        element, default = self.elements[name]
        pose = element.find("pose")
        relative = default if pose is None else pose.get("relative_to") or pose.get("frame") or default
        self.known[name] = self.pose(relative, depth + 1) @ _pose(pose)
        return self.known[name]

    def body(self, name: str, depth: int = 0) -> str:
        """The link that a name of a joint's end stands for."""
        found = self.elements.get(name)
        if found is None or depth > 100 or found[0].tag != "frame":
            return name
        return self.body(found[0].get("attached_to") or "", depth + 1)

    def shape(self, element: Element) -> Array:
        """Link from a shape of it (4, 4); of one that is relative to another frame, as if to the link."""
        return _pose(element.find("pose"))


def _named(link: _Link) -> list[str]:
    """Names that lead to a part; the only link of a model adds none."""
    only = link.path[-1] in ("link", "body", "base_link") and len(link.path) > 1
    return list(link.path[:-1] if only else link.path)


def _inertial(link: _Link) -> dict[str, Any] | None:
    element = link.element.find("inertial")
    mass = None if element is None else element.findtext("mass")
    if element is None or mass is None:
        return None
    inertia = element.find("inertia")
    frame = _pose(element.find("pose"))
    moments = None
    if inertia is not None:
        xx, yy, zz, xy, xz, yz = (
            float(_numbers(inertia.findtext(key), 1, (0.0,))[0])
            for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        moments = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    return {"mass": float(_numbers(mass, 1)[0]), "frame": frame.tolist(), "moments": moments}


def _color(element: Element) -> tuple[float, float, float, float] | None:
    text = element.findtext("material/diffuse") or element.findtext("material/ambient")
    if text is None:
        return None
    values = np.clip(np.array(text.split()[:3], float), 0, 1)
    return (*(float(c) for c in values), 1.0) if len(values) == 3 else None  # type: ignore[return-value]


def _flag(text: str | None) -> bool:
    return (text or "").strip().lower() in ("true", "1")


def _positive(value: float | None) -> float | None:
    return value if value is not None and value > 0 else None


def _pose(element: Element | None) -> Array:
    if element is None or not (element.text or "").strip():
        return np.eye(4)
    if element.get("rotation_format") == "quat_xyzw":
        x, y, z, *xyzw = _numbers(element.text, 7)
        return transform(rotation_from_wxyz([xyzw[3], *xyzw[:3]]), [x, y, z])
    values = _numbers(element.text, 6)
    turns = values[3:] * (math.pi / 180 if _flag(element.get("degrees")) else 1.0)
    return transform(rotation_from_rpy(turns), values[:3])


def _numbers(text: str | None, count: int, default: tuple[float, ...] | None = None) -> Array:
    if text is None and default is not None:
        return np.array(default)
    values = np.array((text or "").split(), float)
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(f"{(text or '')[:60]!r} is not {count} numbers")
    return values
