"""What machines say: newest values of variables, and why one may not be relied on now."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from msgspec.structs import replace

from seerob.core.errors import Undecided
from seerob.core.samples import REPEATED, Quality, SignalSample
from seerob.workstation.variables import Value, Variable

DEFAULT_TIMEOUT = 1.0
"""Time-out [s] of what is heard without a source that states one."""
SLACK = 1e-9
"""Instants that differ by less are the same [s]."""
MAX_KEPT = 4096
"""Pictures kept per source at most."""


class KnownValue(NamedTuple):
    """What is known of a variable at an instant."""

    value: Value | None
    """In SI; None when it was never heard. The last one known when there is a doubt."""
    invalid_reason: str
    """Why it may not be relied on; empty when it may."""


class Signals:
    """The newest pictures of all sources of variables, a few of which may lie ahead of the tick.

    Args:
        dictionary: Variables by name.
        timeouts: Of variables, or of their sources [s], by name.
        untimed: Why nobody knows how late something is, by variable; it shows, and nothing that moves by it
            is known.
    """

    def __init__(
        self,
        dictionary: Mapping[str, Variable],
        timeouts: Mapping[str, float],
        untimed: Mapping[str, str] | None = None,
    ) -> None:
        self.dictionary = dictionary
        self.untimed = untimed or {}
        self._timeouts = {
            name: timeouts.get(name, timeouts.get(variable.source, DEFAULT_TIMEOUT))
            for name, variable in dictionary.items()
        }
        self._heard: dict[str, list[SignalSample]] = {}

    def take(self, sample: SignalSample) -> None:
        """Hear a picture; one that is older than the newest is dropped.

        What is said again because run time fell behind is late from now on, also where that lies ahead.
        """
        heard = self._heard.setdefault(sample.source, [])
        if heard and sample.t < heard[-1].t:
            return
        if heard and sample.quality is Quality.LATE and sample.t - heard[-1].t < REPEATED:
            heard[:] = [replace(s, quality=sample.quality) if s.quality is Quality.GOOD else s for s in heard]
        heard.append(sample)
        del heard[: len(heard) - MAX_KEPT]

    def forget(self, t: float) -> None:
        """Drop what is older than the last picture at or before ``t`` [s]."""
        for heard in self._heard.values():
            while len(heard) > 1 and heard[1].t <= t:
                del heard[0]

    def at(self, name: str, t: float) -> KnownValue:
        """What is known of a variable of the dictionary at an instant [s]."""
        source = self.dictionary[name].source
        picture = next((s for s in reversed(self._heard.get(source, ())) if s.t <= t + SLACK), None)
        if picture is None:
            return KnownValue(None, f"{name}: nothing heard yet")
        value = picture.values.get(name)
        age = t - picture.t + picture.ages.get(name, 0.0)
        timeout = self._timeouts[name]
        if age > timeout + SLACK:
            return KnownValue(value, f"{name}: {source} not heard for {age:.2f} s (time-out {timeout:g} s)")
        return KnownValue(value, invalid_value_reason(picture, name))

    def value(self, name: str, t: float) -> Value:
        """The value of a variable of the dictionary at an instant [s].

        Raises:
            Undecided: It is not known, or may not be relied on.
        """
        known = self.at(name, t)
        if known.value is None or known.invalid_reason:
            raise Undecided(known.invalid_reason or f"{name}: not heard")
        return known.value

    def meanwhile(self, name: str, begin: float, t: float) -> tuple[Value, ...]:
        """Every value of a variable that was told after one instant and before another [s], in their order.

        Raises:
            Undecided: One of them may not be relied on.
        """
        source = self.dictionary[name].source
        found = []
        for picture in self._heard.get(source, ()):
            if begin + SLACK < picture.t < t - SLACK:
                if invalid_reason := invalid_value_reason(picture, name):
                    raise Undecided(f"{invalid_reason}, at {picture.t:.3f} s")
                found.append(picture.values[name])
        return tuple(found)

    def switches(self, name: str, begin: float, t: float) -> tuple[float, ...]:
        """When a variable was told to be another one than before, or to be in doubt or no more so.

        After one instant and until another [s], in their order.
        """
        instants = dict.fromkeys(
            picture.t
            for picture in self._heard.get(self.dictionary[name].source, ())
            if begin + SLACK < picture.t <= t + SLACK
        )
        found, last = [], self.at(name, begin)
        for instant in instants:
            now = self.at(name, instant)
            if (now.value, bool(now.invalid_reason)) != (last.value, bool(last.invalid_reason)):
                found.append(min(instant, t))
            last = now
        return tuple(found)

    def picture(self, t: float) -> tuple[dict[str, Value], dict[str, str]]:
        """Every variable that was heard, and every doubt, at an instant [s]."""
        known = {name: self.at(name, t) for name, v in self.dictionary.items() if not v.write}
        values = {name: k.value for name, k in known.items() if k.value is not None}
        return values, {name: k.invalid_reason for name, k in known.items() if k.invalid_reason}


def invalid_value_reason(picture: SignalSample, name: str) -> str:
    """Why a variable of a picture may not be relied on; empty when it may."""
    if name in picture.doubts:
        return picture.doubts[name]
    if picture.quality is not Quality.GOOD:
        return f"{name}: {picture.invalid_reason('its source')}"
    return "" if name in picture.values else f"{name}: not heard"
