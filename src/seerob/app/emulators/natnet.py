"""A NatNet server without Motive: answers questions, and streams moving people and rigid bodies."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Annotated, Literal

import numpy as np

from seerob.app.emulation.background import Emulator
from seerob.app.emulation.mvn_person import Person
from seerob.app.emulation.options import PersonOptions, Ready, option, port
from seerob.core.transforms import turned
from seerob.files.motion_capture.upright import world_from_file
from seerob.protocols.tracking import mvn_pose, natnet
from seerob.protocols.tracking.natnet import (
    RIGID_BODY,
    SKELETON,
    Bodies,
    Body,
    BoneModel,
    Frame,
    Message,
    Models,
    Skeleton,
    SkeletonModel,
    Version,
)
from seerob.protocols.tracking.natnet import Body as RigidBody

ONE_MARKER = struct.pack("<i", 1) + struct.pack("<3f", 0.1, 0.2, 0.3)


def frame(said: Frame, version: Version) -> bytes:
    """Payload of a frame; with one marker set and one unlabelled marker, as real ones have."""
    markers = b"all\0" + ONE_MARKER
    parts = [
        struct.pack("<i", said.number),
        _listed([markers], version),
        _listed([struct.pack("<3f", 0.4, 0.5, 0.6)], version),
        _listed([_body(body, version) for body in said.bodies], version),
    ]
    if version >= (2, 1):
        parts.append(_listed([_skeleton(s, version) for s in said.skeletons], version))
    if version >= (4, 1):
        parts.append(_listed([], version))
    if version >= (2, 3):
        labeled = struct.pack("<i4f", 7, 0.1, 0.2, 0.3, 0.014)
        labeled += struct.pack("<H", 0) if version >= (2, 6) else b""
        labeled += struct.pack("<f", 0.0004) if version >= (3, 0) else b""
        parts.append(_listed([labeled], version))
    if version >= (2, 9):
        parts.append(_listed([struct.pack("<iiif", 1, 1, 1, 9.81)], version))
    if version >= (2, 11):
        parts.append(_listed([], version))
    parts.append(struct.pack("<II", 0, 0))
    parts.append(struct.pack("<d" if version >= (2, 7) else "<f", said.t))
    if version >= (3, 0):
        parts.append(struct.pack("<3Q", 1, 2, 3))
    if version >= (4, 1):
        parts.append(struct.pack("<II", 4, 5))
    parts.append(struct.pack("<HI", said.recording | said.models_changed << 1, 0))
    return b"".join(parts)


def models(said: Models, version: Version) -> bytes:
    """Payload of the model definitions."""
    found = [_defined(RIGID_BODY, _bone_model(body, version), version) for body in said.bodies]
    for skeleton in said.skeletons:
        bones = b"".join(_bone_model(bone, version) for bone in skeleton.bones)
        head = skeleton.name.encode() + b"\0" + struct.pack("<ii", skeleton.id, len(skeleton.bones))
        found.append(_defined(SKELETON, head + bones, version))
    markers = b"all\0" + struct.pack("<i", 1) + b"marker\0"
    found.append(_defined(0, markers, version))
    return struct.pack("<i", len(found)) + b"".join(found)


def server_info(name: str, version: Version, *, port: int, group: str | None) -> bytes:
    """Payload of the answer to a client that connects."""
    start = name.encode().ljust(256, b"\0") + bytes([1, 0, 0, 0, *version, 0, 0])
    if version < (3, 0):
        return start
    where = bytes(int(part) for part in (group or "0.0.0.0").split("."))  # noqa: S104  # none
    return start + struct.pack("<QH?", 10_000_000, port, group is not None) + where


def _listed(items: Sequence[bytes], version: Version) -> bytes:
    content = b"".join(items)
    size = struct.pack("<i", len(content)) if version >= (4, 1) else b""
    return struct.pack("<i", len(items)) + size + content


def _body(body: RigidBody, version: Version) -> bytes:
    data = struct.pack("<i7f", body.id, *body.position, *body.xyzw)
    if version < (3, 0):
        data += ONE_MARKER + struct.pack("<if", 1, 0.014)
    data += struct.pack("<f", body.error)
    return data + (struct.pack("<H", body.tracked) if version >= (2, 6) else b"")


def _skeleton(skeleton: Skeleton, version: Version) -> bytes:
    bones = b"".join(_body(bone, version) for bone in skeleton.bones)
    return struct.pack("<ii", skeleton.id, len(skeleton.bones)) + bones


def _bone_model(bone: BoneModel, version: Version) -> bytes:
    data = bone.name.encode() + b"\0" + struct.pack("<ii3f", bone.id, bone.parent, 0.0, 0.1, 0.0)
    if version >= (4, 2):
        data += struct.pack("<4f", 0.0, 0.0, 0.0, 1.0)
    if version >= (3, 0):
        data += struct.pack("<i3fi", 1, 0.0, 0.0, 0.0, 3)
        data += b"m1\0" if version >= (4, 0) else b""
    return data


def _defined(kind: int, content: bytes, version: Version) -> bytes:
    size = struct.pack("<i", len(content)) if version >= (4, 1) else b""
    return struct.pack("<i", kind) + size + content


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
_ROWS = [mvn_pose.SEGMENTS.index(segment) for _, segment, _ in BONES]
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
            skeletons.append(Skeleton(number, Bodies.of(bones)))
        bodies: list[Body] = []
        for index, (person, segment) in enumerate(self.worn.values()):
            pose, row = person(t), mvn_pose.SEGMENTS.index(segment)
            bodies += _as_bodies(pose.positions[row, None], pose.wxyz[row, None], 100 + index)
        return Frame(k, t, Bodies.of(bodies), tuple(skeletons), models_changed=False, recording=False)

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
            info = server_info("Emulated Motive", self.version, port=port, group=address)
            link.sendto(natnet.message(Message.SERVER_INFO, info), client)
        elif kind == Message.REQUEST_MODELS:
            said = models(self.models(), self.version)
            link.sendto(natnet.message(Message.MODELS, said), client)

    def _stream(self, link: socket.socket, k: int) -> None:
        data = natnet.message(Message.FRAME, frame(self.frame(k), self.version))
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
