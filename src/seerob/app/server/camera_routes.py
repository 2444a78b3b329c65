"""Pictures of cameras over HTTP, one per request.

``/camera/<number>`` has the newest picture of a network camera. ``POST /board`` finds the corners of a
printed board in a picture that a visitor's device took of it: who may be a person of the twin may do it,
grey, 8 bit, rows from above, as bytes that nothing has to unpack. The page sends what is found with where its
camera was (`seerob.core.page_messages.Register`).
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from time import monotonic

import numpy as np
from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse, Response

from seerob.app.server.access import Role
from seerob.core.errors import InputError
from seerob.description.camera import board as boards
from seerob.description.camera.calibration import corners
from seerob.devices.live.camera_pictures import Cameras

SMALLEST, MOST_PIXELS = 64, 1 << 20
"""Edge of a picture, and its pixels."""
SECONDS = 10.0
"""In which it has to come."""
WAIT = 1.0
"""A request that knows the newest picture is answered after so long at the latest [s]."""


class BoardFinder:
    """Looks for boards, one picture at a time."""

    def __init__(self) -> None:
        self._busy = asyncio.Lock()

    async def answer(self, request: Request) -> Response:
        """Corners of ``?board=`` in a picture of ``?width=`` px: float32, x, y on it [m], x, y in it [px]."""
        if Role.TRACK not in request.scope["state"]["roles"]:
            return PlainTextResponse("this page may not: open the address for tracking\n", 403)
        width = request.query_params.get("width", "")
        if not (
            width.isascii() and width.isdecimal() and SMALLEST <= int(width[:9]) <= MOST_PIXELS // SMALLEST
        ):
            return PlainTextResponse("no such width\n", 400)
        if self._busy.locked():
            return PlainTextResponse("another picture is being looked at\n", 409)
        async with self._busy:
            try:
                board = boards.read(request.query_params.get("board", "")[:60])
                async with asyncio.timeout(SECONDS):
                    picture = await _whole(request)
                if picture is None or len(picture) % int(width) or len(picture) < SMALLEST * int(width):
                    return PlainTextResponse(f"{MOST_PIXELS} pixels at most, in whole rows\n", 413)
                grey = np.frombuffer(picture, np.uint8).reshape(-1, int(width))
                found = await asyncio.to_thread(corners, grey, board)
            except (TimeoutError, ClientDisconnect):
                return PlainTextResponse("did not come whole\n", 408)
            except InputError as error:
                return PlainTextResponse(f"{error}\n", 400)
        if found is None:
            return Response(status_code=204)
        rows = np.column_stack([found.board[:, :2], found.pixels]).astype("<f4")
        return Response(rows.tobytes(), media_type="application/octet-stream")


async def _whole(request: Request) -> bytes | None:
    """What comes; None where it is more than a picture may have."""
    came = bytearray()
    async for piece in request.stream():
        came += piece
        if len(came) > MOST_PIXELS:
            return None
    return bytes(came)


async def newest_picture(cameras: Cameras | None, request: Request) -> Response:
    """The newest picture that is another than ``?after=``; 204 when there is none, 202 with the reason."""
    number, after = request.path_params["number"], request.query_params.get("after", "0")
    camera = None if cameras is None else cameras.of.get(number)
    if camera is None or not (after.isascii() and after.isdecimal() and len(after) < 12):
        return PlainTextResponse("nobody fetches its pictures here\n", 404)
    loop, known = asyncio.get_running_loop(), int(after)
    there = loop.create_future()

    def tell() -> None:
        if not there.done():
            there.set_result(None)

    def from_its_thread() -> None:
        with suppress(RuntimeError):  # the server has stopped meanwhile
            loop.call_soon_threadsafe(tell)

    found = camera.newest(from_its_thread, known)
    if isinstance(found, str) or found.number == known:
        with suppress(TimeoutError):
            await asyncio.wait_for(there, WAIT)
        found = camera.newest()
    if isinstance(found, str):
        return PlainTextResponse(found, 202)
    if found.number == known:
        return Response(status_code=204)
    # How old it is: what a page shows of the present must not be the past.
    headers = {"X-Picture": str(found.number), "X-Age": f"{monotonic() - found.at:.3f}"}
    return Response(found.jpeg, media_type="image/jpeg", headers=headers)
