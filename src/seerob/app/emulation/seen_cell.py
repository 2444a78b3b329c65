"""What stands before an emulated camera: the real things of a cell, where other emulators move them.

Robots and people of `[[emulators]]` that keep step by the clock of this machine (``in_step``) are where those
have them, whatever the twin makes of what they say. Of others nobody here knows where they are: they are left
out, and the picture says so.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from typing import NamedTuple

import mujoco
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from seerob.app.emulation.motions import round_time
from seerob.app.emulation.options import EmulatorOptions, RobotOptions
from seerob.core.errors import InputError
from seerob.core.plugin import kind_of
from seerob.core.snapshot import CameraInfo, Scene, Snapshot
from seerob.core.transforms import Array, rotation_from_wxyz, transform, wxyz_from_rotation
from seerob.description.camera.lens import project
from seerob.description.humans import keyframes
from seerob.devices.capture.options import placement
from seerob.model.model import Mechanism, Model
from seerob.model.mounting.compilation import compile_workstation
from seerob.outputs.picture import lettering
from seerob.outputs.picture.canvas import Camera as Pinhole
from seerob.outputs.picture.canvas import Canvas, Room
from seerob.outputs.picture.stage_bodies import Bodies, read_bodies
from seerob.session.scene import camera_of, scene_of
from seerob.workstation.source import Source
from seerob.workstation.workstation import Pose, Workstation

RATE = 60.0
"""Of keyframes [Hz]."""
MARK = "emulated picture"
LARGEST = 4096
"""Of a picture without distortion [px]: what a lens shows that needs more, it does not."""
STEEPEST = 100.0
"""Beyond this times the distance ahead nothing is looked for."""
_INK = (0.15, 0.2, 0.25)


class Mover(NamedTuple):
    """Somebody who keeps step."""

    mechanism: Mechanism
    joints: Callable[[float], Array]
    """Joint values at a time of the clock [s], shape (n,)."""
    world_from_own: Array
    """Where their world lies in the cell, shape (4, 4)."""


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
        motion = replace(emulator, **there).one_round(emulator.target())
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


# -- its picture --------------------------------------------------------------------------------


class Lens:
    """Where each pixel of a camera with distortion is in a picture without.

    Args:
        size: Width and height [px].
        lens: fx, fy, cx, cy, k1, k2, p1, p2, k3.

    Raises:
        InputError: The distortion is too strong.
    """

    def __init__(self, size: tuple[int, int], lens: Array) -> None:
        width, height = size
        u, v = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
        # x with project(x) = pixel, by fixed points: what distortion adds is taken off again and again.
        wanted = np.stack([(u - lens[2]) / lens[0], (v - lens[3]) / lens[1]], -1)
        rays = wanted.copy()
        for _ in range(50):
            there = project(lens, np.concatenate([rays, np.ones((*rays.shape[:2], 1))], -1))
            off = (there - np.stack([u, v], -1)) / lens[:2]
            rays = np.clip(rays - off, -STEEPEST, STEEPEST)
        reach = np.abs(rays).reshape(-1, 2).max(axis=0)
        self.focal = float(max(lens[0], lens[1]))
        across, down = (2 * np.ceil(self.focal * reach) + 4).tolist()
        if not (np.abs(off) < 1e-3).all() or not max(across, down) <= LARGEST:
            raise InputError.at("calibration", "distortion", "is too strong to be drawn", "calibrate again")
        self.width, self.height = int(across), int(down)
        # The middle of a pixel of OpenCV is at whole numbers, of a picture here at halves.
        columns = self.width / 2 + self.focal * rays[..., 0] - 0.5
        rows = self.height / 2 + self.focal * rays[..., 1] - 0.5
        left = np.clip(columns.astype(np.int64), 0, self.width - 2)
        top = np.clip(rows.astype(np.int64), 0, self.height - 2)
        s, t = (rows - top)[..., None], (columns - left)[..., None]
        shares = ((1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t)
        places = (left + self.width * top + step for step in (0, 1, self.width, self.width + 1))
        self._four = [(at, share.astype(np.float32)) for at, share in zip(places, shares, strict=True)]

    def camera(self, world_from_camera: Array) -> Pinhole:
        """Return the pinhole camera at a place, shape (4, 4), whose pictures `distorted` takes."""
        field = 2 * float(np.arctan(self.height / 2 / self.focal))
        R, at = world_from_camera[:3, :3], world_from_camera[:3, 3]
        return Pinhole(at, R.T, self.width, self.height, field)

    def distorted(self, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The picture as the lens has it, between pixels on the plane through four of them."""
        flat = pixels.reshape(-1, 3)
        seen = sum(share * flat.take(at, axis=0) for at, share in self._four)
        return np.asarray(np.rint(seen), np.uint8)


class Photographer:
    """Draws pictures of a cell; of one thread.

    Args:
        station: What its file says.
        camera: Number of the camera.
        begun: Time of the clock at which the emulators of the cell were switched on [s].
    """

    def __init__(self, station: Workstation, camera: int, begun: float = 0.0) -> None:
        self.cell = SeenCell(station, camera, begun)
        self._lens = Lens(self.cell.info.size, np.array(self.cell.info.lens))
        self._bodies: Bodies = read_bodies(self.cell.scene, self.cell.model.meshes)
        solid = np.array(self.cell.seen, bool)[self._bodies.node]
        self._faces = self._bodies.faces[solid[self._bodies.faces].all(axis=1)]
        self._ids = self._bodies.ids[solid[self._bodies.faces].all(axis=1)]
        self._room = Room()
        left_out = f"; not seen: {', '.join(self.cell.unknown)}" if self.cell.unknown else ""
        self._mark = f"{MARK}{left_out}"

    def picture(self, clock: float) -> NDArray[np.uint8]:
        """What the camera sees at a time of the clock [s], shape (height, width, 3)."""
        snapshot, world_from_camera = self.cell.at(clock)
        vertices, normals = self._bodies.placed(snapshot)
        canvas = Canvas(self._lens.camera(world_from_camera), self._room)
        canvas.shadow(vertices, self._faces, 0.0)
        canvas.bodies(vertices, normals, self._faces, self._ids, self._bodies.colors)
        seen = self._lens.distorted(canvas.pixels())
        size = max(10, seen.shape[0] // 28)
        at = lettering.width(self._mark, size) / 2 + size, seen.shape[0] - 1.2 * size
        lettering.write(seen, at, self._mark, _INK, size)
        return seen
