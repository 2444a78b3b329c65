r"""Exact least distances and closest points between sets of bodies.

A `Shapes` is built once per model; a `Query` binds the two sets once and then answers for poses.

The distance of two solids is that of their cores less their radii. While cores are apart it is exact,
down to minus the sum of the radii. When cores intersect, or one lies wholly inside a mesh, the
overlap is *at least* as deep as the (never positive) value says, and `DistanceKind.DEPTH_AT_LEAST` says so:
no library gives a meaningful depth of two concave meshes. The least over many pairs is the least of
these values, so a body inside a machine can never read as far from it.

Criteria ask one by one and share pairs of bodies without knowing of each other: a `Surveyor` asks what was
asked at two ticks in a row together from then on, in one compiled call, but for what was not asked at the
last tick. The answers are functions of the poses alone, so this saves time and changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import IntEnum, StrEnum
from typing import NamedTuple

import numpy as np
from msgspec import Struct
from numpy.typing import ArrayLike, NDArray

from seerob.core.errors import InputError, Problem, SimulationDiverged
from seerob.core.transforms import Array
from seerob.kernels import nearest as kernel
from seerob.kernels.pairs import MESH
from seerob.kernels.shapes import Indices, Shapes

__all__ = ["Closest", "Closests", "DistanceKind", "Per", "Query", "Shapes", "Survey", "Surveyor"]

PATIENCE = 256
"""Ticks after which what nobody asks any more is left out."""


class DistanceKind(IntEnum):
    """What a distance tells."""

    EXACT = kernel.EXACT
    """The distance, or the depth of the overlap of two dilations, to rounding."""
    DEPTH_AT_LEAST = kernel.DEPTH_AT_LEAST
    """Cores intersect or one is inside a mesh: the overlap is at least this deep."""
    BEYOND_CAP = kernel.BEYOND_CAP
    """Not nearer than the query's cap, which is the value; no points."""
    WITHIN_CAP = kernel.WITHIN_CAP
    """Nearer than the query's cap, which is the value: more was not asked; no points."""


_KINDS = {int(kind): kind for kind in DistanceKind}
"""To ask an enumeration for a member takes longer than to make all the rest of an answer."""


class Per(StrEnum):
    """What a least distance is taken over: the two sets, each body, or each pair of bodies."""

    SETS = "sets"
    """All of a to all of b: one."""
    BODY = "body"
    """All of a to each body of b."""
    PAIR = "pair"
    """Each body of a to each body of b, a-major."""
    WHETHER = "whether"
    """Whether each pair of bodies is nearer than the cap: far cheaper than how near."""


class Closest(Struct, frozen=True, eq=False):
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
    kind: DistanceKind


class Closests(Struct, frozen=True, eq=False):
    """Many `Closest`, in arrays: shape (g,) for one set of poses, (N, g) for a batch."""

    distance: Array
    """[m]."""
    point_a: Array
    """[m], shape (..., 3)."""
    point_b: Array
    body_a: Indices
    body_b: Indices
    kind: NDArray[np.int8]
    """Values of `DistanceKind`."""

    def of(self, *index: int | slice | Indices) -> Closests:
        """Some of them."""
        return Closests(
            self.distance[index],
            self.point_a[index],
            self.point_b[index],
            self.body_a[index],
            self.body_b[index],
            self.kind[index],
        )

    def shaped(self, shape: tuple[int, ...]) -> Closests:
        """Return these distances reshaped to ``shape``; points keep their last axis of 3."""
        return Closests(
            self.distance.reshape(shape),
            self.point_a.reshape((*shape, 3)),
            self.point_b.reshape((*shape, 3)),
            self.body_a.reshape(shape),
            self.body_b.reshape(shape),
            self.kind.reshape(shape),
        )

    def at(self, *index: int) -> Closest:
        """One of them."""
        return Closest(
            self.distance.item(*index),
            self.point_a[index],
            self.point_b[index],
            self.body_a.item(*index),
            self.body_b.item(*index),
            _KINDS[self.kind.item(*index)],
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
        self.bodies = *self.a, *self.b
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
        self._rows = np.array(rows, np.int64)
        self._bodies = np.array(bodies, np.int64)
        self._groups = np.array(groups, np.int64)
        pairs = len(self.a) * len(self.b)
        self._columns = {
            Per.SETS: (0, 1),
            Per.BODY: (1, len(self.b)),
            Per.PAIR: (2, pairs),
            Per.WHETHER: (2, pairs),
        }
        self._alone: dict[Per, Survey] = {}

    def _survey(self, per: Per) -> Survey:
        if per not in self._alone:
            self._alone[per] = Survey(self.shapes, [(self, per)])
        return self._alone[per]

    def members(self, per: Per) -> Members:
        """Its pairs by group, in their order within each."""
        column, count = self._columns[per]
        order = np.argsort(self._groups[:, column], kind="stable")
        # A group of bodies without solids is empty.
        start = np.searchsorted(self._groups[order, column], np.arange(count + 1))
        return Members(self._rows[order], self._bodies[order], start.astype(np.int64))

    def minimum(self, rotations: ArrayLike, positions: ArrayLike) -> Closest:
        """Where the two sets are nearest.

        Args:
            rotations: world_from_body of every body of the shapes, shape (n, 3, 3).
            positions: Likewise [m], shape (n, 3).

        Raises:
            SimulationDiverged: A pose that is not finite.
        """
        return self.ask(rotations, positions, Per.SETS).at(0)

    def per_body(self, rotations: ArrayLike, positions: ArrayLike) -> Closests:
        """Where each body of b is nearest to all of a, in the order of ``b``; see `minimum`."""
        return self.ask(rotations, positions, Per.BODY)

    def per_pair(self, rotations: ArrayLike, positions: ArrayLike) -> Closests:
        """Where each body of a is nearest to each of b, shape (len(a)·len(b),), a-major; see `minimum`."""
        return self.ask(rotations, positions, Per.PAIR)

    def ask(self, rotations: ArrayLike, positions: ArrayLike, per: Per) -> Closests:
        """One of the three; see `minimum`."""
        (found,) = self._survey(per).ask(rotations, positions)
        return found

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
        (found,) = self._survey(per).batch(rotations, positions)
        return found


class Survey:
    """Many questions about the same shapes, answered in one compiled call; see `Query`.

    Each answer is that of its query asked alone, bit for bit; pairs of solids that several of them
    ask for are measured once.
    """

    def __init__(self, shapes: Shapes, questions: Sequence[tuple[Query, Per]]) -> None:
        """Bind.

        Args:
            shapes: Of all the queries.
            questions: What is asked.
        """
        self.shapes = shapes
        self.questions = tuple(questions)
        # What is cheap to answer from pairs that are known comes last.
        late = (Per.SETS, Per.WHETHER)
        order = sorted(range(len(self.questions)), key=lambda k: self.questions[k][1] in late)
        members = [self.questions[k][0].members(self.questions[k][1]) for k in order]
        rows = np.concatenate([found.rows for found in members])
        pair_of, pair = np.unique(rows[:, :2], axis=0, return_inverse=True)
        members_of, swapped_of = pair.ravel().astype(np.int32), rows[:, 2] == 1
        bodies_of = np.concatenate([*(found.bodies for found in members), [[-1, -1]]])
        offsets = np.cumsum([0, *(len(found.rows) for found in members)])
        starts = [found.start[:-1] + offset for found, offset in zip(members, offsets, strict=False)]
        starts_of = np.concatenate([*starts, offsets[-1:]]).astype(np.int64)
        sizes = [len(found.start) - 1 for found in members]
        self._caps = np.repeat([self.questions[k][0].cap for k in order], sizes)
        whether = np.repeat([self.questions[k][1] is Per.WHETHER for k in order], sizes)
        ends = np.cumsum([0, *sizes]).tolist()
        columns = {k: slice(ends[i], ends[i + 1]) for i, k in enumerate(order)}
        self.columns = {self.questions[k]: columns[k] for k in range(len(order))}
        """Where the answers to each question are among all of them."""
        self.begins: dict[tuple[Question, ...], list[int]] = {}
        """Where those to some begin, by these."""
        self._columns = [columns[k] for k in range(len(order))]
        self._in_turn = np.concatenate([np.arange(len(self._caps))[part] for part in self._columns])
        self._asked = kernel.Questions(
            np.unique(pair_of), pair_of, starts_of, members_of, swapped_of, bodies_of, whether
        )
        self._memory = self._forget()

    def ask(self, rotations: ArrayLike, positions: ArrayLike) -> list[Closests]:
        """Answers for one set of poses, in the order of the questions; see `Query.minimum`."""
        found = self.together(rotations, positions)
        if len(self._columns) == 1:
            return [found]
        return [found.of(columns) for columns in self._columns]

    def together(self, rotations: ArrayLike, positions: ArrayLike, caps: Array | None = None) -> Closests:
        """All answers for one set of poses, those to each question in its `columns`.

        Args:
            rotations: As of `Query.minimum`.
            positions: Likewise.
            caps: Of `without`.
        """
        return self._run(rotations, positions, (), self._memory, self._caps if caps is None else caps)

    def without(self, questions: Iterable[Question]) -> Array:
        """Caps [m] with which some questions are not asked, for `together`."""
        caps = self._caps.copy()
        for question in questions:
            caps[self.columns[question]] = -np.inf
        return caps

    def within(self, rotations: ArrayLike, positions: ArrayLike, caps: Array) -> Closests:
        """Answers up to other caps, one after the other in the order of the questions.

        Args:
            rotations: As of `Query.minimum`, for one set of poses or, shape (N, n, 3, 3), for many.
            positions: Likewise.
            caps: Of every answer [m]; -infinity where none is asked for.
        """
        many = np.shape(rotations)[:-3]
        if len(self._columns) == 1:
            return self._run(rotations, positions, many, self._memory, np.ascontiguousarray(caps, float))
        own = np.empty_like(self._caps)
        own[self._in_turn] = caps
        return self._run(rotations, positions, many, self._memory, own).of(
            *[slice(None)] * len(many), self._in_turn
        )

    def batch(self, rotations: ArrayLike, positions: ArrayLike) -> list[Closests]:
        """Answers for many samples, in the order of the questions; see `Query.batch`."""
        found = self._run(rotations, positions, (len(np.asarray(rotations)),), self._forget(), self._caps)
        return [found.of(slice(None), columns) for columns in self._columns]

    def _forget(self) -> kernel.Bound:
        return kernel.Bound(self.shapes.arrays(), self._asked)

    def _run(
        self,
        rotations: ArrayLike,
        positions: ArrayLike,
        many: tuple[int, ...],
        bound: kernel.Bound,
        caps: Array,
    ) -> Closests:
        """Answers of shape (*many, g), of poses with such leading dimensions.

        Asked between other work, what it costs is mostly what of Python it touches: so it touches little.
        """
        R = np.ascontiguousarray(rotations, float)
        x = np.ascontiguousarray(positions, float)
        n = len(self.shapes.names)
        if R.shape != (*many, n, 3, 3) or x.shape != (*many, n, 3):
            raise ValueError(f"poses of {n} bodies expected, not rotations {R.shape} and positions {x.shape}")
        if many:
            R, x = R.reshape(-1, 3, 3), x.reshape(-1, 3)
        count = len(caps) * many[0] if many else len(caps)
        # Not bound like the rest: whoever keeps an answer must never see that of a later tick in it.
        figures, winners, kinds = (
            np.empty((7, count)),
            np.empty((2, count), np.int64),
            np.empty(count, np.int8),
        )
        bad, body = kernel.nearest(R, x, n, bound.table, caps, figures, winners, kinds)
        if bad >= 0:
            self._memory = self._forget()
            sample = f" of sample {bad}" if many and many[0] > 1 else ""
            raise SimulationDiverged(f"the pose of {self.shapes.names[body]!r}{sample} is not finite")
        points = figures[1:].reshape(2, count, 3)
        found = Closests(figures[0], points[0], points[1], winners[0], winners[1], kinds)
        return found.shaped((*many, len(caps))) if many else found


class Members(NamedTuple):
    """Pairs of solids by group."""

    rows: Indices
    """Solids, meshes first, and 1 where the first belongs to the second set, shape (k, 3)."""
    bodies: Indices
    """Bodies of the first and of the second set, shape (k, 2)."""
    start: Indices
    """Where each group begins, shape (g + 1,)."""


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


Question = tuple[Query, Per]


class Surveyor:
    """Answers of one tick.

    Args:
        shapes: Of the model.
    """

    def __init__(self, shapes: Shapes) -> None:
        self._shapes = shapes
        self._together: dict[Question, int] = {}
        """Questions that are asked together, and the tick when each was last asked for."""
        self._survey: Survey | None = None
        self._resting: set[Question] = set()
        """Those of them that were not asked for at the last tick: they are asked alone when they are."""
        self._caps: Array | None = None
        """Without them."""
        self._asked: dict[Question, None] = {}
        self._before: dict[Question, None] = {}
        self._tick = 0
        self._answers: dict[Question, Closests] = {}
        self._found: Closests | None = None
        """All answers of this tick that were asked together."""

    def forget(self) -> None:
        """The poses are others now."""
        self._answers.clear()
        self._found = None
        self._tick += 1
        new = [question for question in self._asked if question in self._before]
        idle = self._tick % PATIENCE == 0 and any(
            self._tick - last > PATIENCE for last in self._together.values()
        )
        if new or idle:
            self._together = {
                question: last for question, last in self._together.items() if self._tick - last <= PATIENCE
            }
            self._together |= dict.fromkeys(new, self._tick)
            questions = list(self._together)
            self._survey = Survey(self._shapes, questions) if len(questions) > 1 else None
            self._resting, self._caps = set(), None
        since = self._tick - 1
        resting = {question for question, last in self._together.items() if last < since}
        if resting != self._resting and self._survey is not None:
            self._resting, self._caps = resting, self._survey.without(resting)
        self._before, self._asked = self._asked, {}

    def closest(self, query: Query, rotations: Array, positions: Array) -> Closest:
        """Where two sets are nearest at this tick; see `Query`."""
        question = query, Per.SETS
        if self._survey is None or question not in self._together or question in self._resting:
            return self.ask(query, Per.SETS, rotations, positions).at(0)
        self._together[question] = self._tick
        if self._found is None:
            self._found = self._survey.together(rotations, positions, self._caps)
        return self._found.at(self._survey.columns[question].start)

    def together(
        self, questions: tuple[Question, ...], rotations: Array, positions: Array
    ) -> tuple[Closests, list[int]] | None:
        """All answers of a tick, and where those to some questions begin; None while one is asked alone."""
        survey, known = self._survey, self._together
        if survey is None or (rows := survey.begins.get(questions)) is None:
            new = [question for question in questions if question not in known]
            if survey is None or new:
                self._asked |= dict.fromkeys(new)
                return None
            rows = survey.begins[questions] = [survey.columns[each].start for each in questions]
        known.update(dict.fromkeys(questions, self._tick))
        if not self._resting.isdisjoint(questions):
            return None
        if self._found is None:
            self._found = survey.together(rotations, positions, self._caps)
        return self._found, rows

    def ask(self, query: Query, per: Per, rotations: Array, positions: Array) -> Closests:
        """The answer to a question at this tick; see `Query`."""
        question = query, per
        found = self._answers.get(question)
        if question in self._together:
            self._together[question] = self._tick
            if found is None and self._survey is not None and question not in self._resting:
                if self._found is None:
                    self._found = self._survey.together(rotations, positions, self._caps)
                found = self._found.of(self._survey.columns[question])
                self._answers[question] = found
                return found
        else:
            self._asked[question] = None
        if found is None:
            found = self._answers[question] = query.ask(rotations, positions, per)
        return found
