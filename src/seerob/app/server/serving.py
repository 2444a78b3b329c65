"""The server as a whole: a thread with a loop of its own, started and stopped from ordinary code.

At ``/`` is the page, at ``/mesh/<hash>.glb`` are the meshes, at ``/ws`` the snapshots.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import socket
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import AbstractAsyncContextManager
from ipaddress import ip_address
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import Self

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute

from seerob.app.server import page
from seerob.app.server.client import Closing
from seerob.app.server.connection import PromptRequests, WholeBinaryFrames
from seerob.app.server.door import Door
from seerob.app.server.feed import Feed
from seerob.app.server.hub import PATIENCE, Hub
from seerob.app.server.page import FOLDER
from seerob.core.errors import InputError
from seerob.core.host_name import is_address, is_loopback
from seerob.core.snapshot import Scene

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


_log = logging.getLogger(__name__)

LARGEST_MESSAGE = 16384
"""From a page [B]; what a headset sees of a body with both hands has 10 000, a command less than 100."""
PORTS_TRIED = 20
SHORTEST_TOKEN = 16


class Server:
    """Shows a feed to browsers; `start` returns the address to open.

    Args:
        scene: What does not change.
        meshes: Binary glTF per mesh hash of the scene's nodes.
        feed: `live.Live` or `player.Player`.
        host: Address to listen on; anything but this machine's own needs a token.
        port: Port; 0 is any free one, a taken one moves to the next free (see `notice`).
        token: What a visitor must know; it is part of the address that `start` returns.
        hosts: Names, besides addresses and ``localhost``, under which the server may be asked for.
        origins: Origins, such as ``https://line3.example``, whose pages may connect as well.
        page: Folder of the built page.
        patience: How long a page may leave a frame waiting before it is disconnected [s].
    """

    def __init__(
        self,
        *,
        scene: Scene,
        meshes: dict[str, bytes],
        feed: Feed,
        host: str = "127.0.0.1",
        port: int = 8080,
        token: str | None = None,
        hosts: Iterable[str] = (),
        origins: Iterable[str] = (),
        page: Path = FOLDER,
        patience: float = PATIENCE,
    ) -> None:
        self._host, self._wanted, self._token = host, port, token
        self._feed = feed
        self.hub = Hub(scene=scene, feed=feed, patience=patience)
        app = build(hub=self.hub, meshes=meshes, folder=page, lifespan=self._lifespan)
        names = {name.lower() for name in hosts} | ({host.lower()} if not is_address(host) else set())
        self._app = Door(app, hosts=frozenset(names), origins=frozenset(origins), token=token)
        self._thread: Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._uvicorn: uvicorn.Server | None = None
        self._ready = Event()
        self._failure: BaseException | None = None
        self.port = 0
        """Port that is listened on."""
        self.notice = ""
        """What the user should be told, such as that the port was taken."""

    @property
    def url(self) -> str:
        """What to open in a browser."""
        # "Every address" is not one that a browser can open; this machine's own is among them.
        everywhere = is_address(self._host) and ip_address(self._host).is_unspecified
        name = "localhost" if everywhere else f"[{self._host}]" if ":" in self._host else self._host
        return f"http://{name}:{self.port}/" + (f"?token={self._token}" if self._token else "")

    def start(self) -> str:
        """Listen, and return `url`; connections are answered as soon as this returns.

        Raises:
            InputError: No token where one is needed, or nothing to listen on.
        """
        if self._thread is not None:
            raise RuntimeError("a server starts once")
        self._check_token()
        listening = self._listen()
        self._thread = Thread(target=self._run, args=(listening,), name="seerob-server", daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            self._thread.join()
            raise self._failure
        return self.url

    def stop(self) -> None:
        """Close every connection and the port; returns when nothing is left. May be called again."""
        thread, loop = self._thread, self._loop
        if thread is None or loop is None or not thread.is_alive():
            return
        with contextlib.suppress(RuntimeError):  # the loop ended by itself meanwhile
            asyncio.run_coroutine_threadsafe(self._leave(), loop)
        thread.join()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _check_token(self) -> None:
        if self._token is None and not is_loopback(self._host):
            what = f"{self._host!r} can be reached from other machines and no token was given"
            raise InputError.at("server", "host", what, "give a token, or listen on 127.0.0.1")
        if self._token is not None and not (
            len(self._token) >= SHORTEST_TOKEN and self._token.isascii() and self._token.isalnum()
        ):
            what = f"is not {SHORTEST_TOKEN} or more letters and digits"
            raise InputError.at("server", "token", what, "use secrets.token_hex(16)")

    def _listen(self) -> socket.socket:
        tried = range(self._wanted, min(self._wanted + PORTS_TRIED, 65536)) if self._wanted else (0,)
        failure: OSError | None = None
        for port in tried:
            try:
                listening = socket.create_server(
                    (self._host, port), family=socket.AF_INET6 if ":" in self._host else socket.AF_INET
                )
            except OSError as error:
                failure = error
                if error.errno in (errno.EADDRINUSE, errno.EACCES):
                    continue
                break
            self.port = listening.getsockname()[1]
            if self._wanted not in (0, self.port):
                self.notice = f"port {self._wanted}: {failure.strerror if failure else ''}; using {self.port}"
            return listening
        what = f"cannot listen on {self._host!r} port {self._wanted}: {failure}"
        raise InputError.at("server", "port", what, "choose another port, or 0 for any free one")

    def _run(self, listening: socket.socket) -> None:
        config = uvicorn.Config(
            self._app,
            loop="asyncio",
            http=PromptRequests,
            backlog=64,  # so many are accepted before one that is too many can be cut
            ws=WholeBinaryFrames,
            ws_max_size=LARGEST_MESSAGE,
            ws_ping_interval=5.0,
            ws_ping_timeout=10.0,
            # Compression costs latency on each frame; poses hardly compress.
            ws_per_message_deflate=False,
            lifespan="on",
            log_config=None,
            # Below a warning, uvicorn logs addresses, and they may hold the token.
            log_level="warning",
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=2,
        )
        self._uvicorn = uvicorn.Server(config)
        try:
            asyncio.run(self._uvicorn.serve(sockets=[listening]))
        except (Exception, SystemExit) as error:
            if self._ready.is_set():
                _log.exception("the server ended")
            self._failure = error
        finally:
            listening.close()
            self._ready.set()

    @contextlib.asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        self._loop = asyncio.get_running_loop()
        feeding = asyncio.create_task(self._feeding())
        self._ready.set()
        yield
        feeding.cancel()
        await asyncio.gather(feeding, return_exceptions=True)

    async def _feeding(self) -> None:
        try:
            await self._feed.run(self.hub)
        except Exception as error:
            while isinstance(error, ExceptionGroup):
                error = error.exceptions[0]
            # A picture that no longer moves must not stay on a screen as if it were the present.
            _log.error("nothing more to show: %s", error, exc_info=error)
            self.hub.end(Closing(1011, f"nothing more to show: {error}"))

    async def _leave(self) -> None:
        assert self._uvicorn is not None
        self.hub.end(Closing(1001, "the server stops"))
        await asyncio.sleep(0.05)
        self._uvicorn.should_exit = True
        # Whoever does not read cannot be told; a stop does not wait for them.
        await asyncio.sleep(0.5)
        for connection in tuple(self._uvicorn.server_state.connections):
            if connection.transport is not None:
                connection.transport.abort()
