"""Who may come in, and what every answer carries.

A page of another site that the same browser has open can reach this server: by its address, and
by a name that it makes point here (DNS rebinding). Hence: the host asked for must be an address or
a known name, a WebSocket must come from the page's own origin, and whoever listens on more than
this machine asks for a token.
"""

from __future__ import annotations

import re
from hmac import compare_digest

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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


class Door:
    """Turns away whom the page is not for, and puts `HEADERS` on every answer."""

    def __init__(self, app: ASGIApp, *, hosts: frozenset[str], origins: frozenset[str], token: str | None):
        """Wrap an application.

        Args:
            app: What is behind the door.
            hosts: Names, besides addresses and ``localhost``, under which it may be asked for.
            origins: Origins, besides its own, whose pages may open a WebSocket.
            token: What a visitor must know; nobody is asked when None.
        """
        self._app, self._hosts, self._origins, self._token = app, hosts, origins, token

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

        answer = self._refuse(scope) or self._welcome(scope)
        await (answer or self._app)(scope, receive, send_with_headers)

    def _refuse(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        match = _HOST.fullmatch(host)
        name = (match[1] or match[2]).lower() if match else ""
        if not (is_address(name) or name == "localhost" or name in self._hosts):
            return PlainTextResponse("not served under this host name\n", 403)
        if scope["type"] == "websocket":
            origin = headers.get("origin")
            own = (f"http://{host}", f"https://{host}")
            if origin is not None and origin not in own and origin not in self._origins:
                return PlainTextResponse("not open to pages of another origin\n", 403)
        return None

    def _welcome(self, scope: Scope) -> Response | None:
        """Check the token; one in the address moves to a cookie, which meshes and WebSocket then carry."""
        if self._token is None:
            return None
        visitor = HTTPConnection(scope)
        asked = visitor.query_params.get("token")
        cookie = f"seerob-{scope['server'][1]}"
        known = asked if asked is not None else visitor.cookies.get(cookie, "")
        if not compare_digest(known.encode(), self._token.encode()):
            return PlainTextResponse("a token is needed: open the address that seerob printed\n", 401)
        if asked is not None and scope["type"] == "http" and scope["path"] == "/":
            answer = RedirectResponse("/", 303)
            answer.set_cookie(cookie, self._token, httponly=True, samesite="lax")
            return answer
        return None
