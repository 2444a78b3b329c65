"""Who may come in, what they may do there, and what every answer carries.

A page of another site that the same browser has open can reach this server: by its address, and
by a name that it makes point here (DNS rebinding). Hence: the host asked for must be an address or
a known name, a WebSocket or what brings something must come from the page's own origin, and whoever
listens on more than this machine asks for a token. Requests that come faster than a page makes them wait.
"""

from __future__ import annotations

import asyncio
import re
from math import ceil

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.utils import ClientDisconnected

from seerob.app.server.access import EVERYTHING, Guesses, Role, Tokens, Visits, matching, neighbourhood
from seerob.app.server.allowance import Allowances
from seerob.app.server.trust import PATHS
from seerob.core.host_name import is_address

HEADERS = {
    # Together they make the page cross-origin isolated: without that there is no SharedArrayBuffer.
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Embedder-Policy": "require-corp",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; "
    "img-src 'self' data: blob:; connect-src 'self' blob:; worker-src 'self' blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}
"""On every answer. ``blob:`` is for textures inside a mesh and for a bundled worker."""

_HOST = re.compile(r"(?:\[([0-9A-Fa-f:.]+)\]|([A-Za-z0-9.-]+))(?::\d{1,5})?")


STRANGERS, VISITORS = (10.0, 40.0), (60.0, 200.0)
"""Requests per second of one address, and at once: of who has no token, and of others. A page has 10 to 100
files and meshes."""
SOCKETS = (10.0, 64.0)
"""WebSockets that one address may begin per second, and at once: as many as pages are served. Each is told
the past, which costs more than a file."""
LONGEST_WAIT = 5.0
"""After which a request that came too fast is turned away [s]."""
_ROLES = {role: frozenset({Role.VIEW, role}) for role in Role}


class Door:
    """Turns away whom the page is not for, and puts `HEADERS` on every answer."""

    def __init__(
        self,
        app: ASGIApp,
        *,
        hosts: frozenset[str],
        origins: frozenset[str],
        tokens: Tokens | None,
        visits: Visits,
        encrypted: bool,
    ) -> None:
        """Wrap an application, which finds ``role`` and ``roles`` of a visitor in the scope's state.

        Args:
            app: What is behind the door.
            hosts: Names, besides addresses and ``localhost``, under which it may be asked for.
            origins: Origins, besides its own, whose pages may open a WebSocket.
            tokens: What visitors must know; nobody is asked when None.
            visits: Is told of those who are turned away.
            encrypted: Whether it is served over TLS.
        """
        self._app, self._hosts, self._origins, self._tokens = app, hosts, origins, tokens
        self._visits, self._encrypted = visits, encrypted
        self._cookies = [] if tokens is None else [tokens.cookie(role) for role in Role]
        self._guesses = Guesses()
        self._strangers, self._visitors = Allowances(*STRANGERS), Allowances(*VISITORS)
        self._sockets = Allowances(*SOCKETS)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request or WebSocket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"].endswith((".response.start", ".accept")):
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
                headers.setdefault("Cache-Control", "no-store")
            await send(message)

        address = scope["client"][0] if scope.get("client") else ""
        answer = self._refuse(scope) or self._welcome(scope, address)
        known = answer is None or answer.status_code < 400
        if answer is not None and not known:
            self._visits.turn_away(address, bytes(answer.body).decode().strip())
        known_here = known and "role" in scope.get("state", {})
        asked = [self._visitors if known_here else self._strangers]
        if known and scope["type"] == "websocket":
            asked.append(self._sockets)
        owed = [allowances.of(neighbourhood(address)) for allowances in asked]
        wait = max(allowance.take() for allowance in owed)
        if wait > LONGEST_WAIT:
            for allowance in owed:
                allowance.take(-1.0)  # whoever is turned away owes nothing for it
            answer = _later("too many requests", wait)
            self._visits.turn_away(address, "too many requests")
        elif wait:
            try:
                await asyncio.sleep(wait)
            except asyncio.CancelledError:  # the server stops: no mistake that belongs in the log
                raise ClientDisconnected from None
        await (answer or self._app)(scope, receive, send_with_headers)

    def _refuse(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        match = _HOST.fullmatch(host)
        name = (match[1] or match[2]).lower() if match else ""
        if not (is_address(name) or name == "localhost" or name in self._hosts):
            return PlainTextResponse("not served under this host name\n", 403)
        changes = scope["type"] == "http" and scope["method"] not in ("GET", "HEAD")
        if scope["type"] == "websocket" or changes:
            origin = headers.get("origin")
            own = (f"https://{host}",) if self._encrypted else (f"http://{host}", f"https://{host}")
            if origin is not None and origin not in own and origin not in self._origins:
                return PlainTextResponse("not open to pages of another origin\n", 403)
        return None

    def _welcome(self, scope: Scope, address: str) -> Response | None:
        """Check the token; one in the address moves to a cookie, which meshes and WebSocket then carry."""
        state = scope.setdefault("state", {})
        if self._tokens is None:
            state["role"], state["roles"] = "any", EVERYTHING
            return None
        visitor = HTTPConnection(scope)
        asked = visitor.query_params.get("token")
        cookie = f"seerob-{scope['server'][1]}"
        if asked is None and scope["type"] == "http" and scope["path"] in PATHS:
            return None
        if asked is None:
            role = matching(visitor.cookies.get(cookie, ""), self._cookies)
        elif (left := self._guesses.locked(address)) > 0:
            # Whoever has come in before, from the same address, keeps a cookie and is not concerned.
            return _later("too many wrong tokens from this address", left)
        elif (role := self._tokens.role(asked)) is None:
            self._guesses.fail(address)
        if role is None:
            return PlainTextResponse("a token is needed: open the address that seerob printed\n", 401)
        state["role"], state["roles"] = role.value, _ROLES[role]
        if asked is not None and scope["type"] == "http" and scope["path"] == "/":
            answer = RedirectResponse("/", 303)
            known = self._cookies[list(Role).index(role)]
            answer.set_cookie(cookie, known, httponly=True, samesite="lax", secure=self._encrypted)
            return answer
        return None


def _later(why: str, wait: float) -> Response:
    headers = {"Retry-After": str(ceil(wait))}
    return PlainTextResponse(f"{why}: try again later\n", 429, headers=headers)
