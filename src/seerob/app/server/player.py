"""Plays a recording: run time follows the wall clock times a speed; all pages share one player."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from math import inf, nan, nextafter
from struct import Struct
from time import monotonic
from typing import Protocol, runtime_checkable

import msgspec
from msgspec.structs import replace

from seerob.app.server.company import COLORS, MOST_POINTS, SHAPES, place_mistake, titled
from seerob.app.server.feed import Audience
from seerob.core.errors import InputError
from seerob.core.printable import printable_record
from seerob.core.snapshot import (
    Command,
    History,
    Scene,
    Snapshot,
    SoFar,
    Transport,
    VisitorInfo,
    VisitorPresence,
)
from seerob.recording.format import Visitor
from seerob.recording.result_log import ResultLog

_LIMB, _POINT = Struct("<7f"), Struct("<3f")
_NOBODY = _LIMB.pack(*[nan] * 7)
_Numbers = tuple[float, float, float, float, float, float, float]
_Numbers3 = tuple[float, float, float]


class _Seen(msgspec.Struct):
    """One visitor of a message on ``/presences``."""

    id: int
    head: _Numbers | None = None
    left: _Numbers | None = None
    right: _Numbers | None = None
    points: list[_Numbers3] = []
    laser: list[_Numbers3] = []

    def presence(self) -> VisitorPresence:
        """What pages are told, with the number turned negative."""
        limbs = (self.head, self.left, self.right)
        return VisitorPresence(
            id=-self.id,
            poses=b"".join(_NOBODY if limb is None else _LIMB.pack(*limb) for limb in limbs),
            points=b"".join(_POINT.pack(*point) for point in self.points[:MOST_POINTS]),
            laser=b"".join(_POINT.pack(*point) for point in self.laser[:2]),
        )


class _AllSeen(msgspec.Struct):
    visitors: list[_Seen]


_decode_seen = msgspec.json.Decoder(_AllSeen).decode


@runtime_checkable
class RemembersVisitors(Protocol):
    """A recording that holds who looked on."""

    def visits(self) -> tuple[tuple[float, Visitor], ...]:
        """Who came, introduced themselves and left, with run time [s], in order."""

    def presences_at(self, t: float) -> bytes:
        """What was last said before ``t`` [s] of where visitors are, JSON; empty when nothing was."""


def there_at(visits: Iterable[tuple[float, Visitor]], t: float) -> tuple[VisitorInfo, ...]:
    """Who was there at an instant [s], as pages are told; their numbers are negative."""
    there: dict[int, Visitor] = {}
    for when, visitor in visits:
        if when > t:
            break
        if visitor.event == "left":
            there.pop(visitor.id, None)
        elif visitor.id > 0:
            there[visitor.id] = visitor
    return tuple(
        VisitorInfo(
            id=-number,
            role=titled(one.role, one.human),
            introduced=one.device != "",
            name=one.name or f"visitor {number}",
            color=COLORS[number % len(COLORS)],
            shape=SHAPES[number % len(SHAPES)],
            device=one.device or "program",
            human=one.human,
            scale=one.scale,
            position=one.position,
            turn=one.turn,
            calls=False,
            holds=(),
            recorded=True,
        )
        for number, one in there.items()
    )


SLOWEST, FASTEST = 0.01, 100.0
"""Speeds are brought into this range."""
LONGEST_STEP = 1000
"""Snapshots moved by one ``step`` at most."""
POINTS = 4000
"""Per criterion in the history of a whole recording, at most."""
_TELL_EVERY = 1.0
_log = logging.getLogger(__name__)


class Recorded(Protocol):
    """What the player needs of a recording; `seerob.recording.recording.Recording` is one."""

    start: float
    """Run time of the first tick [s]."""
    end: float
    """Run time of the last tick [s]."""

    @property
    def scene(self) -> Scene:
        """What did not change during the run."""

    def snapshots(self, start: float | None = None, end: float | None = None) -> Iterator[Snapshot]:
        """Snapshots with ``start <= t <= end`` [s], in order."""

    def snapshot_at(self, t: float) -> Snapshot:
        """The last snapshot at or before ``t`` [s]; the first one when all are later."""


class Player:
    """Shows recorded snapshots as they are; nothing is computed again.

    Args:
        recording: What to play; it is read in the server's thread and in another one.
        playing: Whether it starts by itself.
        loop: Whether it starts again at the end; otherwise it pauses there.
        rate: Frames sent per second at most [1/s].
        beside: What of another run is plotted on the same axis (`History.beside`).
        others: Runs that a page may ask for instead, by what they are called; opened when it does.
    """

    mode = "replay"

    def __init__(
        self,
        recording: Recorded,
        *,
        playing: bool = False,
        loop: bool = False,
        rate: float = 60.0,
        beside: History | None = None,
        others: Mapping[str, Callable[[], Recorded]] | None = None,
    ) -> None:
        self._recording = recording
        self._playing, self._loop, self._speed = playing, loop, 1.0
        self._pause = 1.0 / rate
        self._anchor = recording.start, monotonic()
        self._steps = 0
        self._dirty = True
        self._shown: float | None = None
        self._wake = asyncio.Event()
        self._visitors = recording if isinstance(recording, RemembersVisitors) else None
        self._log = ResultLog(recording.scene.criteria)
        self._others = others or {}
        self._beside = beside or History(traces=())
        self._asked, self._asking = -1, asyncio.Event()
        self._traces = self._log.history(POINTS).traces
        self._so_far = printable_record(self._log.so_far(whole=False))
        self.reading = True
        """Whether the recording is still read through; then `so_far` is ``whole``, or reading failed."""

    @property
    def duration(self) -> float:
        """Length of the recording [s]."""
        return self._recording.end - self._recording.start

    def history(self) -> History:
        """The whole recording, or as much of it as was read by now."""
        return printable_record(replace(self._beside, traces=self._traces, others=tuple(self._others)))

    def so_far(self) -> SoFar:
        """What the recorded run came to, as far as it was read by now."""
        return self._so_far

    def transport(self) -> Transport:
        """State of the player."""
        return Transport(playing=self._playing, t=self._now(), speed=self._speed, loop=self._loop)

    def seen_at(self, t: float | None) -> Snapshot:
        """The recorded snapshot at an instant, or at the one that is played now."""
        return self._recording.snapshot_at(self._now() if t is None else t)

    def command(self, command: Command) -> None:
        """Play, pause, seek, speed, step, loop or beside.

        Raises:
            ValueError: A ``step`` that is no whole number, or a run ``beside`` that is not offered.
        """
        value = command.value or 0.0
        match command.action:
            case "play":
                self._set(self._recording.start if self._at_end() else self._now())
                self._playing = True
            case "pause":
                self._set(self._now())
                self._playing = False
            case "seek":
                self._set(value)
                self._steps = 0
            case "speed":
                self._set(self._now())
                self._speed = min(max(value, SLOWEST), FASTEST)
            case "step":
                if value != int(value):
                    raise ValueError("step needs a whole number")
                self._set(self._now())
                self._playing = False
                self._steps = max(-LONGEST_STEP, min(LONGEST_STEP, self._steps + int(value)))
            case "loop":
                self._loop = bool(value)
            case "beside":
                if value not in range(-1, len(self._others)):
                    raise ValueError("beside needs the number of another run")
                self._asked = int(value)
                self._asking.set()
        self._dirty = True
        self._wake.set()

    async def run(self, audience: Audience) -> None:
        """Show snapshots until cancelled.

        Raises:
            InputError: The recording cannot be read where it was wanted.
        """
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._read_all(audience))
            tasks.create_task(self._show(audience))
            tasks.create_task(self._put_beside(audience))

    async def _show(self, audience: Audience) -> None:
        while True:
            self._wake.clear()
            self._turn(audience)
            # Never faster than pages draw, however many commands come.
            await asyncio.sleep(self._pause)
            if not self._playing:
                await self._wake.wait()

    def _turn(self, audience: Audience) -> None:
        if self._playing and self._at_end():
            self._set(self._recording.start if self._loop else self._recording.end)
            self._playing = self._loop and self.duration > 0.0
            self._dirty = True
        snapshot = self._recording.snapshot_at(self._now())
        if self._steps:
            snapshot = self._stepped(snapshot, self._steps)
            self._steps = 0
            self._set(snapshot.t)
        if self._dirty:
            self._dirty = False
            audience.tell(self.transport())
        if snapshot.t != self._shown:
            self._shown = snapshot.t
            audience.show(printable_record(snapshot))
            if self._visitors is not None:
                audience.recall(*self._recalled(self._visitors, snapshot.t))

    def _recalled(
        self, visitors: RemembersVisitors, t: float
    ) -> tuple[tuple[VisitorInfo, ...], tuple[VisitorPresence, ...]]:
        """Who was there, and where, at an instant [s]; nobody where the recording is not as it should."""
        try:
            there = there_at(visitors.visits(), t)
            told = visitors.presences_at(t) if there else b""
            seen = _decode_seen(told).visitors if told else []
            numbers = {info.id for info in there}
            presences = tuple(one.presence() for one in seen if -one.id in numbers)
        except (InputError, msgspec.DecodeError, UnicodeDecodeError, RecursionError, OverflowError) as error:
            _log.warning("who looked on is not shown: %s", error)
            self._visitors = None
            return (), ()
        return there, tuple(one for one in presences if not place_mistake(one))

    def _stepped(self, snapshot: Snapshot, steps: int) -> Snapshot:
        if steps > 0:
            later = deque(islice(self._recording.snapshots(nextafter(snapshot.t, inf)), steps), maxlen=1)
            return later[0] if later else snapshot
        for _ in range(-steps):
            snapshot = self._recording.snapshot_at(nextafter(snapshot.t, -inf))
        return snapshot

    def _now(self) -> float:
        t, then = self._anchor
        if self._playing:
            t += (monotonic() - then) * self._speed
        return min(t, self._recording.end)

    def _set(self, t: float) -> None:
        self._anchor = min(max(t, self._recording.start), self._recording.end), monotonic()

    def _at_end(self) -> bool:
        return self._now() >= self._recording.end

    async def _read_all(self, audience: Audience) -> None:
        """Fill the history; a long recording comes in parts, which all begin at its start."""
        snapshots = self._recording.snapshots()
        more = True
        try:
            while more:
                more = await asyncio.to_thread(self._read_some, snapshots, monotonic() + _TELL_EVERY)
                audience.tell(self.history())
                audience.tell(self._so_far)
        finally:
            self.reading = False

    def _read_some(self, snapshots: Iterator[Snapshot], until: float) -> bool:
        more = _add(self._log, snapshots, until)
        self._traces = self._log.history(POINTS).traces
        self._so_far = printable_record(self._log.so_far(whole=not more))
        return more

    async def _put_beside(self, audience: Audience) -> None:
        """Show the run that was asked for last beside this one, or why it is not."""
        while True:
            await self._asking.wait()
            self._asking.clear()
            self._beside = History(traces=())
            if self._asked >= 0:
                title, opened = list(self._others.items())[self._asked]
                try:
                    other = await asyncio.to_thread(opened)
                    log, snapshots = ResultLog(other.scene.criteria), other.snapshots()
                    # In parts: another one may be asked for meanwhile.
                    while await asyncio.to_thread(_add, log, snapshots, monotonic() + _TELL_EVERY):
                        if self._asking.is_set():
                            break
                    self._beside = beside(self._recording.scene, other.scene, log, title)
                except InputError as error:
                    self._beside = History(traces=(), beside_refusal=f"{title}: {error.problems[0].what}")
            if not self._asking.is_set():
                audience.tell(self.history())


def _add(log: ResultLog, snapshots: Iterator[Snapshot], until: float) -> bool:
    """Add snapshots to a log until an instant [s], monotonic time; whether there are more."""
    for snapshot in snapshots:
        log.add(snapshot)
        if monotonic() > until:
            return True
    return False


def beside(ours: Scene, theirs: Scene, log: ResultLog, title: str) -> History:
    """What another run holds of criteria of the same name, kind and unit, as it was recorded.

    Raises:
        InputError: It has no such criterion.
    """
    asked = {(info.name, info.kind, info.unit, info.at_most) for info in ours.criteria}
    same = {info.name for info in theirs.criteria if (info.name, info.kind, info.unit, info.at_most) in asked}
    if not same:
        what = "has no criterion with a name, kind and unit of the one that is shown"
        raise InputError.at(title, "criteria", what, "name a recording of the same criteria")
    traces = tuple(trace for trace in log.history(POINTS).traces if trace.name in same)
    return History(traces=(), beside=traces, beside_title=title)
