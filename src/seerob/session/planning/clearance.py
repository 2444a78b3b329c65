r"""Whether a robot keeps a distance from everything on a straight way in joint space: proven, not sampled.

On a way :math:`\Delta q` every point of a body moves at most :math:`\sum_j |\Delta q_j| w_j`, with w the
farthest that any of its points ever is from the axis of joint j (`seerob.session.permissible.moving_joints`).
So a span whose middle has a distance d is clear where :math:`d - \tfrac12 \sum_j |\Delta q_j| w_j \ge`
margin; otherwise it is halved, down to spans on which nothing moves farther than a resolution: those count as
not clear. Distances are those of the twin's own shapes; what may be nearer by its note is taken off.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np

from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.figures import against
from seerob.core.transforms import Array
from seerob.distance.least import DistanceKind, Per, Query, Survey
from seerob.model.model import Mechanism, Model
from seerob.session.permissible.moving_joints import KinematicChain, chains_of

RESOLUTION = 1e-3
"""A span on which no point moves farther and that is not clear is given up [m]."""
SPACING = 0.04
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
    ) -> None:
        self._model, self.robot = model, robot
        self._data = mujoco.MjData(model.mj)
        self._ids = np.array([body.mj for body in model.bodies])
        self.asked = 0
        """Postures that were looked at."""
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
        if not self._pairs:
            raise InputError.at("workstation", robot.name, "there is nothing to keep away from")
        asked = [(pairs.query, Per.PAIR if pairs.own else Per.BODY) for pairs in self._pairs]
        self._survey = Survey(model.shapes, asked)
        self._whether = Survey(model.shapes, [(pairs.query, Per.WHETHER) for pairs in self._pairs])
        # Of each pair of bodies the row of the weights: those of a body of the robot with all others are one.
        self._weights = np.concatenate(
            [p.weight if p.own else np.tile(p.weight, (len(p.query.a), 1)) for p in self._pairs]
        )
        self._deviations = np.concatenate([np.full(p.count, p.deviation) for p in self._pairs])
        self._own = np.concatenate([np.full(p.count, p.own) for p in self._pairs])

    def nearest(self, q: Array, *, own: bool = False) -> Nearest | None:
        """Where the robot is nearest to others, or to itself, at joint positions (n,); None without any."""
        found = []
        for pairs in self._pairs:
            if pairs.own is own:
                closest = pairs.query.minimum(*self._poses(q))
                first, second = (self._model.bodies[i].name for i in (closest.body_a, closest.body_b))
                found.append(Nearest(closest.distance - pairs.deviation, f"{second} ↔ {first}"))
        return min(found, key=lambda near: near.distance, default=None)

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
        moved = self._weights @ np.abs(b - a)
        need = self._needs(margin)
        longest = float(moved.max(initial=0.0))
        spans = deque([(0.0, 1.0)])
        while spans:
            low, high = spans.popleft()  # what is not clear is met the sooner
            half = (high - low) / 2
            poses = self._poses(a + (low + half) * (b - a))
            if not self._is_nearer(poses, need + moved * half):
                continue
            if self._is_nearer(poses, need) or longest * half < RESOLUTION / 2:
                return False
            spans += [(low, low + half), (low + half, high)]
        return True

    def sampled(self, a: Array, b: Array, margin: float) -> bool:
        """Whether postures of the straight way from ``a`` to ``b``, `SPACING` apart, keep a margin [m].

        No proof: what is between them is not looked at.
        """
        need = self._needs(margin)
        longest = float((self._weights @ np.abs(b - a)).max(initial=0.0))
        steps = max(1, int(np.ceil(longest / SPACING)))
        waiting = _middle_first(steps)  # what is not clear is met the sooner
        asked = 4
        while waiting:
            poses = [self._poses(a + k / steps * (b - a)) for k in waiting[:asked]]
            R, x = (np.array([pose[i] for pose in poses]) for i in (0, 1))
            if self._is_nearer((R, x), need):
                return False
            waiting, asked = waiting[asked:], 2 * asked
        return True

    def is_clear(self, q: Array, margin: float) -> bool:
        """Whether a posture (n,) keeps a margin [m]."""
        return not self._is_nearer(self._poses(q), self._needs(margin))

    def _needs(self, margin: float) -> Array:
        """Of each pair of bodies the distance between its shapes that is enough [m]."""
        needs: Array = np.where(self._own, OWN_MARGIN, margin) + self._deviations
        return needs

    def _is_nearer(self, poses: tuple[Array, Array], caps: Array) -> bool:
        """Whether any pair of bodies is nearer than its cap [m], in any of the postures."""
        self.asked += len(poses[0]) if poses[0].ndim > 3 else 1
        found = self._whether.within(*poses, caps)
        return bool((found.kind != DistanceKind.BEYOND_CAP).any())

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
        met = min(float(self._distances(q)[0].min()) for q in path)
        for a, b in pairwise(path):
            moved = self._weights @ np.abs(b - a)
            spans = [(0.0, 1.0)]
            while spans:
                low, high = spans.pop()
                half = (high - low) / 2
                middle = a + (low + half) * (b - a)
                enough = np.where(self._own, -np.inf, met - tolerance + moved * half + self._deviations)
                if self._is_nearer(self._poses(middle), enough):
                    met = min(met, float(self._distances(middle)[0].min()))
                    spans += [(low, low + half), (low + half, high)]
        return met - tolerance * (len(path) > 1)

    def _poses(self, q: Array) -> tuple[Array, Array]:
        robot, data = self.robot, self._data
        data.qpos[robot.q_address] = robot.coupling @ q + robot.offset
        mujoco.mj_kinematics(self._model.mj, data)
        return data.xmat[self._ids].reshape(-1, 3, 3), data.xpos[self._ids]

    def _distances(self, q: Array) -> list[Array]:
        self.asked += 1
        answers = self._survey.ask(*self._poses(q))
        return [answer.distance - p.deviation for answer, p in zip(answers, self._pairs, strict=True)]

    def _against(self, others: tuple[int, ...]) -> _Pairs:
        query = Query(self._model.shapes, others, self._mine)
        weight = np.array([self._weight(self._chains[i], frozenset()) for i in self._mine])
        return _Pairs(query, weight, self._deviation(others, self._mine), own=False)

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


def _middle_first(steps: int) -> list[int]:
    """0 … steps, each half of what is left after the one before."""
    found, spans = [0, steps], deque([(0, steps)])
    while spans:
        low, high = spans.popleft()
        if high - low > 1:
            middle = (low + high) // 2
            found.append(middle)
            spans += [(low, middle), (middle, high)]
    return found


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
