"""A description as URDF, its meshes as STL in metres: what ROS, MuJoCo, Pinocchio and this program read.

A link with several joints, or with one whose axis does not pass through its origin, becomes several links:
URDF has one joint for each, through the origin of the link that it moves.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from seerob.core.shapes import Mesh, Solid
from seerob.core.transforms import Array, rotation_from_rpy, transform
from seerob.description.description import Description, Inertial, Joint, JointKind, Link
from seerob.description.shapes.glb import solid_mesh, stl_bytes
from seerob.description.shapes.mesh_bodies import tidied

BETWEEN = "__at_"
"""Stands in the name of a link that URDF needs between two others, before the name of its joint."""


class MeshFiles:
    """Meshes as files, each content once.

    Attributes:
        files: Content by name.
    """

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self.files: dict[str, bytes] = {}
        self._known: dict[str, str] = {}

    def name(self, mesh: Mesh, label: str) -> str:
        """Path of the file of a mesh; ``label`` is what it is called by, if no other is."""
        content = stl_bytes(mesh)
        digest = hashlib.sha256(content).hexdigest()
        if digest not in self._known:
            stem = "".join(c if c.isascii() and (c.isalnum() or c in "_-") else "_" for c in label)[:80]
            name, number = f"{self.folder}/{stem or 'mesh'}.stl", 1
            while any(name.lower() == other.lower() for other in self.files):
                number += 1
                name = f"{self.folder}/{stem}_{number}.stl"
            self.files[name] = content
            self._known[digest] = name
        return self._known[digest]


def written(
    description: Description, *, folder: str = "meshes", mimics: bool = True, plain: bool = False
) -> tuple[str, dict[str, bytes]]:
    """The text of a URDF and the mesh files that it names.

    Args:
        description: What is written.
        folder: Of the meshes, relative to the URDF.
        mimics: Whether joints that follow another one are written so.
        plain: Only what URDF itself has: no ``deviation`` on collisions, no ``error`` on masses, capsules of
            three pieces.
    """
    robot = Element("robot", name=description.name)
    if plain:
        # MuJoCo else looks for meshes without their folder, and joins links that no joint is between.
        # Surfaces that are split by colour have no volume, which it refuses: what is only drawn is left out.
        said = {"strippath": "false", "fusestatic": "false", "discardvisual": "true"}
        SubElement(SubElement(robot, "mujoco"), "compiler", said)
    meshes = MeshFiles(folder)
    for link in description.links:
        _link(robot, link, meshes, mimics=mimics, plain=plain)
    indent(robot, " ")
    text = '<?xml version="1.0"?>\n' + tostring(robot, encoding="unicode") + "\n"
    return text, meshes.files


def rpy_from_rotation(rotation: Array) -> Array:
    """Roll, pitch, yaw of a rotation (3, 3), which `rotation_from_rpy` turns into it again but for rounding.

    Each angle is taken from what the ones before it leave, so that nothing is lost near a pitch of 90°.
    """
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    rest = rotation_from_rpy([0.0, 0.0, -yaw]) @ rotation
    pitch = np.arctan2(-rest[2, 0], rest[0, 0])
    roll = np.arctan2(-rest[1, 2], rest[1, 1])
    return np.array([roll, pitch, yaw])


def _link(robot: Element, link: Link, meshes: MeshFiles, *, mimics: bool, plain: bool) -> None:
    parent, at = link.parent, link.parent_from_link
    for number, joint in enumerate(link.joints):
        last = number == len(link.joints) - 1
        shifted = bool(np.any(joint.anchor))
        name = link.name if last and not shifted else f"{link.name}{BETWEEN}{joint.name}"
        _joint(robot, joint, parent or "", name, at @ transform(position=joint.anchor), mimics, plain)
        if name != link.name:
            SubElement(robot, "link", name=name)
        parent, at = name, transform(position=-joint.anchor)
    if link.parent is not None and parent != link.name:
        label = f"{link.name}__fixed"
        fixed = SubElement(robot, "joint", name=label, type="fixed")
        _ends(fixed, parent or "", link.name)
        _origin(fixed, at)
    element = SubElement(robot, "link", name=link.name)
    if link.inertial is not None:
        _inertial(element, link.inertial, plain=plain)
    for mesh in link.visual:
        visual = SubElement(element, "visual")
        geometry = SubElement(visual, "geometry")
        SubElement(geometry, "mesh", filename=meshes.name(mesh, link.name))
        material = SubElement(visual, "material", name="color_" + "_".join(f"{c:.3g}" for c in mesh.color))
        SubElement(material, "color", rgba=_text(mesh.color))
    for solid in link.solids:
        _collision(element, solid, meshes, link.name, plain=plain)


def _joint(
    robot: Element, joint: Joint, parent: str, child: str, at: Array, mimics: bool, plain: bool
) -> None:
    limited = joint.lower is not None and joint.upper is not None
    turns = joint.kind is JointKind.REVOLUTE
    kind = ("revolute" if limited else "continuous") if turns else "prismatic"
    element = SubElement(robot, "joint", name=joint.name, type=kind)
    _ends(element, parent, child)
    _origin(element, at)
    SubElement(element, "axis", xyz=_text(joint.axis))
    limit: dict[str, str] = {}
    if limited:
        limit |= {"lower": repr(float(joint.lower or 0.0)), "upper": repr(float(joint.upper or 0.0))}
    elif not turns:
        # URDF has no prismatic joint without ends.
        limit |= {"lower": "-1000.0", "upper": "1000.0"}
    for key, known in (("effort", joint.effort), ("velocity", joint.velocity)):
        if known is not None:
            limit[key] = repr(float(known.value))
        elif plain and kind != "continuous":
            limit[key] = "0.0"  # URDF demands one; nobody stated it, and 0 is read as unknown
    if limit:
        SubElement(element, "limit", limit)
    if joint.damping or joint.friction:
        said = {"damping": repr(float(joint.damping)), "friction": repr(float(joint.friction))}
        SubElement(element, "dynamics", said)
    if joint.mimic is not None and mimics:
        follows = {
            "joint": joint.mimic.joint,
            "multiplier": repr(float(joint.mimic.multiplier)),
            "offset": repr(float(joint.mimic.offset)),
        }
        SubElement(element, "mimic", follows)


def _ends(element: Element, parent: str, child: str) -> None:
    SubElement(element, "parent", link=parent)
    SubElement(element, "child", link=child)


def _origin(element: Element, at: Array) -> None:
    SubElement(element, "origin", xyz=_text(at[:3, 3]), rpy=_text(rpy_from_rotation(at[:3, :3])))


def _inertial(link: Element, inertial: Inertial, *, plain: bool) -> None:
    element = SubElement(link, "inertial")
    SubElement(element, "origin", xyz=_text(inertial.com), rpy="0 0 0")
    off = {
        "error": inertial.error,
        "spread_error": inertial.spread_error,
        "within": inertial.within,
        "gyration": inertial.gyration,
    }
    said = {} if plain else {key: repr(float(one)) for key, one in off.items() if one > 0}
    SubElement(element, "mass", {"value": repr(float(inertial.mass)), **said})
    pairs = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
    moments: Mapping[str, str] = {key: repr(float(inertial.inertia[at])) for key, at in pairs.items()}
    SubElement(element, "inertia", dict(moments))


def _collision(link: Element, solid: Solid, meshes: MeshFiles, label: str, *, plain: bool) -> None:
    said = {} if plain or not solid.deviation else {"deviation": repr(float(solid.deviation))}
    if solid.points is not None and len(solid.points) == 2 and plain:
        for at, tag, sizes in _pieces(solid):
            element = SubElement(link, "collision", said)
            _origin(element, at)
            SubElement(SubElement(element, "geometry"), tag, sizes)
        return
    element = SubElement(link, "collision", said)
    if solid.points is not None and len(solid.points) == 2:
        at, length = _along(solid.points)
        _origin(element, at)
        sizes = {"radius": repr(float(solid.radius)), "length": repr(length)}
        tag = "capsule" if length else "sphere"
        SubElement(SubElement(element, "geometry"), tag, sizes if length else {"radius": sizes["radius"]})
        return
    mesh = solid_mesh(solid) if solid.mesh is None or solid.radius else tidied(solid.mesh)[0]
    SubElement(SubElement(element, "geometry"), "mesh", filename=meshes.name(mesh, label))


def _pieces(solid: Solid) -> Iterable[tuple[Array, str, dict[str, str]]]:
    """A capsule as a cylinder and two balls, each with its place."""
    assert solid.points is not None
    at, length = _along(solid.points)
    radius = repr(float(solid.radius))
    if length:
        yield at, "cylinder", {"radius": radius, "length": repr(length)}
    for end in solid.points[: 2 if length else 1]:
        yield transform(position=end), "sphere", {"radius": radius}


def _along(points: Array) -> tuple[Array, float]:
    """Middle of a segment with z along it (4, 4), and its length [m]."""
    a, b = points
    length = float(np.linalg.norm(b - a))
    if length < 1e-12:
        return transform(position=a), 0.0
    z = (b - a) / length
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    return transform(np.column_stack([x, np.cross(z, x), z]), (a + b) / 2), length


def _text(values: Sequence[float] | Array) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
