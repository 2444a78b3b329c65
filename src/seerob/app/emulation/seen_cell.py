"""What stands before an emulated camera: the real things of a cell, where other emulators move them.

Robots and people of `[[emulators]]` that keep step by the clock of this machine (``in_step``) are where those
have them, whatever the twin makes of what they say. Of others nobody here knows where they are: they are left
out, and the picture says so.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from msgspec.structs import replace

from seerob.app.emulation.motions import round_time
from seerob.app.emulation.options import EmulatorOptions, RobotOptions
from seerob.core.errors import InputError, UnknownName
from seerob.core.plugin import kind_of
from seerob.core.snapshot import CameraInfo, Scene, Snapshot
from seerob.core.transforms import Array, rotation_from_wxyz, transform, wxyz_from_rotation
from seerob.description.humans import keyframes
from seerob.devices.capture.options import placement
from seerob.model.model import Mechanism, Model
from seerob.model.mounting.compilation import compile_workstation
from seerob.session.reading import read
from seerob.session.scene import camera_of, scene_of
from seerob.workstation.source import Source
from seerob.workstation.workstation import Pose, Workstation

RATE = 60.0
"""Of keyframes [Hz]."""


class Mover(NamedTuple):
    """Somebody who keeps step."""

    mechanism: Mechanism
    joints: Callable[[float], Array]
    """Joint values at a time of the clock [s], shape (n,)."""
    world_from_own: Array
    """Where their world lies in the cell, shape (4, 4)."""


def named(file: Path, camera: str) -> tuple[Workstation, int]:
    """A workstation as far as its file goes, and the number of one of its cameras.

    Raises:
        InputError: The file is wrong, or has no camera.
        UnknownName: It has none of that name.
    """
    station = read(file)
    names = [each.name for each in station.cameras]
    if not names:
        raise InputError.at(file, "cameras", "none", "add [[cameras]], which an emulated one stands for")
    if camera and camera not in names:
        raise UnknownName("camera", camera, names)
    return station, names.index(camera) if camera else 0


class SeenCell:
    """A cell as one of its cameras has it before it.

    Args:
        station: What its file says.
        camera: Number of the camera.
        begun: Time of the clock at which emulators were switched on [s]: who works in rounds stands at first.

    Raises:
        InputError: With every mistake in files that it names; where the camera stands is not known.
    """

    def __init__(self, station: Workstation, camera: int, begun: float) -> None:
        bare = replace(station, safety=(), ergonomics=())
        self.model: Model = compile_workstation(bare)
        self.scene: Scene = scene_of(self.model, (), files={})
        self.info: CameraInfo = camera_of(self.model, station.cameras[camera])
        if self.info.place is None:
            key = f"cameras[{camera}].calibration"
            raise InputError.at("workstation.toml", key, self.info.mistake, "calibrate it")
        self._movers = tuple(_movers(self.model, begun))
        self._data = mujoco.MjData(self.model.mj)
        known = {mover.mechanism.name for mover in self._movers}
        self.unknown: tuple[str, ...] = tuple(
            sorted(
                mechanism.name
                for mechanism in self.model.mechanisms.values()
                if mechanism.role in ("robot", "human") and mechanism.name not in known
            )
        )
        """Robots and people of whom nobody here knows where they are."""
        there = any(node.real for node in self.scene.nodes)
        self.seen: tuple[bool, ...] = tuple(
            [node.real or (not there and node.role != "area") for node in self.scene.nodes]
        )
        """Of each node whether it exists: what is ``real``, or everything but areas where nothing is."""
        self.seen = tuple(
            seen and body.mover not in self.unknown
            for seen, body in zip(self.seen, self.model.bodies, strict=True)
        )

    def at(self, clock: float) -> tuple[Snapshot, Array]:
        """Where everything is at a time of the clock [s], and world from camera, shape (4, 4)."""
        model, data = self.model, self._data
        for mechanism in model.mechanisms.values():
            data.qpos[mechanism.q_address] = mechanism.coupling @ mechanism.home + mechanism.offset
        for mover in self._movers:
            m = mover.mechanism
            data.qpos[m.q_address] = m.coupling @ mover.joints(clock) + m.offset
        mujoco.mj_kinematics(model.mj, data)
        elsewhere = {mover.mechanism.name: mover.world_from_own for mover in self._movers}
        poses = np.zeros((len(model.bodies), 7))
        for row, body in zip(poses, model.bodies, strict=True):
            row[:3], row[3:] = data.xpos[body.mj], data.xquat[body.mj]
            if (T := elsewhere.get(body.mover)) is not None:
                row[:3] = T[:3, :3] @ row[:3] + T[:3, 3]
                row[3:] = wxyz_from_rotation(T[:3, :3] @ rotation_from_wxyz(row[3:]))
        place = self.info.place
        assert place is not None  # refused before
        own = transform(rotation_from_wxyz(place.wxyz), place.position)
        if place.node:
            row = poses[[body.name for body in model.bodies].index(place.node)]
            own = transform(rotation_from_wxyz(row[3:]), row[:3]) @ own
        return Snapshot(t=0.0, seq=0, poses=poses.astype("<f4").tobytes()), own


def _movers(model: Model, begun: float) -> Iterator[Mover]:
    """Who of a cell keeps step: the emulators of each kind belong to its sources in their order."""
    sources: dict[str, list[Source]] = defaultdict(list)
    for source in model.workstation.sources:
        sources[kind_of("sources", source)].append(source)
    for emulator in model.workstation.emulators:
        kind = kind_of("emulators", emulator)
        if not sources[kind]:
            continue
        source = sources[kind].pop(0)
        if (mover := _mover(model, emulator, source, begun)) is not None:
            yield mover


def _mover(model: Model, emulator: EmulatorOptions, source: Source, begun: float) -> Mover | None:
    mechanism = model.mechanisms.get(source.target())
    period = getattr(emulator, "in_step", None)
    if mechanism is None or period is None:
        return None
    if mechanism.role == "robot" and isinstance(emulator, RobotOptions):
        if getattr(emulator, "follows", None):  # goes where it is told
            return None
        files = {"file": emulator.file, "waypoints": emulator.waypoints}
        there = {key: str(model.folder / name) for key, name in files.items() if name is not None}
        motion, _ = replace(emulator, in_step=None, **there).motion(emulator.target())
        return Mover(mechanism, lambda clock: np.array(motion(clock % period)[0]), np.eye(4))
    before = emulator.person_before()
    if mechanism.role != "human" or before is None:
        return None
    file, device_from_person = before
    person = mechanism.description
    played = keyframes.sample(keyframes.read(file, person, folder=model.folder), person, RATE)
    length = float(played.t[-1])

    def joints(clock: float) -> Array:
        t = round_time(clock, period, begun) % length
        return np.asarray(played.q[max(int(np.searchsorted(played.t, t + 1e-9, side="right")) - 1, 0)])

    at = getattr(source, "at", None) or Pose()
    return Mover(mechanism, joints, placement(at) @ device_from_person)
