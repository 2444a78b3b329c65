"""The sender beside SteamVR without trackers: sends those that a moving person would wear."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from seerob.app.emulators.message_sender import MessageSender, Way
from seerob.app.emulators.mvn_person import Person
from seerob.core.transforms import rotation_from_rpy, rotation_from_wxyz, wxyz_from_rotation
from seerob.protocols.tracking import mvn_segments
from seerob.protocols.tracking.vive import PORT, Device, Devices, encode

WORN = {
    "waist": "Pelvis",
    "chest": "T8",
    "left_foot": "LeftFoot",
    "right_foot": "RightFoot",
    "left_hand": "LeftHand",
    "right_hand": "RightHand",
    "left_elbow": "LeftForeArm",
    "right_elbow": "RightForeArm",
    "head": "Head",
}
"""Roles and the segments that they sit on."""
FIVE = ("waist", "left_foot", "right_foot", "left_hand", "right_hand")
"""The least with which a whole body is followed."""
STRAP = rotation_from_rpy((0.4, -0.7, 1.1))
"""How a tracker happens to be turned on its strap."""

Trackers = Callable[[float], Devices]
"""All devices at a time [s]."""


def worn(person: Person, roles: Sequence[str] = FIVE) -> Trackers:
    """Trackers on a person.

    Args:
        person: Who wears them.
        roles: Of `WORN`.
    """
    rows = [mvn_segments.SEGMENTS.index(WORN[role]) for role in roles]

    def at(t: float) -> Devices:
        pose = person(t)
        return Devices(
            t,
            tuple(
                Device(
                    serial=f"LHR-{k:04X}",
                    role=role,
                    tracking=True,
                    position=np.asarray(pose.positions[row]),
                    wxyz=wxyz_from_rotation(rotation_from_wxyz(pose.wxyz[row]) @ STRAP),
                )
                for k, (role, row) in enumerate(zip(roles, rows, strict=True))
            ),
        )

    return at


def recorded(trackers: Trackers, *, duration: float, rate: float) -> Iterator[Devices]:
    """Instants for `seerob.files.motion_capture.tracker_file.write`.

    Args:
        trackers: What is recorded.
        duration: [s]
        rate: Instants per second [Hz].
    """
    for k in range(int(duration * rate)):
        yield trackers(k / rate)


class ViveSender(MessageSender):
    """The sender, in threads of its own.

    Args:
        trackers: What it sees.
        to: Address and port that datagrams go to; None for a WebSocket that others connect to.
        host: Own address to listen on, with a WebSocket.
        port: Own port to listen on, with a WebSocket; 0 is any free one.
        rate: Messages per second [Hz].
        way: What happens to each message on the way.
    """

    def __init__(
        self,
        trackers: Trackers,
        *,
        to: tuple[str, int] | None = ("127.0.0.1", PORT),
        host: str = "127.0.0.1",
        port: int = PORT,
        rate: float = 90.0,
        way: Way | None = None,
    ) -> None:
        super().__init__(to=to, host=host, port=port, rate=rate, way=way)
        self.trackers = trackers

    def message(self, k: int) -> bytes:
        """The message number ``k``."""
        return encode(self.trackers(k / self.rate))
