r"""Whether a robot keeps a distance from everything on a straight way in joint space: proven, not sampled.

On a way :math:`\Delta q` every point of a body moves at most :math:`\sum_j |\Delta q_j| w_j`, with w the
farthest that any of its points ever is from the axis of joint j (`seerob.session.permissible.moving_joints`).
So a span whose middle has a distance d is clear where :math:`d - \tfrac12 \sum_j |\Delta q_j| w_j \ge`
margin; otherwise it is halved, down to spans on which nothing moves farther than a resolution: those count as
not clear. Distances are those of the twin's own shapes; what may be nearer by its note is taken off.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.figures import against
from seerob.core.transforms import Array, rotation_from_wxyz, transform
from seerob.distance.least import Per, Query
from seerob.kernels import ways
from seerob.kernels.pairs import BODY
from seerob.kernels.ways import Apart, Arm, Bound
from seerob.model.model import Mechanism, Model
from seerob.session.permissible.moving_joints import KinematicChain, chains_of

RESOLUTION = 1e-5
"""A span on which no point moves farther and that is not clear is given up [m]."""
SPACING = 0.01
"""No point moves farther between two postures that are looked at where nothing is proven yet [m]."""
OWN_MARGIN = 0.002
"""Of the robot's own bodies from each other, whatever the margin to others is [m]."""
WATCHED = ("robot", "tool", "workpiece", "part", "machine", "human")
"""Roles of bodies that are kept away from; areas are looked through unless they are named."""


@dataclass(frozen=True)
class Nearest:
    """How near the robot is to anything."""

    distance: float
    """[m], with the deviation of the shapes taken off."""
    what: str
    """``ur10/forearm_link ↔ table``."""


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Distances of one sort and how fast they can change."""

    query: Query
    weight: Array
    """Largest change of each distance per joint [m/rad or 1], shape (rows, n)."""
    deviation: float
    own: bool
    """Whether they are between the robot's own bodies."""

    def need(self, margin: float) -> float:
        """Distance that is enough, given the margin to others [m]."""
        return OWN_MARGIN if self.own else margin

    @property
    def count(self) -> int:
        """Pairs of bodies."""
        return len(self.query.a) * len(self.query.b)


class Clearance:
    """A robot among everything else, which stands still.

    Args:
        model: The compiled workstation; everybody else is where the file puts them.
        robot: Who moves.
        start: Joint positions at which parts of the robot that touch each other are told [rad or m], (n,).
        keep_out: Areas that are kept away from like everything else.
        places: Joint positions of others, by name [rad or m], (n,) each, instead of those of the file.
        swept: Names of others that are looked through: an area of ``keep_out`` is in their place.
        off: How far others may be from where they are taken to be [m].

    Raises:
        UnknownName: No such area.
        InputError: Others of whom nobody said where they are, an area that moves, or nothing to keep away
            from.
    """

    def __init__(
        self,
        model: Model,
        robot: Mechanism,
        start: Array,
        *,
        keep_out: Sequence[str] = (),
        places: Mapping[str, Array] | None = None,
        swept: Collection[str] = (),
        off: float = 0.0,
    ) -> None:
        self._model, self.robot, self._off = model, robot, off
        self._data = mujoco.MjData(model.mj)
        self._ids = np.array([body.mj for body in model.bodies])
        places = places or {}
        there = [m for m in model.mechanisms.values() if m.name != robot.name and m.name not in swept]
        problems = [
            Problem("workstation", other.name, why, "a way is clear only of what has a shape")
            for other in (robot, *there)
            if (why := model.unshaped((other.name,)))
        ]
        problems += [
            Problem("workstation", other.name, "nobody says where it stands", "give its q in the file")
            for other in there
            if other.name not in places and not other.home_given
        ]
        areas = tuple(_areas(model, keep_out, robot.name, swept, problems))
        if problems:
            raise InputError(problems)
        for other in model.mechanisms.values():
            at = places.get(other.name, other.home)
            self._data.qpos[other.q_address] = other.coupling @ at + other.offset
        reach = np.zeros(model.mj.nv)
        span = np.where(np.isfinite(robot.upper - robot.lower), robot.upper - robot.lower, 0.0)
        reach[robot.v_address] = np.abs(robot.coupling) @ span
        self._mine = tuple(robot.moving)
        self._chains = dict(zip(self._mine, chains_of(model, self._mine, reach), strict=True))
        own = {*robot.bodies, *robot.carried}
        others = tuple(
            b.index
            for b in model.bodies
            if b.index not in own and b.role in WATCHED and b.carrier not in swept
        )
        self._pairs: list[_Pairs] = []
        if (others or areas) and self._mine:
            self._pairs.append(self._against((*others, *areas)))
        self.left_out: tuple[str, ...] = ()
        """Pairs of the robot's own bodies that touch or overlap at the start and are not watched."""
        self._pairs += self._itself(own, start)
        if not self._pairs and not swept:
            raise InputError.at("workstation", robot.name, "there is nothing to keep away from")
        # Of each pair of bodies the row of the weights: those of a body of the robot with all others are one.
        weights = np.concatenate(
            [
                np.zeros((0, len(robot.joints))),
                *(p.weight if p.own else np.tile(p.weight, (len(p.query.a), 1)) for p in self._pairs),
            ]
        )
        found = [pairs.query.members(Per.WHETHER) for pairs in self._pairs]
        counts = [len(m.rows) for m in found]
        each = np.concatenate([np.zeros(0, np.int64), *(np.diff(m.start) for m in found)])
        row = np.repeat(np.arange(len(weights)), each)
        own_rows = np.repeat(np.array([p.own for p in self._pairs], bool), counts)
        self._own: NDArray[np.bool_] = own_rows
        self._deviations = np.repeat(np.array([p.deviation for p in self._pairs], float), counts)
        pair = np.concatenate([np.zeros((0, 2), np.int64), *(m.rows[:, :2] for m in found)])
        self.apart = Apart(pair, np.ascontiguousarray(weights[row]))
        """Pairs of solids, and how fast the robot changes their distances."""
        self._bound = self._bind(self.apart, start)
        self.table = self._bound.table
        """What `seerob.kernels.ways` is given."""

    @property
    def asked(self) -> int:
        """Postures that were looked at."""
        return int(self._bound.room.counts[0])

    def nearest(self, q: Array, *, own: bool = False) -> Nearest | None:
        """Where the robot is nearest to others, or to itself, at joint positions (n,); None without any."""
        found = []
        for pairs in self._pairs:
            if pairs.own is own:
                closest = pairs.query.minimum(*self._poses(q))
                first, second = (self._model.bodies[i].name for i in (closest.body_a, closest.body_b))
                found.append(Nearest(closest.distance - pairs.deviation, f"{second} ↔ {first}"))
        return min(found, key=lambda near: near.distance, default=None)

    def place_others(self, qpos: Array) -> None:
        """Put everybody else where MuJoCo's positions have them, for `nearest`."""
        self._data.qpos[:] = qpos

    def fault(self, q: Array, margin: float) -> str:
        """Why a posture is not clear; empty when it is."""
        for own, least in ((False, margin), (True, OWN_MARGIN)):
            near = self.nearest(q, own=own)
            if near is not None and near.distance < least:
                shown = against(near.distance, least, "m", at_most=False)
                return f"{shown.value} m at {near.what}, less than {shown.limit} m"
        return ""

    def clear(self, a: Array, b: Array, margin: float) -> bool:
        """Whether every posture of the straight way from ``a`` to ``b`` keeps a margin [m]; proven.

        Args:
            a: Joint positions, shape (n,).
            b: Likewise.
            margin: [m], 0 or more.
        """
        return bool(ways.is_clear(a, b, self.needs(margin), RESOLUTION, True, self.table))

    def sampled(self, a: Array, b: Array, margin: float) -> bool:
        """Whether postures of the straight way from ``a`` to ``b``, `SPACING` apart, keep a margin [m].

        No proof: what is between them is not looked at.
        """
        return bool(ways.is_clear(a, b, self.needs(margin), SPACING, False, self.table))

    def is_clear(self, q: Array, margin: float) -> bool:
        """Whether a posture (n,) keeps a margin [m]."""
        return not ways.too_near(np.asarray(q, float), self.needs(margin), self.table)

    def needs(self, margin: float) -> Array:
        """Of each pair of solids the distance that is enough, given the margin to others [m]."""
        needs: Array = np.where(self._own, OWN_MARGIN, margin) + self._deviations
        return needs

    def least(self, *path: Array, tolerance: float = 5e-3) -> float:
        """A bound from below on the distance to others on the straight ways between postures.

        Args:
            path: Joint positions, shape (n,) each.
            tolerance: By how much it may be too small [m].

        Returns:
            [m]; infinite without others.
        """
        if self._pairs[0].own:
            return np.inf
        deviation = np.where(self._own, np.inf, self._deviations)
        return float(ways.least_on(np.array(path, float), deviation, tolerance, self.table))

    def _poses(self, q: Array) -> tuple[Array, Array]:
        robot, data = self.robot, self._data
        data.qpos[robot.q_address] = robot.coupling @ q + robot.offset
        mujoco.mj_kinematics(self._model.mj, data)
        return data.xmat[self._ids].reshape(-1, 3, 3), data.xpos[self._ids]

    def _bind(self, apart: Apart, start: Array) -> Bound:
        """All as arrays, everybody else where they stand."""
        mj, bodies, robot = self._model.mj, self._model.bodies, self.robot
        rotations, positions = self._poses(start)
        solids = self._model.shapes.arrays()
        links: dict[int, tuple[int, Array]] = {}
        fixed, parents, joints = [], list[int](), list[int]()
        roots = {int(mj.body_rootid[bodies[i].mj]) for i in self._mine}
        for body in np.flatnonzero(np.isin(mj.body_rootid, list(roots))).tolist():
            link, parent = links.get(int(mj.body_parentid[body]), (0, np.eye(4)))
            within = parent @ transform(rotation_from_wxyz(mj.body_quat[body]), mj.body_pos[body])
            first = int(mj.body_jntadr[body])
            for joint in range(first, first + int(mj.body_jntnum[body])):
                parents.append(link)
                fixed.append(within[:3])
                joints.append(joint)
                link, within = len(joints), np.eye(4)
            links[body] = link, within
        at = mj.jnt_qposadr[joints]
        base = self._data.qpos[at] - mj.qpos0[at]
        coupling = np.zeros((len(joints), len(robot.joints)))
        where = {int(address): k for k, address in enumerate(at)}
        for address, share, shift in zip(robot.q_address.tolist(), robot.coupling, robot.offset, strict=True):
            if address in where:
                base[where[address]] = shift - mj.qpos0[address]
                coupling[where[address]] = share
        mine = np.array(self._mine, np.int64)
        own = [links[bodies[i].mj] for i in self._mine]
        j, used = len(joints), np.unique(apart.pair)
        arm = Arm(
            base, coupling, np.array(parents, np.int64), mj.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE,
            np.array(fixed).reshape(j, 3, 4), mj.jnt_axis[joints].reshape(j, 3),
            mj.jnt_pos[joints].reshape(j, 3), np.array([link for link, _ in own], np.int64),
            np.array([within[:3] for _, within in own]).reshape(-1, 3, 4), mine,
            used[np.isin(solids.which[used, BODY], mine)],
        )  # fmt: skip
        return Bound(solids, arm, apart, rotations, positions)

    def _against(self, others: tuple[int, ...]) -> _Pairs:
        model = self._model.closed or self._model  # what may be closed, nobody may reach into
        query = Query(model.shapes, others, self._mine)
        weight = np.array([self._weight(self._chains[i], frozenset()) for i in self._mine])
        return _Pairs(query, weight, self._deviation(others, self._mine) + self._off, own=False)

    def _itself(self, own: Iterable[int], start: Array) -> list[_Pairs]:
        """Pairs of bodies of the robot with at least two joints between them."""
        bodies = self._model.bodies
        dofs = {
            i: frozenset(self._chains[i].dofs.tolist()) if i in self._chains else frozenset() for i in own
        }
        found, touching = [], []
        for second in self._mine:
            firsts = tuple(
                i for i in sorted(own) if dofs[i] < dofs[second] and len(dofs[second] - dofs[i]) >= 2
            )
            if not firsts:
                continue
            query = Query(self._model.shapes, firsts, (second,))
            near = query.per_pair(*self._poses(start)).distance <= 0
            touching += [
                f"{bodies[i].name} ↔ {bodies[second].name}"
                for i, hit in zip(firsts, near, strict=True)
                if hit
            ]
            firsts = tuple(i for i, hit in zip(firsts, near, strict=True) if not hit)
            if not firsts:
                continue
            # Of two bodies of one chain only the joints between them change the distance.
            weight = np.array([self._weight(self._chains[second], dofs[i]) for i in firsts])
            query = Query(self._model.shapes, firsts, (second,))
            deviation = self._deviation(firsts, (second,))
            found.append(_Pairs(query, weight, deviation, own=True))
        self.left_out = tuple(touching)
        return found

    def _weight(self, chain: KinematicChain, without: frozenset[int]) -> Array:
        """Of one body, per commanded joint of the robot, shape (n,)."""
        each = np.zeros(self._model.mj.nv)
        for dof, w in zip(chain.dofs.tolist(), chain.weight.tolist(), strict=True):
            each[dof] = 0.0 if dof in without else w
        return np.asarray(each[self.robot.v_address] @ np.abs(self.robot.coupling))

    def _deviation(self, a: Iterable[int], b: Iterable[int]) -> float:
        bodies = self._model.bodies
        return sum(max((bodies[i].deviation for i in side), default=0.0) for side in (a, b))


def _areas(
    model: Model, names: Sequence[str], robot: str, swept: Collection[str], problems: list[Problem]
) -> Iterator[int]:
    """Indices of areas; those that cannot be kept away from are added to the problems."""
    known = {b.name: b for b in model.bodies if b.role == "area"}
    for name in dict.fromkeys(names):
        if name not in known:
            raise UnknownName("area", name, known)
        carrier = known[name].carrier
        if carrier == robot or carrier in swept:
            what = f"moves with {carrier}"
            problems.append(Problem("plan", f"area {name!r}", what, "keep out of areas that stand still"))
        yield known[name].index
