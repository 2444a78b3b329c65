"""Whether an MQTT broker is there, and why it is not, sooner than MQTT itself would tell."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import aiomqtt

NOTHING = "seerob/is-the-broker-there"
"""A topic that nobody subscribes."""
PATIENCE = 2.0
"""With the broker's answer [s]."""


class Pulse:
    """Whether a broker has sent something of late, or answers when it is asked.

    MQTT's own ping takes seconds, and a message that is not published is none. A topic that nobody has
    subscribed is unsubscribed: a broker confirms that all the same (MQTT 3.1.1, 3.10.4), and nothing
    follows from it.

    Args:
        client: Connected.
        within: How long ago that may be [s].
    """

    def __init__(self, client: aiomqtt.Client, within: float) -> None:
        self._client, self._within = client, within
        self._shown = time.monotonic()
        self._asking: asyncio.Task[None] | None = None

    def shown(self, *, spoke: bool) -> bool:
        """Whether it was there within that time.

        Args:
            spoke: It has just sent something.

        Raises:
            ConnectionError: It does not answer.
        """
        now = time.monotonic()
        if spoke:
            self._shown = now
        if self._asking is not None and self._asking.done():
            error, self._asking = self._asking.exception(), None
            if error is not None:
                raise ConnectionError(f"the broker does not answer: {error}")
        if self._asking is None and now - self._shown > self._within / 2:
            self._asking = asyncio.create_task(self._ask(now))
        return now - self._shown <= self._within

    async def aclose(self) -> None:
        """Ask no more."""
        if self._asking is not None:
            self._asking.cancel()
            await asyncio.gather(self._asking, return_exceptions=True)

    async def _ask(self, asked: float) -> None:
        await self._client.unsubscribe(NOTHING, timeout=PATIENCE)
        self._shown = max(self._shown, asked)


@asynccontextmanager
async def known_end(client: aiomqtt.Client) -> AsyncGenerator[None, None]:
    """Take note why connections end: asyncio logs what nobody has asked for.

    aiomqtt keeps the reason in a future, and begins another when the broker leaves while it connects.
    """
    futures = [getattr(client, "_disconnected", None)]
    try:
        yield
    finally:
        futures.append(getattr(client, "_disconnected", None))
        for future in futures:
            if isinstance(future, asyncio.Future) and future.done() and not future.cancelled():
                future.exception()
