"""What protective devices have in common: who is in a field, whom of them it saw, and since when."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar, Protocol, cast

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from seerob.core import figures
from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Highlight, Input, Label, Marker, Origin, Result, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import ROUNDING, keeps
from seerob.criteria.body_parts import seen_first
from seerob.criteria.criterion import Criterion, Evaluate
from seerob.criteria.figure import Compute, Figure, Present, Shown, Twin
from seerob.distance.least import Closests
from seerob.model import provenance
from seerob.model.model import Gap, Model
from seerob.recording.answers import Flags
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.spans import Falls, Points, approaching
from seerob.twin.state import State
from seerob.twin.states import States
from seerob.workstation.tables.sensors import Sensor

Names = str | tuple[str, ...]


class Seen(StrEnum):
    """What a device makes of a body that is in its field."""

    DETECTED = "detected"
    MAYBE = "may be missed"
    MISSED = "not detected"


@dataclass(frozen=True)
class Sight:
    """What a device makes of one body, and why."""

    seen: Seen
    why: str = ""


def names_of(given: Names) -> tuple[str, ...]:
    """One name or several, as several."""
    return (given,) if isinstance(given, str) else given


def sensor_of(model: Model, name: str, kind: str) -> Sensor:
    """A sensor of a kind: a field of `Sensor`.

    Raises:
        UnknownName: The workstation has none of that name and kind.
    """
    known = {s.name: s for s in model.workstation.sensors if getattr(s, kind) is not None}
    if name not in known:
        raise UnknownName(kind.replace("_", " "), name, known)
    return known[name]


def bodies_of(model: Model, given: Names) -> tuple[int, ...]:
    """Bodies that names mean, each once, without areas."""
    chosen = dict.fromkeys(i for name in names_of(given) for i in model.select(name))
    return tuple(i for i in chosen if model.bodies[i].role != "area")


def others(model: Model, sensor: Sensor, bodies: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """What else can stand in a beam's way: what stands still, and what moves.

    Raises:
        UnknownName: The sensor ignores something that there is not.
    """
    left_out = {i for name in sensor.ignores for i in model.select(name)} | set(bodies)
    rest = [b for b in model.bodies if b.role != "area" and b.index not in left_out and b.solids]
    return tuple(b.index for b in rest if not b.mover), tuple(b.index for b in rest if b.mover)


def carriers_of(model: Model, bodies: tuple[int, ...]) -> tuple[str, ...]:
    """Robots and people that carry some bodies."""
    return tuple(dict.fromkeys(model.bodies[i].mover for i in bodies if model.bodies[i].mover))


class Presence:
    """Somebody in a field: from when on, how far they walked before the device saw them and switched."""

    def __init__(self, model: Model, sensor: Sensor, field: int, bodies: tuple[int, ...]) -> None:
        """Of a field's body, and the bodies that may enter it.

        Raises:
            InputError: A body that is part of the field.
        """
        if not bodies:
            raise InputError.at(
                sensor.name, "of", "nothing in it has a shape", "name who may enter the field"
            )
        self.model, self.sensor, self.bodies = model, sensor, bodies
        self.gap: Gap = model.gap((field,), bodies)
        self._off = TrackingError(model, bodies)
        self._rows, self._row = list(bodies), {i: k for k, i in enumerate(bodies)}
        self._last: tuple[float, Array] | None = None
        self._since: float | None = None
        self.undetected = 0.0
        """Path inside the field before it was seen [m]."""
        self.until_output = 0.0
        """Further path until the output had switched [m]."""

    def inside(self, found: Closests) -> list[int]:
        """Which bodies are in the field."""
        return [self.bodies[k] for k in np.flatnonzero(found.distance <= ROUNDING).tolist()]

    def follow(self, state: State, inside: NDArray[np.bool_], triggered: bool) -> None:
        """Take the way of what is inside since the last evaluation into account."""
        now = state.placed(self.bodies)[1][self._rows]
        if self._last is None or state.t <= self._last[0]:
            self._last, self._since, self.undetected, self.until_output = None, None, 0.0, 0.0
        way = 0.0
        if self._last is not None and inside.any():
            way = float(np.linalg.norm(now - self._last[1], axis=1)[inside].max())
        if not inside.any() and not triggered:
            self._since, self.undetected, self.until_output = None, 0.0, 0.0
        elif not triggered:
            self.undetected += way
        elif self._since is None:
            self._since = state.t
            self.undetected += way
        elif self.sensor.response is not None and self._last is not None:
            # Of the way since the last evaluation, the share that lies before the output switched.
            left = self._since + self.sensor.response - self._last[0]
            self.until_output += way * min(max(left / (state.t - self._last[0]), 0.0), 1.0)
        self._last = state.t, now

    def of_many(
        self, states: States, found: Closests, *, open: bool | Flags = False, beside: float = 0.0
    ) -> Figure:
        """Compute how far everybody is from the field, of N instants.

        Args:
            states: The twin.
            found: How near each body is to the field.
            open: Whether somebody may be in the field all the same, shape (N,).
            beside: How far from the field the device may see somebody [m]: that is asked of each instant.
        """
        value = found.distance.min(axis=-1)
        states.alone = states.alone | ((value > ROUNDING) & (value <= beside))
        return Figure(value, 0.0, (value - self.gap.deviation, value), open=open)

    def of_one(
        self,
        state: State,
        found: Closests,
        sights: Mapping[int, Sight],
        *,
        undecided_reasons: tuple[str, ...] = (),
        more: Any = None,
    ) -> Figure:
        """Compute how far everybody is from the field now, and how far they walked in it.

        Args:
            state: The twin.
            found: How near each body is to the field.
            sights: What the device makes of each body that it saw or should have seen.
            undecided_reasons: Why nobody in the field may be wrong all the same.
            more: What the device shows besides.
        """
        inside = found.distance <= ROUNDING
        triggered = any(sight.seen is not Seen.MISSED for sight in sights.values())
        self.follow(state, inside, triggered)
        may = self._off.at(state) + self.gap.deviation
        room = found.distance - may
        nearest, perhaps = int(found.distance.argmin()), int(room.argmin())
        value = float(found.distance[nearest])
        entered = {i: (sight, float(found.distance[self._row[i]])) for i, sight in sights.items()}
        missed = [i for i, sight in sights.items() if sight.seen is Seen.MISSED]
        near = _Near(
            who=self.bodies[nearest],
            perhaps=self.bodies[perhaps],
            off=float(may[perhaps]),
            entered=entered,
            walked=(self.undetected, self.until_output if triggered else None),
            missed={i: tuple(state.placed((i,))[1][i].tolist()) for i in missed},
            undecided_reasons=undecided_reasons,
            more=more,
        )
        ends = float(room[perhaps]), value
        return Figure(value, 0.0, ends, exceeded=bool(sights), open=bool(undecided_reasons), beside=near)

    def shown(
        self,
        state: State,
        figure: Figure,
        verdict: Verdict | None,
        *,
        parts: tuple[Result, ...] = (),
        also: Callable[[], Iterable[Marker]] = tuple,
    ) -> Shown:
        """Say and draw who is in the field, and what the device makes of them.

        Args:
            state: The twin.
            figure: From `of_one`.
            verdict: Of it.
            parts: More figures.
            also: Draws more, from copies.
        """
        near: _Near = figure.beside
        names = self.model.bodies
        least, _ = cast("tuple[float, float]", figure.interval)
        if near.entered:
            reason = self._worst_sight(near.entered)
        elif not keeps(least, 0.0, at_most=False):
            off = figures.rounded_up(near.off * 1e3, "mm")
            reason = f"{names[near.perhaps].name} is within {off}, what its shape and its place may be off by"
        else:
            reason = "; ".join(near.undecided_reasons) or names[near.who].name
        each = [
            Result(
                name=names[i].name,
                value=distance,
                unit="m",
                limit=0.0,
                at_most=False,
                verdict=verdict,
                reason=f"{sight.seen}: {sight.why}" if sight.why else str(sight.seen),
            )
            for i, (sight, distance) in near.entered.items()
        ]

        def draw() -> tuple[Marker, ...]:
            lit = (Highlight(body=names[i].name, verdict=verdict) for i in (self.gap.a[0], *near.entered))
            missed = (
                Label(position=at, text=f"not detected: {near.entered[i][0].why}", verdict=verdict)
                for i, at in near.missed.items()
            )
            return *lit, *missed, *also()

        return Shown(reason, draw, (*each, *self._ways(near), *parts))

    def _worst_sight(self, entered: Mapping[int, tuple[Sight, float]]) -> str:
        """The worst first: who is not detected although in the field."""
        sights, names = [(i, sight) for i, (sight, _) in entered.items()], self.model.bodies
        if all(sight.seen is Seen.MISSED for _, sight in sights):
            i, sight = sights[0]
            return f"NOT detected: {names[i].name}, {sight.why}"
        surely = [i for i, sight in sights if sight.seen is Seen.DETECTED]
        if surely:
            return "detected: " + ", ".join(names[i].name for i in surely)
        i, sight = next((i, sight) for i, sight in sights if sight.seen is Seen.MAYBE)
        return f"may be missed: {names[i].name}, {sight.why}"

    def _ways(self, near: _Near) -> tuple[Result, ...]:
        if not near.entered:
            return ()
        undetected, until_output = near.walked
        why = "" if until_output is not None else "not detected yet"
        way = Result(name="walked before detection", value=undetected, unit="m", reason=why)
        if until_output is None:
            return (way,)
        known = self.sensor.response is not None
        until = Result(
            name="walked until the output switched",
            value=until_output if known else None,
            unit="m",
            verdict=None if known else Verdict.UNDECIDED,
            reason="" if known else "response time not given",
        )
        return way, until

    def falls(self) -> Falls:
        """How far its distance can fall between two instants, see `Criterion.falls`."""
        return approaching(self.gap.a, self.gap.b)

    def inputs(self) -> tuple[Input, ...]:
        """Inputs of the basis: motion, shapes, and the figures of the device with their source."""
        sensor, given = self.sensor, []
        for name, value, unit in (
            ("detection capability", sensor.capability, "m"),
            ("response time", sensor.response, "s"),
        ):
            given.append(
                Input(name=name, unit=unit, origin=Origin.MISSING)
                if value is None
                else Input(
                    name=name,
                    value=value,
                    unit=unit,
                    origin=Origin.GIVEN if sensor.source else Origin.ASSUMED,
                    source=sensor.source or "workstation file, which names no data sheet",
                )
            )
        return (*provenance.motion(self.model, *self.gap.carriers), *provenance.shapes(self.gap), *given)


class _Near(Struct, frozen=True, eq=False):
    """Who is nearest to a field or in it at an instant; bodies by index."""

    who: int
    perhaps: int
    """Who may be nearest, shapes and devices being what they are."""
    off: float
    """By how much that one may be elsewhere [m]."""
    entered: Mapping[int, tuple[Sight, float]]
    """What the device makes of each that it saw or should have seen, and its distance from the field [m]."""
    walked: tuple[float, float | None]
    """Way in the field before somebody was seen, and from then until the output had switched [m]; None where
    nobody is seen yet."""
    missed: Mapping[int, tuple[float, float, float]]
    """Where those are whom it does not see [m]."""
    undecided_reasons: tuple[str, ...]
    """Why nobody in the field may be wrong all the same."""
    more: Any
    """What the device shows besides."""


class Device(Protocol):
    """A protective device of the workstation, with the names of a criterion resolved."""

    presence: Presence

    def compute(self, twin: Twin, /) -> Figure:
        """How far everybody is from its field, and what it makes of who is in it."""

    def shown(self, state: State, figure: Figure, verdict: Verdict | None, /) -> Shown:
        """What is said and drawn of that."""


class InField(Criterion, frozen=True, kw_only=True):
    """Base of the criteria about who is in the field of a protective device."""

    unit: ClassVar[str] = "m"
    whole: ClassVar[bool] = False
    at_most: ClassVar[bool] = False

    def device(self, model: Model) -> Device:
        """Look up every name in the model once."""
        raise NotImplementedError

    def bind(self, model: Model) -> Evaluate:
        """Return the function that judges one instant: of who is partly seen, what is seen first.

        What the device makes of those stays open, since a bone that nobody sees may shade another.
        """
        device = self.device(model)
        presence, (field,) = device.presence, device.presence.gap.a
        sight = Sight(Seen.MAYBE, "whether the device sees it is open")

        def without(lost: tuple[int, ...]) -> Evaluate | None:
            bodies = tuple(i for i in presence.bodies if i not in lost)
            if not bodies:
                return None
            rest = Presence(model, presence.sensor, field, bodies)

            def compute(twin: Twin) -> Figure:
                found = twin.closest_per_body(rest.gap)
                return rest.of_one(cast("State", twin), found, dict.fromkeys(rest.inside(found), sight))

            return self.judging(compute, rest.shown)

        return seen_first(presence.bodies, self.judging(device.compute, device.shown), without)

    def compute(self, model: Model) -> Compute:
        """Return the function that computes distances from the field, and what the device sees."""
        return self.device(model).compute

    def present(self, model: Model) -> Present:
        """Return the function that says who is in the field, and draws what the device sees."""
        return self.device(model).shown

    def one_by_one(self, model: Model) -> str:
        """Many instants are computed together, but for those at which a beam may end beside the field."""
        return ""

    def falls(self, model: Model, points: Points) -> Falls:
        """Bound how far a body can move into the field between two instants at which this is asked."""
        return self.device(model).presence.falls()
