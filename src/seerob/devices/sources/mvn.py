"""Xsens MVN Analyze and Animate, live, through their network streamer.

MVN sends to the address and port that its settings name; this source only listens. Positions and
orientations of 23 segments, props and fingers, of several characters; joint angles that are sent too are
compared with those of the segments.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import AsyncGenerator
from contextlib import aclosing
from enum import StrEnum
from typing import Annotated

from msgspec import Meta

from seerob.core.snapshot import Finding
from seerob.description.capture.captured import CaptureFrame, Layout
from seerob.devices.capture.mvn_frames import Frames, Unit
from seerob.devices.capture.stream_source import CaptureStream
from seerob.protocols import ProtocolError
from seerob.protocols.links.datagrams import listening
from seerob.protocols.tracking import mvn
from seerob.protocols.tracking.mvn_pose import POSES, Up

_log = logging.getLogger(__name__)

SILENCE = 1.0
"""Without a datagram the connection counts as lost [s]."""
CONNECT_WITHIN = 5.0
"""How long a TCP connection is waited for before the port is opened anew [s]."""
ASKED = 0.6
"""How long it is listened to at start, after the first datagram [s]."""
WAITING = 512
"""Datagrams of a TCP connection that wait; after that the sender waits."""
WHERE = (
    "MVN: Options, Preferences, Network Streamer: this computer's address, "
    "Position + Orientation (Quaternion)"
)


class Transport(StrEnum):
    """How MVN sends."""

    UDP = "udp"
    TCP = "tcp"
    """It connects to this computer; nothing is lost, but what is late makes all that follows late."""


class Mvn(CaptureStream, frozen=True, kw_only=True):
    """A person in an Xsens suit, live, through MVN's network streamer."""

    bind: str = "127.0.0.1"
    """Own address on the network of the computer with MVN; when not given, only this machine is heard."""
    port: Annotated[int, Meta(ge=1, le=65535)] = mvn.PORT
    """Own port that MVN sends to."""
    sender: str = ""
    """Address of the computer with MVN; what others send is not listened to. Anyone's when not given."""
    transport: Transport = Transport.UDP
    """``udp`` or ``tcp``, as MVN's settings say."""
    frequency: Annotated[float, Meta(ge=1, le=240, extra={"unit": "Hz"})] = 60.0
    """Rate of the stream in MVN's settings [Hz]."""
    unit: Unit = Unit.GUESS
    """Unit of positions: ``m``, ``cm``, or guessed from the length of the trunk, because Xsens' documents
    differ."""
    up: Up = Up.Z
    """Axis that points up in quaternion datagrams (02): ``z``, or ``y`` when MVN is set so."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return 1 / self.frequency

    async def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        """Every pose of every character."""
        who = self.name or f"mvn {self.human}"
        said = Frames(unit=self.unit, up=self.up, who=who)
        begun: float | None = None
        posed = False
        try:
            async with aclosing(self._datagrams()) as heard:
                async for arrived, data in heard:
                    begun = arrived if begun is None else begun
                    found = said.feed(data, arrived)
                    if found is not None:
                        posed = True
                        yield found
                    elif not posed and arrived - begun > SILENCE:
                        raise ProtocolError(_no_pose(said))
        finally:
            losses = said.assembly.losses
            if losses or said.refused:
                _log.info("%s: %s, %d datagrams not understood", who, losses, said.refused)

    async def ask(self) -> tuple[Finding, ...]:
        """Who and what is in the stream."""
        said = Frames(unit=self.unit, up=self.up, who=self.name or "mvn")
        first: float | None = None
        samples = 0
        end = time.monotonic() + ASKED + SILENCE
        async with aclosing(self._datagrams()) as heard:
            async for arrived, data in heard:
                first = arrived if first is None else first
                samples += said.feed(data, arrived) is not None
                if arrived - first >= ASKED or arrived >= end:
                    break
        return self._remarks(said, samples)

    def _remarks(self, said: Frames, samples: int) -> tuple[Finding, ...]:
        def say(level: str, text: str) -> Finding:
            return Finding(level=level, subject=self.human, text=f"mvn: {text}")

        kinds = (
            ", ".join(f"{kind} ({count})" for kind, count in sorted(said.kinds.items())) or "nothing known"
        )
        found = [say("note", f"datagrams heard: {kinds}")]
        if not samples:
            found.append(say("warning", _no_pose(said)))
        for number, who in sorted(said.characters.items()):
            if who.kind is None:
                continue
            text = f"character {number}{f' ({who.name})' if who.name else ''}: datagrams {who.kind:02d}"
            found.append(say("note", text + (f", stature {who.stature:.2f} m" if who.stature else "")))
            if self.unit is Unit.GUESS:
                unit = who.unit or "no unit that is known"
                found.append(say("assumed", f"positions are in {unit}, by the length of the trunk"))
            if who.kind is not POSES[0]:
                text = (
                    "position and orientation by quaternions (02) say the same without a convention to assume"
                )
                found.append(say("assumed", f"{text}; choose them in MVN"))
            if who.off:
                text = (
                    f"joint angles differ from those of the segments by {math.degrees(who.off):.2f}° at most"
                )
                found.append(say("note", text))
        people = [str(k) for k, who in sorted(said.characters.items()) if who.kind is not None]
        if len(people) > 1 and not self.subject:
            text = f"characters {', '.join(people)}: the first that is heard is followed; name one as subject"
            found.append(say("warning", text))
        if said.refused:
            found.append(say("warning", f"{said.refused} datagrams are not understood"))
        if said.assembly.losses:
            found.append(say("warning", f"on the way: {said.assembly.losses}"))
        return tuple(found)

    async def _datagrams(self) -> AsyncGenerator[tuple[float, bytes], None]:
        if self.transport is Transport.TCP:
            async with aclosing(_connected(self.bind, self.port, self.sender)) as stream:
                async for item in stream:
                    yield item
        else:
            async with (
                listening(self.bind, self.port, sender=self.sender or None) as port,
                aclosing(port.receive(SILENCE)) as heard,
            ):
                async for datagram in heard:
                    yield datagram.arrived, datagram.data


def _no_pose(said: Frames) -> str:
    kinds = ", ".join(sorted(said.kinds)) or "none that is known"
    return f"no pose among its datagrams ({kinds}); {WHERE}"


async def _connected(bind: str, port: int, sender: str) -> AsyncGenerator[tuple[float, bytes], None]:
    """Datagrams of the one who connects; a second one is turned away."""
    queue: asyncio.Queue[tuple[float, bytes] | Exception] = asyncio.Queue(WAITING)
    busy = False

    async def welcome(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal busy
        if busy or (sender and writer.get_extra_info("peername")[0] != sender):
            writer.transport.abort()
            return
        busy = True
        splitter = mvn.Splitter()
        try:
            while data := await reader.read(mvn.LARGEST):
                for datagram in splitter.feed(data):
                    await queue.put((time.monotonic(), datagram))
            await queue.put(EOFError("MVN closed the connection"))
        except (OSError, ProtocolError) as error:
            await queue.put(error)
        finally:
            writer.transport.abort()

    server = await asyncio.start_server(welcome, bind, port)
    try:
        while True:
            patience = SILENCE if busy else CONNECT_WITHIN
            try:
                async with asyncio.timeout(patience):
                    item = await queue.get()
            except TimeoutError as error:
                what = "nothing sent to" if busy else "nobody connected to"
                raise TimeoutError(f"{what} port {port} for {patience:g} s") from error
            if isinstance(item, Exception):
                raise item
            yield item
    finally:
        server.close()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(0.2):
                await server.wait_closed()
