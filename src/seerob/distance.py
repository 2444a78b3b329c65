r"""Exact least distances and closest points between sets of bodies.

A `Shapes` is built once per model; a `Query` binds the two sets once and then answers for poses.

The distance of two solids is that of their cores less their radii. While cores are apart it is exact,
down to minus the sum of the radii. When cores intersect, or one lies wholly inside a mesh, the
overlap is *at least* as deep as the (never positive) value says, and `Reach.DEPTH_AT_LEAST` says so:
no library gives a meaningful depth of two concave meshes. The least over many pairs is the least of
these values, so a body inside a machine can never read as far from it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum, StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.errors import InputError, Problem, SimulationDiverged
from seerob.kernels import nearest as kernel
from seerob.kernels.pairs import MESH
from seerob.kernels.shapes import Indices, Shapes
from seerob.transforms import Array

__all__ = ["Closest", "Closests", "Per", "Query", "Reach", "Shapes"]


class Reach(IntEnum):
    """What a distance tells."""

    EXACT = kernel.EXACT
    """The distance, or the depth of the overlap of two dilations, to rounding."""
    DEPTH_AT_LEAST = kernel.DEPTH_AT_LEAST
    """Cores intersect or one is inside a mesh: the overlap is at least this deep."""
    BEYOND_CAP = kernel.BEYOND_CAP
    """Not nearer than the query's cap, which is the value; no points."""


class Per(StrEnum):
    """Of what a least distance is taken."""

    SETS = "sets"
    """All of a to all of b: one."""
    BODY = "body"
    """All of a to each body of b."""
    PAIR = "pair"
    """Each body of a to each body of b, a-major."""


@dataclass(frozen=True, eq=False)
class Closest:
    """Where two sets of bodies are nearest."""

    distance: float
    """[m]; negative when they overlap."""
    point_a: Array
    """On the surface of the solid of a, in the world [m], shape (3,); NaN beyond the cap.

    When a core is inside a mesh, the points span the stated depth; when cores intersect, they coincide.
    """
    point_b: Array
    body_a: int
    """Index in `Shapes.names`; -1 beyond the cap."""
    body_b: int
    reach: Reach


@dataclass(frozen=True, eq=False)
class Closests:
    """Many `Closest`, in arrays: shape (g,) for one set of poses, (N, g) for a batch."""

    distance: Array
    """[m]."""
    point_a: Array
    """[m], shape (..., 3)."""
    point_b: Array
    body_a: Indices
    body_b: Indices
    reach: NDArray[np.int8]
    """Values of `Reach`."""

    def at(self, *index: int) -> Closest:
        """One of them."""
        return Closest(
            float(self.distance[index]),
            self.point_a[index],
            self.point_b[index],
            int(self.body_a[index]),
            int(self.body_b[index]),
            Reach(int(self.reach[index])),
        )


class Query:
    """How near two sets of bodies are; bound once, asked at every tick.

    Answers are functions of the poses alone, bit for bit; what a query remembers of the last poses
    only saves time. Because of that memory one query must not be asked by two threads at once.
    """

    def __init__(
        self, shapes: Shapes, a: Iterable[int], b: Iterable[int], *, cap: float = float("inf")
    ) -> None:
        """Bind.

        Args:
            shapes: Of the whole model.
            a: Bodies of the first set, by index.
            b: Bodies of the second set, none of them in the first.
            cap: Distance above which it does not matter how far [m].

        Raises:
            InputError: A set that is empty, without solids, not in ``shapes`` or not disjoint from the
                other; a cap that is not a number.
        """
        self.shapes = shapes
        self.a, self.b = tuple(dict.fromkeys(map(int, a))), tuple(dict.fromkeys(map(int, b)))
        _check_sets(shapes, self.a, self.b, cap)
        self.cap = float(cap)
        rows, bodies, groups = [], [], []
        mesh = shapes.which[:, MESH]
        for ia, body_a in enumerate(self.a):
            for ib, body_b in enumerate(self.b):
                for i in shapes.solids[body_a]:
                    for j in shapes.solids[body_b]:
                        swap = (mesh[j], -j) > (mesh[i], -i)
                        rows.append((j, i, 1) if swap else (i, j, 0))
                        bodies.append((body_a, body_b))
                        groups.append((0, ib, ia * len(self.b) + ib))
        self._pair = np.array(rows, np.int64)
        self._bodies = np.array([*bodies, (-1, -1)], np.int64)  # The last row is pair -1.
        self._used = np.unique(self._pair[:, :2])
        counts = (1, len(self.b), len(self.a) * len(self.b))
        self._groups = {
            per: _Groups.of(np.array([g[k] for g in groups]), counts[k]) for k, per in enumerate(Per)
        }
        self._memory = self._forget()
        self._last = {per: np.full(counts[k], -1, np.int64) for k, per in enumerate(Per)}

    def minimum(self, rotations: ArrayLike, positions: ArrayLike) -> Closest:
        """Where the two sets are nearest.

        Args:
            rotations: world_from_body of every body of the shapes, shape (n, 3, 3).
            positions: Likewise [m], shape (n, 3).

        Raises:
            SimulationDiverged: A pose that is not finite.
        """
        return self._ask(rotations, positions, Per.SETS).at(0)

    def per_body(self, rotations: ArrayLike, positions: ArrayLike) -> Closests:
        """Where each body of b is nearest to all of a, in the order of ``b``; see `minimum`."""
        return self._ask(rotations, positions, Per.BODY)

    def per_pair(self, rotations: ArrayLike, positions: ArrayLike) -> Closests:
        """Where each body of a is nearest to each of b, shape (len(a)·len(b),), a-major; see `minimum`."""
        return self._ask(rotations, positions, Per.PAIR)

    def batch(self, rotations: ArrayLike, positions: ArrayLike, per: Per = Per.SETS) -> Closests:
        """Answers for many samples in one compiled call that holds no lock; safe in threads.

        Args:
            rotations: world_from_body of every body, shape (N, n, 3, 3); cheapest in the order of time.
            positions: Likewise [m], shape (N, n, 3).
            per: Of what the least is taken.

        Returns:
            Arrays of shape (N, g), g = 1, len(b) or len(a)·len(b).

        Raises:
            SimulationDiverged: A pose that is not finite.
        """
        last = np.full(len(self._last[per]), -1, np.int64)
        return self._run(rotations, positions, per, self._forget(), last)

    def _ask(self, rotations: ArrayLike, positions: ArrayLike, per: Per) -> Closests:
        many = self._run(
            np.asarray(rotations)[None], np.asarray(positions)[None], per, self._memory, self._last[per]
        )
        return Closests(
            many.distance[0], many.point_a[0], many.point_b[0], many.body_a[0], many.body_b[0], many.reach[0]
        )

    def _forget(self) -> tuple[Array, Array, Indices]:
        """Corners at the last call, bounds then, nearest triangles then: of a query never asked."""
        solids, pairs = len(self.shapes.which), len(self._pair)
        return (
            np.full((solids, 8, 3), np.inf),
            np.full(pairs, -np.inf),
            np.full((pairs, 2), -1, np.int64),
        )

    def _run(
        self,
        rotations: ArrayLike,
        positions: ArrayLike,
        per: Per,
        memory: tuple[Array, Array, Indices],
        last: Indices,
    ) -> Closests:
        s = self.shapes
        R = np.ascontiguousarray(rotations, float)
        x = np.ascontiguousarray(positions, float)
        n = len(s.names)
        if R.shape[1:] != (n, 3, 3) or x.shape != (len(R), n, 3):
            raise ValueError(f"poses of {n} bodies expected, not rotations {R.shape} and positions {x.shape}")
        groups = self._groups[per]
        shape = len(R), len(groups.start) - 1
        distance, points = np.empty(shape), np.full((*shape, 6), np.nan)
        winner, reach = np.empty(shape, np.int64), np.empty(shape, np.int8)
        bad, body = kernel.nearest(
            R, x, s.which, s.local, s.ball, s.corners, s.radius, s.nodes, s.links, s.triangles, s.probes,
            self._used, self._pair, groups.start, groups.members, self.cap,
            *memory, last, distance, points, winner, reach,
        )  # fmt: skip
        if bad >= 0:
            self._memory = self._forget()
            sample = f" of sample {bad}" if len(R) > 1 else ""
            raise SimulationDiverged(f"the pose of {s.names[body]!r}{sample} is not finite")
        bodies = self._bodies[winner]
        return Closests(distance, points[..., :3], points[..., 3:], bodies[..., 0], bodies[..., 1], reach)


@dataclass(frozen=True, eq=False)
class _Groups:
    start: Indices
    members: Indices

    @classmethod
    def of(cls, group: Indices, count: int) -> _Groups:
        """Pairs of each group, ascending; a group of bodies without solids is empty."""
        start = np.searchsorted(np.sort(group), np.arange(count + 1))
        return cls(start.astype(np.int64), np.argsort(group, kind="stable"))


def _check_sets(shapes: Shapes, a: tuple[int, ...], b: tuple[int, ...], cap: float) -> None:
    where = "distance query"
    n = len(shapes.names)
    problems = []
    for key, bodies in (("a", a), ("b", b)):
        wrong = [i for i in bodies if not 0 <= i < n]
        if wrong:
            problems.append(Problem(where, key, f"no body has index {wrong[0]}", f"0 to {n - 1} exist"))
        elif not any(shapes.solids[i] for i in bodies):
            what = "none of " + ", ".join(shapes.names[i] for i in bodies) if bodies else "an empty set"
            problems.append(Problem(where, key, f"{what} has a shape", "name bodies with shapes"))
    both = sorted(set(a) & set(b))
    if both and 0 <= both[0] < n:
        what = f"{shapes.names[both[0]]!r} is in both sets"
        problems.append(Problem(where, "b", what, "each body belongs to one of them"))
    if np.isnan(cap):
        problems.append(Problem(where, "cap", f"{cap} is not a distance", "metres, or infinity for none"))
    if problems:
        raise InputError(problems)
