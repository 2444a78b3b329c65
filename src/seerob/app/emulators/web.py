"""A machine that tells its variables as a JSON document, over real HTTP(S) and by WebSocket."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from seerob.app.emulation import motions
from seerob.app.emulation.background import HttpEmulator
from seerob.app.emulation.options import EmulatorOptions, Ready, port

Document = Callable[[float], Mapping[str, object]]
"""What it tells at a time since the start [s]."""
STATE, LIVE = "/state", "/live"


class WebServer(HttpEmulator):
    """A machine with a web server, in a thread of its own.

    Args:
        document: What it tells at ``/state``, and again and again at ``/live`` (WebSocket).
        token: That must come in the header ``Authorization: Bearer …``; anybody may ask when empty.
        host: Address to listen on.
        port: 0 is any free one.
        period: Between two documents of the WebSocket [s].
        certificate: Certificate and key files (PEM); unencrypted without.
    """

    def __init__(
        self,
        document: Document,
        *,
        token: str = "",
        host: str = "127.0.0.1",
        port: int = 0,
        period: float = 0.05,
        certificate: tuple[Path, Path] | None = None,
    ) -> None:
        super().__init__(host, port, certificate)
        self.document, self.period, self._token = document, period, token

    @property
    def live(self) -> str:
        """Where its WebSocket is."""
        return f"ws{self.url.removeprefix('http')}{LIVE}"

    def routes(self) -> Sequence[object]:
        """The document, and the WebSocket."""
        from starlette.routing import Route, WebSocketRoute

        return Route(STATE, self._answer), WebSocketRoute(LIVE, self._push)

    def _known(self, headers: Mapping[str, str]) -> bool:
        return not self._token or headers.get("authorization") == f"Bearer {self._token}"

    async def _answer(self, request: Any) -> Any:
        from starlette.responses import JSONResponse, PlainTextResponse

        if not self._known(request.headers):
            return PlainTextResponse("who are you?", status_code=401)
        return JSONResponse(dict(self.document(self.now())))

    async def _push(self, socket: Any) -> None:
        from starlette.websockets import WebSocketDisconnect

        if not self._known(socket.headers):
            await socket.close()
            return
        await socket.accept()
        try:
            while not self._over.is_set():
                await socket.send_text(json.dumps(dict(self.document(self.now()))))
                await asyncio.sleep(self.period)
        except (WebSocketDisconnect, RuntimeError):
            return


# -- options ------------------------------------------------------------------------------------


class Web(EmulatorOptions, frozen=True, kw_only=True):
    """A web server that tells a belt, a light curtain and a door (/state, and /live by WebSocket)."""

    port: Annotated[int, port()] = 8090

    def ready(self) -> Ready:
        """The machine."""
        server = WebServer(_cell, host=self.host, port=self.port)
        what = f"a belt, a light curtain and a door at {STATE}, and at {LIVE} by WebSocket"
        hear = (f"seerob probe web http://{{at}}{STATE}", f"seerob probe web ws://{{at}}{LIVE}")
        return Ready(server, what, f"{self.host}:{self.port}", hear)


def _cell(t: float) -> Mapping[str, object]:
    return {
        "belt": {
            "running": motions.running(t),
            "speed": motions.speed(t),
            "position": motions.position(t),
        },
        "curtain": {"clear": motions.clear(t)},
        "door": {"open": motions.door_open(t)},
    }
