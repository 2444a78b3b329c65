"""A small program that sends messages at a steady rate, over datagrams or to whoever connects."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from seerob.emulators.background import Emulator

if TYPE_CHECKING:
    from websockets.sync.server import Server, ServerConnection

LATE = 0.5
"""Time that is not made up for when this machine was too slow [s]."""

Way = Callable[[bytes], Sequence[bytes]]
"""What a network does to a message: loses, doubles, damages it."""


class MessageSender(Emulator):
    """The sender, in threads of its own.

    Args:
        to: Address and port that datagrams go to; None for a WebSocket that others connect to.
        host: Own address to listen on, with a WebSocket.
        port: Own port to listen on, with a WebSocket; 0 is any free one.
        rate: Messages per second [Hz].
        way: What happens to each message on the way.
    """

    def __init__(
        self,
        *,
        to: tuple[str, int] | None,
        host: str = "127.0.0.1",
        port: int = 0,
        rate: float,
        way: Way | None = None,
    ) -> None:
        super().__init__()
        self.to, self.host, self.port, self.rate, self.way = to, host, port, rate, way
        self.sent = 0
        """Messages so far."""
        self._server: Server | None = None

    def begin(self) -> Callable[[], object]:
        """Listen for whoever wants to hear, or connect.

        Raises:
            OSError: The address cannot be listened on, or is none.
        """
        if self.to is not None:
            link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            link.connect(self.to)
            return lambda: self._send(link)
        from websockets.sync.server import serve

        server = self._server = serve(self._speak, self.host, self.port, compression=None)
        self.port = server.socket.getsockname()[1]
        return server.serve_forever

    def stopping(self) -> None:
        """Close the connections."""
        if self._server is not None:
            self._server.shutdown()
            self._server = None

    def message(self, k: int) -> bytes:
        """The message number ``k``."""
        raise NotImplementedError

    def _send(self, link: socket.socket) -> None:
        with link:
            self._play(link.send)

    def _speak(self, connection: ServerConnection) -> None:
        """Until whoever listens has gone."""
        self._play(lambda data: connection.send(data, text=True))

    def _play(self, send: Callable[[bytes], object]) -> None:
        from websockets.exceptions import ConnectionClosed

        begun, k = time.monotonic(), 0
        while not self._over.wait(max(0.0, begun + k / self.rate - time.monotonic())):
            message = self.message(k)
            try:
                for data in (message,) if self.way is None else self.way(message):
                    send(data)
            except ConnectionRefusedError:
                pass  # nobody listens yet: a sender does not mind
            except (OSError, ConnectionClosed):
                return
            self.sent += 1
            late = time.monotonic() - begun - k / self.rate
            k += 1 + (int(late * self.rate) if late > LATE else 0)
