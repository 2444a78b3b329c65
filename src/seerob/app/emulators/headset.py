"""A visitor without a headset: comes to the page of a run and says what a headset would see."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import numpy as np
from msgspec import Struct

from seerob.app.emulation.background import LoopEmulator
from seerob.app.emulation.mvn_person import Person
from seerob.app.emulation.options import COMMAND, IN_STEP, PersonOptions, Ready, option, port
from seerob.core.errors import InputError
from seerob.core.page_messages import Command, Grab, Introduction, Presence, Tracking
from seerob.core.transforms import Array, rotation_from_rpy, rotation_from_wxyz, wxyz_from_rotation
from seerob.protocols.tracking.mvn_pose import SEGMENTS
from seerob.protocols.tracking.vive import xr_positions, xr_turns

if TYPE_CHECKING:
    from websockets.asyncio.client import ClientConnection

PROTOCOL = "seerob.v2.msgpack"
RETRY = 0.5
"""Time between two attempts to come in [s]."""
ACKNOWLEDGED = 4
"""Every so many snapshots."""
PRESENCES = 30.0
"""How often a page says where a visitor is who looks on [Hz]."""

THREE = {
    "viewer": ("Head", (0.05, 0.0, 0.04)),
    "left-grip": ("LeftHand", (0.0, 0.05, 0.0)),
    "right-grip": ("RightHand", (0.0, -0.05, 0.0)),
}
"""What every headset sees: segment, and where on it in the T-pose (x forward, y left, z up) [m]."""
_SIDES = {
    "shoulder": "Shoulder",
    "arm-upper": "UpperArm",
    "arm-lower": "ForeArm",
    "hand-wrist": "Hand",
    "upper-leg": "UpperLeg",
    "lower-leg": "LowerLeg",
    "foot-ankle": "Foot",
    "foot-ball": "Toe",
}
BODY = {
    "hips": "Pelvis",
    "spine-lower": "L5",
    "spine-upper": "T8",
    "neck": "Neck",
    "head": "Head",
    **{
        f"{side}-{joint}": f"{side.title()}{name}"
        for side in ("left", "right")
        for joint, name in _SIDES.items()
    },
}
"""Joints of WebXR Body Tracking: segment whose origin each is."""


def seen(person: Person, *, body: bool) -> Callable[[float], tuple[tuple[str, ...], Array]]:
    """What a headset sees of the person who wears it.

    Args:
        person: Who wears it.
        body: Whether it sees joints of the whole body beside head and hands.

    Returns:
        Of a time [s]: names, and positions and rotations as `Tracking.poses` has them, shape (n, 7).
    """
    joints = {name: (segment, (0.0, 0.0, 0.0)) for name, segment in (BODY if body else {}).items()}
    every = {**THREE, **joints}
    rows = [SEGMENTS.index(segment) for segment, _ in every.values()]
    offsets = np.array([at for _, at in every.values()])

    def at(t: float) -> tuple[tuple[str, ...], Array]:
        pose = person(t)
        turns = pose.wxyz[rows]
        positions = pose.positions[rows] + np.einsum("nij,nj->ni", rotation_from_wxyz(turns), offsets)
        return tuple(every), np.concatenate([xr_positions(positions), xr_turns(turns)], axis=-1)

    return at


def in_world(poses: Array, introduction: Introduction) -> Array:
    """Poses of a visitor's room in the world.

    Args:
        poses: As `Tracking.poses` has them, shape (n, 7).
        introduction: Where and how large they stand.
    """
    turn = rotation_from_wxyz(introduction.turn)
    places = introduction.scale * poses[:, :3] @ turn.T + introduction.position
    turns = [wxyz_from_rotation(turn @ rotation_from_wxyz(wxyz)) for wxyz in poses[:, 3:]]
    return np.concatenate([places, turns], axis=-1)


class _Received(Struct):
    """What matters of a message of the server: snapshots are acknowledged, others are known."""

    type: str = ""
    seq: int | None = None
    visitors: tuple[dict[str, object], ...] = ()


class Visitor(LoopEmulator):
    """The visitor, in a thread of its own; comes again when it was sent away.

    Args:
        person: Who wears the headset.
        human: Whom of the workstation that person is.
        host: Machine that serves the page.
        port: Its port.
        rate: Pictures per second [Hz].
        body: Whether joints of the whole body are seen.
        grabs: What hands hold from when on [s]; time begins with the first picture of the run.
        in_step: Instead at the next whole multiple of this period of the machine's clock [s].
        introduction: How they introduce themselves; None for not at all. Who is no person of the twin says
            where head and hands are in the world.
    """

    def __init__(
        self,
        person: Person,
        *,
        human: str,
        host: str,
        port: int,
        rate: float,
        body: bool,
        grabs: Sequence[tuple[float, Grab]] = (),
        in_step: float | None = None,
        introduction: Introduction | None = None,
    ) -> None:
        super().__init__()
        self._in_step = in_step
        self._introduction = introduction
        self.human, self.rate, self.to = human, rate, (host, port)
        self.sent = 0
        """Messages so far."""
        self.others: tuple[str, ...] = ()
        """Names of all visitors, as the page told last."""
        self._seen = seen(person, body=body)
        self._grabs = sorted(grabs, key=lambda grab: grab[0])

    def found_page(self, port: int) -> None:
        """The page is at another port than was said."""
        self.to = self.to[0], port

    async def serve(self, ready: Callable[[], None], over: asyncio.Event) -> None:
        """Come in, be seen, and come again, until it is over."""
        ready()
        task = asyncio.ensure_future(self._visit())
        await over.wait()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    async def _visit(self) -> None:
        from websockets.asyncio.client import connect
        from websockets.exceptions import WebSocketException

        while True:
            with suppress(OSError, WebSocketException, TimeoutError):
                url = f"ws://{self.to[0]}:{self.to[1]}/ws"
                async with connect(
                    url,
                    subprotocols=[PROTOCOL],  # type: ignore[list-item]
                    compression=None,
                    max_size=None,
                ) as connection:
                    runs = asyncio.Event()
                    answers = asyncio.ensure_future(self._acknowledge(connection, runs))
                    try:
                        await runs.wait()
                        await self._be_seen(connection, time.monotonic())
                    finally:
                        answers.cancel()
                        await asyncio.gather(answers, return_exceptions=True)
            await asyncio.sleep(RETRY)

    async def _be_seen(self, connection: ClientConnection, begun: float) -> None:
        grabs = deque(self._grabs)
        introduction = self._introduction
        if introduction is not None:
            await connection.send(msgspec.msgpack.encode(introduction))
        looks_on = introduction is not None and not self.human
        rate = min(self.rate, PRESENCES) if looks_on else self.rate
        waits = 0.0 if self._in_step is None else -time.time() % self._in_step
        while True:
            k = int((time.monotonic() - begun) * rate) + 1
            await asyncio.sleep(max(0.0, begun + k / rate - time.monotonic()))
            while grabs and grabs[0][0] <= k / rate - waits:
                await connection.send(msgspec.msgpack.encode(grabs.popleft()[1]))
            names, poses = self._seen(max(k / rate - waits, 0.0))
            if looks_on:
                assert introduction is not None
                world = in_world(poses[: len(THREE)], introduction)
                said: Presence | Tracking = Presence(poses=world.astype("<f4").tobytes())
            else:
                said = Tracking(
                    human=self.human,
                    t=k / rate,
                    names=names,
                    poses=poses.astype("<f4").tobytes(),
                    scale=1.0 if introduction is None else introduction.scale,
                )
            await connection.send(msgspec.msgpack.encode(said))
            self.sent += 1

    async def _acknowledge(self, connection: ClientConnection, runs: asyncio.Event) -> None:
        decoder = msgspec.msgpack.Decoder(_Received)
        unanswered = 0
        async for message in connection:
            received = decoder.decode(message)  # type: ignore[arg-type]
            if received.type == "visitors":
                self.others = tuple(str(visitor.get("name", "")) for visitor in received.visitors)
            if received.type == "snapshot" and received.seq is not None:
                runs.set()
                unanswered += 1
                if unanswered == ACKNOWLEDGED:
                    unanswered = 0
                    done = Command(action="ack", value=received.seq)
                    await connection.send(msgspec.msgpack.encode(done))


# -- options ------------------------------------------------------------------------------------


class Headset(PersonOptions, frozen=True, kw_only=True):
    """A headset that shows the page of a run: what it sees of the moving person who wears it."""

    human: Annotated[str, option("whom of the workstation that person is; empty for one who looks on")] = (
        "operator"
    )
    name: Annotated[str, option("by which others know them; who looks on needs one")] = ""
    device: Annotated[Literal["vr", "ar"], option("what they wear")] = "vr"
    scale: Annotated[float, option("how many times as large as the twin they are", ge=0.01, le=100)] = 1.0
    stands: Annotated[str, option("where the floor of their room lies in the world: X Y Z, in m")] = "0 0 0"
    to: Annotated[str, option("machine that serves the page")] = "127.0.0.1"
    port: Annotated[int, port("port of the page; `seerob run --emulated` tells its own")] = 8080
    rate: Annotated[float, option("pictures per second", "Hz", ge=30, le=144)] = 72.0
    body: Annotated[bool, option("joints of the whole body are seen; else head and hands")] = False
    in_step: Annotated[float, option(IN_STEP, "s", gt=0)] | None = None
    grabs: Annotated[
        str,
        option("what hands take and let go: '4.5 right_hand blank_1, 8 right_hand', at seconds of the run"),
    ] = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.faults().any:
            raise ValueError(
                "--drop, --delay, --jitter and --garble are of devices with a network of their own"
            )
        if not self.human and not self.name:
            raise ValueError("--human is empty: who looks on needs a --name")
        if not self.human and self.grabs:
            raise ValueError("--grabs are of a --human: who looks on has no hands in the twin")

    def ready(self) -> Ready:
        """The visitor."""
        visitor = Visitor(
            self.person(),
            human=self.human,
            host=self.to,
            port=self.port,
            rate=self.rate,
            body=self.body,
            grabs=tuple(self.grabbed()),
            in_step=self.in_step,
            introduction=self._introduction() if self.name else None,
        )
        hear = ("seerob run CELL --port {port}",)
        if self.human:
            hear = (f"seerob run CELL --port {{port}}     (with a source headset of {self.human})",)
        who = self.human or f"{self.name}, who looks on"
        return Ready(visitor, f"a headset on {who}, {self.file}", f"{self.to}:{self.port}", hear)

    def _introduction(self) -> Introduction:
        place = [at for text in self.stands.split() if (at := _number(text)) is not None]
        if len(place) != 3 or len(self.stands.split()) != 3:
            raise InputError.at(COMMAND, "--stands", f"{self.stands!r} is no place", "write X Y Z, in m")
        upright = wxyz_from_rotation(rotation_from_rpy((np.pi / 2, 0.0, 0.0)))
        w, x, y, z = map(float, upright)
        return Introduction(
            name=self.name,
            device=self.device,
            human=self.human,
            scale=self.scale,
            position=(place[0], place[1], place[2]),
            turn=(w, x, y, z),
        )

    def grabbed(self) -> Iterator[tuple[float, Grab]]:
        """What hands take and let go, and when [s].

        Raises:
            InputError: One is none.
        """
        for text in filter(None, map(str.strip, self.grabs.split(","))):
            match text.split():
                case [t, hand, *piece] if len(piece) < 2 and _number(t) is not None:
                    yield float(t), Grab(hand=f"{self.human}/{hand}", piece="".join(piece))
                case _:
                    what, remedy = (
                        f"{text!r} is no grab",
                        "write SECONDS HAND PIECE, or SECONDS HAND to let go",
                    )
                    raise InputError.at(COMMAND, "--grabs", what, remedy)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
