"""Rokoko Studio's custom streaming without Studio: sends moving persons over a real socket."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from seerob.app.emulation.message_sender import MessageSender, Way
from seerob.app.emulation.mvn_person import Person
from seerob.app.emulation.options import PersonOptions, Ready, To, option, port
from seerob.protocols.tracking import mvn_pose
from seerob.protocols.tracking.rokoko import PORT, SEGMENTS, Actor, Scene, encode

_SPINE = {"hip": "Pelvis", "spine": "L5", "chest": "T12", "neck": "Neck", "head": "Head"}
_LIMBS = {"LowerArm": "ForeArm", "UpLeg": "UpperLeg", "Leg": "LowerLeg"}


def _row(segment: str) -> int:
    for side in ("left", "right"):
        part = segment.removeprefix(side)
        if part != segment:
            return mvn_pose.SEGMENTS.index(side.capitalize() + _LIMBS.get(part, part))
    return mvn_pose.SEGMENTS.index(_SPINE[segment])


_ROWS = [_row(segment) for segment in SEGMENTS]


class RokokoSender(MessageSender):
    """Studio, in a thread of its own.

    Args:
        people: By name.
        to: Address and port to send to.
        rate: Datagrams per second [Hz].
        version: ``2`` or ``3``.
        compressed: In an LZ4 frame.
        way: What happens to each datagram on the way.
    """

    def __init__(
        self,
        people: dict[str, Person],
        *,
        to: tuple[str, int] = ("127.0.0.1", PORT),
        rate: float = 100.0,
        version: str = "3",
        compressed: bool = False,
        way: Way | None = None,
    ) -> None:
        super().__init__(to=to, rate=rate, way=way)
        self.people, self.version, self.compressed = dict(people), version, compressed

    def scene(self, t: float) -> Scene:
        """What Studio says at a time [s]."""
        actors = []
        for name, person in self.people.items():
            pose = person(t)
            actors.append(Actor(name, pose.positions[_ROWS], np.asarray(pose.wxyz)[_ROWS]))
        return Scene(t=t, version=self.version, actors=tuple(actors), fps=self.rate)

    def message(self, k: int) -> bytes:
        """The datagram number ``k``."""
        return encode(self.scene(self.t(k)), compressed=self.compressed)


# -- options ------------------------------------------------------------------------------------


class Rokoko(PersonOptions, frozen=True, kw_only=True):
    """Rokoko Studio's live stream (JSON), which sends a moving person."""

    rate: Annotated[float, option("samples per second", "Hz", ge=1, le=200)] = 100.0
    to: To = "127.0.0.1"
    port: Annotated[int, port("port to send to")] = PORT
    version: Annotated[Literal["2", "3"], option("version of the JSON")] = "3"
    lz4: Annotated[bool, option("compressed")] = False

    def ready(self) -> Ready:
        """Studio."""
        server = RokokoSender(
            {"Anna": self.person()},
            to=(self.to, self.port),
            rate=self.rate,
            version=self.version,
            compressed=self.lz4,
        )
        return Ready(server, f"a person, {self.file}", f"{self.to}:{self.port}")
