r"""The volume that bodies sweep on their way, in voxels; none that any of their points crosses is missed.

Between two samples every joint stays between its two values. The way is cut into m equal pieces and each
solid is stamped in the middle of each, dilated by a bound of how far its points can be from there: with half
a piece's width :math:`w_i = |\Delta q_i| / 2m` of each joint, :math:`\sum_i w_i \rho_i`, see
`seerob.kernels.voxels.motion_bounds`. With m = 1 that covers *every* way on which each joint stays between
its two values; with m > 1 every way that passes each piece so, as the straight line does.

When the joint velocities at both samples are given, the way may be the cubic with these ends: it leaves
the straight line by at most :math:`\frac{4}{27} (|\dot q_0 h - \Delta q| + |\dot q_1 h - \Delta q|)` (the
largest value of :math:`s (1-s)^2`), which is added to :math:`w_i`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import mujoco
import numpy as np

from seerob.core.shapes import Mesh
from seerob.core.transforms import Array
from seerob.distance.voxels import VoxelGrid, check_room
from seerob.kernels.voxels import motion_bounds, stamp
from seerob.model.model import Model
from seerob.model.volumes.moving import Core, Moving, Progress, posed, with_field

SLACK = 0.5
"""Dilation for the motion between stamps that pieces are made small for [voxels]."""
FINEST = 64
"""Pieces between two samples, at most; a power of 2. Beyond it the dilation grows instead."""
SPACING = 0.75
"""Of the nodes of a mesh's field [voxels]."""
MANY = 100
"""Stamps from which on threads share them."""
SLAB = 3
"""Blocks of the grid that a thread takes at a time."""
BATCH = 64
"""Samples between two reports of progress."""
BAND = 0.9
"""Up to where fields are exact, beyond the slack: a little more than half of half a diagonal [voxels]."""
CUBIC = 4.0 / 27.0


@dataclass(frozen=True, eq=False)
class Swept:
    """A volume, and what is guaranteed of it."""

    grid: VoxelGrid
    dilation: float
    """What the bodies were dilated by for the motion between stamps, at most [m]."""
    mean_dilation: float
    """On average over the stamps [m]."""
    stamps: int
    """Poses of single solids that were marked."""
    guarantee: str
    """What is inside, in a sentence."""
    excess: float | None = None
    """How far a point of the voxels can be from the true set, all roundings added up [m]; None: not known."""

    @property
    def volume(self) -> float:
        """Volume of the voxels; not less than that of the swept set [m³]."""
        return self.grid.volume

    def mesh(self, *, most: int | None = None) -> Mesh:
        """A closed surface with all voxels inside, of about ``most`` triangles; None sets no bound."""
        return self.grid.mesh(most=most)


class Holding(Protocol):
    """What grippers hold as a motion goes on, instant by instant: see `seerob.twin.machines.gripping`."""

    mj: mujoco.MjModel
    """The `mujoco.MjModel` that tells where bodies are on those that carry them."""

    def follow(self, qpos: Array) -> None:
        """The next instant: positions of all joints [rad or m], shape (nq,)."""


class Sweep:
    """Marks the way of bodies, piece by piece."""

    def __init__(
        self,
        model: Model,
        bodies: Sequence[int],
        *,
        voxel: float,
        slack: float = SLACK,
        memory: float | None = None,
        held: Holding | None = None,
    ) -> None:
        """Prepare.

        Args:
            model: The compiled workstation.
            bodies: Indices in `Model.bodies`.
            voxel: Edge of a voxel [m].
            slack: Dilation for motion that is aimed at [voxels]; less takes longer.
            memory: Most bytes that the voxels may take; by default half of what is free.
            held: What grippers hold on the way; without it, all that they may pick up is in the hand as the
                file has it, all the time.

        Raises:
            InputError: A voxel size that is no length or makes too many; bodies without shapes.
        """
        self.grid = VoxelGrid(voxel, memory=memory)
        self.slack = slack
        self.moving = Moving(model, bodies)
        self._held = held
        if held is not None:
            self.moving.mj = held.mj
        self._cores: tuple[Core, ...] | None = None
        self.dilation = 0.0
        self.beyond = np.zeros(len(self.moving.cores))
        """How far each solid is dilated from now on, beside what motion asks for [m], shape (ns,)."""
        self.stamps = 0
        self._total = 0.0
        self._last: tuple[Array, Array | None] | None = None
        self._joints = self.moving.joints
        count = len(self.moving.cores)
        self._queue: list[list[tuple[Array, Array, float]]] = [[] for _ in range(count)]

    @property
    def cores(self) -> tuple[Core, ...]:
        """What is stamped, with its fields: made when first needed, after the memory has been checked."""
        if self._cores is None:
            pitch = self.grid.pitch
            band = (BAND + min(self.slack, 1.0)) * pitch
            make = partial(with_field, spacing=pitch * SPACING, band=band)
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                self._cores = tuple(pool.map(make, self.moving.cores))
        return self._cores

    def start(self, qpos: Array, qvel: Array | None = None) -> None:
        """Mark the bodies where they are now; what they did before is not known."""
        if self._held is not None:
            self._held.follow(qpos)
        rotations, positions = self.moving.place(qpos)
        self.grid.cover(*self.moving.box(rotations, positions, self.beyond))
        for core, beyond in enumerate(self.beyond.tolist()):
            self._queue[core].append((rotations[core].copy(), positions[core].copy(), beyond))
        self._last = qpos.copy(), None if qvel is None else qvel.copy()
        self.flush()

    def advance(
        self,
        qpos: Array,
        qvel: Array | None = None,
        period: float | None = None,
        noise: Array | None = None,
    ) -> None:
        """Mark the way from the last joint positions to these, or these alone when they are the first.

        Args:
            qpos: All joint positions [rad or m], shape (nq,).
            qvel: All joint velocities there [rad/s or m/s], shape (nv,); the way is then the cubic.
            period: Time since the last ones [s]; needed with ``qvel``.
            noise: How far velocities may be off at both ends [rad/s or m/s], shape (nv,): a cubic of other
                velocities is off by a quarter of what these make in that time, at most.
        """
        if self._last is None:
            self.start(qpos, qvel)
            return
        self.enqueue(qpos, qvel, period, noise)
        self.flush()

    def enqueue(
        self,
        qpos: Array,
        qvel: Array | None = None,
        period: float | None = None,
        noise: Array | None = None,
    ) -> None:
        """Advance like `advance`, but mark nothing before `flush`."""
        assert self._last is not None
        before, speed = self._last
        delta = (qpos - before)[self._joints.q_address]
        bend = np.zeros(len(delta))
        if qvel is not None and speed is not None and period is not None:
            address = self._joints.v_address
            bend = CUBIC * (np.abs(speed[address] * period - delta) + np.abs(qvel[address] * period - delta))
            bend = bend + (0.0 if noise is None else noise[address] * period / 4)
        middle = self._bounded(before, qpos, 0.5, np.abs(delta) / 2 + bend)
        self.grid.cover(*self.moving.box(middle[0], middle[1], middle[2] + self.beyond))
        goal = self.slack * self.grid.pitch
        pieces = np.exp2(np.ceil(np.log2(np.maximum(middle[2] / goal, 1.0)))).astype(np.int64)
        pieces = np.minimum(pieces, FINEST)
        moved = middle[2] > 0
        for m in np.unique(pieces[moved]).tolist():
            chosen = np.flatnonzero(moved & (pieces == m)).tolist()
            for piece in range(m):
                made = middle
                if m > 1:
                    made = self._bounded(before, qpos, (piece + 0.5) / m, np.abs(delta) / (2 * m) + bend)
                rotations, positions, reach = made
                for core in chosen:
                    wide = float(reach[core] + self.beyond[core])
                    self._queue[core].append((rotations[core], positions[core], wide))
        self._last = qpos.copy(), None if qvel is None else qvel.copy()
        if self._held is not None:
            self._held.follow(qpos)

    def flush(self) -> None:
        """Mark what was enqueued."""
        grid, blocks = self.grid, self.grid.full.shape[0]
        work = [
            (
                core,
                np.array([e[0] for e in queue]),
                np.array([e[1] for e in queue]),
                np.array([e[2] for e in queue]),
            )
            for core, queue in zip(self.cores, self._queue, strict=True)
            if queue
        ]

        def mark(begin: int, end: int) -> int:
            return sum(
                stamp(grid.arrays(), core.region(), R, x, reach + core.radius, begin, end)
                for core, R, x, reach in work
            )

        stamps = sum(len(reach) for *_, reach in work)
        if stamps < MANY:
            grid.count += mark(0, blocks)
        else:
            edges = range(0, blocks + SLAB, SLAB)
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                grid.count += sum(pool.map(mark, edges[:-1], edges[1:]))
        for *_, reach in work:
            self.dilation = max(self.dilation, float(reach.max()))
            self._total += float(reach.sum())
        self.stamps += stamps
        for queue in self._queue:
            queue.clear()

    def clear(self) -> None:
        """Forget everything that was marked."""
        self.grid.clear()
        self.dilation, self.stamps, self._total, self._last = 0.0, 0, 0.0, None

    def _bounded(self, a: Array, b: Array, share: float, widths: Array) -> tuple[Array, Array, Array]:
        """Poses at a share of the way, and how far points can be from there [m], shape (ns,)."""
        moving = self.moving
        rotations, positions = moving.place(a + share * (b - a))
        bounds = np.empty(len(moving.cores))
        motion_bounds(
            moving.anchors, moving.axes, self._joints.slides, widths, moving.chain_start, moving.chain,
            moving.corners, moving.radius, rotations, positions, bounds,
        )  # fmt: skip
        return rotations, positions, bounds

    @property
    def swept(self) -> Swept:
        """What has been marked so far."""
        mean = self._total / self.stamps if self.stamps else 0.0
        guarantee = (
            "every voxel that a point of the bodies' shapes crosses while each joint goes straight from "
            "sample to sample, or on the cubic where velocities are given"
        )
        moving = self.moving
        if moving.mj is moving.model.mj and any(moving.model.bodies[i].holder for i in moving.bodies):
            guarantee += "; what is picked up counts in the hand, where the file has it"
        return Swept(self.grid, self.dilation, mean, self.stamps, guarantee)


def swept_volume(
    model: Model,
    bodies: Sequence[int],
    motion: Mapping[str, Array],
    *,
    voxel: float,
    slack: float = SLACK,
    memory: float | None = None,
    held: Holding | None = None,
    progress: Progress = lambda _: None,
    stop: Callable[[], bool] = lambda: False,
) -> Swept:
    """The volume of a trajectory, or of a part of it.

    Args:
        model: The compiled workstation.
        bodies: What sweeps, from `Model.select`.
        motion: Joint positions of robots and humans by name [rad or m], shape (N, n) each; who is not
            named stands still where the file puts it.
        voxel: Edge of a voxel [m].
        slack: See `Sweep`.
        memory: Likewise.
        held: Likewise.
        progress: Told the share that is done.
        stop: Asked now and then; when true, what is marked so far is returned.

    Raises:
        InputError: The motion does not fit, or the voxels would take more memory than they may; found
            before anything is marked.
    """
    qpos = posed(model, motion)
    sweep = Sweep(model, bodies, voxel=voxel, slack=slack, memory=memory, held=held)
    box = _box(sweep, qpos)
    check_room(*box, voxel, memory)
    sweep.grid.cover(*box)
    sweep.start(qpos[0])
    for i in range(1, len(qpos)):
        sweep.enqueue(qpos[i])
        if i % BATCH == 0 or i == len(qpos) - 1:
            sweep.flush()
            progress(i / (len(qpos) - 1))
            if stop():
                break
    return sweep.swept


def _box(sweep: Sweep, qpos: Array) -> tuple[Array, Array]:
    """The box around the whole way; makes the grid no larger than it must be."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    delta = np.abs(np.diff(qpos, axis=0))[:, sweep.moving.joints.q_address] / 2
    for i in range(max(len(qpos) - 1, 1)):
        end = min(i + 1, len(qpos) - 1)
        widths = delta[i] if len(delta) else np.zeros(len(sweep.moving.joints.slides))
        a, b = sweep.moving.box(*sweep._bounded(qpos[i], qpos[end], 0.5, widths))
        low, high = np.minimum(low, a), np.maximum(high, b)
    return low, high
