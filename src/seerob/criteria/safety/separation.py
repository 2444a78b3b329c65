r"""Protective separation distance, ISO/TS 15066:2016 5.5.4.2.3; upper bound: [Weistroffer2022]_ Eq. 2."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, cast

import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import replace

from seerob.core import figures
from seerob.core.domains import at_least, number
from seerob.core.errors import InputError, Undecided
from seerob.core.snapshot import Basis, Input, Origin, Result
from seerob.core.tolerances import Shifts, Spread, Tolerance, deciding
from seerob.core.transforms import Array
from seerob.core.verdict import Verdict
from seerob.criteria.body_parts import BodyPlaces, partly_seen
from seerob.criteria.criterion import Claim, Criterion, Evaluate, Follows, Moment
from seerob.criteria.figure import Compute, Figure, Parts, Present, Shown, Twin, result_of, verdict_of
from seerob.criteria.noisy_speeds import others_noisy
from seerob.criteria.plan import Whole
from seerob.criteria.sensors.detection import Detection, device_of
from seerob.criteria.stopping import many_instants
from seerob.criteria.stopping.models import MOVING, NOISY, Stop, StopModel, bind_stop
from seerob.criteria.stopping.onset import LARGEST_WINDOW
from seerob.criteria.stopping.planned import OneOf, Stops, faster, line, permissible, terms
from seerob.criteria.stopping.reaction import joint_limits
from seerob.criteria.stopping.required import (
    SIMULATED,
    TOP,
    LargestSeparation,
    SeparationEnds,
    approach_speed,
    factor_by_search,
    intrusion,
    shifted,
    tolerances,
)
from seerob.criteria.stopping.stated_acceleration import JointAccelerations, StatedAcceleration
from seerob.criteria.stopping.terms import At, Course, assumed_speed, way_of_person
from seerob.description.norms.iso_13855 import REACHING, WALKING
from seerob.distance.least import Closests
from seerob.kernels.separation import (
    HumanSpeed,
    TimedStop,
    approach_speeds,
    lost_in_time,
    rise,
    separation,
    separations,
)
from seerob.kernels.spans import Indices, greatest
from seerob.model import provenance
from seerob.model.model import Gap, Model
from seerob.twin.accuracy.distance_ends import DistanceEnds
from seerob.twin.accuracy.tracking_error import tracking
from seerob.twin.spans import ROUNDING, UNBOUNDED, Fall, Falls, Margin, Points, Span, rows_of
from seerob.twin.state import State
from seerob.twin.states import States

__all__ = ["Detection", "Separation", "Stop", "separation_bound"]


_WITHIN, _UNDECIDED = Verdict.WITHIN, Verdict.UNDECIDED
CLOSE = 1e-4
"""A rise of S_p between ticks that is not looked into [m]; our choice, a tenth of the tolerance to which
`seerob.session.permissible.between_samples` bounds distances."""
MORE = "S_p may be larger by"
"""Name of the part of a result that says so; there is none where S_p is known."""


class Required(NamedTuple):
    """S_p of each moving part."""

    S_p: Array
    """What is sure from below, of the speeds as they are known [m], shape (n,)."""
    most: Array
    """A bound from above [m], shape (n,)."""
    unbounded_reason: str
    """Why it may be still more; empty when it may not."""


class _Shared(NamedTuple):
    """What questions about parts of a gap share."""

    unknown_ever: str
    """Why S_p may always be larger than what is computed; empty when it may not."""
    largest: tuple[LargestSeparation, LargestSeparation]
    ends: SeparationEnds
    tops: Mapping[Shifts, Array]
    """By which ends of the inputs, the bound on S_p from above that was asked last [m], shape (n,)."""


class _Found(Struct, frozen=True, eq=False):
    """What distances and S_p at one instant follow from."""

    stop: StopModel
    found: Closests
    course: At
    now: Course
    seen: tuple[float, float]
    """Speed of the person as it is known, and as it may be [m/s]."""
    stray: str
    S_p: Array
    """Protective separation distance as shown [m], shape (n,)."""
    most: Array
    """A bound on it from above, likewise."""
    unbounded_reason: str
    span: Spread | None
    """Ends of S_p by its tolerances."""
    near: Array
    """Least distances of the parts [m], shape (n,)."""
    far: Array
    """Largest, likewise."""


def room_ends(
    near: Array, far: Array, S_p: Array, more: Array, low: Array, high: Array
) -> tuple[Array, Array]:
    """Ends of distances, with what S_p may be off put on their side [m], shape (n,) each.

    Args:
        near: Least distances [m], shape (n,), as all others.
        far: Largest distances [m].
        S_p: As given [m].
        more: What acceleration and noise may add to it [m].
        low: Least end of S_p by its tolerances [m].
        high: Largest end [m].
    """
    return (near - more) - (high - S_p), far + (S_p - low)


def separation_bound(v_r: Array, v_h: float, T_r: float, T_s: float, xi: float) -> Array:
    r"""Upper bound of the protective separation distance, Eq. 2.

    :math:`S_p \le v_r (T_r + T_s) + v_h (T_r + T_s) + \xi`.

    Args:
        v_r: Speed of the hazardous part [m/s], shape (...); not below 0.
        v_h: Speed of the person [m/s].
        T_r: Reaction time [s].
        T_s: Stopping time [s].
        xi: Intrusion distance and position uncertainties, C + Z_d + Z_r [m].

    Returns:
        S_p [m], shape (...).
    """
    person, time = number("v_h", v_h, 0, unit="m/s"), number("T_r", T_r, 0, unit="s")
    time = time + number("T_s", T_s, 0, unit="s")
    return (np.maximum(v_r, 0.0) + person) * time + number("xi", xi, 0, unit="m")


class Separation(Criterion, frozen=True, kw_only=True):
    """Speed and separation monitoring: every moving part of a robot or machine against the person."""

    unit: ClassVar[str] = "m"
    by_speed: ClassVar[bool] = True
    whole: ClassVar[bool] = False
    at_most: ClassVar[bool] = False

    between: tuple[str, str]
    """A robot or a machine, and a human. What carries it counts with it."""
    stop: Stop
    mode: Literal["dynamic", "fixed"] = "dynamic"
    """S_p of the present speeds, or the largest that occurred so far."""
    human_speed: Annotated[float, Meta(gt=0, extra={"unit": "m/s"})] | None = None
    """v_h [m/s]; when not given, that of ISO 13855 for a person whose speed is not monitored:
    2 m/s where that leads to S_p of 0.5 m or less, above 1.6 m/s but S_p not below 0.5 m."""
    intrusion: Annotated[float, Meta(ge=0, extra={"unit": "m"})] | None = None
    """C: how far a person may reach in before being detected [m], ISO 13855."""
    detection: Detection | None = None
    """Instead of ``intrusion``: what C follows from."""
    sensor: str | None = None
    """An entry of ``[[sensors]]`` that detects the person: its response time is added to ``stop.reaction``,
    and its detection capability and height give C unless ``intrusion`` does."""
    human_uncertainty: Annotated[float, Meta(ge=0, extra={"unit": "m"})] | None = None
    """Z_d: uncertainty of the person's position [m]."""
    robot_uncertainty: Annotated[float, Meta(ge=0, extra={"unit": "m"})] | None = None
    """Z_r: uncertainty of the robot's position [m]."""
    human_speed_tolerance: Annotated[float, Meta(ge=0, extra={"unit": "m/s"})] = 0.0
    """How far `human_speed` may be off, either way [m/s]."""
    intrusion_tolerance: Annotated[float, Meta(ge=0, extra={"unit": "m"})] = 0.0
    """How far C may be off, given or from a device, either way [m]; C is never below 0."""

    def __post_init__(self) -> None:
        if self.human_speed_tolerance and self.human_speed_tolerance >= (self.human_speed or 0.0):
            raise ValueError("human_speed_tolerance is of a human_speed that is larger: give that")
        if self.intrusion_tolerance and not any((self.intrusion is not None, self.detection, self.sensor)):
            raise ValueError("intrusion_tolerance is of a C that is not given: give intrusion or detection")
        if self.intrusion is not None and self.detection is not None:
            raise ValueError("give either intrusion or detection")

    def _tolerances(self) -> tuple[Tolerance, ...]:
        own = (
            Tolerance("human_speed", self.human_speed_tolerance, "m/s"),
            Tolerance("intrusion", self.intrusion_tolerance, "m"),
        )
        return (*tolerances(self.stop), *(tolerance for tolerance in own if tolerance.half))

    def _shifted(self, shifts: Shifts) -> Separation:
        """Return this criterion without tolerances, its inputs at one end: 1 is where S_p is largest."""
        n = len(tolerances(self.stop))
        sides = dict(zip((t.name for t in self._tolerances()[n:]), shifts[n:], strict=True))
        v_h, C = self.human_speed, self._intrusion()[0]
        if v_h is not None:
            v_h += sides.get("human_speed", 0) * self.human_speed_tolerance
        if "intrusion" in sides:
            C = max((C or 0.0) + sides["intrusion"] * self.intrusion_tolerance, 0.0)
        return replace(
            self,
            stop=shifted(self.stop, shifts[:n]),
            human_speed=v_h,
            **({"intrusion": C, "detection": None} if "intrusion" in sides else {}),
            human_speed_tolerance=0.0,
            intrusion_tolerance=0.0,
        )

    def at_worst(self, model: Model) -> Separation:
        """Return this criterion without tolerances, with every input where S_p is largest."""
        own, _, _ = self._by_device(model)
        inputs = len(own._tolerances())
        return own._shifted((1,) * inputs) if inputs else self

    def subjects(self) -> tuple[str, ...]:
        """The robot and the human."""
        return self.between

    def _sides(self, model: Model) -> tuple[str, str]:
        """Robot and human, in that order."""
        roles = {name: model.mechanism(name).role for name in self.between}
        if sorted(role == "human" for role in roles.values()) != [False, True]:
            what = f"{list(self.between)} are not a robot or machine and a human"
            raise InputError.at(self.name, "between", what, "name one of each")
        first, second = self.between
        return (second, first) if roles[first] == "human" else (first, second)

    def moving(self, model: Model) -> tuple[int, ...]:
        """Bodies of which each has an S_p: the moving parts of the robot or machine, and what carries it."""
        return model.moving_of(self._sides(model)[0])

    def _everybody(self, model: Model) -> tuple[str, ...]:
        """The robot or machine, what it carries, and what carries it."""
        robot = model.mover(self._sides(model)[0])
        return (robot.name, *robot.riders, *model.carriers_of(robot.name))

    def _gap(self, model: Model) -> Gap:
        robot, human = self._sides(model)
        return model.gap(model.select(human), model.moving_of(robot))

    def _stop(self, model: Model) -> StopModel:
        return bind_stop(self.stop, model, model.mover(self._sides(model)[0]), self._gap(model))

    def _intrusion(self) -> tuple[float | None, str, str]:
        """C [m] when known, why it is not complete, and its source."""
        if self.detection is not None:
            return self.detection.intrusion()
        return self.intrusion, "" if self.intrusion is not None else "intrusion (C)", "workstation file"

    def _by_device(self, model: Model) -> tuple[Separation, tuple[str, ...], tuple[Input, ...]]:
        """Return this criterion with what its sensor adds, what is not known of the sensor, and inputs."""
        if self.sensor is None:
            return self, (), ()
        device = device_of(model, self.name, self.sensor, self.detection)
        stop = replace(self.stop, reaction=self.stop.reaction + device.response)
        detection = device.detection if self.intrusion is None else None
        return (
            replace(self, stop=stop, detection=detection, sensor=None),
            device.undecided_reasons,
            device.inputs,
        )

    def _terms(self) -> tuple[tuple[float, float, float], list[str]]:
        """C, Z_d and Z_r [m], 0 where not known, and what is not known."""
        C, missing_C, _ = self._intrusion()
        missing = [missing_C] if missing_C else []
        if self.human_uncertainty is None:
            missing.append("human_uncertainty (Z_d)")
        if self.robot_uncertainty is None:
            missing.append("robot_uncertainty (Z_r)")
        return (C or 0.0, self.human_uncertainty or 0.0, self.robot_uncertainty or 0.0), missing

    def unknown(self, model: Model) -> str:
        """Why S_p may be larger than what is computed; empty when it is not."""
        own, undecided_reasons, _ = self._by_device(model)
        return self._unknown([*own._terms()[1], *undecided_reasons], own._stop(model))

    @staticmethod
    def _unknown(missing: list[str], stop: StopModel) -> str:
        reasons = [f"not given: {', '.join(missing)}"] if missing else []
        return "; ".join([*reasons, *stop.undecided_reasons])

    @property
    def _human_speed(self) -> HumanSpeed:
        """How fast the person is assumed to come."""
        return assumed_speed(self.human_speed)

    def _distance(self, course: Course, K: float, seen: float) -> Array:
        """S_p of each part [m], shape (n,), of a person who is seen to be as fast as ``seen`` [m/s].

        Args:
            course: Of the robot.
            K: C + Z_d + Z_r [m].
            seen: [m/s].
        """
        found = np.empty(len(course.S_r))
        separation(course.S_r, course.S_s, self._time(course), K, self._human_speed, seen, found)
        return found

    def _time(self, course: Course) -> float:
        """T_r + T_s [s]."""
        T_s = course.T_s
        return self.stop.reaction + (T_s if T_s >= 0.0 else float(at_least("T_s", T_s, unit="s")))

    def _distances(self, course: Course, K: float, seen: Array) -> Array:
        """S_p at N instants [m], shape (N, n); ``seen`` of each (N,)."""
        found = np.empty(course.S_r.shape)
        separations(
            np.ascontiguousarray(course.S_r), np.ascontiguousarray(course.S_s), self._time(course), K,
            self._human_speed, seen, found,
        )  # fmt: skip
        return found

    @staticmethod
    def _seen(state: State, gap: Gap, stray: str) -> tuple[float, float]:
        """Speed of the person's fastest point that may be relied on [m/s]; 0 of a twin that is stopped.

        Args:
            state: The twin.
            gap: Whose first set the person is.
            stray: Why the twin is stopped (`State.strays`).

        Returns:
            As it is known, and as it may be by the noise of positions that it was derived from.
        """
        if stray:
            return 0.0, 0.0
        lost = state.invalid_bodies(gap.a)
        people = tuple(i for i in gap.a if i not in lost) if lost else gap.a
        seen = state.fastest_speed(people, allow_estimated=True)
        if not state.speed_errors:
            return seen, seen
        speeds = state.fastest_speeds(people, allow_estimated=True)
        return seen, float((speeds + state.speed_noise(people)).max(initial=0.0))

    def looks_ahead(self, model: Model) -> Mapping[str, float]:
        """Look ahead as long as the robot takes to react from this tick or the next, to a whole tick [s]."""
        if self.stop.acceleration is not None:
            return {}
        worst = self._by_device(model)[0].at_worst(model).stop.reaction
        return {self._sides(model)[0]: min(worst, LARGEST_WINDOW) + 2 * model.workstation.engine.tick}

    def claims(self, model: Model) -> Sequence[Claim]:
        """Claim that the robot gets no faster while it reacts than the file says, of points or of joints."""
        a, station = self.stop.acceleration, model.workstation
        if self not in station.safety:
            return ()
        areas = (area for area in station.areas if area.swept and area.swept.separation == self.name)
        on_it = (one for one in station.safety if getattr(one, "separation", None) == self.name)
        holds = (self.name, *(each.name for each in (*on_it, *areas)))
        T_r = self._by_device(model)[0].at_worst(model).stop.reaction
        if a is None:
            robot = model.mover(self._sides(model)[0])
            limits = joint_limits(model, robot)
            return () if limits is None else (JointAccelerations(model, robot, limits[0], T_r, holds),)
        key = f"safety[{station.safety.index(self)}].stop.acceleration"
        return (StatedAcceleration(model, self.moving(model), a, T_r, key, holds),)

    def bind(self, model: Model) -> Evaluate:
        """Return the function that judges one instant: of who is partly seen, what is seen first."""
        own, shared = self._by_device(model)[0], self._shared(model)

        def bind(gap: Gap) -> Evaluate:
            return self.judging(own._separations(model, gap, shared), own._line(model, gap, shared))

        return partly_seen(model, own._gap(model), bind)

    def compute(self, model: Model) -> Compute:
        """Look up every name in the model once and return the function that computes distances and S_p."""
        own = self._by_device(model)[0]
        return own._separations(model, own._gap(model), self._shared(model))

    def planned(self, model: Model) -> Callable[[Sequence[Any], Model], Whole] | None:
        """Return what computes distances together, of the present speeds and without tolerances."""
        own = self._by_device(model)[0]
        plain = self.mode == "dynamic" and not own._tolerances() and not self.unknown(model)
        return _stops if plain else None

    def _planned(self, model: Model) -> OneOf:
        own = self._by_device(model)[0]
        gap, stop, same = own._gap(model), own._stop(model), Result(name=self.name, unit="m", at_most=False)
        K, names = sum(own._terms()[0]) + gap.deviation, [model.bodies[i].name for i in gap.b]
        present = own._line(model, gap, self._shared(model))

        def alone(state: State, found: Closests) -> Result | None:
            course, seen = stop.courses(state), state.fastest_speed(gap.a)
            now = course(1.0)
            if now.most is not None or now.unbounded_reason:
                return None
            S_p, far = own._distance(now, K, seen), found.distance
            at = _Found(stop, found, course, now, (seen, seen), "", S_p, S_p, "", None, far, far)
            figure = Figure(None, parts=Parts(names, far, S_p), beside=at)
            verdict = verdict_of(figure, at_most=same.at_most)
            if verdict is _UNDECIDED or not math.isfinite(seen):
                return None
            return result_of(figure, verdict, present(state, figure, verdict), same)

        given = tuple(
            Result(name=name, value=value, unit="m") for name, value in own._terms_given(gap).items()
        )
        human = own._sides(model)[1]
        return OneOf(gap, stop, own.stop.reaction, K, given, human, own.human_speed, same, alone)

    def one_by_one(self, model: Model) -> str:
        """Say so of what depends on earlier instants, has ends, or where the way to stop is not given."""
        own = self._by_device(model)[0]
        if self.mode == "fixed":
            return "the largest S_p so far counts"
        if own._tolerances():
            return "what S_p is made from has tolerances"
        if many_instants.courses(model, own.stop, own._gap(model)) is None:
            return "how the robot stops is worked out at each instant"
        return ""

    def _shared(self, model: Model) -> _Shared:
        own, tops = self._by_device(model)[0], dict[Shifts, Array]()
        if self.stop.model == "simulated":
            model.mover(self._sides(model)[0]).require_masses(self.name)

        def figure(shifts: Shifts) -> Callable[[State], Array]:
            required = own._shifted(shifts).required(model)

            def at(state: State) -> Array:
                found = required(state)
                tops[shifts] = found.most
                return found.S_p

            return at

        ends = SeparationEnds(own._tolerances(), figure, remembers=own.mode == "fixed")
        return _Shared(self.unknown(model), (LargestSeparation(), LargestSeparation()), ends, tops)

    def _terms_given(self, gap: Gap) -> dict[str, float]:
        """C, Z_d and Z_r [m], by name."""
        C, Z_d, Z_r = self._terms()[0]
        return {"C": C + gap.deviation, "Z_d": Z_d, "Z_r": Z_r}

    def _separations(self, model: Model, gap: Gap, shared: _Shared) -> Compute:
        stop, K = self._stop(model), sum(self._terms()[0]) + gap.deviation
        names = tuple(model.bodies[i].name for i in gap.b)
        unknown_ever, largest, ends, tops = shared
        ends_of_distance, largest_ends = DistanceEnds(model, gap), (1,) * len(ends.tolerances)
        required: Callable[[States], Array] | None = None

        def of_many(states: States, distance: Array) -> Figure:
            nonlocal required
            required = required or self._of_many(model, gap)
            return Figure(None, parts=Parts(names, distance, required(states), open=bool(unknown_ever)))

        def compute(twin: Twin) -> Figure:
            found = twin.closest_per_body(gap, allow_estimated=True, strayed=True)
            if twin.many:
                return of_many(cast("States", twin), found.distance)
            state: State = twin  # type: ignore[assignment]
            stray, course = state.strays(gap.a), stop.courses(state)
            now, seen = course(1.0), self._seen(state, gap, stray)
            S_p, most, unbounded_reason = self._required(now, K, *seen)
            if self.mode == "fixed":
                S_p, most = (each.including(state, x) for each, x in zip(largest, (S_p, most), strict=True))
            near, far = ends_of_distance.of_bodies(state, found.distance)
            span, interval = ends.at(state) if ends.tolerances else None, None
            if span is not None:
                # What acceleration and noise may add to S_p, all inputs at their worst, is less distance.
                more = np.maximum(tops[largest_ends] - span.high, 0.0)
                interval = room_ends(near, far, S_p, more, span.low, span.high)
            elif (far is not near and (far > near).any()) or (most is not S_p and (most > S_p).any()):
                interval = near - (most - S_p), far
            open_ = bool(unknown_ever or unbounded_reason or stray)
            parts = Parts(names, found.distance, S_p, interval, open_)
            return Figure(None, parts=parts, beside=_Found(
                stop, found, course, now, seen, stray, S_p, most, unbounded_reason, span, near, far
            ))  # fmt: skip

        return compute

    def _line(self, model: Model, gap: Gap, shared: _Shared) -> Present:
        """What is said of the part that governs, and the line to it."""
        names = [body.name for body in model.bodies]
        of_K = self._terms_given(gap)
        K, rest = sum(self._terms()[0]) + gap.deviation, sum(of_K.values())
        given = tuple(Result(name=name, value=value, unit="m") for name, value in of_K.items())
        places, human = BodyPlaces(model), self._sides(model)[1]
        to_whom: dict[bytes, list[str]] = {}
        """By the bodies to which parts were nearest at the last instant, their names."""

        def present(state: State, figure: Figure, verdict: Verdict | None) -> Shown:
            at: _Found = figure.beside
            parts, found = figure.parts, at.found
            assert parts is not None
            k, S_p = parts.governs, at.S_p
            nearest = places.named(state, int(found.body_a[k]), found.point_a[k])
            where = f"{parts.names[k]} ↔ {nearest}"
            where += faster(human, at.seen[0], self.human_speed)
            if verdict is _UNDECIDED:
                where = f"{where}: {self._undecided_reason(model, state, at, k, shared)}"
            limit = float(S_p[k])
            draw = line(float(found.distance[k]), limit, found.point_b[k], found.point_a[k], verdict)
            beside = (
                *self._shown(at.now, k, limit, rest, at.seen[0]),
                *given,
                *self._more(S_p, at.most, at.unbounded_reason),
            )
            if not (state.between and verdict is _WITHIN):  # which nobody is shown, and it takes long
                beside += self._permissible(
                    at.stop, state, at.course, at.now, found.distance, K, at.seen, at.stray
                )
            key = found.body_a.tobytes()
            if key not in to_whom:
                to_whom.clear()
                to_whom[key] = list(map(names.__getitem__, found.body_a.tolist()))
            return Shown(where, draw, beside, to_whom[key])

        return present

    def _undecided_reason(self, model: Model, state: State, at: _Found, k: int, shared: _Shared) -> str:
        human, S_p, most = self._sides(model)[1], at.S_p, at.most
        slower = f"{at.stray}: how fast the person is nobody knows" if at.stray else ""
        if unknown := "; ".join(filter(None, (shared.unknown_ever, at.unbounded_reason, slower))):
            return f"{unknown}; S_p is at least the figure shown"
        widths = np.zeros(0) if at.span is None else at.span.widths[:, k]
        wide = float(at.far[k] - at.near[k])
        if most[k] > S_p[k] and bool((most - S_p)[k] >= max(wide, *widths.tolist(), 0.0)):
            noisy = human in state.speed_errors and NOISY not in at.now.more
            why = "; ".join(filter(None, (at.now.more, NOISY * noisy)))
            return f"S_p is up to {figures.rounded_up(float(most[k]), 'm')} {why}"
        return deciding((*shared.ends.tolerances, tracking(wide / 2)), np.append(widths, wide))

    @staticmethod
    def _more(S_p: Array, highest: Array, unbounded_reason: str) -> tuple[Result, ...]:
        """By how much S_p of some part may be larger than shown; no value where that has no bound."""
        if unbounded_reason:
            return (Result(name=MORE, unit="m", reason=unbounded_reason),)
        most = 0.0 if highest is S_p else float((highest - S_p).max())
        return (Result(name=MORE, value=most, unit="m"),) if most > 0 else ()

    def _shown(self, now: Course, k: int, S_p: float, K: float, seen: float) -> tuple[Result, ...]:
        """The terms of S_p of the part that governs, but for those of K; S_h is what the others leave."""
        S_r, S_s = float(now.S_r[k]), float(now.S_s[k])
        S_h = S_p - (S_r + S_s) - K
        if self.mode == "dynamic" and self.human_speed is not None:
            S_h = float(way_of_person(max(self.human_speed, seen), self.stop.reaction, now.T_s))
        return terms(S_r, S_s, S_h)

    def remembers(self, model: Model) -> bool:
        """Say whether the result depends on earlier instants, so that it is asked in the order of time."""
        return self.mode == "fixed"

    def falls(self, model: Model, points: Points) -> Falls | None:
        """Bound the margin of each moving part between instants; None where nobody knows how S_p changes."""
        gap, rises = self._gap(model), self.rises(model)
        people, parts, lasts = rows_of(gap.a), rows_of(gap.b), self.lasts(model)
        if self.mode == "fixed":
            # How S_p rises is in `follows`.
            return lambda span, _: Fall(span.way(people) + span.fast[parts] * span.T)
        if rises is None:
            most = self._most(model, points)
            n = len(parts)

            def below(span: Span, least: Array | float) -> Fall:
                S_p = None if most is None else most(span)
                if S_p is None:
                    return UNBOUNDED
                nearer, each = span.way(people) + span.fast[parts] * span.T, np.asarray(least)
                lost = np.maximum(each[:n] - (each[n:] - nearer - S_p), nearer)
                return Fall(np.inf, np.concatenate([lost, nearer]))

            return None if most is None else below

        in_time = self._lost_in_time(model, people, parts) if lasts else None

        def falls(span: Span, _: Array | float) -> Fall:
            if in_time is not None and not span.noisy:
                return Fall(np.inf, in_time(span))
            nearer = span.way(people) + span.fast[parts] * span.T
            lost = np.concatenate([nearer + rises(span), nearer])
            # What S_p has ahead may leave it at once: the margin at the end says nothing of the way there.
            return Fall(np.inf, lost) if lasts else Fall(lost)

        return falls

    def _lost_in_time(self, model: Model, people: Indices, parts: Indices) -> Callable[[Span], Array] | None:
        """What `falls` says is lost, in one call; None but for a stop of known time without tolerances."""
        own = self._by_device(model)[0]
        in_time = own._stop(model).in_time
        if in_time is None or own._tolerances():
            return None
        stop, v_h = TimedStop(own.stop.reaction, *in_time), self.human_speed

        def lost(span: Span) -> Array:
            found = np.empty(2 * len(parts))
            lost_in_time(
                span.fast, span.slow, people, parts, span.T, stop, v_h or REACHING, v_h or WALKING, ROUNDING,
                found,
            )  # fmt: skip
            return found

        return lost

    def bounded_once(self, model: Model) -> bool:
        """Whether energy bounds the stops that begin within a span: those of half of it are no shorter."""
        return self.stop.model == "simulated"

    def follows(self, model: Model, points: Points) -> Follows | None:
        """With ``mode = "fixed"`` the largest S_p counts, also of instants between two ticks."""
        if self.mode != "fixed":
            return None
        present = replace(self, mode="dynamic")
        return self.limit_follows(model, points, keeps=True, again=lambda: present.bind(model))

    def limit_follows(
        self, model: Model, points: Points, *, keeps: bool, again: Callable[[], Evaluate]
    ) -> Follows | None:
        """S_p of each of `moving` as what a limit follows from; None where nothing bounds it within a span.

        Args:
            model: The compiled workstation.
            points: Of which the motion is bounded.
            keeps: See `Follows`, as the next.
            again: Of whom the limit is.
        """
        own = replace(self.at_worst(model), mode="dynamic")._by_device(model)[0]
        gap, stop, required = own._gap(model), own._stop(model), own.required(model)
        people, parts, by_speed = rows_of(gap.a), rows_of(gap.b), stop.by_speed
        K, longest = sum(own._terms()[0]) + gap.deviation, own._most(model, points)

        def now(state: State) -> Moment:
            onsets = (each(1.0).v_s for each in stop.reactions(state) if each is not None)
            return Moment(
                required(state).most,
                (np.max([*onsets], axis=0), np.array(own._seen(state, gap, state.strays(gap.a))[1])),
            )

        def known_ahead(span: Span, at: Moment) -> Array:
            """S_p at the begin covers the tick, but for how fast parts and people get between its ends."""
            assert by_speed is not None
            v, seen = at.beside
            low, high = by_speed(v), by_speed(v + np.maximum(span.fast[parts] - span.ends[parts], 0.0))
            fastest = float((span.fast + span.noise)[people].max(initial=0.0))
            return np.asarray(at.figure + own._longer(low, high, float(seen), fastest))

        def at_speeds(span: Span, _: Moment) -> Array:
            assert by_speed is not None
            fast = span.fast + span.noise
            return own._at_speeds(by_speed, K, fast[parts], float(fast[people].max(initial=0.0)))

        def by_joints(span: Span, _: Moment) -> Array:
            assert longest is not None
            found = longest(span)
            return np.full(len(parts), np.inf) if found is None else found

        if by_speed is None and longest is None:
            return None
        most = by_joints if by_speed is None else known_ahead if stop.lasts else at_speeds
        close = math.inf if self.bounded_once(model) else CLOSE
        return Follows(now, most, close, keeps, again)

    def lasts(self, model: Model) -> bool:
        """Whether S_p of an instant is at least that of any other in the tick that begins with it.

        But for how fast the robot gets meanwhile, `rises`.
        """
        return self._by_device(model)[0]._stop(model).lasts

    def rises(self, model: Model) -> Callable[[Span], Array] | None:
        """How much S_p of each of `moving` can change within a span [m]; None where not known.

        Where S_p follows from the speeds of the instant, it never falls as one of them grows
        (`StopModel.by_speed`, and the larger of assumed and seen v_h): so at every instant it lies between
        those of the least and of the largest speeds in the span. Where what is known ahead is in it
        (`lasts`), S_p of the begin covers every stop that begins until the next tick; this is on top.
        """
        gap = self._gap(model)
        people, parts = rows_of(gap.a), rows_of(gap.b)
        required: list[Callable[[Array, float, Array, float], Array]] = []
        for each in dict.fromkeys((self, self.at_worst(model))):
            own = each._by_device(model)[0]
            stop, K = own._stop(model), sum(own._terms()[0]) + gap.deviation
            if stop.by_speed is None:
                return None
            required.append(partial(own._risen, stop.by_speed, K, stop.lasts))

        def rises(span: Span) -> Array:
            # Speeds that may be off by noise are that at both ends.
            ranges = [(span.fast, span.slow)]
            if span.noisy:
                ranges.append((span.fast + span.noise, span.slow + span.noise[: len(span.slow)]))
            found = [
                risen(least[parts], greatest(least, people), most[parts], greatest(most, people))
                for risen in required
                for most, least in ranges
            ]
            return found[0] if len(found) == 1 else np.asarray(np.max(found, axis=0))

        return rises

    def _most(self, model: Model, points: Points) -> Callable[[Span], Array | None] | None:
        """S_p of each of `moving` within a span at most [m], by how far joints and people get in it."""
        own = self.at_worst(model)._by_device(model)[0]
        gap, bind = self._gap(model), own._stop(model).in_span
        longest = None if bind is None else bind(points)
        if longest is None:
            return None
        people, K = rows_of(gap.a), sum(own._terms()[0]) + gap.deviation

        def most(span: Span) -> Array | None:
            course = longest(span)
            seen = float((span.fast + span.noise)[people].max(initial=0.0))
            return None if course is None or not np.isfinite(seen) else own._distance(course, K, seen)

        return most

    def _risen(
        self,
        by_speed: Callable[[Array], Course],
        K: float,
        lasts: bool,
        slow: Array,
        slowest: float,
        fast: Array,
        fastest: float,
    ) -> Array:
        """How much S_p rises from the least to the largest speeds, of parts and of people [m], shape (n,)."""
        if lasts:
            # S_p is not that of these speeds, and may lie where it grows faster than theirs.
            return self._longer(by_speed(slow), by_speed(fast), slowest, fastest)
        return self._at_speeds(by_speed, K, fast, fastest) - self._at_speeds(by_speed, K, slow, slowest)

    def _longer(self, low: Course, high: Course, seen: float, fastest: float) -> Array:
        """How much S_p can grow with the course and with how fast people are seen to be [m], shape (n,).

        Whatever it is: between the speeds that ISO 13855 assumes it grows no faster than with the larger.

        Args:
            low: Of the robot.
            high: With speeds that are higher.
            seen: Speed of people with the former [m/s].
            fastest: With the latter [m/s].
        """
        v_h, found = max(self.human_speed or REACHING, fastest), np.empty(len(high.S_r))
        faster = max(fastest - max(self.human_speed or WALKING, seen), 0.0)
        before, then = self._time(low), self._time(high)
        rise(v_h * before, low.S_r, low.S_s, v_h * then, high.S_r, high.S_s, faster * then, found)
        return found

    def _at_speeds(self, by_speed: Callable[[Array], Course], K: float, v: Array, seen: float) -> Array:
        return self._distance(by_speed(v), K, seen)

    def margin(self, result: Result) -> Margin:
        """Tell how far each moving part is from S_p [m], then how far each is away [m], with tolerances."""
        parts = [part for part in result.parts if part.verdict is not None]
        away = [part.value or 0.0 for part in parts]
        room = [far - (part.limit or 0.0) for far, part in zip(away, parts, strict=True)]
        if not any(part.interval for part in parts):
            none = np.zeros(len(room) if self.mode == "fixed" else 2 * len(room))
            return np.array(room if self.mode == "fixed" else [*room, *away]), none
        near = [part.interval[0] if part.interval else far for far, part in zip(away, parts, strict=True)]
        off = [far - least for far, least in zip(away, near, strict=True)]
        if self.mode == "fixed":
            return np.array(room), np.array(off)
        return np.array([*room, *near]), np.array([*off, *[0.0] * len(off)])

    def _required(self, now: Course, K: float, seen: float, seen_most: float) -> Required:
        S_p, top = self._distance(now, K, seen), now.most
        if top is None and not seen_most > seen:
            return Required(S_p, S_p, now.unbounded_reason)
        most = np.maximum(self._distance(top or now, K, seen_most), S_p)
        unbounded = now.unbounded_reason, "" if top is None else top.unbounded_reason
        return Required(S_p, most, "; ".join(dict.fromkeys(filter(None, unbounded))))

    def required(self, model: Model) -> Callable[[State], Required]:
        """S_p of each of `moving`, in that order; to be asked at every tick."""
        own, _, _ = self._by_device(model)
        stop, largest = own._stop(model), (LargestSeparation(), LargestSeparation())
        gap = own._gap(model)
        K = sum(own._terms()[0]) + gap.deviation

        def at(state: State) -> Required:
            found = own._required(stop.courses(state)(1.0), K, *own._seen(state, gap, state.strays(gap.a)))
            if own.mode != "fixed":
                return found
            S_p, most = (each.including(state, x) for each, x in zip(largest, found[:2], strict=True))
            return Required(S_p, most, found.unbounded_reason)

        return at

    def required_of_many(self, model: Model) -> Callable[[States], Array]:
        """S_p of each of `moving` at N instants [m], shape (N, n), where nothing keeps it to `one_by_one`."""
        own = self._by_device(model)[0]
        return own._of_many(model, own._gap(model))

    def _of_many(self, model: Model, gap: Gap) -> Callable[[States], Array]:
        courses, K = many_instants.courses(model, self.stop, gap), sum(self._terms()[0]) + gap.deviation
        everybody = (*self._everybody(model), *gap.carriers, *model.carriers_of(self._sides(model)[1]))
        assert courses is not None

        def at(states: States) -> Array:
            seen = states.fastest_points(gap.a)[0].max(axis=1, initial=0.0)
            S_p = self._distances(courses(states), K, seen)
            # How much faster noise may make everybody is asked of each instant.
            states.alone = states.alone | others_noisy(states, everybody)
            return S_p

        return at

    def inverse(self, model: Model) -> Callable[[State, Array], tuple[Array, tuple[Result, ...]]]:
        """S_p of every moving part [m] and the largest permissible speed, at given distances of them [m].

        Raises:
            Undecided: When asked, where S_p may be larger than what is computed.
        """
        if self.sensor is not None:
            return self._by_device(model)[0].inverse(model)
        gap, stop = self._gap(model), self._stop(model)
        K = sum(self._terms()[0]) + gap.deviation

        def at(state: State, distance: Array) -> tuple[Array, tuple[Result, ...]]:
            course = stop.courses(state)
            now = course(1.0)
            stray = state.strays(gap.a)
            seen = self._seen(state, gap, stray)
            required = self._required(now, K, *seen)
            if required.unbounded_reason:
                raise Undecided(required.unbounded_reason)
            return required.most, self._permissible(stop, state, course, now, distance, K, seen, stray)

        return at

    def _permissible(
        self,
        stop: StopModel,
        state: State,
        course: At,
        now: Course,
        distance: Array,
        K: float,
        seen: tuple[float, float],
        stray: str,
    ) -> tuple[Result, ...]:
        """Largest speed of the robot's fastest point for which no part is nearer than its S_p."""
        speed, factor, reason = None, None, ""

        def S_p(scale: float) -> Array:
            required = self._required(course(scale), K, *seen)
            if required.unbounded_reason:
                raise Undecided(required.unbounded_reason)
            return required.most

        least, highest = stop.reactions(state)
        onset = least if highest is None else highest
        present = onset(1.0)
        if stray or now.unbounded_reason or (now.most is not None and now.most.unbounded_reason):
            reason = "S_p is at least what is shown: no speed follows"
        elif stop.inverse is not None and present.linear:
            v_h = np.empty(len(distance))
            approach_speeds(distance, self._human_speed, seen[1], v_h)
            speed, factor = stop.inverse(onset(0.0), present, distance, v_h, K)
        elif now.v_r.max() > MOVING:
            factor = factor_by_search(S_p, distance, stop.costly)
            speed = factor * float(now.v_r.max())
            reason = "or more" if factor == (1.0 if stop.costly else TOP) else ""
        else:
            reason = "stands still: no motion to scale"
        return permissible(speed, factor, reason)

    def basis(self, model: Model) -> Basis:
        """State the formula, its source, the inputs with their origin, and what is not modelled."""
        if self.sensor is not None:
            own, _, of_device = self._by_device(model)
            found = own.basis(model)
            return replace(found, inputs=(*found.inputs, *of_device))
        robot, human = self._sides(model)
        stop = self._stop(model)
        inputs = [
            *provenance.motion(model, robot, human),
            *provenance.shapes(self._gap(model)),
            provenance.given("T_r", self.stop.reaction, "s"),
            *(provenance.given(f"tolerance of {t.name}", t.half, t.unit) for t in self._tolerances()),
            *stop.inputs,
        ]
        if self.stop.model == "simulated":
            inputs += provenance.masses(model, model.mover(robot))
        stated = None if self.detection is None else self.detection.stated()
        inputs += [approach_speed(self.human_speed), stated or intrusion(self.intrusion)]
        for name, value in (("Z_d", self.human_uncertainty), ("Z_r", self.robot_uncertainty)):
            inputs.append(
                Input(name=name, unit="m", origin=Origin.MISSING)
                if value is None
                else provenance.given(name, value, "m")
            )
        bound = self.stop.model == "bound"
        formula = (
            "S_p = (v_r + v_h)(T_r + T_s) + C + Z_d + Z_r"
            if bound
            else f"S_p = v_h (T_r + T_s) + S_r + S_s + C + Z_d + Z_r; {stop.formula}"
        )
        fixed = ", the largest so far" if self.mode == "fixed" else ""
        toward = self.stop.direction == "toward"
        norm = (
            "ISO/TS 15066:2016 5.5.4.2.3; structure from public sources that agree (2S), "
            "no licensed text was opened"
        )
        return Basis(
            formula=f"{formula}{fixed}; v_h is no less than that of the twin's person; the distance must "
            "not fall below S_p, nor below that of speeds that are higher by three standard deviations of "
            "noise where they are derived from positions",
            source=f"Weistroffer et al. 2022, Eq. 2 (upper bound of {norm})" if bound else norm,
            inputs=tuple(inputs),
            not_modelled=(
                *stop.not_modelled,
                *((SIMULATED,) if self.stop.model == "simulated" and tolerances(self.stop) else ()),
                *(() if toward else ("direction: the speed counts in full, also of parts that move away",)),
                *(self.detection.ways_around() if self.detection is not None else ()),
                "a person who gets faster than v_h, and than now",
            ),
        )


def _stops(criteria: Sequence[Separation], model: Model) -> Stops:
    """Bind separations of a tick's plan."""
    return Stops([each._planned(model) for each in criteria], model)
