"""What several devices see of a person made one, and from one device to another without a jump.

A bone is taken from the device that counts most for it. One that loses the bone for a frame would else throw
the twin to where another device sees it, and back. Here the device that takes over is shifted at first, so
that it goes on where the twin is, and the shift fades. The shift is told: what a device really sees stays
what the twin is compared with. A device that has lost the bone for longer must see it for a while before it
gets it back.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs

from seerob.core.samples import BodyPoint, Vec3, Vec4
from seerob.core.transforms import Array, rotation_from_axis_angle, wxyz_from_rotation
from seerob.description.capture.fitting import Pulls
from seerob.description.humans.skeleton import BONES

BETTER = 1.25
"""By how much another device must count more for a bone before it takes it over: devices are offset."""


def best(
    devices: Sequence[Sequence[BodyPoint]],
    chosen: dict[tuple[str, bool], int],
    barred: Collection[tuple[str, bool, int]] = (),
) -> list[BodyPoint]:
    """Per bone the positions, and the orientations, of the device that counts most for it.

    Args:
        devices: What each of them sees.
        chosen: The choice of the instant before, which holds until another device counts clearly more;
            brought up to date.
        barred: Bone, whether its orientation is meant, and a device that it is not taken from now.
    """
    if len(devices) == 1:
        return list(devices[0])
    best: dict[tuple[str, bool], tuple[float, int]] = {}
    for k, points in enumerate(devices):
        for p in points:
            for turned, value, weight in (
                (False, p.position, p.position_weight),
                (True, p.wxyz, p.orientation_weight),
            ):
                counts = weight * (BETTER if chosen.get((p.bone, turned)) == k else 1.0)
                if value is None or (barred and (p.bone, turned, k) in barred):
                    continue
                if counts > best.get((p.bone, turned), (0.0, 0))[0]:
                    best[p.bone, turned] = counts, k
    chosen |= {key: k for key, (_, k) in best.items()}
    out = []
    for k, points in enumerate(devices):
        for p in points:
            here = best.get((p.bone, False), (0.0, -1))[1] == k
            turned = best.get((p.bone, True), (0.0, -1))[1] == k
            if (here and p.position is not None) or (turned and p.wxyz is not None):
                out.append(
                    structs.replace(p, position=p.position if here else None, wxyz=p.wxyz if turned else None)
                )
    return out


def between(before: Sequence[BodyPoint], after: Sequence[BodyPoint], share: float) -> list[BodyPoint]:
    """Points that both samples have, a share of the way from one to the other."""
    later = {p.name: p for p in after}
    out = []
    for p in before:
        other = later.get(p.name)
        position: Vec3 | None = None
        wxyz: Vec4 | None = None
        if other is not None and p.position is not None and other.position is not None:
            x, y, z = ((1 - share) * a + share * b for a, b in zip(p.position, other.position, strict=True))
            position = x, y, z
        if other is not None and p.wxyz is not None and other.wxyz is not None:
            wxyz = _nlerp(p.wxyz, other.wxyz, share)
        out.append(structs.replace(p, position=position, wxyz=wxyz))
    return out


def _nlerp(a: Vec4, b: Vec4, share: float) -> Vec4:
    sign = 1.0 if sum(x * y for x, y in zip(a, b, strict=True)) >= 0 else -1.0
    mixed = [(1 - share) * x + share * sign * y for x, y in zip(a, b, strict=True)]
    norm = float(np.linalg.norm(mixed)) or 1.0
    w, x, y, z = (value / norm for value in mixed)
    return w, x, y, z


AGAIN = 0.25
"""A device that did not see a bone for longer must see it for so long before it gets it back [s]."""
FADE = 0.3
"""Time in which a shift is gone [s], and `SPEED`, `TURNING` which it does not exceed."""
SPEED, TURNING = 0.5, 2.0
"""Of a shift that fades [m/s, rad/s]: slower than a person who walks, or who turns a hand."""
Side = tuple[str, bool]
"""A bone, and whether its orientation is meant."""


@dataclass(frozen=True, eq=False)
class _Shift:
    """What is added to what a device says of a bone."""

    begun: float
    """[s]"""
    lasts: float
    """[s]"""
    size: Array
    """At first: displacement [m] or rotation vector [rad] in the root's frame, shape (3,)."""

    def at(self, t: float) -> Array:
        """The rest of it: without a jump in speed at either end."""
        share = min(max((t - self.begun) / self.lasts, 0.0), 1.0)
        return np.asarray(self.size * (1 - share * share * (3 - 2 * share)))


class Handover:
    """Which device each bone is taken from, and what is left of the shifts."""

    def __init__(self) -> None:
        self._chosen: dict[Side, int] = {}
        self._seen: dict[tuple[str, bool, int], tuple[float, float]] = {}
        """Bone, whether its orientation is meant, device → since when it sees it, and when it last did."""
        self._begun: float | None = None
        self._shifts: dict[Side, _Shift] = {}
        self._changed: set[Side] = set()
        self._now: dict[tuple[int, str], Vec3] = {}
        self._before: dict[tuple[int, str], Vec3] = {}

    def choose(self, devices: Sequence[Sequence[BodyPoint]], t: float) -> list[BodyPoint]:
        """Per bone the positions, and the orientations, of the device it is taken from.

        Args:
            devices: What each of them sees at ``t``; in the same order at every call.
            t: [s]
        """
        if len(devices) == 1:
            return list(devices[0])
        self._begun = t if self._begun is None else self._begun
        seen = {
            (p.bone, turned, k)
            for k, points in enumerate(devices)
            for p in points
            for turned, value in ((False, p.position), (True, p.wxyz))
            if value is not None
        }
        self._before = self._now
        self._now = {
            (k, p.name): p.position
            for k, points in enumerate(devices)
            for p in points
            if p.position is not None
        }
        for key in seen:
            since, last = self._seen.get(key, (t, t))
            self._seen[key] = (since if t - last <= AGAIN else t), t
        barred = {
            (bone, turned, k)
            for bone, turned, k in seen
            if (now := self._chosen.get((bone, turned), k)) != k
            and (bone, turned, now) in seen
            and self._seen[bone, turned, k][0] > max(t - AGAIN, self._begun)
        }
        before = dict(self._chosen)
        chosen = best(devices, self._chosen, barred)
        self._changed = {side for side, k in self._chosen.items() if side in before and before[side] != k}
        return chosen

    def forget(self) -> None:
        """Whoever is put somewhere anew is shifted nowhere."""
        self._shifts.clear()

    def eased(self, found: Pulls, t: float, R: Array, p: Array, root_from_world: Array) -> Pulls:
        """What is seen, shifted so that it goes on where the posture before was.

        Args:
            found: Of what `choose` chose, in the root's frame.
            t: [s]
            R: Root from bone of the posture before, (21, 3, 3).
            p: Its bones' positions [m], (21, 3).
            root_from_world: Shape (4, 4).
        """
        for side in self._changed:
            self._begin(found, side, t, R, p, root_from_world[:3, :3])
        self._changed = set()
        self._shifts = {side: shift for side, shift in self._shifts.items() if t < shift.begun + shift.lasts}
        if not self._shifts:
            return found
        position, rotation = found.position.copy(), found.rotation.copy()
        for (bone, turned), shift in self._shifts.items():
            rows = found.bone == BONES.index(bone)
            if turned:
                rotation[rows] = _turn(shift.at(t)) @ rotation[rows]
            else:
                position[rows] += shift.at(t)
        return replace(found, position=position, rotation=rotation)

    def _begin(self, found: Pulls, side: Side, t: float, R: Array, p: Array, turn: Array) -> None:
        bone, turned = side
        i = BONES.index(bone)
        rows = np.flatnonzero((found.bone == i) & ((found.wo if turned else found.wp) > 0))
        if not len(rows):
            return
        if turned:
            size = _vector(R[i] @ found.rotation[rows[0]].T)
        else:
            # Where the device saw it when the posture before was made, so that it goes on at its speed.
            moved = np.array([self._moved(side, found.names[row]) for row in rows]) @ turn.T
            size = (p[i] + found.at[rows] @ R[i].T - (found.position[rows] - moved)).mean(axis=0)
        fastest = TURNING if turned else SPEED
        # The steepest part of the fade is half as steep again as its mean.
        lasts = max(FADE, 1.5 * float(np.linalg.norm(size)) / fastest)
        self._shifts[side] = _Shift(t, lasts, np.asarray(size))

    def _moved(self, side: Side, name: str) -> Array:
        """Way of a point of the device that was chosen since the posture before [m], in the world, (3,)."""
        key = self._chosen[side], name
        before = self._before.get(key, self._now[key])
        return np.array([a - b for a, b in zip(self._now[key], before, strict=True)], float)


def _vector(rotation: Array) -> Array:
    """Rotation vector [rad], (3,), of the shorter way."""
    w, *axis = wxyz_from_rotation(rotation).tolist()
    size = float(np.linalg.norm(axis))
    if size < 1e-9:
        return np.zeros(3)
    angle = 2 * float(np.arctan2(size, abs(w)))
    return np.array(axis, float) * ((angle if w >= 0 else -angle) / size)


def _turn(vector: Array) -> Array:
    angle = float(np.linalg.norm(vector))
    return rotation_from_axis_angle(vector / angle, angle) if angle > 1e-12 else np.eye(3)
