"""Heavy parsers in a process of their own, with limits of memory and time, used again for the next file.

A parser of others (COLLADA, workbooks, xacro) that a file makes crash, hang or ask for all memory ends that
process and not this one, which says so with the file's name. It is started when the first such file is there,
has nothing of this process's environment but what Python needs, ends with this process or when nobody asked
for a minute, and answers with plain data: numbers, texts, bytes, dates, lists, tuples and tables.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import io
import os
import pickle
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from threading import Lock, Timer
from typing import IO, Any, BinaryIO, NamedTuple, TypeVar

from seerob.core.errors import InputError, Problem, SeerobError
from seerob.core.extras import MissingPackage

T = TypeVar("T")

MEMORY = 4 << 30
"""What a parser may take beyond what the process has before [byte]."""
SECONDS = 60.0
"""Computing time until it answers [s]; by the clock it may take four times as long."""
LONGEST = 1 << 32
"""No answer is longer [byte]."""
USED_AGAIN_WITHIN, ENDS_AFTER = 30.0, 60.0
"""How long after its last answer it is asked again, and when it ends by itself [s]."""
KEPT = 2
"""So many processes wait for the next file."""
TIRED = 512 << 20
"""One that has taken so much [byte] is not kept."""
MOST_AHEAD = 1024
"""Items of a generator that are fetched at once, after fewer at first."""

COMMAND = (sys.executable, "-P", "-m", "seerob.core.files.parser_process")
"""``-P``: the folder it is started in is none to take modules from."""
_KEPT = ("LANG", "LC_ALL", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "SYSTEMROOT", "TMPDIR", "TEMP")
_KEPT_OF_PYTHON = ("PYTHONHOME", "PYTHONPYCACHEPREFIX", "PYTHONDONTWRITEBYTECODE")
_DATES = {"date", "datetime", "time", "timedelta"}
_HEAD = 8


def parsed(
    function: Callable[..., T],
    *arguments: object,
    file: str,
    remedy: str = "export it again",
    memory: int = MEMORY,
    seconds: float = SECONDS,
) -> T:
    """What a function answers that is called in the parsers' process.

    Args:
        function: Of a module that this process has too, found there by its name; answers with plain data.
        arguments: Its arguments, of which it is told by pickling.
        file: How messages call what is read.
        remedy: What the user can do when it ends, hangs or takes too much.
        memory: What it may take [byte], where the system knows limits (not on Windows).
        seconds: How long it may compute [s].

    Raises:
        InputError: As the function raises it, with the same problems; or it ended its process, took more
            memory or time, or failed with anything else.
    """
    return _Conversation(function, arguments, file, remedy, memory, seconds).only()  # type: ignore[no-any-return]


def parsed_one_by_one(
    function: Callable[..., Iterator[T]],
    *arguments: object,
    file: str,
    remedy: str = "export it again",
    memory: int = MEMORY,
    seconds: float = SECONDS,
    ahead: int = MOST_AHEAD,
) -> Iterator[T]:
    """What a generator yields that runs in the parsers' process, as it is asked for.

    Arguments and errors are those of `parsed`; the time is that until the next items, of which up to
    ``ahead`` are fetched at once; 1 where each is to be told as it comes.
    """
    return _Conversation(function, arguments, file, remedy, memory, seconds, ahead).each()


class _Ended(Exception):
    """Of the process, without an answer; says how."""


class _TookTooLong(_Ended):
    pass


class _Answer(NamedTuple):
    kind: str
    value: Any
    last: bool
    tired: bool


class _Child:
    """One process and the two pipes to it."""

    def __init__(self, modules: tuple[str, ...] = ()) -> None:
        kept = {name: os.environ[name] for name in (*_KEPT, *_KEPT_OF_PYTHON) if name in os.environ}
        path = os.pathsep.join(entry for entry in sys.path if entry)
        self.process = subprocess.Popen(  # noqa: S603 - of our own
            (*COMMAND, *modules),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**kept, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},
            process_group=0,  # Ctrl-C is for this process, which ends it
        )
        self.answered = time.monotonic()

    def ask(self, request: bytes, seconds: float) -> _Answer:
        """Its answer.

        Raises:
            _Ended: It has none.
        """
        late = False

        def end() -> None:
            nonlocal late
            late = True
            self.process.kill()

        timer = Timer(4 * seconds, end)
        timer.daemon = True
        timer.start()
        try:
            assert self.process.stdin is not None
            assert self.process.stdout is not None
            with contextlib.suppress(OSError):  # it has ended: no answer comes
                _send(self.process.stdin, request)
            answer = _received(self.process.stdout)
            self.answered = time.monotonic()
        except BaseException:  # an interrupt in the middle of an answer
            self.close(kill=True)
            raise
        finally:
            timer.cancel()
        if answer is None:
            self.close(kill=True)
            code = self.process.returncode
            if late or code == -getattr(signal, "SIGXCPU", 0):
                raise _TookTooLong
            raise _Ended(signal.Signals(-code).name if code < 0 else f"exit code {code}")
        try:
            return _Answer(*_Plain(io.BytesIO(answer)).load())
        except pickle.UnpicklingError as error:
            self.close(kill=True)
            raise _Ended(str(error)) from None

    def close(self, *, kill: bool = False) -> None:
        """End it."""
        if kill:
            self.process.kill()
        self.leave()
        self.process.wait()

    def leave(self) -> None:
        """Close this process's ends of the pipes."""
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):  # what nobody reads any more
                    pipe.close()


class _Plain(pickle.Unpickler):
    """Takes no class from a process that read what strangers wrote, dates apart."""

    def find_class(self, module: str, name: str) -> object:
        if module == "datetime" and name in _DATES:
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name} is no plain data")


def begin(*modules: str) -> None:
    """Start a process that imports modules meanwhile, where a file for it comes soon."""
    with contextlib.suppress(OSError):  # whoever has the file is told
        _give_back(_Child(modules), tired=False)


_idle: list[_Child] = []
_lock = Lock()


def _taken() -> tuple[_Child, bool]:
    """A process, and whether nobody used it before."""
    while True:
        with _lock:
            child = _idle.pop() if _idle else None
        if child is None:
            return _Child(), True
        if time.monotonic() - child.answered < USED_AGAIN_WITHIN and child.process.poll() is None:
            return child, False
        child.close(kill=True)


def _give_back(child: _Child, *, tired: bool) -> None:
    with _lock:
        if kept := not tired and len(_idle) < KEPT:
            _idle.append(child)
    if not kept:
        child.close(kill=True)


@atexit.register
def _end_all() -> None:
    while _idle:
        _idle.pop().close(kill=True)


def _forget() -> None:
    """In a process that was forked from the one that has them, and ends them."""
    while _idle:
        child = _idle.pop()
        child.leave()
        child.process.returncode = 0


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


class _Conversation:
    """One question, and what comes of it."""

    def __init__(
        self,
        function: Callable[..., Any],
        arguments: tuple[object, ...],
        file: str,
        remedy: str,
        memory: int,
        seconds: float,
        ahead: int = MOST_AHEAD,
    ) -> None:
        self.name = f"{function.__module__}:{function.__qualname__}"
        self.request = pickle.dumps((self.name, arguments, memory, seconds, ahead, os.path.realpath(".")))
        self.file, self.remedy, self.memory, self.seconds = file, remedy, memory, seconds

    def only(self) -> Any:
        return self._value(*self._begun())

    def each(self) -> Iterator[Any]:
        child, answer = self._begun()
        try:
            while True:
                yield from self._value(child, answer)
                if answer.last:
                    return
                answer = self._next(child, more=True)
        finally:
            if not answer.last and child.process.returncode is None:
                with contextlib.suppress(InputError):
                    self._value(child, self._next(child, more=False))

    def _begun(self) -> tuple[_Child, _Answer]:
        while True:
            child, fresh = _taken()
            try:
                return child, child.ask(self.request, self.seconds)
            except _TookTooLong:
                raise self._too_long() from None
            except _Ended as how:
                # What another file left behind is not this one's fault.
                if fresh:
                    raise self._wrong(f"ends the process that reads it ({how})") from None

    def _next(self, child: _Child, *, more: bool) -> _Answer:
        try:
            return child.ask(pickle.dumps(more), self.seconds)
        except _TookTooLong:
            raise self._too_long() from None
        except _Ended as how:
            raise self._wrong(f"ends the process that reads it ({how})") from None

    def _value(self, child: _Child, answer: _Answer) -> Any:
        if answer.last:
            _give_back(child, tired=answer.tired)
        match answer.kind:
            case "is":
                return answer.value
            case "memory":
                raise self._wrong(f"takes more than {self.memory >> 20} MiB of memory to read")
            case "wrong":
                raise InputError(Problem(*problem) for problem in answer.value)
            case "missing":
                raise MissingPackage(answer.value)
            case "refused":
                raise SeerobError(answer.value)
        raise self._wrong(f"cannot be read: {answer.value}")

    def _too_long(self) -> InputError:
        return self._wrong(f"takes more than {self.seconds:g} s to read")

    def _wrong(self, what: str) -> InputError:
        return InputError.at(self.file, "", what, self.remedy)


def _send(pipe: IO[bytes], content: bytes) -> None:
    pipe.write(len(content).to_bytes(_HEAD, "little"))
    pipe.write(content)
    pipe.flush()


def _received(pipe: IO[bytes]) -> bytes | None:
    head = pipe.read(_HEAD)
    size = int.from_bytes(head, "little")
    if len(head) < _HEAD or size > LONGEST:
        return None
    content: bytes = pipe.read(size)
    return content if len(content) == size else None


# -- in the other process -----------------------------------------------------------------------


def _main() -> None:
    # What a library prints is no answer.
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb") as out:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        for module in sys.argv[1:]:
            with contextlib.suppress(ImportError):  # who needs it is told
                importlib.import_module(module)
        questions = sys.stdin.buffer
        while os.name != "posix" or select.select([questions], [], [], ENDS_AFTER)[0]:
            request = _received(questions)
            if request is None:
                return
            _answer(request, questions, out)


def _answer(request: bytes, questions: BinaryIO, out: BinaryIO) -> None:
    def say(kind: str, value: object, *, last: bool = True) -> None:
        _send(out, pickle.dumps((kind, value, last, _peak() > TIRED)))

    # Of the process that started this one.
    name, arguments, memory, seconds, ahead, folder = pickle.loads(request)  # noqa: S301
    with contextlib.suppress(OSError):  # relative paths are from where that one is now
        os.chdir(folder)
    module, _, function = name.partition(":")
    try:
        called = getattr(importlib.import_module(module), function)
        _limit_memory(memory)
        _limit_time(seconds)
        value = called(*arguments)
        if not isinstance(value, Iterator):
            say("is", value)
            return
        size = min(16, ahead)
        while True:
            items = list(islice(value, size))
            if len(items) < size:
                say("is", items)
                return
            say("is", items, last=False)
            if (wanted := _received(questions)) is None:
                return
            if not pickle.loads(wanted):  # noqa: S301 - as above
                del value  # closes what it has open
                say("is", [])
                return
            size = min(2 * size, ahead)
            _limit_time(seconds)
    except MissingPackage as error:
        say("missing", error.package)
    except InputError as error:
        say("wrong", [tuple(problem) for problem in error.problems])
    except SeerobError as error:
        say("refused", str(error))
    except MemoryError:
        say("memory", None)
    except Exception as error:
        text = " ".join(f"{type(error).__name__}: {error}".split())
        say("failed", text[:200])


def _limit_time(seconds: float) -> None:
    """So much more than this process has computed by now [s]."""
    if os.name == "posix":
        import resource

        used = resource.getrusage(resource.RUSAGE_SELF)
        _limit(resource.RLIMIT_CPU, int(used.ru_utime + used.ru_stime + seconds) + 1)


def _limit_memory(memory: int) -> None:
    """So much more than this process has taken by now [byte]; a crash leaves no image of it."""
    if os.name == "posix":
        import resource

        _limit(resource.RLIMIT_AS, _held() + memory)
        _limit(resource.RLIMIT_CORE, 0)


def _limit(kind: int, most: int) -> None:
    import resource

    with contextlib.suppress(ValueError, OSError):  # it has a lower one already, or macOS, which has none
        resource.setrlimit(kind, (most, resource.getrlimit(kind)[1]))


def _held() -> int:
    """Addresses that this process has taken [byte]."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except OSError:  # of Linux alone
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def _peak() -> int:
    """Most memory that this process had [byte]; that of `resource` counts the one that started it, too."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:  # of Linux alone
        return 0
    return next((int(line.split()[1]) << 10 for line in lines if line.startswith("VmHWM:")), 0)


if __name__ == "__main__":
    _main()
    os._exit(0)
