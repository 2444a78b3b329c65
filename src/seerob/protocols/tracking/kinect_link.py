"""The live messages of a depth camera's PC, as they arrive: by datagrams, or over a WebSocket."""

from __future__ import annotations

from collections.abc import AsyncGenerator

from seerob.protocols.links import live_messages
from seerob.protocols.links.live_messages import NONSENSE, SILENCE
from seerob.protocols.tracking.kinect import Picture, decode_message

__all__ = ["NONSENSE", "SILENCE", "Sieve", "from_datagrams", "from_websocket"]


class Sieve(live_messages.Sieve[Picture]):
    """Lets through pictures that are newer."""

    def __init__(self) -> None:
        super().__init__(decode_message, "the camera")


def from_datagrams(
    bind: str, port: int, sender: str | None, silence: float = SILENCE
) -> AsyncGenerator[tuple[float, Picture], None]:
    """Pictures that somebody sends to this machine; see `live_messages.from_datagrams`."""
    return live_messages.from_datagrams(Sieve(), bind, port, sender, silence)


def from_websocket(
    host: str, port: int, silence: float = SILENCE
) -> AsyncGenerator[tuple[float, Picture], None]:
    """Pictures over a connection to the sender; see `live_messages.from_websocket`."""
    return live_messages.from_websocket(Sieve(), host, port, silence)
