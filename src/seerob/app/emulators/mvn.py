"""MVN's network streamer without MVN: sends a moving person over a real socket, UDP or TCP."""

from __future__ import annotations

import random
import socket
import struct
import time
from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np

from seerob.app.emulation.background import Emulator
from seerob.app.emulation.mvn_person import Person, Pose
from seerob.app.emulation.options import PersonOptions, Ready, To, option, port
from seerob.core.transforms import Array, angles_from_rotation, rotation_from_wxyz, wxyz_from_rotation
from seerob.devices.capture.xsens import anatomical, joint_angles
from seerob.protocols.tracking import mvn
from seerob.protocols.tracking.mvn import Header, Kind, ScalePoint, encode, pack_items, pack_scale, pack_tags
from seerob.protocols.tracking.mvn_pose import JOINTS, PARENTS, SEGMENTS, UNITY

IDS = np.arange(1, len(SEGMENTS) + 1)
HEAD_OVER_NECK = 2.0
"""Height of the head over the length of the neck: what the emulated person's stature is made of."""
_JOINT_IDS = np.array([[(SEGMENTS.index(p) + 1) << 8, (SEGMENTS.index(c) + 1) << 8] for _, p, c in JOINTS])
_UNITY_ROWS = [SEGMENTS.index(name) for name in UNITY]
_Y_UP = [1, 2, 0]
"""(x, y, z) with z up → y up: the inverse of what a reader does."""


def datagrams(
    kind: Kind,
    pose: Pose,
    *,
    sample: int,
    t: float,
    units: float = 1.0,
    character: int = 0,
    name: str = "emulated",
    items_each: int = 0,
    old: bool = False,
) -> list[bytes]:
    """One instant in one kind.

    Args:
        kind: Of `Kind`; motion trackers (23) and points (03) are not emulated.
        pose: The person.
        sample: Counter.
        t: Time code [s].
        units: Units of the stream per metre: 1 or 100.
        character: Its number.
        name: Its name.
        items_each: At most so many items per datagram, then there are several; 0 for all in one.
        old: Header of versions before 2019, with zeros at its end.

    Raises:
        ValueError: The kind is not emulated.
    """
    ids, values, payload = np.zeros(0, int), np.zeros((0, 1)), b""
    p = units * pose.positions
    match kind:
        case Kind.EULER:
            ids, values = IDS, np.hstack([p[:, _Y_UP], _euler(pose.wxyz)])
        case Kind.QUATERNION:
            ids, values = IDS, np.hstack([p, pose.wxyz])
        case Kind.UNITY:
            ids, values = IDS, _unity(Pose(p, pose.wxyz))
        case Kind.ANGLES:
            ids, values = _JOINT_IDS, np.degrees(joint_angles(anatomical(pose.wxyz)))
        case Kind.LINEAR:
            ids, values = IDS, np.hstack([p, np.zeros((len(IDS), 6))])
        case Kind.ANGULAR:
            ids, values = IDS, np.hstack([pose.wxyz, np.zeros((len(IDS), 6))])
        case Kind.MASS_CENTER:
            payload = struct.pack(">3f", *p.mean(axis=0))
        case Kind.META:
            payload = pack_tags({"name": name, "xmid": "00000000", "color": "e96417"})
        case Kind.SCALE:
            payload = _scale(Pose(p, pose.wxyz))
        case Kind.TIME_CODE:
            whole = int(t)
            clock = (
                f"{whole // 3600 % 24:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}.{int(1000 * (t % 1)):03d}"
            )
            payload = clock.encode()
        case _:
            raise ValueError(f"{kind!r} is not emulated")
    each = items_each or max(len(ids), 1)
    starts = range(0, max(len(ids), 1), each)
    found = []
    for part, start in enumerate(starts):
        own = slice(start, start + each)
        body = payload or pack_items(ids[own], values[own])
        header = Header(
            kind=kind,
            sample=sample,
            part=part,
            last=part == len(starts) - 1,
            items=len(ids[own]) or 1,
            time_code=round(1000 * t),
            character=character,
            segments=0 if old else len(SEGMENTS),
        )
        data = encode(header, body)
        found.append(data[:17] + bytes(7) + data[24:] if old else data)
    return found


def _euler(wxyz: Array) -> Array:
    """Turns about the fixed axes x, y, z with y up [deg]."""
    angles = angles_from_rotation("ZYX", rotation_from_wxyz(wxyz[:, [0, 2, 3, 1]]))
    return np.rad2deg(angles[:, ::-1])


def _unity(pose: Pose) -> Array:
    """Offsets and turns against the parents, y up, left-handed."""
    offsets, turns = _against_parents(pose)
    q = np.array([wxyz_from_rotation(turn) for turn in turns])
    left = np.stack([-offsets[:, 1], offsets[:, 2], offsets[:, 0]], axis=1)
    quaternions = np.stack([q[:, 0], q[:, 2], -q[:, 3], -q[:, 1]], axis=1)
    return np.asarray(np.hstack([left, quaternions])[_UNITY_ROWS])


def _scale(pose: Pose) -> bytes:
    """The person in the T-pose, where every segment's axes are the world's."""
    offsets, _ = _against_parents(pose)
    at = np.zeros_like(offsets)
    for k, parent in enumerate(PARENTS):
        if parent >= 0:
            at[k] = at[parent] + offsets[k]
    at[:, 2] -= at[:, 2].min()
    head = SEGMENTS.index("Head")
    neck = float(np.linalg.norm(offsets[head]))
    top = ScalePoint(head + 1, 1, "pTopOfHead", 0, (0.0, 0.0, HEAD_OVER_NECK * neck))
    return pack_scale([(name, p) for name, p in zip(SEGMENTS, at.tolist(), strict=True)], [top])


def _against_parents(pose: Pose) -> tuple[Array, Array]:
    """Offsets and rotations of the segments in the frames of their parents."""
    R = rotation_from_wxyz(pose.wxyz)
    offsets, turns = pose.positions.copy(), R.copy()
    for k, parent in enumerate(PARENTS):
        if parent >= 0:
            offsets[k] = R[parent].T @ (pose.positions[k] - pose.positions[parent])
            turns[k] = R[parent].T @ R[k]
    return offsets, turns


KINDS = (Kind.QUATERNION, Kind.ANGLES, Kind.MASS_CENTER, Kind.META, Kind.SCALE)
SELDOM = frozenset({Kind.META, Kind.SCALE})
"""Sent once a second."""
LATE = 0.5
"""Time that is not made up for when this machine was too slow [s]."""
PATIENCE = 2.0
"""For a TCP connection [s]."""

Way = Callable[[list[bytes]], Sequence[bytes]]
"""What a network does to the datagrams of an instant: loses, swaps, doubles some."""


class MvnSender(Emulator):
    """The streamer, in a thread of its own.

    Args:
        people: By the number of the character.
        to: Address and port to send to.
        rate: Instants per second [Hz].
        kinds: Datagrams of each instant.
        units: Units of the stream per metre: 1 or 100.
        tcp: Connect and send in a stream.
        items_each: Items per datagram at most; 0 for all in one.
        old: Headers of versions before 2019.
        way: What happens to them on the way.
    """

    def __init__(
        self,
        people: dict[int, Person],
        *,
        to: tuple[str, int] = ("127.0.0.1", mvn.PORT),
        rate: float = 60.0,
        kinds: Sequence[Kind] = KINDS,
        units: float = 1.0,
        tcp: bool = False,
        items_each: int = 0,
        old: bool = False,
        way: Way | None = None,
    ) -> None:
        super().__init__()
        self.people, self.to, self.rate, self.kinds = dict(people), to, rate, tuple(kinds)
        self.units, self.tcp, self.items_each, self.old, self.way = units, tcp, items_each, old, way
        self.sent = 0
        """Instants so far."""
        self.phase = 0.0
        """Of its clock [s]: one that starts again says nothing that it said before to the last bit."""

    def begin(self) -> Callable[[], object]:
        """Connect.

        Raises:
            OSError: With TCP, nobody listens there.
        """
        self.phase = random.uniform(0.0, 0.25 / self.rate)  # noqa: S311 - no secret
        if self.tcp:
            link = socket.create_connection(self.to, PATIENCE)
            link.settimeout(PATIENCE)
        else:
            link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            link.connect(self.to)
        return lambda: self._send(link)

    def instant(self, k: int) -> list[bytes]:
        """All datagrams of an instant, as they are sent."""
        t = self.phase + k / self.rate
        seldom = k % max(round(self.rate), 1) == 0
        found: list[bytes] = []
        for number, person in self.people.items():
            pose = person(t)
            for kind in self.kinds:
                if seldom or kind not in SELDOM:
                    found += datagrams(
                        kind,
                        pose,
                        sample=k,
                        t=t,
                        units=self.units,
                        character=number,
                        name=f"person {number}",
                        items_each=self.items_each,
                        old=self.old,
                    )
        return found if self.way is None else list(self.way(found))

    def _send(self, link: socket.socket) -> None:
        begun, k = time.monotonic(), 0
        with link:
            while not self._over.wait(max(0.0, begun + k / self.rate - time.monotonic())):
                try:
                    for datagram in self.instant(k):
                        link.sendall(datagram)
                except ConnectionRefusedError:
                    pass  # nobody listens yet: a streamer does not mind
                except OSError:
                    return
                self.sent += 1
                late = time.monotonic() - begun - k / self.rate
                k += 1 + (int(late * self.rate) if late > LATE else 0)


# -- options ------------------------------------------------------------------------------------


class Mvn(PersonOptions, frozen=True, kw_only=True):
    """Xsens MVN's network streamer, which sends a moving person."""

    to: To = "127.0.0.1"
    port: Annotated[int, port("port to send to")] = mvn.PORT
    rate: Annotated[float, option("samples per second", "Hz", ge=1, le=240)] = 60.0
    tcp: Annotated[bool, option("connect and send in a stream; else UDP")] = False
    cm: Annotated[bool, option("positions in centimetres, as the specification says")] = False

    def ready(self) -> Ready:
        """The streamer."""
        server = MvnSender(
            {0: self.person()},
            to=(self.to, self.port),
            rate=self.rate,
            units=100.0 if self.cm else 1.0,
            tcp=self.tcp,
        )
        return Ready(server, f"a person, {self.file}", f"{self.to}:{self.port}")
