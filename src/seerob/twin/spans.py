r"""What everybody does between two ticks: the way they take, and how far and fast any point can get on it.

Whoever judges instants says nothing of what lies between them. Here lies what bounds it: the joints move
along cubics through the positions and velocities of the physics' own steps (of the samples, where the twin
is put on these), and with that of every joint a bound on speed, acceleration and its variation of every point
(`seerob.kernels.spans`). All of it holds at every instant of the span, whatever the shapes.

A figure of which the margin to its limit, m, changes by at most ``fall`` within a span of ends 0 and 1, and
falls at most ``bend`` below the lesser of both ends, is there nowhere below

.. math:: \max\big(\tfrac12 (m_0 + m_1 - \text{fall}),\; \min(m_0, m_1) - \text{bend}\big).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, overload

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.spans import (
    FIGURES,
    Chains,
    Figures,
    all_falls,
    column_changes,
    greatest,
    joint_bounds,
    joints_at,
    joints_on_ways,
    point_bounds,
    slowest_and_fastest,
)
from seerob.model.model import Mechanism, Model

Indices = NDArray[np.int64]
Foresee = Callable[[str, Array], tuple[Array, Array, str] | None]
"""Asks what a robot does at instants to come [s]: positions and velocities of its joints [rad or m], shape
(k, n), and why they are not known so; None where nothing is."""

Knots = Callable[[str, float, float], Sequence[float] | Array]
"""Asks of a robot, and from when to when [s], between which instants what it is known to do is one cubic: in
the order of time [s], shape (k,)."""


class Coupling(NamedTuple):
    """What the commanded joints of a robot do to all joints."""

    moves: NDArray[np.bool_]
    """Which of them they move, in the order of ``MjData.qvel``, shape (nv,)."""
    shares: Array
    """Absolute share of each commanded one in it, shape (nv, n)."""


def coupling_of(model: Model, mechanism: Mechanism) -> Coupling:
    """Of a robot's own joints."""
    moves, shares = np.zeros(model.mj.nv, bool), np.zeros((model.mj.nv, mechanism.coupling.shape[1]))
    moves[mechanism.v_address], shares[mechanism.v_address] = True, np.abs(mechanism.coupling)
    return Coupling(moves, shares)


class Gap(NamedTuple):
    """A time in which samples are missing of who is heard live (`seerob.twin.control.unheard`)."""

    name: str
    begin: float
    """When its last sample before was so [s]."""
    end: float
    """When its first one after was [s]."""
    acceleration: Array
    """Largest of its joints meanwhile [rad/s² or m/s²], shape (n,); infinite where nobody knows it."""
    speeds: bool
    """Whether both samples say speeds."""

    @property
    def anywhere(self) -> bool:
        """Whether nothing bounds where it was meanwhile."""
        return not np.isfinite(self.acceleration).all()


ROUNDING = 1e-9
"""Added to every bound on a way or a speed [m, m/s]: the error of rounding is far below."""


@dataclass(frozen=True, eq=False)
class Path:
    """Where all joints are from one tick to the next: cubics from knot to knot."""

    t: Array
    """Knots, increasing: both ticks and what lies between [s], shape (k,), k >= 2."""
    q: Array
    """``qpos`` there, shape (k, nq)."""
    v: Array
    """``qvel`` there, shape (k, nv)."""
    broken: tuple[str, ...] = ()
    """Robots, people and machines that were put elsewhere meanwhile: nobody knows their way."""
    captured: tuple[Array, Array] | None = None
    """``qpos`` and ``qvel`` of the same knots with people as they were captured, where the physics holds one
    of them elsewhere at either end (`State.stray`), or touches one (`Hearing.held`)."""

    gaps: tuple[Gap, ...] | None = None
    """What is missing until its end of robots, machines and variables that are heard live; None where none is
    heard live."""
    loose: tuple[Gap, ...] = ()
    """What is missing on the way: robots may have gone another one."""

    def captured_at(self, t: float) -> tuple[Array, Array] | None:
        """``qpos`` and ``qvel`` at an instant [s] of it with people as captured; None where it follows."""
        if self.captured is None:
            return None
        q, v = np.empty(self.q.shape[1]), np.empty(self.v.shape[1])
        joints_at(self.t, *self.captured, t, q, v)
        return q, v

    def at(self, t: float) -> tuple[Array, Array]:
        """``qpos`` and ``qvel`` at an instant [s] of it."""
        q, v = np.empty(self.q.shape[1]), np.empty(self.v.shape[1])
        joints_at(self.t, self.q, self.v, t, q, v)
        return q, v

    def accelerations(self, begin: float, end: float, dofs: Indices, *, stepped: bool) -> Array:
        """Accelerations of joints from one instant to another, of which all others there are means, (m, d).

        Args:
            begin: [s].
            end: [s].
            dofs: Which joints, in the order of ``MjData.qvel``.
            stepped: Whether the knots are the physics' steps, in each of which they are constant.
        """
        found = []
        for k in np.flatnonzero((self.t[1:] > begin) & (self.t[:-1] < end)).tolist():
            T = self.t[k + 1] - self.t[k]
            v, then = self.v[k, dofs], self.v[k + 1, dofs]
            if stepped:
                found.append((then - v) / T)
                continue
            mean = 6 * (self.q[k + 1, dofs] - self.q[k, dofs]) / T
            x = (np.array([max(begin, self.t[k]), min(end, self.t[k + 1])]) - self.t[k]) / T
            found += [(mean - 4 * v - 2 * then + s * (6 * (v + then) - 2 * mean)) / T for s in x.tolist()]
        return np.array(found).reshape(-1, len(dofs))

    def copied(self) -> Path:
        """The path in arrays of its own: the engine writes the next one into these."""
        return replace(self, t=self.t.copy(), q=self.q.copy(), v=self.v.copy())

    @staticmethod
    def joined(paths: Sequence[Path], loose: tuple[Gap, ...]) -> Path:
        """Paths that follow one another as one, of which something is missing."""
        ends = [0 if k == 0 else 1 for k in range(len(paths))]  # they share them
        captured = None
        if any(path.captured is not None for path in paths):
            both = [(path.q, path.v) if path.captured is None else path.captured for path in paths]
            q, v = (np.concatenate([each[i][k:] for each, k in zip(both, ends, strict=True)]) for i in (0, 1))
            captured = q, v
        t, q, v = (
            np.concatenate([part[k:] for part, k in zip(every, ends, strict=True)])
            for every in ([p.t for p in paths], [p.q for p in paths], [p.v for p in paths])
        )
        broken = {name for path in paths for name in path.broken} | {
            gap.name for gap in loose if gap.anywhere
        }
        bounded = tuple(gap for gap in loose if not gap.anywhere)
        return Path(t, q, v, tuple(sorted(broken)), captured, loose=bounded)

    def middle(self, begin: float, end: float) -> float:
        """Where a span is best cut [s]: at the knot that is nearest to its middle, else there."""
        inside = self.t[(self.t > begin) & (self.t < end)]
        half = (begin + end) / 2
        return float(inside[np.abs(inside - half).argmin()]) if len(inside) else half


class Ways(Sequence[Path]):
    """Paths from each of some instants to the next, which share their ends.

    Args:
        t: Knots of all, increasing [s], shape (k,).
        q: ``qpos`` there, shape (k, nq).
        v: ``qvel`` there, shape (k, nv).
        first: Which knots the instants are, shape (N,) of N - 1 paths.
    """

    def __init__(self, t: Array, q: Array, v: Array, first: Indices) -> None:
        self.t, self.q, self.v, self.first = t, q, v, first

    def __len__(self) -> int:
        return max(len(self.first) - 1, 0)

    @overload
    def __getitem__(self, k: int) -> Path: ...
    @overload
    def __getitem__(self, k: slice) -> Ways: ...
    def __getitem__(self, k: int | slice) -> Path | Ways:
        if isinstance(k, slice):
            begin, end, step = k.indices(len(self))
            if step != 1:
                raise ValueError("ways are taken one after the other: a slice without a step")
            return Ways(self.t, self.q, self.v, self.first[begin : max(begin, end) + 1])
        k = range(len(self))[k]
        return self.joined(k, k + 1)

    def at(self, k: Indices, t: Array) -> tuple[Array, Array]:
        """``qpos`` (m, nq) and ``qvel`` (m, nv) at instants [s], shape (m,), each on one path, shape (m,)."""
        q, v = np.empty((len(t), self.q.shape[1])), np.empty((len(t), self.v.shape[1]))
        joints_on_ways(self.t, self.q, self.v, self.first, k, t, q, v)
        return q, v

    def knots_inside(self) -> Array:
        """Knots of all paths that are none of the instants [s], shape (m,)."""
        begin, end = int(self.first[0]), int(self.first[-1])
        if end - begin == len(self):
            return self.t[:0]
        inside = np.ones(end - begin + 1, bool)
        inside[self.first - begin] = False
        return self.t[begin : end + 1][inside]

    def joined(self, begin: int, end: int) -> Path:
        """Paths that follow one another as one."""
        knots = slice(int(self.first[begin]), int(self.first[end]) + 1)
        return Path(self.t[knots], self.q[knots], self.v[knots])


class Fall(NamedTuple):
    """How much of its margin a figure can lose within a span, in its own unit; numbers, or one per part."""

    fall: Array | float
    """From any instant of the span to any other."""
    bend: Array | float = np.inf
    """Below the lesser margin of both ends."""


_FALL = partial(tuple.__new__, Fall)
"""Makes one of a pair, without a call of Python for each."""
UNBOUNDED = Fall(np.inf)
"""The fall within a span of which nothing is known."""


class Points:
    """Points of which the motion is bounded: of every body its outermost, and what criteria add.

    Args:
        model: The compiled workstation.

    Attributes:
        count: How many there are; the first are those of `Model.bodies`.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self._own: list[tuple[int, Array, float]] = []
        self._ids = b""
        """Which of MuJoCo's bodies moved each body when chains were resolved."""
        self._bounds = np.zeros((4, model.mj.nv))
        self._speed, self._change, self._varies, self._away = self._bounds
        self._every = NO_CHAINS
        self._movers = {name: np.asarray(m.v_address) for name, m in model.mechanisms.items()}

    @property
    def count(self) -> int:
        """How many points there are."""
        return len(self.model.bodies) + len(self._own)

    def add(self, body: int, point: Array, radius: float = 0.0) -> int:
        """Bound another point, and all that is within a distance of it; to be called before the first span.

        Args:
            body: MuJoCo's.
            point: In its frame [m], shape (3,).
            radius: [m].

        Returns:
            Its row in what a `Span` says of points.
        """
        self._own.append((body, np.asarray(point, float).reshape(1, 3), radius))
        self._ids = b""
        return self.count - 1

    def span(self, path: Path, begin: float, end: float, ids: Indices, mj: mujoco.MjModel) -> Span:
        """What holds from one instant to another.

        Args:
            path: Of all joints.
            begin: [s].
            end: [s].
            ids: MuJoCo's body of each body at the begin, see `seerob.twin.attachments`.
            mj: The `mujoco.MjModel` then.
        """
        if self._ids != ids.tobytes():
            self._chains(mj, ids)
        n = self.count
        moved, captured = np.empty((3, n)), None
        if path.captured is not None:
            # Who is held back may be where the twin is, or where the capture is: the larger motion of both.
            self._bound(path, *path.captured, begin, end, mj, moved)
            captured, joints = moved.copy(), self._bounds.copy()
        self._bound(path, path.q, path.v, begin, end, mj, moved)
        if captured is not None:
            np.maximum(self._bounds, joints, out=self._bounds)
            np.maximum(moved, captured, out=moved)
        if path.broken:
            moved[:, ~np.isfinite(moved[0])] = np.inf
        fast = None if captured is None else captured[0]
        return Span(begin, end, moved, self._bounds.copy(), path, mj, fast)

    def _bound(
        self,
        path: Path,
        q: Array,
        v: Array,
        begin: float,
        end: float,
        mj: mujoco.MjModel,
        moved: Array,
    ) -> None:
        """Bound all joints, and with them all points, on cubics through the knots of a path."""
        joint_bounds(path.t, q, v, begin, end, mj.qpos0, self._bounds)
        for gap in path.loose:
            self._loosen(gap, end - begin)
        for name in path.broken:
            rows = self._movers[name]
            self._speed[rows] = self._change[rows] = self._varies[rows] = np.inf
        point_bounds(self._bounds, end - begin, self._every, moved)

    def _loosen(self, gap: Gap, T: float) -> None:
        """Let a robot go any way within a span of length T [s] that its accelerations allow."""
        mechanism, rows = self.model.mechanisms[gap.name], self._movers[gap.name]
        coupling = np.abs(mechanism.coupling)
        limits = [math.inf if v is None else v.value for v in mechanism.velocity_limits]
        most = coupling @ gap.acceleration
        lasts, twice = gap.end - gap.begin, 1 if gap.speeds else 2
        faster = twice * (most + self._change[rows]) * lasts / 4
        away = faster * lasts / 4
        with np.errstate(invalid="ignore"):
            capped = np.where(coupling > 0, coupling * limits, 0.0).sum(axis=1)
        allowed = np.maximum(capped - self._speed[rows], 0.0)
        faster = np.minimum(faster, allowed)
        self._varies[rows] += 4 * faster / T
        # Soon at its limit, it goes on so for nearly half of the time, and comes back in the other half.
        self._away[rows] += np.minimum(away, faster * lasts / 2)
        self._speed[rows] += faster
        self._change[rows] = np.maximum(self._change[rows], most)

    @property
    def every_chain(self) -> Chains:
        """Joints that move the points."""
        return self._every

    def chain(self, point: int) -> tuple[Indices, NDArray[np.bool_], Array]:
        """Joints that move a point, from base to tip, whether each turns, the segments behind them [m]."""
        assert self._ids
        start, joints, turns, lengths = self._every
        part = slice(int(start[point]), int(start[point + 1]))
        return joints[part], turns[part], lengths[part]

    def chains(self, points: Indices, ids: Indices, mj: mujoco.MjModel) -> tuple[Indices, Chains]:
        """Joints that move some points; ids and model as `span` takes them.

        Returns:
            Which these are in ``MjData.qvel``, increasing, shape (d,), and the chains, by rows of that.
        """
        if self._ids != ids.tobytes():
            self._chains(mj, ids)
        every = [self.chain(point) for point in points.tolist()]
        joints, turns, lengths = (
            np.concatenate([each[i] for each in every]) if every else np.zeros(0, kind)
            for i, kind in enumerate((np.int64, np.bool_, float))
        )
        dofs = np.unique(joints)
        start = np.cumsum([0, *(len(each[0]) for each in every)])
        return dofs, Chains(start, np.searchsorted(dofs, joints), turns, lengths)

    def column_changes(self, point: int, span: Span, coupling: Coupling) -> Array:
        r"""How quickly columns of a point's linear Jacobian change at most, per second, shape (n,).

        Args:
            point: See `add`.
            span: Within which.
            coupling: Whose columns.
        """
        found = np.empty(coupling.shares.shape[1])
        column_changes(*self.chain(point), span.qd, span.away, *coupling, found)
        return found

    def at_constant_speeds(self, span: Span) -> tuple[Array, Array]:
        """Largest acceleration of each point from the speeds of joints alone [m/s²], shape (p,).

        Returns:
            That, and a bound on how far it changes within the span: `seerob.kernels.spans` bounds each term
            of how the whole acceleration does by its size, and those of this part are among them.
        """
        none, (most, varies) = np.zeros(len(span.qd)), np.empty((2, self.count))
        for change, found in ((none, most), (span.qdd, varies)):
            moved = np.empty((3, self.count))
            point_bounds(np.array([span.qd, change, none, span.away]), span.T, self._every, moved)
            found[:] = moved[1] if change is none else 4 * moved[2] / span.T
        return most, varies

    def _chains(self, mj: mujoco.MjModel, ids: Indices) -> None:
        """Resolve which joints move each point, from base to tip, and how long the segments between are."""
        data = mujoco.MjData(mj)
        mujoco.mj_kinematics(mj, data)
        bodies = self.model.bodies
        every = [(int(ids[b.index]), b.corners, b.radius + b.deviation) for b in bodies]
        start, joints, turns, lengths = [0], [], [], []
        for body, points, radius in (*every, *self._own):
            chain = joints_of(mj, body)
            ends = points @ data.xmat[body].reshape(3, 3).T + data.xpos[body]
            anchors = data.xanchor[chain]
            if chain:
                far = float(np.linalg.norm(ends - anchors[-1], axis=1).max(initial=0.0))
                lengths += [*np.linalg.norm(np.diff(anchors, axis=0), axis=1).tolist(), far + radius]
            joints += [int(mj.jnt_dofadr[j]) for j in chain]
            turns += [bool(mj.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE) for j in chain]
            start.append(len(joints))
        self._every = chains_by(start, joints, turns, lengths)
        self._ids = ids.tobytes()


def chains_by(
    start: Sequence[int], joints: Sequence[int], turns: Sequence[bool], lengths: Sequence[float]
) -> Chains:
    """Chains by their fields."""
    where, which = np.array(start, np.int64), np.array(joints, np.int64)
    return Chains(where, which, np.array(turns, np.bool_), np.array(lengths, float))


NO_CHAINS = chains_by([0], [], [], [])
"""Of no points."""


def joints_of(mj: mujoco.MjModel, body: int) -> list[int]:
    """Joints that move a body of MuJoCo's, from base to tip."""
    found: list[int] = []
    while body > 0:
        first = int(mj.body_jntadr[body])
        found = [*range(first, first + int(mj.body_jntnum[body])), *found]
        body = int(mj.body_parentid[body])
    return found


class Span:
    """Bounds that hold at every instant from one to another; points as in `Points`."""

    def __init__(
        self,
        begin: float,
        end: float,
        moved: Array,
        joints: Array,
        path: Path,
        mj: mujoco.MjModel,
        captured: Array | None = None,
    ) -> None:
        self.begin, self.end = begin, end
        self.path, self.mj = path, mj
        """Where all joints are, and the `mujoco.MjModel` that moves them."""
        self.foresee: Foresee = lambda name, t: None
        """What robots are known to do after the tick at which the path ends."""
        self.knots: Knots = lambda name, begin, end: ()
        """Between which instants that is one cubic."""
        self.T = end - begin
        """Its length [s]."""
        self._captured = captured
        self.moved = moved
        """The next three, shape (3, p)."""
        self.fast = fast = moved[0]
        """Largest speed [m/s], shape (p,)."""
        self.quick = moved[1]
        """Largest acceleration [m/s²], shape (p,)."""
        self.bend = moved[2]
        """How far a velocity gets from the straight line between those at both ends [m/s], shape (p,)."""
        self.slow = np.zeros(len(fast))
        """Least speed of the fastest point of each body [m/s], shape (n,)."""
        self.ends = fast
        """Larger of its speeds at both ends [m/s], shape (n,), once these are known."""
        self.noise = np.zeros(len(fast))
        """How far speeds of points of bodies may be off that were derived from noisy positions [m/s], shape
        (p,), which is in no other figure here; 0 of points that criteria add."""
        self.noisy = False
        """Whether there is any."""
        self.joint_noise = np.zeros(mj.nv)
        """How far speeds of joints may be off by that noise [rad/s or m/s], shape (nv,)."""
        self.joints = joints
        """From `seerob.kernels.spans.joint_bounds`, shape (4, nv)."""
        self.qd, self.qdd, _, self.away = joints
        """Largest absolute speed and acceleration of every joint, and way from the model's pose, (nv,)."""

    def between_speeds(self, before: Array, after: Array) -> None:
        """Take into account how fast bodies are at both ends [m/s], shape (n,) each."""
        self.ends, self.slow = np.empty((2, len(before)))
        slowest_and_fastest(
            before, after, self.T, self.quick, self.bend, self.fast, self.ends, self.slow
        )  # fmt: skip
        if self._captured is not None:
            # How fast the twin is at both ends says nothing of who was captured elsewhere.
            np.maximum(self.fast, self._captured, out=self.fast)

    def derived(self, points: Array, joints: Array) -> None:
        """Take into account how far speeds may be off at one end, of bodies [m/s] (n,) and joints (nv,).

        Until the other end, the distance of a point from an axis changes by no more than both of them move.
        """
        n, some = len(points), points > 0
        moved = 2 * float(self.fast[:n].max(initial=0.0)) * self.T
        self.noise[:n][some] = points[some] + float(np.linalg.norm(joints)) * moved
        self.joint_noise = joints
        self.noisy = bool(some.any())

    def way(self, rows: Indices) -> float:
        """Longest way of any of some points within the span [m]."""
        return greatest(self.fast, rows) * self.T + ROUNDING


Margin = tuple[Array | float, Array | float]
"""How far figures are from their limits as the twin has them, and how much of that their tolerances take; in
their own unit, numbers or one per part."""
Falls = Callable[[Span, Array | float], Fall]
"""How far the margins of a criterion can fall within a span, given the least known at its ends."""


class Relative:
    """How quickly points of bodies can change their velocity as seen from other bodies.

    Args:
        mj: The `mujoco.MjModel`.
        pairs: From which of its bodies, and of which.
        points: Of the latter, in its frame [m], shape (k, 3) each.
        reach: How far around them others are meant, too [m], shape (pairs,).
    """

    def __init__(
        self, mj: mujoco.MjModel, pairs: Iterable[tuple[int, int]], points: Iterable[Array], reach: Array
    ) -> None:
        data = mujoco.MjData(mj)
        mujoco.mj_kinematics(mj, data)
        start, joints, turns, lengths = [0], [], [], []
        for (a, b), own, around in zip(pairs, points, reach.tolist(), strict=True):
            back, forth = joints_of(mj, a), joints_of(mj, b)
            same = sum(1 for k, j in enumerate(back) if back[: k + 1] == forth[: k + 1])
            way = [*reversed(back[same:]), *forth[same:]]
            anchors = data.xanchor[way]
            if way:
                ends = own @ data.xmat[b].reshape(3, 3).T + data.xpos[b]
                far = float(np.linalg.norm(ends - anchors[-1], axis=1).max(initial=0.0)) + around
                lengths += [*np.linalg.norm(np.diff(anchors, axis=0), axis=1).tolist(), far]
            joints += [int(mj.jnt_dofadr[j]) for j in way]
            turns += [bool(mj.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE) for j in way]
            start.append(len(joints))
        self._chains = chains_by(start, joints, turns, lengths)

    def quick(self, span: Span) -> Array:
        """Largest acceleration [m/s²], shape (pairs,)."""
        bounds = np.array([span.qd, span.qdd, span.qdd, span.away])
        _, quick, _ = moved = np.empty((3, len(self._chains.start) - 1))
        point_bounds(bounds, span.T, self._chains, moved)
        return quick


def change_of_motion(
    model: Model,
    bodies: Iterable[int],
    dofs: Indices,
    points: Points,
    heaviest: Callable[[int], tuple[float, float]] = lambda _: (1.0, 0.0),
) -> Callable[[Span], tuple[float, float]]:
    r"""How much :math:`\sqrt{2E}` of all that has a mass can change within a span, and bend.

    It is a norm of their velocities, so it changes by no more than the norm of how much they change.

    Args:
        model: The compiled workstation.
        bodies: MuJoCo's.
        dofs: Whose rotors count.
        points: Of which the motion is bounded.
        heaviest: Of a body, by which factor its mass may be more, and how far its centre off [m].

    Returns:
        In √J, as `Fall` has it; infinity of who jumps.
    """
    mj = model.mj
    heavy = [b for b in dict.fromkeys(bodies) if mj.body_mass[b] > 0]
    more = np.array([heaviest(body) for body in heavy]).reshape(-1, 2)
    masses = more[:, 0] * mj.body_mass[heavy]
    # The mean square distance from the centre of mass is what its moments of inertia say.
    radii = np.sqrt(mj.body_inertia[heavy].sum(axis=1) / 2 / mj.body_mass[heavy]) + more[:, 1]
    rows = rows_of(
        points.add(body, mj.body_ipos[body], radius) for body, radius in zip(heavy, radii, strict=True)
    )
    rotors = mj.dof_armature[dofs]

    def change(span: Span) -> tuple[float, float]:
        if not (np.isfinite(span.quick[rows]).all() and np.isfinite(span.qdd[dofs]).all()):
            return np.inf, np.inf
        turned = rotors @ (span.qdd[dofs] * span.T) ** 2
        fall = np.sqrt(masses @ (span.quick[rows] * span.T) ** 2 + turned)
        return float(fall), float(np.sqrt(masses @ span.bend[rows] ** 2 + turned / 4))

    return change


def rows_of(points: Iterable[int]) -> Indices:
    """Points as a `Span` wants them."""
    return np.array(tuple(points), np.int64)


def down_to(least: Array | float, lowest: Array | float) -> Fall:
    """Return the fall of margins from ``least`` at the lesser end to no less than ``lowest`` in between."""
    return Fall(np.inf, np.maximum(np.asarray(least) - lowest, 0.0))


@dataclass(frozen=True, eq=False)
class Approaching:
    """Bounds the change of a distance between two sets of points by the ways of both."""

    first: Indices
    second: Indices

    def __call__(self, span: Span, _: Array | float) -> Fall:
        """How far it can fall within a span [m]."""
        return Fall(span.way(self.first) + span.way(self.second))


@dataclass(frozen=True, eq=False)
class Speeding:
    """Bounds the change of the speed of the fastest of some points."""

    rows: Indices

    def __call__(self, span: Span, _: Array | float) -> Fall:
        """How far it can rise within a span [m/s]."""
        faster = greatest(span.quick, self.rows) * span.T
        return Fall(faster + ROUNDING, greatest(span.bend, self.rows) + ROUNDING)


@dataclass(frozen=True, eq=False)
class Turning:
    """Bounds the change of singular values of a point's linear Jacobian, by the norm of its own change."""

    points: Points
    point: int
    """Index of the point, as `Points.add` returns it."""
    coupling: Coupling
    """Whose columns."""

    def __call__(self, span: Span, _: Array | float) -> Fall:
        """How far they can fall within a span [m/rad or 1]."""
        moved = self.points.column_changes(self.point, span, self.coupling)
        return Fall(math.sqrt(float(moved @ moved)) * span.T)


def approaching(a: Iterable[int], b: Iterable[int]) -> Approaching:
    """Bound the change of a distance between two sets of points by the ways of both."""
    return Approaching(rows_of(a), rows_of(b))


def speeding(points: Iterable[int]) -> Speeding:
    """Bound the change of the speed of the fastest of some points."""
    return Speeding(rows_of(points))


class AllFalls:
    """Bounds what `Approaching`, `Speeding` and `Turning` do, of many figures in one compiled call.

    Args:
        falls: Of every figure; others than those are left out.
    """

    def __init__(self, falls: Iterable[Falls | None]) -> None:
        every = [each for each in falls if isinstance(each, Approaching | Speeding | Turning)]
        own = [each for each in every if not isinstance(each, Turning)]
        self._turning = [each for each in every if isinstance(each, Turning)]
        self.bounds = (*own, *self._turning)
        """Those that are not left out."""
        sets = [
            rows
            for each in own
            for rows in (
                (each.first, each.second) if isinstance(each, Approaching) else (each.rows, each.rows[:0])
            )
        ]
        couplings = [each.coupling for each in self._turning]
        joints, columns = (max((each.shares.shape[k] for each in couplings), default=0) for k in (0, 1))
        self._figures = Figures(
            np.cumsum([0, *map(len, sets)]),
            np.concatenate([np.zeros(0, np.int64), *sets]),
            np.array([isinstance(each, Approaching) for each in own], bool),
            np.array([each.point for each in self._turning], np.int64),
            np.zeros((len(couplings), joints), bool),
            np.zeros((len(couplings), joints, columns)),
        )
        for moves, shares, each in zip(self._figures.moves, self._figures.shares, couplings, strict=True):
            moves[:], shares[:, : each.shares.shape[1]] = each
        self._table = FIGURES.rows(self._figures)
        self._found = np.empty((2, len(self.bounds)))

    def of(self, span: Span) -> dict[Falls, Fall]:
        """What each says of a span."""
        chains = self._turning[0].points.every_chain if self._turning else NO_CHAINS
        all_falls(self._table, chains, span.joints, span.moved, span.T, ROUNDING, self._found)
        falls, below = self._found.tolist()
        return dict(zip(self.bounds, map(_FALL, zip(falls, below, strict=True)), strict=True))
