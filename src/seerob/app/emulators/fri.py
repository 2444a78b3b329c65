"""An LBR controller that sends what FRI sends, over a real socket, and watches how it is answered.

It plays a motion with the drives on and nothing touching the arm. Its session becomes ready, and its
quality good, as long as answers come as often as it asks for them, as on the real one.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from typing import Annotated, Literal

from seerob.app.emulation.background import LoopEmulator
from seerob.app.emulation.motions import Motion
from seerob.app.emulation.options import Ready, RobotOptions, option, port
from seerob.protocols import ProtocolError
from seerob.protocols.robots import fri
from seerob.protocols.robots.fri import Edition, Monitoring, Quality, SessionState

PATIENCE = 10
"""Answers that may be missing before the quality is poor."""
REMEMBERED = 1000
"""Messages to which an answer is compared."""
READY = 20
"""Answers in a row after which it is good."""


class FriServer(LoopEmulator):
    """A controller's FRI session, in a thread of its own.

    Args:
        motion: What the robot does; time counts from when this was made, also through a stop.
        to: Own address of the client, and the port that it listens on.
        host: Address to send from.
        edition: Which FRI it speaks.
        period: Between messages [s], whole milliseconds.
        torques: Measured joint torques at a time [s → N·m]; none are sent when not given.
        stamped: Whether messages carry the controller's time.
    """

    def __init__(
        self,
        motion: Motion,
        *,
        to: tuple[str, int],
        host: str = "127.0.0.1",
        edition: Edition = Edition.V2_7,
        period: float = 0.005,
        torques: Callable[[float], tuple[float, ...]] | None = None,
        stamped: bool = True,
    ) -> None:
        super().__init__()
        self.to, self.host, self.edition, self.period, self.stamped = to, host, edition, period, stamped
        self.motion, self.torques = motion, torques
        self.session, self.quality = SessionState.MONITORING_WAIT, Quality.POOR
        self.answers = 0
        """Good answers so far."""
        self.overlay = False
        """A robot program has started a motion overlay."""
        self.wrong: list[str] = []
        """What was wrong with answers."""
        self.moved_by_answer = 0.0
        """Largest difference between joints of an answer and the controller's own [rad]."""
        self._sequence = self._row = self._missing = 0
        self._sent: dict[int, Monitoring] = {}
        self._made = time.monotonic()

    def message(self, t: float) -> Monitoring:
        """What it sends at a time since it was made [s]."""
        q, _ = self.motion(t)
        tau = () if self.torques is None else self.torques(t)
        return Monitoring(
            edition=self.edition,
            sequence=self._sequence,
            reflected=max(self.answers - 1, 0),
            session=SessionState.COMMANDING_ACTIVE if self.overlay else self.session,
            quality=self.quality,
            send_period=round(1e3 * self.period),
            receive_multiplier=1,
            safety=fri.SafetyState.NORMAL_OPERATION,
            drives=(fri.DriveState.ACTIVE,) * len(q),
            operation=fri.OperationMode.AUT,
            control=fri.ControlMode.POSITION,
            q=q,
            tau=tau,
            external_tau=(0.0,) * len(tau),
            commanded_q=q if self.edition is Edition.V1 else (),
            ipo_q=q if self.overlay else (),
            # Nanoseconds are whole on the wire.
            time=round(t, 9) if self.stamped else None,
        )

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Send at a steady rate, and hear the answers."""
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _Answers(self), local_addr=(self.host, 0)
        )
        ready()
        begun = time.monotonic()
        k = 0
        try:
            while not over.is_set():
                message = self.message(begun - self._made + k * self.period)
                self._sent[self._sequence] = message
                self._sent.pop(self._sequence - REMEMBERED, None)
                transport.sendto(fri.encode_monitoring(message), self.to)
                self._sequence = (self._sequence + 1) & 0xFFFF_FFFF
                self._missing += 1
                if self._missing > PATIENCE:
                    self._row, self.session, self.quality = 0, SessionState.MONITORING_WAIT, Quality.POOR
                k += 1
                wait = begun + k * self.period - time.monotonic()
                if wait < -1.0:  # this machine slept: what was not sent is not made up for
                    k = int((time.monotonic() - begun) / self.period)
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(over.wait(), max(wait, 0.0))
        finally:
            transport.abort()

    def heard(self, datagram: bytes) -> None:
        """An answer has arrived."""
        try:
            answer = fri.decode_answer(datagram, self.edition)
        except ProtocolError as error:
            self.wrong.append(str(error))
            return
        asked = self._sent.get(answer.reflected)
        if asked is None:
            self.wrong.append(f"an answer to {answer.reflected}, which was not sent of late")
            return
        wants_joints = self.edition is Edition.V1 or asked.session == SessionState.COMMANDING_ACTIVE
        if wants_joints and not answer.q:
            self.wrong.append("an answer without joints")
            return
        if answer.q:
            apart = (abs(a - b) for a, b in zip(answer.q, asked.q, strict=True))
            self.moved_by_answer = max(self.moved_by_answer, *apart)
        self.answers += 1
        self._row, self._missing = self._row + 1, 0
        if self._row >= READY:
            self.session, self.quality = SessionState.MONITORING_READY, Quality.EXCELLENT


class _Answers(asyncio.DatagramProtocol):
    def __init__(self, server: FriServer) -> None:
        self._server = server

    def datagram_received(self, data: bytes, _: tuple[str | object, int]) -> None:
        self._server.heard(data)


# -- options ------------------------------------------------------------------------------------

HOME = (0.0, 0.5, 0.0, -1.4, 0.0, 1.2, 0.0)
"""What it swings about when no motion is given [rad]."""
JOINTS = 7


class Fri(RobotOptions, frozen=True, kw_only=True):
    """A KUKA LBR controller (FRI), which sends to a client."""

    robot: Annotated[str, option("robot of the library, whose limits hold")] = "iiwa14"
    to: Annotated[str, option("address of the client")] = "127.0.0.1"
    port: Annotated[int, port("port of the client")] = 30200
    edition: Annotated[Literal["1", "2.5", "2.7"], option("edition of FRI")] = "2.7"
    period: Annotated[int, option("between messages", "ms", ge=1, le=100)] = 5

    def ready(self) -> Ready:
        """The controller."""
        target = self.target(joints=JOINTS, whose="an LBR")
        motion, what = self.motion(target, HOME)
        server = FriServer(
            motion,
            to=(self.to, self.port),
            host=self.host,
            edition=Edition(self.edition),
            period=1e-3 * self.period,
        )
        where = f"{self.host}, to {self.to}:{self.port}"
        return Ready(server, f"{target.name}, {what}", where, (f"seerob probe fri {self.host}{{option}}",))
