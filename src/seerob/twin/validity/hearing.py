"""What is known of where a robot, a machine or a person really is.

Which bones of people a question is about, and what is said of those that nobody sees.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from itertools import pairwise
from operator import attrgetter, sub
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from seerob.core.samples import REPEATED, Placing
from seerob.core.transforms import Array
from seerob.description.capture.estimated import estimated
from seerob.description.capture.following import COASTS, Followed, InvalidPart, held_speed
from seerob.description.humans.skeleton import BONES
from seerob.kernels.pull import SLACK as SLACK  # noqa: PLC0414
from seerob.model.model import Model


def bones_of(model: Model, bodies: Sequence[int]) -> tuple[tuple[str, ...], dict[str, frozenset[str]]]:
    """Who moves bodies: all but people, and of each person the bones among them.

    Args:
        model: The compiled workstation.
        bodies: By index. What a person holds asks for the whole person.
    """
    others: dict[str, None] = {}
    people: dict[str, set[str]] = {}
    for body in (model.bodies[i] for i in bodies):
        if body.role == "human":
            people.setdefault(body.owner, set()).add(body.name.removeprefix(f"{body.owner}/"))
        elif body.mover:
            others[body.mover] = None
    return tuple(others), {name: frozenset(bones) for name, bones in people.items()}


def unobserved_reason(person: str, bones: Sequence[str]) -> str:
    """Why nothing is decided of a person of whom bones are not seen; empty when there are none."""
    if not bones:
        return ""
    shown = ", ".join(bones[:6])
    shown = f"{shown} and {len(bones) - 6} more" if len(bones) > 6 else shown
    return f"{person}: no device sees {shown}"


STANDS = 1e-2
"""Speed below which a motion that ends has stopped [rad/s or m/s]: noise of encoders makes standing robots
as fast, and within the time-out nothing gets farther than some millimetres."""


class Places(NamedTuple):
    """What devices leave open of where the bones of a person are, however well they see them turned."""

    unplaced: frozenset[str]
    """Bones of which nobody says where they are."""
    displaced: frozenset[str]
    """Bones of ``unplaced`` of which somebody said before where they are, or all of them when nobody says
    where anything is."""
    slack: Mapping[str, float]
    """Bone → how much farther a point of it may be, as it is held or seen elsewhere, too [m]."""
    placings: tuple[Placing, ...] = ()
    """How well it is known where the worlds of devices lie, where that is not exact."""


EVERYWHERE = Places(frozenset(), frozenset(), MappingProxyType({}))
"""What is left open of a person whose bones are all placed: nothing."""
NOWHERE = Places(frozenset(BONES), frozenset(BONES), {})
"""What is left open of a person whose posture is told, and the place of no bone."""


BoneErrors = Mapping[str, tuple[float | None, float | None]]
"""Bone → how far the twin's is from where a device has it, position [m] and angle [rad]; None where none was
seen."""


class BonesHeard(NamedTuple):
    """What one sample said of the bones of a person, besides how joints are."""

    t: float
    """Its instant [s]."""
    parts: tuple[InvalidPart, ...] = ()
    """Why single bones may not be relied on when the rest may, as (reason, bones)."""
    observed: frozenset[str] | None = None
    """Bones that some device sees; None where no device is asked, as joints move the person."""
    bare: frozenset[str] = frozenset()
    """Bones of limbs that devices see without anything that shows where they point."""
    unaimed: Mapping[str, float] = MappingProxyType({})
    """Hands, feet and heads of which only the joint is seen, with a bound on how far they may be turned from
    the twin's [rad]."""
    undetermined: frozenset[tuple[str, int]] = frozenset()
    """Angles of the posture that nothing tells, each with its side."""
    places: Places = EVERYWHERE
    """Of which bones nobody says where they are."""


class Heard(NamedTuple):
    """What one sample said of a robot, a machine or a person, besides where it is."""

    t: float
    """Its instant [s]."""
    reason: str = ""
    """Why it may not be relied on; empty when it may."""
    torques: Array | None = None
    """Measured joint torques [N·m or N], shape (n,); None where there were none."""
    speed_error: Array | None = None
    """How far its speeds may be off, derived from noisy positions [rad/s or m/s], shape (n,); None where
    nobody says so."""


_INSTANT, _REASON = attrgetter("t"), attrgetter("reason")


@dataclass
class Hearing:
    """What is known of where a robot or human really is."""

    given: bool
    """It stands where the workstation file puts it; no source drives it."""
    driven: bool
    """A source drives it."""
    timeout: float = 0.2
    """[s]"""
    heard: list[Heard] = field(default_factory=list)
    """The newest samples, each newer than the one before; some may lie ahead of the tick."""
    invalid_torque_reason: str = ""
    """Why those torques may not be relied on; empty when they may."""
    error: float = 0.0
    """Largest joint error between twin and reference [rad or m]."""
    bones: dict[str, tuple[float | None, float | None]] = field(default_factory=dict)
    """Bone of a person that devices see → how far the twin's is from the device's, position [m] and angle
    [rad]; None where none was seen."""
    bones_heard: list[BonesHeard] = field(default_factory=list)
    """Of a person, what the newest samples said of bones, oldest first; empty of whom joints move."""
    captured: Array | None = None
    """Of a person whom the physics moves: the joint positions that the twin is pulled to now [rad or m]."""
    captured_v: Array | None = None
    """Their velocities [rad/s or m/s]."""
    held: bool = False
    """Something touches that person, or keeps the twin from being where it is pulled to: how fast the person
    is, what was captured tells, too."""
    residual: dict[str, tuple[float | None, float | None]] = field(default_factory=dict)
    """Errors like `bones`, of those joint positions instead of the twin's, where the twin does not follow."""
    reset_at: float = -np.inf
    """When the physics last lost it, so that it was put back [s]."""
    saturated: bool = False
    """A joint's torque limit was reached: the twin cannot do what was heard."""
    older: float = 0.0
    """How much older than its instant what was heard last may be [s]."""
    leaves_at: float = 0.0
    """Of who stands where he was last said to be: largest speed of a joint then [rad/s or m/s]."""
    once: bool = False
    """It was heard once, or once after a silence, and that told no speed; or not yet often enough to tell how
    noisy the positions are that its speeds follow from; or it is a person who was not heard for longer than
    the twin goes on."""
    grace: float = 0.0
    """How long after its newest sample it may be late all the same [s]."""
    unlike: Array | None = None
    """How far the twin's joint velocities are from those that its source says now [rad/s or m/s], shape (n,);
    None where they are not, or it says none."""
    coarse: str = ""
    """Why what is heard is too coarse for energies and forces; empty when it is not."""

    def copied(self) -> Hearing:
        """Copy it: what is written into the copy changes nothing that is known."""
        return replace(
            self,
            heard=deepcopy(self.heard),
            bones_heard=[*self.bones_heard],
            captured=None if self.captured is None else self.captured.copy(),
            captured_v=None if self.captured_v is None else self.captured_v.copy(),
            bones={**self.bones},
            residual={**self.residual},
        )

    def take(self, said: Heard) -> None:
        """Take what one sample said.

        What is said again with a doubt holds from now on: also what was heard before it and lies ahead of the
        tick is in doubt.
        """
        if said.reason and self.heard and said.t - self.heard[-1].t < REPEATED:
            self.heard = [h if h.reason else h._replace(reason=said.reason) for h in self.heard]
        self.heard.append(said)

    def follow(self, found: Followed) -> None:
        """Take what devices told of a person at one instant."""
        self.take(Heard(found.t, found.reason))
        places = Places(found.unplaced, found.displaced, found.slack, found.placings)
        if any(placing.reason for placing in found.placings):
            places = NOWHERE._replace(slack=found.slack, placings=found.placings)
        self.bones_heard.append(
            BonesHeard(
                found.t, found.parts, found.observed, found.bare, found.unaimed, found.undetermined, places
            )
        )

    def forget(self, t: float) -> None:
        """Drop what is older than the last sample at or before ``t`` [s]."""
        while len(self.heard) > 1 and self.heard[1].t <= t:
            del self.heard[0]
        while len(self.bones_heard) > 1 and self.bones_heard[1].t <= t:
            del self.bones_heard[0]

    def invalid_reason(self, t: float) -> str:
        """Why what was heard does not tell where it is at ``t`` [s]; empty when it does.

        A sample ahead of the tick does not make up for silence before it: all that happened between two
        samples that are further apart than the time-out is a guess.
        """
        if not self.driven:
            return "" if self.given else "no source drives it and the file gives no position (q)"
        k = self._past(t)
        if k == 0:
            return "nothing heard yet"
        last = self.heard[k - 1].t
        age = t - last + self.older
        if age > self.timeout + SLACK:
            why = self.heard[k - 1].reason
            return f"not heard for {age:.2f} s (time-out {self.timeout:.3g} s)" + (why and f": {why}")
        silence = self.heard[k].t - last if k < len(self.heard) else 0.0
        if silence > self.timeout + SLACK and t - last > SLACK:
            return f"not heard for {silence:.2f} s from {last:.3f} s on (time-out {self.timeout:.3g} s)"
        if k == len(self.heard) and t - last > self.grace + SLACK and self.leaves_at > STANDS:
            speed = f"{self.leaves_at:.3g} rad/s or m/s"
            return f"what drives it ends in motion, with {speed} at {last:.3f} s: nobody says that it stopped"
        if not any(map(_REASON, self.heard)):
            return ""
        # Who falls behind has more than one sample ahead: the last takes all of them back.
        heard, until = self.heard, len(self.heard) - 1
        while until > k and not heard[until].t - heard[until - 1].t < REPEATED:
            until -= 1
        for said in heard[k - 1 : until + 1]:
            if said.reason:
                return said.reason
        return ""

    def around(self, t: float) -> list[Heard]:
        """Return the last sample at or before ``t`` [s] and the next one, where there are such."""
        k = self._past(t)
        return self.heard[max(k - 1, 0) : k + 1]

    def _past(self, t: float) -> int:
        """How many of the newest samples are of ``t`` [s] or before."""
        return bisect_right(self.heard, t + SLACK, key=_INSTANT)

    def speed_error(self, t: float) -> Array | None:
        """How far joint velocities may be off at ``t`` [s], shape (n,).

        The worse of two samples, and by how much the twin is faster or slower than both say.
        """
        for said in self.heard:
            if said.speed_error is not None:
                break
        else:
            return self.unlike
        around = [said.speed_error for said in self.around(t) if said.speed_error is not None]
        error = np.max(around, axis=0) if around else None
        if self.unlike is None:
            return error
        return self.unlike if error is None else np.asarray(error + self.unlike)

    def invalid_ahead_reason(self, t: float, until: float) -> str:
        """Why what was heard does not tell what it does from ``t`` to ``until`` [s]; empty when it does."""
        begin, end, longest = t + SLACK, until - SLACK, self.timeout + SLACK
        times = [*map(_INSTANT, self.heard)]
        # What is heard well ahead is mostly so all the way: pairs are looked at where one of them is not.
        doubt = any(map(_REASON, self.heard)) or max(map(sub, times[1:], times), default=0.0) > longest
        for before, said in pairwise(self.heard) if doubt else ():
            a, b = before.t, said.t
            if begin < b and a < end:
                if said.reason:
                    return said.reason
                if b - a > longest:
                    return f"nothing is heard from {a:.3f} s to {b:.3f} s"
        last = self.heard[-1].t if self.heard else -np.inf
        if last < until - SLACK and self.leaves_at > STANDS:
            return f"its motion ends at {last:.3f} s, and what it does after is not known"
        return ""

    def invalid_parts(self, t: float) -> tuple[InvalidPart, ...]:
        """Bones that may not be relied on at ``t`` [s], with the reasons."""
        return tuple(part for said in self._said_of_bones(t) for part in said.parts)

    def unaimed(self, t: float) -> dict[str, float]:
        """Hands, feet and heads at ``t`` [s] of which only the joint is seen, each with a bound [rad].

        It bounds the angle between how the twin's is turned and how the person's may be.
        """
        found: dict[str, float] = {}
        for said in self._said_of_bones(t):
            found |= {bone: max(angle, found.get(bone, 0.0)) for bone, angle in said.unaimed.items()}
        return found

    def unplaced(self, t: float) -> tuple[str, ...]:
        """Bones of which it is known how they are turned at ``t`` [s], and nobody says where they are."""
        found = {bone for said in self._said_of_bones(t) for bone in said.places.unplaced}
        return tuple(bone for bone in BONES if bone in found) if found else ()

    def displaced(self, t: float) -> str:
        """Why nobody may rely any more on where bones are that were placed before; empty when all may."""
        found = {bone for said in self._said_of_bones(t) for bone in said.places.displaced}
        return self._no_place(t, tuple(bone for bone in BONES if bone in found)) if found else ""

    def unplaced_reason(self, t: float) -> str:
        """Why nobody knows where bones are whose directions are known at ``t`` [s]; empty when all are."""
        return self._no_place(t, self.unplaced(t))

    def _no_place(self, t: float, bones: Sequence[str]) -> str:
        if bones and (reasons := [placing.reason for placing in self.placings(t) if placing.reason]):
            return reasons[0]
        return no_position_reason(bones)

    def placings(self, t: float) -> tuple[Placing, ...]:
        """How well it is known at ``t`` [s] where the worlds of devices lie, where that is not exact."""
        every = (placing for said in self._said_of_bones(t) for placing in said.places.placings)
        return tuple(dict.fromkeys(every))

    def slack(self, t: float) -> dict[str, float]:
        """Bones of which a point may be farther than what is seen shows at ``t`` [s], and by how much [m].

        Of whom nothing is heard meanwhile each bone is held: the twin goes on for a while and then stays, the
        person may have turned back at once.
        """
        found: dict[str, float] = {}
        around = self._said_of_bones(t)
        for said in around:
            found |= {bone: max(size, found.get(bone, 0.0)) for bone, size in said.places.slack.items()}
        if len(around) == 1 and (age := t - around[0].t) > SLACK and around[0].observed:
            away = age + min(age, COASTS)
            found = {bone: held_speed(bone) * away + found.get(bone, 0.0) for bone in BONES}
        return found

    def undetermined_angles(self, t: float) -> frozenset[tuple[str, int]]:
        """Angles of the posture at ``t`` [s] that nothing tells, each with its side."""
        return frozenset(angle for said in self._said_of_bones(t) for angle in said.undetermined)

    def unobserved(self, t: float) -> tuple[str, ...]:
        """Bones that no device sees at ``t`` [s] and that the bones beside them do not tell.

        Empty for a person whom no device sees, whom joints or keyframes move.
        """
        around = self._said_of_bones(t)
        seen = [said.observed for said in around if said.observed is not None]
        if not seen:
            return ()
        return estimated(frozenset.intersection(*seen), frozenset().union(*(said.bare for said in around)))

    def _said_of_bones(self, t: float) -> list[BonesHeard]:
        """What was said last by ``t`` [s] and what next: between two samples either may hold."""
        k = 0
        for said in self.bones_heard:
            if not said.t <= t + SLACK:
                break
            k += 1
        return self.bones_heard[max(k - 1, 0) : k + 1]


def no_position_reason(bones: Sequence[str]) -> str:
    """Why nothing rests on where bones are of which only the directions are known; empty for none."""
    shown = ", ".join(bones[:6])
    shown = f"{shown} and {len(bones) - 6} more" if len(bones) > 6 else shown
    which = "the person is" if len(bones) == len(BONES) else f"{shown} {'is' if len(bones) == 1 else 'are'}"
    return f"no device says where {which}, only how bones are turned" if bones else ""
