"""What a long command shows on a terminal while it works, and how long its parts took."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from types import TracebackType
from typing import Any, Self

from seerob.app.console.terminal import STATUS
from seerob.core.errors import SeerobError
from seerob.core.printable import printable
from seerob.core.samples import Sample
from seerob.core.snapshot import Snapshot
from seerob.outputs.sink import AtEnd, KeepsResults, Writer
from seerob.recording.result_log import ResultLog


class Progress:
    """Told the run time of each tick, and then what is being written."""

    def __init__(self, show: Callable[[float], None], say: Callable[[str], None]) -> None:
        """Use `progress`."""
        self._show, self.say = show, say
        self._begun = self._last = time.perf_counter()

    def __call__(self, t: float) -> None:
        """Run time reached [s]."""
        self._last = time.perf_counter()
        self._show(t)

    @property
    def moving(self) -> float:
        """Wall time from the start to the last tick [s]."""
        return self._last - self._begun

    @property
    def writing(self) -> float:
        """Wall time since the last tick [s]: closing files, drawing the report."""
        return time.perf_counter() - self._last


EVERY = 10.0
"""Time between two lines, where there is no terminal [s]."""


def lines() -> Callable[[str], None]:
    """What says a text in a line of its own, once in `EVERY`: for who reads it through a pipe, or later."""
    said = time.monotonic()

    def say(text: str) -> None:
        nonlocal said
        if time.monotonic() - said >= EVERY:
            said = time.monotonic()
            STATUS.print(printable(text), markup=False)

    return say


@contextmanager
def progress(duration: float, what: str) -> Iterator[Progress]:
    """A bar over run time on a terminal; elsewhere `lines`.

    Args:
        duration: Run time that the bar is full at [s].
        what: Beside the bar.
    """
    if not STATUS.is_terminal or duration <= 0:
        say = lines()
        yield Progress(lambda t: say(f"{what}: {t / max(duration, t, 1e-9):.0%}"), say)
        return
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    columns = (BarColumn(), TextColumn("{task.description}"), TimeRemainingColumn())
    with Bars(*columns, console=STATUS, transient=True) as bars:
        task = bars.add_task(what, total=duration)
        yield Progress(
            lambda t: bars.update(task, completed=t),
            # Nobody knows how long the drawing takes: the bar moves to and fro.
            lambda text: bars.update(task, description=text, total=None),
        )


class Announced:
    """A writer that says what it writes while it is closed: a report takes seconds.

    Args:
        writer: The writer.
        file: Of it.
        say: Shows a text.
        outlived: Whether a run goes on, and comes to its verdict, where the file cannot be written. Then what
            is written at the end is written elsewhere, if there is room.

    Attributes:
        failure: Why the file is not there, or not whole.
        elsewhere: Where it was written instead.
    """

    def __init__(
        self, writer: Writer, file: str, say: Callable[[str], None], *, outlived: bool = False
    ) -> None:
        self._writer, self.file, self._say, self._outlived = writer, file, say, outlived
        self.failure: Exception | None = None
        self.elsewhere: Path | None = None

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick: what goes out, and what came in to make it."""
        if self.failure is not None:
            return
        try:
            self._writer.write(snapshot, samples)
        except (SeerobError, OSError) as error:
            if not self._outlived:
                raise
            self.failure = error

    def share(self, log: ResultLog) -> None:
        """Use the log of the run; adding a snapshot that is in it changes nothing."""
        if isinstance(self._writer, KeepsResults):
            self._writer.share(log)

    def close(self) -> None:
        """Finish files; nothing half-written stays behind."""
        self._announce()
        self._writer.close()

    def __enter__(self) -> Self:
        self._writer.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._announce()
        try:
            self._writer.__exit__(kind, error, trace)
        except (SeerobError, OSError) as failure:
            if kind is not None or not self._outlived:
                raise
            self.failure = self.failure or failure
            self._write_elsewhere()

    def _write_elsewhere(self) -> None:
        if not isinstance(self._writer, AtEnd) or not hasattr(self._writer, "path"):
            return
        writer: Any = self._writer
        for near in (tempfile.gettempdir(), Path.home()):
            with suppress(SeerobError, OSError):
                folder = Path(tempfile.mkdtemp(prefix="seerob-", dir=near))
                try:
                    writer.path = folder / self.file
                    writer.close()
                    self.elsewhere = writer.path
                    return
                finally:
                    if self.elsewhere is None:
                        rmtree(folder, ignore_errors=True)

    def _announce(self) -> None:
        self._say(f"writing {self.file}")
        if hasattr(self._writer, "progress"):
            self._writer.progress = lambda done, total: self._say(f"writing {self.file}: {done} of {total}")


def announced(
    writers: Sequence[Writer], files: Sequence[str], say: Callable[[str], None], *, outlived: bool = False
) -> list[Announced]:
    """Writers that say which file they are writing; ``outlived`` as of `Announced`."""
    return [Announced(w, file, say, outlived=outlived) for w, file in zip(writers, files, strict=True)]


@contextmanager
def spinner(*, quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Yields what shows a text and a spinner on a terminal, from its first call on; elsewhere `lines`."""
    if quiet or not STATUS.is_terminal:
        yield (lambda _: None) if quiet else lines()
        return
    status = STATUS.status("")

    def say(text: str) -> None:
        status.update(text)
        status.start()

    try:
        yield say
    finally:
        status.stop()
