r"""Where a part of a person could be clamped: in a gap no wider than the body part, of parts that move.

A gap :math:`g` between a moving part of a robot and another surface clamps a body part of the
thickness :math:`D` where it is no wider than it while its sides move against each other:

.. math:: |v| > 0, \qquad g \le D

What gets narrow between two ticks is found there (`seerob.criteria.between_ticks`): how often it is asked
makes no gap clamp. Whether the *least* distance closes does not count: a nearer surface at a
constant distance, or a part that tilts, hides another place where the gap closes. A part that moves past a
surface or away from it counts as well: the rule errs on the side of clamping, and one more surface never
permits more. Nothing is remembered: the answer at an instant follows from the poses and speeds then.

Between the robot's own parts nothing gets where they are always near. Which body parts do is settled once,
from the shapes and the ranges of the joints:

- of two parts that several joints move against each other (a tool and the upper arm), a body part gets
  between where, in some position of these joints, any place on the one is as far from the other as the
  thinnest of the body part is thick. How near they are as wholes says nothing of that: two links behind a
  double elbow are near there however wide they gape. What gets in clamps as it does at any other surface;
- of two parts that one joint moves against each other (an elbow, two fingers), every place is looked at by
  itself; see `seerob.criteria.contact.joint_gaps`;
- between parts one of which slides without ends, or follows a turn without ends by a share of it, and
  between what a gripper picks up and whatever moves against it, everything gets.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes import Solid
from seerob.core.transforms import Array
from seerob.distance.least import Per, Query
from seerob.kernels.shapes import Shapes
from seerob.model.model import Mechanism, Model

Flags = NDArray[np.bool_]
Coordinate = tuple[str, int]
"""A commanded joint: mechanism and column."""

STILL = 1e-6
"""Parts that move more slowly against each other stay as they are [m/s]: rounding, and nothing else. What
moves slowly clamps as what is fast does; noise of speeds is for `seerob.criteria.noisy_speeds`."""
SAMPLED = 64
"""Positions of several joints in which it is looked how wide two parts open."""
TOGETHER = 4
"""Of these that are looked at together: mostly the first tell enough."""
MISSED = 0.1
"""By which share they may open wider in a position in between."""
JUNG = (3 / 8) ** 0.5
"""Radius of a ball around points whose distances are 1 at most."""
ENDLESS = 1.0
"""How far to either side a slide without ends is looked at [m]."""


def clamps(gaps: Array, speed: Array, thickness: Array) -> Flags:
    """Which gaps clamp which body parts.

    Args:
        gaps: Distances of pairs of surfaces [m], shape (..., g).
        speed: Of one side seen from the other [m/s], shape (..., g).
        thickness: Of body parts in each gap [m], -infinity of one that does not get in, shape (g, r).

    Returns:
        Shape (..., g, r).
    """
    # What is not a number clamps: nobody knows that it does not.
    return np.asarray(~(speed <= STILL)[..., None] & ~(np.asarray(gaps, float)[..., None] > thickness))


def getting_in(opens: Array, fits: Array, thickness: Array) -> Array:
    """Thickness of body parts in gaps that let them in [m], shape (g, r), else -infinity.

    Args:
        opens: How wide a gap gets anywhere [m], shape (g,).
        fits: Thinnest that a body part is [m], shape (r,).
        thickness: Of body parts [m], shape (r,).
    """
    return np.where(opens[:, None] * (1 + MISSED) >= fits, thickness, -np.inf)


@dataclass(frozen=True, eq=False)
class PinchPairs:
    """The gaps in which the moving parts of a robot could clamp somebody, bound once."""

    moving: tuple[int, ...]
    """Bodies of the robot that its joints move."""
    queries: tuple[tuple[Query, Per], ...]
    first: NDArray[np.int64]
    """Row in ``moving`` of each gap, shape (g,)."""
    second: NDArray[np.int64]
    """Row in ``moving`` of the other side, -1 when it does not move or is a surface, shape (g,)."""
    across: NDArray[np.int64]
    """Body of the other side, -1 of the gaps to any of the surfaces that stand, shape (g,)."""
    inner: Flags
    """Whether it is between two parts of the robot, shape (g,)."""

    def gaps(self, rotations: Array, positions: Array) -> tuple[Array, NDArray[np.int64]]:
        """Gaps [m] and the body on the other side (-1 beyond the cap), shape (g,).

        Args:
            rotations: world_from_body of every body, shape (n, 3, 3).
            positions: Likewise [m], shape (n, 3).
        """
        distances, others = [np.zeros(0)], [np.zeros(0, np.int64)]
        for query, per in self.queries:
            found = query.ask(rotations, positions, per)
            distances.append(found.distance)
            others.append(found.body_a)
        return np.concatenate(distances), np.concatenate(others)

    def batch(self, rotations: Array, positions: Array) -> Array:
        """Gaps of many samples [m], shape (N, g). Poses as of `Query.batch`."""
        found = [query.batch(rotations, positions, per).distance for query, per in self.queries]
        return np.concatenate([np.zeros((len(rotations), 0)), *found], axis=1)

    def fastest(self, clamped: Flags, speed: Array) -> Array:
        """Of gaps (g, r) and their speeds (g,) the largest that a moving body clamps at, 0: none, (b, r)."""
        found = np.zeros((len(self.moving), clamped.shape[1]))
        for side in (self.first, self.second):
            for gap in np.flatnonzero((side >= 0) & (self.across >= 0) & clamped.any(axis=1)):
                found[side[gap]] = np.maximum(found[side[gap]], np.where(clamped[gap], speed[gap], 0.0))
        return found

    def per_body(self, clamped: Flags) -> Flags:
        """Which moving bodies clamp, shape (..., b, r), given which gaps do, shape (..., g, r)."""
        found = np.zeros((*clamped.shape[:-2], len(self.moving), clamped.shape[-1]), bool)
        some = clamped.any(axis=(*range(clamped.ndim - 2), -1))
        for side in (self.first, self.second):
            for gap in np.flatnonzero((side >= 0) & some):
                found[..., side[gap], :] |= clamped[..., gap, :]
        return found


def pinch_pairs(
    shapes: Shapes,
    moving: Sequence[int],
    surfaces: Sequence[int],
    excluded: frozenset[tuple[int, int]],
    *,
    others: Sequence[int] = (),
    still: Sequence[int] = (),
    cap: float,
) -> PinchPairs:
    """Bind the gaps of a robot.

    Args:
        shapes: Of the model.
        moving: Bodies that the robot's joints move.
        surfaces: Bodies around that stand.
        others: Bodies of other robots and of machines, which move.
        excluded: Pairs of the robot's own bodies that are one, or that are judged place by place.
        still: The robot's own bodies that its joints do not move.
        cap: Largest gap that matters [m].
    """
    queries: list[tuple[Query, Per]] = []
    first: list[int] = []
    second: list[int] = []
    across: list[int] = []
    if moving and surfaces:
        queries.append((Query(shapes, surfaces, moving, cap=cap), Per.BODY))
        first += range(len(moving))
        second += [-1] * len(moving)
        across += [-1] * len(moving)
    if moving and others:
        queries.append((Query(shapes, others, moving, cap=cap), Per.PAIR))
        first += [*range(len(moving))] * len(others)
        second += [-1] * (len(moving) * len(others))
        across += [other for other in dict.fromkeys(others) for _ in moving]
    outside = len(first)
    own = [*moving, *still]
    for row, body in enumerate(moving):
        others = [
            k
            for k in range(row + 1, len(own))
            if (body, own[k]) not in excluded and (own[k], body) not in excluded
        ]
        if others:
            queries.append((Query(shapes, [own[k] for k in others], [body], cap=cap), Per.PAIR))
            first += [row] * len(others)
            second += [k if k < len(moving) else -1 for k in others]
            across += [own[k] for k in others]
    return PinchPairs(
        tuple(moving), tuple(queries), np.array(first, np.int64), np.array(second, np.int64),
        np.array(across, np.int64), np.arange(len(first)) >= outside,
    )  # fmt: skip


class RelativeJoints:
    """Which commanded joints move two bodies of a robot against each other, and poses by where they stand.

    Args:
        model: The compiled workstation.
    """

    def __init__(self, model: Model) -> None:
        self._model, self._data = model, mujoco.MjData(model.mj)
        self._bodies = [body.mj for body in model.bodies]
        self._of_joint: dict[int, set[Coordinate]] = {}
        for name, m in model.mechanisms.items():
            for row, dof in enumerate(m.v_address.tolist()):
                columns = np.flatnonzero(m.coupling[row]).tolist()
                self._of_joint.setdefault(dof, set()).update((name, column) for column in columns)

    def between(self, a: int, b: int) -> frozenset[Coordinate]:
        """Commanded joints between two bodies; empty when they are one."""
        mj = self._model.mj
        ways = []
        for body in (a, b):
            at, dofs = int(self._bodies[body]), set()
            while at:
                start, count = int(mj.body_dofadr[at]), int(mj.body_dofnum[at])
                dofs |= set(range(start, start + count)) if count else set()
                at = int(mj.body_parentid[at])
            ways.append(dofs)
        found = (self._of_joint.get(dof, set()) for dof in ways[0] ^ ways[1])
        return frozenset(coordinate for each in found for coordinate in each)

    def in_order(self, coordinates: Iterable[Coordinate]) -> list[Coordinate]:
        """From the ground outward, whatever the robot and its machines are called."""
        mj = self._model.mj

        def depth(coordinate: Coordinate) -> tuple[int, int]:
            name, column = coordinate
            m = self._model.mechanisms[name]
            at, above = int(mj.dof_bodyid[m.v_address[m.own[column]]]), 0
            while at:
                at, above = int(mj.body_parentid[at]), above + 1
            return above, column

        return sorted(coordinates, key=depth)

    def range(self, coordinate: Coordinate) -> tuple[float, float]:
        """Ends of a joint [rad or m]; a turn that lacks one goes round once, a slide some way."""
        name, column = coordinate
        m = self._model.mechanisms[name]
        low, high, home = float(m.lower[column]), float(m.upper[column]), float(m.home[column])
        below, above = np.isfinite([low, high]).tolist()
        if m.joints[column].kind == "revolute" and not (below and above):
            low = low if below else high - 2 * np.pi if above else home - np.pi
            return low, low + 2 * np.pi
        low = low if below else home - ENDLESS
        return low, high if above else max(home + ENDLESS, low)

    def endless(self, coordinate: Coordinate) -> bool:
        """Whether no range of it says what gets between two parts: a slide without ends, or a turn without.

        Of a turn once round is all, unless another joint goes with it by a share of a turn.
        """
        name, column = coordinate
        m = self._model.mechanisms[name]
        if np.isfinite([m.lower[column], m.upper[column]]).all():
            return False
        whole = m.coupling[:, column]
        return m.joints[column].kind != "revolute" or not bool((whole == np.round(whole)).all())

    def poses(self, positions: Mapping[Coordinate, Array]) -> tuple[Array, Array]:
        """Poses of all bodies with some joints there and all others at home.

        Args:
            positions: Of each joint [rad or m], shape (N,) each.

        Returns:
            world_from_body, shapes (N, n, 3, 3) and (N, n, 3) [m].
        """
        count = len(next(iter(positions.values())))
        rotations, places = [], []
        for k in range(count):
            for name, m in self._model.mechanisms.items():
                q = m.home.copy()
                for (who, column), values in positions.items():
                    if who == name:
                        q[column] = values[k]
                self._data.qpos[m.q_address] = m.coupling @ q + m.offset
            mujoco.mj_kinematics(self._model.mj, self._data)
            rotations.append(self._data.xmat[self._bodies].reshape(-1, 3, 3).copy())
            places.append(self._data.xpos[self._bodies].copy())
        return np.array(rotations), np.array(places)


def robot_pinch_pairs(
    model: Model, robot: Mechanism, *, cap: float, enough: float
) -> tuple[PinchPairs, Array, list[tuple[int, int, Coordinate]]]:
    """The gaps of a robot to parts and other robots, and between its own parts.

    Args:
        model: The compiled workstation.
        robot: The robot.
        cap: Largest gap that matters [m].
        enough: How wide everything gets in [m]: more is not looked for.

    Returns:
        Its gaps; how wide they open anywhere [m], infinity of surfaces and where everything gets in, shape
        (g,); and pairs of its own bodies to look at place by place, with the joint between them.
    """
    own = (*robot.bodies, *robot.carried)
    still = [i for i in own if i not in robot.moving]
    around = [b for b in model.bodies if b.role not in ("human", "area") and b.index not in own]
    surfaces = [b.index for b in around if not b.mover]
    others = [b.index for b in around if b.mover]
    joints = RelativeJoints(model)
    between = {(i, j): joints.between(i, j) for i in own for j in own if i < j}
    # Without ends anything may get between, and what is picked up lies in the hand as it was taken: who is
    # near clamps.
    loose = {i for i in own if model.bodies[i].holder}
    always = {
        pair for pair, of in between.items() if any(map(joints.endless, of)) or (of and loose & {*pair})
    }
    one = ((pair, next(iter(of))) for pair, of in between.items() if len(of) == 1 and pair not in always)
    placed = [(*pair, coordinate) for pair, coordinate in one]
    excluded = frozenset(pair for pair, of in between.items() if len(of) < 2 and pair not in always)
    pairs = pinch_pairs(model.shapes, robot.moving, surfaces, excluded, others=others, still=still, cap=cap)
    opens = np.full(len(pairs.first), np.inf)
    poses: list[tuple[Array, Array]] = []
    distances = cache(lambda body: distances_from(model.bodies[body].solids))
    for gap in np.flatnonzero(pairs.inner).tolist():
        i, j = pairs.moving[pairs.first[gap]], int(pairs.across[gap])
        if (min(i, j), max(i, j)) in always:
            continue
        ways = (_Way(model, i, j, distances), _Way(model, j, i, distances))
        opens[gap] = max(way.least for way in ways)
        if opens[gap] < enough and not poses:
            poses = _some_poses(joints, set().union(*between.values()))
        for some, way in product(poses, ways):
            if opens[gap] >= enough:
                break
            opens[gap] = max(opens[gap], way.at(*some))
    return pairs, opens, placed


def _some_poses(joints: RelativeJoints, coordinates: Iterable[Coordinate]) -> list[tuple[Array, Array]]:
    """Poses of all bodies while some joints stand anywhere, a few at a time; see `RelativeJoints.poses`."""
    every = joints.in_order(coordinates)
    low, high = np.array([joints.range(coordinate) for coordinate in every]).T
    at = low + np.random.default_rng(0).random((SAMPLED, len(every))) * (high - low)
    return [joints.poses(dict(zip(every, some.T, strict=True))) for some in np.split(at, SAMPLED // TOGETHER)]


Distances = Callable[[Array], tuple[Array, Array]]
"""How far points (k, 3) in a body's frame are from it, shape (k,), and where it is nearest, (k, 3) [m]."""


def distances_from(solids: Sequence[Solid]) -> Distances:
    """What tells the distances of points from a body."""
    shapes = Shapes.build([("body", solids), ("point", [Solid(points=np.zeros((2, 3)))])])
    query = Query(shapes, [0], [1])

    def distances(points: Array) -> tuple[Array, Array]:
        positions = np.zeros((len(points), 2, 3))
        positions[:, 1] = points
        found = query.batch(np.broadcast_to(np.eye(3), (len(points), 2, 3, 3)), positions)
        return found.distance[:, 0], found.point_a[:, 0]

    return distances


class _Way:
    """How far any place of a body gets from another one, at most [m]."""

    def __init__(self, model: Model, one: int, other: int, distances: Callable[[int], Distances]) -> None:
        body, self._one, self._other = model.bodies[one], one, other
        self._corners, self._distances = body.corners, distances
        self.least = JUNG * float(np.linalg.norm(np.ptp(body.corners, axis=0))) + body.radius
        """No point of a hull is farther from all of its corners than their ball is wide (Jung)."""

    def at(self, rotations: Array, positions: Array) -> float:
        """In some poses of all bodies, as of `RelativeJoints.poses`."""
        points = np.einsum("nij,kj->nki", rotations[:, self._one], self._corners)
        points += positions[:, self._one, None] - positions[:, self._other, None]
        points = np.einsum("nki,nij->nkj", points, rotations[:, self._other]).reshape(-1, 3)
        return self.least + float(self._distances(self._other)(points)[0].max())
