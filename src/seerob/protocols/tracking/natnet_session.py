"""A conversation with a NatNet server: who it is, what its numbers mean, then frame after frame."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import AsyncGenerator
from contextlib import AsyncExitStack, aclosing
from dataclasses import dataclass

from seerob.protocols import ProtocolError
from seerob.protocols.links.datagrams import Datagram, Datagrams, listening
from seerob.protocols.links.live_messages import NONSENSE
from seerob.protocols.tracking import natnet
from seerob.protocols.tracking.natnet import Frame, Message, ServerInfo
from seerob.protocols.tracking.natnet_models import Models, models

SILENCE = 1.0
"""Without a datagram the connection counts as lost [s]."""
ASK_AGAIN = 0.5
"""A question that was not answered is asked again after this [s]."""
PATIENCE = 2.0
"""For the answers at the begin [s]."""
KEEP_ALIVE = 0.5
"""Motive stops a unicast stream to whom it does not hear from for some seconds [s]."""


@dataclass(frozen=True, eq=False, slots=True)
class Heard:
    """A frame, and what its numbers mean."""

    arrived: float
    """Host's monotonic time [s]."""
    frame: Frame
    models: Models
    """What the numbers of the frame stand for; this object stays the same one until something changes."""
    server: ServerInfo


class Session:
    """What is known of a server.

    Args:
        port: To ask from.
        server: Address and command port.
        unicast: Whether it has to be told that somebody still listens.
    """

    def __init__(self, port: Datagrams, server: tuple[str, int], *, unicast: bool) -> None:
        self._port, self._server, self._unicast = port, server, unicast
        self.info: ServerInfo | None = None
        self.models: Models | None = None
        self._asked = self._kept = -1e9
        self._stale = False
        self._nonsense = 0

    def tick(self, now: float) -> None:
        """Ask for what is not known yet, and say that somebody listens."""
        if now - self._asked >= ASK_AGAIN and (self.models is None or self._stale):
            self._asked = now
            if self.info is None:
                self._port.send(natnet.message(Message.CONNECT, b"Ping\0"), self._server)
            else:
                self._port.send(natnet.message(Message.REQUEST_MODELS), self._server)
        if self._unicast and now - self._kept >= KEEP_ALIVE:
            self._kept = now
            self._port.send(natnet.message(Message.KEEP_ALIVE), self._server)

    def take(self, datagram: Datagram) -> Heard | None:
        """What a datagram says; None when it is no frame, or not understood yet.

        Raises:
            ProtocolError: Too much nonsense in a row.
        """
        try:
            found = self._take(datagram)
        except ProtocolError:
            self._nonsense += 1
            if self._nonsense >= NONSENSE:
                raise
            return None
        self._nonsense = 0
        return found

    def _take(self, datagram: Datagram) -> Heard | None:
        kind, payload = natnet.split(datagram.data)
        if kind == Message.SERVER_INFO:
            self.info = natnet.server_info(payload)
            self._asked = -1e9
            return None
        if self.info is None:
            return None
        version = self.info.natnet[:2]
        if kind == Message.MODELS:
            fresh = models(payload, version)
            self._stale = False
            if fresh != self.models:
                self.models = fresh
        elif kind == Message.FRAME and self.models is not None:
            frame = natnet.frame(payload, version)
            known = {s.id for s in self.models.skeletons}, {b.id for b in self.models.bodies}
            self._stale = self._stale or frame.models_changed
            self._stale |= not all(s.id in known[0] for s in frame.skeletons)
            self._stale |= not all(b.id in known[1] for b in frame.bodies)
            return Heard(datagram.arrived, frame, self.models, self.info)
        return None


async def frames(
    host: str,
    *,
    bind: str,
    command_port: int = natnet.COMMAND_PORT,
    data_port: int = natnet.DATA_PORT,
    group: str | None = natnet.GROUP,
) -> AsyncGenerator[Heard, None]:
    """Frames of a server.

    Args:
        host: Its name or address.
        bind: Own address on its network.
        command_port: Its port for questions.
        data_port: Port of the multicast group.
        group: Multicast group; None for unicast.

    Raises:
        OSError: No such host, or a port is taken.
        TimeoutError: No answer, or nothing for `SILENCE`.
        ProtocolError: Only nonsense, or a version that is not known.
    """
    loop = asyncio.get_running_loop()
    found = await loop.getaddrinfo(host, command_port, family=socket.AF_INET, type=socket.SOCK_DGRAM)
    address = found[0][4][0]
    queue: asyncio.Queue[Datagram | BaseException] = asyncio.Queue(512)
    async with AsyncExitStack() as stack:
        port = await stack.enter_async_context(listening(bind, 0, sender=str(address)))
        ports = [port]
        if group is not None:
            joined = listening(bind, data_port, sender=str(address), group=group)
            ports.append(await stack.enter_async_context(joined))
        tasks = [asyncio.create_task(_forward(each, queue)) for each in ports]
        for task in tasks:
            stack.callback(task.cancel)
        session = Session(port, (str(address), command_port), unicast=group is None)
        begun = spoken = time.monotonic()
        while True:
            now = time.monotonic()
            session.tick(now)
            try:
                async with asyncio.timeout(0.1):
                    datagram = await queue.get()
            except TimeoutError:
                waited = time.monotonic() - spoken
                if session.models is None and time.monotonic() - begun > PATIENCE:
                    raise TimeoutError(_unanswered(session, host, command_port)) from None
                if session.models is not None and waited > SILENCE:
                    raise TimeoutError(f"no frame from {host} for {SILENCE:g} s") from None
                continue
            if isinstance(datagram, BaseException):
                raise datagram
            heard = session.take(datagram)
            _check(session.info)
            if heard is not None:
                spoken = time.monotonic()
                yield heard
            elif session.models is not None and time.monotonic() - spoken > PATIENCE:
                raise TimeoutError(f"{host} answers, but sends no frames: is it in Live, is it playing?")


async def _forward(port: Datagrams, queue: asyncio.Queue[Datagram | BaseException]) -> None:
    async with aclosing(port.receive(float("inf"))) as heard:
        try:
            async for datagram in heard:
                if queue.full():
                    queue.get_nowait()
                queue.put_nowait(datagram)
        except OSError as error:
            await queue.put(error)


def _check(info: ServerInfo | None) -> None:
    if info is not None and not (2, 0) <= info.natnet[:2] < (5, 0):
        shown = ".".join(map(str, info.natnet))
        raise ProtocolError(f"{info.application} speaks NatNet {shown}; 2.0 to 4.x are understood")


def _unanswered(session: Session, host: str, port: int) -> str:
    if session.info is None:
        return f"no answer from {host}:{port} within {PATIENCE:g} s"
    return f"{session.info.application} at {host} does not say its models within {PATIENCE:g} s"
