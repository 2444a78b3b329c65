"""A NatNet server without Motive: answers questions, and streams moving people and rigid bodies."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated, Literal

import numpy as np

from seerob.app.emulation import natnet_datagrams
from seerob.app.emulation.background import Emulator
from seerob.app.emulation.mvn_person import Person
from seerob.app.emulation.options import PersonOptions, Ready, option, port
from seerob.core.transforms import turned
from seerob.files.motion_capture.upright import world_from_file
from seerob.protocols.tracking import mvn_segments, natnet
from seerob.protocols.tracking.natnet import (
    Body,
    BoneModel,
    Frame,
    Message,
    Models,
    Skeleton,
    SkeletonModel,
    Version,
)

FORGET = 4.0
"""A client that is not heard for so long is not sent to any more [s]."""
_BONES = {
    "Hip": ("Pelvis", 0),
    "Ab": ("L5", 1),
    "Chest": ("T12", 2),
    "Neck": ("Neck", 3),
    "Head": ("Head", 4),
}
_ARM = (("Shoulder", "Shoulder"), ("UArm", "UpperArm"), ("FArm", "ForeArm"), ("Hand", "Hand"))
_LEG = (("Thigh", "UpperLeg"), ("Shin", "LowerLeg"), ("Foot", "Foot"), ("Toe", "Toe"))


def _bones() -> tuple[tuple[str, str, int], ...]:
    """Motive's name, the segment it is, number of its parent; numbers count from 1."""
    rows = [(name, segment, parent) for name, (segment, parent) in _BONES.items()]
    for side in ("Left", "Right"):
        for limb, first in ((_ARM, 3), (_LEG, 1)):
            parent = first
            for name, segment in limb:
                rows.append((f"{side[0]}{name}", f"{side}{segment}", parent))
                parent = len(rows)
    return tuple(rows)


BONES = _bones()
_ROWS = [mvn_segments.SEGMENTS.index(segment) for _, segment, _ in BONES]
_WORLD = world_from_file("y")


class NatnetServer(Emulator):
    """Motive's streaming, in a thread of its own.

    Args:
        people: Skeletons by name.
        worn: Rigid bodies: name → person and segment of MVN on which it is worn.
        version: Of NatNet.
        host: Own address.
        port: Own port for questions; 0 is any free one.
        group: Multicast group and port; None for unicast to whoever asks.
        rate: Frames per second [Hz].
    """

    def __init__(
        self,
        people: dict[str, Person],
        *,
        worn: dict[str, tuple[Person, str]] | None = None,
        version: Version = (4, 1),
        host: str = "127.0.0.1",
        port: int = natnet.COMMAND_PORT,
        group: tuple[str, int] | None = None,
        rate: float = 120.0,
    ) -> None:
        super().__init__()
        self.people, self.worn, self.version = dict(people), dict(worn or {}), version
        self.host, self.port, self.group, self.rate = host, port, group, rate
        self.sent = 0
        """Frames so far."""
        self._clients: dict[tuple[str, int], float] = {}

    def begin(self) -> Callable[[], object]:
        """Begin to answer and to stream.

        Raises:
            OSError: The port is taken.
        """
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            link.bind((self.host, self.port))
            if self.group is not None:
                link.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(self.host))
                link.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        except OSError:
            link.close()
            raise
        self.port = link.getsockname()[1]
        return lambda: self._serve(link)

    def models(self) -> Models:
        """What there is."""
        skeletons = tuple(
            SkeletonModel(
                number,
                name,
                tuple(BoneModel(k, f"{name}_{bone}", parent) for k, (bone, _, parent) in enumerate(BONES, 1)),
            )
            for number, name in enumerate(self.people, 1)
        )
        bodies = tuple(BoneModel(100 + k, name, -1) for k, name in enumerate(self.worn))
        return Models(bodies, skeletons)

    def frame(self, k: int) -> Frame:
        """The frame number ``k``."""
        t = k / self.rate
        skeletons = []
        for number, person in enumerate(self.people.values(), 1):
            pose = person(t)
            bones = _as_bodies(pose.positions[_ROWS], pose.wxyz[_ROWS], (number << 16) + 1)
            skeletons.append(Skeleton(number, bones))
        bodies: list[Body] = []
        for index, (person, segment) in enumerate(self.worn.values()):
            pose, row = person(t), mvn_segments.SEGMENTS.index(segment)
            bodies += _as_bodies(pose.positions[row, None], pose.wxyz[row, None], 100 + index)
        return Frame(k, t, tuple(bodies), tuple(skeletons), models_changed=False, recording=False)

    def _serve(self, link: socket.socket) -> None:
        begun, k = time.monotonic(), 0
        with link:
            while not self._over.is_set():
                wait = begun + k / self.rate - time.monotonic()
                if wait > 0:
                    link.settimeout(wait)
                    with suppress(OSError):  # time for the next frame, or a client that has gone
                        self._answer(link, *link.recvfrom(2048))
                    continue
                self._stream(link, k)
                late = time.monotonic() - begun - k / self.rate
                k += 1 + (int(late * self.rate) if late > 0.5 else 0)

    def _answer(self, link: socket.socket, data: bytes, client: tuple[str, int]) -> None:
        self._clients[client] = time.monotonic()
        kind = int.from_bytes(data[:2], "little")
        if kind == Message.CONNECT:
            address, port = self.group or (None, natnet.DATA_PORT)
            info = natnet_datagrams.server_info("Emulated Motive", self.version, port=port, group=address)
            link.sendto(natnet.message(Message.SERVER_INFO, info), client)
        elif kind == Message.REQUEST_MODELS:
            said = natnet_datagrams.models(self.models(), self.version)
            link.sendto(natnet.message(Message.MODELS, said), client)

    def _stream(self, link: socket.socket, k: int) -> None:
        data = natnet.message(Message.FRAME, natnet_datagrams.frame(self.frame(k), self.version))
        now = time.monotonic()
        self._clients = {client: t for client, t in self._clients.items() if now - t < FORGET}
        for client in [self.group] if self.group is not None else list(self._clients):
            with suppress(OSError):  # nobody there: a server does not mind
                link.sendto(data, client)
        self.sent += 1


def _as_bodies(positions: np.ndarray, wxyz: np.ndarray, first: int) -> tuple[Body, ...]:
    places, turns = positions @ _WORLD, turned(_WORLD.T, wxyz)
    return tuple(
        Body(first + k, place, turn[[1, 2, 3, 0]], 0.0002, tracked=True)
        for k, (place, turn) in enumerate(zip(places, turns, strict=True))
    )


# -- options ------------------------------------------------------------------------------------

TRACKED = {"waist": "Pelvis", "left_foot": "LeftFoot", "right_foot": "RightFoot"}
TRACKED |= {"left_hand": "LeftHand", "right_hand": "RightHand"}
"""Rigid bodies and the segments that they sit on."""
_GROUP = "group (address) to send to, port 1511; else to who asks"


class Natnet(PersonOptions, frozen=True, kw_only=True):
    """OptiTrack Motive's stream (NatNet), with a moving person."""

    rate: Annotated[float, option("samples per second", "Hz", ge=1, le=1000)] = 120.0
    port: Annotated[int, port("port for questions; 0 is any free one")] = 1510
    version: Annotated[
        Literal["2.6", "2.9", "3.0", "3.1", "4.0", "4.1", "4.2"], option("version of NatNet")
    ] = "4.1"
    multicast: Annotated[str, option(_GROUP)] | None = None

    def ready(self) -> Ready:
        """Motive."""
        person = self.person()
        major, minor = map(int, self.version.split("."))
        server = NatnetServer(
            {"Anna": person},
            worn={name: (person, segment) for name, segment in TRACKED.items()},
            version=(major, minor),
            host=self.host,
            port=self.port,
            group=(self.multicast, natnet.DATA_PORT) if self.multicast else None,
            rate=self.rate,
        )
        return Ready(server, f"a skeleton and five rigid bodies, {self.file}", f"{self.host}:{self.port}")
