"""The sender of a depth camera's PC without a camera: sends moving persons over a real socket."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

from seerob.app.emulation.message_sender import MessageSender, Way
from seerob.app.emulation.motions import in_rounds
from seerob.app.emulation.options import (
    IN_ROUNDS,
    LIBRARY,
    NOISE,
    EmulatorOptions,
    Noise,
    Ready,
    option,
    port,
)
from seerob.core.transforms import Array, inverse, rotation_from_rpy, transform
from seerob.description.capture.mapping import conventions, plain
from seerob.description.description import Description
from seerob.description.humans import keyframes, manikin
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.protocols.tracking.kinect import JOINTS, PORT, Body, Picture, encode_message

RATE = 30.0
"""Of keyframes [Hz]."""
STATURE = 1.75
CAMERA = transform(rotation_from_rpy((0.0, np.radians(12.0), np.pi)), (2.5, 0.0, 1.6))
"""Where the camera stands that sees our digital human: in front of it, tilted down by 12°."""

Scene = Callable[[float], Picture]
"""What the camera sees at a time [s]."""


def joints(person: Description, q: Array, *, stature: float) -> Array:
    """Where a body tracker would see the joints of our digital human.

    Args:
        person: Made by `seerob.description.humans.manikin.build`.
        q: Joint values [rad, m], shape (..., 53).
        stature: Of the person [m].

    Returns:
        Positions in the person's root frame, z up [m], shape (..., 32, 3).
    """
    rotations, origins = bone_poses(person, q)
    places = conventions()["azure_kinect"].places
    rows = []
    for name in JOINTS:
        place = places[plain(name)]
        bone = BONES.index(place.bone)
        rows.append(origins[..., bone, :] + rotations[..., bone, :, :] @ (place.at * stature))
    return np.stack(rows, axis=-2)


def animated(file: str, *, camera: Array = CAMERA, folder: Path = Path()) -> Scene:
    """Somebody of medium size who does what keyframes say, again and again.

    Args:
        file: Keyframes, or ``library:reach``.
        camera: World from camera (x forward, y left, z up), shape (4, 4).
        folder: Where relative paths start.

    Raises:
        InputError: The file is missing or wrong.
    """
    person = manikin.build(name="person", stature=STATURE, mass=75.0, sex="male")
    played = keyframes.sample(keyframes.read(file, person, folder=folder), person, RATE)
    camera_from_world = inverse(camera)
    seen = joints(person, played.q, stature=STATURE) @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    sure = np.ones(len(JOINTS))
    pictures = [
        Picture(t=t, bodies=(Body(1, row, None, sure),)) for t, row in zip(played.t, seen, strict=True)
    ]
    return repeated(pictures, up=camera_from_world[:3, 2])


def recorded(path: Path, subject: str = "") -> Scene:
    """Who was recorded, in the frame of the camera, again and again.

    Raises:
        InputError: The file is missing or wrong.
    """
    from seerob.devices.sources.kinect_recording import KinectRecording
    from seerob.workstation.workstation import Pose

    # Any pose but the default keeps what is seen in the frame of the camera.
    source = KinectRecording(human="person", file=path.name, subject=subject, at=Pose(rpy=(0.0, 0.0, 0.0)))
    frames = list(source.read(path).frames)
    pictures = []
    for frame in frames:
        seen = bool(np.isfinite(frame.positions).any())
        body = Body(1, frame.positions, frame.orientations, frame.confidence)
        pictures.append(Picture(t=frame.t - frames[0].t, bodies=(body,) if seen else ()))
    return repeated(pictures)


def repeated(pictures: list[Picture], up: Array | None = None) -> Scene:
    """The nearest picture before; from the end it starts again."""
    times = np.array([picture.t for picture in pictures])
    period = float(times[-1]) + (float(times[-1] - times[-2]) if len(times) > 1 else 1.0)

    def scene(t: float) -> Picture:
        k = max(int(np.searchsorted(times, t % period + 1e-9, side="right")) - 1, 0)
        return Picture(t=t, bodies=pictures[k].bodies, camera="emulated", up=up)

    return scene


def measured(scene: Scene, noise: float) -> Scene:
    """What a camera measures of it: what has no noise is taken for frozen.

    Args:
        scene: What is before the camera.
        noise: Standard deviation of each coordinate [m].
    """
    chance = np.random.default_rng(0)

    def picture(t: float) -> Picture:
        seen = scene(t)
        bodies = [
            replace(body, positions=body.positions + noise * chance.normal(size=body.positions.shape))
            for body in seen.bodies
        ]
        return replace(seen, bodies=tuple(bodies))

    return picture if noise else scene


FIRST = 1.0
"""The camera's clock at the first picture [s]; it counts from when it was switched on."""


class KinectSender(MessageSender):
    """The sender, in threads of its own.

    Args:
        scene: What the camera sees; time counts from the start of the sender.
        to: Address and port that datagrams go to; None for a WebSocket that others connect to.
        host: Own address to listen on, with a WebSocket.
        port: Own port to listen on, with a WebSocket; 0 is any free one.
        rate: Pictures per second [Hz].
        way: What happens to each message on the way.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        to: tuple[str, int] | None = ("127.0.0.1", PORT),
        host: str = "127.0.0.1",
        port: int = PORT,
        rate: float = 30.0,
        way: Way | None = None,
    ) -> None:
        super().__init__(to=to, host=host, port=port, rate=rate, way=way)
        self.scene = scene

    def message(self, k: int) -> bytes:
        """The message of a picture."""
        picture = self.scene(self.t(k))
        return encode_message(replace(picture, t=FIRST + self.t(k), frame=k))


# -- options ------------------------------------------------------------------------------------

CONNECT = "seerob probe kinect --set link=websocket --set host={host} --port {port}"
"""How one that listens is heard."""
_FILE = "a recording of a body tracker (.json, .bag, .csv …), or keyframes (.toml, library:…)"


class Kinect(EmulatorOptions, frozen=True, kw_only=True):
    """The sender beside a depth camera (Azure Kinect, Orbbec), which sees a moving person."""

    file: Annotated[str, option(_FILE)] = LIBRARY
    subject: Annotated[str, option("which body of a recording")] = ""
    to: Annotated[str, option("address to send datagrams to")] = "127.0.0.1"
    port: Annotated[int, port("port to send to, or to listen at with --websocket")] = PORT
    rate: Annotated[float, option("pictures per second", "Hz", ge=1, le=60)] = 30.0
    noise: Noise = NOISE
    websocket: Annotated[bool, option("let listeners connect; else UDP")] = False
    in_step: Annotated[float, option(IN_ROUNDS, "s", gt=0)] | None = None

    def person_before(self) -> tuple[str, Array] | None:
        """Who stands before the camera."""
        return (self.file, inverse(CAMERA)) if self._keyframes and self.in_step is not None else None

    @property
    def _keyframes(self) -> bool:
        return self.file.startswith("library:") or self.file.endswith(".toml")

    def ready(self) -> Ready:
        """The sender."""
        scene = animated(self.file) if self._keyframes else recorded(Path(self.file), self.subject)
        scene = measured(scene, self.noise)
        if self.in_step is not None:
            scene = in_rounds(scene, self.in_step)
        to = None if self.websocket else (self.to, self.port)
        server = KinectSender(scene, to=to, host=self.host, port=self.port, rate=self.rate)
        where = self.host if self.websocket else self.to
        hear = (CONNECT,) if self.websocket else ()
        return Ready(server, f"a person, {self.file}", f"{where}:{self.port}", hear)
