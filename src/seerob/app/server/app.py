"""What is at which address: ``/`` the page, ``/mesh/<hash>.glb`` the meshes, ``/ws`` the snapshots."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute

from seerob.app.server import page
from seerob.app.server.hub import Hub

Lifespan = Callable[[Starlette], AbstractAsyncContextManager[None]]


def build(*, hub: Hub, meshes: Mapping[str, bytes], folder: Path, lifespan: Lifespan) -> Starlette:
    """The application behind the `Door`.

    Args:
        hub: Serves the WebSockets.
        meshes: Binary glTF by hash.
        folder: The built page.
        lifespan: What runs while the application does.
    """

    async def mesh(request: Request) -> Response:
        data = meshes.get(request.path_params["name"].removesuffix(".glb"))
        if data is None:
            return PlainTextResponse("no such mesh\n", 404)
        # The address is the content's hash, so that it never changes; private, as it is the user's.
        headers = {"Cache-Control": "private, max-age=31536000, immutable"}
        return Response(data, media_type="model/gltf-binary", headers=headers)

    async def file(request: Request) -> Response:
        return await run_in_threadpool(page.answer, folder, request.path_params["path"])

    routes = [
        WebSocketRoute("/ws", hub.attend),
        Route("/mesh/{name}", mesh),
        Route("/{path:path}", file),
    ]
    return Starlette(routes=routes, lifespan=lifespan)
