"""What every emulator is: something that begins and ends, and again; also one with a web server."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import time
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import Any, Self

from seerob.protocols.links.tcp_server import stop_accepting


class CannotListen(OSError):
    """One of several ports of an emulator cannot be listened on.

    Args:
        error: Why.
        option: Of the port: ``primary_port``.
        where: Address and port.
    """

    def __init__(self, error: OSError, option: str, where: str) -> None:
        super().__init__(error.errno, error.strerror)
        self.option, self.where = option, where


class Emulator:
    """Works in a thread of its own; derive, and say in `begin` what it does there."""

    def __init__(self) -> None:
        self._over = Event()
        self._thread: Thread | None = None

    def begin(self) -> Callable[[], object]:
        """Take the addresses that are needed, and return what the thread does until `_over` is set.

        Raises:
            OSError: An address cannot be had.
        """
        raise NotImplementedError

    def start(self) -> Self:
        """Begin; returns when it can be reached, or has begun to send.

        Raises:
            OSError: An address cannot be had.
        """
        if self._thread is not None:
            raise RuntimeError("is already started")
        self._over.clear()
        work = self.begin()
        self._thread = Thread(target=work, name=f"seerob-{type(self).__name__}", daemon=True)
        self._thread.start()
        self.started()
        return self

    def started(self) -> None:
        """Called once the thread runs: may wait until it is ready."""

    def stop(self) -> None:
        """End, as a device does that is switched off; it may be started again."""
        if self._thread is not None:
            self._over.set()
            self.stopping()
            self._thread.join()
            self._thread = None

    def stopping(self) -> None:
        """Called before the thread is waited for: may wake it."""

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


class LoopEmulator(Emulator):
    """One whose thread runs an event loop; derive, and say in `serve` what it does there."""

    def __init__(self) -> None:
        super().__init__()
        self._ready = Event()
        self._failure: BaseException | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Serve until it is over.

        Args:
            ready: To be called when clients can connect.
            over: Set when it is stopped.

        Raises:
            OSError: An address cannot be listened on.
        """
        raise NotImplementedError

    def begin(self) -> Callable[[], object]:
        """The loop."""
        self._ready.clear()
        self._failure = None
        return self._run

    def started(self) -> None:
        """Wait until clients can connect."""
        self._ready.wait()
        if self._failure is not None:
            failure, thread, self._thread = self._failure, self._thread, None
            if thread is not None:
                thread.join()
            raise failure

    def stopping(self) -> None:
        """Wake the loop."""
        if self._loop is not None and self._stop is not None:
            with contextlib.suppress(RuntimeError):  # ended by itself
                self._loop.call_soon_threadsafe(self._stop.set)
        self._loop = self._stop = None

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception as error:
            self._failure = error
        finally:
            self._ready.set()

    async def _serve(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        await self.serve(self._ready.set, self._stop)


class HttpEmulator(Emulator):
    """A web server; derive, and say in `routes` what it answers.

    Args:
        host: Address to listen on.
        port: 0 is any free one.
        certificate: Certificate and key files (PEM); unencrypted without.
    """

    def __init__(self, host: str, port: int, certificate: tuple[Path, Path] | None) -> None:
        super().__init__()
        self.host, self.port = host, port
        self._certificate = certificate
        self._begun = 0.0
        self._server: Any = None

    @property
    def url(self) -> str:
        """Where it is."""
        return f"http{'s' if self._certificate else ''}://{self.host}:{self.port}"

    def now(self) -> float:
        """Time since it was started [s]."""
        return time.monotonic() - self._begun

    def routes(self) -> Sequence[Any]:
        """What it answers, routes of `starlette`."""
        raise NotImplementedError

    def begin(self) -> Callable[[], object]:
        """Listen.

        Raises:
            OSError: The port cannot be listened on.
        """
        import uvicorn
        from starlette.applications import Starlette

        listening = socket.create_server((self.host, self.port))
        self.port = listening.getsockname()[1]
        files: dict[str, Any] = {}
        if self._certificate is not None:
            files = {"ssl_certfile": self._certificate[0], "ssl_keyfile": self._certificate[1]}
        app = _unmoved(Starlette(routes=list(self.routes())))
        config = uvicorn.Config(app, log_config=None, lifespan="off", timeout_graceful_shutdown=1, **files)

        class Server(uvicorn.Server):
            """Leaves nothing open: uvicorn ends at once and forgets who was connected."""

            async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
                for server in self.servers:
                    await stop_accepting(server)
                await super().shutdown(sockets)
                for connection in tuple(self.server_state.connections):
                    if connection.transport is not None:
                        connection.transport.abort()
                await asyncio.sleep(0)

        self._server = Server(config)
        self._begun = time.monotonic()
        run = self._server.run
        return lambda: run([listening])

    def started(self) -> None:
        """Wait until clients can connect."""
        while not self._server.started and self._thread is not None and self._thread.is_alive():
            time.sleep(0.005)

    def stopping(self) -> None:
        """Close at once, as a device does that is switched off."""
        self._server.should_exit = self._server.force_exit = True


def _unmoved(app: Any) -> Callable[[Any, Any, Any], Awaitable[None]]:
    """Wrap an app so that visitors who leave, or who are there when it is switched off, go unmentioned."""
    from starlette.requests import ClientDisconnect

    async def answer(scope: Any, receive: Any, send: Any) -> None:
        try:
            await app(scope, receive, send)
        except (ClientDisconnect, asyncio.CancelledError):
            if scope["type"] != "http":
                return
            with contextlib.suppress(RuntimeError):  # it had begun to answer
                await send({"type": "http.response.start", "status": 503, "headers": []})
                await send({"type": "http.response.body"})

    return answer
