"""What a snapshot says of each person: bones, joints, and how far the twin is from the device."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seerob.core.snapshot import Scene, Snapshot
from seerob.core.transforms import Array
from seerob.description.humans.skeleton import AXES, PARENTS, ROOT


@dataclass(frozen=True)
class Person:
    """A person of the scene."""

    name: str
    bones: tuple[str, ...]
    slots: tuple[int, ...]
    """Places of the bones in `Snapshot.poses`."""
    joints: tuple[tuple[str, str], ...]
    """Name and unit."""

    @property
    def bone_titles(self) -> list[str]:
        """Seven per bone: place and orientation of its frame in the world."""
        places = [f"{axis} [m]" for axis in "xyz"] + [f"q{axis} [1]" for axis in "wxyz"]
        return [f"{bone} {what}" for bone in self.bones for what in places]

    @property
    def measured_titles(self) -> list[str]:
        """One per bone."""
        return [f"{bone} measured" for bone in self.bones]

    @property
    def joint_measured_titles(self) -> list[str]:
        """One per joint."""
        return [f"{joint} measured" for joint, _ in self.joints]

    @property
    def error_titles(self) -> list[str]:
        """Two per bone."""
        return [f"{bone} {what}" for bone in self.bones for what in ("position [m]", "angle [rad]")]

    def poses(self, snapshot: Snapshot) -> Array:
        """Poses of the bones in the world, x, y, z [m], w, x, y, z, as the snapshot has them: (bones, 7)."""
        every = np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7)
        return np.asarray(every[list(self.slots)])

    def measured(self, snapshot: Snapshot) -> list[float | None]:
        """Give 1 for each bone that a device sees at this tick, and 0 for each that is estimated.

        None for every bone where devices say nothing of the person: joints or keyframes move it then, or it
        is not heard.
        """
        seen = _seen(snapshot, self.name)
        return [float(bone in seen) if seen else None for bone in self.bones]

    def joints_measured(self, snapshot: Snapshot) -> list[float | None]:
        """Give 1 for each joint where devices see both bones that it connects, else what `measured` says.

        A joint of the waist, which no bone carries, needs the pelvis alone.
        """
        seen = _seen(snapshot, self.name)
        return [float(_CONNECTED.get(j, _NONE) <= seen) if seen else None for j, _ in self.joints]

    def errors(self, snapshot: Snapshot) -> list[float | None]:
        """In the order of `error_titles`; None where no device sees the bone."""
        seen = snapshot.bones.get(self.name, {})
        return [error for bone in self.bones for error in seen.get(bone, (None, None))]


_CONNECTED = {axis.name: frozenset({axis.bone, PARENTS[axis.bone]} - {ROOT}) for axis in AXES}
_NONE = frozenset({""})
"""Of a joint that is none of ours, which nothing measures."""


def _seen(snapshot: Snapshot, name: str) -> frozenset[str]:
    """Bones that devices see at this tick."""
    bones = snapshot.bones.get(name, {})
    return frozenset(bone for bone, (away, turned) in bones.items() if away is not None or turned is not None)


def people(scene: Scene) -> tuple[Person, ...]:
    """Every person of the scene."""
    found = []
    for mechanism in scene.mechanisms:
        if mechanism.role != "human":
            continue
        own = [
            (k, node.name.rpartition("/")[2])
            for k, node in enumerate(scene.nodes)
            if node.owner == mechanism.name and node.role == "human"
        ]
        found.append(
            Person(
                name=mechanism.name,
                bones=tuple(bone for _, bone in own),
                slots=tuple(k for k, _ in own),
                joints=tuple((j.name, j.unit) for j in mechanism.joints),
            )
        )
    return tuple(found)
