"""The sender beside SteamVR without trackers: sends those that a moving person would wear."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Literal

import numpy as np

from seerob.app.emulation.message_sender import MessageSender, Way
from seerob.app.emulation.motions import in_rounds
from seerob.app.emulation.mvn_person import ARMS, FIVE, WORN, Person
from seerob.app.emulation.options import IN_ROUNDS, PersonOptions, Ready, option, port
from seerob.core.transforms import Array, rotation_from_rpy, rotation_from_wxyz, wxyz_from_rotation
from seerob.protocols.tracking import mvn_pose
from seerob.protocols.tracking.vive import PORT, Device, Devices, encode

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
    rows = [mvn_pose.SEGMENTS.index(WORN[role]) for role in roles]

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
        return encode(self.trackers(self.t(k)))


# -- options ------------------------------------------------------------------------------------

CONNECT = "seerob probe vive --set link=websocket --set host={host} --port {port}"
"""How one that listens is heard."""


class Vive(PersonOptions, frozen=True, kw_only=True):
    """The sender beside SteamVR (Vive trackers), which sends those of a moving person."""

    rate: Annotated[float, option("samples per second", "Hz", ge=1, le=250)] = 90.0
    to: Annotated[str, option("address to send datagrams to")] = "127.0.0.1"
    port: Annotated[int, port("port to send to, or to listen at with --websocket")] = PORT
    websocket: Annotated[bool, option("let listeners connect; else UDP")] = False
    trackers: Annotated[
        Literal["least", "all", "arms", "hand"],
        option("the least five for a whole body, all nine, two on the arms, or one on the right hand"),
    ] = "least"
    in_step: Annotated[float, option(IN_ROUNDS, "s", gt=0)] | None = None

    def person_before(self) -> tuple[str, Array] | None:
        """Who stands in the world of the lighthouses."""
        keyframes = not self.file.endswith((".mvnx", ".bvh"))
        return (self.file, np.eye(4)) if keyframes and self.in_step is not None else None

    def ready(self) -> Ready:
        """The sender."""
        person = self.person()
        if self.in_step is not None:
            person = in_rounds(person, self.in_step)
        roles = {"least": FIVE, "all": tuple(WORN), "arms": ARMS, "hand": ("right_hand",)}[self.trackers]
        trackers = worn(person, roles)
        to = None if self.websocket else (self.to, self.port)
        server = ViveSender(trackers, to=to, host=self.host, port=self.port, rate=self.rate)
        where = self.host if self.websocket else self.to
        hear = (CONNECT,) if self.websocket else ()
        return Ready(
            server,
            f"{len(roles)} trackers on a person, {self.file}",
            f"{where}:{self.port}",
            hear,
        )
