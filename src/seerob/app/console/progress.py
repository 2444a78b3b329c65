"""What a long command shows on a terminal: its parts, how long they took, and loops that are compiled."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from queue import Queue
from shutil import rmtree
from threading import Thread
from types import TracebackType
from typing import IO, Any, Self

from seerob.app.console.terminal import STATUS
from seerob.core.errors import SeerobError
from seerob.core.printable import printable
from seerob.core.samples import Sample
from seerob.core.snapshot import Snapshot
from seerob.outputs.sink import AtEnd, BeginsAtEnd, KeepsResults, Writer
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

    columns = (BarColumn(), TextColumn("{task.description}", markup=False), TimeRemainingColumn())
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

    def begin(self) -> None:
        """No tick comes any more; what fails here fails again when it is closed, which says so."""
        if self.failure is None and isinstance(self._writer, BeginsAtEnd):
            with suppress(SeerobError, OSError):
                self._writer.begin()

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
    from rich.text import Text

    status = STATUS.status("")

    def say(text: str) -> None:
        status.update(Text(printable(text)))
        status.start()

    try:
        yield say
    finally:
        status.stop()


COMPILING = "compiling the inner loops, once"
MOST = 4
"""Processes at once, of about 300 MB each; one loop takes a third of all the time."""
ATTEMPTS = 2
"""To compile a loop: what ends a process, or lets it fail beside others, seldom comes twice."""
LAST_LINES = 6
"""How many of the last lines of a process that failed are told."""
ENDED = "the process ended with"
"""And its code, where it said nothing."""


def compile_loops(wanted: Collection[str] | None = None) -> None:
    """Compile loops of `seerob.kernels._beforehand` that are not kept as they are now; say how far it is.

    Those of `LOOPS` there unless others are named.

    What cannot be compiled here, whatever the reason, is told, and compiled when it is called.
    """
    missing = missing_loops(wanted)
    if not missing or not sys.executable or getattr(sys, "frozen", False):
        return
    STATUS.print(f"{COMPILING}: 0 of {len(missing)}", markup=False)
    left, why = list(missing), ""
    with spinner() as say:
        for _ in range(ATTEMPTS):
            with closing(_compiled(tuple(left))) as compiled:
                for name, failure in compiled:
                    if failure:
                        why = failure
                        continue
                    left.remove(name)
                    say(f"{COMPILING}: {len(missing) - len(left)} of {len(missing)}")
            if not left:
                return
    text = f"compiled when they are called, as that failed now: {', '.join(left)}"
    STATUS.print(printable(f"{text}\n{why}" if why else text), markup=False)


def missing_loops(wanted: Collection[str] | None = None) -> list[str]:
    """Names in `seerob.kernels._beforehand` of what is neither kept as it is now nor brought."""
    from seerob.kernels._beforehand import LOOPS
    from seerob.kernels._kept_loops import BROUGHT, key_of, stood_in_for

    kept, brought = (
        {found.name for folder in folders if folder.is_dir() for found in folder.glob("*.nbi")}
        for folders in (cache_folders(), [BROUGHT])
    )
    end = f".py{sys.version_info.major}{sys.version_info.minor}"

    def is_there(name: str) -> bool:
        module, function = name.split()

        def among(files: set[str], processor: str = "") -> bool:
            begin, key = f"{module}.{function}-", f"-{key_of(module, processor)}{end}"
            return any(file.startswith(begin) and key in file for file in files)

        return among(kept) or any(among(brought, processor) for processor in stood_in_for())

    return [name for name in (LOOPS if wanted is None else wanted) if not is_there(name)]


def _compiled(names: Sequence[str]) -> Generator[tuple[str, str]]:
    """Compile loops in processes side by side.

    Yields:
        The name of each when it is done, and why it is not; it is then left, and its process gone.
    """
    waiting, answers = iter(names), Queue[tuple[str, str] | None]()
    workers: list[subprocess.Popen[str]] = []

    def share(worker: subprocess.Popen[str], errors: IO[str]) -> None:
        assert worker.stdin is not None
        assert worker.stdout is not None
        for name in waiting:
            answer = ""
            with suppress(OSError):  # it has ended
                worker.stdin.write(f"{name}\n")
                worker.stdin.flush()
                answer = worker.stdout.readline()
            answers.put((name, "" if answer else _last_words(worker, errors)))
            if not answer:
                break
        answers.put(None)

    threads: list[Thread] = []
    with ExitStack() as files:
        try:
            for _ in range(min(MOST, os.cpu_count() or 1, len(names))):
                try:
                    errors = files.enter_context(tempfile.TemporaryFile("w+", errors="replace"))
                    workers.append(_worker(errors))
                except OSError:  # no process can be started
                    break
                threads.append(Thread(target=share, args=(workers[-1], errors), daemon=True))
                threads[-1].start()
            for _ in workers:
                while (answer := answers.get()) is not None:
                    yield answer
        finally:
            for worker in workers:
                worker.kill()
            for thread in threads:
                thread.join()
            for worker in workers:
                with suppress(OSError), worker:  # what it was still to be told is lost with it
                    pass  # closes its pipes and waits for its end


def _worker(errors: IO[str]) -> subprocess.Popen[str]:
    path = os.pathsep.join(entry for entry in sys.path if entry)
    return subprocess.Popen(
        (sys.executable, "-P", "-m", "seerob.kernels._beforehand"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        env={**os.environ, "PYTHONPATH": path},
        text=True,
        process_group=0,  # Ctrl-C is for the command, which ends it
    )


def _last_words(worker: subprocess.Popen[str], errors: IO[str]) -> str:
    """Why a process has ended that should not."""
    with suppress(subprocess.TimeoutExpired):
        worker.wait(5)
    errors.seek(0)
    said = [line for line in errors.read().splitlines() if line.strip()]
    return "\n".join(said[-LAST_LINES:]) or f"{ENDED} {worker.returncode}"


def cache_folders() -> list[Path]:
    """Where Numba keeps, or looks for, what it compiled of `seerob.kernels`."""
    spec = find_spec("seerob.kernels")
    assert spec is not None
    assert spec.origin is not None
    package = os.path.dirname(os.path.abspath(spec.origin))
    # As numba.core.caching names the folder of a package in a cache for all of them.
    inner = f"{os.path.basename(package)}_{hashlib.sha1(package.encode(), usedforsecurity=False).hexdigest()}"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return [Path(chosen) / inner]
    from platformdirs import user_cache_path

    return [Path(package) / "__pycache__", user_cache_path("numba", appauthor=False) / inner]
