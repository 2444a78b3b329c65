"""How far a person's bones are from where devices see them, over a whole run, in bounded memory.

Errors are counted in classes that are 1 % wide: a percentile is good to half a per cent of itself,
however long the run is; the largest error and its instant are exact.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Errors = Mapping[str, tuple[float | None, float | None]]
"""Bone → position [m] and angle [rad] that is missing, as in `Snapshot.bones`."""

WIDTH = math.log(1.01)
"""Width of a class, as a logarithm."""
LEAST = 1e-6
"""Everything below is in the first class [m or rad]."""
CLASSES = round(math.log(1e9) / WIDTH)
"""The last class has all that is beyond 1000 m or rad."""


class BoneError(NamedTuple):
    """One bone, or all of them, over the run."""

    bone: str
    """Empty for all bones together."""
    what: str
    """``position`` or ``angle``."""
    unit: str
    """``m`` or ``rad``."""
    median: float
    p95: float
    largest: float
    t: float
    """When it was largest [s]."""
    ticks: int
    """In how many ticks the bone was seen; of all bones, the sum."""


class _Counted:
    """The errors of one bone."""

    def __init__(self) -> None:
        self.classes: NDArray[np.int64] = np.zeros(CLASSES, np.int64)
        self.largest, self.t = -math.inf, math.nan

    def take(self, error: float, t: float) -> None:
        k = int(math.log(error / LEAST) / WIDTH) if error > LEAST else 0
        self.classes[min(k, CLASSES - 1)] += 1
        if error > self.largest:
            self.largest, self.t = error, t

    def percentile(self, share: float) -> float:
        """The middle of the class of the smallest error that ``share`` of all do not exceed."""
        summed = np.cumsum(self.classes)
        k = int(np.searchsorted(summed, max(math.ceil(share * int(summed[-1]) - 1e-9), 1)))
        return min(LEAST * math.exp((k + 0.5) * WIDTH) if k else 0.0, self.largest)


_WHAT = (("position", "m"), ("angle", "rad"))


class BoneErrors:
    """What is counted of one person."""

    def __init__(self) -> None:
        self._of: dict[tuple[str, int], _Counted] = {}

    def add(self, bones: Errors, t: float) -> None:
        """Take one tick; what is not a finite number is not counted."""
        for bone, errors in bones.items():
            for k, error in enumerate(errors):
                if error is not None and math.isfinite(error):
                    counted = self._of.get((bone, k))
                    if counted is None:
                        counted = self._of[bone, k] = _Counted()
                    counted.take(error, t)

    def bones(self) -> tuple[BoneError, ...]:
        """Every bone that was seen, first all positions, then all angles."""
        return tuple(
            _bone_error(bone, k, counted)
            for what in range(len(_WHAT))
            for (bone, k), counted in tuple(self._of.items())
            if k == what
        )

    def all(self) -> tuple[BoneError, ...]:
        """Errors of all bones together: position and angle, as far as they were seen."""
        return tuple(
            _bone_error("", k, _together(counted))
            for k in range(len(_WHAT))
            if (counted := [c for (_, what), c in tuple(self._of.items()) if what == k])
        )


def _bone_error(bone: str, k: int, counted: _Counted) -> BoneError:
    what, unit = _WHAT[k]
    return BoneError(
        bone=bone,
        what=what,
        unit=unit,
        median=counted.percentile(0.5),
        p95=counted.percentile(0.95),
        largest=counted.largest,
        t=counted.t,
        ticks=int(counted.classes.sum()),
    )


def _together(counted: Iterable[_Counted]) -> _Counted:
    whole = _Counted()
    for one in counted:
        whole.classes = whole.classes + one.classes
        if one.largest > whole.largest:
            whole.largest, whole.t = one.largest, one.t
    return whole
