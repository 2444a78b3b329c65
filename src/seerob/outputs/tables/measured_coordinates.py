"""Which of OpenSim's coordinates are estimated because no device saw a bone that they speak of."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache

import numpy as np

from seerob.core.transforms import Array
from seerob.description.humans.skeleton import JOINTS
from seerob.files.motion_capture import opensim_coordinates
from seerob.outputs.sentences import percent

STEP = 1e-3
"""Of a joint, to see which coordinates follow it [rad or m]."""
PER_LINE = 6


class EstimatedCoordinates:
    """Counts the rows in which each coordinate is estimated."""

    def __init__(self) -> None:
        self._rows = self._told = 0
        self._estimated: Counter[str] = Counter()

    def add(self, joints: Sequence[float | None]) -> None:
        """Take a row.

        Args:
            joints: Of `seerob.outputs.tables.people.Person.joints_measured`.
        """
        self._rows += 1
        if joints[0] is None:  # joints or keyframes move the person
            return
        self._told += 1
        lost: list[bool] = np.any(_follows()[:, [not v for v in joints]], axis=1).tolist()
        self._estimated.update(
            name for name, is_lost in zip(opensim_coordinates.coordinates(), lost, strict=True) if is_lost
        )

    def lines(self) -> list[str]:
        """Remarks for the file's header; none when everything was measured, or no device saw the person."""
        named = [f"{name} ({percent(n / self._rows)} of the rows)" for name, n in self._estimated.items()]
        out = [
            f"estimated, no device saw the bones: {', '.join(named[k : k + PER_LINE])}\n"
            for k in range(0, len(named), PER_LINE)
        ]
        if self._told < self._rows and self._told:
            out.append(f"no device saw the person in {self._rows - self._told} of {self._rows} rows\n")
        return out


@cache
def _follows() -> Array:
    """Whether a coordinate follows a joint of ours, shape (37, 53); the pelvis' place follows its joints."""
    rest = 0.1 * np.cos(np.arange(len(JOINTS)))  # no angle is 0, where some would hide
    moved = np.vstack([rest, rest + STEP * np.eye(len(JOINTS))])
    found = opensim_coordinates.from_joints(moved, moved[:, :3])
    return np.asarray((np.abs(found[1:] - found[0]) > STEP**2).T)
