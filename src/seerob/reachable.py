r"""The volume that bodies can reach, from kinematics and joint limits, in voxels; nothing is missed.

Every position of a chain is a product of screws about the axes at one reference position,
:math:`e^{\hat\xi_1 \delta_1} \cdots e^{\hat\xi_n \delta_n} x` ([LynchPark2017]_ section 4.1), and the joints
are free of each other within their limits. So the reachable set is swept joint by joint, from the tip to
the base: what lies beyond joint i, as voxels, is turned about the axis of joint i through its whole range,
together with the link that joint i moves. Each of these n sweeps is conservative as in `seerob.swept`; a
sample of joint space could never be. A whole turn is made in the half-plane of radius and height: no angle
is missed.

That bodies collide with each other, and that mimic joints are tied to others, is not taken into account:
both make the true set smaller. Every joint adds the rounding to voxels once more, so the volume is thicker
than the truth by a few voxels; smaller ones bring it nearer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from seerob.errors import InputError
from seerob.kernels.fields import cells_field
from seerob.kernels.revolve import profile, revolve
from seerob.kernels.voxels import stamp
from seerob.model import Model
from seerob.moving import Core, Moving, Progress, reach_box, with_field
from seerob.swept import BAND, SLACK, SPACING, Swept
from seerob.transforms import Array
from seerob.voxels import VoxelGrid, check_room

LAYERS = 4
"""Around a set of voxels, up to which distances from it are exact [voxels]."""


@dataclass(frozen=True, eq=False)
class _Screw:
    """The axis of a joint at the reference position, and how far it may go from there."""

    slide: bool
    anchor: Array
    axis: Array
    low: float
    high: float

    def pose(self, delta: float) -> tuple[Array, Array]:
        """world_from_reference after the joint moved by ``delta`` [rad or m]: (3, 3), (3,)."""
        if self.slide:
            return np.eye(3), delta * self.axis
        x, y, z = self.axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rotation = np.eye(3) + np.sin(delta) * cross + (1 - np.cos(delta)) * cross @ cross
        return rotation, self.anchor - rotation @ self.anchor


def reachable_volume(
    model: Model,
    bodies: Sequence[int],
    *,
    voxel: float,
    slack: float = SLACK,
    memory: float | None = None,
    progress: Progress = lambda _: None,
    stop: Callable[[], bool] = lambda: False,
) -> Swept | None:
    """Everything that any point of the bodies can reach within the joint limits.

    Args:
        model: The compiled workstation.
        bodies: What reaches, from `Model.select`.
        voxel: Edge of a voxel [m].
        slack: Dilation for motion between two stamps that is aimed at [voxels].
        memory: Most bytes that the voxels may take; by default half of what is free.
        progress: Told the share that is done.
        stop: Asked now and then.

    Returns:
        The volume; None when stopped, since a part of it would not hold what it promises.

    Raises:
        InputError: A slide without limits; voxels that would take more memory than they may.
    """
    moving = Moving(model, bodies)
    low, high = reach_box(model, bodies)
    if not np.isfinite([low, high]).all():
        what = "a joint that slides has no limits"
        raise InputError.at("reachable volume", "of", what, "give lower and upper, or sweep a trajectory")
    check_room(low, high, voxel, memory)
    rotations, positions = moving.place(np.asarray(model.mj.qpos0, float))
    screws = _screws(model, moving)
    work = _Work(voxel, slack, memory, stop)
    beyond: dict[int, list[VoxelGrid]] = {}
    own: dict[int, list[tuple[Core, Array, Array]]] = {}
    parent: dict[int, int] = {}
    for i, (core, chain) in enumerate(zip(moving.cores, moving.chains, strict=True)):
        own.setdefault(chain[-1] if chain else -1, []).append((core, rotations[i], positions[i]))
        parent |= dict(zip(chain, (-1, *chain), strict=False))
    order = sorted(parent, reverse=True)
    for done, joint in enumerate(order):
        grid = work.sweep(screws[joint], own.get(joint, []), beyond.pop(joint, []))
        if grid is None:
            return None
        beyond.setdefault(parent[joint], []).append(grid)
        progress((done + 1) / len(order))
    # The rest stands still: one sweep that does not move.
    still = _Screw(True, np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.0, 0.0)
    grids = beyond.pop(-1, [])
    whole = grids[0] if len(grids) == 1 and -1 not in own else work.sweep(still, own.get(-1, []), grids)
    if whole is None:
        return None
    guarantee = "every voxel that a point of the bodies' shapes can reach within the joint limits"
    return Swept(whole, work.dilation, work.dilation, work.stamps, guarantee)


class _Work:
    def __init__(self, voxel: float, slack: float, memory: float | None, stop: Callable[[], bool]) -> None:
        self.voxel, self.slack, self.memory, self.stop = voxel, slack, memory, stop
        self.dilation = 0.0
        self.stamps = 0

    def sweep(
        self, screw: _Screw, cores: Sequence[tuple[Core, Array, Array]], beyond: Sequence[VoxelGrid]
    ) -> VoxelGrid | None:
        """All that solids and voxels, placed at the reference position, meet while one joint moves."""
        grid = VoxelGrid(self.voxel, memory=self.memory)
        if not screw.slide and screw.high - screw.low >= 2 * np.pi:
            for core, rotation, position in cores:
                if not self._stamped(grid, _still(screw), core, rotation, position):
                    return None
            return self._turned(screw, [grid, *beyond])
        for core, rotation, position in cores:
            if not self._stamped(grid, screw, core, rotation, position):
                return None
        for voxels in beyond:
            if not self._stamped(grid, screw, _core_of(voxels), np.eye(3), np.zeros(3), exact=voxels):
                return None
        return grid

    def _stamped(
        self,
        grid: VoxelGrid,
        screw: _Screw,
        core: Core,
        rotation: Array,
        position: Array,
        exact: VoxelGrid | None = None,
    ) -> bool:
        if exact is None:
            band = (BAND + min(self.slack, 1.0)) * self.voxel
            core = with_field(core, spacing=self.voxel * SPACING, band=band)
        corners = core.corners @ rotation.T + position
        arms = np.cross(corners - screw.anchor, screw.axis)
        arm = 1.0 if screw.slide else float(np.linalg.norm(arms, axis=1).max()) + core.radius
        span = screw.high - screw.low
        count = max(int(np.ceil(span / 2 * arm / (self.slack * self.voxel))), 1)
        bound = span / (2 * count) * arm
        self.dilation = max(self.dilation, bound)
        reach = bound + core.radius
        poses = [screw.pose(screw.low + (k + 0.5) * span / count) for k in range(count)]
        R = np.array([turn @ rotation for turn, _ in poses])
        x = np.array([turn @ position + shift for turn, shift in poses])
        points = np.einsum("nij,kj->nki", R, core.corners) + x[:, None]
        grid.cover(points.min(axis=(0, 1)) - reach, points.max(axis=(0, 1)) + reach)
        for k in range(0, count, 16):
            if self.stop():
                return False
            some = slice(k, k + 16)
            grid.count += stamp(
                grid.cells, grid.full, grid.origin, grid.pitch, core.nodes, core.start, core.spacing,
                core.low, core.high, R[some], x[some], np.full(len(R[some]), reach), 0, grid.full.shape[0],
            )  # fmt: skip
        self.stamps += count
        return True

    def _turned(self, screw: _Screw, grids: Sequence[VoxelGrid]) -> VoxelGrid | None:
        grids = [grid for grid in grids if grid.count]
        if self.stop():
            return None
        centres = [grid.centres() - screw.anchor for grid in grids]
        heights = [c @ screw.axis for c in centres]
        radii = [np.linalg.norm(np.cross(c, screw.axis), axis=1) for c in centres]
        rim = max(float(r.max()) for r in radii) + self.voxel
        low = min(float(h.min()) for h in heights) - self.voxel
        high = max(float(h.max()) for h in heights) + self.voxel
        # The box around the drum: along each world axis its ends and its rim.
        side = rim * np.sqrt(np.clip(1 - screw.axis**2, 0, 1))
        ends = screw.anchor + np.array([low, high])[:, None] * screw.axis
        turned = VoxelGrid(self.voxel, memory=self.memory)
        turned.cover(ends.min(axis=0) - side, ends.max(axis=0) + side)
        pitch = self.voxel / 4
        half = self.voxel / 2 * float(np.abs(screw.axis).sum())
        plane = profile(
            np.concatenate(radii), np.concatenate(heights) - low, self.voxel, half, pitch, rim, high - low
        )
        turned.count = revolve(
            turned.cells,
            turned.full,
            turned.origin,
            self.voxel,
            plane,
            pitch,
            screw.anchor,
            screw.axis,
            low,
            half,
        )
        return turned


def _still(screw: _Screw) -> _Screw:
    return _Screw(True, screw.anchor, screw.axis, 0.0, 0.0)


def _core_of(grid: VoxelGrid) -> Core:
    """A set of voxels as something that can be stamped."""
    cells, first = grid.marked(LAYERS + 1)
    low, high = grid.bounds()
    field = cells_field(cells, grid.pitch, LAYERS)
    return Core(
        body=-1,
        rotation=np.eye(3),
        position=np.zeros(3),
        low=low * grid.pitch,
        high=(high + 1) * grid.pitch,
        radius=0.0,
        nodes=field,
        start=(first + 0.5) * grid.pitch,
        spacing=grid.pitch,
    )


def _screws(model: Model, moving: Moving) -> dict[int, _Screw]:
    """Axes at the last placement and what is left of each joint's range from there."""
    limits: dict[str, tuple[float | None, float | None]] = {}
    for name, mechanism in model.mechanisms.items():
        every = [joint for link in mechanism.description.links for joint in link.joints]
        span = np.array([mechanism.lower, mechanism.upper])
        for row, joint in enumerate(every):
            low, high = joint.lower, joint.upper
            if joint.mimic is not None:
                # As far as the joint that it follows takes it.
                factor = mechanism.coupling[row]
                with np.errstate(invalid="ignore"):
                    reached = np.where(factor == 0, 0.0, factor * span).sum(axis=1) + mechanism.offset[row]
                low, high = float(reached.min()), float(reached.max())
            limits[f"{name}/{joint.name}"] = low, high
    screws = {}
    for j in {j for chain in moving.chains for j in chain}:
        name = mujoco.mj_id2name(model.mj, mujoco.mjtObj.mjOBJ_JOINT, j)
        low, high = limits[name]
        now = float(model.mj.qpos0[moving.joints.q_address[j]])
        slide = bool(moving.joints.slides[j])
        ends = (-np.pi, np.pi)
        if low is not None and high is not None and np.isfinite(high - low):
            ends = low - now, high - now
        screws[j] = _Screw(slide, moving.anchors[j].copy(), moving.axes[j].copy(), *ends)
    return screws
