"""What emulated machines with a web server share: real HTTP or HTTPS, in a thread of its own."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import time
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import Any

from seerob.app.emulation.background import Emulator
from seerob.protocols.links.tcp_server import stop_accepting


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
