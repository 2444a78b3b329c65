"""A person in a Rokoko suit, live, through Rokoko Studio's custom streaming (JSON, versions 2 and 3).

Studio sends to the address and port that its settings name; this source only listens. Positions of 21
segments are used; orientations after a calibration only, as Studio's rest pose is not documented.
"""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import AsyncGenerator
from contextlib import aclosing
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from seerob.core.snapshot import Finding
from seerob.description.capture.captured import CaptureFrame, Layout
from seerob.devices.capture.stream_source import CaptureStream
from seerob.protocols.links.live_messages import Sieve, from_datagrams
from seerob.protocols.tracking.rokoko import LAYOUT, PORT, Scene, decode

SILENCE = 1.0
"""Without a datagram the connection counts as lost [s]."""
LISTEN_AT_START = 0.6
"""How long it is listened to at start [s]."""


class Rokoko(CaptureStream, frozen=True, kw_only=True):
    """A person in a Rokoko suit, live, through Rokoko Studio."""

    loads: ClassVar[tuple[str, ...]] = ("lz4.frame",)

    bind: str = "127.0.0.1"
    """Own address on the network of the computer with Studio; when not given, only this machine is heard."""
    port: Annotated[int, Meta(ge=1, le=65535)] = PORT
    """Own port that Studio sends to."""
    sender: str = ""
    """Address of the computer with Studio; whoever sends first when not given. It is no proof: addresses of
    datagrams can be forged. When anybody else sends, the person is undecided."""
    frequency: Annotated[float, Meta(ge=1, le=200, extra={"unit": "Hz"})] = 100.0
    """Rate of the stream in Studio's settings [Hz]."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return 1 / self.frequency

    async def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        """Everybody, by name.

        Raises:
            OSError: The port is taken, or nothing comes.
            ProtocolError: Only nonsense comes.
        """
        async with aclosing(self._scenes()) as scenes:
            async for _, scene in scenes:
                for actor in scene.actors:
                    yield (
                        LAYOUT,
                        CaptureFrame(
                            t=scene.t,
                            positions=actor.positions,
                            orientations=actor.orientations,
                            subject=actor.name,
                        ),
                    )

    async def ask(self) -> tuple[Finding, ...]:
        """Which version, and who is in the stream."""
        heard: list[Scene] = []
        end = time.monotonic() + LISTEN_AT_START
        try:
            async with asyncio.timeout(LISTEN_AT_START + SILENCE), aclosing(self._scenes()) as scenes:
                async for _, scene in scenes:
                    heard.append(scene)
                    if time.monotonic() > end:
                        break
        except TimeoutError:
            if not heard:
                raise
        return tuple(
            Finding(level=level, subject=self.human, text=f"rokoko: {text}")
            for level, text in remarks(heard, self.subject)
        )

    def _scenes(self) -> AsyncGenerator[tuple[float, Scene], None]:
        sieve = Sieve(decode, "Rokoko Studio")
        return from_datagrams(sieve, self.bind, self.port, self.sender or None, SILENCE)


def remarks(heard: list[Scene], subject: str) -> list[tuple[str, str]]:
    """What is to be said of a stream, as level and text."""
    names = Counter(actor.name for scene in heard for actor in scene.actors)
    said = [("note", f"version {heard[-1].version}, {len(heard)} datagrams")]
    said.append(("assumed", "metres, y up, left-handed, as Unity has it: Studio's datagrams do not say"))
    if not names:
        said.append(("warning", "nobody is in the stream: switch on the actor in Studio"))
    elif subject and subject not in names:
        said.append(("warning", f"nobody is called {subject!r}; there are: {', '.join(sorted(names)[:8])}"))
    elif len(names) > 1 and not subject:
        listed = ", ".join(sorted(names)[:8])
        said.append(("warning", f"several persons ({listed}): the first is followed; name one as subject"))
    if np.isnan(heard[-1].t):
        said.append(("assumed", "datagrams have no time: they count as of their arrival"))
    return said
