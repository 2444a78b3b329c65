"""MVN's network streamer without MVN: sends a moving person over a real socket, UDP or TCP."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Sequence
from typing import Annotated

from seerob.app.emulation.background import Emulator
from seerob.app.emulation.mvn_datagrams import datagrams
from seerob.app.emulation.mvn_person import Person
from seerob.app.emulation.options import PersonOptions, Ready, To, option, port
from seerob.protocols.tracking import mvn
from seerob.protocols.tracking.mvn import Kind

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

    def begin(self) -> Callable[[], object]:
        """Connect.

        Raises:
            OSError: With TCP, nobody listens there.
        """
        if self.tcp:
            link = socket.create_connection(self.to, PATIENCE)
            link.settimeout(PATIENCE)
        else:
            link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            link.connect(self.to)
        return lambda: self._send(link)

    def instant(self, k: int) -> list[bytes]:
        """All datagrams of an instant, as they are sent."""
        t = k / self.rate
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
