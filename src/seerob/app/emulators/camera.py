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
from typing import TYPE_CHECKING, Annotated, Any

from seerob.app.emulation.background import HttpEmulator
from seerob.app.emulation.options import EmulatorOptions, Ready, option, port
from seerob.core.errors import InputError, UnknownName
from seerob.description.camera import lens
from seerob.session.reading import read
from seerob.workstation.workstation import Workstation

if TYPE_CHECKING:
    from seerob.app.emulation.seen_cell import Photographer

BOUNDARY = "frame"


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
        # What draws takes a second of processor time to import, which a camera at which nobody looks saves.
        from seerob.app.emulation.seen_cell import Photographer
        from seerob.outputs.picture.jpeg import jpeg

        if self._photographer is None:
            self._photographer = Photographer(self._station, self._camera, self._switched_on)
        return jpeg(self._photographer.picture(time.time()))


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
        found = lens.read(Path(station.folder) / entry.calibration)
        if found.error is None:
            what = "says nothing of where the camera stands"
            raise InputError.at(entry.calibration, "camera", what, "seerob calibrate camera, with --placed")
        server = CameraServer(station, number, host=self.host, port=self.port, rate=self.rate)
        what = f"camera {entry.name} of {station.title or self.cell}, {found.width} × {found.height} px"
        hear = ('[[cameras]] address = "http://{at}/" in its workstation file, and seerob run',)
        return Ready(server, what, f"{self.host}:{self.port}", hear)
