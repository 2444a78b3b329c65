"""A live source in a process of its own, seen from the one in which the twin computes.

Python lets one thread of a process compute at a time. Beside a twin that computes, or another source that
decodes, each packet would wait for them several times on the way from the socket to the mailbox; in a process
of its own it waits for none, and the twin for no one who decodes. `seerob.devices.live.listening_process` is
that process; what it hears lies in memory that both see, and what it logs is logged here. Should it end, it
is started again.

In that memory nothing queues and nobody waits: who writes replaces, who reads takes what is there. A kind of
sample (`seerob.core.samples.key`) has a slot of two halves, written in turn; a number says which is the newer
one, and another which was read last. What is copied while it is overwritten is found by that half's own
number and checksum, and copied again.
"""

from __future__ import annotations

import contextlib
import logging
import mmap
import os
import pickle
import signal
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from threading import Event, Lock, Thread
from typing import IO, NamedTuple

import msgspec
from msgspec.structs import replace

from seerob.core.errors import SeerobError
from seerob.core.samples import Quality, Sample, SignalSample, key
from seerob.core.snapshot import SourceLine
from seerob.devices.live.device_clock import ClockState
from seerob.devices.live.listening import FIRST_PAUSE, LONGEST_PAUSE, STOP_WITHIN, LiveSource, because
from seerob.workstation.source import Target

SLOTS = 256
"""Kinds of samples."""
LARGEST = 1 << 17
"""Of an encoded sample [byte]; memory that is never written takes no room."""
AGAIN = 20
"""Times that a slot is read which is being overwritten; then it waits for the next call."""

_COUNT = struct.Struct("<Q")
_HALF = struct.Struct("<QII")
"""Number of the sample, length [byte], checksum."""
_HEAD = 64
_ROOM = _HALF.size + LARGEST
_SLOT = _HEAD + 2 * _ROOM
_WHOLE = _HEAD + SLOTS * _SLOT


def memory() -> int:
    """A descriptor of memory for one mailbox; another process inherits it, and whoever has it closes it.

    Raises:
        OSError: There is none.
    """
    file = _nameless()
    try:
        os.ftruncate(file, _WHOLE)
    except BaseException:
        os.close(file)
        raise
    return file


def _nameless() -> int:
    if hasattr(os, "memfd_create"):
        with contextlib.suppress(OSError):  # some containers forbid it
            return os.memfd_create("seerob-mailbox")
    with tempfile.TemporaryFile() as found:
        return os.dup(found.fileno())


class SharedMailbox:
    """One end; one thread may `post`, of the process that writes, and one `take`, of that which reads.

    Args:
        file: From `memory`; may be closed afterwards.
    """

    def __init__(self, file: int) -> None:
        self._memory = mmap.mmap(file, _WHOLE)
        self._places: dict[tuple[str, ...], int] = {}
        self._written: list[int] = []
        """Samples so far, by slot."""
        self._encoder = msgspec.msgpack.Encoder(enc_hook=_plain)
        self._decoder = msgspec.msgpack.Decoder(Sample)
        self._seen: list[int] = []

    def post(self, sample: Sample) -> None:
        """Put a sample; it replaces an earlier one about the same target that nobody took.

        Raises:
            SeerobError: It is too large, or one kind too many.
            TypeError: A mistake of the source: what it says is no sample.
        """
        data = self._encoder.encode(sample)
        try:
            self._decoder.decode(data)
        except msgspec.ValidationError as error:
            raise TypeError(f"no {type(sample).__name__}: {error}") from None
        if len(data) > LARGEST:
            raise SeerobError(f"a sample of {len(data)} bytes; the most is {LARGEST}")
        index = self._places.setdefault(key(sample), len(self._places))
        if index == SLOTS:
            del self._places[key(sample)]
            raise SeerobError(f"more than {SLOTS} different things are told")
        if index == len(self._written):
            self._written.append(0)
        number = self._written[index] = self._written[index] + 1
        start = _HEAD + index * _SLOT
        half = start + _HEAD + (number & 1) * _ROOM
        _HALF.pack_into(self._memory, half, number, len(data), zlib.crc32(data, number & 0xFFFFFFFF))
        self._memory[half + _HALF.size : half + _HALF.size + len(data)] = data
        _COUNT.pack_into(self._memory, start, number)
        if number == 1:
            _COUNT.pack_into(self._memory, 0, index + 1)

    def waits(self, what: tuple[str, ...]) -> bool:
        """Whether there is a sample of a kind, posted here, that nobody took at the other end."""
        index = self._places.get(what)
        if index is None or index >= len(self._written):
            return False
        (read,) = _COUNT.unpack_from(self._memory, _HEAD + index * _SLOT + _COUNT.size)
        return bool(read != self._written[index])

    def take(self) -> tuple[Sample, ...]:
        """The samples posted since the last call, in order of the first one of their kind."""
        (count,) = _COUNT.unpack_from(self._memory, 0)
        self._seen += [0] * (count - len(self._seen))
        taken = []
        for index in range(count):
            data = self._newest(index)
            if data is not None:
                taken.append(self._decoder.decode(data))
        return tuple(taken)

    def _newest(self, index: int) -> bytes | None:
        """What a slot holds; None when it was taken, or for now."""
        start = _HEAD + index * _SLOT
        for _ in range(AGAIN):
            (number,) = _COUNT.unpack_from(self._memory, start)
            if number == self._seen[index]:
                return None
            half = start + _HEAD + (number & 1) * _ROOM
            wrote, length, checksum = _HALF.unpack_from(self._memory, half)
            if wrote != number or not 0 < length <= LARGEST:
                continue
            data = self._memory[half + _HALF.size : half + _HALF.size + length]
            # With the number: what was read of two samples in turn would be taken twice.
            if zlib.crc32(data, number & 0xFFFFFFFF) == checksum:
                self._seen[index] = number
                _COUNT.pack_into(self._memory, start + _COUNT.size, number)
                return data
        return None


def _plain(value: object) -> float | bool | int:
    """Numbers of numpy, which some libraries give."""
    numpy = sys.modules.get("numpy")  # without it there are none
    if numpy is not None and isinstance(value, numpy.generic):
        return value.item()  # type: ignore[no-any-return]
    raise TypeError(f"a {type(value).__name__} in a sample")


_log = logging.getLogger(__name__)

COMMAND = (sys.executable, "-P", "-m", "seerob.devices.live.listening_process")
"""``-P``: the folder it is started in is none to take modules from."""
BEGIN_WITHIN = 10.0
"""How long a run waits until it listens [s]."""
LINE_EVERY = 1.0
"""How often it says how it hears [s]."""
LONGEST_LINE = 1 << 20
"""A line of the listening process's log is read up to this length [byte]."""
SPARE = 2.0
"""Beyond the time in which listeners end [s]; then it is killed."""


class Order(NamedTuple):
    """What the other process is told at its start, pickled."""

    path: list[str]
    """Where modules are found: what follows may be of any."""
    level: int
    """Level of the log."""
    memory: int
    """Descriptor of the mailbox's memory, inherited."""
    again: bool
    """Whether another one listened before."""
    pair: bytes
    """From `pickled_source`."""
    known: ClockState | None = None
    """What the one before knew of the device's clock."""


class ProcessMessage(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A line from the other process: a record of the log, how it hears, or that it listens now."""

    ready: bool = False
    logger: str = ""
    level: int = 0
    text: str = ""
    trace: str | None = None
    line: SourceLine | None = None
    """How the source is heard."""


def pickled_source(source: LiveSource, target: Target | None) -> bytes | None:
    """A source and what it drives, as another process can be told; None when only this one knows it."""
    if os.name != "posix" or not sys.executable or getattr(sys, "frozen", False):
        return None  # memory is inherited by its descriptor; a frozen program is no interpreter
    if not type(source).own_process or type(source).__module__ == "__main__":
        return None
    try:
        told = target if target is None or source.links else replace(target, description=None)
        return pickle.dumps((source, told))
    except Exception:  # whatever stands in its way
        return None


class SourceProcess:
    """One source's process, its end and its beginning anew.

    Args:
        name: Of the source.
        pair: It and what it drives, from `pickled_source`.
    """

    def __init__(self, name: str, pair: bytes) -> None:
        self.name = name
        self.line = SourceLine()
        """How it is heard."""
        self._pair = pair
        self._box: SharedMailbox | None = None
        self._known: ClockState | None = None
        self._begun, self._stopping = Event(), Event()
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._listens = False
        self._thread = Thread(target=self._keep, name=f"seerob-apart-{self.name}", daemon=True)

    def start(self) -> None:
        """Start it; returns at once."""
        self._thread.start()

    def wait(self) -> None:
        """Until it listens, or cannot."""
        if not self._begun.wait(BEGIN_WITHIN):
            _log.warning("%s: its process did not begin to listen within %g s", self.name, BEGIN_WITHIN)

    def take(self) -> tuple[Sample, ...]:
        """What was heard since the last call, the newest of each."""
        box = self._box
        samples = () if box is None else box.take()
        for sample in samples:
            # What is late has the right instant all the same; after a step nobody knows.
            sure = sample.quality in (Quality.GOOD, Quality.LATE)
            if sure and sample.t_device is not None and not isinstance(sample, SignalSample):
                self._known = ClockState(sample.t - sample.t_device, sample.t_device, sample.t)
        return samples

    def ask_to_stop(self) -> None:
        """Ask it to end; returns at once."""
        with self._lock:
            self._stopping.set()
            if self._process is None:
                return
            if self._listens and self._process.stdin is not None:
                with contextlib.suppress(OSError):  # it has ended
                    self._process.stdin.close()
            else:  # it may be in the middle of being told, and has nothing yet to leave in order
                self._process.terminate()

    def join(self) -> None:
        """Wait for its end."""
        self._thread.join(STOP_WITHIN + SPARE)
        if self._thread.is_alive():
            with self._lock:
                if self._process is not None:
                    self._process.kill()
            self._thread.join(SPARE)
        self._box = None

    def _keep(self) -> None:
        pause, again = FIRST_PAUSE, False
        while not self._stopping.is_set():
            begun = time.monotonic()
            try:
                how = self._once(again)
            except OSError as error:
                how = because(error)
            self._begun.set()
            if self._stopping.is_set():
                return
            if time.monotonic() - begun > LONGEST_PAUSE:
                pause = FIRST_PAUSE
            self.line = replace(self.line, heard=False, word=f"its process has ended ({how})")
            _log.error("%s: the process that listened has ended (%s) and is started again", self.name, how)
            again = True
            self._stopping.wait(pause)
            pause = min(2 * pause, LONGEST_PAUSE)

    def _once(self, again: bool) -> str:
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
                self._listens = False
        finally:
            os.close(file)
        self._box = box
        with process:
            level = logging.getLogger("seerob").getEffectiveLevel()
            self._tell(process, Order(sys.path, level, file, again, self._pair, self._known))
            if process.stdout is not None:
                self._hear(process.stdout)
            try:
                process.wait(SPARE)
            except subprocess.TimeoutExpired:  # nobody can hear it any more
                process.kill()
        code = process.returncode
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"

    def _tell(self, process: subprocess.Popen[bytes], order: Order) -> None:
        # What has ended reads nothing; that is found out by hearing nothing of it.
        with contextlib.suppress(OSError):
            if process.stdin is not None:
                process.stdin.write(pickle.dumps(tuple(order)))
                process.stdin.flush()

    def _hear(self, said: IO[bytes]) -> None:
        decoder = msgspec.json.Decoder(ProcessMessage)
        while line := said.readline(LONGEST_LINE):
            try:
                found = decoder.decode(line)
            except msgspec.DecodeError:
                _log.warning("the process that listens says what nobody understands: %.200r", line)
                continue
            if found.ready:
                with self._lock:
                    self._listens = True
                self._begun.set()
            elif found.line is not None:
                self.line = found.line
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


def _log_again(said: ProcessMessage) -> None:
    logger = logging.getLogger(said.logger)
    if logger.isEnabledFor(said.level):
        record = logger.makeRecord(said.logger, said.level, "", 0, "%s", (said.text,), None)
        record.exc_text = said.trace
        logger.handle(record)
