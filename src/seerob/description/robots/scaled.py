r"""A robot that is larger or smaller than the one that exists, by the similarity law of Froude.

Shapes grow by :math:`s`; what they are made of and the pull of the earth stay. So masses go with :math:`s^3`,
moments of inertia with :math:`s^5`, and a motion that looks the same takes :math:`\sqrt s` times as long:
angular speeds go with :math:`s^{-1/2}`, speeds with :math:`s^{1/2}`, forces with :math:`s^3` and torques with
:math:`s^4`. Whether anybody could build it, strong and stiff enough, is another question.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

import numpy as np

from seerob.core.shapes import Mesh, Solid
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, Quantity


def scaled(description: Description, scale: float, *, name: str) -> Description:
    """A robot `scale` times as large, with what follows for its masses, speeds and torques.

    Args:
        description: The one that exists.
        scale: Factor of all lengths, above 0.
        name: Of the robot, for the finding that says that it does not exist.
    """
    text = (
        f"a robot of this size does not exist: {scale:g} times as large as {description.source}, of the "
        "same density; masses, inertia, speeds and torques follow from the similarity law of Froude, and "
        "nobody has measured any of them"
    )
    slides = {j.name for link in description.links for j in link.joints if j.kind is JointKind.PRISMATIC}
    return replace(
        description,
        links=tuple(_link(link, scale, slides) for link in description.links),
        source=f"{description.source}, × {scale:g}",
        findings=(*description.findings, Finding(level="warning", subject=name, text=text)),
    )


def _link(link: Link, s: float, slides: Set[str]) -> Link:
    placed = link.parent_from_link.copy()
    placed[:3, 3] *= s
    return replace(
        link,
        parent_from_link=placed,
        joints=tuple(_joint(joint, s, slides) for joint in link.joints),
        inertial=None if link.inertial is None else _inertial(link.inertial, s),
        visual=tuple(_mesh(mesh, s) for mesh in link.visual),
        solids=tuple(_solid(solid, s) for solid in link.solids),
    )


def _joint(joint: Joint, s: float, sliding: Set[str]) -> Joint:
    slides = joint.kind is JointKind.PRISMATIC
    way = s if slides else 1.0
    force, speed = (s**3, s**0.5) if slides else (s**4, s**-0.5)
    mimic = joint.mimic
    if mimic is not None:
        led = s if mimic.joint in sliding else 1.0
        mimic = replace(mimic, multiplier=mimic.multiplier * way / led, offset=mimic.offset * way)
    return replace(
        joint,
        anchor=joint.anchor * s,
        lower=None if joint.lower is None else joint.lower * way,
        upper=None if joint.upper is None else joint.upper * way,
        velocity=_quantity(joint.velocity, speed, s),
        effort=_quantity(joint.effort, force, s),
        armature=_quantity(joint.armature, s**3 if slides else s**5, s),
        damping=joint.damping * force / speed,
        friction=joint.friction * force,
        mimic=mimic,
    )


def _quantity(given: Quantity | None, factor: float, s: float) -> Quantity | None:
    if given is None:
        return None
    source = f"{given.source}, × {factor:.4g} for a robot {s:g} times as large"
    return Quantity(given.value * factor, _origin(given.origin), source, given.error)


def _origin(given: Origin) -> Origin:
    """What was measured or stated is computed from that; what nobody knows is known no better."""
    known = (Origin.MEASURED, Origin.STATED, Origin.GIVEN)
    return Origin.COMPUTED if given in known else given


def _inertial(given: Inertial, s: float) -> Inertial:
    source = f"{given.source}, × {s**3:.4g} for a robot {s:g} times as large"
    return replace(
        given,
        mass=given.mass * s**3,
        com=given.com * s,
        inertia=given.inertia * s**5,
        within=given.within * s,
        gyration=given.gyration * s,
        origin=_origin(given.origin),
        source=source,
    )


def _mesh(mesh: Mesh, s: float) -> Mesh:
    return Mesh(mesh.vertices * s, mesh.faces, mesh.color)


def _solid(solid: Solid, s: float) -> Solid:
    points: Array | None = None if solid.points is None else np.asarray(solid.points) * s
    mesh = None if solid.mesh is None else _mesh(solid.mesh, s)
    return replace(solid, mesh=mesh, points=points, radius=solid.radius * s, deviation=solid.deviation * s)
