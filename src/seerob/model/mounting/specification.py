"""Putting links and things into one MuJoCo specification, and keeping the books of what is where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from seerob.core.errors import InputError
from seerob.core.quantities import Pose
from seerob.core.remembered import remembered
from seerob.core.shapes import Mesh, Solid
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, rotation_from_rpy, rotation_from_wxyz, transform, wxyz_from_rotation
from seerob.description.description import Inertial, Joint, JointKind, Quantity
from seerob.description.shapes import glb
from seerob.description.shapes.hull import convex_hull

TINY = 2e-15
"""MuJoCo wants more than 1e-15 kg on a body with a joint; this changes no digit of a mass matrix."""
LEAST_FULL = 1e-14
"""Below this it takes no eigenvalue of a full matrix [kg·m²], but principal moments of `TINY`."""


@dataclass
class Entry:
    """A body in the making; becomes `seerob.model.model.Body`."""

    name: str
    role: str
    owner: str
    carrier: str
    solids: tuple[Solid, ...]
    mass: Quantity | None
    mesh: str | None
    triangles: int
    holder: str = ""


@dataclass
class Mounting:
    """A MuJoCo specification under construction."""

    file: str = "workstation"
    """The workstation file, for messages."""
    spec: mujoco.MjSpec = field(default_factory=mujoco.MjSpec)
    entries: list[Entry] = field(default_factory=list)
    meshes: dict[str, bytes] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    files: dict[str, bytes] = field(default_factory=dict)
    _bodies: dict[str, mujoco.MjsBody] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.spec.compiler.degree = False
        self.spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
        self.spec.compiler.fusestatic = False
        self.spec.compiler.autolimits = False

    def option(self, *, timestep: float, gravity: Sequence[float]) -> None:
        """Set how the physics is integrated: time step [s] and gravity [m/s²] (3,)."""
        self.spec.option.timestep = timestep
        self.spec.option.gravity = gravity
        # Damping of the controllers is integrated implicitly: stiff gains stay stable.
        self.spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST

    def body(self, name: str, parent: str | None, parent_from_body: Array) -> mujoco.MjsBody:
        """Add a body; ``parent`` None is the world.

        Raises:
            InputError: Another body has that name: a link, a bone, a piece of a part, MuJoCo's world.
        """
        if name in self._bodies or name == "world":
            what = f"the name {name!r} is taken by another body"
            raise InputError.at(self.file, "name", what, "choose another")
        above = self.spec.worldbody if parent is None else self._bodies[parent]
        added = above.add_body(
            name=name, pos=parent_from_body[:3, 3], quat=wxyz_from_rotation(parent_from_body[:3, :3])
        )
        self._bodies[name] = added
        return added

    def has(self, name: str) -> bool:
        """Whether there is a body of that name."""
        return name in self._bodies

    def get(self, name: str) -> mujoco.MjsBody:
        """The specification's body of that name."""
        return self._bodies[name]

    def joint(self, body: mujoco.MjsBody, name: str, joint: Joint) -> None:
        """Add a joint. Limits are not imposed: the twin shows what was heard, also beyond them."""
        hinge = joint.kind == JointKind.REVOLUTE
        body.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_HINGE if hinge else mujoco.mjtJoint.mjJNT_SLIDE,
            axis=joint.axis,
            pos=joint.anchor,
            armature=joint.armature.value if joint.armature is not None else 0.0,
            damping=[joint.damping, 0.0, 0.0],
            frictionloss=joint.friction,
        )

    def inertial(self, body: mujoco.MjsBody, inertial: Inertial) -> None:
        """Give a body its mass properties."""
        body.explicitinertial = True
        body.mass = inertial.mass
        body.ipos = inertial.com
        i = inertial.inertia
        moments, axes = np.linalg.eigh(i)
        if moments[0] < LEAST_FULL:  # MuJoCo knows no point masses; no moment and no mass gets smaller
            axes = axes * np.sign(np.linalg.det(axes))
            body.inertia, body.iquat = np.maximum(moments, TINY), wxyz_from_rotation(axes)
            return
        body.fullinertia = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]

    def massless(self, body: mujoco.MjsBody) -> None:
        """Give a body with a joint so little mass that no figure changes."""
        body.explicitinertial = True
        body.mass = TINY
        body.inertia = [TINY] * 3

    def shape(
        self,
        name: str,
        *,
        role: str,
        owner: str,
        carrier: str,
        solids: Sequence[Solid],
        visual: Sequence[Mesh],
        mass: Quantity | None,
    ) -> None:
        """Note that a body has a shape: it becomes a node of the scene and an item of distances."""
        shown = glb.shown(solids, visual)
        self.meshes[shown.digest] = shown.content
        self.entries.append(
            Entry(name, role, owner, carrier, tuple(solids), mass, shown.digest, shown.triangles)
        )


def pose_matrix(pose: Pose) -> Array:
    """Homogeneous matrix (4, 4) of a pose in the file."""
    if pose.wxyz is not None:
        return transform(rotation_from_wxyz(pose.wxyz), pose.position)
    return transform(rotation_from_rpy(pose.rpy if pose.rpy is not None else (0.0, 0.0, 0.0)), pose.position)


def extreme_points(solids: Sequence[Solid]) -> tuple[Array, float]:
    """Points whose convex hull, dilated by the radius returned with them, contains the solids.

    Returns:
        Points, shape (k, 3) [m], and radius [m].
    """
    points: list[Array] = []
    radius = 0.0
    for solid in solids:
        radius = max(radius, solid.radius)
        if solid.mesh is None:
            assert solid.points is not None
            corner = solid.points
            points.append(
                corner if len(corner) == 2 else np.vstack([corner, corner[1] + corner[2] - corner[0]])
            )
            continue
        points.append(_hull_corners(solid.mesh))
    return (np.vstack(points), radius) if points else (np.zeros((0, 3)), 0.0)


@remembered
def _hull_corners(mesh: Mesh) -> Array:
    """Corners of the convex hull of a mesh [m], shape (k, 3)."""
    vertices = mesh.vertices[np.unique(mesh.faces)]
    faces = convex_hull(vertices)
    # Flat or too few points: all of them are as good.
    return vertices if faces is None else vertices[np.unique(faces)]
