"""What people hold is of them for whoever asks how near they are, and of the load for whoever asks that.

A workpiece `on` a hand is one of the person's shapes. A loose one (`seerob.twin.machines.loose`) is a thing
of its own: while a hand holds it, what is asked of the person alone says nothing of how far it reaches,
unless the same is asked of it. And a method that is told a load is not told enough where hands hold more.
Limits of contact are of body regions as heavy as they are: who is hit through what a hand holds, or by a
hand that is heavier by it, is hit otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from seerob.core.errors import Undecided
from seerob.core.figures import rounded_up
from seerob.core.snapshot import Result
from seerob.criteria.criterion import Criterion
from seerob.criteria.question import Bound
from seerob.criteria.scoring.handled import at_most, heavier, unweighed
from seerob.criteria.scoring.phases import Phase, entered_for, phase_at
from seerob.model.model import Model
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.state import State

MORE = 1e-6
"""Share by which what is held may be heavier than the load that is given [1]: rounding."""
UNKNOWN = Phase()
"""Of an instant that belongs to no phase: nothing is entered."""


class InHand:
    """Why what criteria say is not within while people hold something.

    Args:
        model: The compiled workstation.
        bound: All of its criteria.
    """

    def __init__(self, model: Model, bound: Sequence[Bound]) -> None:
        criteria = [one.criterion for one in bound]
        self._model, self._criteria = model, criteria
        # Postures are of bodies alone, and limits of contact of what touches them.
        self._near = [
            one.group == "safety" and one.criterion.by_shape and not one.criterion.adults for one in bound
        ]
        self._masses = {
            name: float(sum(model.mj.body_mass[mj] for mj in {model.bodies[i].mj for i in mechanism.bodies}))
            * max(heavier(model, model.bodies[i]) for i in mechanism.bodies)
            for name, mechanism in model.mechanisms.items()
            if mechanism.role == "workpiece"
        }
        self._bodies = {body.name: body.index for body in model.bodies}
        self._judged: list[set[int]] = []
        self._always: dict[str, dict[str, float]] = {}
        """Person → what is mounted on a bone, by name [kg]; infinite where nobody knows what it weighs."""
        for name, mechanism in model.mechanisms.items():
            if mechanism.role == "human":
                carried = (model.bodies[i] for i in mechanism.carried)
                self._always[name] = {b.owner: at_most(model, b) for b in carried if b.mass is not None}
                self._always[name] |= dict.fromkeys(unweighed(model, name), math.inf)
        loads = ((i, _entered_load(model, each)) for i, each in enumerate(criteria))
        self._loads = {i: load for i, load in loads if load is not None}
        """Place of each that is told a load → that load at an instant of the run [s]."""
        self._hits = {i: hits for i, each in enumerate(criteria) if (hits := each.hits(model)) is not None}
        """Place of each that limits contact → what may hit people, from how near [m] and fast [m/s] on."""
        self._gaps: dict[tuple[int, str], Callable[[State], float]] = {}
        self._mounted = {
            model.bodies[i].owner: (name,)
            for name, mechanism in model.mechanisms.items()
            if mechanism.role == "human"
            for i in mechanism.carried
        }
        """What is mounted on a bone → on whose."""
        told = bool(self._mounted and self._hits) or bool(any(self._always.values()) and self._loads)
        self.never = not self._masses and not told
        """Whether nobody can hold anything that counts."""

    def reasons(self, state: State, results: Sequence[Result]) -> dict[int, str]:
        """Why what a criterion says of a state is not within, by its place in the file."""
        held, found = state.held, dict[int, str]()
        weights = {person: dict(things) for person, things in self._always.items()}
        for piece, hands in held.items():
            for hand in hands:
                weights.setdefault(hand.partition("/")[0], {})[piece] = self._masses[piece]
        for i, load_at in self._loads.items():
            if (load := load_at(state.t)) is None:
                continue
            for person in self._criteria[i].subjects():
                things = weights.get(person, {})
                if sum(things.values()) > load * (1 + MORE):
                    what = ", ".join(f"{name} ({_weight(mass)})" for name, mass in things.items())
                    reason = f"{person} holds {what}, and load says {load:g} kg: give all that hands hold"
                    found[i] = reason
        if held:
            found |= self._nearer(state, results)
        for i, (_, horizon, _) in self._hits.items():
            for piece, holders in (*held.items(), *self._mounted.items()):
                people = {holder.partition("/")[0] for holder in holders} & self._always.keys()
                if people and self._may_be_hit(i, piece, state):
                    reason = (
                        f"{', '.join(sorted(people))} holds {piece}, which may be hit from {horizon:g} m on: "
                        "no limit is known of who is hit through what is held"
                    )
                    found[i] = reason
        return found

    def _may_be_hit(self, i: int, piece: str, state: State) -> bool:
        """Whether something that moves is near what is held, or may be: of whom that is not known."""
        moving, horizon, standstill = self._hits[i]
        try:
            moves = (state.fastest_speeds(moving) > standstill).any()
            return bool(moves) and not self._gap(i, piece)(state) > horizon
        except Undecided:
            return True

    def _gap(self, i: int, piece: str) -> Callable[[State], float]:
        """How near what may hit people is to what is held at least, at an instant [m]."""
        if (i, piece) not in self._gaps:
            moving, model = self._hits[i][0], self._model
            pieces = [body.index for body in model.bodies if body.owner == piece]
            if not all(model.bodies[b].solids for b in (*moving, *pieces)):
                self._gaps[i, piece] = lambda state: 0.0
            else:
                gap, off = model.gap(moving, pieces), TrackingError(model, pieces)

                def nearest(state: State) -> float:
                    found = gap.query.minimum(state.rotations, state.positions).distance
                    return found - gap.deviation - float(off.at(state).max(initial=0.0))

                self._gaps[i, piece] = nearest
        return self._gaps[i, piece]

    def _nearer(self, state: State, results: Sequence[Result]) -> dict[int, str]:
        """Who judges a hand, and nobody what it holds, with less room than that reaches."""
        if not self._judged:
            self._judged = [each.judged(self._model) for each in self._criteria]
        found: dict[int, str] = {}
        for i, (criterion, bodies) in enumerate(zip(self._criteria, self._judged, strict=True)):
            if not self._near[i]:
                continue
            for piece, hands in state.held.items():
                own = {*self._model.mechanisms[piece].bodies}
                alike = zip(self._criteria, self._judged, strict=True)
                # A gripper's body is a part of it, and counts by itself (`seerob.twin.machines.gripping`).
                own_hands = [hand for hand in hands if self._bodies.get(hand) in bodies]
                holding = [self._bodies[hand] for hand in own_hands]
                if not holding or any(own & b for c, b in alike if type(c) is type(criterion)):
                    continue
                reach = min(self._reach(state, own, hand) for hand in holding)
                if _room(results[i]) > reach:
                    continue
                person = own_hands[0].partition("/")[0]
                reason = (
                    f"{person} holds {piece}, which reaches {rounded_up(reach)} m from the hand, and nobody "
                    f"asks the same of it: add a criterion of this kind with {piece}, or mount it on the hand"
                )
                found[i] = reason
        return found

    def _reach(self, state: State, pieces: set[int], hand: int) -> float:
        """How far a point of a workpiece is from a wrist until the next tick at most [m]."""
        far = 0.0
        for body in (self._model.bodies[i] for i in pieces):
            points = body.corners @ state.rotations[body.index].T + state.positions[body.index]
            away = np.linalg.norm(points - state.positions[hand], axis=1).max(initial=0.0)
            far = max(far, float(away) + body.radius + body.deviation)
        return far + float(state.largest_speeds().max(initial=0.0)) * self._model.workstation.engine.tick


def _weight(mass: float) -> str:
    return f"{mass:g} kg" if math.isfinite(mass) else "of a mass that nobody gave"


def _room(result: Result) -> float:
    """How much farther than a distance has to be it is [m]; none of what is no distance."""
    if result.unit != "m" or result.at_most or result.value is None or result.limit is None:
        return -math.inf
    return float(min((result.value, *(result.interval or ()))) - result.limit)


def _entered_load(model: Model, criterion: Criterion) -> Callable[[float], float | None] | None:
    """The handled mass that a method is told, at an instant of the run [s]; None where it is told none.

    Who counts what hands hold is told enough.

    Of lifts, which have no instants, that is the greatest.
    """
    if getattr(criterion, "weighs_hands", False):
        return None
    if lifts := getattr(criterion, "lifts", ()):
        masses = [lift.load if lift.heaviest is None else lift.heaviest for lift in lifts]
        return None if None in masses else lambda t: max(masses)
    phases = entered_for(model, criterion)
    if all(getattr(phase, "load", None) is None for phase in phases):
        return None
    return lambda t: getattr(phase_at(phases, t, UNKNOWN), "load", None)
