"""The twin at many instants at once, and what follows from it: `seerob.twin.state.State` in arrays.

The accessors are those of `State` with a dimension of instants in front, and their figures are the same
to rounding. Who was not heard at an instant is in `States.invalid_reasons`: whoever asks depends on it, and
`States.asked` says on whom.

Their motion may be said by arrays instead of sources (`motion_of`).
"""

from __future__ import annotations

import threading
from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, cast

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core.errors import InputError, Problem, Undecided
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.distance.least import Closests, Per, Query, Survey
from seerob.kernels.axes import half_axes, mobility
from seerob.kernels.chain import along, carried_by, held_many, jacobians
from seerob.kernels.speed import by_coordinate, fastest_many, velocities_many
from seerob.model.model import Frame, Gap, Mechanism, Model
from seerob.recording.answers import Flags
from seerob.twin.attachments import Columns, moving_dofs, unknown_place
from seerob.twin.authors_view import OF_MANY, AuthorsView
from seerob.twin.spans import Path, Ways
from seerob.twin.trees import Followed, Tree
from seerob.twin.validity.hearing import BoneErrors, BonesHeard, Hearing

Reasons = NDArray[np.object_]
"""Why something is not known at each instant, empty where it is; shape (N,)."""


class Seen(NamedTuple):
    """What is known of somebody at an instant besides where they are."""

    once: bool
    """They were heard once, and that told no speed."""
    errors: BoneErrors
    said: Sequence[BonesHeard]

    @classmethod
    def of(cls, hearing: Hearing) -> Seen:
        """What a run knows now."""
        return cls(hearing.once, {**hearing.bones}, [*hearing.bones_heard])

    def tell(self, hearing: Hearing) -> None:
        """Let whoever is asked know it, too."""
        hearing.once, hearing.bones, hearing.bones_heard = self.once, {**self.errors}, [*self.said]


@dataclass(frozen=True, eq=False)
class Motion:
    """Where everybody is at many instants."""

    t: Array
    """[s], shape (N,)."""
    q: Array
    """MuJoCo's positions, shape (N, nq)."""
    v: Array
    """MuJoCo's velocities, shape (N, nv)."""
    invalid_reasons: Mapping[str, Reasons]
    """Why a robot or human may not be there, by name."""
    foreseen: bool = False
    """Whether one instant leads to the next: a motion, and not a collection of places."""
    ways: Sequence[Path] | None = None
    """From each instant to the next, N - 1 of them; None where the instants are no motion."""

    speed_errors: Mapping[str, Array] = field(default_factory=dict)
    """By name, see `seerob.twin.state.State.speed_error`, shape (N, n)."""
    of: Motion | None = None
    """The whole motion that it is a part of; None of a whole one."""
    begin: int = 0
    """Which of its instants is the first one here."""
    still: frozenset[str] = frozenset()
    """Robots whose speed nobody tells (`seerob.twin.validity.validity.Validity.moved`)."""
    unmoved: frozenset[str] = frozenset()
    """Robots, people and machines that neither a source nor an array moves: for how long, nobody says."""
    seen: Mapping[str, Sequence[Seen]] = field(default_factory=dict)
    """Of people whom devices see, and of who was heard once, what else is known of them at each instant: who
    depends on them is asked instant by instant."""
    coarse: Mapping[str, str] = field(default_factory=dict)
    """Of robots and people that are heard too coarsely for energies and forces, why."""
    implausible: tuple[Finding, ...] = ()
    """What was found of where devices saw people, at any instant."""
    unforeseen: frozenset[str] = frozenset()
    """Machines that are moved: what they do next nobody knows in a run either (`Engine.ahead`)."""

    def part(self, begin: int, end: int) -> Motion:
        """Some instants that follow one another."""
        return replace(
            self,
            t=self.t[begin:end],
            q=self.q[begin:end],
            v=self.v[begin:end],
            invalid_reasons={name: found[begin:end] for name, found in self.invalid_reasons.items()},
            ways=None if self.ways is None else self.ways[begin : end - 1],
            speed_errors={name: found[begin:end] for name, found in self.speed_errors.items()},
            seen={name: found[begin:end] for name, found in self.seen.items()},
            of=self if self.of is None else self.of,
            begin=self.begin + begin,
        )


class Questions:
    """Distances that are asked of many instants, so that from the second time on they are asked together.

    Shared by threads.
    """

    def __init__(self, model: Model) -> None:
        self._shapes = model.shapes
        self._lock = threading.Lock()
        self._survey: Survey | None = None

    def ask(
        self, question: tuple[Query, Per], rotations: Array, positions: Array
    ) -> dict[tuple[Query, Per], Closests]:
        """Answers to this question and to all that were ever asked."""
        with self._lock:
            known = () if self._survey is None else self._survey.questions
            if self._survey is None or question not in known:
                self._survey = Survey(self._shapes, [*known, question])
            survey = self._survey
        return dict(zip(survey.questions, survey.batch(rotations, positions), strict=True))


class Bench:
    """What is the same for all instants, and where one thread places the twin."""

    def __init__(self, model: Model, questions: Questions) -> None:
        self.model, self.questions = model, questions
        mj = self.mj = model.mj
        self.data = mujoco.MjData(mj)
        self.ids = np.array([body.mj for body in model.bodies], np.int64)
        self.roots = mj.body_rootid[self.ids].astype(np.int64)
        self._columns: dict[str, Columns] = {}
        self._trees: dict[int, Tree | None] = {}

    @cached_property
    def corners(self) -> tuple[Array, NDArray[np.int64]]:
        """Corners of all bodies, and where those of each start (`seerob.kernels.speed.by_coordinate`)."""
        return by_coordinate([body.corners for body in self.model.bodies])

    @cached_property
    def reach(self) -> Array:
        """How far each body lies outside these [m], shape (n,)."""
        return np.array([body.radius + body.deviation for body in self.model.bodies])

    def columns(self, mechanism: Mechanism) -> Columns:
        """Where the joints of a mechanism are."""
        if mechanism.name not in self._columns:
            self._columns[mechanism.name] = Columns.of(mechanism, self.mj)
        return self._columns[mechanism.name]

    def another(self) -> Bench:
        """Return a place of its own for another thread, which shares all that is the same."""
        found = copy(self)
        found.data = mujoco.MjData(self.mj)
        return found

    def tree(self, body: int) -> Tree | None:
        """The tree of one of MuJoCo's bodies; None where only MuJoCo follows it."""
        root = int(self.mj.body_rootid[body])
        if root not in self._trees:
            self._trees[root] = Tree.of(self.mj, root) if root else None
        return self._trees[root]

    def place(self, motion: Motion) -> States:
        """The twin at instants."""
        return States(self, motion)

    def moved(self, motion: Motion) -> dict[str, Array]:
        """What MuJoCo makes of positions and velocities, for all bodies, instants in front."""
        mj, data, n = self.mj, self.data, len(motion.t)
        moved = {
            name: np.empty((n, *getattr(data, name).shape))
            for name in ("xmat", "xpos", "cvel", "cdof", "subtree_com", "xanchor", "xaxis")
        }
        # Views that MuJoCo writes through.
        views = [(found, getattr(data, name)) for name, found in moved.items()]
        qpos, qvel = data.qpos, data.qvel
        for k in range(n):
            qpos[:], qvel[:] = motion.q[k], motion.v[k]
            mujoco.mj_kinematics(mj, data)
            mujoco.mj_comPos(mj, data)
            mujoco.mj_comVel(mj, data)
            for found, view in views:
                found[k] = view
        return moved

    def masses(self, motion: Motion, mechanism: Mechanism) -> Array:
        """Joint-space mass matrices as MuJoCo has them, shape (N, n, n)."""
        mj, data, columns = self.mj, self.data, self.columns(mechanism)
        M, found = data.M, np.empty((len(motion.t), len(mechanism.own), len(mechanism.own)))
        for k in range(len(found)):
            data.qpos[:] = motion.q[k]
            mujoco.mj_kinematics(mj, data)
            mujoco.mj_comPos(mj, data)
            mujoco.mj_makeM(mj, data)
            found[k] = columns.of_mass_matrix(M)
        return found


class States:
    """The twin at N instants."""

    many: ClassVar[bool] = True

    def __init__(self, bench: Bench, motion: Motion) -> None:
        self.model, self._motion, self.invalid_reasons = bench.model, motion, motion.invalid_reasons
        self.asked: set[str] = set()
        """Robots and humans that answers have depended on since the set was last cleared."""
        self.speeds_asked: set[str] = set()
        """Those of which speeds were asked since it was last cleared."""
        self.alone = np.zeros(len(motion.t), bool)
        """Instants that whoever was asked last leaves to be asked one by one, shape (N,)."""
        self._bench = bench
        self._cache: dict[str | tuple[Hashable, ...], Any] = {}
        self._answers: dict[tuple[Query, Per], Closests] = {}

    def __len__(self) -> int:
        return len(self._motion.t)

    @property
    def t(self) -> Array:
        """Run times [s], shape (N,)."""
        return self._motion.t

    @property
    def motion(self) -> Motion:
        """Where everybody is, whoever was heard."""
        return self._motion

    def elsewhere(self, motion: Motion) -> States:
        """Return the twin at other instants."""
        return States(self._bench, motion)

    @contextmanager
    def for_author(self, author: str) -> Iterator[States]:
        """While a criterion of one's own is asked: as `seerob.twin.state.State.for_author`."""
        apart = States(self._bench, self._motion)
        apart.model = self.model.own_of(author)
        view = AuthorsView(apart, OF_MANY)
        try:
            yield cast("States", view)
        finally:
            view.answered()
            self.asked |= apart.asked
            self.speeds_asked |= apart.speeds_asked

    # Each is found when it is asked first: what only a robot's own tree says does not follow the others.

    @cached_property
    def _moved(self) -> dict[str, Array]:
        return self._bench.moved(self._motion)

    @cached_property
    def _rotations(self) -> Array:
        """World from body, in the order of `Model.bodies`, shape (N, n, 3, 3)."""
        return np.ascontiguousarray(self._moved["xmat"][:, self._bench.ids]).reshape(len(self), -1, 3, 3)

    @cached_property
    def _positions(self) -> Array:
        """World position of the bodies' origins [m], shape (N, n, 3)."""
        return np.ascontiguousarray(self._moved["xpos"][:, self._bench.ids])

    def _followed(self, body: int) -> Followed | None:
        """The tree of one of MuJoCo's bodies; None where only MuJoCo follows it."""
        tree = self._bench.tree(body)
        if tree is None:
            return None
        key = "tree", int(self._bench.mj.body_rootid[body])
        if key not in self._cache:
            self._cache[key] = tree.follow(self._motion.q)
        found: Followed = self._cache[key]
        return found

    def require(self, *names: str) -> None:
        """Say that what follows depends on robots or humans."""
        self.asked.update(names)

    def moved(self, name: str) -> bool:
        """Whether anything tells how fast somebody is (`seerob.twin.validity.validity.Validity.moved`)."""
        return name not in self._motion.still

    def invalid_source_reason(self, name: str) -> Reasons:
        """Why what was heard of somebody may not be relied on, shape (N,); empty where it may."""
        return self._motion.invalid_reasons[name]

    def everywhere(self) -> tuple[Array, Array]:
        """Rotations and positions [m] of all bodies, whoever was heard: for bounds, never for a verdict.

        Returns:
            Shapes (N, n, 3, 3) and (N, n, 3).
        """
        return self._rotations, self._positions

    def placed(self, bodies: Sequence[int]) -> tuple[Array, Array]:
        """World from body, and the origins in the world [m], of these bodies; of others NaN.

        Returns:
            Shapes (N, n, 3, 3) and (N, n, 3), in the order of `Model.bodies`.
        """
        self.require(*filter(None, (self.model.bodies[i].carrier for i in bodies)))
        self._settled(bodies)
        rotations, positions = np.full_like(self._rotations, np.nan), np.full_like(self._positions, np.nan)
        rows = list(bodies)
        rotations[:, rows], positions[:, rows] = self._rotations[:, rows], self._positions[:, rows]
        return rotations, positions

    def captured(self, name: str, bodies: Sequence[int]) -> tuple[Array, Array]:
        """Where bones of a person were captured: nothing stops a twin that is put where the samples say.

        Args:
            name: Of the person.
            bodies: Its bones, by index.

        Returns:
            World from bone, shape (N, n, 3, 3), and the bones' origins in the world [m], (N, n, 3), in the
            order of ``bodies``.
        """
        self.require(name)
        return self._rotations[:, list(bodies)], self._positions[:, list(bodies)]

    def qd(self, mechanism: Mechanism) -> Array:
        """Joint velocities [rad/s or m/s], shape (N, n)."""
        self.require(mechanism.name)
        self.speeds_asked.add(mechanism.name)
        return self._motion.v[:, self._bench.columns(mechanism).own_v]

    def mass_matrix(self, mechanism: Mechanism) -> Array:
        """Joint-space mass matrices [kg·m², kg·m or kg], shape (N, n, n).

        Raises:
            Undecided: A mass that nobody gave, or what drives it is too coarse for what a mass is asked for.
        """
        self._weigh(mechanism)
        if why := self._motion.coarse.get(mechanism.name):
            raise Undecided(f"{mechanism.name}: {why}")
        key = "M", mechanism.name
        if key not in self._cache:
            columns = self._bench.columns(mechanism)
            tree = self._followed(int(columns.bodies[0])) if len(columns.bodies) else None
            if tree is None:
                self._cache[key] = self._bench.masses(self._motion, mechanism)
            else:
                M = tree.mass_matrix(mechanism.v_address)
                C = columns.coupling
                self._cache[key] = M if C is None else C.T @ M @ C
        return np.asarray(self._cache[key])

    def held(self, mechanism: Mechanism) -> Array:
        """Torques that hold its joints against gravity [N·m or N], shape (N, n).

        Raises:
            Undecided: A mass that nobody gave.
        """
        self._weigh(mechanism)
        if why := mechanism.roughly_weighed:
            raise Undecided(why)
        columns, moved = self._bench.columns(mechanism), self._moved
        found = np.empty((len(self), len(columns.joints)))
        held_many(
            moved["subtree_com"], moved["xanchor"], moved["xaxis"], columns.bodies, columns.joints,
            columns.turns, columns.masses, self._bench.mj.opt.gravity, found,
        )  # fmt: skip
        return found if columns.coupling is None else np.asarray(found @ columns.coupling)

    def _weigh(self, mechanism: Mechanism) -> None:
        self.require(mechanism.name)
        self._settled(mechanism.carried)
        if mechanism.unknown_masses:
            raise Undecided("; ".join(mechanism.unknown_masses))

    def largest_speeds(self) -> Array:
        """Bounds on the speeds of all bodies' points [m/s], shape (N, n): for bounds, never for a verdict."""
        return np.asarray(self._fastest()[0])

    def jacobian(self, frame: Frame, mechanism: Mechanism, offset: Array | None = None) -> Array:
        """Jacobians of a point of a frame, linear rows first, world axes, shape (N, 6, n)."""
        self.require(mechanism.name)
        key = id(frame), mechanism.name, None if offset is None else offset.tobytes()
        if key not in self._cache:
            bench, columns = self._bench, self._bench.columns(mechanism)
            at = frame.body_from_frame[:3, 3]
            if offset is not None:
                at = at + frame.body_from_frame[:3, :3] @ offset
            dofs = np.arange(bench.mj.nv)[columns.all_v]
            tree = self._followed(frame.mj)
            if tree is not None:
                found = tree.jacobian(frame.mj, at, dofs)
            else:
                moved = self._moved
                points = moved["xpos"][:, frame.mj] + moved["xmat"][:, frame.mj].reshape(-1, 3, 3) @ at
                found = np.empty((len(self), 6, len(dofs)))
                root, moves = int(bench.mj.body_rootid[frame.mj]), moving_dofs(bench.mj, frame.mj)
                jacobians(moved["cdof"], moved["subtree_com"], root, dofs, moves, points, found)
            # With the frame itself: another one may get the id of one that is forgotten.
            self._cache[key] = frame, found if columns.coupling is None else found @ columns.coupling
        return np.asarray(self._cache[key][1])

    def velocity(self, frame: Frame, mechanism: Mechanism, offset: Array | None = None) -> Array:
        """Velocities that the joints of a mechanism give a point, linear before angular, shape (N, 6)."""
        J, qd = self.jacobian(frame, mechanism, offset), self.qd(mechanism)
        key = "velocity", id(frame), mechanism.name, None if offset is None else offset.tobytes()
        if key not in self._cache:
            found = np.empty((len(self), 6))
            carried_by(np.ascontiguousarray(J), np.ascontiguousarray(qd), found)
            self._cache[key] = frame, found
        return np.asarray(self._cache[key][1])

    def singular_values(self, frame: Frame, mechanism: Mechanism, offset: Array | None = None) -> Array:
        """Singular values of the linear rows of `jacobian`, largest first, shape (3, N)."""
        values = np.empty((len(self), 3))
        half_axes(np.ascontiguousarray(self.jacobian(frame, mechanism, offset)), values)
        return values.T

    def pose(self, frame: Frame) -> tuple[Array, Array]:
        """World rotations (N, 3, 3) and positions (N, 3) [m] of a frame."""
        moving = [m for m in self.model.mechanisms.values() if frame.mj in m.mj_bodies]
        self.require(*(m.name for m in moving))
        self._settled([body.index for body in self.model.bodies if body.mj == frame.mj])
        R, x = self._moved["xmat"][:, frame.mj].reshape(-1, 3, 3), self._moved["xpos"][:, frame.mj]
        return R @ frame.body_from_frame[:3, :3], x + R @ frame.body_from_frame[:3, 3]

    def inverse_effective_mass(
        self, frame: Frame, mechanism: Mechanism, offset: Array | None = None
    ) -> Array:
        """Inverses of the effective mass matrix of a point [1/kg], shape (N, 3, 3)."""
        J, M = self.jacobian(frame, mechanism, offset), self.mass_matrix(mechanism)
        found = np.empty((len(self), 3, 3))
        if not mobility(np.ascontiguousarray(J), np.ascontiguousarray(M), found):
            raise np.linalg.LinAlgError("M, a mass matrix, is not positive definite")
        return found

    def speed_error(self, mechanism: Mechanism) -> Array | None:
        """How far its joint velocities may be off, shape (N, n); None where nobody says that they were."""
        self.require(mechanism.name)
        return self._motion.speed_errors.get(mechanism.name)

    def along(self, bodies: tuple[int, ...], mechanism: Mechanism, points: Array, directions: Array) -> Array:
        r"""Rows :math:`u^T J_v` of points of several bodies, shape (N, b, n).

        Args:
            bodies: By index.
            mechanism: Whose joints the columns are.
            points: One of each body, in the world [m], shape (N, b, 3).
            directions: Likewise, shape (N, b, 3).
        """
        self.require(mechanism.name)
        self._settled(bodies)
        bench, moved, rows = self._bench, self._moved, np.array(bodies, np.int64)
        moves = np.array([moving_dofs(bench.mj, int(i)) for i in bench.ids[rows]])
        every = np.empty((len(self), len(rows), bench.mj.nv))
        for k in range(len(self)):
            along(
                moved["cdof"][k], moved["subtree_com"][k], bench.roots[rows], moves,
                np.ascontiguousarray(points[k]), np.ascontiguousarray(directions[k]), every[k],
            )  # fmt: skip
        return np.asarray(bench.columns(mechanism).of_rows(every))

    def fastest_points(self, bodies: Sequence[int]) -> tuple[Array, Array, Array]:
        """Bounds on the speeds of any points of bodies, corners and their velocities; see `State`.

        Returns:
            Shapes (N, b), (N, b, 3) and (N, b, 3).
        """
        movers = tuple(filter(None, (self.model.bodies[i].carrier for i in bodies)))
        self.require(*movers)
        self.speeds_asked.update(movers)
        self._settled(bodies)
        speed, point, velocity = (found[:, list(bodies)] for found in self._fastest())
        return speed, point, velocity

    def _fastest(self) -> tuple[Array, Array, Array]:
        if "fastest" not in self._cache:
            bench, moved, shape = self._bench, self._moved, self._positions.shape
            twists = np.empty((2, *shape))
            velocities_many(
                moved["cvel"], moved["subtree_com"], self._positions, bench.ids, bench.roots, twists
            )
            speed, point, velocity = np.zeros(shape[:2]), np.zeros(shape), np.zeros(shape)
            fastest_many(
                self._rotations, self._positions, twists[0], twists[1], *bench.corners, bench.reach,
                speed, point, velocity,
            )  # fmt: skip
            self._cache["fastest"] = speed, point, velocity
        speed, point, velocity = self._cache["fastest"]
        return speed, point, velocity

    # Whom a device sees is asked of instant by instant: nobody here is estimated, or has strayed.

    def closest(self, gap: Gap, *, allow_estimated: bool = False, strayed: bool = False) -> Closests:
        """Where two sets are nearest, shape (N,)."""
        return self.distances(gap.query, Per.SETS).of(slice(None), 0)

    def closest_per_body(self, gap: Gap, *, allow_estimated: bool = False, strayed: bool = False) -> Closests:
        """Where each body of ``gap.b`` is nearest to ``gap.a``, in the order of ``gap.b``, shape (N, b)."""
        return self.distances(gap.query, Per.BODY)

    def distances(self, query: Query, per: Per) -> Closests:
        """What a query says, shape (N, g)."""
        self.require(*filter(None, (self.model.bodies[i].carrier for i in query.bodies)))
        self._settled(query.bodies)
        question = query, per
        if question not in self._answers:
            self._answers |= self._bench.questions.ask(question, self._rotations, self._positions)
        return self._answers[question]

    def _settled(self, bodies: Sequence[int]) -> None:
        """Refuse what a gripper picks up."""
        for body in (self.model.bodies[i] for i in bodies):
            if body.holder:
                raise Undecided(unknown_place(body))


WHERE = "batch"
NOWHERE = "no motion is given and the file gives no position (q)"
NOT_FINITE = "a position or velocity that was given is not finite"


def motion_of(
    model: Model, q: Mapping[str, ArrayLike], qd: Mapping[str, ArrayLike], t: ArrayLike | None
) -> Motion:
    """The motion of those who are named; the others stand where the workstation file puts them.

    Args:
        model: The compiled workstation.
        q: Positions of the commanded joints by robot or human [rad or m], shape (N, n) each.
        qd: Likewise velocities [rad/s or m/s].
        t: Instants, increasing [s], shape (N,); a tick apart when not given.

    Raises:
        InputError: With every array that does not fit.
        UnknownName: A name that is no robot or human.
    """
    mechanisms = {name: model.mechanism(name) for name in [*q, *qd]}
    problems: list[Problem] = []
    if not q:
        problems.append(Problem(WHERE, "q", "empty", "give positions of a robot or human"))
    count = len(np.asarray(next(iter(q.values())))) if q else 0
    given: dict[str, tuple[Array, Array]] = {}
    for name, mechanism in mechanisms.items():
        arrays = []
        for key, values in (("q", q), ("qd", qd)):
            if name not in values:
                remedy = "give both; velocities of 0 where it stands still"
                problems.append(Problem(WHERE, f"{key}[{name!r}]", "missing", remedy))
                continue
            array = np.asarray(values[name], float)
            wanted = count, len(mechanism.joints)
            if array.shape != wanted:
                what = f"has the shape {array.shape}"
                joints = f"{len(mechanism.joints)} joints of {count} instants: {wanted}"
                problems.append(Problem(WHERE, f"{key}[{name!r}]", what, joints))
            arrays.append(array)
        if len(arrays) == 2:
            given[name] = arrays[0], arrays[1]
    period = model.workstation.engine.tick
    instants: Array = np.asarray(np.arange(count) * period if t is None else t, float)
    if instants.shape != (count,) or not np.isfinite(instants).all() or (np.diff(instants) <= 0).any():
        problems.append(Problem(WHERE, "t", "are not instants", f"{count} numbers that increase"))
    if problems:
        raise InputError(problems)
    motion = _placed(model, given, instants)
    if t is None:
        return motion
    return replace(motion, foreseen=count > 1, ways=Ways(motion.t, motion.q, motion.v, np.arange(count)))


def _placed(model: Model, given: Mapping[str, tuple[Array, Array]], t: Array) -> Motion:
    q, v = np.tile(model.mj.qpos0, (len(t), 1)), np.zeros((len(t), model.mj.nv))
    invalid_reasons: dict[str, Reasons] = {}
    for mechanism in model.mechanisms.values():
        name = mechanism.name
        position, velocity = given.get(name) or _at_home(mechanism, len(t))
        finite: Flags = np.asarray(np.isfinite(np.hstack([position, velocity])).all(axis=1))
        # Who is lost stands somewhere, so that of everybody else something can be said.
        position = np.where(finite[:, None], position, mechanism.home)
        velocity = np.where(finite[:, None], velocity, 0.0)
        q[:, mechanism.q_address] = position @ mechanism.coupling.T + mechanism.offset
        v[:, mechanism.v_address] = velocity @ mechanism.coupling.T
        invalid_reasons[name] = np.where(finite, "", f"{name}: {NOT_FINITE}").astype(object)
        if name not in given and not mechanism.home_given:
            invalid_reasons[name][:] = f"{name}: {NOWHERE}"
    robots = [m.name for m in model.mechanisms.values() if m.role == "robot"]
    still = {name for name in robots if given.keys().isdisjoint((name, *model.carriers_of(name)))}
    moved = frozenset(name for name in given if model.mechanisms[name].role == "machine")
    unmoved = frozenset(model.mechanisms.keys() - given.keys())
    return Motion(t, q, v, invalid_reasons, still=frozenset(still), unforeseen=moved, unmoved=unmoved)


def _at_home(mechanism: Mechanism, n: int) -> tuple[Array, Array]:
    return np.tile(mechanism.home, (n, 1)), np.zeros((n, len(mechanism.home)))
