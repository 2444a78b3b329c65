"""The server as a whole: a thread with a loop of its own, started and stopped from ordinary code.

At ``/`` is the page, at ``/mesh/<hash>.glb`` are the meshes, at ``/ws`` the snapshots.

The built page's files: only what is listed is served, so that no path can lead elsewhere.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import gzip
import logging
import socket
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import AbstractAsyncContextManager
from functools import lru_cache
from ipaddress import ip_address
from pathlib import Path
from threading import Event, Thread
from time import monotonic
from types import TracebackType
from typing import Self

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute

from seerob.app.server import trust
from seerob.app.server.access import Role, Tokens, Visits
from seerob.app.server.cad_route import Bringing
from seerob.app.server.camera_routes import BoardFinder, newest_picture
from seerob.app.server.certificates import Tls
from seerob.app.server.client import Closing
from seerob.app.server.connection import Doorstep, PromptLoop, PromptRequests, WholeBinaryFrames
from seerob.app.server.desk import Desk
from seerob.app.server.door import Door
from seerob.app.server.feed import Feed
from seerob.app.server.hub import PATIENCE, Hub
from seerob.core.errors import InputError
from seerob.core.host_name import is_address, is_loopback
from seerob.core.snapshot import Scene
from seerob.devices.live.camera_pictures import Cameras
from seerob.devices.live.headset_offers import Offers
from seerob.protocols.links.tcp_server import stop_accepting
from seerob.session.measuring import Ruler

FOLDER = Path(__file__).parent / "page"

_TYPES = {
    # Written down: some systems' own tables call JavaScript text/plain, which a browser refuses.
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".ico": "image/x-icon",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".map": "application/json",
    ".mjs": "text/javascript; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".webmanifest": "application/manifest+json",
    ".woff2": "font/woff2",
}

_NOT_BUILT = """<!doctype html><html lang="en"><meta charset="utf-8"><title>seerob: page not built</title>
<h1>The page is not built</h1>
<p>The server runs, but the files of its page are not there. In a checkout of the repository, run</p>
<pre>make web</pre><p>and reload. A released package contains them.</p></html>
"""


def files(folder: Path) -> dict[str, Path]:
    """Files below a folder by path as asked for, without links and hidden ones."""
    return {
        path.relative_to(folder).as_posix(): path
        for path in folder.rglob("*")
        if path.is_file() and not path.is_symlink() and not path.name.startswith(".")
    }


LISTED = 1.0
"""How long the list of a folder's files counts [s]: long enough that requests without end do not read it
each time, short enough for a page that is built anew."""


@lru_cache(8)
def _files(folder: Path, _: int) -> dict[str, Path]:
    return files(folder)


def answer(folder: Path, path: str) -> Response:
    """The file at ``path`` (the page itself when empty), packed or not; 503 when the page was not built."""
    listed = _files(folder, int(monotonic() / LISTED))
    if "index.html" not in listed:
        return HTMLResponse(_NOT_BUILT, 503)
    name = path or "index.html"
    file = listed.get(name) or listed.get(f"{name}.gz")
    if file is None:
        return PlainTextResponse("no such file\n", 404)
    kind = _TYPES.get(Path(name).suffix.lower(), "application/octet-stream")
    content = file.read_bytes() if file.suffix != ".gz" else gzip.decompress(file.read_bytes())
    return Response(content, media_type=kind, headers={"Cache-Control": "no-store"})


Lifespan = Callable[[Starlette], AbstractAsyncContextManager[None]]


def build(
    *,
    hub: Hub,
    meshes: Mapping[str, bytes],
    schema: bytes,
    folder: Path,
    tls: Tls | None,
    cameras: Cameras | None,
    bringing: Bringing | None,
    lifespan: Lifespan,
) -> Starlette:
    """The application behind the `Door`.

    Args:
        hub: Serves the WebSockets.
        meshes: Binary glTF by hash.
        schema: JSON schema of the workstation file, for forms; empty where nobody edits.
        folder: The built page.
        tls: Whose authority visitors have to trust.
        cameras: Whose pictures are fetched.
        bringing: Takes CAD files of pages that edit.
        lifespan: What runs while the application does.
    """

    async def mesh(request: Request) -> Response:
        data = meshes.get(request.path_params["name"].removesuffix(".glb"))
        if data is None:
            return PlainTextResponse("no such mesh\n", 404)
        # The address is the content's hash, so that it never changes; private, as it is the user's.
        headers = {"Cache-Control": "private, max-age=31536000, immutable"}
        return Response(data, media_type="model/gltf-binary", headers=headers)

    async def forms(_: Request) -> Response:
        if not schema:
            return PlainTextResponse("nobody edits here\n", 404)
        return Response(schema, media_type="application/json", headers={"Cache-Control": "no-store"})

    async def trusted(request: Request) -> Response:
        return trust.answer(tls, request.url.path)

    async def camera(request: Request) -> Response:
        return await newest_picture(cameras, request)

    async def cad(request: Request) -> Response:
        if bringing is None:
            return PlainTextResponse("nobody edits here\n", 404)
        return await bringing.answer(request)

    finder = BoardFinder()

    async def board(request: Request) -> Response:
        return await finder.answer(request)

    async def file(request: Request) -> Response:
        return await run_in_threadpool(answer, folder, request.path_params["path"])

    routes = [
        WebSocketRoute("/ws", hub.attend),
        Route("/mesh/{name}", mesh),
        Route("/schema.json", forms),
        Route("/camera/{number:int}", camera),
        Route("/cad/{name}", cad, methods=["POST"]),
        Route("/board", board, methods=["POST"]),
        *(Route(path, trusted) for path in sorted(trust.PATHS)),
        Route("/{path:path}", file),
    ]
    return Starlette(routes=routes, lifespan=lifespan)


_log = logging.getLogger(__name__)

LARGEST_MESSAGE = 16384
"""From a page [B]; what a headset sees of a body with both hands has 10 000, a command less than 100."""
PORTS_TRIED = 20


class _Uvicorn(uvicorn.Server):
    """Closes without leaving a connection open that was accepted in its last moment."""

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        for server in self.servers:
            await stop_accepting(server)
        await super().shutdown(sockets)


class Server:
    """Shows a feed to browsers; `start` returns the address to open.

    Args:
        scene: What does not change.
        meshes: Binary glTF per mesh hash of the scene's nodes.
        feed: `live.Live` or `player.Player`.
        host: Address to listen on; anything but this machine's own needs tokens, and TLS or ``clear_text``.
        port: Port; 0 is any free one, a taken one moves to the next free (see `notice`).
        tokens: What visitors must know, by role; a token is part of each address of `urls`.
        tls: Encrypts; see `seerob.app.server.certificates`.
        clear_text: Whether others may be served unencrypted, so that anyone on the way reads and changes it.
        hosts: Names, besides addresses and ``localhost``, under which the server may be asked for.
        desk: Where pages edit the workstation; None where nobody does.
        bringing: Takes CAD files that pages bring; None where none does.
        ruler: Gives that by which pages measure in what is shown; None where they do not.
        cameras: Network cameras whose pictures are handed on.
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
        tokens: Tokens | None = None,
        tls: Tls | None = None,
        clear_text: bool = False,
        hosts: Iterable[str] = (),
        origins: Iterable[str] = (),
        desk: Desk | None = None,
        bringing: Bringing | None = None,
        ruler: Callable[[], Ruler] | None = None,
        cameras: Cameras | None = None,
        page: Path = FOLDER,
        patience: float = PATIENCE,
    ) -> None:
        self._host, self._wanted, self._tokens = host, port, tokens
        self.tls, self.clear_text = tls, clear_text
        self._feed = feed
        self.visits = Visits()
        """Who is, and was, connected."""
        self.offers = Offers()
        """What headsets that show a page see: the sources of the same run take it."""
        self.hub = Hub(
            scene=scene,
            feed=feed,
            offers=self.offers,
            visits=self.visits,
            desk=desk,
            ruler=ruler,
            patience=patience,
        )
        self._meshes = dict(meshes)
        schema = b"" if desk is None else desk.schema
        app = build(
            hub=self.hub,
            meshes=self._meshes,
            schema=schema,
            folder=page,
            tls=tls,
            cameras=cameras,
            bringing=bringing,
            lifespan=self._lifespan,
        )
        known = (*hosts, *(() if tls is None else tls.names))
        names = {name.lower() for name in known} | ({host.lower()} if not is_address(host) else set())
        self._app = Door(
            app,
            hosts=frozenset(names),
            origins=frozenset(origins),
            tokens=tokens,
            visits=self.visits,
            encrypted=tls is not None,
        )
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
        """What to open in a browser; of a server that asks for tokens, to look only."""
        return self.urls[Role.VIEW]

    @property
    def urls(self) -> dict[Role, str]:
        """What to open in a browser, by role; one address for all where no token is asked for."""
        return self.urls_at()

    def urls_at(self, host: str = "") -> dict[Role, str]:
        """What to open in a browser, by role, at an address of this machine; at its first when empty."""
        # "Every address" is not one that a browser can open; this machine's own is among them.
        everywhere = is_address(self._host) and ip_address(self._host).is_unspecified
        name = host or ("localhost" if everywhere else self._host)
        name = f"[{name}]" if ":" in name else name
        base = f"{'http' if self.tls is None else 'https'}://{name}:{self.port}/"
        tokens = self._tokens or ("",) * len(Role)
        return {role: base + (token and f"?token={token}") for role, token in zip(Role, tokens, strict=True)}

    def begin(self, scene: Scene, meshes: Mapping[str, bytes]) -> None:
        """Show another scene from now on; only to be called in the server's own loop.

        Args:
            scene: What does not change until the next one.
            meshes: Those of its nodes; earlier ones are kept, as pages may still ask for them.
        """
        self._meshes.update(meshes)
        self.hub.begin(scene)

    def call(self, act: Callable[[], None]) -> None:
        """Do something in the server's own loop, once it comes to it; nothing when it has stopped."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(act)

    def start(self) -> str:
        """Listen, and return `url`; connections are answered as soon as this returns.

        Raises:
            InputError: No tokens or no TLS where they are needed, or nothing to listen on.
        """
        if self._thread is not None:
            raise RuntimeError("a server starts once")
        self._check_others()
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

    def _check_others(self) -> None:
        if is_loopback(self._host):
            return
        reached = f"{self._host!r} can be reached from other machines"
        if self._tokens is None:
            remedy = "give tokens, or listen on 127.0.0.1"
            raise InputError.at("server", "host", f"{reached} and no token was given", remedy)
        if self.tls is None and not self.clear_text:
            remedy = "give --certificate and --key, or install the extra tls; --clear-text does without"
            what = f"{reached}, and whoever is on the way could read and change what is not encrypted"
            raise InputError.at("server", "host", what, remedy)

    def _listen(self) -> socket.socket:
        tried = range(self._wanted, min(self._wanted + PORTS_TRIED, 65536)) if self._wanted else (0,)
        failure: OSError | None = None
        for port in tried:
            try:
                listening = Doorstep(
                    socket.create_server(
                        (self._host, port), family=socket.AF_INET6 if ":" in self._host else socket.AF_INET
                    )
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
            backlog=64,
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
        config.load()
        config.ssl = None if self.tls is None else self.tls.context
        self._uvicorn = _Uvicorn(config)
        try:
            with asyncio.Runner(loop_factory=PromptLoop) as runner:
                runner.run(self._uvicorn.serve(sockets=[listening]))
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
