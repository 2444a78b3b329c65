"""Xsens MVN Analyze and Animate, live, through their network streamer.

MVN sends to the address and port that its settings name; this source only listens. Positions and orientations
of 23 segments, props and fingers, of several characters; joint angles that are sent too are compared with
those of the segments. A frame is the best pose that is sent, its unit, and what is doubtful. Nothing that
comes over a network ends it: what cannot be understood is counted and told once.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections import Counter
from collections.abc import AsyncGenerator
from contextlib import aclosing
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.capture.captured import CaptureFrame, Layout, Seen
from seerob.devices.capture.options import XSENS
from seerob.devices.capture.stream_source import CaptureStream
from seerob.devices.capture.xsens import anatomical, differences
from seerob.devices.live.listening import say_once
from seerob.protocols import ProtocolError
from seerob.protocols.links.datagrams import listening
from seerob.protocols.links.tcp_server import tcp_server
from seerob.protocols.tracking import mvn
from seerob.protocols.tracking.mvn import Assembly, Items, Kind, Scale, Tags, decode
from seerob.protocols.tracking.mvn_pose import (
    JOINTS,
    METRES,
    PARENTS,
    POSES,
    SEGMENTS,
    Up,
    looks_y_up,
    pose,
    unit_of,
)
from seerob.workstation.source import PostureError

_log = logging.getLogger(__name__)

BETTER_GONE = 1.0
"""A kind that says more and was not heard for so long [s] is not waited for."""
MOST_CHARACTERS = 16
CHECK_EVERY = 30
"""Samples between two comparisons of joint angles."""
AGREE = math.radians(1.0)
_PAIRS = {(SEGMENTS.index(p) + 1, SEGMENTS.index(c) + 1): k for k, (_, p, c) in enumerate(JOINTS)}


class Unit(StrEnum):
    """Unit of the positions in the stream."""

    GUESS = "guess"
    """From the length of the trunk."""
    M = "m"
    CM = "cm"


@dataclass
class Character:
    """One person in the stream."""

    kind: Kind | None = None
    heard: float = -math.inf
    """When a sample of that kind was whole, on the host's clock [s]."""
    unit: str | None = None
    name: str = ""
    stature: float | None = None
    """Top of the head in the T-pose [m]."""
    time_code: int = -1
    sample: int = -1
    posed: tuple[int, Array] | None = None
    """Sample and orientations of the latest pose."""
    checks: int = 0
    off: float = 0.0
    """Largest difference of joint angles from those of the segments [rad]."""
    segments: dict[str, tuple[float, float, float]] = field(default_factory=dict)


class Frames:
    """What one connection has said so far.

    Attributes:
        characters: By number.
        kinds: Datagrams of each kind.
        refused: Datagrams that could not be understood.
        assembly: Its losses.
    """

    def __init__(self, *, unit: Unit = Unit.GUESS, up: Up = Up.Z, who: str = "mvn") -> None:
        self._unit, self._up, self._who = unit, up, who
        self.characters: dict[int, Character] = {}
        self.kinds: Counter[str] = Counter()
        self.refused = 0
        self.assembly = Assembly()
        self._layouts: dict[tuple[str, ...], Layout] = {}
        self._warned: set[str] = set()

    def feed(self, data: bytes, arrived: float) -> tuple[Layout, CaptureFrame] | None:
        """The frame that a datagram completes, if it does.

        Args:
            data: The datagram.
            arrived: Host's monotonic time [s].
        """
        try:
            return self._feed(data, arrived)
        except ProtocolError as error:
            self.refused += 1
            self._tell("refused", f"a datagram is not understood: {error}; more of them are counted only")
            return None

    def _feed(self, data: bytes, arrived: float) -> tuple[Layout, CaptureFrame] | None:
        datagram = decode(data)
        header = datagram.header
        self.kinds[f"{header.kind:02d}" if header.kind is not None else "other"] += 1
        who = self._character(header.character)
        if isinstance(datagram, Tags):
            who.name = datagram.tags.get("name", who.name)[:80]
        elif isinstance(datagram, Scale):
            _scale(who, datagram)
        elif isinstance(datagram, Items):
            if header.kind is Kind.ANGLES:
                self._compare(who, datagram)
            elif header.kind in POSES:
                return self._pose(who, datagram, arrived)
        return None

    def _character(self, number: int) -> Character:
        if number not in self.characters and len(self.characters) >= MOST_CHARACTERS:
            raise ProtocolError(f"more than {MOST_CHARACTERS} characters")
        return self.characters.setdefault(number, Character())

    def _pose(self, who: Character, datagram: Items, arrived: float) -> tuple[Layout, CaptureFrame] | None:
        kind = datagram.header.kind
        assert kind is not None  # one of POSES
        if (
            who.kind is not None
            and POSES.index(kind) > POSES.index(who.kind)
            and arrived - who.heard < BETTER_GONE
        ):
            return None
        whole = self.assembly.feed(datagram)
        if whole is None:
            return None
        names, positions, turns = pose(whole, up=self._up, lengths=1.0)
        if who.kind is not kind:
            who.kind, who.unit = kind, None
        who.heard = arrived
        header = whole.header
        if who.unit is None:
            who.unit = self._decide(positions, header.character, kind)
        metres = METRES[who.unit] if who.unit is not None else math.nan
        body = turns[: len(SEGMENTS)]
        who.posed = header.sample, body
        return self._layout(names), CaptureFrame(
            t=self._time(who, header.time_code, header.sample),
            positions=metres * positions,
            orientations=turns,
            subject=str(header.character),
        )

    def _decide(self, positions: Array, character: int, kind: Kind) -> str | None:
        """The unit of a character's positions; None as long as it is not clear."""
        guessed = unit_of(positions)
        if kind is Kind.QUATERNION and self._up is Up.Z and looks_y_up(positions):
            self._tell("up", f'character {character} is upright along y: if it stands, give up = "y"')
        if self._unit is not Unit.GUESS:
            if guessed is not None and guessed != self._unit:
                text = f"in {self._unit} its trunk is no person's, in {guessed} it is"
                self._tell("unit", f"character {character}: {text}")
            return str(self._unit)
        if guessed is None:
            self._tell("unit", f"character {character}: in no unit its trunk is a person's; no positions")
        else:
            self._tell(
                "unit", f"character {character}: positions are in {guessed}, by the length of its trunk"
            )
        return guessed

    def _layout(self, names: tuple[str, ...]) -> Layout:
        if names not in self._layouts:
            parents = (*PARENTS, *(-1 for _ in names[len(SEGMENTS) :]))
            self._layouts = {names: Layout(Seen.SEGMENTS, names, "xsens", parents)}
        return self._layouts[names]

    @staticmethod
    def _time(who: Character, time_code: int, sample: int) -> float:
        """On MVN's clock [s]; NaN when that stands still, as it may when nothing is recorded."""
        stands = time_code == who.time_code and sample != who.sample
        who.time_code, who.sample = time_code, sample
        return math.nan if stands else time_code / 1000

    def _compare(self, who: Character, datagram: Items) -> None:
        """Joint angles against those of the segments, now and then."""
        who.checks += 1
        if who.posed is None or who.checks % CHECK_EVERY != 1 or who.posed[0] != datagram.header.sample:
            return
        angles = np.full((len(JOINTS), 3), np.nan)
        for (parent, child), values in zip((datagram.ids >> 8).tolist(), datagram.numbers(), strict=True):
            if (parent, child) in _PAIRS:
                angles[_PAIRS[parent, child]] = np.radians(values)
        with np.errstate(invalid="ignore"):
            off = differences(anatomical(who.posed[1]), angles)
        if np.isfinite(off).any():
            who.off = max(who.off, float(np.nanmax(off)))
        if who.off > AGREE:
            text = f"its joint angles differ from those of its segments by {math.degrees(who.off):.1f}°"
            self._tell("angles", f"character {datagram.header.character}: {text}; the segments are used")

    def _tell(self, about: str, text: str) -> None:
        if about not in self._warned:
            self._warned.add(about)
            level = logging.INFO if text.endswith("trunk") else logging.WARNING
            say_once(_log, level, f"{self._who}: {text}")


def _scale(who: Character, scale: Scale) -> None:
    known = {name.replace(" ", ""): position for name, position in scale.segments}
    if known:
        who.segments = known
    for point in scale.points:
        if point.name == "pTopOfHead" and "Head" in who.segments:
            body = np.array([who.segments.get(name, (math.nan,) * 3) for name in SEGMENTS])
            unit = unit_of(body)
            height = who.segments["Head"][2] + point.position[2]
            if unit is not None and math.isfinite(height):
                who.stature = METRES[unit] * height


SILENCE = 1.0
"""Without a datagram the connection counts as lost [s]."""
CONNECT_WITHIN = 5.0
"""How long a TCP connection is waited for before the port is opened anew [s]."""
LISTEN_AT_START = 0.6
"""How long it is listened to at start, after the first datagram [s]."""
WAITING = 512
"""Datagrams of a TCP connection that wait; after that the sender waits."""
WHERE = (
    "MVN: Options, Preferences, Network Streamer: this computer's address, "
    "Position + Orientation (Quaternion)"
)


class Transport(StrEnum):
    """How MVN sends."""

    UDP = "udp"
    TCP = "tcp"
    """It connects to this computer; nothing is lost, but what is late makes all that follows late."""


class Mvn(CaptureStream, frozen=True, kw_only=True):
    """A person in an Xsens suit, live, through MVN's network streamer."""

    known_error: ClassVar[PostureError | None] = XSENS

    bind: str = "127.0.0.1"
    """Own address on the network of the computer with MVN; when not given, only this machine is heard."""
    port: Annotated[int, Meta(ge=1, le=65535)] = mvn.PORT
    """Own port that MVN sends to."""
    sender: str = ""
    """Address of the computer with MVN; whoever sends first when not given. It is no proof: addresses of
    datagrams can be forged. When anybody else sends, the person is undecided."""
    transport: Transport = Transport.UDP
    """``udp`` or ``tcp``, as MVN's settings say."""
    frequency: Annotated[float, Meta(ge=1, le=240, extra={"unit": "Hz"})] = 60.0
    """Rate of the stream in MVN's settings [Hz]."""
    unit: Unit = Unit.GUESS
    """Unit of positions: ``m``, ``cm``, or guessed from the length of the trunk, because Xsens' documents
    differ."""
    up: Up = Up.Z
    """Axis that points up in quaternion datagrams (02): ``z``, or ``y`` when MVN is set so."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return 1 / self.frequency

    async def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        """Every pose of every character."""
        who = self.name or f"mvn {self.human}"
        said = Frames(unit=self.unit, up=self.up, who=who)
        begun: float | None = None
        posed = False
        try:
            async with aclosing(self._datagrams()) as heard:
                async for arrived, data in heard:
                    begun = arrived if begun is None else begun
                    found = said.feed(data, arrived)
                    if found is not None:
                        posed = True
                        yield found
                    elif not posed and arrived - begun > SILENCE:
                        raise ProtocolError(_no_pose(said))
        finally:
            losses = said.assembly.losses
            if losses or said.refused:
                _log.info("%s: %s, %d datagrams not understood", who, losses, said.refused)

    async def ask(self) -> tuple[Finding, ...]:
        """Who and what is in the stream."""
        said = Frames(unit=self.unit, up=self.up, who=self.name or "mvn")
        first: float | None = None
        samples = 0
        end = time.monotonic() + LISTEN_AT_START + SILENCE
        async with aclosing(self._datagrams()) as heard:
            async for arrived, data in heard:
                first = arrived if first is None else first
                samples += said.feed(data, arrived) is not None
                if arrived - first >= LISTEN_AT_START or arrived >= end:
                    break
        return self._remarks(said, samples)

    def _remarks(self, said: Frames, samples: int) -> tuple[Finding, ...]:
        def say(level: str, text: str) -> Finding:
            return Finding(level=level, subject=self.human, text=f"mvn: {text}")

        kinds = (
            ", ".join(f"{kind} ({count})" for kind, count in sorted(said.kinds.items())) or "nothing known"
        )
        found = [say("note", f"datagrams heard: {kinds}")]
        if not samples:
            found.append(say("warning", _no_pose(said)))
        for number, who in sorted(said.characters.items()):
            if who.kind is None:
                continue
            text = f"character {number}{f' ({who.name})' if who.name else ''}: datagrams {who.kind:02d}"
            found.append(say("note", text + (f", stature {who.stature:.2f} m" if who.stature else "")))
            if self.unit is Unit.GUESS:
                unit = who.unit or "no unit that is known"
                found.append(say("assumed", f"positions are in {unit}, by the length of the trunk"))
            if who.kind is not POSES[0]:
                text = (
                    "position and orientation by quaternions (02) say the same without a convention to assume"
                )
                found.append(say("assumed", f"{text}; choose them in MVN"))
            if who.off:
                text = (
                    f"joint angles differ from those of the segments by {math.degrees(who.off):.2f}° at most"
                )
                found.append(say("note", text))
        people = [str(k) for k, who in sorted(said.characters.items()) if who.kind is not None]
        if len(people) > 1 and not self.subject:
            text = f"characters {', '.join(people)}: the first that is heard is followed; name one as subject"
            found.append(say("warning", text))
        if said.refused:
            found.append(say("warning", f"{said.refused} datagrams are not understood"))
        if said.assembly.losses:
            found.append(say("warning", f"on the way: {said.assembly.losses}"))
        return tuple(found)

    async def _datagrams(self) -> AsyncGenerator[tuple[float, bytes], None]:
        if self.transport is Transport.TCP:
            async with aclosing(_connected(self.bind, self.port, self.sender)) as stream:
                async for item in stream:
                    yield item
        else:
            async with (
                listening(self.bind, self.port, sender=self.sender or None) as port,
                aclosing(port.receive(SILENCE)) as heard,
            ):
                async for datagram in heard:
                    yield datagram.arrived, datagram.data


def _no_pose(said: Frames) -> str:
    kinds = ", ".join(sorted(said.kinds)) or "none that is known"
    return f"no pose among its datagrams ({kinds}); {WHERE}"


async def _connected(bind: str, port: int, sender: str) -> AsyncGenerator[tuple[float, bytes], None]:
    """Datagrams of the one who connects; a second one is turned away."""
    queue: asyncio.Queue[tuple[float, bytes] | Exception] = asyncio.Queue(WAITING)
    connected: list[asyncio.StreamWriter] = []

    async def welcome(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if connected or (sender and writer.get_extra_info("peername")[0] != sender):
            writer.transport.abort()
            return
        connected.append(writer)
        splitter = mvn.Splitter()
        try:
            while data := await reader.read(mvn.LARGEST):
                for datagram in splitter.feed(data):
                    await queue.put((time.monotonic(), datagram))
            await queue.put(EOFError("MVN closed the connection"))
        except (OSError, ProtocolError) as error:
            await queue.put(error)
        finally:
            writer.transport.abort()

    try:
        async with tcp_server(welcome, bind, port):
            while True:
                patience = SILENCE if connected else CONNECT_WITHIN
                try:
                    async with asyncio.timeout(patience):
                        item = await queue.get()
                except TimeoutError as error:
                    what = "nothing sent to" if connected else "nobody connected to"
                    raise TimeoutError(f"{what} port {port} for {patience:g} s") from error
                if isinstance(item, Exception):
                    raise item
                yield item
    finally:
        for writer in connected:
            writer.transport.abort()
