"""A plan: postures to go through, a way between two, and what is known of it.

Every straight way of it is proven to be clear. RRT-Connect ([Kuffner2000]_) finds it by postures along its
ways, short cuts make it shorter (`seerob.kernels.ways`); then it is proven, and where that fails searched
again by ways that are.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core.errors import InputError, Problem, SeerobError
from seerob.core.transforms import Array
from seerob.kernels import ways
from seerob.model.model import Mechanism, Model
from seerob.session.planning.clearance import RESOLUTION, SPACING, WATCHED, Clearance
from seerob.session.planning.others import made_for, movers

LIMIT = 1e-9
"""Beyond a limit by less is rounding [rad or m]."""
MOST = 1_000_000
"""Postures that are looked at per way."""
PERSON = "; where people go is not known"


@dataclass(frozen=True, eq=False)
class Plan:
    """A path of one robot, straight in joint space from posture to posture."""

    robot: str
    joints: tuple[str, ...]
    q: Array
    """Postures [rad or m], shape (k, n)."""
    margin: float
    """Kept everywhere on it [m]; proven for the shapes of the twin."""
    least: float
    """Bound from below on the distance to anything, on all of it [m]."""
    nearest: str
    """What is nearest to what at the posture of the path that is nearest to anything."""
    seed: int
    asked: int
    """Postures whose distances were computed."""
    left_out: tuple[str, ...]
    """Pairs of the robot's own bodies that are not watched."""
    at: tuple[int, ...] = ()
    """Rows of ``q`` at which the start and each goal are."""
    around: tuple[str, ...] = ()
    """How everybody else was taken, one sentence each."""
    open: tuple[str, ...] = ()
    """Why it is not known that the way is clear, although it is by the twin's shapes where they stand."""

    @property
    def others(self) -> str:
        """That everything else stands, or that what is said of it follows."""
        return "; of the others:" if self.around else ", while everything else stands."

    def toml(self) -> str:
        """A file of waypoints, for the source ``waypoints``."""
        head = [
            f"# Planned for {self.robot} with seed {self.seed}: straight joint moves between these postures",
            f"# keep at least {self.margin:g} m from everything, by the twin's shapes{self.others}",
            *(f"# - {text}" for text in self.around),
            *(f"# Not known to be clear: {text}" for text in self.open),
            "# A blend would leave the proven way. Preliminary: not executed by any controller.",
            f"# joints: {', '.join(self.joints)}",
        ]
        rows = [f"[[waypoints]]\nq = [{', '.join(f'{x:.9f}' for x in q)}]" for q in self.q.tolist()]
        return "\n".join([*head, "", "\n\n".join(rows), ""])


def plan(
    model: Model,
    robot: str,
    goals: Sequence[ArrayLike],
    *,
    start: Sequence[float] | None = None,
    margin: float = 0.02,
    seed: int = 1,
    seconds: float = 60.0,
    keep_out: Sequence[str] = (),
    places: Mapping[str, Array] | None = None,
    swept: Collection[str] = (),
    off: float = 0.0,
    say: Callable[[int], bool] = lambda tried: False,
) -> Plan:
    """A path from a start through goals that keeps a margin from everything, proven between postures too.

    Everybody else stands where ``places`` or the workstation file puts them, unless an area that they sweep
    is in their place. Areas are looked at only where ``keep_out`` names them.

    Args:
        model: The compiled workstation.
        robot: Who moves.
        goals: Joint positions to go through, (n,) each [rad or m]; or (k, n), of which the
            first that is clear is taken: the ways of reaching one pose.
        start: Where it begins [rad or m]; its ``q`` in the file when not given.
        margin: Least distance from anything, itself included [m].
        seed: Same model, same seed, same path.
        seconds: Longest time per goal [s].
        keep_out: Areas that are kept away from like everything else.
        places: Joint positions of others by name [rad or m], (n,) each, instead of those of the file.
        swept: Others that are looked through, as an area of ``keep_out`` is what they sweep.
        off: How far others may be from where they are taken to be [m].
        say: Told how many postures were tried; True stops the work.

    Raises:
        UnknownName: No such robot or area.
        InputError: No start, a posture of another length, beyond a limit, or nearer than the margin.
        NoPath: None was found; that there is none is not known.
        Stopped: ``say`` said so.
    """
    mechanism = model.robot(robot)
    if start is None and not mechanism.home_given:
        raise InputError.at(
            "plan",
            "start",
            f"nobody says where {robot} is",
            "give its q in the file, or a start (--from on the command line)",
        )
    if not goals:
        raise InputError.at("plan", "goal", "missing", "give joint positions to go to")
    if not (margin >= 0 and np.isfinite(margin)):
        raise InputError.at("plan", "margin", f"{margin} m", "give 0 or more")
    postures = [
        np.asarray(mechanism.home if start is None else start, float),
        *(np.asarray(g, float) for g in goals),
    ]
    names = ["start", *(f"goal {i + 1}" for i in range(len(goals)))]
    problems: list[Problem] = []
    for name, q in zip(names, postures, strict=True):
        problems += wrong(mechanism, name, q)
    if problems:
        raise InputError(problems)
    clearance = Clearance(
        model, mechanism, postures[0], keep_out=keep_out, places=places, swept=swept, off=off
    )
    postures = [first_clear(clearance, q, margin) for q in postures]
    for name, q in zip(names, postures, strict=True):
        what = clearance.fault(q, margin)
        if what:
            problems.append(Problem("plan", name, what, "choose another posture or a smaller margin"))
    if problems:
        raise InputError(problems)
    path, at = [postures[0]], [0]
    for (a, b), (first, second) in zip(pairwise(postures), pairwise(names), strict=True):
        try:
            path += search(clearance, a, b, margin=margin, seed=seed, most=MOST, seconds=seconds, say=say)[1:]
        except NoPath as error:
            remedy = "give a posture in between, more seconds, another seed, or a smaller margin"
            raise NoPath(f"from {first} to {second}: {error}; {remedy}") from error
        at.append(len(path) - 1)
    least = clearance.least(*path)
    near = [found for q in path if (found := clearance.nearest(q)) is not None]
    return Plan(
        robot=robot,
        joints=tuple(j.name for j in mechanism.joints),
        q=np.array(path),
        margin=margin,
        least=float(max(least, margin)),
        nearest=min(near, key=lambda n: n.distance).what if near else "",
        seed=seed,
        asked=clearance.asked,
        left_out=clearance.left_out,
        at=tuple(at),
        around=_around(model, robot, keep_out, places or {}, swept),
        open=tuple(open_findings(model, robot, keep_out)),
    )


def open_findings(model: Model, robot: str, keep_out: Sequence[str]) -> Iterator[str]:
    """What findings hold of whatever is kept apart: a run calls no distance of theirs within."""
    bodies = [b for b in model.bodies if b.role in WATCHED or b.name in keep_out]
    names = {robot, *model.mechanisms, *(b.name for b in bodies), *(b.owner for b in bodies)}
    yield from dict.fromkeys(
        f"{f.subject}: {f.text}" for f in model.findings if not names.isdisjoint(f.holds) or "*" in f.holds
    )


def _around(
    model: Model, robot: str, keep_out: Sequence[str], places: Mapping[str, Array], swept: Collection[str]
) -> tuple[str, ...]:
    moving = movers(model.workstation, robot)
    said = []
    for name, other in model.mechanisms.items():
        if name == robot:
            continue
        if name in swept:
            said.append(f"{name}: all that it sweeps while its source plays is kept away from")
        elif name in places and name in moving:
            said.append(f"{name}: stands where its source has it at the instant that was given")
        elif name in moving:
            said.append(f"{name}: stands where the file puts it, although a source moves it")
        else:
            said.append(f"{name}: stands where the file puts it" + PERSON * (other.role == "human"))
    said += [f"area {name}: kept away from" for name in keep_out if name not in made_for(swept)]
    looked_through = [a.name for a in model.workstation.areas if a.name not in keep_out]
    if looked_through:
        said.append(f"areas that are looked through: {', '.join(looked_through)}")
    return tuple(said)


def first_clear(clearance: Clearance, ways: Array, margin: float) -> Array:
    """Of postures (k, n) the first that keeps a margin [m], or the first; or one (n,)."""
    rows = np.atleast_2d(ways)
    return next((q for q in rows if not clearance.fault(q, margin)), rows[0])


def wrong(robot: Mechanism, name: str, ways: Array) -> Iterator[Problem]:
    """What is not a posture of a robot, (n,), or several, (k, n)."""
    n = len(robot.joints)
    if ways.ndim not in (1, 2) or not ways.size or ways.shape[-1] != n:
        yield Problem("plan", name, f"an array of shape {ways.shape}", f"give {n} numbers [rad or m]")
        return
    for q in np.atleast_2d(ways):
        for joint, low, value, high in zip(robot.joints, robot.lower, q, robot.upper, strict=True):
            if not low - LIMIT <= value <= high + LIMIT:
                what = f"{joint.name} at {value:.4g} is beyond its limits {low:.4g} and {high:.4g}"
                yield Problem("plan", name, what, "choose another posture")


STRIDE = 0.6
"""Largest step of a tree in joint space [rad or m]."""

ROOM = 0.005
"""What is made shorter keeps so much more than the margin [m]: along the margin a proof takes small steps."""

NODES = 20_000
"""Of each tree of a search."""
SLICE = 32
"""Random postures that are tried before somebody is asked whether to go on."""
SHORT_CUTS = 60
"""Short cuts that are tried."""
GAIN = 0.002
"""Share of the length of a way that a short cut must save."""


class NoPath(SeerobError):
    """No path was found; that there is none is not known."""


class Stopped(SeerobError):
    """It was asked to stop."""


def search(
    clearance: Clearance,
    start: Array,
    goal: Array,
    *,
    margin: float,
    seed: int,
    most: int,
    seconds: float,
    say: Callable[[int], bool],
) -> list[Array]:
    """Postures of a path whose straight ways all keep the margin.

    Args:
        clearance: The robot among everything.
        start: Joint positions, shape (n,); clear.
        goal: Likewise.
        margin: [m].
        seed: Of what is tried.
        most: Largest number of postures tried.
        seconds: Longest time; what is found before does not depend on it [s].
        say: Told how many were tried; True stops the work.

    Raises:
        NoPath: None was found within ``most`` or ``seconds``.
        Stopped: ``say`` said so.
    """
    if clearance.clear(start, goal, margin):
        return [start, goal]
    random = np.array([seed % 2**64], np.uint64)
    patience = _Patience(clearance.asked, most, seconds, say)
    found = _searched(clearance, start, goal, margin, random, patience, proven=False)
    # Only what is kept is proven; what is clear at postures and not between them is searched again.
    path = [start]
    for a, b in pairwise(found):
        if clearance.clear(a, b, margin):
            path.append(b)
            continue
        way = _searched(clearance, a, b, margin, random, patience, proven=True)
        # One tree grew towards the other: its ways were proven from their other end.
        if not all(clearance.clear(x, y, margin) or clearance.clear(y, x, margin) for x, y in pairwise(way)):
            raise NoPath("the path that was found could not be proven")
        path += way[1:]
    return path


def _searched(
    clearance: Clearance,
    start: Array,
    goal: Array,
    margin: float,
    random: NDArray[np.uint64],
    patience: _Patience,
    *,
    proven: bool,
) -> list[Array]:
    """Postures whose straight ways are clear, as far as is looked, without detours that it can do without.

    Raises:
        NoPath: None was found in time.
        Stopped: Nobody wants to wait.
    """
    low, high = bounds(clearance.robot, start, goal)
    nodes, parents = np.empty((2, NODES, len(start))), np.zeros((2, NODES), np.int64)
    nodes[:, 0] = start, goal
    size = np.array([1, 1, 0])
    how = (RESOLUTION if proven else SPACING, proven, clearance.table)
    need, state = clearance.needs(margin), ways.ON
    while state != ways.FOUND:
        if state == ways.FULL or patience.over(clearance.asked):
            raise patience.end()
        state = ways.connect(nodes, parents, size, random, low, high, STRIDE, SLICE, need, *how)
    halves = []
    for tree in (0, 1):
        k, half = size[tree] - 1, list[Array]()
        while k:
            half.append(nodes[tree, k])
            k = parents[tree, k]
        halves.append([*half, nodes[tree, 0]])
    way = halves[0][::-1] + halves[1][1:]
    if proven:
        return way  # of a part of what was proven the proof may need finer steps
    need = clearance.needs(margin + ROOM)

    def clear(*postures: Array) -> bool:
        if patience.over(clearance.asked):
            return False
        return all(ways.is_clear(a, b, need, *how) for a, b in pairwise(postures))

    return _plain(clear, _shortened(clear, way, np.random.default_rng(int(random[0]))))


def _shortened(clear: Callable[..., bool], way: list[Array], random: np.random.Generator) -> list[Array]:
    """A way with short cuts, of all joints or by turns of one, between random places of it."""
    for turn in range(SHORT_CUTS):
        far = np.cumsum([0.0, *(float(np.linalg.norm(b - a)) for a, b in pairwise(way))])
        u, v = np.sort(random.uniform(0, far[-1], 2))
        i, j = np.clip(np.searchsorted(far, (u, v), side="right") - 1, 0, len(way) - 2).tolist()
        if i == j:
            continue
        at, knots = np.array([u, *far[i + 1 : j + 1], v]), np.array(way)
        cut = np.column_stack([np.interp(at, far, column) for column in knots.T])
        if turn % 2:  # of one joint alone: the others go as before
            joint = int(random.integers(len(knots[0])))
            cut[:, joint] = np.interp(at, (u, v), (cut[0, joint], cut[-1, joint]))
        else:
            cut = cut[[0, -1]]
        length = float(np.linalg.norm(np.diff(cut, axis=0), axis=1).sum())
        if length < v - u - GAIN * far[-1] and clear(*cut):
            way = [*way[: i + 1], *cut, *way[j + 1 :]]
    return way


def _plain(clear: Callable[..., bool], way: list[Array]) -> list[Array]:
    """Without postures that can be left out."""
    k = 1
    while k < len(way) - 1:
        if clear(way[k - 1], way[k + 1]):
            del way[k]
        else:
            k += 1
    return way


class _Patience:
    """Tells when to give up, and then why."""

    def __init__(self, begun: int, most: int, seconds: float, say: Callable[[int], bool]) -> None:
        self._begun, self._most, self._seconds, self._say = begun, most, seconds, say
        self._until = time.monotonic() + seconds
        self._tried = 0

    def over(self, asked: int) -> bool:
        """Whether there is no more time, or enough was looked at; `Stopped` when nobody wants to wait."""
        self._tried = asked - self._begun
        if self._say(self._tried):
            raise Stopped(f"stopped after {self._tried} postures")
        return self._tried > self._most or time.monotonic() > self._until

    def end(self) -> NoPath:
        """What to raise when it is over, or there is no room for more."""
        spent = f"in {self._seconds:g} s ({self._tried} postures tried)"
        if time.monotonic() <= self._until:
            spent = f"with {self._tried} postures tried"
        return NoPath(f"no path was found {spent}; that there is none is not known")


def bounds(robot: Mechanism, start: Array, goal: Array) -> tuple[Array, Array]:
    """Where postures are tried: within the limits, and where there are none half a turn around both ends."""
    least, most = np.minimum(start, goal), np.maximum(start, goal)
    low = np.minimum(np.maximum(robot.lower, least - np.pi), least)
    return low, np.maximum(np.minimum(robot.upper, most + np.pi), most)
