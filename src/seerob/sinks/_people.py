"""What a snapshot says of each person: bones, joints, and how far the twin is from the device."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seerob.snapshot import Scene, Snapshot
from seerob.transforms import Array


@dataclass(frozen=True)
class Person:
    """A person of the scene."""

    name: str
    bones: tuple[str, ...]
    slots: tuple[int, ...]
    """Of the bones in `Snapshot.poses`."""
    joints: tuple[tuple[str, str], ...]
    """Name and unit."""

    @property
    def bone_titles(self) -> list[str]:
        """Seven per bone: place and orientation of its frame in the world."""
        places = [f"{axis} [m]" for axis in "xyz"] + [f"q{axis} [1]" for axis in "wxyz"]
        return [f"{bone} {what}" for bone in self.bones for what in places]

    @property
    def error_titles(self) -> list[str]:
        """Two per bone."""
        return [f"{bone} {what}" for bone in self.bones for what in ("position [m]", "angle [rad]")]

    def poses(self, snapshot: Snapshot) -> Array:
        """Of the bones in the world: x, y, z [m], w, x, y, z; shape (bones, 7), as exact as the snapshot."""
        every = np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7)
        return np.asarray(every[list(self.slots)])

    def errors(self, snapshot: Snapshot) -> list[float | None]:
        """In the order of `error_titles`; None where no device sees the bone."""
        seen = snapshot.bones.get(self.name, {})
        return [error for bone in self.bones for error in seen.get(bone, (None, None))]


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
