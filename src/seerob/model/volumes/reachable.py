r"""The volume that bodies can reach, from kinematics and joint limits, in voxels; nothing is missed.

Every position of a chain is a product of screws about the axes at one reference position,
:math:`e^{\hat\xi_1 \delta_1} \cdots e^{\hat\xi_n \delta_n} x` ([LynchPark2017]_ section 4.1), and the joints
are free of each other within their limits. So the reachable set is swept joint by joint, from the tip to
the base: what lies beyond joint i, as voxels, is turned about the axis of joint i through its whole range,
together with the link that joint i moves. Each of these n sweeps is conservative as in
`seerob.model.volumes.swept`; a sample of joint space could never be. A whole turn is made in the half-plane
of radius and height: no angle is missed.

That bodies collide with each other, and that mimic joints are tied to others, is not taken into account:
both make the true set smaller. Every joint rounds to voxels once more. So that this does not add up, each
joint is swept in voxels as fine as `CELLS` allow, and what it moves is cut back to a ball that it cannot
leave: from a point of its axis to one of the next, and so on to the farthest corner, no way is longer than
the sum. What rounding can have added in all is counted step by step (`Swept.excess`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.distance.voxels import VoxelGrid, check_room
from seerob.kernels.fields import cells_field
from seerob.kernels.revolve import cut_to_ball, profile, revolve
from seerob.kernels.voxels import stamp
from seerob.model.model import Model
from seerob.model.volumes.moving import Core, Joints, Moving, Progress, reach_box, with_field
from seerob.model.volumes.swept import SLACK, SPACING, Swept

CELLS = 2e7
"""Voxels that the sweep of one joint may take, about, when they are made finer than asked."""
FINEST = 8
"""Parts of a voxel's edge in the sweep of a joint, at most; a power of 2."""
EXACT = 2.0
"""How far around a set distances from it are exact [voxels that are marked]; `_stamped_excess` needs it."""
HALF_DIAGONAL = np.sqrt(3) / 2


@dataclass(frozen=True, eq=False)
class Screw:
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


STILL = Screw(True, np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.0, 0.0)


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
        raise _without_limits()
    check_room(low, high, voxel, memory)
    rotations, positions = moving.place(np.asarray(model.mj.qpos0, float))
    joints = {j for chain in moving.chains for j in chain}
    screws = screws_of(model, joints, moving.anchors, moving.axes)
    balls = _balls(moving, screws, rotations, positions)
    work = _Work(voxel, slack, memory, stop)
    beyond: dict[int, list[_Set]] = {}
    own: dict[int, list[tuple[Core, Array, Array]]] = {}
    parent: dict[int, int] = {}
    for i, (core, chain) in enumerate(zip(moving.cores, moving.chains, strict=True)):
        own.setdefault(chain[-1] if chain else -1, []).append((core, rotations[i], positions[i]))
        parent |= dict(zip(chain, (-1, *chain), strict=False))
    order = sorted(parent, reverse=True)
    for done, joint in enumerate(order):
        found = work.sweep(screws[joint], own.get(joint, []), beyond.pop(joint, []), balls[joint])
        if found is None:
            return None
        beyond.setdefault(parent[joint], []).append(found)
        progress((done + 1) / len(order))
    whole = work.whole(own.get(-1, []), beyond.pop(-1, []))
    if whole is None:
        return None
    guarantee = "every voxel that a point of the bodies' shapes can reach within the joint limits"
    return Swept(whole.grid, work.dilation, work.dilation, work.stamps, guarantee, whole.excess)


@dataclass(frozen=True, eq=False)
class _Set:
    """Voxels, and how far they can be from the set that they stand for."""

    grid: VoxelGrid
    centre: float
    """Largest distance of a voxel's centre from that set [m]."""

    @property
    def excess(self) -> float:
        """Largest distance of any point of the voxels from that set [m]."""
        return float(self.centre + HALF_DIAGONAL * self.grid.pitch)


class _Work:
    def __init__(self, voxel: float, slack: float, memory: float | None, stop: Callable[[], bool]) -> None:
        self.voxel, self.slack, self.memory, self.stop = voxel, slack, memory, stop
        self.dilation = 0.0
        self.stamps = 0

    def sweep(
        self,
        screw: Screw,
        cores: Sequence[tuple[Core, Array, Array]],
        beyond: Sequence[_Set],
        ball: tuple[Array, float],
    ) -> _Set | None:
        """All that solids and voxels, placed at the reference position, meet while one joint moves."""
        grid = VoxelGrid(_finer(self.voxel, ball[1]), memory=self.memory)
        whole_turn = not screw.slide and screw.high - screw.low >= 2 * np.pi
        excess = 0.0
        for core, rotation, position in cores:
            added = self._stamped(grid, STILL if whole_turn else screw, core, rotation, position)
            if added is None:
                return None
            excess = max(excess, added)
        if whole_turn:
            found = self._turned(screw, [_Set(grid, excess), *beyond], grid.pitch)
            if found is None:
                return None
            grid, excess = found.grid, found.centre
        else:
            for voxels in beyond:
                core = _core_of(voxels.grid, grid.pitch * EXACT)
                added = self._stamped(grid, screw, core, np.eye(3), np.zeros(3))
                if added is None:
                    return None
                excess = max(excess, voxels.excess + added)
        centre, radius = ball
        grid.count -= cut_to_ball(grid.cells, grid.full, grid.origin, grid.pitch, centre, radius)
        return _Set(grid, excess)

    def whole(self, still: Sequence[tuple[Core, Array, Array]], moved: Sequence[_Set]) -> _Set | None:
        """All of it, in voxels of the size that was asked for."""
        grid = VoxelGrid(self.voxel, memory=self.memory)
        excess = 0.0
        for core, rotation, position in still:
            added = self._stamped(grid, STILL, core, rotation, position)
            if added is None:
                return None
            excess = max(excess, added)
        for each in moved:
            if not each.grid.count:
                continue
            factor = round(self.voxel / each.grid.pitch)
            low, high = each.grid.bounds()
            grid.cover(low * each.grid.pitch, (high + 1) * each.grid.pitch)
            # Its empty layers may lie beyond what is covered.
            for i in range(int(low[0]), int(high[0]) + 1):
                marked = np.argwhere(each.grid.cells[i - int(each.grid.first[0])])
                j, k = ((marked + each.grid.first[1:]) // factor - grid.first[1:]).T
                grid.cells[i // factor - grid.first[0], j, k] = 1
            # From the centre of a voxel to that of one of the finer voxels in it.
            apart = HALF_DIAGONAL * (self.voxel - each.grid.pitch)
            excess = max(excess, each.centre + apart)
        grid.count = int(grid.cells.sum(dtype=np.int64))
        return _Set(grid, excess)

    def _stamped(
        self, grid: VoxelGrid, screw: Screw, core: Core, rotation: Array, position: Array
    ) -> float | None:
        """How far the centre of a voxel that was marked can be from the set [m]; None when stopped."""
        pitch = grid.pitch
        core = with_field(core, spacing=pitch * SPACING, band=EXACT * pitch)
        corners = core.corners @ rotation.T + position
        arms = np.cross(corners - screw.anchor, screw.axis)
        arm = 1.0 if screw.slide else float(np.linalg.norm(arms, axis=1).max()) + core.radius
        span = screw.high - screw.low
        count = max(int(np.ceil(span / 2 * arm / (self.slack * pitch))), 1)
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
                return None
            some = slice(k, k + 16)
            grid.count += stamp(
                grid.arrays(),
                core.region(),
                R[some],
                x[some],
                np.full(len(R[some]), reach),
                0,
                grid.full.shape[0],
            )
        self.stamps += count
        return _stamped_excess(core, bound, pitch)

    def _turned(self, screw: Screw, sets: Sequence[_Set], pitch: float) -> _Set | None:
        sets = [each for each in sets if each.grid.count]
        if self.stop():
            return None
        centres = [each.grid.centres() - screw.anchor for each in sets]
        heights = np.concatenate([c @ screw.axis for c in centres])
        radii = np.concatenate([np.linalg.norm(np.cross(c, screw.axis), axis=1) for c in centres])
        edges = np.concatenate([np.full(len(c), s.grid.pitch) for c, s in zip(centres, sets, strict=True)])
        largest = float(edges.max())
        rim = float(radii.max()) + largest
        low, high = float(heights.min()) - largest, float(heights.max()) + largest
        # The box around the drum: along each world axis its ends and its rim.
        side = rim * np.sqrt(np.clip(1 - screw.axis**2, 0, 1))
        ends = screw.anchor + np.array([low, high])[:, None] * screw.axis
        turned = VoxelGrid(pitch, memory=self.memory)
        turned.cover(ends.min(axis=0) - side, ends.max(axis=0) + side)
        fine = pitch / 4
        share = float(np.abs(screw.axis).sum()) / 2
        wide = _seen_along(screw.axis)
        plane = profile(radii, heights - low, edges, share, wide, fine, rim, high - low)
        turned.count = revolve(
            turned.cells, turned.full, turned.origin, pitch, plane, fine, screw.anchor, screw.axis, low,
            share * pitch, wide * pitch,
        )  # fmt: skip
        # Both voxels meet one cell of the half-plane: so far are their centres from each other at most.
        excess = max(
            each.centre + float(np.hypot(wide * both + fine, share * both + fine))
            for each in sets
            for both in [pitch + each.grid.pitch]
        )
        return _Set(turned, excess)


def _finer(voxel: float, radius: float) -> float:
    """Edge of the voxels in which a joint is swept that keeps what it moves in a ball [m]."""
    parts = 1
    while parts < FINEST and (4 * parts * radius / voxel) ** 3 <= CELLS:
        parts *= 2
    return voxel / parts


def _seen_along(axis: Array) -> float:
    """Farthest that a point of a cube is from its centre, seen along an axis [edges]."""
    signs = np.array([[1, a, b] for a in (-1, 1) for b in (-1, 1)], float)
    return float(np.sqrt(3 - (signs @ axis) ** 2).max() / 2)


def _stamped_excess(core: Core, bound: float, pitch: float) -> float:
    r"""How far the centre of a voxel that was marked can be from the set itself [m].

    Interpolated squares give away at most :math:`3 h^2 / 4`, and since distances are 1-Lipschitz the
    interpolation itself no more than :math:`\sqrt3 h / 2` of the distance, see `seerob.kernels.fields`.
    """
    gap = HALF_DIAGONAL * core.spacing if core.nodes.size else 0.0
    near = gap + float(np.hypot(bound + core.radius + 0.5 * pitch, gap)) - core.radius
    return float(near + HALF_DIAGONAL * pitch)


def _balls(
    moving: Moving, screws: dict[int, Screw], rotations: Array, positions: Array
) -> dict[int, tuple[Array, float]]:
    """Of each joint a ball that what it moves cannot leave: its centre on the axis (3,), its radius [m]."""
    ways: list[tuple[tuple[int, ...], Array, float]] = []
    for i, (core, chain) in enumerate(zip(moving.cores, moving.chains, strict=True)):
        corners = core.corners @ rotations[i].T + positions[i]
        points = [screws[j].anchor for j in chain]
        # Any point of an axis will do; those near each other give a short way.
        for _ in range(30):
            for k, j in enumerate(chain):
                after = points[k + 1] if k + 1 < len(chain) else corners.mean(axis=0)
                middle = after if k == 0 else (points[k - 1] + after) / 2
                points[k] = screws[j].anchor + screws[j].axis * (screws[j].axis @ (middle - screws[j].anchor))
        if chain:
            last = float(np.linalg.norm(corners - points[-1], axis=1).max()) + core.radius
            ways.append((chain, np.array(points), last))
    balls = {}
    for joint in screws:
        through = [(each[0].index(joint), *each) for each in ways if joint in each[0]]
        centre = np.mean([way[k] for k, _, way, _ in through], axis=0)
        radius = 0.0
        for k, chain, way, last in through:
            slides = [screws[j] for j in chain[k:] if screws[j].slide]
            own = float(np.linalg.norm(way[k] - centre))
            steps = float(np.linalg.norm(np.diff(way[k:], axis=0), axis=1).sum())
            slid = sum(max(abs(s.low), abs(s.high)) for s in slides)
            radius = max(radius, own + steps + last + slid)
        balls[joint] = centre, radius
    return balls


def _core_of(grid: VoxelGrid, band: float) -> Core:
    """A set of voxels as something that can be stamped; distances are exact up to ``band`` [m] around."""
    layers = int(np.ceil(band / grid.pitch)) + 2
    cells, first = grid.marked(layers + 1)
    low, high = grid.bounds()
    field = cells_field(cells, grid.pitch, layers)
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


def _without_limits() -> InputError:
    what = "a joint that slides has no limits"
    return InputError.at("reachable volume", "of", what, "give lower and upper, or sweep a trajectory")


def screws_of(model: Model, joints: Iterable[int], anchors: Array, axes: Array) -> dict[int, Screw]:
    """Axes of joints where the file has them, and what is left of each joint's range from there.

    Args:
        model: The compiled workstation.
        joints: Of `mujoco`, by index.
        anchors: A point of each joint's axis there, in the world [m], shape (nj, 3).
        axes: Each joint's axis there, shape (nj, 3).

    Raises:
        InputError: A slide without limits.
    """
    every = Joints.of(model.mj)
    limits: dict[str, tuple[float | None, float | None]] = {}
    for name, mechanism in model.mechanisms.items():
        own = [joint for link in mechanism.description.links for joint in link.joints]
        span = np.array([mechanism.lower, mechanism.upper])
        for row, joint in enumerate(own):
            low, high = joint.lower, joint.upper
            if joint.mimic is not None:
                # As far as the joint that it follows takes it; where that has no limits its own count.
                factor = mechanism.coupling[row]
                with np.errstate(invalid="ignore"):
                    reached = np.where(factor == 0, 0.0, factor * span).sum(axis=1) + mechanism.offset[row]
                if np.isfinite(reached).all():
                    low, high = float(reached.min()), float(reached.max())
            limits[f"{name}/{joint.name}"] = low, high
    screws = {}
    for j in joints:
        name = mujoco.mj_id2name(model.mj, mujoco.mjtObj.mjOBJ_JOINT, j) or ""
        low, high = limits[name]
        now = float(model.mj.qpos0[every.q_address[j]])
        slide = bool(every.slides[j])
        ends = (-np.pi, np.pi)
        if low is not None and high is not None and np.isfinite(high - low):
            ends = low - now, high - now
        elif slide:
            raise _without_limits()
        screws[j] = Screw(slide, anchors[j].copy(), axes[j].copy(), *ends)
    return screws
