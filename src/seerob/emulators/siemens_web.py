"""A PLC's web server (S7 web API) that plays variables, over real HTTP or HTTPS."""

from __future__ import annotations

import secrets
import socket
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from seerob.emulators.background import Emulator
from seerob.protocols import s7_web

MOST_SESSIONS = 4
Program = Mapping[str, Callable[[float], Any]]
"""Variable → its value at a time since the start [s]."""


class SiemensWebServer(Emulator):
    """A PLC with a web server, in a thread of its own.

    Args:
        program: What it has, by symbolic name: ``"Belt".speed``.
        user: Who may log in.
        password: With which.
        host: Address to listen on.
        port: 0 is any free one.
        certificate: Certificate and key files (PEM); unencrypted without.
        outputs: Bools that may be written; `written` keeps what was.
    """

    def __init__(
        self,
        program: Program,
        *,
        user: str,
        password: str,
        host: str = "127.0.0.1",
        port: int = 0,
        certificate: tuple[Path, Path] | None = None,
        outputs: tuple[str, ...] = (),
    ) -> None:
        super().__init__()
        self.program, self.host, self.port = program, host, port
        self.sessions: set[str] = set()
        self.written: dict[str, list[bool]] = {name: [] for name in outputs}
        self._who, self._certificate = (user, password), certificate
        self._begun = 0.0
        self._server: Any = None

    @property
    def url(self) -> str:
        """Where it is."""
        return f"http{'s' if self._certificate else ''}://{self.host}:{self.port}"

    def begin(self) -> Callable[[], object]:
        """Listen.

        Raises:
            OSError: The port cannot be listened on.
        """
        import uvicorn
        from starlette.applications import Starlette
        from starlette.routing import Route

        listening = socket.create_server((self.host, self.port))
        self.port = listening.getsockname()[1]
        files: dict[str, Any] = {}
        if self._certificate is not None:
            files = {"ssl_certfile": self._certificate[0], "ssl_keyfile": self._certificate[1]}
        app = Starlette(routes=[Route(s7_web.PATH, self._answer, methods=["POST"])])
        config = uvicorn.Config(app, log_config=None, lifespan="off", timeout_graceful_shutdown=0, **files)
        self._server = uvicorn.Server(config)
        self._begun = time.monotonic()
        run = self._server.run
        return lambda: run([listening])

    def started(self) -> None:
        """Wait until clients can connect."""
        while not self._server.started and self._thread is not None and self._thread.is_alive():
            time.sleep(0.005)

    def stopping(self) -> None:
        """Its sessions are gone, too."""
        self._server.should_exit = self._server.force_exit = True
        self.sessions.clear()

    async def _answer(self, request: Any) -> Any:
        from starlette.responses import JSONResponse

        calls = await request.json()
        token = request.headers.get(s7_web.TOKEN, "")
        if isinstance(calls, list):
            return JSONResponse([self._one(call, token) for call in calls])
        return JSONResponse(self._one(calls, token))

    def _one(self, call: dict[str, Any], token: str) -> dict[str, Any]:
        method, params, number = call["method"], call.get("params", {}), call["id"]
        outcome = self._outcome(method, params, token)
        return {"jsonrpc": "2.0", "id": number, **outcome}

    def _outcome(self, method: str, params: dict[str, Any], token: str) -> dict[str, Any]:
        if method == "Api.Login":
            if (params["user"], params["password"]) != self._who:
                return _error(100, "Login failed")
            if len(self.sessions) >= MOST_SESSIONS:
                return _error(4, "No resources")
            token = secrets.token_hex(14)
            self.sessions.add(token)
            return {"result": {"token": token}}
        if token not in self.sessions:
            return _error(2, "Permission denied")
        if method == "Api.Logout":
            self.sessions.discard(token)
            return {"result": True}
        if method == "PlcProgram.Read":
            value = self.program.get(params["var"])
            if value is None:
                return _error(200, "Address does not exist")
            return {"result": value(time.monotonic() - self._begun)}
        if method == "PlcProgram.Write":
            if params["var"] not in self.written:
                return _error(200, "Address does not exist")
            self.written[params["var"]].append(bool(params["value"]))
            return {"result": True}
        if method == "PlcProgram.Browse":
            return {"result": self._below(params.get("var", ""))}
        return _error(-32601, "Method not found")

    def _below(self, address: str) -> list[dict[str, Any]]:
        names: dict[str, bool] = {}
        for name in self.program:
            block, _, rest = name.removeprefix('"').partition('"')
            if not address:
                names[block] = bool(rest)
            elif address == f'"{block}"' and rest:
                names[rest.removeprefix(".")] = False
        return [{"name": name, "has_children": below} for name, below in names.items()]


def _error(code: int, text: str) -> dict[str, Any]:
    return {"error": {"code": code, "message": text}}
