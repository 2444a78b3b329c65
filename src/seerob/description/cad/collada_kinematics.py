"""Kinematics of COLLADA 1.5: links, joints, limits, speeds, masses, and which nodes of the scene they move.

A joint's axis is bound to a turn or a shift of a node of the visual scene; what follows it there is the link.
Lengths stay in the file's unit and axes, angles become radians. Works in the parsers' process.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from seerob.core.transforms import Array, rotation_from_axis_angle, transform
from seerob.description.mesh_files import MeshSource

MARK = b"instance_kinematics_"
"""Stands in every document whose scene has kinematics."""
MAX_LINKS = 2_000
MAX_NODES = 200_000
ROOT_FRAMES = ("openrave", "urdf")
"""Words in the name of writers that state the frame of a mass in the model's frame, not in the body's."""
_TURN = math.pi / 180
_FAR = 1e-6
"""Places of one joint that differ by more are told, as a share of the mechanism's size."""


@dataclass
class _Link:
    name: str
    parent: int
    parent_from_joint: Array
    joints: list[dict[str, Any]]
    joint_from_link: Array
    node: str = ""
    world: Array | None = None
    """Where the visual scene has its frame, its joints as they are there."""
    inertial: dict[str, Any] | None = None


def plain(path: Path, data: bytes, max_bytes: int, max_faces: int) -> tuple[list[dict[str, Any]], list[Any]]:
    """Mechanisms of a document, and findings, as plain data.

    Returns:
        For each mechanism ``name``, ``world`` (4, 4) of its base and ``links``: name, number of the parent
        (-1 for the base), ``matrix`` (4, 4) from the parent, ``joints``, ``inertial``, ``node`` (identifier
        of the visual scene's node whose meshes are the link's) and ``link_from_world`` (4, 4) in the pose
        that the scene shows, where it is known.
    """
    from defusedxml.ElementTree import fromstring

    source = MeshSource(path, data, max_bytes, max_faces)
    with source.parsing("COLLADA file"):
        found = list(_Document(source, fromstring(data, forbid_dtd=True)).mechanisms())
    return found, [(f.level, f.subject, f.text) for f in source.findings]


class _Document:
    def __init__(self, source: MeshSource, root: Element) -> None:
        self.source, self.root = source, root
        for element in root.iter():
            element.tag = str(element.tag).rpartition("}")[2]
        self.ids = {e.attrib["id"]: e for e in root.iter() if "id" in e.attrib}
        tool = root.findtext(".//contributor/authoring_tool") or ""
        self.in_root = any(word in tool.lower() for word in ROOT_FRAMES)
        self.nodes: dict[str, _Node] = {}
        self._read_nodes()
        self.renamed = dict(self._parameters())

    # -- the visual scene ---------------------------------------------------------------------

    def _read_nodes(self) -> None:
        scene = self.root.find("scene/instance_visual_scene")
        top = None if scene is None else self.ids.get(scene.get("url", "").rpartition("#")[2])
        if top is None:
            top = self.root.find("library_visual_scenes/visual_scene")
        stack: list[tuple[Element, Array, tuple[str, ...]]] = []
        if top is not None:
            stack += [(n, np.eye(4), ()) for n in reversed(top.findall("node"))]
        count = 0
        while stack:
            element, above, path = stack.pop()
            count += 1
            if count > MAX_NODES or len(path) > 200:
                self.source.fail(f"has more than {MAX_NODES} nodes, or nests them deeper than 200")
            node = _Node(element, above, path)
            self.nodes.setdefault(node.key or f"#{count}", node)
            below = (*path, element.get("id", ""), element.get("sid", ""))
            stack += [(n, node.world, below) for n in reversed(element.findall("node"))]

    def _bound(self, target: str) -> tuple[_Node, int] | None:
        """The node, and the number of its transform, that a binding names."""
        *path, last = target.replace("#", "").split("/")
        best: tuple[int, _Node, int] | None = None
        for node in self.nodes.values():
            for number, sid in enumerate(node.sids):
                if sid == last:
                    known = {node.element.get("id"), node.element.get("sid"), *node.path}
                    score = sum(word in known for word in path)
                    if best is None or score > best[0]:
                        best = score, node, number
        return None if best is None else (best[1], best[2])

    # -- names of parameters ------------------------------------------------------------------

    def _parameters(self) -> Iterator[tuple[str, str]]:
        for element in self.root.iter():
            if element.tag in ("newparam", "setparam"):
                name = element.get("sid") or element.get("ref") or ""
                value = element.findtext("SIDREF") or element.findtext("float") or ""
                yield name.rpartition("/")[2], value.strip()
            elif element.tag == "bind" and element.get("symbol"):
                param = element.find("param")
                value = element.findtext("SIDREF") or element.findtext("float") or ""
                yield element.get("symbol", ""), value.strip() if param is None else param.get("ref", "")

    def _resolved(self, element: Element | None) -> str:
        """What a parameter, a reference or a number comes to."""
        if element is None:
            return ""
        param = element.find("param")
        text = (
            "".join(element.itertext()).strip() if param is None else (param.get("ref") or param.text or "")
        )
        text = text.strip()
        for _ in range(20):
            key = text.rpartition("/")[2]
            if key not in self.renamed or not self.renamed[key] or self.renamed[key] == text:
                break
            text = self.renamed[key]
        return text

    def _joint_of(self, axis: str) -> tuple[str, str, str]:
        """Model, joint and axis that a path names; the model is empty where it does not say."""
        words = [word for word in axis.split("/") if word]
        joint, sid = ("", "", *words)[-2:]
        model = words[-3] if len(words) > 2 else ""
        return self.models.get(model, model), joint, sid

    # -- mechanisms ---------------------------------------------------------------------------

    def mechanisms(self) -> Iterator[dict[str, Any]]:
        self.models: dict[str, str] = {}
        for element in self.root.iter("instance_kinematics_model"):
            url = element.get("url", "").rpartition("#")[2]
            self.models[element.get("sid", "")] = url
            self.models[url] = url
        wanted = list(dict.fromkeys(self.models.values()))
        self.limits: dict[tuple[str, str], tuple[float | None, ...]] = {}
        self.speeds: dict[tuple[str, str], float] = {}
        self._read_axis_infos()
        bindings = [
            (
                self._joint_of(self._resolved(b.find("axis"))),
                b.get("target", ""),
                self._resolved(b.find("value")),
            )
            for b in self.root.iter("bind_joint_axis")
        ]
        for name in wanted:
            model = self.ids.get(name)
            if model is None or model.tag != "kinematics_model":
                self.source.note(f"the kinematics model {name!r} is not in the file", level="warning")
                continue
            yield from self._mechanism(name, model, [b for b in bindings if b[0][0] in ("", name)])

    def _read_axis_infos(self) -> None:
        """Limits and speeds that articulated systems state, by joint."""
        places: dict[str, str] = {}
        for info in self.root.iter("axis_info"):
            axis = self._resolved_path(info.get("axis", ""), places)
            if info.get("sid"):
                places[info.get("sid", "")] = axis
        for info in self.root.iter("axis_info"):
            model, joint, _ = self._joint_of(self._resolved_path(info.get("axis", ""), places))
            limits = info.find("limits")
            if limits is not None:
                ends = (_number(self._resolved(limits.find(end))) for end in ("min", "max"))
                self.limits[model, joint] = tuple(ends)
            speed = _number(self._resolved(info.find("speed")))
            if speed is not None:
                self.speeds[model, joint] = speed

    def _resolved_path(self, axis: str, places: Mapping[str, str]) -> str:
        return places.get(axis.rpartition("/")[2], axis)

    def _mechanism(self, name: str, model: Element, bindings: list[Any]) -> Iterator[dict[str, Any]]:
        common = model.find("technique_common")
        common = model if common is None else common
        self.joints = {}
        for child in common:
            if child.tag == "joint":
                self.joints[child.get("sid") or child.get("id") or ""] = child
            elif child.tag == "instance_joint":
                joint = self.ids.get(child.get("url", "").rpartition("#")[2])
                if joint is not None:
                    self.joints[child.get("sid") or joint.get("sid") or joint.get("id") or ""] = joint
        for root in common.findall("link"):
            links: list[_Link] = []
            self._walk(root, -1, np.eye(4), [], links, name)
            if any(link.joints for link in links):
                yield self._placed(model.get("name") or name, links, bindings)

    def _walk(
        self,
        element: Element,
        parent: int,
        before: Array,
        joints: list[dict[str, Any]],
        links: list[_Link],
        model: str,
    ) -> None:
        if len(links) >= MAX_LINKS:
            self.source.fail(f"has more than {MAX_LINKS} links")
        own = np.eye(4)
        for child in element:
            own = own @ _transform(child)
        number = len(links)
        label = element.get("name") or element.get("sid") or f"link_{number}"
        links.append(_Link(label, parent, before, joints, own))
        for attachment in element:
            if attachment.tag in ("attachment_start", "attachment_end"):
                text = f"link {label}: a loop of joints ({attachment.get('joint', '')}) is left out"
                self.source.note(text, level="warning")
            if attachment.tag != "attachment_full":
                continue
            at = np.eye(4)
            for child in attachment:
                at = at @ _transform(child)
            below = attachment.find("link")
            if below is not None:
                made = self._axes(attachment.get("joint", "").rpartition("/")[2], model)
                self._walk(below, number, at, made, links, model)

    def _axes(self, sid: str, model: str) -> list[dict[str, Any]]:
        """Degrees of freedom of a joint, in the frame before it."""
        element = self.joints.get(sid)
        if element is None:
            self.source.note(f"joint {sid!r} is not in the file: taken as fixed", level="warning")
            return []
        axes = [child for child in element if child.tag in ("revolute", "prismatic")]
        found: list[dict[str, Any]] = []
        for child in axes:
            turns = child.tag == "revolute"
            k = _TURN if turns else 1.0
            axis = _numbers(child.findtext("axis"), 3)
            lower, upper = (_number(child.findtext(f"limits/{end}")) for end in ("min", "max"))
            if (model, sid) in self.limits and len(axes) == 1:
                said = self.limits[model, sid]
                lower, upper = (a if b is None else b for a, b in zip((lower, upper), said, strict=True))
            name = element.get("name") or sid
            speed = self.speeds.get((model, sid))
            found.append(
                {
                    "sid": sid,
                    "axis_sid": child.get("sid", ""),
                    "name": name if len(axes) == 1 else f"{name}_{child.get('sid', len(found))}",
                    "kind": child.tag,
                    "axis": axis,
                    "lower": None if lower is None else lower * k,
                    "upper": None if upper is None else upper * k,
                    "velocity": speed,
                    "value": 0.0,
                    "mimic": self._formula(sid, model),
                }
            )
        return found

    def _formula(self, sid: str, model: str) -> tuple[str, float, float] | None:
        """``q = factor · q[joint] + offset`` of a joint that a formula drives."""
        for formula in self.root.iter("formula"):
            target = self._resolved(formula.find("target"))
            if sid not in target.split("/"):
                continue
            common = formula.find("technique_common")
            top = None if common is None else next((e for e in common.iter() if e.tag == "math"), None)
            inner = top if top is not None else common
            inner = None if inner is None or not len(inner) else inner[0]
            parts = None if inner is None else _linear(inner)
            names = [] if parts is None else [key for key in parts if key]
            if parts is None or len(names) > 1:
                self.source.note(
                    f"the formula of joint {sid!r} is not linear: it is left out", level="warning"
                )
                return None
            if names:
                words = names[0].split("/")
                joint = next((word for word in reversed(words) if word in self.joints), words[-1])
                return joint, parts[names[0]], parts.get("", 0.0)
        return None

    def _placed(self, name: str, links: list[_Link], bindings: list[Any]) -> dict[str, Any]:
        by_joint = {joint[1]: (target, value) for joint, target, value in bindings}
        for link in links:
            for number, joint in enumerate(link.joints):
                target, value = by_joint.get(joint["sid"], ("", ""))
                bound = self._bound(target) if target else None
                if bound is None:
                    continue
                node, at = bound
                turned = node.angle(at, joint)
                shown = _number(value)
                if turned is None:
                    k = _TURN if joint["kind"] == "revolute" else 1.0
                    turned = 0.0 if shown is None else shown * k
                joint["value"] = turned
                link.node = node.key
                if number == 0:
                    link.world = node.before(at)
        # Fixed are joints whose two limits are one: URDF's fixed ones are written so.
        world, poses = self._frames(links)
        for link, pose in zip(links, poses, strict=True):
            if not link.node:
                label = link.name
                same = [
                    n for n in self.nodes.values() if label in (n.element.get("id"), n.element.get("name"))
                ]
                link.node = same[0].key if len(same) == 1 else ""
            link.inertial = self._inertial(link, pose)
        rows = [self._row(link, pose, world) for link, pose in zip(links, poses, strict=True)]
        return {"name": name, "world": (world @ links[0].joint_from_link).tolist(), "links": rows}

    def _frames(self, links: list[_Link]) -> tuple[Array, list[Array]]:
        """Where the model's frame is in the scene, and the frames of links in the model's."""
        poses: list[Array] = []
        worlds: list[tuple[str, Array]] = []
        for link in links:
            above = np.eye(4) if link.parent < 0 else poses[link.parent]
            before = above @ link.parent_from_joint
            if link.world is not None:
                worlds.append((link.name, link.world @ np.linalg.inv(before)))
            pose = before
            for joint in link.joints:
                pose = pose @ _moved(joint, joint["value"])
            poses.append(pose @ link.joint_from_link)
        if not worlds:
            bound = self.root.find(".//bind_kinematics_model")
            last = "" if bound is None else bound.get("node", "").rpartition("/")[2]
            node = next(
                (n for n in self.nodes.values() if last and last in (n.key, n.element.get("sid"))), None
            )
            return (np.eye(4) if node is None else node.world), poses
        world = worlds[0][1]
        size = 1.0 + max(float(np.abs(pose[:3, 3]).max()) for pose in poses)
        for name, other in worlds[1:]:
            off = float(np.abs(other - world).max())
            if off > _FAR * size:
                text = (
                    f"link {name} is {off:.3g} of its units elsewhere in the visual scene than its joints say"
                )
                self.source.note(text, level="warning")
        return world, poses

    def _inertial(self, link: _Link, pose: Array) -> dict[str, Any] | None:
        body = None
        targets = {
            i.get("body", ""): i.get("target", "").rpartition("#")[2]
            for i in self.root.iter("instance_rigid_body")
        }
        for element in self.root.iter("rigid_body"):
            names = {element.get("name"), element.get("sid"), element.get("id")}
            if link.name in names or (link.node and link.node == targets.get(element.get("sid", ""))):
                body = element
                break
        common = None if body is None else body.find("technique_common")
        mass = None if common is None else _number(common.findtext("mass"))
        if common is None or mass is None:
            return None
        frame = np.eye(4)
        for child in common.findall("mass_frame/*"):
            frame = frame @ _transform(child)
        if self.in_root:
            frame = np.linalg.inv(pose) @ frame
        inertia = common.findtext("inertia")
        return {
            "mass": mass,
            "frame": frame.tolist(),
            "moments": None if inertia is None else _numbers(inertia, 3).tolist(),
        }

    def _row(self, link: _Link, pose: Array, world: Array) -> dict[str, Any]:
        fixed = [j for j in link.joints if j["lower"] is not None and j["lower"] == j["upper"]]
        matrix = link.parent_from_joint.copy()
        joints = []
        after = link.joint_from_link
        for joint in link.joints:
            if joint in fixed or not np.any(joint["axis"]):
                matrix = matrix @ _moved(joint, joint["value"] if joint in fixed else 0.0)
                continue
            joints.append({**joint, "axis": (after[:3, :3].T @ joint["axis"]).tolist()})
        anchor = np.linalg.inv(after)[:3, 3]
        matrix = matrix @ after if link.parent >= 0 else np.eye(4)
        # A frame in the scene, where a joint is bound; else by the chain.
        at = world @ pose
        if link.world is not None:
            at = link.world
            for joint in link.joints:
                at = at @ _moved(joint, joint["value"])
            at = at @ after
        return {
            "name": link.name,
            "parent": link.parent,
            "matrix": matrix.tolist(),
            "anchor": anchor.tolist(),
            "joints": joints,
            "inertial": link.inertial,
            "node": link.node,
            "link_from_world": np.linalg.inv(at).tolist(),
        }


@dataclass
class _Node:
    element: Element
    above: Array
    path: tuple[str, ...]
    sids: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.transforms = [c for c in self.element if c.tag in _TRANSFORMS]
        self.sids = [c.get("sid", "") for c in self.transforms]
        self.key = self.element.get("id", "")
        self.world = self.before(len(self.transforms))

    def before(self, number: int) -> Array:
        """World from what precedes a transform, (4, 4)."""
        matrix = self.above
        for transformed in self.transforms[:number]:
            matrix = matrix @ _transform(transformed)
        return matrix

    def angle(self, number: int, joint: dict[str, Any]) -> float | None:
        """How far the scene has turned or shifted a joint [rad or the file's unit]."""
        element, axis = self.transforms[number], np.asarray(joint["axis"], float)
        if element.tag == "rotate" and joint["kind"] == "revolute":
            x, y, z, degrees = _numbers(element.text, 4)
            return float(math.copysign(degrees, np.dot([x, y, z], axis) * degrees or 1.0)) * _TURN
        if element.tag == "translate" and joint["kind"] == "prismatic":
            length = np.linalg.norm(axis)
            return float(np.dot(_numbers(element.text, 3), axis) / length) if length > 0 else None
        return None


_TRANSFORMS = ("translate", "rotate", "matrix", "scale", "lookat", "skew")


def _transform(element: Element) -> Array:
    """Matrix (4, 4) of a transform, the identity for any other element."""
    if element.tag == "translate":
        return transform(position=_numbers(element.text, 3))
    if element.tag == "rotate":
        *axis, degrees = _numbers(element.text, 4)
        return transform(rotation_from_axis_angle(axis, degrees * _TURN)) if np.any(axis) else np.eye(4)
    if element.tag == "matrix":
        return _numbers(element.text, 16).reshape(4, 4)
    if element.tag == "scale":
        return np.diag([*_numbers(element.text, 3), 1.0])
    return np.eye(4)


def _moved(joint: dict[str, Any], value: float) -> Array:
    axis = np.asarray(joint["axis"], float)
    length = float(np.linalg.norm(axis))
    if not length:
        return np.eye(4)
    if joint["kind"] == "prismatic":
        return transform(position=axis / length * value)
    return transform(rotation_from_axis_angle(axis, value))


def _numbers(text: str | None, count: int) -> Array:
    values = np.array((text or "").split(), float)
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(f"{(text or '')[:60]!r} is not {count} numbers")
    return values


def _number(text: str | None) -> float | None:
    """A number, or None where there is none."""
    word = (text or "").strip()
    if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", word):
        return None
    value = float(word)
    return value if math.isfinite(value) else None


def _linear(element: Element, depth: int = 0) -> dict[str, float] | None:
    """Factors of symbols in a MathML expression, the constant under ``""``; None where it is not linear."""
    if depth > 50:
        return None
    if element.tag == "cn":
        value = _number(element.text)
        return None if value is None else {"": value}
    if element.tag in ("ci", "csymbol"):
        return {(element.text or "").strip(): 1.0}
    if element.tag != "apply" or not len(element):
        return None
    sums = [_linear(child, depth + 1) for child in element[1:]]
    parts = [p for p in sums if p is not None]
    if len(parts) < len(sums) or not parts:
        return None
    if element[0].tag in ("plus", "minus"):
        total = dict(parts[0])
        if element[0].tag == "minus" and len(parts) == 1:
            return {key: -value for key, value in total.items()}
        sign = -1.0 if element[0].tag == "minus" else 1.0
        for part in parts[1:]:
            for key, value in part.items():
                total[key] = total.get(key, 0.0) + sign * value
        return total
    if element[0].tag in ("times", "divide"):
        total = parts[0]
        for part in parts[1:]:
            if set(part) <= {""}:
                k = part.get("", 0.0)
            elif set(total) <= {""} and element[0].tag == "times":
                k, total = total.get("", 0.0), part
            else:
                return None
            if element[0].tag == "divide":
                if not k:
                    return None
                k = 1 / k
            total = {key: value * k for key, value in total.items()}
        return total
    return None
