"""Base of the writers whose files are there, whole, only when the run is over."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from types import TracebackType

from seerob.core.snapshot import CriterionInfo
from seerob.outputs.sink import Closing
from seerob.recording.result_log import ResultLog

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
