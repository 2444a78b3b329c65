"""What a snapshot says of each person: bones, joints, and how far the twin is from the device.

What was heard, as cells with a title each that says the unit: for tables of raw data.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from seerob.core.samples import BodySample, GrabSample, JointSample, PoseSample, Sample, SignalSample
from seerob.core.snapshot import Scene, Snapshot
from seerob.core.transforms import Array
from seerob.description.humans.skeleton import AXES, PARENTS, ROOT

Cell = str | float | bool | None
TIME = "t [s]"
DEVICE_TIME = "device clock [s]"
QUALITY = "quality"
HEAD = (TIME, DEVICE_TIME, "sequence number", QUALITY)
"""Columns that every table of samples begins with."""


def title(sample: Sample) -> str:
    """Which table it belongs to."""
    target = "" if isinstance(sample, SignalSample) else sample.target
    return sample.source if not target or target in sample.source else f"{sample.source} {target}"


def joint_titles(scene: Scene) -> dict[str, tuple[tuple[str, str], ...]]:
    """Name and unit of every joint, by robot and human."""
    return {m.name: tuple((j.name, j.unit) for j in m.joints) for m in scene.mechanisms}


def joint_head(joints: Mapping[str, tuple[tuple[str, str], ...]], name: str, n: int) -> list[str]:
    """Titles of the joints of a robot or human in a table, and of its tracking error.

    Args:
        joints: Of `joint_titles`.
        name: Robot or human.
        n: How many joints there are.
    """
    titles = [f"{joint} [{unit}]" for joint, unit in joints.get(name, ())][:n]
    titles += [f"joint {k + 1} [rad or m]" for k in range(len(titles), n)]
    return [*titles, "tracking error [rad or m]"]


def cells(sample: Sample, joints: Mapping[str, tuple[tuple[str, str], ...]]) -> dict[str, Cell]:
    """Title → what was heard.

    Args:
        sample: As it came in: nothing is interpolated, and what was not seen is None.
        joints: Of `joint_titles`.
    """
    found: dict[str, Cell] = dict(
        zip(HEAD, (sample.t, sample.t_device, float(sample.seq), sample.quality.value), strict=True)
    )
    if isinstance(sample, JointSample):
        found |= _joints(sample, joints.get(sample.target, ()))
    elif isinstance(sample, PoseSample):
        found |= _pose("", sample.position, sample.wxyz)
    elif isinstance(sample, BodySample):
        found["subject"], found["latency [s]"] = sample.subject, sample.latency
        for point in sample.points:
            found |= _pose(f"{point.name} ", point.position, point.wxyz)
            if point.confidence is not None:
                found[f"{point.name} confidence"] = point.confidence
    elif isinstance(sample, GrabSample):
        found["holds"] = sample.piece
    else:
        found |= sample.values
    return found


def _joints(sample: JointSample, known: tuple[tuple[str, str], ...]) -> dict[str, Cell]:
    found: dict[str, Cell] = {}
    names = [*known, *((f"joint {k + 1}", "rad or m") for k in range(len(known), len(sample.q)))]
    torques = {"rad": "N·m", "m": "N"}
    for what, values in (("", sample.q), (" velocity", sample.qd), (" torque", sample.tau)):
        for (name, unit), value in zip(names, values or (), strict=False):
            shown = {"": unit, " velocity": f"{unit}/s", " torque": torques.get(unit, "N·m or N")}[what]
            found[f"{name}{what} [{shown}]"] = value
    return found


def _pose(name: str, position: tuple[float, ...] | None, wxyz: tuple[float, ...] | None) -> dict[str, Cell]:
    found: dict[str, Cell] = {}
    if position is not None:
        found |= {f"{name}{axis} [m]": value for axis, value in zip("xyz", position, strict=True)}
    if wxyz is not None:
        found |= {f"{name}q{axis} [1]": value for axis, value in zip("wxyz", wxyz, strict=True)}
    return found


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
