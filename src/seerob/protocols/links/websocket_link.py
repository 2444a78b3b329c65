"""A WebSocket to a server that sends more than anybody asked for: what waits is bounded, the oldest goes."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import AsyncGenerator, Mapping, Sequence
from contextlib import asynccontextmanager
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from seerob.protocols import NotLetIn, ProtocolError

if TYPE_CHECKING:
    from ssl import SSLContext

    from websockets.asyncio.client import ClientConnection

CONNECT_WITHIN = 2.0
"""[s]"""
WAITING = 64
"""Messages that wait to be read; of more, the oldest are lost."""
ALIVE = 10.0
"""A server that answers no ping within this time is gone [s]."""


class Link:
    """A connection that is made; see `linked`."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._waiting = deque[tuple[float, bytes | str]](maxlen=WAITING)
        self._arrived = asyncio.Event()
        self._task = asyncio.create_task(self._listen())

    async def send(self, message: str | bytes) -> None:
        """Send; text in a text frame, bytes in a binary one.

        Raises:
            ProtocolError: The connection is closed.
        """
        from websockets.exceptions import ConnectionClosed

        try:
            await self._socket.send(message)
        except ConnectionClosed as error:
            raise ProtocolError(f"the server closed the connection: {error}") from error

    async def receive(self, patience: float | None) -> tuple[float, bytes | str] | None:
        """The next message and when it arrived (host's monotonic time [s]); None when the server closed.

        Args:
            patience: Longest pause [s]; None for any.

        Raises:
            TimeoutError: Nothing for so long.
            ProtocolError: The connection broke.
        """
        async with asyncio.timeout(patience):
            while not self._waiting:
                if self._task.done():
                    self._ended()
                    return None
                self._arrived.clear()
                await self._arrived.wait()
        return self._waiting.popleft()

    async def close(self) -> None:
        """End it."""
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    def _ended(self) -> None:
        from websockets.exceptions import ConnectionClosed

        try:
            self._task.result()
        except ConnectionClosed as error:
            raise ProtocolError(f"the connection broke: {error}") from error

    async def _listen(self) -> None:
        try:
            async for message in self._socket:
                self._waiting.append((time.monotonic(), message))
                self._arrived.set()
        finally:
            self._arrived.set()


@asynccontextmanager
async def linked(
    host: str, port: int, *, largest: int, what: str, protocols: Sequence[str] = (), tls: bool = False
) -> AsyncGenerator[Link, None]:
    """Connect.

    Args:
        host: Name or address.
        port: Of the server.
        largest: Message that is read [byte].
        what: The server, for messages.
        protocols: Subprotocols that are spoken.
        tls: Encrypted, and the server's certificate is checked.

    Raises:
        OSError: There is no connection.
        TimeoutError: It does not answer.
        ProtocolError: No such server is there.
    """
    shown = f"[{host}]" if ":" in host else host
    url = f"ws{'s' if tls else ''}://{shown}:{port}/"
    async with linked_to(url, largest=largest, what=what, protocols=protocols) as link:
        yield link


@asynccontextmanager
async def linked_to(
    url: str,
    *,
    largest: int,
    what: str,
    protocols: Sequence[str] = (),
    headers: Mapping[str, str] = MappingProxyType({}),
    tls: SSLContext | None = None,
) -> AsyncGenerator[Link, None]:
    """Connect to a URL; redirections are not followed.

    Args:
        url: ``ws://…`` or ``wss://…``.
        largest: Message that is read [byte].
        what: The server, for messages.
        protocols: Subprotocols that are spoken.
        headers: Of the request, beside its own.
        tls: Which certificates are trusted, with ``wss``; those of the system when not given.

    Raises:
        OSError: There is no connection.
        TimeoutError: It does not answer.
        NotLetIn: Who asks is not known, or may not.
        ProtocolError: No such server is there.
    """
    from websockets.asyncio.client import connect
    from websockets.exceptions import InvalidHandshake, InvalidStatus, InvalidURI
    from websockets.typing import Subprotocol

    class Straight(connect):
        """Goes nowhere else: what is sent along may be a secret."""

        def process_redirect(self, exc: Exception) -> Exception | str:
            return exc

    at = urlsplit(url).netloc
    own: dict[str, Any] = {} if tls is None else {"ssl": tls}
    opening = Straight(
        url,
        additional_headers=dict(headers),
        max_size=largest,
        open_timeout=CONNECT_WITHIN,
        close_timeout=0.2,
        ping_interval=ALIVE,
        ping_timeout=ALIVE,
        compression=None,
        proxy=None,
        subprotocols=[Subprotocol(name) for name in protocols] or None,
        **own,
    )
    try:
        socket = await opening
    except (InvalidHandshake, InvalidURI) as error:
        if isinstance(error, InvalidStatus) and error.response.status_code in (401, 403):
            what = f"the server at {at} answers with HTTP {error.response.status_code}"
            raise NotLetIn(f"{what}: it wants another login or token") from error
        raise ProtocolError(f"no {what} answers at {at}: {error}") from error
    async with socket:
        if protocols and socket.subprotocol is None:
            raise ProtocolError(f"{at} speaks none of {', '.join(protocols)}")
        link = Link(socket)
        try:
            yield link
        finally:
            await link.close()
