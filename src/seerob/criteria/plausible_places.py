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
        before, self._due = self._found, state.t + AGAIN
        self._found = tuple(self._implausible(state, self._now(state), feet=not new and not self._found))
        return None if self._found == before else self._found

    def _now(self, state: State) -> Mapping[str, Array]:
        """Joint positions of everybody who was heard; as they were, of whom nothing is heard now."""
        for name in self._where:
            if _placed(state, name):
                captured = state.hearings[name].captured
                here = state.joint_positions(self._model.mechanisms[name])
                self._where[name] = here if captured is None else captured
        return self._where

    def _implausible(self, state: State, q: Mapping[str, Array], *, feet: bool) -> list[Finding]:
        """What is implausible.

        Args:
            state: Now.
            q: Joint positions of everybody who was heard.
            feet: All else is known to be plausible.
        """
        found: list[Finding] = []
        for quantity in placed(self._model, q, feet=feet):
            key, again = quantity.key, quantity.key in self._plausible
            if again and quantity.kind not in (FEET, BELOW):
                continue
            implausible = [f for f in findings([quantity], ()) if f.holds]
            if not implausible or self._confirmed(quantity):
                self._plausible.add(key)
                self._off.pop(key, None)
            elif not again or state.t - self._off.setdefault(key, state.t) >= LASTS:
                found += [_fitted(f, quantity, state) for f in implausible]
        return found

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


def _fitted(finding: Finding, quantity: Quantity, state: State) -> Finding:
    """The finding; of feet that no device sees, which are where the stature has them, with what to do."""
    if quantity.kind not in (FEET, BELOW):
        return finding
    name = quantity.about[0]
    hearing = state.hearings.get(name)
    if hearing is None or not set(hearing.unobserved(state.t)) >= LEGS:
        return finding
    text = (
        f"no device sees the legs of {name}, which are as long as the stature in the file says: fit the "
        "person to the wearer (calibration, in a headset 'fit me' at the wrist) or give their stature"
    )
    return structs.replace(finding, text=f"{finding.text}; {text}")


def _placed(state: State, name: str) -> bool:
    """Whether it was heard where it is."""
    return not state.invalid_source_reason(name) and not state.hearings[name].unplaced(state.t)
