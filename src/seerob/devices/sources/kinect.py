"""A depth camera that tracks bodies (Azure Kinect, Orbbec Femto), live, from a sender on its PC.

The tracker runs where the camera is plugged in; a small program there (``tools/kinect_sender``) sends what
it finds: 32 joints per person, in datagrams, or over a WebSocket. The message is in docs/sources/kinect.md.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections.abc import AsyncGenerator
from contextlib import aclosing
from enum import StrEnum
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.capture.captured import CaptureFrame, Layout
from seerob.devices.capture.options import AZURE_KINECT, placement
from seerob.devices.capture.stream_source import CaptureStream
from seerob.devices.live.listening import Contact, contact_of
from seerob.files.motion_capture.persons import Follower, numbers
from seerob.files.motion_capture.upright import kinect_upright, upright_rotation
from seerob.protocols.tracking.kinect import LAYOUT, PORT, Body, Picture, from_datagrams, from_websocket
from seerob.workstation.source import Opened, PostureError, Target
from seerob.workstation.workstation import Pose

_log = logging.getLogger(__name__)

LISTEN_FOR = 1.0
"""How long it is listened for what the camera says of itself [s]."""
TILTED = math.radians(3.0)
"""Gravity may differ from what ``at`` says by so much: the depth camera itself is mounted to 1° or so."""


class Link(StrEnum):
    """How the messages come."""

    UDP = "udp"
    """Datagrams that the sender sends to this machine."""
    WEBSOCKET = "websocket"
    """A connection to the sender."""


class Kinect(CaptureStream, frozen=True, kw_only=True):
    """A depth camera that tracks bodies (Azure Kinect, Orbbec Femto), live, from a sender on its PC."""

    known_error: ClassVar[PostureError | None] = AZURE_KINECT

    loads: ClassVar[tuple[str, ...]] = ("websockets.asyncio.client",)
    asks: ClassVar[str] = (
        "# at = { position = [x, y, z], rpy_deg = [roll, pitch, yaw] }   # where the camera stands and looks"
    )

    link: Link = Link.UDP
    """``udp``: the sender sends to this machine; ``websocket``: this machine connects to the sender."""
    host: str = ""
    """Address of the camera's PC; with ``udp`` only its datagrams count, and those of whoever sends
    first when not given. It is no proof: addresses of datagrams can be forged. When anybody else sends, the
    person is undecided."""
    port: Annotated[int, Meta(ge=1, le=65535)] = PORT
    """UDP or TCP port that the sender sends to, or listens on."""
    bind: str = "0.0.0.0"  # noqa: S104  # whoever sends is on another machine
    """Own address on which datagrams are listened for."""
    frequency: Annotated[float, Meta(ge=1, le=60, extra={"unit": "Hz"})] = 30.0
    """Pictures per second that the camera is set to [Hz]: 5, 15 or 30."""

    def period(self) -> float:
        """Interval between pictures [s]."""
        return 1 / self.frequency

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Ask the camera what it is, if it can be reached.

        Raises:
            InputError: Nobody says where the camera stands or which PC it is, or a number is none.
        """
        self._check()
        if self.at == Pose():
            what = "nobody says where the camera stands and looks"
            remedy = (
                "measure it and give at (x forward, y left, z up of the camera); `seerob probe kinect` helps"
            )
            raise InputError.at("sources", "at", what, remedy)
        return super().open(folder, target)

    def _check(self) -> None:
        numbers(self.subject)
        if self.link == Link.WEBSOCKET and not self.host:
            what = "no address to connect to"
            raise InputError.at("sources", "host", what, "give that of the camera's PC")

    def pictures(self) -> AsyncGenerator[tuple[float, Picture], None]:
        """What the sender says, as it arrives."""
        if self.link == Link.WEBSOCKET:
            return from_websocket(self.host, self.port)
        return from_datagrams(self.bind, self.port, self.host or None)

    def contact(self) -> Contact:
        """The camera's PC."""
        return contact_of(self, listens=self.link is Link.UDP)

    async def ask(self) -> tuple[Finding, ...]:
        """Listen for a second: which camera, how many persons, and how it is tilted."""
        self._check()
        heard: list[Picture] = []
        end = time.monotonic() + LISTEN_FOR
        try:
            async with asyncio.timeout(LISTEN_FOR), aclosing(self.pictures()) as pictures:
                async for _, picture in pictures:
                    heard.append(picture)
                    if time.monotonic() > end:
                        break
        except TimeoutError as error:
            if not heard:
                where = f"port {self.port}" if self.link == Link.UDP else f"{self.host}:{self.port}"
                raise TimeoutError(f"nothing came to {where} within {LISTEN_FOR:g} s") from error
        return tuple(
            Finding(level=level, subject=self.human, text=text) for level, text in remarks(heard, self.at)
        )

    async def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        """The person who is followed; all NaN while not seen.

        Raises:
            OSError: There is no connection, or no longer.
            ProtocolError: What comes cannot be understood.
        """
        follower = Follower(self.subject)
        label = self.subject
        events = 0
        async with aclosing(self.pictures()) as pictures:
            async for _, picture in pictures:
                body = follower.choose(picture)
                label = label or ("" if body is None else str(body.id))
                events = _tell(self.name or f"kinect {self.human}", follower, events)
                yield LAYOUT, frame(picture.t, body, label)


def frame(t: float, body: Body | None, subject: str) -> CaptureFrame:
    """What is seen of a person; NaN everywhere when that is nothing."""
    if body is None:
        return CaptureFrame(t=t, positions=np.full((len(LAYOUT.names), 3), np.nan), subject=subject)
    return CaptureFrame(
        t=t,
        positions=body.positions,
        orientations=body.orientations,
        confidence=body.confidence,
        subject=subject,
    )


def remarks(heard: list[Picture], at: Pose) -> list[tuple[str, str]]:
    """What is to be said of a camera after a second of listening, as level and text."""
    camera = next((p.camera for p in heard if p.camera), "")
    ids = sorted({body.id for p in heard for body in p.bodies})
    said = [("note", f"depth camera {camera or 'without a number'}: {len(heard)} pictures in a second")]
    if not ids:
        said.append(("warning", "it sees nobody"))
    elif max(len(p.bodies) for p in heard) > 1:
        listed = ", ".join(map(str, ids))
        said.append(("warning", f"it sees several persons ({listed}): name the person's number as subject"))
    if any(body.confidence is None for p in heard for body in p.bodies):
        said.append(
            ("assumed", "it sends no confidences: joints that the tracker only predicts count as seen")
        )
    ups = [p.up for p in heard if p.up is not None]
    if ups:
        said.append(_level(np.median(ups, axis=0), at))
    elif (standing := _standing(heard)) is not None:
        said.append(standing)
    return said


def _level(up: Array, at: Pose) -> tuple[str, str]:
    """Whether ``at`` agrees with the camera's accelerometer, or what it should say."""
    up = up / np.linalg.norm(up)
    rotation = upright_rotation(up)
    roll, pitch = (
        math.atan2(rotation[2, 1], rotation[2, 2]),
        -math.asin(float(np.clip(rotation[2, 0], -1, 1))),
    )
    shown = f"rpy_deg = [{math.degrees(roll):.1f}, {math.degrees(pitch):.1f}, …]"
    if at == Pose():
        text = f"gravity: give at = {{ position = […], {shown} }} with its place and heading as measured"
        return "note", text
    off = math.acos(float(np.clip(placement(at)[2, :3] @ up, -1, 1)))
    if off > TILTED:
        text = f"at differs by {math.degrees(off):.1f}° from the vertical that the camera feels ({shown})"
        return "warning", text
    return "note", f"at agrees to {math.degrees(off):.1f}° with the vertical that the camera feels"


def _standing(heard: list[Picture]) -> tuple[str, str] | None:
    bodies = [p.bodies[0].positions for p in heard if len(p.bodies) == 1]
    if not bodies:
        return None
    _, finding = kinect_upright(np.stack(bodies), file="the camera has no accelerometer")
    return finding.level, finding.text


def _tell(name: str, follower: Follower, told: int) -> int:
    """One line per change of number; how many there were."""
    count = len(follower.renamed) + len(follower.exchanged)
    if count > told:
        what = "exchanged: followed by place" if follower.exchanged else "changed: taken for the same person"
        _log.warning("%s: the tracker's number of the person was %s", name, what)
    return count
