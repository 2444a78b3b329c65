"""Records a run to an MCAP file that survives a killed process and opens in Foxglove or Lichtblick."""

from __future__ import annotations

import math
import time
from collections import deque
from pathlib import Path
from threading import Condition, Thread
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, NamedTuple

from msgspec import Meta

from seerob.core.errors import InputError, SeerobError, ended_by
from seerob.core.printable import printable
from seerob.core.samples import Sample
from seerob.core.snapshot import Finding, Presences, Scene, Snapshot
from seerob.outputs.sink import Closing, Pictured, Sink, Visited
from seerob.recording.format import Visitor

if TYPE_CHECKING:
    from seerob.outputs.mcap import McapTape

FLUSH_PERIOD = 0.4
"""Longest time that a tick waits before it is on disk [s]."""

TOGETHER, GATHER = 50, 0.05
"""So many ticks are taken over at once, or those of so long [s]."""

MAX_REASON = 2000
"""Longest reason that is recorded of a run that broke off [characters]."""

_BACKLOG = 20
"""How many times `Recorder.queue` ticks may wait with their samples only."""


class Recorder(Sink, frozen=True, kw_only=True):
    """Record samples and snapshots to an MCAP file."""

    file: Annotated[str, Meta(pattern=r"^[^/\\]+\.mcap$", description="a file name that ends in .mcap")] = (
        "run.mcap"
    )
    """Name in the run's folder; must not exist yet."""
    lossless: bool = False
    """Whether a full queue holds the run up instead of dropping: for runs as fast as possible."""
    queue: Annotated[int, Meta(ge=1)] = 1000
    """Ticks that may wait for the disk."""

    def open(
        self, scene: Scene, meshes: dict[str, bytes], files: dict[str, bytes], folder: Path
    ) -> RecorderWriter:
        """Create the file and start the thread that writes it.

        Raises:
            InputError: The file's name is wrong, it exists, or it cannot be written.
        """
        from seerob.outputs.mcap import McapTape

        if self.file != Path(self.file).name or not self.file.endswith(".mcap"):
            raise InputError.at(
                folder, "recorder.file", f"{self.file!r} is not a file name", "such as run.mcap"
            )
        if self.queue < 1:
            raise InputError.at(folder, "recorder.queue", f"{self.queue} ticks hold nothing", "1 or more")
        path = folder / self.file
        try:
            tape = McapTape(path, scene, meshes, files)
        except FileExistsError:
            raise InputError.at(path, "", "exists already", "give another folder or recorder.file") from None
        except OSError as error:
            what = f"cannot be written: {error.strerror}"
            raise InputError.at(path, "", what, "give a folder that exists and may be written") from error
        return RecorderWriter(tape, path, lossless=self.lossless, queue=self.queue)


class _Waiting(NamedTuple):
    seq: int
    t: float
    samples: tuple[Sample, ...]
    snapshot: Snapshot | None
    visitors: tuple[Visitor, ...] = ()
    presences: Presences | None = None
    pictures: list[tuple[str, bytes]] | tuple[()] = ()


class RecorderWriter(Closing):
    """Hands ticks to its own thread.

    When the disk cannot keep up, snapshots are dropped first and the samples kept, so that a replay
    is still exact; `dropped`, `lost` and `out_of_order` count, and the file says so too.
    """

    def __init__(self, tape: McapTape, path: Path, *, lossless: bool, queue: int) -> None:
        """Use `Recorder.open`."""
        self.path = path
        self.dropped = 0
        """Ticks of which only the samples were recorded."""
        self.lost = 0
        """Ticks of which nothing was recorded."""
        self.out_of_order = 0
        """Ticks left out because seq or time did not advance."""
        self._tape, self._lossless, self._queue = tape, lossless, queue
        self._together = min(TOGETHER, queue)
        self._waiting: deque[_Waiting] = deque()
        self._condition = Condition()
        self._closing = False
        self._error: Exception | None = None
        self._broken_off = ""
        self._last = (-1, -math.inf)
        self._taken = 0
        self._visited: Visited | None = None
        self._pictured: Pictured | None = None
        self._thread = Thread(target=self._run, name="seerob recorder", daemon=True)
        try:
            self._thread.start()
        except KeyboardInterrupt:  # while its beginning was waited for: nobody will close this
            self._end()
            raise

    def watch(self, visited: Visited) -> None:
        """Record who looks on, too."""
        self._visited = visited

    def look(self, pictured: Pictured) -> None:
        """Record what cameras see, too."""
        self._pictured = pictured

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick; returns at once unless ``lossless`` and the queue is full.

        Raises:
            SeerobError: In a lossless recording, when the disk refused.
        """
        with self._condition:
            if self._lossless:
                while len(self._waiting) >= self._queue and self._error is None:
                    self._condition.wait(1.0)
                self._refuse_after_error()
            if self._error is not None or self._closing:
                self.lost += 1
                return
            seq, t = snapshot.seq, snapshot.t
            if not (seq > self._last[0] and t > self._last[1] and math.isfinite(t)):
                self.out_of_order += 1
                return
            backlog = len(self._waiting)
            if backlog >= self._queue * _BACKLOG:
                self.lost += 1
                return
            self._last = seq, t
            self._taken += 1
            kept = snapshot if backlog < self._queue else None
            if kept is None:
                self.dropped += 1
            visitors: tuple[Visitor, ...] = ()
            presences = None
            if self._visited is not None:
                visitors, presences = self._visited.take(), self._visited.seen()
            pictures = () if self._pictured is None or kept is None else self._pictured.taken()
            self._waiting.append(_Waiting(seq, t, samples, kept, visitors, presences, pictures))
            if len(self._waiting) >= self._together:
                self._condition.notify_all()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None and not isinstance(error, KeyboardInterrupt):
            self._broken_off = printable(ended_by(error))[:MAX_REASON]
        super().__exit__(kind, error, trace)

    def close(self) -> None:
        """Write what waits and finish the file.

        Raises:
            SeerobError: The disk refused; the recording ends before the run did.
        """
        self._end()
        self._thread.join()
        self._refuse_after_error()

    def _end(self) -> None:
        with self._condition:
            self._closing = True
            self._condition.notify_all()

    def findings(self) -> tuple[Finding, ...]:
        """What is missing from the recording."""
        texts = []
        if self.dropped:
            texts.append(f"{self.dropped} snapshots were dropped: the disk could not keep up")
        if self.lost:
            texts.append(f"{self.lost} ticks are missing altogether: replay is not exact")
        if self.out_of_order:
            texts.append(f"{self.out_of_order} ticks were left out: their time did not advance")
        if self._error is not None:
            texts.append(f"recording stopped early: {self._error}")
        return tuple(Finding(level="warning", subject=self.path.name, text=text) for text in texts)

    def _refuse_after_error(self) -> None:
        if self._error is not None:
            raise SeerobError(f"{self.path}: recording stopped early: {self._error}") from self._error

    def _run(self) -> None:
        try:
            self._pump()
        except Exception as error:
            # Kept, not swallowed: `write` counts from here on, `close` and `findings` tell.
            self._tape.abandon()
            with self._condition:
                self._error = error
                self.lost += self._taken - self._tape.kept
                self._waiting.clear()
                self._condition.notify_all()

    def _pump(self) -> None:
        oldest: float | None = None  # when the first tick that is not on disk was written
        while True:
            with self._condition:
                # Woken at every tick it would hold the twin up at every tick.
                gathered = time.monotonic() + GATHER
                while len(self._waiting) < self._together and not self._closing:
                    if (left := gathered - time.monotonic()) <= 0:
                        break
                    self._condition.wait(left)
                # A few at a time: a long backlog must not delay the flush.
                taken = [self._waiting.popleft() for _ in range(min(len(self._waiting), 100))]
                done = self._closing and not taken
                self._condition.notify_all()
            if done:
                if self._visited is not None:
                    self._tape.visitors(max(self._last[1], 0.0), self._visited.take(end=True))
                self._tape.finish(self._counts(), self._broken_off)
                return
            if taken and oldest is None:
                oldest = time.monotonic() - GATHER
            for tick in taken:
                self._tape.tick(tick.seq, tick.t, tick.samples, tick.snapshot)
                self._tape.visitors(tick.t, tick.visitors)
                if tick.presences is not None:
                    self._tape.presences(tick.t, tick.presences)
                for camera, jpeg in tick.pictures:
                    self._tape.picture(tick.t, camera, jpeg)
            # Looked at again a `GATHER` later.
            if oldest is not None and time.monotonic() + GATHER - oldest >= FLUSH_PERIOD:
                self._tape.flush()
                oldest = None

    def _counts(self) -> dict[str, int]:
        return {
            "ticks": self._tape.ticks,
            "dropped": self.dropped,
            "lost": self.lost,
            "out_of_order": self.out_of_order,
        }
