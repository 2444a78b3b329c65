"""What the twin of a person is pulled toward, from what any number of devices see of it.

Every device's samples wait here until the engine needs them. At each instant somebody speaks of, all
devices are brought to it (between two samples interpolated, after the newest held), each bone is taken
from the device that counts most for it, and the posture that agrees best with all that is the joint
reference of that instant. The engine's controllers pull the body there; contacts decide the rest.

Nothing here believes a jump: a point that nobody could have moved so far since it was last believed is
left out until it is near enough in time and place, joints move no faster than a person can, and whoever
appears elsewhere is put there, not dragged. Whatever is left out or held says why, for the verdicts.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from msgspec import structs

from seerob.core.samples import BodyPoint, BodySample, Placing, Quality, Vec3
from seerob.core.transforms import Array, inverse
from seerob.description.capture.estimated import (
    ENDS,
    Turn,
    aimed,
    bare,
    estimated,
    invalid_with,
    located,
    swing,
    turned,
    undetermined,
)
from seerob.description.capture.fitting import Fitter, Pulls, pulls
from seerob.description.capture.frozen import Frozen
from seerob.description.capture.handover import Handover, between
from seerob.description.capture.smoothing import HIGHEST, LOWEST, POINT_SLACK, POINT_SPEED, Smoother
from seerob.description.description import Description, JointKind
from seerob.description.humans.skeleton import AXES, BONES, without_side

SPEED = {"rad": 10.0, "m": 5.0}
"""No joint of a person at work is faster; the waist's translation [rad/s, m/s]."""
FAR = 0.25
"""A bone that is farther from where it is seen [m] is not followed."""
TURNED = np.radians(45.0)
"""A bone that is turned farther from how it is seen [rad] is not followed."""
MOST_KEPT = 4096
"""Samples per device at most; many times what lies between two ticks."""
MOST_DEVICES = 32
MOST_POINTS = 2000
"""Of one sample."""
LARGEST = 1e6
"""No number of a point is larger, in SI."""
SLACK = 1e-9
"""Instants that differ by less are the same [s]."""
MANY = 0.3
"""Share of a device's points that jump at once, beyond which none of them is believed."""
HELD_SPEED = 2.0
"""What is held may have moved so fast meanwhile [m/s]: a reaching hand, K of ISO 13855:2010, 6.2 (2+)."""
SWUNG_SPEED = 5.0
"""Legs that are not seen may have moved so fast meanwhile [m/s]: the foot of somebody who walks swings at up
to 4 to 5 m/s (M)."""
COASTS = 0.25
"""So long the twin of a person goes on at its speed when nothing more is heard live [s]; our choice: what is
lost on the way from a headset mostly lasts no longer, and who walks at 1.6 m/s goes 0.4 m meanwhile."""
LEGS = ("thigh", "shank", "foot", "toes")
STARTS = 20.0
"""No waist gets faster or slower with more [m/s²]: sprinters start with some 10 m/s² (M), falls have 9.8."""
STARTS_WITHIN, STARTS_NOISE, STARTS_HOLD = 0.1, 0.3, 0.5
"""Mean speeds of two such times are compared [s]; by how much a waist's may be off [m/s]: 2 cm of a depth
camera; how long what is found counts [s]."""
WHOLE = 8
"""Bones of which places are seen that tell where the waist is: beside a hand alone it is a guess."""
AGAIN = 1e-5
"""A sample that follows another this soon [s] says it again, with a doubt (`seerob.devices.live.receivers`):
the posture is the same to the last bit. The fit would find it a little nearer, and a millionth of a metre
within a microsecond is metres per second that the twin would go on with."""
ELSEWHERE = 0.1
"""Whoever was not seen for a while and is farther from before [rad or m] is put there, not pulled."""


K = TypeVar("K")
InvalidPart = tuple[str, tuple[str, ...]]
"""Why some bones may not be relied on, and which."""


@dataclass(frozen=True, eq=False)
class Followed:
    """The posture at one instant."""

    t: float
    """[s]"""
    q: Array
    """Joint reference [rad or m], shape (53,)."""
    reason: str
    """Why it may not be relied on; empty when it may."""
    parts: tuple[InvalidPart, ...]
    """Why single bones may not be, and which, when the others may."""
    anew: bool
    """Nobody knows how the person came here: it is to be put there."""
    late: bool
    """Run time stood still before it (`Quality.LATE`): nobody knows how fast the person is."""
    seen: Pulls
    """What it was made of, in the root's frame."""
    observed: frozenset[str] = frozenset()
    """Bones that some device sees, each within its hold time."""
    bare: frozenset[str] = frozenset()
    """Those of them of limbs of which nothing shows where they point."""
    unaimed: Mapping[str, float] = field(default_factory=dict)
    """Hands, feet and heads of which nothing but the joint is seen: bone → bound on the angle between how
    the twin's is turned and how the person's may be [rad]."""
    undetermined: frozenset[tuple[str, int]] = frozenset()
    """Angles of the posture that nothing tells, with their side, by `estimated.undetermined`."""
    unplaced: frozenset[str] = frozenset()
    """Bones that point as they are seen, or as the bones beside them tell, and nobody says where they are."""
    displaced: frozenset[str] = frozenset()
    """Bones of ``unplaced`` of which a place was seen before, or all of them when nobody says where anything
    is."""
    slack: Mapping[str, float] = field(default_factory=dict)
    """Bone → how much farther a point of it may be than the newest of what is seen shows [m]: what is held
    may have moved, and another device may see it elsewhere."""
    placings: tuple[Placing, ...] = ()
    """How well it is known where the worlds of devices lie that were heard, where that is not exact."""


@dataclass(frozen=True)
class _DeviceReading:
    """What one device says of an instant."""

    points: list[BodyPoint]
    reason: str = ""
    """Why all of it may not be relied on."""
    part: InvalidPart | None = None
    jumped: bool = False
    """Something was left out because it jumped."""
    late: bool = False
    """Its sample is `Quality.LATE`."""
    placing: Placing | None = None
    """Of its sample."""


class _Waist:
    """Whether what is seen of a waist can be its motion: a picture that drifts has no mass."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, Array]] = deque()
        self._found, self._until = "", -np.inf

    def forget(self) -> None:
        """What was seen before says nothing of what comes."""
        self._past.clear()

    def __call__(self, t: float, place: Array) -> str:
        """Why it cannot have come here; empty when it may.

        Args:
            t: Later than before [s].
            place: [m], shape (3,).
        """
        past = self._past
        past.append((t, place))
        while len(past) > 2 and past[1][0] <= t - 2 * STARTS_WITHIN - SLACK:
            past.popleft()
        middle = next((k for k in reversed(past) if k[0] <= t - STARTS_WITHIN + SLACK), past[0])
        begin = next((k for k in reversed(past) if k[0] <= middle[0] - STARTS_WITHIN + SLACK), middle)
        first, second = middle[0] - begin[0], t - middle[0]
        if 0 < first <= 5 * STARTS_WITHIN and 0 < second <= 5 * STARTS_WITHIN:
            speeds = (place - middle[1]) / second, (middle[1] - begin[1]) / first
            gained = float(np.linalg.norm(speeds[0] - speeds[1]))
            if gained > STARTS * 0.5 * (first + second) + STARTS_NOISE:
                a = 2 * gained / (first + second)
                self._found = f"the waist would change its speed with {a:.0f} m/s², as nobody can"
                self._until = t + STARTS_HOLD
        return self._found if t <= self._until else ""


@dataclass
class _Device:
    """What one source said."""

    times: list[float] = field(default_factory=list)
    samples: list[BodySample] = field(default_factory=list)
    believed: dict[str, tuple[float, Vec3]] = field(default_factory=dict)
    """Point → when and where it was last believed."""
    seen: dict[str, float] = field(default_factory=dict)
    """Bone → when it was last seen, or first told of without being seen."""
    observed: dict[str, float] = field(default_factory=dict)
    """Bone → when it was last seen indeed."""
    placed: dict[str, float] = field(default_factory=dict)
    """Bone → when a place of it was last seen."""
    anchored: dict[str, float] = field(default_factory=dict)
    """Bone → when a place of it was last seen that says where the person stands."""
    turned: dict[Turn, float] = field(default_factory=dict)
    """Bone and axis → when it was last seen how it is turned about it."""
    leaning: dict[str, float] = field(default_factory=dict)
    """Bone → when it was last seen by joints that may lean while the person does not."""
    smoother: Smoother = field(default_factory=Smoother)
    frozen: Frozen = field(default_factory=Frozen)

    def forget(self, t: float) -> None:
        """Drop what is older than the last sample at or before ``t``."""
        k = max(bisect_right(self.times, t) - 1, len(self.times) - MOST_KEPT)
        if k > 0:
            del self.times[:k], self.samples[:k]


class Following:
    """One person and all devices that see it."""

    def __init__(self, description: Description, world_from_root: Array, timeout: float = np.inf) -> None:
        """Know the person.

        Args:
            description: Of `seerob.description.humans.manikin.build`.
            world_from_root: Where its root stands, (4, 4).
            timeout: Age from which on nothing that was seen of the person may be relied on [s], whatever
                the devices' hold.
        """
        self._timeout = timeout
        self._placed_before: set[str] = set()
        self._fitter = Fitter(description)
        self._root_from_world = inverse(world_from_root)
        self._speed = np.array([SPEED["m" if a.kind is JointKind.PRISMATIC else "rad"] for a in AXES])
        self._devices: dict[str, _Device] = {}
        self._instants: list[float] = []
        self._last: Followed | None = None
        self._history: list[Followed] = []
        self._handover = Handover()
        self._waist = _Waist()
        self._waits = False
        """Nothing was believed of late: where the person is now is not known."""

    def hear(self, sample: BodySample) -> bool:
        """Take a sample; False for one that is not newer than the last of its device, which is dropped."""
        if sample.source not in self._devices and len(self._devices) >= MOST_DEVICES:
            return False
        device = self._devices.setdefault(sample.source, _Device())
        if not np.isfinite(sample.t) or (device.times and sample.t <= device.times[-1]):
            return False
        if len(sample.points) > MOST_POINTS or not 0 < sample.hold < LARGEST:
            return False
        sample = structs.replace(sample, points=device.frozen(sample.points, sample.t))
        if sample.smoothing:
            if not LOWEST <= sample.smoothing <= HIGHEST:
                return False
            smooth = device.smoother(sample.points, sample.t, sample.smoothing)
            sample = structs.replace(sample, points=smooth)
        device.times.append(sample.t)
        device.samples.append(sample)
        k = bisect_right(self._instants, sample.t)
        if k == 0 or self._instants[k - 1] < sample.t:
            self._instants.insert(k, sample.t)
            del self._instants[:-MOST_KEPT]
        return True

    def until(self, t: float) -> Iterator[Followed]:
        """Postures at the instants that were heard of, up to the first one after ``t`` [s], each once."""
        while self._instants and (self._last is None or self._last.t < t):
            instant = self._instants.pop(0)
            if self._last is not None and instant <= self._last.t:
                continue
            found = self._at(instant)
            if found is None:
                continue
            self._last = found
            self._history.append(found)
            del self._history[:-MOST_KEPT]
            yield found
        for device in self._devices.values():
            device.forget(min(t, np.inf if self._last is None else self._last.t))

    def _at(self, t: float) -> Followed | None:
        readings = [self._device_at(device, name, t) for name, device in self._devices.items()]
        points = [each.points for each in readings]
        reasons = [each.reason for each in readings if each.reason]
        late = any(each.late for each in readings)
        parts = [each.part for each in readings if each.part is not None]
        chosen, last = self._handover.choose(points, t), self._last
        if not chosen:
            if last is None or not any(each.jumped for each in readings):
                return None
            self._waits = True
            reasons += [why for why, _ in parts]
            return Followed(
                t, last.q, "; ".join(reasons[:4]), (), False, late, pulls((), self._root_from_world)
            )
        parts += self._lost(t)
        here = {point.bone for point in chosen}
        parts = [(why, _with_others(bones, here)) for why, bones in parts]
        found = pulls(chosen, self._root_from_world)
        # After a silence, or where nothing was believed, a person may be anywhere, in any posture.
        hold = max(device.samples[-1].hold for device in self._devices.values() if device.samples)
        lost = last is not None and (self._waits or t - last.t > hold)
        reach = np.inf if last is None or lost else self._speed * (t - last.t)
        before, since = (None, np.inf) if last is None or lost else (last.q, t - last.t)
        q, error = self._fitter.fit(self._eased(found, before, t), before, reach=reach, since=since)
        if before is not None and since < AGAIN:
            q = before
        moved = np.zeros(len(q)) if last is None else np.abs(q - last.q)
        elsewhere = lost and bool(moved.max() > ELSEWHERE)
        self._waits = False
        if (moved >= 0.999 * reach).any():
            joint = AXES[int((moved / reach).argmax())].name
            reasons.append(f"{joint} would move faster than a person can")
        reasons += _residual(found, error)
        if lost:
            self._waist.forget()
        if elsewhere:
            reasons.append("appeared elsewhere")
        observed = self._seen(t, lambda device: device.observed)
        placed = self._seen(t, lambda device: device.placed)
        if len(placed) < WHOLE:
            self._waist.forget()
        elif rushed := self._waist(t, q[:3]):
            reasons.append(rushed)
        turns = self._seen(t, lambda device: device.turned)
        open_ends = ENDS & observed.keys() - aimed(turns)
        unaimed = {bone: swing(bone, q, self._fitter.lower, self._fitter.upper) for bone in open_ends}
        leaning = bool(self._seen(t, lambda device: device.leaning))
        reason = "; ".join(reasons[:4])
        bones = bare(observed, placed, turns)
        anchored = self._seen(t, lambda device: device.anchored)
        ages = _located_ages(observed, placed, anchored, turns)
        unplaced = frozenset(BONES).difference(ages, estimated(observed, bones))
        displaced = unplaced & self._placed_before if ages else unplaced
        self._placed_before |= anchored.keys()
        disagreements = self._disagreements(readings, t, q)
        parts += [
            (f"devices see it {far:.2f} m apart: {bone}", (bone,)) for bone, far in disagreements if far > FAR
        ]
        slack = {bone: held_speed(bone) * age for bone, age in ages.items() if age > SLACK}
        for bone, far in disagreements:
            slack[bone] = max(far, slack.get(bone, 0.0))
        # Wherever the twin waited, nobody knows how a person who is seen for the first time came.
        anew = last is None or elsewhere
        return Followed(
            t, q, reason, tuple(parts), anew, late, found, frozenset(observed), bones, unaimed,
            undetermined(turns, leaning=leaning),
            unplaced, displaced, slack,
            tuple(each.placing for each in readings if each.points and each.placing is not None),
        )  # fmt: skip

    def _eased(self, found: Pulls, before: Array | None, t: float) -> Pulls:
        """What is seen, without a jump where another device has taken over."""
        if before is None:
            self._handover.forget()
            return found
        return self._handover.eased(found, t, *self._fitter.bones(before), self._root_from_world)

    def _device_at(self, device: _Device, name: str, t: float) -> _DeviceReading:
        """What a device sees at ``t``: between two samples, or the newest while it counts."""
        k = bisect_right(device.times, t) - 1
        if k < 0:
            return _DeviceReading([])
        sample = device.samples[k]
        age = t - device.times[k]
        if age > sample.hold:
            return _DeviceReading([], part=(f"{name} was not heard for {age:.2f} s", tuple(device.seen)))
        points: Sequence[BodyPoint] = sample.points
        instant = device.times[k]
        if age > 0 and k + 1 < len(device.times) and device.times[k + 1] - device.times[k] <= sample.hold:
            share = age / (device.times[k + 1] - device.times[k])
            instant = t
            points = between(points, device.samples[k + 1].points, share)
        reason = sample.invalid_reason(name)
        if sample.quality is Quality.INVALID:
            return _DeviceReading([], reason)
        reading = self._believed(device, points, instant, reason, placed=sample.placed)
        reading = replace(reading, placing=sample.placing, late=sample.quality is Quality.LATE)
        if not sample.upright:
            device.leaning |= {point.bone: instant for point in reading.points}
        return reading

    def _believed(
        self, device: _Device, points: Sequence[BodyPoint], t: float, reason: str, *, placed: bool
    ) -> _DeviceReading:
        """Without what cannot have moved so far; what is believed is remembered."""
        out: list[BodyPoint] = []
        jumped: dict[str, str] = {}
        for point in points:
            if not (point.position_weight or point.orientation_weight or point.confidence == 0.0):
                continue  # a weight of 0 is as good as not mapped; a confidence of 0 is not seen just now
            device.seen.setdefault(point.bone, t)
            if not _finite(point):
                continue
            if point.position is not None:
                before = device.believed.get(point.name)
                if before is not None:
                    away = float(np.linalg.norm(np.subtract(point.position, before[1])))
                    if away > POINT_SLACK + POINT_SPEED * (t - before[0]):
                        jumped[point.name] = point.bone
                        continue
                device.believed[point.name] = t, point.position
            if point.position is not None or point.wxyz is not None:
                device.seen[point.bone] = t
                if _counts(point):
                    device.observed[point.bone] = t
                if point.position is not None and point.position_weight > 0:
                    device.placed[point.bone] = t
                    if placed:
                        device.anchored[point.bone] = t
                out.append(point)
        device.turned |= dict.fromkeys(turned(out), t)
        if not jumped:
            return _DeviceReading(out, reason)
        why = ", ".join(list(jumped)[:4]) + (" …" if len(jumped) > 4 else "") + " jumped"
        if len(jumped) > MANY * max(1, len(points)):
            # What a device loses so much of, it has lost altogether.
            return _DeviceReading([], "; ".join(filter(None, (reason, why))), jumped=True)
        return _DeviceReading(out, reason, (why, tuple(dict.fromkeys(jumped.values()))), jumped=True)

    def _hold(self, device: _Device) -> float:
        """Age from which on what a device saw does not count [s]."""
        return min(device.samples[-1].hold, self._timeout) + SLACK

    def _seen(self, t: float, what: Callable[[_Device], dict[K, float]]) -> dict[K, float]:
        """Bones, or turns of bones, of which some device sees something, each with its age [s]."""
        found: dict[K, float] = {}
        for device in self._devices.values():
            hold = self._hold(device) if device.samples else -1.0
            for bone, seen in what(device).items():
                if t - seen <= min(hold, found.get(bone, hold)):
                    found[bone] = max(t - seen, 0.0)
        return found

    def _disagreements(
        self, readings: Sequence[_DeviceReading], t: float, q: Array
    ) -> list[tuple[str, float]]:
        """Bones that several devices see, and how far from the posture ``q`` one of them sees it [m]."""
        if sum(bool(each.points) for each in readings) < 2:
            return []
        every = pulls([point for each in readings for point in each.points], self._root_from_world)
        names = [{BONES.index(p.bone) for p in each.points if p.position is not None} for each in readings]
        twice = {bone for k, own in enumerate(names) for bone in own if any(bone in n for n in names[:k])}
        found = self._fitter.errors(every, q)
        return [(BONES[bone], found[BONES[bone]][0] or 0.0) for bone in twice if BONES[bone] in found]

    def _lost(self, t: float) -> list[InvalidPart]:
        """Bones that a device has and that nobody has seen for too long."""
        newest: dict[str, tuple[float, float]] = {}
        for device in self._devices.values():
            if not device.samples:
                continue
            hold = self._hold(device)
            for bone, seen in device.seen.items():
                before = newest.get(bone, (-np.inf, hold))
                newest[bone] = max(seen, before[0]), max(hold, before[1])
        gone = [bone for bone, (seen, hold) in newest.items() if t - seen > hold]
        gone.sort(key=BONES.index)
        still = {bone for device in self._devices.values() for bone in device.frozen.bones}
        found = []
        for why, own in (
            ("not seen any more", [bone for bone in gone if bone not in still]),
            ("frozen, the same value again and again", [bone for bone in gone if bone in still]),
        ):
            if own:
                found.append((f"{why}: {', '.join(own[:6])}", tuple(own)))
        return found

    def errors(self, t: float, q: Array) -> dict[str, tuple[float | None, float | None]]:
        """How far the twin is from what devices saw at ``t``: bone → position [m] and angle [rad].

        Args:
            t: [s]
            q: Joint values of the twin [rad or m], shape (53,).

        Returns:
            The largest of each bone that was seen; None where no position or no orientation was.
        """
        k = sum(f.t <= t + SLACK for f in self._history) - 1
        self._history = self._history[max(0, k) :]
        if k < 0:
            return {}
        here = self._history[0]
        after = self._history[1] if len(self._history) > 1 else None
        if after is not None and after.anew and t > here.t + SLACK:
            return {}
        if after is None or t <= here.t:
            return self._fitter.errors(here.seen, q)
        share = (t - here.t) / (after.t - here.t)
        if here.seen.same(after.seen):
            return self._fitter.errors(here.seen.toward(after.seen, share), q)
        return self._fitter.errors(here.seen if share < 0.5 else after.seen, q)


def held_speed(bone: str) -> float:
    """How fast a bone that is not seen just now may move [m/s]."""
    return SWUNG_SPEED if without_side(bone) in LEGS else HELD_SPEED


def _located_ages(
    observed: Mapping[str, float],
    placed: Mapping[str, float],
    anchored: Mapping[str, float],
    turns: Mapping[Turn, float],
) -> dict[str, float]:
    """Bones of which it is told where they are, each with the age of the oldest that it takes [s]."""
    found: dict[str, float] = {}
    ends: dict[str, float] = {}
    for age in sorted({*observed.values(), *placed.values(), *turns.values()}):
        seen, places = ({bone for bone, own in each.items() if own <= age} for each in (observed, placed))
        ways = {turn for turn, own in turns.items() if own <= age}
        directed = frozenset(BONES).difference(estimated(seen, bare(seen, places, ways)))
        for bone in located(directed, {bone for bone, own in anchored.items() if own <= age}):
            found.setdefault(bone, age)
        for bone in aimed(ways):
            ends.setdefault(bone, age)
    return {bone: max(age, ends.get(bone, 0.0)) for bone, age in found.items()}


def _with_others(bones: Sequence[str], seen: Collection[str]) -> tuple[str, ...]:
    """Bones in doubt with all that are in doubt for want of them."""
    return tuple(dict.fromkeys(other for bone in bones for other in invalid_with(bone, seen)))


def _counts(point: BodyPoint) -> bool:
    """Whether it pulls at all."""
    return (point.position is not None and point.position_weight > 0) or (
        point.wxyz is not None and point.orientation_weight > 0
    )


def _finite(point: BodyPoint) -> bool:
    values = [*point.at, *(point.position or ()), *(point.wxyz or ())]
    values += [point.position_weight, point.orientation_weight]
    return (
        all(abs(value) < LARGEST for value in values)  # false for NaN
        and point.bone in BONES
        and min(point.position_weight, point.orientation_weight) >= 0
        and (point.wxyz is None or sum(x * x for x in point.wxyz) > 0.5)
    )


def _residual(seen: Pulls, error: Array) -> list[str]:
    """Bones that the posture cannot bring to where they are seen."""
    far = np.where(seen.wp > 0, np.linalg.norm(error[:, :3], axis=1), 0.0)
    turned = np.where(seen.wo > 0, np.linalg.norm(error[:, 3:], axis=1), 0.0)
    out = []
    k = int(far.argmax())
    if far[k] > FAR:
        out.append(f"{BONES[seen.bone[k]]} cannot be where {seen.names[k]} is seen ({far[k]:.2f} m off)")
    k = int(turned.argmax())
    if turned[k] > TURNED:
        degrees = np.degrees(turned[k])
        out.append(f"{BONES[seen.bone[k]]} cannot be turned as {seen.names[k]} is seen ({degrees:.0f}° off)")
    return out
