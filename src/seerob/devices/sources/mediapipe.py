"""A person whom MediaPipe sees in the pictures of any camera, live, from a program that runs it.

``examples/clients/mediapipe_camera.py`` is such a program: a result with its time per datagram, as in
docs/sources/mediapipe.md.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator
from contextlib import aclosing
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.description.capture.captured import CaptureFrame, Layout
from seerob.devices.capture.options import MEDIAPIPE
from seerob.devices.capture.stream_source import CaptureStream
from seerob.devices.live.listening import Contact, contact_of
from seerob.protocols import ProtocolError
from seerob.protocols.links.live_messages import SILENCE, Sieve, from_datagrams
from seerob.protocols.tracking.mediapipe import LAYOUT, PORT, Result, camera_points, centred, decode_message
from seerob.workstation.source import Opened, PostureError, Target
from seerob.workstation.workstation import Pose

LISTEN_FOR = 1.0
"""How long it is listened for what is sent [s]."""


class Mediapipe(CaptureStream, frozen=True, kw_only=True):
    """A person whom MediaPipe sees in any camera's pictures, live, from a program that runs it."""

    known_error: ClassVar[PostureError | None] = MEDIAPIPE
    placed: ClassVar[bool] = False
    asks: ClassVar[str] = (
        "# at = { position = [x, y, 0.95], rpy_deg = [roll, pitch, yaw] }   # of the hips; of the camera"
    )

    sender: str = ""
    """Address of the machine that runs MediaPipe; whoever sends first when not given. It is no proof:
    addresses of datagrams can be forged. When anybody else sends, the person is undecided."""
    port: Annotated[int, Meta(ge=1, le=65535)] = PORT
    """Own UDP port that the results are sent to."""
    bind: str = "127.0.0.1"
    """Own address on which datagrams are listened for; when not given, only this machine is heard."""
    frequency: Annotated[float, Meta(ge=1, le=240, extra={"unit": "Hz"})] = 30.0
    """Pictures per second [Hz]."""

    def period(self) -> float:
        """Interval between pictures [s]."""
        return 1 / self.frequency

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Check that somebody says how the camera is turned.

        Raises:
            InputError: Nobody does.
        """
        if self.at == Pose():
            what = "nobody says how the camera is turned"
            remedy = "give at: position of the hips, and as rpy_deg where the camera looks (pitch > 0: down)"
            raise InputError.at("sources", "at", what, remedy)
        return super().open(folder, target)

    def contact(self) -> Contact:
        """The program that runs MediaPipe."""
        return contact_of(self, listens=True)

    def results(self) -> AsyncGenerator[tuple[float, Result], None]:
        """What is sent, as it arrives."""
        sieve = Sieve(decode_message, "MediaPipe")
        return from_datagrams(sieve, self.bind, self.port, self.sender or None, SILENCE)

    async def ask(self) -> tuple[Finding, ...]:
        """Listen for a second: how many pictures, and whether one person is in them."""
        heard: list[Result] = []
        end = time.monotonic() + LISTEN_FOR
        try:
            async with asyncio.timeout(LISTEN_FOR), aclosing(self.results()) as results:
                async for _, result in results:
                    heard.append(result)
                    if time.monotonic() > end:
                        break
        except TimeoutError as error:
            if not heard:
                raise TimeoutError(f"nothing came to port {self.port} within {LISTEN_FOR:g} s") from error
        return tuple(Finding(level=level, subject=self.human, text=text) for level, text in remarks(heard))

    async def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        """The only person in the picture; all NaN while there is none, or several.

        Raises:
            OSError: The port is taken, or nothing comes.
            ProtocolError: Only nonsense comes, or coordinates in the picture.
        """
        async with aclosing(self.results()) as results:
            async for _, result in results:
                yield LAYOUT, frame(result)


def frame(result: Result) -> CaptureFrame:
    """What is seen of the only person; NaN everywhere when that is nobody, or one of several.

    Raises:
        ProtocolError: They are no world landmarks.
    """
    if len(result.people) != 1:
        return CaptureFrame(t=result.t, positions=np.full((len(LAYOUT.names), 3), np.nan))
    (values,) = result.people
    if not centred(values):
        raise ProtocolError("the hips are not at the origin: send pose_world_landmarks, not pose_landmarks")
    positions, orientations, confidence = camera_points(values[None])
    return CaptureFrame(
        t=result.t, positions=positions[0], orientations=orientations[0], confidence=confidence[0]
    )


def remarks(heard: list[Result]) -> list[tuple[str, str]]:
    """What is to be said after a second of listening, as level and text."""
    said = [("note", f"MediaPipe: {len(heard)} pictures in a second; no place in the room is known")]
    most = max(len(result.people) for result in heard)
    if most == 0:
        said.append(("warning", "nobody is seen"))
    elif most > 1:
        said.append(("warning", "several persons, without a number: they count as not seen (num_poses = 1)"))
    if any(np.isnan(person[:, 3]).any() for result in heard for person in result.people):
        said.append(("warning", "it sends no visibility: such landmarks count as not seen"))
    return said
