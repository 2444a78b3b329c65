r"""Bounds on distance and speed that hold at every instant between samples, not only at them.

The motion between two samples is the cubic of `seerob.session.permissible.path`. On a span of time
with middle m and half length h every point of a body has a speed of at most :math:`v(m) + A h` and gets at
most :math:`v(m) h + A h^2 / 2` away from where it is at m; A bounds its acceleration there
(`seerob.session.permissible.moving_joints`). So, for two bodies a and b,

.. math:: d(t) \ge d(m) - (v_a + v_b) h - (A_a + A_b) h^2 / 2, \qquad v(t) \le v(m) + A h.

Spans are halved, the one with the worst bound first, until the worst bound is within a tolerance of the
worst value found. What is stated is the bound: it holds for this interpolation and these shapes whatever
the tolerance, and when the search is ended early too.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import mujoco
import numpy as np

from seerob.core import figures
from seerob.core.errors import InputError, Undecided
from seerob.core.samples import JointSample
from seerob.core.transforms import Array
from seerob.criteria.safety.minimum_distance import MinimumDistance
from seerob.criteria.safety.separation import Separation
from seerob.model.model import Model
from seerob.session.permissible.evaluation import PermissibleSpeed, Sources
from seerob.session.permissible.moving_joints import KinematicChain, MovingJoints, chains_of
from seerob.session.permissible.path import GivenMotion
from seerob.twin.state import State
from seerob.twin.validity.hearing import Hearing

ROUNDING = 1e-7
"""Taken off distances and added to speeds [m, m/s]: the error of poses and distances is far below."""
MOST_ASKED = 200_000
METHOD = (
    "cubics through positions and velocities of the samples; displacement and speed of every point bounded "
    "by its acceleration, spans of time halved until the bound is within the tolerance"
)


@dataclass(frozen=True)
class Bound:
    """What holds at every instant of a stretch of time."""

    what: str
    """``distance arm ↔ op``."""
    unit: str
    at_most: bool
    """Whether the bound is from above (a speed) or from below (a distance)."""
    value: float
    """The bound."""
    found: float
    """Worst value that was met; the truth lies between it and the bound."""
    at: float
    """When [s]."""
    start: float
    """Start of the stretch [s]."""
    end: float
    asked: int
    """Instants that were looked at."""
    note: str = ""
    """What it leaves out."""

    def figures(self) -> dict[str, str | float | None]:
        """For machines; a bound that is not there is None."""
        value = self.value if math.isfinite(self.value) else None
        side = "at most" if self.at_most else "at least"
        return {
            "what": self.what,
            "unit": self.unit,
            "side": side,
            "bound": value,
            "met": self.found,
            "at": self.at,
            "from": self.start,
            "to": self.end,
        }

    def worded(self) -> str:
        """The bound with its sign, rounded to the worse side."""
        if self.at_most:
            return f"≤ {figures.rounded_up(self.value, self.unit)}"
        return f"≥ {figures.rounded_down(self.value, self.unit)}"

    def sentence(self) -> str:
        """Sentence of the report."""
        if not math.isfinite(self.value):
            return f"{self.what}: no bound, {self.note} (met at {self.at:.3f} s)"
        text = (
            f"{self.what} {self.worded()} at every instant from {self.start:.3f} s to {self.end:.3f} s "
            f"(worst met {figures.figure(self.found, self.unit)} at {self.at:.3f} s)"
        )
        return f"{text}; {self.note}" if self.note else text


Progress = Callable[[int], None]
"""Told how many instants were looked at; what it raises stops the work."""


class BetweenSamples:
    """Bounds over the motions of a workstation."""

    def __init__(
        self, model: Model, motions: Mapping[str, GivenMotion], *, progress: Progress = lambda _: None
    ) -> None:
        """Bind.

        Args:
            model: The compiled workstation.
            motions: By the name of the robot or human that each moves; who has none stands still.
            progress: See `Progress`.

        Raises:
            InputError: No motion, or motions that have no time in common.
        """
        if not motions:
            raise InputError.at("bounds", "motion", "nobody moves", "give a recorded or planned motion")
        self.start = max(float(m.t[0]) for m in motions.values())
        self.end = min(float(m.t[-1]) for m in motions.values())
        if not self.start < self.end:
            raise InputError.at("bounds", "motion", "the motions have no time in common", "give ones that do")
        # The least distance is that with openings closed of which nobody says whether they are.
        self._model, self._progress = model.closed or model, progress
        self._joints = MovingJoints(model, motions)
        self._slid = self._joints.slid()
        hearings = {name: Hearing(given=True, driven=False) for name in model.mechanisms}
        self._data = mujoco.MjData(model.mj)
        self._state = State(model, self._data, hearings)
        doubtful = [name for name, m in motions.items() if not m.good.all()]
        self._note = (
            f"samples that the source does not vouch for count too ({', '.join(doubtful)})"
            if doubtful
            else ""
        )

    def _require(self, bodies: Iterable[int], *names: str) -> None:
        """Raise `Undecided` unless it is known how everybody moves on whom the place of a body depends.

        And where no shape shows a part of a robot that a name means.
        """
        if unshaped := self._model.unshaped(names):
            raise Undecided(unshaped)
        followed = {m.name for m in self._model.workstation.machines if m.motion.variables()}
        ids: set[int] = set()
        for i in bodies:
            at = self._model.bodies[i].mj
            while at > 0 and at not in ids:
                ids.add(at)
                at = int(self._model.mj.body_parentid[at])
        every = self._model.mechanisms.values()
        for name in (m.name for m in every if not ids.isdisjoint(m.mj_bodies.tolist())):
            if name in self._joints.motions:
                continue
            if name in followed:
                raise Undecided(f"{name} follows variables: what it does between samples is not known")
            if not self._model.mechanisms[name].home_given:
                raise Undecided(f"{name}: no source drives it and the file gives no position (q)")

    def _at(self, t: float) -> State:
        self._data.qpos[:], self._data.qvel[:] = self._joints.at(t)
        self._state.refresh(t)
        return self._state

    def distance(self, a: str, b: str, *, tolerance: float = 1e-3) -> Bound:
        """Least distance between two named sets, as `minimum_distance` has it.

        Args:
            a: Names, as of `Model.select`.
            b: Likewise.
            tolerance: How far the bound may be from the least distance met [m].

        Raises:
            UnknownName: A name that means no body.
            InputError: A tolerance that is not above 0.
            Undecided: Somebody whose place nobody gave, or who follows variables; a part without a shape.
        """
        gap = self._model.gap(self._model.select(a), self._model.select(b))
        self._require(gap.bodies, a, b)
        first, second = (chains_of(self._model, side, self._slid) for side in (gap.a, gap.b))

        def middle(t: float) -> tuple[Array, Array]:
            state = self._at(t)
            found = gap.query.per_body(state.rotations, state.positions).distance
            # Whichever body of the first set is nearest next, it comes no faster than the fastest of them.
            v_a = max((state.fastest_point(i)[0] for i in gap.a), default=0.0)
            v_b = np.array([state.fastest_point(i)[0] for i in gap.b])
            return np.asarray(found), v_a + v_b

        def bound(value: Array, speed: Array, agility: Array, half: float) -> float:
            return float((value - speed * half - agility * half**2 / 2).min()) - ROUNDING

        def agility(low: float, high: float) -> Array:
            A_a = self._agility(first, low, high).max(initial=0.0)
            return np.asarray(A_a + self._agility(second, low, high))

        found = self._search(
            f"distance {a} ↔ {b}", "m", False, middle, agility, bound, lambda v: float(v.min()), tolerance
        )
        # Of shapes that overlap the distance only says that they do.
        return replace(found, value=-np.inf, note="they touch or overlap") if found.found <= 0 else found

    def speed(self, of: str, *, tolerance: float = 1e-3) -> Bound:
        """Largest speed of any point of a named set [m/s], as `velocity` with ``of`` has it.

        Args:
            of: A name, as of `Model.select`.
            tolerance: How far the bound may be from the largest speed met [m/s].

        Raises:
            UnknownName: A name that means no body.
            InputError: A tolerance that is not above 0.
            Undecided: Somebody whose place nobody gave, or who follows variables.
        """
        bodies = self._model.select(of)
        self._require(bodies, of)
        chains = chains_of(self._model, bodies, self._slid)

        def middle(t: float) -> tuple[Array, Array]:
            state = self._at(t)
            return np.array([state.fastest_point(i)[0] for i in bodies]), np.zeros(len(bodies))

        def bound(value: Array, _: Array, agility: Array, half: float) -> float:
            return -float((value + agility * half).max()) - ROUNDING

        def agility(low: float, high: float) -> Array:
            return self._agility(chains, low, high)

        return self._search(
            f"speed of {of}", "m/s", True, middle, agility, bound, lambda v: -float(v.max()), tolerance
        )

    def _agility(self, chains: list[KinematicChain], low: float, high: float) -> Array:
        qd, qdd = self._joints.largest(np.array([low]), np.array([high]))
        return np.array([float(chain.agility(qd, qdd)[0]) for chain in chains])

    def _search(
        self,
        what: str,
        unit: str,
        at_most: bool,
        middle: Callable[[float], tuple[Array, Array]],
        agility: Callable[[float, float], Array],
        bound: Callable[[Array, Array, Array, float], float],
        worst: Callable[[Array], float],
        tolerance: float,
    ) -> Bound:
        """Least value over time; of speeds the negative ones."""
        if not tolerance > 0:
            raise InputError.at("bounds", "tolerance", f"{tolerance} {unit}", "give more than 0")
        spans: list[tuple[float, float, float]] = []
        best, at, asked = np.inf, self.start, 0

        def look(low: float, high: float) -> None:
            nonlocal best, at, asked
            t = (low + high) / 2
            value, speed = middle(t)
            asked += 1
            if worst(value) < best:
                best, at = worst(value), t
            heapq.heappush(spans, (bound(value, speed, agility(low, high), (high - low) / 2), low, high))
            self._progress(asked)

        edges = self._joints.breaks(self.start, self.end).tolist()
        if len(edges) > MOST_ASKED:
            raise InputError.at("bounds", "motion", f"{len(edges)} samples", f"at most {MOST_ASKED}")
        for low, high in pairwise(edges):
            look(low, high)
        while spans[0][0] < best - tolerance and asked < MOST_ASKED and (at_most or best > 0):
            _, low, high = heapq.heappop(spans)
            half = (low + high) / 2
            look(low, half)
            look(half, high)
        sign = -1.0 if at_most else 1.0
        return Bound(
            what, unit, at_most, sign * spans[0][0], sign * best, at, self.start, self.end, asked, self._note
        )


MOST = 20
"""Distances that are bounded, and speeds."""
PERIOD = 0.008
"""At which a rescaled motion is sampled for its bounds [s]."""


def motions_of(sources: Sources, found: PermissibleSpeed | None = None) -> dict[str, GivenMotion] | None:
    """The motions of all who move; None where a source gives anything but joint positions.

    Args:
        sources: Opened.
        found: Whose rescaled motion, if any, replaces the given one.
    """
    motions: dict[str, GivenMotion] = {}
    for source, opened in sources:
        if not source.target():
            continue
        if found is not None and found.rescaled is not None and source.target() == found.map.robot:
            continue
        samples = list(opened.samples)
        joints = [s for s in samples if isinstance(s, JointSample)]
        if len(joints) != len(samples) or len(joints) < 2 or source.target() in motions:
            return None
        motions[source.target()] = GivenMotion.of(joints)
    if found is not None and found.rescaled is not None:
        planned = found.rescaled.trajectory(PERIOD)
        assert planned.qd is not None
        good = np.ones(len(planned.t), bool)
        motions[found.map.robot] = GivenMotion(found.map.robot, planned.t, planned.q, planned.qd, good)
    return motions


def wanted_bounds(
    model: Model, motions: Mapping[str, GivenMotion] | None, *, tolerance: float = 1e-3, most: int
) -> list[Bound]:
    """The bounds, none where motions are not known between samples."""
    if not motions:
        return []
    between = BetweenSamples(model, motions)
    robots = [name for name, m in model.mechanisms.items() if m.role == "robot" and name in motions]
    asked = [partial(between.distance, a, b, tolerance=tolerance) for a, b in _pairs(model)[:most]]
    asked += [partial(between.speed, name, tolerance=tolerance) for name in robots[:most]]
    bounds = []
    for ask in asked:
        with suppress(Undecided):
            bounds.append(ask())
    return bounds


def _pairs(model: Model) -> Sequence[tuple[str, str]]:
    """Sets whose distance some criterion asks about."""
    kinds = (Separation, MinimumDistance)
    found = [tuple(c.between) for c in model.workstation.safety if isinstance(c, kinds)]
    return [(a, b) for a, b in dict.fromkeys(found)]
