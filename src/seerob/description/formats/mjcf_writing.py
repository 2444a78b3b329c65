"""A cell as MJCF, its meshes as STL in metres: geometry for the screen in group 2, for contacts in 3."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from seerob.core.shapes import Mesh, Solid
from seerob.core.transforms import Array, wxyz_from_rotation
from seerob.description.description import Description, JointKind, Link
from seerob.description.formats.urdf_writing import MeshFiles
from seerob.description.shapes.glb import solid_mesh
from seerob.description.shapes.mesh_bodies import is_closed, tidied
from seerob.description.shapes.moments import signed_volume

TINY = 2e-15
"""MuJoCo wants more than 1e-15 kg on a frame that a joint moves and that nothing is on."""


def written(
    cell: Description, home: Mapping[str, float], *, folder: str = "meshes"
) -> tuple[str, dict[str, bytes]]:
    """The text of an MJCF file and the mesh files that it names.

    Args:
        cell: Its first link is the world.
        home: Positions of joints of its keyframe ``home`` [rad or m].
        folder: Of the meshes, relative to the file.
    """
    root = Element("mujoco", model=cell.name)
    SubElement(root, "compiler", angle="radian", autolimits="true", meshdir=".", fusestatic="false")
    SubElement(root, "option", gravity="0 0 -9.81")
    asset, worldbody = Element("asset"), Element("worldbody")
    files = MeshFiles(folder)
    assets: dict[str, str] = {}

    def mesh_of(mesh: Mesh, label: str) -> str:
        file = files.name(mesh, label)
        if file not in assets:
            assets[file] = f"mesh_{len(assets)}"
            # A surface without an inside, or hardly any, has no volume that MuJoCo could weigh.
            thin = not is_closed(tidied(mesh)[0]) or abs(signed_volume(mesh)) < 1e-9
            said = {"name": assets[file], "file": file, **({"inertia": "shell"} if thin else {})}
            SubElement(asset, "mesh", said)
        return assets[file]

    bodies = {cell.links[0].name: worldbody}
    equalities: list[dict[str, str]] = []
    order: list[str] = []
    for link in cell.links[1:]:
        where = {"name": link.name, **_placed(link.parent_from_link)}
        body = SubElement(bodies[link.parent or ""], "body", where)
        bodies[link.name] = body
        _inertial(body, link)
        for joint in link.joints:
            order.append(joint.name)
            said = {
                "name": joint.name,
                "type": "hinge" if joint.kind is JointKind.REVOLUTE else "slide",
                "axis": _text(joint.axis),
                "pos": _text(joint.anchor),
            }
            if joint.lower is not None and joint.upper is not None:
                said["range"] = _text((joint.lower, joint.upper))
            for key, value in (
                ("damping", joint.damping),
                ("frictionloss", joint.friction),
                ("armature", joint.armature.value if joint.armature is not None else 0.0),
            ):
                if value:
                    said[key] = repr(float(value))
            if joint.effort is not None:
                said["actuatorfrcrange"] = _text((-joint.effort.value, joint.effort.value))
            SubElement(body, "joint", said)
            if joint.mimic is not None:
                poly = _text((joint.mimic.offset, joint.mimic.multiplier, 0.0, 0.0, 0.0))
                equalities.append({"joint1": joint.name, "joint2": joint.mimic.joint, "polycoef": poly})
        for mesh in link.visual:
            rgba = _text(mesh.color)
            common = {"contype": "0", "conaffinity": "0", "group": "2", "mass": "0", "rgba": rgba}
            SubElement(body, "geom", {"type": "mesh", "mesh": mesh_of(mesh, link.name), **common})
        for solid in link.solids:
            _geom(body, solid, partial(mesh_of, label=link.name))
    if len(asset):
        root.append(asset)
    root.append(worldbody)
    if equalities:
        equality = SubElement(root, "equality")
        for said in equalities:
            SubElement(equality, "joint", said)
    if order:
        values = dict(home)
        for said in equalities:
            offset, factor, *_ = map(float, said["polycoef"].split())
            values[said["joint1"]] = offset + factor * values.get(said["joint2"], 0.0)
        # MuJoCo numbers joints depth first, as the tree is written.
        names = [element.get("name", "") for element in worldbody.iter("joint")]
        qpos = _text([values.get(name, 0.0) for name in names])
        SubElement(SubElement(root, "keyframe"), "key", name="home", qpos=qpos)
    indent(root, " ")
    return tostring(root, encoding="unicode") + "\n", files.files


def _inertial(body: Element, link: Link) -> None:
    if link.inertial is not None:
        i = link.inertial.inertia
        moments, axes = np.linalg.eigh(i)
        said = {"pos": _text(link.inertial.com), "mass": repr(float(link.inertial.mass))}
        if moments[0] > 1e-12:
            six = _text((i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]))
            said["fullinertia"] = six
        else:
            axes = axes * np.sign(np.linalg.det(axes))
            said["quat"] = _text(wxyz_from_rotation(axes))
            said["diaginertia"] = _text(np.maximum(moments, TINY))
        SubElement(body, "inertial", said)
    elif link.joints and not link.solids:
        small = _text((TINY, TINY, TINY))
        SubElement(body, "inertial", pos="0 0 0", mass=repr(TINY), diaginertia=small)


def _geom(body: Element, solid: Solid, mesh_of: Callable[[Mesh], str]) -> None:
    if solid.points is not None and len(solid.points) == 2:
        a, b = solid.points
        said = {"group": "3", "rgba": "0.5 0.5 0.5 0.3"}
        if np.linalg.norm(b - a) < 1e-12:
            SubElement(body, "geom", {"type": "sphere", "pos": _text(a), "size": repr(solid.radius), **said})
            return
        ends = _text((*a, *b))
        SubElement(body, "geom", {"type": "capsule", "fromto": ends, "size": repr(solid.radius), **said})
        return
    mesh = solid_mesh(solid) if solid.mesh is None or solid.radius else tidied(solid.mesh)[0]
    name = mesh_of(mesh)
    SubElement(body, "geom", {"type": "mesh", "mesh": name, "group": "3", "rgba": "0.5 0.5 0.5 0.3"})


def _placed(at: Array) -> dict[str, str]:
    return {"pos": _text(at[:3, 3]), "quat": _text(wxyz_from_rotation(at[:3, :3]))}


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
