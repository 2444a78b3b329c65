"""A network camera without one: a picture of the real things of a cell, through the camera's own lens.

It is drawn by lens and pose of the calibration, from where emulators that keep step have robots and people,
and served as MJPEG over HTTP while somebody looks. It says of itself that it is no photograph.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from seerob.app.emulation.background import HttpEmulator
from seerob.app.emulation.options import EmulatorOptions, Ready, option, port
from seerob.app.emulation.seen_cell import SeenCell, named
from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.description.camera.lens import project, read
from seerob.outputs.picture import lettering
from seerob.outputs.picture.canvas import Camera as Pinhole
from seerob.outputs.picture.canvas import Canvas, Room
from seerob.outputs.picture.jpeg import jpeg
from seerob.outputs.picture.stage_bodies import Bodies, read_bodies
from seerob.workstation.workstation import Workstation

MARK = "emulated picture"
BOUNDARY = "frame"
LARGEST = 4096
"""Of a picture without distortion [px]: what a lens shows that needs more, it does not."""
STEEPEST = 100.0
"""Beyond this times the distance ahead nothing is looked for."""
_INK = (0.15, 0.2, 0.25)


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
        self._left = np.clip(columns.astype(np.int64), 0, self.width - 2)
        self._top = np.clip(rows.astype(np.int64), 0, self.height - 2)
        self._right_share = (columns - self._left).astype(np.float32)[..., None]
        self._down_share = (rows - self._top).astype(np.float32)[..., None]

    def camera(self, world_from_camera: Array) -> Pinhole:
        """Return the pinhole camera at a place, shape (4, 4), whose pictures `distorted` takes."""
        field = 2 * float(np.arctan(self.height / 2 / self.focal))
        R, at = world_from_camera[:3, :3], world_from_camera[:3, 3]
        return Pinhole(at, R.T, self.width, self.height, field)

    def distorted(self, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The picture as the lens has it, between pixels on the plane through four of them."""
        i, j, s, t = self._top, self._left, self._down_share, self._right_share
        upper = pixels[i, j] * (1 - t) + pixels[i, j + 1] * t
        lower = pixels[i + 1, j] * (1 - t) + pixels[i + 1, j + 1] * t
        return np.asarray(np.rint(upper * (1 - s) + lower * s), np.uint8)


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


class CameraServer(HttpEmulator):
    """A network camera, in threads of its own; it draws while somebody looks.

    Args:
        station: The cell, as far as its file goes.
        camera: Number of its camera.
        host: Address to listen on.
        port: 0 is any free one.
        rate: Pictures per second [Hz].
    """

    def __init__(
        self, station: Workstation, camera: int, *, host: str = "127.0.0.1", port: int = 0, rate: float = 5.0
    ) -> None:
        super().__init__(host, port, None)
        self._station, self._camera, self.rate = station, camera, rate
        self._switched_on = time.time()
        self._photographer: Photographer | None = None
        self._drawer: ThreadPoolExecutor

    def begin(self) -> Callable[[], object]:
        """Listen; nothing is drawn before somebody looks.

        Raises:
            OSError: The port cannot be listened on.
        """
        self._drawer = ThreadPoolExecutor(1, "seerob camera")
        return super().begin()

    def stopping(self) -> None:
        """Draw nothing more."""
        super().stopping()
        self._drawer.shutdown(cancel_futures=True)

    def routes(self) -> Sequence[object]:
        """Its pictures, whatever the path."""
        from starlette.routing import Route

        return (Route("/{path:path}", self._answer),)

    async def _answer(self, _: Any) -> Any:
        from starlette.responses import StreamingResponse

        kind = f"multipart/x-mixed-replace; boundary={BOUNDARY}"
        return StreamingResponse(self._pictures(), media_type=kind)

    async def _pictures(self) -> AsyncIterator[bytes]:
        loop = asyncio.get_running_loop()
        while not self._over.is_set():
            begun = loop.time()
            data = await loop.run_in_executor(self._drawer, self.newest)
            head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
            yield head.encode() + data + b"\r\n"
            await asyncio.sleep(max(0.0, begun + 1 / self.rate - loop.time()))

    def newest(self) -> bytes:
        """JPEG of now.

        Raises:
            InputError: What the cell names is missing or wrong.
        """
        if self._photographer is None:
            self._photographer = Photographer(self._station, self._camera, self._switched_on)
        return jpeg(self._photographer.picture(time.time()))


# -- options ------------------------------------------------------------------------------------


class Camera(EmulatorOptions, frozen=True, kw_only=True):
    """A network camera (MJPEG over HTTP), which sees the real things of a cell as its emulators move them."""

    port: Annotated[int, port()] = 8081
    cell: Annotated[str, option("workstation whose camera it is: a file, or a folder")] = "."
    camera: Annotated[str, option("name of that camera; the first when not given")] = ""
    rate: Annotated[float, option("pictures per second", "Hz", ge=1, le=30)] = 5.0

    def ready(self) -> Ready:
        """The camera.

        Raises:
            InputError: The cell is missing or wrong, or nobody knows where its camera stands.
        """
        station, number = named(Path(self.cell), self.camera)
        entry = station.cameras[number]
        found = read(Path(station.folder) / entry.calibration)
        if found.error is None:
            what = "says nothing of where the camera stands"
            raise InputError.at(entry.calibration, "camera", what, "seerob calibrate camera, with --placed")
        server = CameraServer(station, number, host=self.host, port=self.port, rate=self.rate)
        what = f"camera {entry.name} of {station.title or self.cell}, {found.width} × {found.height} px"
        hear = ('[[cameras]] address = "http://{at}/" in its workstation file, and seerob run',)
        return Ready(server, what, f"{self.host}:{self.port}", hear)
