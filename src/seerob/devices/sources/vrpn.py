"""Trackers of a VRPN server (Vicon Tracker, Motive, and many others), live over TCP.

Only read: the cookie is answered, nothing else is said. Which tracker is worn where, VRPN does not say.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncGenerator, Iterable
from contextlib import aclosing
from typing import Annotated

import numpy as np
from msgspec import Meta, field

from seerob.core.snapshot import Finding
from seerob.core.transforms import turned
from seerob.description.capture.captured import CaptureFrame, Layout, Seen
from seerob.devices.capture.stream_source import CaptureStream
from seerob.devices.live.listening import say_once
from seerob.files.motion_capture.upright import Up, world_from_file
from seerob.files.tables.mapping import SI, LengthUnit
from seerob.protocols import ProtocolError
from seerob.protocols.links.connection import connected
from seerob.protocols.tracking import vrpn
from seerob.protocols.tracking.vrpn import TrackerPose

_log = logging.getLogger(__name__)

GATHER = 0.3
"""Sensors that appear later than this are not used until it is connected anew [s]: another set of names
would make a calibration void."""
CONNECT_WITHIN = 2.0
SILENCE = 1.0
"""Without a pose the connection counts as lost [s]."""
LISTEN_AT_START = 0.5
"""How long it is listened to at start [s]."""

Key = tuple[str, int]
"""Tracker and sensor."""


class Vrpn(CaptureStream, frozen=True, kw_only=True):
    """Trackers of a VRPN server, live."""

    host: str
    """Address of the computer with the server."""
    port: Annotated[int, Meta(ge=1, le=65535)] = vrpn.PORT
    """Port of the server."""
    trackers: dict[str, str] = field(default_factory=dict)
    """Name at the server → where it is worn (``waist``, ``left_foot`` …); ``name/3`` is sensor 3 of a tracker
    that has several."""
    up: Up | None = None
    """Axis of the server's world that points up; z is assumed when not given."""
    unit: LengthUnit = LengthUnit.M
    """Unit of positions; VRPN's convention is metres."""
    frequency: Annotated[float, Meta(ge=1, le=1000, extra={"unit": "Hz"})] = 100.0
    """Rate of the server [Hz]."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return 1 / self.frequency

    async def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        """All sensors, put together per instant.

        Raises:
            OSError: There is no connection, or no longer.
            ProtocolError: It is no VRPN server, or sends nonsense.
        """
        rows: dict[Key, int] | None = None
        layout: Layout | None = None
        seen: set[Key] = set()
        late: set[Key] = set()
        pending: dict[Key, TrackerPose] = {}
        begun: float | None = None
        async with aclosing(self._poses()) as poses:
            async for arrived, pose in poses:
                begun = arrived if begun is None else begun
                key = pose.tracker, pose.sensor
                if rows is None or layout is None:
                    seen.add(key)
                    if arrived - begun < GATHER:
                        continue
                    rows = {key: row for row, key in enumerate(sorted(seen))}
                    layout = self._layout(rows)
                if key not in rows:
                    if key not in late and len(late) < vrpn.MOST_NAMES:
                        late.add(key)
                        text = f"{self.name}: {key[0]}/{key[1]} appeared late and is not used"
                        say_once(_log, logging.WARNING, text)
                    continue
                first = min((p.t for p in pending.values()), default=pose.t)
                if key in pending or abs(pose.t - first) > 0.5 * self.period():
                    yield layout, self._frame(pending, rows)
                    pending = {}
                pending[key] = pose
                if len(pending) == len(rows):
                    yield layout, self._frame(pending, rows)
                    pending = {}

    def _layout(self, keys: Iterable[Key]) -> Layout:
        names = names_of(keys)
        return Layout(
            seen=Seen.TRACKERS,
            names=tuple(self.trackers.get(name, name) for name in names.values()),
            convention="trackers",
        )

    def _frame(self, pending: dict[Key, TrackerPose], rows: dict[Key, int]) -> CaptureFrame:
        values = np.full((len(rows), 7), np.nan)
        for key, pose in pending.items():
            values[rows[key], :3], values[rows[key], 3:] = pose.position, pose.xyzw
        t = max([pose.t for pose in pending.values()])
        world = world_from_file(self.up or Up.Z)
        with np.errstate(all="ignore"):  # what is not finite is left out where it is used
            positions = (SI[self.unit][1] * values[:, :3]) @ world.T
            return CaptureFrame(t=t, positions=positions, orientations=turned(world, values[:, [6, 3, 4, 5]]))

    async def ask(self) -> tuple[Finding, ...]:
        """Which trackers and sensors there are."""
        found: set[Key] = set()
        end = time.monotonic() + LISTEN_AT_START
        try:
            async with asyncio.timeout(LISTEN_AT_START + CONNECT_WITHIN), aclosing(self._poses()) as poses:
                async for arrived, pose in poses:
                    found.add((pose.tracker, pose.sensor))
                    if arrived > end:
                        break
        except TimeoutError:
            if not found:
                raise
        names = list(names_of(sorted(found)).values())
        said = [("note", f"trackers: {', '.join(names[:40])}")]
        if self.up is None:
            said.append(("assumed", "z is up: VRPN does not say; give up"))
        absent = [name for name in self.trackers if name not in names]
        if absent:
            said.append(("warning", f"not heard: {', '.join(absent)}"))
        return tuple(Finding(level=level, subject=self.human, text=f"vrpn: {text}") for level, text in said)

    async def _poses(self) -> AsyncGenerator[tuple[float, TrackerPose], None]:
        async with connected(self.host, self.port, CONNECT_WITHIN) as connection:
            await connection.write(vrpn.COOKIE)
            data = b""
            async with asyncio.timeout(CONNECT_WITHIN):
                while len(data) < len(vrpn.COOKIE):
                    if not (more := (await connection.read(CONNECT_WITHIN)).data):
                        raise ProtocolError("no VRPN answers there: the connection was closed")
                    data += more
            vrpn.check_cookie(data[: len(vrpn.COOKIE)])
            data = data[len(vrpn.COOKIE) :]
            splitter, names = vrpn.Splitter(), vrpn.Reader()
            heard = arrived = time.monotonic()
            while True:
                for message in splitter.feed(data):
                    pose = names.take(message)
                    if pose is not None:
                        heard = arrived
                        yield arrived, pose
                if arrived - heard > 2 * SILENCE:  # it only says that it lives
                    shown = ", ".join(list(names.senders.values())[:8]) or "none"
                    raise TimeoutError(f"connected, but no pose of a tracker comes (senders: {shown})")
                arrived, data, _ = await connection.read(SILENCE)
                if not data:
                    raise ProtocolError("the server closed the connection")


def names_of(keys: Iterable[Key]) -> dict[Key, str]:
    """``tracker`` where it has one sensor only, ``tracker/3`` else."""
    every = list(keys)
    trackers = [tracker for tracker, _ in every]
    return {
        (tracker, sensor): tracker if trackers.count(tracker) == 1 and sensor == 0 else f"{tracker}/{sensor}"
        for tracker, sensor in every
    }
