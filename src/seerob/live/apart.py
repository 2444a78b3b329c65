"""Live sources in a process of their own, seen from the one in which the twin computes.

Python lets one thread of a process compute at a time. Beside a twin that computes, each packet would wait for
it several times on the way from the socket to the mailbox; in another process none does, and the twin does
not wait for who decodes. `seerob.live.listening_process` is that process; what it hears lies in memory that
both see (`seerob.live.shared_mailbox`), and what it logs is logged here. Should it end, it is started again.
"""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from threading import Event, Lock, Thread
from typing import IO, NamedTuple

import msgspec

from seerob.live.listening import FIRST_PAUSE, LONGEST_PAUSE, STOP_WITHIN, LiveSource
from seerob.live.shared_mailbox import SharedMailbox, memory
from seerob.samples import Sample
from seerob.source import Target

_log = logging.getLogger(__name__)

COMMAND = (sys.executable, "-P", "-m", "seerob.live.listening_process")
"""``-P``: the folder it is started in is none to take modules from."""
READY_WITHIN = 10.0
"""How long a run waits until it listens [s]."""
LONGEST_LINE = 1 << 20
"""Of what it logs [byte]."""
SPARE = 2.0
"""Beyond the time in which listeners end [s]; then it is killed."""

Pair = tuple[LiveSource, Target | None]


class Order(NamedTuple):
    """What the other process is told at its start, pickled."""

    path: list[str]
    """Where modules are found: what follows may be of any."""
    level: int
    """Of the log."""
    memory: int
    """Descriptor of the mailbox's memory, inherited."""
    sources: bytes
    """Pairs of sources and what each drives, pickled."""


class Said(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A line from the other process: a record of the log, or that it listens now."""

    ready: bool = False
    logger: str = ""
    level: int = 0
    text: str = ""
    trace: str | None = None


def may_be_apart(source: LiveSource, target: Target | None) -> bool:
    """Whether a source may listen in another process: what only this one knows cannot be told to it."""
    if os.name != "posix" or not sys.executable:
        return False  # memory is inherited by its descriptor
    if not type(source).apart or type(source).__module__ == "__main__":
        return False
    try:
        pickle.dumps((source, target))
    except Exception:  # whatever stands in its way
        return False
    return True


class Apart:
    """The process, its end and its beginning anew.

    Args:
        sources: With what each drives; of each `may_be_apart` is true.
    """

    def __init__(self, sources: Sequence[Pair]) -> None:
        self._sources = pickle.dumps(list(sources))
        self._box: SharedMailbox | None = None
        self._ready, self._stopping = Event(), Event()
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = Thread(target=self._keep, name="seerob-apart", daemon=True)

    def start(self) -> None:
        """Start it, and wait until it listens."""
        self._thread.start()
        if not self._ready.wait(READY_WITHIN):
            _log.warning("the process that listens did not begin within %g s", READY_WITHIN)

    def take(self) -> tuple[Sample, ...]:
        """What was heard since the last call, the newest of each."""
        return () if self._box is None else self._box.take()

    def ask_to_stop(self) -> None:
        """Ask it to end; returns at once."""
        with self._lock:
            self._stopping.set()
            if self._process is not None and self._process.stdin is not None:
                with contextlib.suppress(OSError):  # it has ended
                    self._process.stdin.close()

    def join(self) -> None:
        """Wait for its end."""
        self._thread.join(STOP_WITHIN + SPARE)
        if self._thread.is_alive():
            with self._lock:
                if self._process is not None:
                    self._process.kill()
            self._thread.join(SPARE)

    def _keep(self) -> None:
        pause = FIRST_PAUSE
        while not self._stopping.is_set():
            begun = time.monotonic()
            try:
                how = self._once()
            except OSError as error:
                how = os.strerror(error.errno) if error.errno else str(error)
            self._ready.set()
            if self._stopping.is_set():
                return
            if time.monotonic() - begun > LONGEST_PAUSE:
                pause = FIRST_PAUSE
            _log.error("the process that listens to devices ended: %s; it is started again", how)
            self._stopping.wait(pause)
            pause = min(2 * pause, LONGEST_PAUSE)

    def _once(self) -> str:
        """Have it run from its start to its end; how it ended.

        Raises:
            OSError: It cannot be started.
        """
        file = memory()
        try:
            box = SharedMailbox(file)
            with self._lock:
                if self._stopping.is_set():
                    return ""
                process = self._process = _started(file)
        finally:
            os.close(file)
        self._box = box
        with process:
            level = logging.getLogger("seerob").getEffectiveLevel()
            order = Order(sys.path, level, file, self._sources)
            self._tell(process, pickle.dumps(tuple(order)))
            if process.stdout is not None:
                self._hear(process.stdout)
            try:
                process.wait(SPARE)
            except subprocess.TimeoutExpired:  # nobody can hear it any more
                process.kill()
        code = process.returncode
        return f"signal {signal.Signals(-code).name}" if code < 0 else f"code {code}"

    def _tell(self, process: subprocess.Popen[bytes], order: bytes) -> None:
        # Whoever is asked to stop meanwhile closes it, and what has ended reads nothing.
        with contextlib.suppress(OSError, ValueError):
            if process.stdin is not None:
                process.stdin.write(order)
                process.stdin.flush()

    def _hear(self, said: IO[bytes]) -> None:
        decoder = msgspec.json.Decoder(Said)
        while line := said.readline(LONGEST_LINE):
            try:
                found = decoder.decode(line)
            except msgspec.DecodeError:
                _log.warning("the process that listens says what nobody understands: %.200r", line)
                continue
            if found.ready:
                self._ready.set()
            else:
                _log_again(found)


def _started(file: int) -> subprocess.Popen[bytes]:
    path = os.pathsep.join(entry for entry in sys.path if entry)
    return subprocess.Popen(  # noqa: S603 - of our own
        COMMAND,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
        pass_fds=(file,),
        process_group=0,  # Ctrl-C is for the run, which asks it to end
    )


def _log_again(said: Said) -> None:
    logger = logging.getLogger(said.logger)
    if logger.isEnabledFor(said.level):
        record = logger.makeRecord(said.logger, said.level, "", 0, "%s", (said.text,), None)
        record.exc_text = said.trace
        logger.handle(record)
