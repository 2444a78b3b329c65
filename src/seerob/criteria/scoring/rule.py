"""What every rule about a posture shares: whose, how accurately it is known, what is entered for it.

What it asks of the twin are the anatomical angles of a person at this tick.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Annotated, ClassVar, cast

import numpy as np
from msgspec import Meta

from seerob.core.errors import InputError, Undecided, UnknownName
from seerob.core.snapshot import Basis, Input, Level
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.criterion import Criterion, not_adult
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.criteria.scoring.bands import Bands
from seerob.criteria.scoring.basis import (
    ACCURACY_NOTE,
    PROJECTION_NOTE,
    captured_accuracy,
    choices,
    entered,
    posture_quality,
    watched,
)
from seerob.criteria.scoring.handled import NOTHING, Handled, bind_handled
from seerob.criteria.scoring.held_work import GAP, WorkDetection, WorkMonitor
from seerob.criteria.scoring.judgement import Method, of_posture, score, shown, together
from seerob.criteria.scoring.measured import Accuracy, ArmPolicy, JointAccuracy, accuracy_of
from seerob.criteria.scoring.phases import P, Phase, check_order, phase_at, phases_of, shared_phases
from seerob.criteria.scoring.spans import Span, Thresholds
from seerob.description.humans.angles import Angles, angles
from seerob.description.humans.skeleton import BONES
from seerob.model import provenance
from seerob.model.model import Mechanism, Model
from seerob.twin.state import State

MOST_SCORES = 4096
"""Postures of which scores are kept, one for all in the same bands."""


def bone_rows(model: Model, human: Mechanism) -> list[int]:
    """Slots of the person's bones in `State.rotations`, in the order of `BONES`."""
    slots = {model.bodies[i].name: i for i in human.bodies}
    return [slots[f"{human.name}/{bone}"] for bone in BONES]


def bind_posture(model: Model, name: str, unmeasured: Collection[str] = ()) -> Callable[[Twin], Angles]:
    """Look the names up, and return what reads the angles of one person, without what nobody measures.

    Of N instants the angles have the shapes (N, 1) and (N, 1, 2).

    Args:
        model: The compiled workstation.
        name: Of the human.
        unmeasured: Bones whose orientation the source does not measure but fills in.

    Raises:
        UnknownName: No such human or bone.
    """
    human = model.human(name)
    outside = not_adult(model, name)
    for bone in unmeasured:
        if bone not in BONES:
            raise UnknownName("bone", bone, BONES)
    bones = tuple(bone_rows(model, human))

    def read(state: Twin) -> Angles:
        if outside:
            raise Undecided(outside)
        if state.many:
            # Of whom more is known than where they are is asked instant by instant.
            R, x = state.captured(human.name, bones)
            found = angles(R[:, None], x[:, None])
            return found.without(unmeasured) if unmeasured else found
        return one(cast("State", state))

    def one(state: State) -> Angles:
        invalid = state.invalid_orientations(human.name)
        hearing = state.hearing(human.name, strayed=True)
        # How a hand is turned of which only the wrist is seen is a guess, too.
        invalid = (*invalid, *hearing.unaimed(state.t))
        # What was captured, not where a table or a robot stops the twin.
        found = angles(*state.captured(human.name, bones, posture=True))
        # What devices see changes with time: of a leg that nobody sees no score is made.
        lost = (*unmeasured, *invalid) if invalid else unmeasured
        found = found.without(lost) if lost else found
        undetermined = hearing.undetermined_angles(state.t)
        return found.masked(undetermined) if undetermined else found

    return read


def by_phase(
    t: float | Array, angles: Angles, phases: Sequence[P], unknown: P, scored: Callable[[Angles, P], Figure]
) -> Figure:
    """Score of one posture in its phase, or of N postures in those of each.

    Args:
        t: Instants of the run [s], shape () or (N,).
        angles: Of the postures.
        phases: What was entered.
        unknown: The phase of instants that belong to none.
        scored: Scores postures in a phase.
    """
    if not isinstance(t, np.ndarray):
        return scored(angles, phase_at(phases, t, unknown))
    return together([(where, scored(angles[where], phase)) for phase, where in phases_of(phases, t, unknown)])


class PostureRule(Criterion, frozen=True, kw_only=True):
    """Base of the rules about a person's posture."""

    instants: ClassVar[str] = (
        "accepted: the method scores postures that are looked at, not the way between them"
    )
    whole: ClassVar[bool] = False  # bones that nobody sees are not assessed
    weighs_hands: ClassVar[bool] = False
    """Whether what is in hands counts beside the load that is entered (`seerob.criteria.scoring.handled`)."""

    human: str
    """Who is judged."""
    accuracy: Annotated[float, Meta(ge=0, lt=np.pi / 2, extra={"unit": "rad"})] | None = None
    """How far each angle of the posture may be off [rad]; the verdict then is of the whole interval."""
    joint_accuracy: JointAccuracy | None = None
    """How far the angles of single joints may be off [rad], where that differs from ``accuracy``."""
    unmeasured: tuple[str, ...] = ()
    """Bones that the source does not measure, such as ``"right_hand"``: what needs them is not assessed."""

    def __post_init__(self) -> None:
        check_order(getattr(self, "phases", ()))
        self.own_error()

    def subjects(self) -> tuple[str, ...]:
        """The person."""
        return (self.human,)

    def own_error(self) -> Accuracy | None:
        """Accuracy of each angle [rad] that the rule itself was given; None when it was not."""
        return accuracy_of(self.accuracy, self.joint_accuracy)

    def error(self, model: Model) -> Accuracy | None:
        """Accuracy of each angle [rad]: the rule's own, else the worst of the devices that see the person.

        None when nobody knows one.
        """
        own = self.own_error()
        return captured_accuracy(model, self.human) if own is None else own


class ScoredPosture(PostureRule, frozen=True, kw_only=True):
    """Base of the rules that score the parts of the body and look the total up in tables: RULA, REBA."""

    METHOD: ClassVar[Method]
    PHASE: ClassVar[type[Phase]]
    weighs_hands: ClassVar[bool] = True
    REPEATED: ClassVar[int]
    """Movements per minute from which on work is repeated."""

    thresholds: Thresholds = Thresholds()
    """Where a posture counts as twisted, raised, upright and so on."""
    arm: ArmPolicy = ArmPolicy.PROJECTION
    """Which angle stands for the flexion of an upper arm."""
    detect: WorkDetection | None = None
    """Find static and repeated work in the movement, where no phase enters it."""

    @property
    def limit(self) -> int | None:
        """Greatest admissible score."""
        level = getattr(self, "action_level", None)
        return None if level is None else self.METHOD.levels[level - self.METHOD.first_level]

    @property
    def levels(self) -> tuple[Level, ...]:
        """Action levels, the lowest first."""
        return self.METHOD.classes

    @property
    def static(self) -> float:
        """How long a posture is held to be static [s]."""
        raise NotImplementedError

    def components(
        self,
        angles: Angles,
        phase: Phase,
        accuracy: Accuracy = 0.0,
        watch: WorkMonitor | None = None,
        handled: Handled = NOTHING,
    ) -> dict[str, Span]:
        """Component scores of postures in a phase, in the order of the method.

        Args:
            angles: Of the postures.
            phase: What was entered.
            accuracy: Of each angle [rad].
            watch: What was found of static and repeated work so far.
            handled: What the hands hold now.

        Returns:
            Shapes (..., 2) of sided components and (...) of central ones.
        """
        raise NotImplementedError

    def entered(self, model: Model) -> tuple[Phase, ...]:
        """Phases of the rule, or else those that every rule shares."""
        own: tuple[Phase, ...] = getattr(self, "phases", ())
        return shared_phases(model, self.human, own, self.PHASE.from_task)

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes scores."""
        read, held = bind_posture(model, self.human, self.unmeasured), bind_handled(model, self.human)
        phases, unknown, error = self.entered(model), self.PHASE(), self.error(model)
        watch = (
            None if self.detect is None else WorkMonitor(self.detect, hold=self.static, count=self.REPEATED)
        )
        if watch is not None and self.every is not None and self.every > GAP:
            raise InputError.at(
                self.name,
                "every",
                f"{self.every:g} s is too seldom to see static and repeated work",
                f"at most {GAP:g} s, or none",
            )

        bands = None
        if watch is None and ArmPolicy(self.arm) is ArmPolicy.PROJECTION:
            bands = Bands(self.METHOD.edges(self.thresholds), self.thresholds, error)
        known = dict[tuple[tuple[int, ...], int, Handled], Figure]()
        """By the bands of a posture, the phase and what is held."""

        def scored(handled: Handled, angles: Angles, phase: Phase) -> Figure:
            cells = None if bands is None or angles.trunk_flexion.ndim else bands.of(angles)
            found = None if cells is None else known.get((cells, id(phase), handled))
            if found is not None:
                return of_posture(found, angles)
            measured = self.components(angles, phase, watch=watch, handled=handled)
            spread = None if error is None else self.components(angles, phase, error, watch, handled)
            found = score(self.METHOD, angles, measured, spread, self.limit)
            if cells is not None:
                if len(known) == MOST_SCORES:
                    known.clear()
                known[cells, id(phase), handled] = of_posture(found, None)  # phases live as long
            return found

        def compute(twin: Twin) -> Figure:
            angles = read(twin)
            if watch is not None:
                watch.add(float(twin.t), angles)
            return by_phase(twin.t, angles, phases, unknown, partial(scored, held(twin)))

        return compute

    def present(self, model: Model) -> Present:
        """Return the function that says and colours what drives the score."""

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            return shown(
                self.METHOD, figure, verdict, limit=self.limit, human=self.human, thresholds=self.thresholds
            )

        return present

    def one_by_one(self, model: Model) -> str:
        """Say so of what is found in the movement so far."""
        return "" if self.detect is None else "static and repeated work is found as it happens"

    def based(
        self,
        model: Model,
        *,
        formula: str,
        source: str,
        not_modelled: tuple[str, ...],
        options: tuple[Input, ...] = (),
    ) -> Basis:
        """The basis, with the inputs and limits that rules of this sort share.

        Args:
            model: The compiled workstation.
            formula: Of the score.
            source: Of the tables, with how sure they are.
            not_modelled: What the rule leaves out.
            options: Of this rule alone.
        """
        return Basis(
            formula=formula,
            source=source,
            inputs=(
                *provenance.motion(model, self.human),
                *options,
                *entered(self.entered(model), self.PHASE()),
                *watched(self.detect, self.static, self.REPEATED),
                *choices(self.thresholds, self.arm),
                *posture_quality(self.accuracy, self.joint_accuracy, self.unmeasured, model, self.human),
                *(() if self.limit is None else provenance.limit(self.limit, "")),
            ),
            not_modelled=(
                *not_modelled,
                PROJECTION_NOTE,
                *((ACCURACY_NOTE,) if self.error(model) is not None else ()),
            ),
        )
