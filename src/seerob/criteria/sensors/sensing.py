"""What protective devices have in common: who is in a field, whom of them it saw, and since when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Highlight, Input, Label, Marker, Origin, Result, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import keeps
from seerob.criteria.body_parts import seen_first
from seerob.criteria.criterion import Evaluate
from seerob.distance.least import Closests
from seerob.model import provenance
from seerob.model.model import Gap, Model
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.spans import Falls, approaching
from seerob.twin.state import State
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
        self._last: tuple[float, Array] | None = None
        self._since: float | None = None
        self.undetected = 0.0
        """Path inside the field before it was seen [m]."""
        self.until_output = 0.0
        """Further path until the output had switched [m]."""

    def inside(self, state: State) -> tuple[Closests, NDArray[np.bool_]]:
        """How near each body is to the field, and which are in it."""
        found = state.closest_per_body(self.gap)
        return found, found.distance <= 0

    def follow(self, state: State, inside: NDArray[np.bool_], triggered: bool) -> None:
        """Take the way of what is inside since the last evaluation into account."""
        now = state.placed(self.bodies)[1][list(self.bodies)]
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

    def result(
        self,
        name: str,
        state: State,
        sights: Mapping[int, Sight],
        *,
        undecided_reasons: tuple[str, ...] = (),
        parts: tuple[Result, ...] = (),
        markers: tuple[Marker, ...] = (),
    ) -> Result:
        """What a device says at this tick.

        Args:
            name: Of the criterion.
            state: The twin.
            sights: What it makes of each body that it saw or should have seen.
            undecided_reasons: Why nobody in the field may be wrong all the same.
            parts: More figures.
            markers: More to draw.
        """
        found, inside = self.inside(state)
        triggered = any(sight.seen is not Seen.MISSED for sight in sights.values())
        self.follow(state, inside, triggered)
        may = self._off.at(state) + self.gap.deviation
        nearest, perhaps = int(found.distance.argmin()), int((found.distance - may).argmin())
        entered = dict(zip(self.bodies, found.distance.tolist(), strict=True))
        each = tuple(
            Result(
                name=self.model.bodies[i].name,
                value=entered.get(i),
                unit="m",
                limit=0.0,
                at_most=False,
                verdict=Verdict.EXCEEDED,
                reason=f"{sight.seen}: {sight.why}" if sight.why else str(sight.seen),
            )
            for i, sight in sights.items()
        )
        if sights:
            verdict, reason = Verdict.EXCEEDED, self._worst_sight(sights)
        elif not keeps(found.distance[perhaps] - may[perhaps], 0.0, at_most=False):
            verdict = Verdict.UNDECIDED
            mm = f"{may[perhaps] * 1e3:.1f} mm"
            reason = f"{self._name(perhaps)} is within {mm}, what its shape and its place may be off by"
        elif undecided_reasons:
            verdict, reason = Verdict.UNDECIDED, "; ".join(undecided_reasons)
        else:
            verdict, reason = Verdict.WITHIN, self._name(nearest)
        lit = [Highlight(body=self.model.bodies[i].name, verdict=Verdict.EXCEEDED) for i in sights]
        near, least = float(found.distance[nearest]), float(found.distance[perhaps] - may[perhaps])
        marks: list[Marker] = [Highlight(body=self.model.bodies[self.gap.a[0]].name, verdict=verdict), *lit]
        for i, sight in sights.items():
            if sight.seen is Seen.MISSED:
                at = tuple(state.placed((i,))[1][i].tolist())
                marks.append(Label(position=at, text=f"not detected: {sight.why}", verdict=Verdict.EXCEEDED))
        return Result(
            name=name,
            value=near,
            unit="m",
            limit=0.0,
            at_most=False,
            verdict=verdict,
            reason=reason,
            interval=(least, near) if least < near else None,
            parts=(*each, *self._ways(bool(sights), triggered), *parts),
            markers=(*marks, *markers),
        )

    def _name(self, nearest: int) -> str:
        return self.model.bodies[self.bodies[nearest]].name

    def _worst_sight(self, sights: Mapping[int, Sight]) -> str:
        """The worst first: who is not detected although in the field."""
        if all(sight.seen is Seen.MISSED for sight in sights.values()):
            i, sight = next(iter(sights.items()))
            return f"NOT detected: {self.model.bodies[i].name}, {sight.why}"
        surely = [i for i, sight in sights.items() if sight.seen is Seen.DETECTED]
        if surely:
            return "detected: " + ", ".join(self.model.bodies[i].name for i in surely)
        i, sight = next((i, s) for i, s in sights.items() if s.seen is Seen.MAYBE)
        return f"may be missed: {self.model.bodies[i].name}, {sight.why}"

    def _ways(self, present: bool, triggered: bool) -> tuple[Result, ...]:
        if not present:
            return ()
        why = "" if triggered else "not detected yet"
        ways = [Result(name="walked before detection", value=self.undetected, unit="m", reason=why)]
        response = self.sensor.response
        if triggered:
            ways.append(
                Result(
                    name="walked until the output switched",
                    value=self.until_output if response is not None else None,
                    unit="m",
                    verdict=Verdict.UNDECIDED if response is None else None,
                    reason="response time not given" if response is None else "",
                )
            )
        return tuple(ways)

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


def seen_in_field(name: str, presence: Presence, judge: Evaluate) -> Evaluate:
    """Judge people of whom a part is seen: who is in the field with that part is in it.

    What the device makes of it stays open, since a bone that nobody sees may shade another.

    Args:
        name: Of the criterion.
        presence: Of the whole question.
        judge: It.
    """
    model, (field,) = presence.model, presence.gap.a

    def without(lost: tuple[int, ...]) -> Evaluate | None:
        bodies = tuple(i for i in presence.bodies if i not in lost)
        if not bodies:
            return None
        rest = Presence(model, presence.sensor, field, bodies)

        def evaluate(state: State) -> Result:
            _, inside = rest.inside(state)
            why = "whether the device sees it is open"
            sights = {i: Sight(Seen.MAYBE, why) for i, there in zip(bodies, inside, strict=True) if there}
            return rest.result(name, state, sights)

        return evaluate

    return seen_first(presence.bodies, judge, without)
