"""Where sources put robots, and devices that saw people put these: is that plausible?

Where a file puts somebody is asked before a run (`seerob.model.mounting.in_place`); where a device does is
known only once it was heard. What is implausible then (nobody within 10 m, feet off the floor, a person
inside a thing) is held until it is plausible once: a wrong unit or frame stays. Feet are looked at for ever:
a step on a chair, or a jump, does not last, and a capture that drifts up or down does. It is confirmed for
all that is no farther beyond than the value in the file: no two sessions tell the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from msgspec import structs

from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.devices.live.listening import LiveSource
from seerob.model.model import Model
from seerob.model.mounting.in_place import BELOW, FEET, placed
from seerob.twin.state import State
from seerob.twin.validity.hearing import Hearing
from seerob.workstation.plausibility.ranges import Quantity, canonical, findings, scaled

LEGS = frozenset(f"{side}_{bone}" for side in ("left", "right") for bone in ("thigh", "shank", "foot"))
AGAIN = 1.0
"""Period at which what is implausible, and where feet are, is asked again [s] of run time."""
LASTS = 3.0
"""Feet that were on something, and are so long on nothing, are not where they are said to be [s]: nobody
jumps for longer, and what somebody stands on for longer is part of the workstation."""


class PlausiblePlaces:
    """Findings about where robots and people were heard to be, bound once.

    Args:
        model: The compiled workstation.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        people = {human.name for human in model.workstation.humans}
        robots = {robot.name for robot in model.workstation.robots}
        self._people = people
        self._waiting = {
            source.target()
            for source in model.workstation.sources
            if source.target() in robots
            or (source.target() in people and (isinstance(source, LiveSource) or source.captured))
        }
        """Whom such a source moves; once they were heard, nobody."""
        self._where: dict[str, Array] = {}
        self._plausible: set[str] = set()
        self._off: dict[str, float] = {}
        """Whose feet left what they stood on, and when [s] of run time."""
        self._hearings: Mapping[str, Hearing] = {}
        """What is known of everybody, by name, of the last instant that was looked at."""
        self._found: tuple[Finding, ...] = ()
        self._due = 0.0

    @property
    def waits(self) -> bool:
        """Whether there is somebody whom a device puts where they are, who was not heard yet."""
        return bool(self._waiting)

    def at(self, state: State) -> tuple[Finding, ...] | None:
        """What is implausible now; None where nothing is new."""
        standing = not self._people.isdisjoint(self._where)
        if not self._waiting and not self._found and not standing:
            return None
        new = [name for name in sorted(self._waiting) if _placed(state, name)]
        if not new and not ((self._found or standing) and state.t >= self._due):
            return None
        for name in new:
            self._waiting.discard(name)
            self._where[name] = state.joint_positions(self._model.mechanisms[name])
        self._hearings = state.hearings
        before, self._due = self._found, state.t + AGAIN
        self._found = tuple(self._implausible(self._now(state), state.t, feet=not new and not self._found))
        return None if self._found == before else self._found

    def _now(self, state: State) -> Mapping[str, Array]:
        """Joint positions of everybody who was heard; as they were, of whom nothing is heard now."""
        for name in self._where:
            if _placed(state, name):
                captured = state.hearings[name].captured
                here = state.joint_positions(self._model.mechanisms[name])
                self._where[name] = here if captured is None else captured
        return self._where

    def _implausible(self, q: Mapping[str, Array], t: float, *, feet: bool) -> list[Finding]:
        """What is implausible.

        Args:
            q: Joint positions of everybody who was heard.
            t: Of the run [s].
            feet: All else is known to be plausible.
        """
        found: list[Finding] = []
        for quantity in placed(self._model, q, feet=feet):
            key, again = quantity.key, quantity.key in self._plausible
            if again and quantity.kind not in (FEET, BELOW):
                continue
            implausible = [f for f in findings([quantity], ()) if f.holds]
            if unfitted := self._unfitted(quantity, t):
                implausible = [structs.replace(f, text=f.text + unfitted) for f in implausible]
            if not implausible or self._confirmed(quantity):
                self._plausible.add(key)
                self._off.pop(key, None)
            elif not again or t - self._off.setdefault(key, t) >= LASTS:
                found += implausible
        return found

    def _unfitted(self, quantity: Quantity, t: float) -> str:
        """What to do about feet that no device sees: they are where a body of the file's stature has them."""
        (name,) = quantity.about[:1]
        hearing = self._hearings.get(name)
        if quantity.kind not in (FEET, BELOW) or hearing is None:
            return ""
        if not set(hearing.unobserved(t)) >= LEGS:
            return ""
        return (
            f"; no device sees the legs of {name}, which are as long as the stature in the file says: fit "
            "the person to the wearer (calibration; in a headset 'fit me' at the wrist) or give their stature"
        )

    def _confirmed(self, quantity: Quantity) -> bool:
        return any(
            isinstance(one.value, float | int) and _no_farther(quantity.values[0], scaled(one.value, factor))
            for one in self._model.workstation.confirmed
            for key, factor in canonical(one.key)
            if key == quantity.key
        )


def _no_farther(value: float, confirmed: float) -> bool:
    """Whether a value is no farther beyond than the one that was confirmed, to the same side."""
    return math.copysign(1.0, value) == math.copysign(1.0, confirmed) and abs(value) <= abs(confirmed)


def _placed(state: State, name: str) -> bool:
    """Whether it was heard where it is."""
    return not state.invalid_source_reason(name) and not state.hearings[name].unplaced(state.t)
