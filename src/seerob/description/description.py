"""What every model reader returns, whatever the format: a tree of links in plain data.

Robots from URDF, MJCF or the library and the digital human are the same kind of thing here;
`seerob.model.model` turns it into MuJoCo bodies. Nothing in this file knows MuJoCo.

Where the links of a description are, by forward kinematics in a few lines, and which links move as one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from seerob.core.errors import Problem
from seerob.core.shapes import Mesh, Solid
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array, rotation_from_axis_angle, transform


class JointKind(StrEnum):
    """How a joint moves; one degree of freedom each."""

    REVOLUTE = "revolute"
    """About ``axis`` [rad], with or without limits (a continuous joint has none)."""
    PRISMATIC = "prismatic"
    """Along ``axis`` [m]."""


@dataclass(frozen=True)
class Quantity:
    """A number with where it comes from."""

    value: float
    origin: Origin
    source: str
    error: float = 0.0
    """Relative uncertainty, of an estimate that has a bound; 0 when stated."""
    spread_error: float = 0.0
    """Of a mass: `Inertial.spread_error`."""
    within: float = 0.0
    """Of a mass: `Inertial.within` [m]."""
    gyration: float = 0.0
    """Of a mass: `Inertial.gyration` [m]."""


@dataclass(frozen=True, eq=False)
class Mimic:
    """``q = multiplier · q[joint] + offset``."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Joint:
    """One degree of freedom of a link relative to its parent."""

    name: str
    kind: JointKind
    axis: Array
    """Unit axis in the link's frame, shape (3,)."""
    anchor: Array = field(default_factory=lambda: np.zeros(3))
    """A point of the axis in the link's frame [m], shape (3,)."""
    lower: float | None = None
    """[rad or m]; None where there is no limit."""
    upper: float | None = None
    velocity: Quantity | None = None
    """Largest speed [rad/s or m/s]; None when nobody stated one."""
    effort: Quantity | None = None
    """Largest torque or force [N·m or N]; None when nobody stated one."""
    armature: Quantity | None = None
    """Rotor inertia seen at the joint [kg·m² or kg]; None when nobody stated one."""
    damping: float = 0.0
    """[N·m·s/rad or N·s/m]"""
    friction: float = 0.0
    """Dry friction [N·m or N]."""
    mimic: Mimic | None = None


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass properties of a link in its own frame."""

    mass: float
    """[kg]"""
    com: Array
    """Centre of mass [m], shape (3,)."""
    inertia: Array
    """About the centre of mass, in the link's axes [kg·m²], shape (3, 3), symmetric."""
    origin: Origin
    source: str
    error: float = 0.0
    """Relative uncertainty of the mass, of an estimate; 0 when stated."""
    spread_error: float = 0.0
    """By which share all that it adds to a mass matrix may be off in any motion, with centre and moments,
    no less than ``error``; 0 where the mass alone is uncertain, infinite where nobody says where the surface
    is that a mesh lacks: then nobody knows the mass either."""
    within: float = 0.0
    """How far from ``com`` any of the mass may lie, where nobody knows how it is spread [m]; 0 where that is
    known."""
    gyration: float = 0.0
    """Largest radius of gyration about any axis through ``com``, where that is known and moments are not [m]:
    they are anything from nothing to ``mass * gyration**2``; 0 where they are known."""


def rigid(parts: Sequence[tuple[Inertial, Array]]) -> Inertial:
    """Mass properties of several bodies as one.

    Args:
        parts: Of each body, and the frame of the whole from its own, (4, 4).
    """
    mass = sum(one.mass for one, _ in parts)
    coms = [at[:3, :3] @ one.com + at[:3, 3] for one, at in parts]
    com = sum((one.mass * c for (one, _), c in zip(parts, coms, strict=True)), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for (one, at), c in zip(parts, coms, strict=True):
        d = c - com
        inertia += at[:3, :3] @ one.inertia @ at[:3, :3].T + one.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Inertial(
        mass,
        com,
        inertia,
        parts[0][0].origin,
        "; ".join(dict.fromkeys(one.source for one, _ in parts)),
        error=sum(one.mass * one.error for one, _ in parts) / mass,
        # What holds of each by itself holds of their sum by the largest; their centre moves with each.
        spread_error=max(
            max(one.error, one.spread_error) if len(parts) > 1 else one.spread_error for one, _ in parts
        ),
    )


@dataclass(frozen=True, eq=False)
class Link:
    """One rigid body."""

    name: str
    parent: str | None
    """None for the root, which is fixed where the workstation puts it."""
    parent_from_link: Array
    """With every joint at 0, shape (4, 4)."""
    joints: tuple[Joint, ...] = ()
    """Several are applied in this order, each in the frame that the ones before it left."""
    inertial: Inertial | None = None
    """None: nobody gave one. Frames without shape or mass are such links too."""
    refused_mass: str = ""
    """Why what its file says of its mass cannot be used; empty where it can, or says nothing."""
    impossible_mass: Problem | None = None
    """What its file says of its mass that no body has, where that cannot be overlooked."""
    visual: tuple[Mesh, ...] = ()
    """For display, in the link's frame."""
    solids: tuple[Solid, ...] = ()
    """For distances and contacts, in the link's frame."""

    def __repr__(self) -> str:
        names = ", ".join(joint.name for joint in self.joints) or "fixed"
        return f"<Link {self.name!r} on {self.parent!r}: {names}>"


@dataclass(frozen=True, eq=False)
class Description:
    """A robot or a human: links in order, each after its parent."""

    name: str
    links: tuple[Link, ...]
    tip: str
    """Link that a tool is mounted on, and the default point of interest."""
    source: str
    """File, library entry and revision it was read from."""
    findings: tuple[Finding, ...] = ()
    """Everything that was repaired, guessed, dropped or is implausible."""
    left_out: tuple[str, ...] = ()
    """Constraints between links that a tree of joints has no place for, a closed loop among them."""
    files: dict[str, bytes] = field(default_factory=dict)
    """Every file that was read (name → content), for hashes and for recordings that travel."""

    def __repr__(self) -> str:
        count = f"{len(self.links)} links, {len(self.joints())} joints"
        return f"<Description {self.name!r}: {count}, from {self.source[:60]}>"

    def joints(self) -> tuple[Joint, ...]:
        """Joints that can be commanded, in order; those that mimic another are not among them."""
        return tuple(j for link in self.links for j in link.joints if j.mimic is None)

    def link(self, name: str) -> Link:
        """The link of that name; KeyError when there is none."""
        return {link.name: link for link in self.links}[name]


def base_from_links(description: Description, q: Mapping[str, float]) -> dict[str, Array]:
    """Pose of every link (4, 4) in the root's frame.

    Joints that ``q`` does not name are at 0, or where the one is that they mimic.

    Args:
        description: The robot.
        q: Joint name → position [rad or m].
    """
    poses: dict[str, Array] = {}
    for link in description.links:
        pose = link.parent_from_link if link.parent is None else poses[link.parent] @ link.parent_from_link
        for joint in link.joints:
            pose = pose @ displacement(joint, _position(joint, q))
        poses[link.name] = pose
    return poses


def _position(joint: Joint, q: Mapping[str, float]) -> float:
    """Where a joint is [rad or m]."""
    if joint.mimic is None or joint.name in q:
        return q.get(joint.name, 0.0)
    return joint.mimic.multiplier * q.get(joint.mimic.joint, 0.0) + joint.mimic.offset


def displacement(joint: Joint, q: float) -> Array:
    """``link_at_0_from_link_at_q`` of a joint, shape (4, 4)."""
    if joint.kind is JointKind.PRISMATIC:
        return transform(position=joint.axis * q)
    rotation = rotation_from_axis_angle(joint.axis, q)
    return transform(rotation, joint.anchor - rotation @ joint.anchor)


def groups(links: Sequence[Link]) -> tuple[tuple[Link, ...], ...]:
    """Links that no joint moves relative to each other; the first of each is the one its joint moves."""
    head: dict[str, str] = {}
    found: dict[str, list[Link]] = {}
    for link in links:
        head[link.name] = link.name if link.parent is None or link.joints else head[link.parent]
        found.setdefault(head[link.name], []).append(link)
    return tuple(map(tuple, found.values()))
