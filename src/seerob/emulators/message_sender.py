"""A small program that sends messages at a steady rate, over datagrams or to whoever connects."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Sequence
from threading import Event, Thread
from types import TracebackType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from websockets.sync.server import Server, ServerConnection

LATE = 0.5
"""Time that is not made up for when this machine was too slow [s]."""

Way = Callable[[bytes], Sequence[bytes]]
"""What a network does to a message: loses, doubles, damages it."""


class MessageSender:
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
        self.to, self.host, self.port, self.rate, self.way = to, host, port, rate, way
        self.sent = 0
        """Messages so far."""
        self._over = Event()
        self._thread: Thread | None = None
        self._server: Server | None = None

    def start(self) -> Self:
        """Begin to send, or to listen for whoever wants to hear.

        Raises:
            OSError: The address cannot be listened on, or is none.
        """
        if self._thread is not None:
            raise RuntimeError("is already started")
        self._over.clear()
        if self.to is None:
            from websockets.sync.server import serve

            self._server = serve(self._speak, self.host, self.port, compression=None)
            self.port = self._server.socket.getsockname()[1]
            self._thread = Thread(
                target=self._server.serve_forever, name=f"seerob-emulator-{type(self).__name__}", daemon=True
            )
        else:
            link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            link.connect(self.to)
            self._thread = Thread(
                target=self._send, args=(link,), name=f"seerob-emulator-{type(self).__name__}", daemon=True
            )
        self._thread.start()
        return self

    def stop(self) -> None:
        """Fall silent; it may be started again."""
        if self._thread is None:
            return
        self._over.set()
        if self._server is not None:
            self._server.shutdown()
        self._thread.join()
        self._thread = self._server = None

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

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
