"""Sets of bodies that move with joints, as the voxel kernels want them: boxes, fields and chains."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.shapes import Mesh, Solid
from seerob.core.transforms import Array
from seerob.description.shapes.mesh_bodies import is_closed
from seerob.description.shapes.mesh_mending import enclosing
from seerob.kernels.fields import Field, Region, mesh_field
from seerob.kernels.tree_file import tree_of
from seerob.model.model import Model

Indices = NDArray[np.int64]
Progress = Callable[[float], None]
"""Told what share is done, 0 to 1."""

MOST_NODES = 4_000_000
"""Of the field of one solid; a larger one is coarser, which marks more, never less."""
EMPTY: Field = np.zeros((0, 0, 0), np.float32)


@dataclass(frozen=True, eq=False)
class Core:
    """One solid, in a frame in which a box contains it tightly."""

    body: int
    """Index in `Model.bodies`."""
    rotation: Array
    """body_from_core, shape (3, 3)."""
    position: Array
    """Position of the core's frame in the body's frame [m], shape (3,)."""
    low: Array
    """Corner of the box around it [m], shape (3,)."""
    high: Array
    radius: float
    """It is dilated by this [m]: its own radius, and how far the real surface may lie outside."""
    mesh: Mesh | None = None
    """None when it is the box itself."""
    nodes: Field = field(default_factory=lambda: EMPTY)
    """Its field: see `seerob.kernels.fields`; empty for the box, and before `with_field`."""
    start: Array = field(default_factory=lambda: np.zeros(3))
    spacing: float = 1.0

    @property
    def corners(self) -> Array:
        """Corners of the box, shape (8, 3) [m]."""
        return np.where(np.indices((2, 2, 2)).reshape(3, 8).T, self.high, self.low)

    def region(self) -> Region:
        """The core as kernels take it."""
        return Region(self.nodes, self.start, self.spacing, self.low, self.high)


def core_of(body: int, solid: Solid) -> Core:
    """A solid (in the frame of body ``body`` of the model) and the box around it."""
    radius = solid.radius + solid.deviation
    if solid.mesh is None:
        assert solid.points is not None
        origin, edges = solid.points[0], solid.points[1:] - solid.points[0]
        rotation = _along(edges)
        ends = np.vstack([np.zeros(3), edges, edges.sum(axis=0)]) @ rotation
        return Core(body, rotation, origin.astype(float), ends.min(axis=0), ends.max(axis=0), radius)
    used = solid.mesh.vertices[np.unique(solid.mesh.faces)].astype(float)
    return Core(body, np.eye(3), np.zeros(3), used.min(axis=0), used.max(axis=0), radius, solid.mesh)


def with_field(core: Core, *, spacing: float, band: float) -> Core:
    """The core of a mesh with its field; any other as it is.

    Args:
        core: From `core_of`.
        spacing: Of the nodes [m].
        band: Distance from the solid's surface up to which the field is exact [m].
    """
    if core.mesh is None:
        return core
    pad = band + core.radius
    size = core.high - core.low + 2 * pad
    spacing = max(spacing, float(np.prod(size) / MOST_NODES) ** (1 / 3))
    tree = tree_of(
        np.ascontiguousarray(core.mesh.vertices, float), np.ascontiguousarray(core.mesh.faces, np.int32)
    )
    start, shape = core.low - pad, np.ceil(size / spacing).astype(np.int64) + 1
    nodes = mesh_field(tree.nodes, tree.links, tree.triangles, tree.closed, start, spacing, shape, pad)
    return replace(core, nodes=nodes, start=start, spacing=spacing)


def _along(edges: Array) -> Array:
    """Right-handed axes as columns, along edges that are at right angles, shape (k, 3) → (3, 3)."""
    axes: list[Array] = []
    for candidate in (*edges, *np.eye(3)[np.abs(edges[0]).argsort()]):
        beside = candidate - sum((axis * (axis @ candidate) for axis in axes), np.zeros(3))
        length = np.linalg.norm(beside)
        if length > 1e-9 * max(float(np.linalg.norm(candidate)), 1e-300) and length > 0:
            axes.append(beside / length)
        if len(axes) == 2:
            break
    return np.column_stack([*axes, np.cross(axes[0], axes[1])])


@dataclass(frozen=True, eq=False)
class Joints:
    """The joints of the whole workstation, in `mujoco`'s order: from base to tip in each chain."""

    slides: NDArray[np.bool_]
    """Whether prismatic, shape (nj,)."""
    q_address: Indices
    """In ``MjData.qpos``, shape (nj,)."""
    v_address: Indices
    """In ``MjData.qvel``, shape (nj,)."""

    @classmethod
    def of(cls, mj: mujoco.MjModel) -> Joints:
        """Read the joints of a compiled model.

        Raises:
            InputError: A joint that is neither revolute nor prismatic.
        """
        if not np.isin(mj.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)).all():
            raise InputError.at("swept volume", "of", "free and ball joints are not swept", "use hinges")
        return cls(
            mj.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE,
            mj.jnt_qposadr.astype(np.int64),
            mj.jnt_dofadr.astype(np.int64),
        )


class Moving:
    """The solids of some bodies, the joints that move each, and where they are for joint positions.

    Attributes:
        mj: The `mujoco.MjModel` that tells where bodies are on those that carry them: that of the
            workstation, with what is picked up in the hand as the file has it; that of a twin that picks
            things up (`seerob.twin.machines.gripping`) has it there as it was taken.
    """

    def __init__(self, model: Model, bodies: Sequence[int]) -> None:
        """Of a compiled workstation, and indices in `Model.bodies`."""
        self.model, self.bodies, self.mj = model, tuple(bodies), model.mj
        _refuse_open(model, self.bodies)
        # With openings closed of which nobody says whether they are.
        shaped = (model.closed or model).bodies
        self.cores = tuple(core_of(i, solid) for i in self.bodies for solid in shaped[i].solids)
        self.joints = Joints.of(model.mj)
        chains = {i: chain_of(model, i) for i in self.bodies}
        self.chains = tuple(chains[core.body] for core in self.cores)
        self.chain_start = np.cumsum([0, *map(len, self.chains)], dtype=np.int64)
        self.chain = np.array([j for chain in self.chains for j in chain], np.int64)
        self.corners = np.array([core.corners for core in self.cores]).reshape(-1, 8, 3)
        self.radius = np.array([core.radius for core in self.cores], float)
        self._turn = np.array([core.rotation for core in self.cores]).reshape(-1, 3, 3)
        self._shift = np.array([core.position for core in self.cores]).reshape(-1, 3)
        self._mj = np.array([model.bodies[core.body].mj for core in self.cores], np.int64)
        self._data = mujoco.MjData(model.mj)
        if not self.cores:
            raise InputError.at("swept volume", "of", "nothing in it has a shape", "name bodies with shapes")

    def place(self, qpos: Array) -> tuple[Array, Array]:
        """world_from_core of every core, (ns, 3, 3) and (ns, 3) [m]; the axes are found on the way."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self.mj, self._data)
        world = self._data.xmat[self._mj].reshape(-1, 3, 3)
        return world @ self._turn, self._data.xpos[self._mj] + np.einsum("nij,nj->ni", world, self._shift)

    @property
    def anchors(self) -> Array:
        """A point of each joint's axis at the last `place`, in the world [m], shape (nj, 3)."""
        return np.asarray(self._data.xanchor)

    @property
    def axes(self) -> Array:
        """Each joint's axis at the last `place`, in the world, shape (nj, 3)."""
        return np.asarray(self._data.xaxis)

    def box(self, rotations: Array, positions: Array, reach: Array) -> tuple[Array, Array]:
        """The upright box that holds all cores at poses, dilated: two corners (3,) [m].

        Args:
            rotations: From `place`.
            positions: Likewise.
            reach: How far each is dilated beyond its own radius [m], shape (ns,).
        """
        points = np.einsum("nij,nkj->nki", rotations, self.corners) + positions[:, None]
        beyond = (reach + self.radius)[:, None, None]
        return (points - beyond).min(axis=(0, 1)), (points + beyond).max(axis=(0, 1))


def chain_of(model: Model, body: int) -> tuple[int, ...]:
    """Joints that move a body, from base to tip."""
    return joints_above(model.mj, model.bodies[body].mj)


def joints_above(mj: mujoco.MjModel, at: int) -> tuple[int, ...]:
    """Joints that move one of MuJoCo's bodies, from base to tip."""
    chain = list[int]()
    while at > 0:
        first = int(mj.body_jntadr[at])
        chain = [*range(first, first + int(mj.body_jntnum[at])), *chain] if first >= 0 else chain
        at = int(mj.body_parentid[at])
    return tuple(chain)


def reach_box(model: Model, bodies: Sequence[int]) -> tuple[Array, Array]:
    """A box that the bodies cannot leave, whatever the joints do: two corners (3,) [m].

    From the first joint's axis on, each joint's anchor and at last the body's points stay within the sum
    of the distances from anchor to anchor. Infinite with a slide that has no limits.
    """
    mj, data = model.mj, mujoco.MjData(model.mj)
    mujoco.mj_kinematics(mj, data)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    limits = {
        f"{name}/{joint.name}": (joint.lower, joint.upper)
        for name, mechanism in model.mechanisms.items()
        for link in mechanism.description.links
        for joint in link.joints
    }
    for index in bodies:
        body = model.bodies[index]
        if not len(body.corners):
            continue
        corners = body.corners @ data.xmat[body.mj].reshape(3, 3).T + data.xpos[body.mj]
        beyond = body.radius + body.deviation
        chain = chain_of(model, index)
        if not chain:
            low, high = (
                np.minimum(low, (corners - beyond).min(axis=0)),
                np.maximum(high, (corners + beyond).max(axis=0)),
            )
            continue
        anchors = data.xanchor[list(chain)]
        length = float(np.linalg.norm(np.diff(anchors, axis=0), axis=1).sum())
        length += float(np.linalg.norm(corners - anchors[-1], axis=1).max()) + beyond
        for joint in chain:
            if mj.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
                name = mujoco.mj_id2name(mj, mujoco.mjtObj.mjOBJ_JOINT, joint) or ""
                ends = limits.get(name, (None, None))
                length += np.inf if None in ends else max(abs(end) for end in ends if end is not None)
        low, high = np.minimum(low, anchors[0] - length), np.maximum(high, anchors[0] + length)
    return low, high


def posed(model: Model, motion: Mapping[str, Array]) -> Array:
    """Positions of all joints of the workstation; who is not named stands where the file puts it.

    Args:
        model: The compiled workstation.
        motion: Joint positions of robots and humans by name [rad or m], shape (N, n) each.

    Returns:
        Shape (N, nq).

    Raises:
        UnknownName: No such robot or human.
        InputError: Shapes that do not fit, or a position that is not finite.
    """
    lengths = {len(q) for q in motion.values()}
    if len(lengths) != 1 or 0 in lengths:
        raise InputError.at(
            "motion", "", f"{sorted(lengths)} samples", "give each the same number, 1 or more"
        )
    out = np.tile(np.asarray(model.mj.qpos0, float), (lengths.pop(), 1))
    for name, mechanism in model.mechanisms.items():
        q = np.asarray(motion.get(name, mechanism.home[None]), float)
        if q.ndim != 2 or q.shape[1] != len(mechanism.joints):
            what = f"{q.shape} joint positions"
            raise InputError.at("motion", name, what, f"give {len(mechanism.joints)} per sample")
        if not np.isfinite(q).all():
            row, column = np.argwhere(~np.isfinite(q))[0]
            what = f"sample {row}, joint {mechanism.joints[column].name} is {q[row, column]}"
            raise InputError.at("motion", name, what, "every position must be a finite number")
        out[:, mechanism.q_address] = q @ mechanism.coupling.T + mechanism.offset
    for name in motion:
        model.mechanism(name)
    return out


def _refuse_open(model: Model, bodies: Sequence[int]) -> None:
    """Refuse tools, workpieces and parts of which nobody can say what volume they take.

    Links are told about only (`seerob.description.lint.open_meshes`): nobody can give them another shape.

    Raises:
        InputError: With each that has an open mesh.
    """
    station = model.workstation
    file = next(iter(station.files), "workstation")
    problems = []
    for group in ("tools", "workpieces", "parts"):
        for i, thing in enumerate(getattr(station, group)):
            own = [model.bodies[k].solids for k in bodies if model.bodies[k].owner == thing.name]
            meshes = [solid.mesh for solids in own for solid in solids if solid.mesh is not None]
            if meshes and not all(map(is_closed, meshes)) and enclosing(meshes) is None:
                what = f"the mesh of {thing.name} is open: the volume that it sweeps cannot be told"
                problems.append(Problem(file, f"{group}[{i}].mesh", what, "close it, or give a shape"))
    if problems:
        raise InputError(problems)
