"""What several devices see of a person at one instant, made one: per bone from the one that counts most."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from msgspec.structs import replace

from seerob.core.samples import BodyPoint, Vec3, Vec4

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
                out.append(replace(p, position=p.position if here else None, wxyz=p.wxyz if turned else None))
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
        out.append(replace(p, position=position, wxyz=wxyz))
    return out


def _nlerp(a: Vec4, b: Vec4, share: float) -> Vec4:
    sign = 1.0 if sum(x * y for x, y in zip(a, b, strict=True)) >= 0 else -1.0
    mixed = [(1 - share) * x + share * sign * y for x, y in zip(a, b, strict=True)]
    norm = float(np.linalg.norm(mixed)) or 1.0
    w, x, y, z = (value / norm for value in mixed)
    return w, x, y, z
