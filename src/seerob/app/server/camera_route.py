"""``/camera/<number>``: the newest picture of a network camera, one per request."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from time import monotonic

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from seerob.devices.live.camera_pictures import Cameras

WAIT = 1.0
"""A request that knows the newest picture is answered after so long at the latest [s]."""


async def answer(cameras: Cameras | None, request: Request) -> Response:
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
