"""What a sink is: something that snapshots, and the samples behind them, are written to."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from msgspec import Struct

from seerob.core.samples import Sample
from seerob.core.snapshot import CriterionInfo, Presences, Scene, Snapshot, SourceLine
from seerob.recording.format import Visitor
from seerob.recording.result_log import ResultLog


class Writer(Protocol):
    """An open sink. A slow one must drop frames of its own, never block the loop."""

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick: what goes out, and what came in to make it."""

    def close(self) -> None:
        """Finish files; nothing half-written stays behind."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


class Closing:
    """What most writers do alike: they are closed at the end, however it comes."""

    def close(self) -> None:
        """Nothing to finish."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@runtime_checkable
class KeepsResults(Protocol):
    """A writer that needs every result of the run: hours of them are kept once, not once per writer."""

    def share(self, log: ResultLog) -> None:
        """Use the log of the run; adding a snapshot that is in it changes nothing."""


@runtime_checkable
class BeginsAtEnd(Protocol):
    """A writer that has much to do at the end, some of it beside others that are closed before."""

    def begin(self) -> None:
        """No tick comes any more; `close` does."""


@runtime_checkable
class Sends(Protocol):
    """A writer that sends to machines or controllers."""

    def lines(self, known: Mapping[str, SourceLine]) -> dict[str, SourceLine]:
        """Add what was sent to how live sources are heard, by name."""


class Visited(Protocol):
    """Where it is known who looks on."""

    def take(self, *, end: bool = False) -> tuple[Visitor, ...]:
        """What happened since the last call; at the ``end`` also who is there still."""

    def seen(self) -> Presences | None:
        """Where visitors are, if anybody has moved since the last call."""


@runtime_checkable
class RecordsVisitors(Protocol):
    """A writer that records who looked on."""

    def watch(self, visited: Visited) -> None:
        """Record them, too, from now on."""


class Pictured(Protocol):
    """Where pictures of cameras come from."""

    def taken(self) -> list[tuple[str, bytes]]:
        """Name of a camera and its picture, JPEG, for each that is newer than at the last call."""


@runtime_checkable
class RecordsPictures(Protocol):
    """A writer that records what cameras see."""

    def look(self, pictured: Pictured) -> None:
        """Record it, too, from now on."""


class Sink(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every sink: one file, one class, one ``kind``. The fields are its table in the file."""

    @abstractmethod
    def open(self, scene: Scene, meshes: dict[str, bytes], files: dict[str, bytes], folder: Path) -> Writer:
        """Open for one run.

        Args:
            scene: What does not change during the run.
            meshes: Binary glTF per mesh hash of the scene's nodes.
            files: The workstation file and every file it names (relative name → content), so that
                a recording can be recomputed anywhere.
            folder: Where to write.
        """
        raise NotImplementedError


# -- files that are there, whole, only when the run is over ---------------------------------------

Progress = Callable[[int, int], None]
"""Called with how many of how many steps of writing are done."""


class AtEnd(Closing):
    """What such writers do alike: they say how far they are, and an impatient user does not wait."""

    progress: Progress | None = None
    """Called while `close` works."""

    def close(self) -> None:
        """Write, whole or not at all."""
        raise NotImplementedError

    def abandon(self) -> None:
        """Leave nothing behind: called in place of `close` when somebody does not want to wait."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Whoever interrupts a run a second time does not want to wait for this.
        if kind is not None and issubclass(kind, KeyboardInterrupt):
            self.abandon()
            return
        try:
            self.close()
        except KeyboardInterrupt:
            self.abandon()
            raise

    def _tell(self, done: int, total: int) -> None:
        if self.progress is not None:
            self.progress(done, total)


class AtEndWithResults(AtEnd):
    """One that needs every result of the run.

    Attributes:
        log: Of the run, once it has one; its own until then.
    """

    def __init__(self, criteria: Iterable[CriterionInfo]) -> None:
        self.log = ResultLog(criteria)

    def share(self, log: ResultLog) -> None:
        """Use the log of the run, which holds the same: see `seerob.outputs.sink.KeepsResults`."""
        self.log = log
