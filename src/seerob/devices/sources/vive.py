"""Worn trackers (Vive, or others of SteamVR), live: from this computer, or from a sender on SteamVR's.

The sender is ``tools/vive_sender``; its message is in docs/sources/vive.md. Any program that reads trackers,
through OpenXR for one, can send the same.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncGenerator
from contextlib import aclosing
from enum import StrEnum
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta, field
from msgspec.structs import replace as changed

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.description.capture.calibration import CalibrationPose
from seerob.description.capture.captured import CaptureFrame, Layout
from seerob.devices.capture import worn_trackers as _worn_trackers
from seerob.devices.capture.stream_source import CaptureStream
from seerob.devices.capture.worn_trackers import Names, OriginWatch, remarks
from seerob.devices.live.listening import Contact, contact_of, say_once
from seerob.protocols.links.live_messages import Sieve, from_datagrams, from_websocket
from seerob.protocols.tracking.vive import PORT, Device, Devices, decode
from seerob.workstation.source import Opened, Target

_log = logging.getLogger(__name__)

GATHER = 0.5
"""Devices that appear later than this after the first message are not used until it is connected anew [s]:
another set of names would make a calibration void."""
LISTEN_FOR = 1.0
"""At start [s]."""


class Link(StrEnum):
    """Where the poses come from."""

    UDP = "udp"
    """Datagrams that the sender sends to this machine."""
    WEBSOCKET = "websocket"
    """A connection to the sender."""
    OPENVR = "openvr"
    """SteamVR on this computer (extra ``vive``)."""


class Vive(CaptureStream, frozen=True, kw_only=True):
    """Worn trackers (Vive, or others of SteamVR), live."""

    loads: ClassVar[tuple[str, ...]] = ("websockets.asyncio.client",)

    link: Link = Link.UDP
    """``udp``: the sender sends to this machine; ``websocket``: this machine connects to it; ``openvr``:
    SteamVR runs here."""
    host: str = ""
    """Name or address of the computer with SteamVR; with ``udp`` only its datagrams count, and those of
    whoever sends first when not given. It is no proof: addresses of datagrams can be forged. When anybody
    else sends, the person is undecided."""
    port: Annotated[int, Meta(ge=1, le=65535)] = PORT
    """UDP or TCP port that the sender sends to, or listens on."""
    bind: str = "127.0.0.1"
    """Own address on which datagrams are listened for; when not given, only this machine is heard."""
    trackers: dict[str, str] = field(default_factory=dict)
    """Serial number → where it is worn (``waist``, ``left_foot`` …), in place of SteamVR's role."""
    frequency: Annotated[float, Meta(ge=1, le=250, extra={"unit": "Hz"})] = 90.0
    """Rate of the sender, or at which SteamVR is asked [Hz]."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return 1 / self.frequency

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Ask which devices there are, if they can be reached.

        Raises:
            InputError: No address to connect to, or a role that two devices have.
        """
        self._check()
        opened = super().open(folder, target)
        if self.calibration.pose is not CalibrationPose.NONE:
            return opened
        text = (
            "trackers sit on straps: without a calibration only their positions count, as if each were in "
            'its joint; give calibration = { pose = "npose" } or "tpose"'
        )
        more = Finding(level="warning", subject=self.human, text=text)
        return changed(opened, findings=(*opened.findings, more))

    def _check(self) -> None:
        _worn_trackers.check(self.trackers, self.name or "sources")
        if self.link is Link.WEBSOCKET and not self.host:
            raise InputError.at(
                "sources", "host", "no address to connect to", "give that of SteamVR's computer"
            )

    async def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        """All devices; NaN for those that are not tracked, or when nobody knows where the origin is.

        Raises:
            OSError: There is no connection, or no longer.
            ProtocolError: What comes cannot be understood, or SteamVR does not run.
        """
        who = self.name or f"vive {self.human}"
        names, watch = Names(self.trackers, self.mapping), OriginWatch()
        layout: Layout | None = None
        rows: dict[str, int] = {}
        begun: float | None = None
        late: set[str] = set()
        async with aclosing(self._instants()) as instants:
            async for arrived, instant in instants:
                begun = arrived if begun is None else begun
                if layout is None:
                    names.learn(instant.devices)
                    if arrived - begun < GATHER or not names.of:
                        continue
                    layout = names.layout()
                    rows = {serial: row for row, serial in enumerate(names.of)}
                    told = {d.serial: d for d in instant.devices}
                    for finding in remarks(names, told.values(), self.human):
                        level = logging.WARNING if finding.level == "warning" else logging.INFO
                        say_once(_log, level, f"{who}: {finding.text}")
                for device in instant.devices:
                    if device.serial not in rows and device.serial not in late:
                        late.add(device.serial)
                        text = f"{who}: {device.serial} appeared late and is not used"
                        say_once(_log, logging.WARNING, text)
                known = watch.moved_at
                if not watch.trusted(instant):
                    if known is None:
                        _log.warning("%s: %s", who, ORIGIN_MOVED)
                    yield layout, CaptureFrame(t=instant.t, positions=np.full((len(rows), 3), np.nan))
                    continue
                yield layout, _worn_trackers.frame(instant, rows)

    def contact(self) -> Contact:
        """The computer with SteamVR, or the one on this machine."""
        if self.link in (Link.UDP, Link.WEBSOCKET):
            return contact_of(self, listens=self.link is Link.UDP)
        return Contact(f"asks {self.link.value} on this machine")

    async def ask(self) -> tuple[Finding, ...]:
        """Which devices there are, where they are worn, and which of them are tracked."""
        self._check()
        names = Names(self.trackers, self.mapping)
        newest: dict[str, Device] = {}
        end = time.monotonic() + LISTEN_FOR
        try:
            async with asyncio.timeout(LISTEN_FOR), aclosing(self._instants()) as instants:
                async for arrived, instant in instants:
                    names.learn(instant.devices)
                    newest |= {device.serial: device for device in instant.devices}
                    if arrived > end:
                        break
        except TimeoutError as error:
            if not newest:
                where = f"port {self.port}" if self.link is Link.UDP else f"{self.host}:{self.port}"
                raise TimeoutError(f"no devices came to {where} within {LISTEN_FOR:g} s") from error
        return remarks(names, newest.values(), self.human)

    def _instants(self) -> AsyncGenerator[tuple[float, Devices], None]:
        if self.link is Link.OPENVR:
            return from_openvr(self.frequency)
        sieve = Sieve(decode, "the sender of trackers")
        if self.link is Link.WEBSOCKET:
            return from_websocket(sieve, self.host, self.port)
        return from_datagrams(sieve, self.bind, self.port, self.host or None)


ORIGIN_MOVED = (
    "the origin of the tracking was set anew: nobody knows where the trackers are now; put it back, or "
    "measure `at` again and start anew"
)


async def from_openvr(rate: float) -> AsyncGenerator[tuple[float, Devices], None]:
    """Readings of SteamVR on this computer, ``rate`` times a second.

    Raises:
        ProtocolError: It does not run, or the package is not installed.
    """
    from seerob.protocols.tracking.openvr_devices import OpenVr

    with OpenVr() as runtime:
        while True:
            instant = runtime.read()
            yield time.monotonic(), instant
            await asyncio.sleep(1 / rate)
