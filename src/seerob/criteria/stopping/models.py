"""How a robot stops, as the workstation file says it: which model gives the ways while it stops."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import replace

from seerob.core.errors import InputError, Undecided
from seerob.core.snapshot import Input, Origin
from seerob.core.tolerances import Shifts
from seerob.core.transforms import Array
from seerob.criteria.stopping import table as stopping_table
from seerob.criteria.stopping.by_energy import bind_braked, bind_braked_in_span
from seerob.criteria.stopping.by_table import (
    InSpan,
    Stopping,
    bind_in_span,
    bind_table,
    impossible,
    other_robot_reason,
)
from seerob.criteria.stopping.onset import At as OnsetAt
from seerob.criteria.stopping.onset import Onset, by_speed
from seerob.criteria.stopping.reaction import GIVE, Reactions, bind_reaction, bind_riders, joint_limits
from seerob.criteria.stopping.simulated import Stopped, StopSimulation
from seerob.criteria.stopping.table import StoppingTable
from seerob.criteria.stopping.terms import (
    BOUND,
    CONSTANT,
    At,
    Braking,
    Course,
    braking,
    largest_factor,
    largest_speed_decelerating,
    largest_speed_in_time,
)
from seerob.distance.least import Per
from seerob.kernels.pull import greatest
from seerob.kernels.separation import TimedStop, largest_factor_in_time
from seerob.model.model import Gap, Mechanism, Model
from seerob.twin.moving_base import first_moving
from seerob.twin.state import State

MOST_OFF = 3
"""So many masses may be off in a simulated stop: every corner of their tolerances is one more."""
SHARE = 0.8
"""Share of the torque limits that is used, unless the file says otherwise."""
SHARES = {"bound": BOUND, "constant_deceleration": CONSTANT}
"""Share of v_r T_s that is travelled, by how a stop is modelled whose time is known."""
STEADY = 1e-3
"""Speeds of joints that differ by less during the reaction time are the same [rad/s or m/s]."""
MOVING = 1e-6
"""Speed above which a robot moves [m/s]."""
FASTEST = f"if the robot is as fast as it can be during the reaction time: {GIVE}, or acceleration_limits"
"""When ways are up to those of the reaction at its worst, in words."""
NOISY = "by the noise of positions that speeds are derived from"
"""When ways may be longer because speeds may be off, in words."""
INSTANTS = 16
"""At most this many instants of a stop are asked for their distance to the person."""


class StopTolerance(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How far figures of a stop may be off, either way."""

    reaction: Annotated[float, Meta(ge=0, extra={"unit": "s"})] = 0.0
    stopping: Annotated[float, Meta(ge=0, extra={"unit": "s"})] = 0.0
    deceleration: Annotated[float, Meta(ge=0, extra={"unit": "m/s²"})] = 0.0


class Stop(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the robot stops."""

    reaction: Annotated[float, Meta(gt=0, extra={"unit": "s"})]
    """T_r: from the event to the onset of braking, detection and processing included [s]; without the
    response time of a ``sensor`` that the criterion names, which is added."""
    stopping: Annotated[float, Meta(gt=0, extra={"unit": "s"})] | None = None
    """T_s: from the onset of braking to standstill [s]; with a table, of the joints that it does not have."""
    model: Literal["bound", "constant_deceleration", "table", "simulated"] = "bound"
    """``bound``: full speed during the whole stop, Eq. 2; ``constant_deceleration``: half of that;
    ``table``: the maker's stopping tables; ``simulated``: the dynamics with all brakes on."""
    deceleration: Annotated[float, Meta(gt=0, extra={"unit": "m/s²"})] | None = None
    """Deceleration of the fastest point [m/s²], instead of ``stopping``, with ``constant_deceleration``."""
    table: str | StoppingTable | None = None
    """Name of a table that comes with seerob (`table.shipped`), or the table itself."""
    table_for: str | None = None
    """Name of the robot that the table is that of, by your own word; without it, a table that is not of the
    robot's ``model`` leaves what it would keep within undecided."""
    rated_payload: Annotated[float, Meta(gt=0, extra={"unit": "kg"})] | None = None
    """Payload at which the table's figures hold [kg], from the robot's data sheet, for a table that does not
    say; refused beside one that does."""
    brakes: Annotated[tuple[Annotated[float, Meta(gt=0)], ...], Meta(extra={"unit": "N·m"})] | None = None
    """Torque of each joint's brake [N·m or N] with ``simulated``; ``torque_share`` of the robot's torque
    limits when not given."""
    torque_share: Annotated[float, Meta(gt=0, le=1)] = SHARE
    """Share of the torque limits that brakes, with ``simulated``."""
    direction: Literal["path", "toward"] = "path"
    """With ``simulated``: whole path of the part, or how much nearer to the person it comes."""
    acceleration: Annotated[float, Meta(ge=0, extra={"unit": "m/s²"})] | None = None
    """How fast any point of the robot may get faster during the reaction time [m/s²]; 0 where your safety
    controller sees to it. When not given: what a motion from a file is known to do; of a live robot the
    ``acceleration_limits`` of its table; else all of its ``velocity_limits`` at once, and between that and no
    acceleration the verdict is undecided. Where the robot's own motion contradicts what is given, nothing
    that rests on it is within until it is corrected or confirmed."""
    tolerance: StopTolerance | None = None
    """How far ``reaction``, ``stopping`` and ``deceleration`` may be off, either way."""

    def __post_init__(self) -> None:
        for key in StopTolerance.__struct_fields__ if self.tolerance is not None else ():
            half, figure = getattr(self.tolerance, key), getattr(self, key)
            if half and (figure is None or half >= figure):
                what = "is not given" if figure is None else f"= {figure:g} is not more"
                raise ValueError(f"tolerance.{key} = {half:g}, but {key} {what}")
        needs = {
            "bound": self.stopping is not None,
            "constant_deceleration": (self.stopping is None) != (self.deceleration is None),
            "table": self.table is not None,
            "simulated": True,
        }
        wanted = {
            "bound": "stopping",
            "constant_deceleration": "either stopping or deceleration",
            "table": "table",
        }
        if not needs[self.model]:
            raise ValueError(f'model = "{self.model}" needs {wanted[self.model]}')
        idle = {
            "deceleration": self.deceleration is not None and self.model != "constant_deceleration",
            "table": self.table is not None and self.model != "table",
            "table_for": self.table_for is not None and self.model != "table",
            "rated_payload": self.rated_payload is not None and self.model != "table",
            "stopping": self.stopping is not None and self.model == "simulated",
            "brakes": self.brakes is not None and self.model != "simulated",
            "torque_share": self.torque_share != SHARE
            and (self.model != "simulated" or self.brakes is not None),
            "direction": self.direction != "path" and self.model != "simulated",
        }
        for name, there in idle.items():
            if there:
                raise ValueError(f'{name} does nothing with model = "{self.model}" as it is given')


Courses = Callable[[State], At]
"""Course of the moving parts from where they are now; may raise `Undecided`."""


Inverse = Callable[[Onset, Onset, Array, Array, float], tuple[float, float | None]]
"""Largest permissible speed of the fastest part [m/s], and as a factor of the present speeds (None at rest),
from the onsets at rest and at the present speeds, distances [m] (n,), approach speeds of the person [m/s]
(n,) and K [m]."""


class StopModel(Struct, frozen=True, eq=False):
    """A way to stop, bound to a robot and what it is to keep away from."""

    courses: Courses
    reactions: Reactions
    """What it does before it brakes."""
    formula: str
    """Formula of S_s."""
    inputs: tuple[Input, ...]
    undecided_reasons: tuple[str, ...] = ()
    """Why ways may be longer than it says."""
    not_modelled: tuple[str, ...] = ()
    inverse: Inverse | None = None
    """In closed form, where there is one."""
    by_speed: Callable[[Array], Course] | None = None
    """The course of parts of given speeds [m/s] that are held, or get faster as given, where nothing else
    counts; never shorter for higher ones."""
    in_span: InSpan | None = None
    """The longest course that begins within a span, where that follows from the joints."""
    lasts: bool = False
    """Whether what is known ahead is in a course: then it is that of the whole tick that begins with it."""
    costly: bool = False
    """Takes milliseconds: searches ask it seldom."""
    in_time: tuple[float, float] | None = None
    """How long it takes to stop [s], and the share of speed times that which is travelled, where both are
    given and nothing else counts."""


class _Brakes(Struct, frozen=True, eq=False):
    """How a robot brakes, whatever it did before."""

    braking: Braking
    formula: str
    inputs: tuple[Input, ...]
    undecided_reasons: tuple[str, ...] = ()
    not_modelled: tuple[str, ...] = ()
    by_onset: Callable[[Onset], Course] | None = None
    """Course by the onset of braking alone; None where other things count, too."""
    in_span: InSpan | None = None
    timed: bool = False
    costly: bool = False
    more: str = ""
    """When ways are up to those of `Course.most`, in words; empty where they have none."""


def bind_stop(stop: Stop, model: Model, robot: Mechanism, gap: Gap) -> StopModel:
    """Resolve how a robot stops.

    Args:
        stop: As the file says.
        model: The workstation.
        robot: Who stops.
        gap: From what it is to keep away (first set) to its moving parts (second set).

    Raises:
        InputError: Options that do not fit the robot.
        UnknownName: No such table.
    """
    if stop.model not in SHARES and robot.role == "machine":
        what = f"{stop.model}, but {robot.name} is a machine, whose stop only a time or a deceleration tells"
        raise InputError.at("stop", "model", what, "bound or constant_deceleration")
    bind = {"table": _tabulated, "simulated": _simulated}.get(stop.model, _timed)
    found = bind(stop, model, robot, gap)
    if not found.timed and robot.riders:
        found = replace(found, braking=_while_riders_rest(found.braking, model, robot))
    if not found.timed and robot.on:
        unbounded_reason = (
            f"{robot.on}, which carries {robot.name}, has a way to stop of its own that is not in it"
        )
        found = replace(found, undecided_reasons=(*found.undecided_reasons, unbounded_reason))
    by_onset, given = found.by_onset, by_speed(stop.reaction, stop.acceleration or 0.0)
    asked, how = bind_reaction(
        model, robot, gap, stop.reaction, stop.acceleration,
        points=stop.model != "simulated", joints=not found.timed,
    )  # fmt: skip
    carries = stop.acceleration is None and bool(robot.riders)
    by_themselves = bind_riders(model, robot, gap, stop.reaction) if carries else None

    def reactions(state: State) -> tuple[OnsetAt, OnsetAt | None]:
        found: tuple[OnsetAt, OnsetAt | None] = state.once(("onset", asked), lambda: asked(state))
        return found

    def with_most(state: State, course: Course, top: Course | None) -> Course:
        """Add what it is at most, where that is more: after another onset, or by how it brakes."""
        if top is None and course.most is None:
            return course
        why = [] if top is None else [NOISY if _noisy(state, model, robot) else FASTEST]
        top = course if top is None else top
        why += [found.more] * (top.most is not None)
        return replace(course, most=top.most or top, more="; ".join(why))

    def courses(state: State) -> At:
        least, most = reactions(state)
        brake: Callable[[Onset, float], Course] | None = None
        why = ""
        try:
            brake = found.braking(state)
        except Undecided as reason:
            why = str(reason)

        def after(onset: Onset, scale: float) -> Course:
            try:
                if brake is not None:
                    return brake(onset, scale)
                unbounded = (onset.unbounded_reason, why)
            except Undecided as reason:
                unbounded = (onset.unbounded_reason, str(reason))
            # It reacts before it brakes: so far it gets whatever the stop is like.
            least = np.zeros_like(onset.S_r)
            return Course(onset.v_r, onset.S_r, least, 0.0, "; ".join(filter(None, unbounded)))

        if by_themselves is None:
            return lambda scale: with_most(
                state, after(least(scale), scale), most and after(most(scale), scale)
            )
        ways, restless, who = by_themselves(state)
        # Who stops within a stroke takes no longer than with the given deceleration over all of it.
        longer = (
            0.0 if stop.deceleration is None else math.sqrt(2 * ways.max(initial=0.0) / stop.deceleration)
        )

        def at(scale: float) -> Course:
            course = with_most(state, after(least(scale), scale), most and after(most(scale), scale))
            if not (restless or ways.any()):
                return course
            top = course.most or course
            unbounded = "; ".join(filter(None, (top.unbounded_reason, restless)))
            top = replace(top, S_r=top.S_r + ways, T_s=top.T_s + longer, unbounded_reason=unbounded)
            stroke = f"if {who} goes all of its stroke: {GIVE}" if ways.any() else ""
            return replace(course, most=top, more="; ".join(filter(None, (course.more, stroke))))

        return at

    return StopModel(
        courses,
        reactions,
        found.formula,
        (*found.inputs, how),
        found.undecided_reasons,
        found.not_modelled,
        _inverse(stop) if found.timed and not carries else None,
        None if by_onset is None else lambda v: by_onset(given(v)),
        found.in_span,
        stop.acceleration is None,
        found.costly,
        (stop.stopping, SHARES[stop.model]) if found.timed and stop.stopping and not carries else None,
    )


def _noisy(state: State, model: Model, robot: Mechanism) -> bool:
    """Whether speeds of a robot, of what rides on it or of what carries it may be off by noise."""
    if not state.speed_errors:
        return False
    everybody = (robot.name, *robot.riders, *model.carriers_of(robot.name))
    return not state.speed_errors.keys().isdisjoint(everybody)


def _while_riders_rest(braking: Braking, model: Model, robot: Mechanism) -> Braking:
    """Raise `Undecided` while a machine on the robot moves: nobody knows its own way to stop."""
    riders = [model.mechanisms[name] for name in robot.riders]

    def at(state: State) -> Callable[[Onset, float], Course]:
        state.require(*robot.riders)
        if name := first_moving(state, riders):
            raise Undecided(f"{name} moves on {robot.name}, and its own way to stop is not known")
        return braking(state)

    return at


def _given(name: str, value: float, unit: str) -> Input:
    return Input(name=name, value=value, unit=unit, origin=Origin.GIVEN, source="workstation file")


def _timed(stop: Stop, model: Model, robot: Mechanism, gap: Gap) -> _Brakes:
    share, a = SHARES[stop.model], stop.deceleration
    T_s = math.nan if stop.stopping is None else stop.stopping

    def after(onset: Onset) -> Course:
        return braking(onset, T_s if a is None else float(onset.v_s.max()) / a, share)

    def bound(state: State) -> Callable[[Onset, float], Course]:
        return lambda onset, scale: after(onset)

    known = _given("T_s", T_s, "s") if a is None else _given("deceleration", a, "m/s²")
    if share == BOUND:
        left_out = "deceleration during the stop: full speed is assumed until standstill"
        return _Brakes(bound, "S_s = v_s T_s", (known,), not_modelled=(left_out,), by_onset=after, timed=True)
    left_out = (
        "a deceleration that sets in late or is uneven: published tables have joints that travel more "
        "than half of speed times time (up to 0.51)"
    )
    formula = "S_s = v_s T_s / 2" + ("" if a is None else ", T_s = v_s / a of the fastest point")
    return _Brakes(bound, formula, (known,), not_modelled=(left_out,), by_onset=after, timed=True)


def _inverse(stop: Stop) -> Inverse:
    """Largest factor of the present speeds in closed form, where a stop's time or deceleration is given."""
    share, a, T_r = SHARES[stop.model], stop.deceleration, stop.reaction
    T_s = math.nan if stop.stopping is None else stop.stopping

    def at(rest: Onset, now: Onset, d: Array, v_h: Array, K: float) -> tuple[float, float | None]:
        top = float(greatest(now.v_r))
        if top < MOVING:
            # At rest nobody knows which part will be fastest: each may be.
            more, faster = now.S_r - now.v_r * T_r, now.v_s - now.v_r
            if a is None:
                left = d - more - share * faster * T_s
                return float(largest_speed_in_time(left, v_h, T_r, T_s, K, share).min()), None
            # The speed at which it begins to brake is larger by what it gains until then.
            gained = float(faster.max())
            speeds = largest_speed_decelerating(d + gained * T_r - more, v_h, T_r, a, K)
            return max(float(speeds.min()) - gained, 0.0), None
        if a is None:
            factor = largest_factor_in_time(
                d, v_h, rest.S_r, now.S_r, rest.v_s, now.v_s, TimedStop(T_r, T_s, share), K
            )  # fmt: skip
        else:
            S_0, S_1 = rest.S_r, now.S_r - rest.S_r
            v_0, v_1 = rest.v_s, now.v_s - rest.v_s
            t_0 = float(v_0.max())
            t_1 = float(now.v_s.max()) - t_0
            factor = largest_factor(
                v_h * (T_r + t_0 / a) + K - d + S_0 + share * v_0 * t_0 / a,
                v_h * t_1 / a + S_1 + share * (v_0 * t_1 + v_1 * t_0) / a,
                share * v_1 * t_1 / a,
            )
        return factor * top, factor

    return at


def _tabulated(stop: Stop, model: Model, robot: Mechanism, gap: Gap) -> _Brakes:
    table = stopping_table.table(stop.table) if isinstance(stop.table, str) else stop.table
    if table is None:
        raise InputError.at("stop", "table", "not given", "the name of a table, or a table")
    if stop.table_for is not None and stop.table_for != robot.name:
        raise InputError.at("stop", "table_for", f"{stop.table_for} does not stop here", robot.name)
    if stop.rated_payload is not None and table.rated_payload is not None:
        what = f"{stop.rated_payload:g} kg, and the table of {table.robot} says {table.rated_payload:g} kg"
        raise InputError.at("stop", "rated_payload", what, "leave it out: the table's own holds")
    unbounded_reason = other_robot_reason(table, model, robot) if stop.table_for is None else ""
    undecided_reasons = (unbounded_reason, *impossible(table, robot))

    def bind(after: Stopping) -> InSpan | None:
        if stop.acceleration:
            return None
        held, limits = stop.acceleration == 0, joint_limits(model, robot)
        return bind_in_span(model, robot, gap, after, T_r=stop.reaction, held=held, limits=limits)

    by_table, by_onset, inputs, in_span = bind_table(
        table, stop.stopping, model, robot, gap, rated_payload=stop.rated_payload, bind=bind
    )
    source = f"{table.source} ({table.confidence})" + (f"; {table.note}" if table.note else "")
    named = Input(name="stopping table", value=table.robot, origin=Origin.STATED, source=source)
    rest = () if stop.stopping is None else (_given("T_s of joints without a table", stop.stopping, "s"),)
    if stop.table_for is not None:
        said = Input(
            name="stopping table is of", value=robot.name, origin=Origin.GIVEN, source="workstation file"
        )
        rest = (said, *rest)
    formula = (
        "S_s = v_s T_s(v_s)"
        if table.tool is not None
        else "S_s from each joint's way times its lever, T_s the longest"
    )
    return _Brakes(
        by_table,
        formula,
        (named, *inputs, *rest),
        undecided_reasons=tuple(filter(None, undecided_reasons)),
        not_modelled=(
            f"stop category {table.category} only, as tabulated",
            "below the table's first speed, payload and extension its first stopping time holds"
            + ("" if table.tool is not None else ", and the lesser of its first way and speed times time"),
        ),
        by_onset=by_onset,
        in_span=in_span,
    )


def _simulated(stop: Stop, model: Model, robot: Mechanism, gap: Gap) -> _Brakes:
    brakes, origin, source = _brakes(stop, robot)
    unknown = [joint.name for joint, torque in zip(robot.joints, brakes, strict=True) if np.isnan(torque)]
    simulation = StopSimulation(model, robot, brakes, gap.b)
    masses = simulation.masses
    followed = not masses.moved and len(masses) <= MOST_OFF
    corners = [*product((-1, 1), repeat=len(masses))] if followed and len(masses) else []
    loose = f"{', '.join(map(str, masses.tolerances))} not followed in a simulated stop"
    by_energy = None if followed or unknown else bind_braked(model, robot, gap, brakes, T_r=stop.reaction)

    def bound(state: State) -> Callable[[Onset, float], Course]:
        if unknown:
            raise Undecided(f"{robot.name}: nobody gave the torque limit of {', '.join(unknown)}")

        def once(onset: Onset, scale: float, known: tuple[Array, Array] | None, shifts: Shifts) -> Course:
            stopped = simulation.stop(state, stop.reaction, scale, known, shifts)
            found = stopped.course()
            if _noisy(state, model, robot):
                why = f"the noise of positions that speeds of {robot.name} are derived from is not followed"
                onset = replace(
                    onset, unbounded_reason=onset.unbounded_reason or f"{why} in a simulated stop"
                )
            S_r = np.maximum(found.S_r, onset.S_r)
            if stop.direction == "path":
                return Course(found.v_r, S_r, found.S_s, found.T_s, onset.unbounded_reason)
            nearer = approach(stopped, state, gap)
            # S_r and S_s only count together; neither may be larger than its path.
            S_r = np.minimum(S_r, nearer)
            return Course(found.v_r, S_r, nearer - S_r, found.T_s, onset.unbounded_reason)

        def weighing(onset: Onset, scale: float, shifts: Shifts) -> Course:
            held = once(onset, scale, None, shifts)
            if onset.q is None or onset.qd is None or not np.abs(onset.qd - state.qd(robot)).max() > STEADY:
                return held
            # A stop that begins sooner begins at the present speeds.
            later = once(onset, scale, (onset.q, onset.qd), shifts)
            return Course(
                held.v_r,
                np.maximum(held.S_r, later.S_r),
                np.maximum(held.S_r + held.S_s, later.S_r + later.S_s) - np.maximum(held.S_r, later.S_r),
                max(held.T_s, later.T_s),
                onset.unbounded_reason,
            )

        def at(onset: Onset, scale: float) -> Course:
            every = [weighing(onset, scale, shifts) for shifts in ((), *corners)]
            if by_energy is not None:
                u = np.abs(scale * state.qd(robot))
                if onset.qd is not None:
                    u = np.maximum(u, np.abs(onset.qd))
                return _bounded(every[0], onset, by_energy(state, u), loose)
            if not corners:
                return every[0]
            least, most = (_each(ends, every) for ends in (np.min, np.max))
            return replace(least, most=most)

        return at

    # Of a positive acceleration such a stop knows nothing.
    known = not (unknown or stop.acceleration)
    shown = ", ".join("?" if np.isnan(b) else f"{b:g}" for b in brakes)
    inputs = (Input(name="brake torques", value=shown, unit="N·m or N", origin=origin, source=source),)
    way = "whole path" if stop.direction == "path" else "loss of distance to where the person is now"
    return _Brakes(
        bound,
        f"S_r + S_s: {way} from M q̈ + c + g = τ, |τ_j| ≤ B_j against q̇_j, until standstill",
        inputs,
        undecided_reasons=(
            *(
                ()
                if robot.rotor_inertia_known
                else (f"{robot.name}: rotor inertia is not given, so the simulated stop may be too short",)
            ),
            *((loose,) * (not followed and by_energy is None)),
        ),
        not_modelled=(
            *(("masses between the ends of their tolerances: only the ends are asked",) * bool(corners)),
            "joint friction, damping and mechanical stops, which would shorten the stop",
            "brakes that act late or one after the other: their delay belongs into the reaction time",
        ),
        in_span=bind_braked_in_span(model, robot, gap, brakes, T_r=stop.reaction, held=stop.acceleration == 0)
        if known
        else None,
        costly=True,
        more=f"if masses are off: {', '.join(map(str, masses.tolerances))}" if corners or by_energy else "",
    )


def _bounded(found: Course, onset: Onset, most: Course | None, reason: str) -> Course:
    """A course of masses as given, up to a bound for all that tolerances allow."""
    if most is None:
        return replace(found, unbounded_reason=found.unbounded_reason or reason)
    # What comes nearer in all is no more than the way.
    S_r, S_s = np.maximum(most.S_r, onset.S_r), np.maximum(most.S_s, found.S_s)
    return replace(found, most=Course(found.v_r, S_r, S_s, max(most.T_s, found.T_s), found.unbounded_reason))


def _each(ends: Callable[..., Array], courses: Sequence[Course]) -> Course:
    """The least or the largest of every term of courses that begin alike, each by itself."""
    terms = ([getattr(course, name) for course in courses] for name in ("S_r", "S_s"))
    S_r, S_s = (np.asarray(ends(term, axis=0)) for term in terms)
    return Course(
        courses[0].v_r, S_r, S_s, float(ends([c.T_s for c in courses])), courses[0].unbounded_reason
    )


def _brakes(stop: Stop, robot: Mechanism) -> tuple[Array, Origin, str]:
    """Torques, NaN where unknown, and where they come from."""
    if stop.brakes is not None:
        if len(stop.brakes) != len(robot.joints):
            raise InputError.at(
                "stop",
                "brakes",
                f"{len(stop.brakes)} torques for the {len(robot.joints)} joints of {robot.name}",
                "one per joint",
            )
        return np.array(stop.brakes), Origin.GIVEN, "workstation file"
    limits = robot.effort_limits
    torques = np.array([np.nan if limit is None else stop.torque_share * limit.value for limit in limits])
    sources = "; ".join(dict.fromkeys(limit.source for limit in limits if limit is not None))
    missing = bool(np.isnan(torques).any())
    source = f"{stop.torque_share:g} of the torque limits ({sources or 'not given'})"
    return torques, Origin.MISSING if missing else Origin.ESTIMATED, source


def approach(stopped: Stopped, state: State, gap: Gap) -> Array:
    """How much nearer each part comes while it stops to what stands still where it is now [m], (n,).

    A bound for all instants: between two of them a distance changes by no more than the path.
    """
    K = len(stopped.t)
    picked = np.unique(np.linspace(0, K - 1, min(K, INSTANTS)).round().astype(int))
    R, x = state.placed(gap.a, allow_estimated=True)
    rotations = np.repeat(R[None], len(picked), axis=0)
    positions = np.repeat(x[None], len(picked), axis=0)
    rotations[:, gap.b] = stopped.rotations[picked]
    positions[:, gap.b] = stopped.positions[picked]
    distances = gap.query.batch(rotations, positions, Per.BODY).distance
    reached = np.vstack([np.zeros(len(gap.b)), np.cumsum(stopped.ways, axis=0)])[picked]
    between = (distances[:-1] + distances[1:] - np.diff(reached, axis=0)) / 2
    least = np.minimum(distances.min(axis=0), between.min(axis=0, initial=np.inf))
    return np.asarray(np.maximum(distances[0] - least, 0.0))
