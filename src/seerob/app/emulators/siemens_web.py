"""A PLC's web server (S7 web API) that plays variables, over real HTTP or HTTPS."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from seerob.app.emulation import motions
from seerob.app.emulation.background import HttpEmulator
from seerob.app.emulation.options import EmulatorOptions, Ready, option, port
from seerob.protocols.plc import s7_web

MOST_SESSIONS = 4
IDLE = 120.0
"""A session that nobody uses for so long is freed [s]."""
Program = Mapping[str, Callable[[float], object]]
"""Variable → its value at a time since the start [s]."""


class SiemensWebServer(HttpEmulator):
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
        super().__init__(host, port, certificate)
        self.program = program
        self.sessions: dict[str, float] = {}
        """When each was last used, in time since the start [s]."""
        self.written: dict[str, list[bool]] = {name: [] for name in outputs}
        self._who = user, password

    def routes(self) -> Sequence[object]:
        """Its one address."""
        from starlette.routing import Route

        return (Route(s7_web.PATH, self._answer, methods=["POST"]),)

    def stopping(self) -> None:
        """Its sessions are gone, too."""
        super().stopping()
        self.sessions.clear()

    async def _answer(self, request: Any) -> Any:
        from starlette.responses import JSONResponse

        try:
            calls = await request.json()
        except (ValueError, RecursionError):
            return JSONResponse({"jsonrpc": "2.0", "id": None, **_error(-32700, "Parse error")})
        token = request.headers.get(s7_web.TOKEN, "")
        if isinstance(calls, list):
            return JSONResponse([self._one(call, token) for call in calls])
        return JSONResponse(self._one(calls, token))

    def _one(self, call: Any, token: str) -> dict[str, Any]:
        try:
            method, params, number = call["method"], call.get("params", {}), call["id"]
            outcome = self._outcome(method, params, token)
        except (KeyError, TypeError, AttributeError):
            return {"jsonrpc": "2.0", "id": None, **_error(-32600, "Invalid request")}
        return {"jsonrpc": "2.0", "id": number, **outcome}

    def _outcome(self, method: str, params: dict[str, Any], token: str) -> dict[str, Any]:
        if method == "Api.Login":
            if (params["user"], params["password"]) != self._who:
                return _error(100, "Login failed")
            for forgotten in [t for t, used in self.sessions.items() if self.now() - used > IDLE]:
                del self.sessions[forgotten]
            if len(self.sessions) >= MOST_SESSIONS:
                return _error(4, "No resources")
            token = secrets.token_hex(14)
            self.sessions[token] = self.now()
            return {"result": {"token": token}}
        if token not in self.sessions:
            return _error(2, "Permission denied")
        self.sessions[token] = self.now()
        if method == "Api.Logout":
            del self.sessions[token]
            return {"result": True}
        if method == "PlcProgram.Read":
            value = self.program.get(params["var"])
            if value is None:
                return _error(200, "Address does not exist")
            return {"result": value(self.now())}
        if method == "PlcProgram.Write":
            if params["var"] not in self.written:
                return _error(200, "Address does not exist")
            self.written[params["var"]].append(bool(params["value"]))
            return {"result": True}
        if method == "PlcProgram.Browse":
            return {"result": self._below(params.get("var", ""))}
        return _error(-32601, "Method not found")

    def _below(self, address: str) -> list[dict[str, object]]:
        names: dict[str, bool] = {}
        for name in self.program:
            block, _, rest = name.removeprefix('"').partition('"')
            if not address:
                names[block] = bool(rest)
            elif address == f'"{block}"' and rest:
                names[rest.removeprefix(".")] = False
        return [
            {"name": name, "has_children": below, **({} if below else self._kind(f"{address}.{name}"))}
            for name, below in names.items()
        ]

    def _kind(self, address: str) -> dict[str, str]:
        value = self.program[address](self.now()) if address in self.program else None
        return {"datatype": "bool" if isinstance(value, bool) else "lreal"}


def _error(code: int, text: str) -> dict[str, object]:
    return {"error": {"code": code, "message": text}}


# -- options ------------------------------------------------------------------------------------

PASSWORD = "seerob"  # noqa: S105 - everybody may know it


class SiemensWeb(EmulatorOptions, frozen=True, kw_only=True):
    """A Siemens PLC's web server (S7 web API): a belt, a light curtain and a door."""

    port: Annotated[int, port()] = 8081
    user: Annotated[str, option("who may log in")] = "seerob"
    password: Annotated[str, option("with which")] = PASSWORD

    def ready(self) -> Ready:
        """The PLC."""
        program = {
            '"Belt".running': motions.running,
            '"Belt".speed': motions.speed,
            '"Belt".position': motions.position,
            '"Curtain".clear': motions.clear,
            '"Door".open': motions.door_open,
        }
        server = SiemensWebServer(
            program,
            user=self.user,
            password=self.password,
            host=self.host,
            port=self.port,
            outputs=('"Twin".too_close',),
        )
        what = f"variables {', '.join(program)}; speeds in mm/s, positions in mm"
        password = self.password if self.password == PASSWORD else "…"
        hear = (
            f"SEEROB_PLC_PASSWORD={password} SEEROB_PLC_PASSWORD_HOST={self.host} seerob probe siemens_web http://{{at}}"
            f" --set user={self.user} --set password_env=SEEROB_PLC_PASSWORD"
        )
        return Ready(server, what, f"{self.host}:{self.port}", (hear,))
