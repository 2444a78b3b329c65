"""A plan in space and time: who passes is waited for or gone around; the motion is proven at every instant.

A roadmap of postures is made: ways that `seerob.session.planning.plan.search` finds past what stands, past
the others as they are at some instants, and random postures beside them. In it the earliest arrival is
searched by safe intervals ([Phillips2011]_): of each posture the times in which the robot may stand there,
and moves from rest to rest in between. What is found is made shorter, its moves overlap where limits and
distances let them, and then it is proven (`seerob.session.planning.among_moving`).
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core.errors import InputError, Problem
from seerob.core.transforms import Array
from seerob.model.model import Mechanism, Model
from seerob.session.permissible.joint_limits import JointLimits
from seerob.session.planning.among_moving import STEP, ClearanceInTime
from seerob.session.planning.clearance import Clearance, Nearest
from seerob.session.planning.others import Course
from seerob.session.planning.plan import (
    MOST,
    NoPath,
    Stopped,
    bounds,
    first_clear,
    open_findings,
    search,
    wrong,
)
from seerob.session.planning.timed_moves import Move, Rows, at, rows

ROOMS = 0.005, 0.02, 0.0
"""What is kept more than the margin at instants that are looked at [m], by turns until a proof holds."""
STRIDE = 0.6
"""Longest way between two postures of the roadmap on one way [rad or m]."""
BESIDE = 30
"""Random postures of the roadmap."""
NEIGHBOURS = 10
"""To how many others moves from a posture are tried."""
WAYS = 4
"""Past what stands, each by another seed: one alone may be winding."""
INSTANTS = 4
"""At which ways past the others as they stand are searched."""
A_WHILE = 20_000
"""Postures that are looked at for one of these."""
WAITS = 0.1
"""Between two departures that are tried [s]."""
OVERLAPS = 1.0, 0.75, 0.5, 0.25, 0.0
"""Shares of the shorter of two ramps by which a move may begin before the one before it ends."""


@dataclass(frozen=True, eq=False)
class TimedPlan:
    """A motion of one robot."""

    robot: str
    rows: Rows
    """On the clock of the others' motion."""
    units: tuple[str, ...]
    """``rad`` or ``m`` of each joint."""
    margin: float
    """Kept at every instant [m]; proven for the shapes of the twin."""
    nearest: Nearest | None
    """Of the instants that were looked at."""
    at: float
    """When that is [s]."""
    stays: float
    """Until when it may stand at the last goal [s], proven."""
    waits: float
    """For how long it stands on the way [s]."""
    until: str
    """When the others' motion ends, and why."""
    off: float
    """How far others may be from where they were seen [m]: kept in addition."""
    asked: int
    """Instants that were looked at."""
    left_out: tuple[str, ...]
    """Pairs of the robot's own bodies that are not watched."""
    open: tuple[str, ...] = ()
    """Why it is not known that the way is clear, although it is by the twin's shapes where they are."""


def plan_in_time(
    model: Model,
    robot: str,
    goals: Sequence[ArrayLike],
    *,
    course: Course,
    who: Sequence[str],
    limits: JointLimits,
    start: Sequence[float] | None = None,
    margin: float = 0.02,
    seed: int = 1,
    seconds: float = 60.0,
    begin: float = 0.0,
    within: float = 30.0,
    keep_out: Sequence[str] = (),
    say: Callable[[int], bool] = lambda tried: False,
) -> TimedPlan:
    """A motion from a start through goals that keeps a margin from everything that moves and stands.

    Args:
        model: The compiled workstation.
        robot: Who moves.
        goals: Joint positions to go through, (n,) each [rad or m].
        course: Where everybody else is.
        who: Those who move.
        limits: Of the robot's joints.
        start: Where it begins, at 0 s; its ``q`` in the file when not given.
        margin: Least distance from anything [m].
        seed: Same model, same motion, same seed: the same plan.
        seconds: Longest time of a search past what stands [s].
        begin: When it may begin to move [s]; until then it stands at the start.
        within: When it arrives at the latest [s].
        keep_out: Areas that are kept away from like everything else.
        say: Told how many instants were looked at; True stops the work.

    Raises:
        UnknownName: No such robot or area.
        InputError: A posture that cannot be, or is nearer than the margin to what stands; or others who carry
            the robot.
        NoPath: None was found until their motion ends; that there is none is not known.
        Stopped: ``say`` said so.
    """
    mechanism = model.robot(robot)
    first = np.asarray(mechanism.home if start is None else start, float)
    postures = [first, *(np.asarray(goal, float) for goal in goals)]
    names = ["start", *(f"goal {i + 1}" for i in range(len(goals)))]
    problems = [p for name, q in zip(names, postures, strict=True) for p in wrong(mechanism, name, q)]
    if not goals:
        problems.append(Problem("plan", "goal", "missing", "give joint positions to go to"))
    if start is None and not mechanism.home_given:
        problems.append(Problem("plan", "start", f"nobody says where {robot} is", "give its q in the file"))
    if not (margin >= 0 and np.isfinite(margin)):
        problems.append(Problem("plan", "margin", f"{margin} m", "give 0 or more"))
    problems += _carried(model, mechanism, who)
    if problems:
        raise InputError(problems)
    still = Clearance(model, mechanism, first, keep_out=keep_out, swept=who)
    postures = [first_clear(still, q, margin) for q in postures]
    for name, q in zip(names, postures, strict=True):
        if what := still.fault(q, margin):
            problems.append(Problem("plan", name, what, "choose another posture or a smaller margin"))
    if problems:
        raise InputError(problems)
    places = {name: model.mechanisms[name].home for name in who}
    every = Clearance(model, mechanism, first, keep_out=keep_out, places=places, off=course.off)
    moving = ClearanceInTime(model, every, course, min(course.end, within))
    until = time.monotonic() + seconds
    roadmap = _Roadmap(still, every, moving, postures, margin=margin, seed=seed, seconds=seconds, say=say)
    why = ""
    for room in ROOMS:
        journey = _Journey(roadmap, moving, every.needs(margin + room), limits, until, say)
        try:
            moves = journey.found(len(postures), begin)
        except NoPath as error:
            why = why or f"{error}; {_ends(course, within)}"
            continue
        for tried in (journey.smooth(moves, first, postures[1:], begin), moves):
            found = rows(tried, first, 0.0, tried[-1].end)
            failed = moving.fault(found, margin) if found.within(limits) else 0.0
            if failed is None:
                when, nearest = moving.nearest(found)
                return TimedPlan(
                    robot=robot,
                    rows=found,
                    units=mechanism.units,
                    margin=margin,
                    nearest=nearest,
                    at=when,
                    stays=_stays(moving, found, margin, course.end),
                    waits=_waits(tried, begin),
                    until=_ends(course, within),
                    off=course.off,
                    asked=moving.asked,
                    left_out=every.left_out,
                    open=tuple(open_findings(model, robot, keep_out)),
                )
            why = f"what was found could not be proven at {failed:.2f} s"
    raise NoPath(f"{why}; that there is none is not known")


def _ends(course: Course, within: float) -> str:
    if course.end <= within:
        return f"where the others are is known until {course.end:.2f} s ({course.why})"
    return f"it was looked at until {within:.2f} s"


def _carried(model: Model, robot: Mechanism, who: Sequence[str]) -> Iterator[Problem]:
    """Others whose joints move the robot itself."""
    dofs = {int(dof): name for name in who for dof in model.mechanisms[name].v_address}
    for body in robot.mj_bodies.tolist():
        at = body
        while at > 0:
            begin = int(model.mj.body_dofadr[at])
            for dof in range(begin, begin + int(model.mj.body_dofnum[at])):
                if dof in dofs:
                    what = f"{robot.name} moves with {dofs[dof]}, or carries it"
                    yield Problem("plan", "--others", what, "plan with others that stand still")
                    return
            at = int(model.mj.body_parentid[at])


def _stays(moving: ClearanceInTime, found: Rows, margin: float, end: float) -> float:
    """Until when the last posture is proven to be clear [s]."""
    begin, q = float(found.t[-1]), np.repeat(found.q[-1:], 2, axis=0)
    for _ in range(20):
        if end <= begin:
            break
        failed = moving.fault(Rows(np.array([begin, end]), q, np.zeros_like(q)), margin)
        if failed is None:
            return end
        end = min(failed, end - STEP) - STEP
    return begin


def _waits(moves: Sequence[Move], begin: float) -> float:
    ends = [begin, *(move.end for move in moves)]
    return sum(max(0.0, move.begin - end) for move, end in zip(moves, ends, strict=False))


class _Roadmap:
    """Postures, and which straight ways between them are clear of what stands."""

    def __init__(
        self,
        still: Clearance,
        every: Clearance,
        moving: ClearanceInTime,
        postures: Sequence[Array],
        *,
        margin: float,
        seed: int,
        seconds: float,
        say: Callable[[int], bool],
    ) -> None:
        self._still, self._margin = still, margin
        found = list(postures)
        self._joined: dict[tuple[int, int], bool] = {}
        self._beside: dict[int, set[int]] = {}
        self.ends: tuple[int, ...] = ()
        """Postures to which every other tries a way."""

        def add(way: list[Array], first: int) -> None:
            chain = [first]
            for a, b in pairwise(way):
                parts = max(1, int(np.ceil(np.linalg.norm(b - a) / STRIDE)))
                for share in np.linspace(0, 1, parts + 1)[1:]:
                    found.append(a + share * (b - a))
                    chain.append(len(found) - 1)
            found.pop()
            chain[-1] = first + 1
            for i in chain:
                self._beside.setdefault(i, set()).update(chain)

        for first, (a, b) in enumerate(pairwise(postures)):
            for k in range(WAYS):
                way = search(still, a, b, margin=margin, seed=seed + k, most=MOST, seconds=seconds, say=say)
                add(way, first)
                if len(way) == 2:
                    break  # straight, and so would the others be
            for k in np.linspace(0, len(moving.t) - 1, INSTANTS).astype(int).tolist():
                moving.stand(k)
                if every.is_clear(a, margin) and every.is_clear(b, margin):
                    try:
                        way = search(
                            every, a, b, margin=margin, seed=seed, most=A_WHILE, seconds=1.0, say=say
                        )
                    except NoPath:
                        continue
                    add(way, first)
        low, high = bounds(still.robot, np.min(postures, axis=0), np.max(postures, axis=0))
        random = np.random.default_rng(seed)
        for q in random.uniform(low, high, (BESIDE, len(low))):
            if still.is_clear(q, margin):
                found.append(q)
        self.q = np.array(found)

    def neighbours(self, i: int) -> Iterator[int]:
        """Postures to which a straight way is clear of what stands, the goals among them."""
        away = np.linalg.norm(self.q - self.q[i], axis=1)
        near = np.argsort(away, kind="stable")[1 : NEIGHBOURS + 1].tolist()
        for j in sorted({*near, *self._beside.get(i, ()), *self.ends} - {i}):
            if away[j] > 0 and self._is_joined(i, j):
                yield j

    def _is_joined(self, i: int, j: int) -> bool:
        key = min(i, j), max(i, j)
        if key not in self._joined:
            self._joined[key] = self._still.sampled(self.q[key[0]], self.q[key[1]], self._margin)
        return self._joined[key]


class _Journey:
    """The earliest arrival on a roadmap."""

    def __init__(
        self,
        roadmap: _Roadmap,
        moving: ClearanceInTime,
        need: Array,
        limits: JointLimits,
        until: float,
        say: Callable[[int], bool],
    ) -> None:
        self._roadmap, self._moving, self._need, self._limits = roadmap, moving, need, limits
        self._until, self._say = until, say
        self._safe: dict[int, NDArray[np.int64]] = {}

    def found(self, count: int, begin: float) -> list[Move]:
        """Moves through the first postures of the roadmap, so many of them, from an instant on [s].

        Raises:
            NoPath: There is none on it.
            Stopped: Nobody wants to wait.
        """
        moves: list[Move] = []
        k = int(np.ceil(begin / STEP - 1e-9))
        if k >= len(self._moving.t):
            raise NoPath(f"nobody knows where others are at {begin:.2f} s")
        if (since := int(self._since(0)[k])) != 0:
            near = self._moving.t[max(since - 1, 0) if since > 0 else k]
            raise NoPath(f"others come too near to the start by {near:.2f} s")
        for goal in range(1, count):
            self._roadmap.ends = (goal,)
            leg, k = self._leg(goal - 1, goal, k)
            moves += leg
        return moves

    def _leg(self, start: int, goal: int, first: int) -> tuple[list[Move], int]:
        """Moves from one posture at an instant to another, and the first instant after."""
        since = int(self._since(start)[first])
        q, limits = self._roadmap.q, self._limits
        least = (np.abs(q - q[goal]) / limits.velocity).max(axis=1)
        before: dict[tuple[int, int], tuple[tuple[int, int], Move]] = {}
        begun = start, since
        arrived = {begun: first}
        queue = [(first * STEP + float(least[start]), first, begun)]
        done: set[tuple[int, int]] = set()
        while queue:
            _, k, key = heapq.heappop(queue)
            if key[0] == goal:
                return _traced(before, key, begun), k
            if key in done:
                continue
            done.add(key)
            if self._say(self._moving.asked):
                raise Stopped(f"stopped after {self._moving.asked} instants")
            if time.monotonic() > self._until:
                raise NoPath("no way was found in the time")
            for j in self._roadmap.neighbours(key[0]):
                for move, end in self._moves(key[0], j, k, arrived):
                    there = j, int(self._since(j)[end])
                    arrived[there] = end
                    before[there] = key, move
                    heapq.heappush(queue, (end * STEP + float(least[j]), end, there))
        raise NoPath(f"no way was found among {len(q)} postures")

    def _moves(
        self, i: int, j: int, k: int, arrived: dict[tuple[int, int], int]
    ) -> Iterator[tuple[Move, int]]:
        """The earliest move to a posture in each of its intervals in which it was not as early."""
        q, here, there = self._roadmap.q, self._since(i), self._since(j)
        move = Move.of(0.0, q[i], q[j], self._limits)
        count = int(np.ceil(move.duration / STEP - 1e-9))
        way = q[i] + move.at(STEP * np.arange(count + 1, dtype=float))[0]
        reached: set[int] = set()
        for begin in range(k, len(here) - count, round(WAITS / STEP)):
            if here[begin] != here[k]:
                break
            end = begin + count
            interval = int(there[end])
            if interval < 0 or interval in reached or arrived.get((j, interval), len(there)) <= end:
                continue
            if self._moving.clear(way, begin, self._need, stop=True).all():
                reached.add(interval)
                yield move.earlier(-float(self._moving.t[begin])), end

    def _since(self, i: int) -> NDArray[np.int64]:
        """Of each instant since when the robot may stand in a posture until then; -1 where it may not."""
        if i not in self._safe:
            q = np.tile(self._roadmap.q[i], (len(self._moving.t), 1))
            clear = self._moving.clear(q, 0, self._need, stop=False)
            last = np.maximum.accumulate(np.where(clear, -1, np.arange(len(clear))))
            self._safe[i] = np.where(clear, last + 1, -1)
        return self._safe[i]

    def smooth(self, moves: list[Move], start: Array, kept: Sequence[Array], begin: float) -> list[Move]:
        """Without stops that nobody needs: several moves as one, sooner, or overlapping; as far as is looked.

        Args:
            moves: Of `found`.
            start: Where they begin, shape (n,).
            kept: Postures that are not left out.
            begin: When it may begin to move [s].
        """

        def stops(move: Move) -> bool:
            return any(np.array_equal(move.goal, q) for q in kept)

        i = 0
        while i < len(moves) - 1:
            last = next((k for k in range(i, len(moves)) if stops(moves[k])), len(moves) - 1)
            for j in range(last, i, -1):
                one = Move.of(moves[i].begin, moves[i].start, moves[j].goal, self._limits)
                tried = [*moves[:i], one, *moves[j + 1 :]]
                if one.end <= moves[j].end and self._looks_clear(tried, start, moves[j].end):
                    moves = tried
                    break
            i += 1
        for i in range(len(moves)):
            before = moves[i - 1].end if i else begin
            most = min(sum(m.windows[1:]) for m in moves[i - 1 : i + 1]) if i else 0.0
            for share in OVERLAPS if i else (0.0,):
                by = moves[i].begin - before + share * most
                tried = [*moves[:i], *(move.earlier(by) for move in moves[i:])]
                if by > 0 and self._looks_clear(tried, start, moves[-1].end):
                    moves = tried
                    break
        return moves

    def _looks_clear(self, moves: list[Move], start: Array, until: float) -> bool:
        """Whether moves keep what is needed at the instants until one [s], and the limits."""
        end = max(until, moves[-1].end)
        k = int(np.searchsorted(self._moving.t, end))
        if k >= len(self._moving.t):
            return False
        q, _ = at(moves, start, self._moving.t[: k + 1])
        if not rows(moves, start, 0.0, moves[-1].end).within(self._limits):
            return False
        return bool(self._moving.clear(q, 0, self._need, stop=True).all())


def _traced(
    before: dict[tuple[int, int], tuple[tuple[int, int], Move]], key: tuple[int, int], start: tuple[int, int]
) -> list[Move]:
    moves: list[Move] = []
    while key != start:
        key, move = before[key]
        moves.append(move)
    return moves[::-1]
