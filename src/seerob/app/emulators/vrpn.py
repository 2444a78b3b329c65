"""A VRPN server without a tracking system: its trackers are worn by a moving person."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from contextlib import suppress
from threading import Thread
from typing import Annotated

from seerob.app.emulation.background import Emulator
from seerob.app.emulation.mvn_person import FIVE, WORN, Person
from seerob.app.emulation.options import PersonOptions, Ready, option, port
from seerob.protocols.tracking import mvn_pose, vrpn

OTHERS = 7
"""Number of the pose's type here: each server chooses its own."""


class VrpnServer(Emulator):
    """The server, in threads of its own.

    Args:
        person: Who wears the trackers.
        worn: Name → segment of MVN on which it is worn.
        host: Own address.
        port: Own port; 0 is any free one.
        rate: Poses per second [Hz].
        units: Units of the stream per metre.
    """

    def __init__(
        self,
        person: Person,
        worn: dict[str, str],
        *,
        host: str = "127.0.0.1",
        port: int = vrpn.PORT,
        rate: float = 100.0,
        units: float = 1.0,
    ) -> None:
        super().__init__()
        self.person, self.worn = person, dict(worn)
        self.host, self.port, self.rate, self.units = host, port, rate, units

    def begin(self) -> Callable[[], object]:
        """Begin to listen.

        Raises:
            OSError: The port is taken.
        """
        listening = socket.create_server((self.host, self.port))
        listening.settimeout(0.1)
        self.port = listening.getsockname()[1]
        return lambda: self._welcome(listening)

    def names(self) -> bytes:
        """What is said first: a sender per tracker, and the types."""
        parts = [vrpn.describe(vrpn.SENDER_DESCRIPTION, k, name.encode()) for k, name in enumerate(self.worn)]
        types = {0: b"vrpn_Base ping_message", OTHERS: vrpn.POSE}
        return b"".join(
            [*parts, *(vrpn.describe(vrpn.TYPE_DESCRIPTION, k, name) for k, name in types.items())]
        )

    def instant(self, t: float) -> bytes:
        """A pose of every tracker."""
        pose = self.person(t)
        found = []
        for k, segment in enumerate(self.worn.values()):
            row = mvn_pose.SEGMENTS.index(segment)
            payload = vrpn.encode_pose(0, self.units * pose.positions[row], pose.wxyz[row][[1, 2, 3, 0]])
            found.append(vrpn.encode(t, k, OTHERS, payload))
        return b"".join(found)

    def _welcome(self, listening: socket.socket) -> None:
        threads = []
        with listening:
            while not self._over.is_set():
                with suppress(TimeoutError):
                    link, _ = listening.accept()
                    thread = Thread(target=self._speak, args=(link,), daemon=True)
                    thread.start()
                    threads.append(thread)
        for thread in threads:
            thread.join()

    def _speak(self, link: socket.socket) -> None:
        with link, suppress(OSError):
            link.settimeout(2.0)
            link.sendall(vrpn.COOKIE)
            if not link.recv(len(vrpn.COOKIE)).startswith(vrpn.MAJOR):
                return
            link.sendall(self.names())
            begun, k = time.monotonic(), 0
            while not self._over.wait(max(0.0, begun + k / self.rate - time.monotonic())):
                link.sendall(self.instant(k / self.rate))
                late = time.monotonic() - begun - k / self.rate
                k += 1 + (int(late * self.rate) if late > 0.5 else 0)


# -- options ------------------------------------------------------------------------------------


class Vrpn(PersonOptions, frozen=True, kw_only=True):
    """A VRPN server (TCP) whose trackers a moving person wears."""

    rate: Annotated[float, option("samples per second", "Hz", ge=1, le=1000)] = 100.0
    port: Annotated[int, port()] = vrpn.PORT

    def ready(self) -> Ready:
        """The server."""
        worn = {role: WORN[role] for role in FIVE}
        server = VrpnServer(self.person(), worn, host=self.host, port=self.port, rate=self.rate)
        return Ready(server, f"five trackers, {self.file}", f"{self.host}:{self.port}")
