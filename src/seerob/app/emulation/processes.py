"""The emulators of a workstation, each in a process of its own as long as a run lasts.

Such a process is told on its standard input what to be and, once that is served, at which port the page is.
It says on its standard output that it is there, and ends when its input is closed: with whoever started it,
however that ends. Where another program has its port, it takes any free one. A workstation file may come from
anywhere, so what it asks for listens on this machine and sends to this machine only.
"""

from __future__ import annotations

import errno
import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from msgspec.structs import replace

from seerob.app.emulation.background import CannotListen
from seerob.app.emulation.options import HOSTS, AsksForPage, EmulatorOptions
from seerob.app.emulation.ports import Move, held
from seerob.app.emulation.serving import Served, served
from seerob.core.errors import InputError, SeerobError
from seerob.core.host_name import is_loopback
from seerob.core.plugin import kind_of, load
from seerob.workstation.source import Source

STARTED_WITHIN = 60.0
"""Libraries of a first start are compiled until then [s]."""
ENDED_WITHIN = 5.0
"""[s]"""
ATTEMPTS = 20
"""To listen: of a port that was free when it was looked for, somebody may be quicker."""
_LONGEST = 1 << 16
"""What a process says of itself is no longer [byte]."""


class Running(NamedTuple):
    """An emulator that runs."""

    key: str
    """Where the workstation file asks for it: ``emulators[0]``."""
    kind: str
    what: str
    """What it plays."""
    at: str
    """``listens at 127.0.0.1:30004``, or ``sends to`` somebody."""
    process: subprocess.Popen[bytes]
    moves: tuple[Move, ...] = ()
    """Ports that were taken."""

    @property
    def ended(self) -> bool:
        """Whether it ended by itself."""
        return self.process.poll() is not None

    def find_page(self, port: int) -> None:
        """Tell it where the page of the run is, if it asks for one."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):  # it ended by itself
            self.process.stdin.write(b"%d\n" % port)
            self.process.stdin.flush()


@contextmanager
def emulated(
    emulators: Sequence[EmulatorOptions], file: Path, sources: Sequence[Source] = ()
) -> Iterator[tuple[Running, ...]]:
    """Start what a workstation file asks for, and end it afterwards.

    Where another program has a port, any free one is taken instead, which `Running.moves` says.

    Args:
        emulators: In the order of the file.
        file: The workstation file; the names of files that they play start at its folder.
        sources: Of the same file.

    Raises:
        InputError: One listens or sends beyond this machine, plays what is not there, or cannot listen; two
            have the same port.
    """
    ports: dict[tuple[str, int], int] = {}
    for i, options in enumerate(emulators):
        for name in (*HOSTS, "multicast"):
            host = getattr(options, name, None)
            if host and not is_loopback(host):
                key, what = f"emulators[{i}].{name}", f"{host} is not this machine"
                remedy = "leave it out, or start that one by hand with seerob emulate"
                raise InputError.at(file, key, what, remedy)
        for name in options.listens:
            at = options.host, getattr(options, name)
            if at[1] and ports.setdefault(at, i) != i:
                what = f"emulators[{ports[at]}] listens at {at[0]}:{at[1]}, too"
                raise InputError.at(file, f"emulators[{i}].{name}", what, "give each a port of its own")
    with ExitStack() as stack:
        given = stack.enter_context(held(emulators, sources))
        started = [stack.enter_context(_process(options, file.parent)) for options, _ in given]
        running = []
        for i, ((options, move), process) in enumerate(zip(given, started, strict=True)):
            kind, key = kind_of("emulators", options), f"emulators[{i}]"
            said = _said(process)
            if "error" in said:
                remedy = "mend it, or end the program that listens there"
                raise InputError.at(file, key, f"{kind}: {said['error']}", remedy)
            asked = ((getattr(options, name), port) for name, port in said["ports"].items())
            moves = (Move(options.host, taken, port) for taken, port in asked if taken not in (0, port))
            found = (*moves, *((move,) if move else ()))
            running.append(Running(key, kind, said["what"], said["at"], process, found))
        yield tuple(running)


@contextmanager
def _process(options: EmulatorOptions, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    # -P: a module that lies in the folder of the workstation is not imported.
    command = [sys.executable, "-P", "-m", __name__]
    with subprocess.Popen(  # noqa: S603 - our own interpreter
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=folder, start_new_session=True
    ) as process:
        assert process.stdin is not None
        order = {"kind": kind_of("emulators", options), "options": msgspec.to_builtins(options)}
        try:
            process.stdin.write(json.dumps(order).encode() + b"\n")
            process.stdin.flush()
            yield process
        finally:
            with suppress(BrokenPipeError):
                process.stdin.close()
            try:
                process.wait(ENDED_WITHIN)
            except subprocess.TimeoutExpired:
                process.kill()


def _said(process: subprocess.Popen[bytes]) -> dict[str, Any]:
    """What a process says once it serves, or why it does not."""
    assert process.stdout is not None
    end, said = time.monotonic() + STARTED_WITHIN, b""
    while not said.endswith(b"\n") and len(said) < _LONGEST:
        left = end - time.monotonic()
        if left <= 0 or not select.select([process.stdout], [], [], left)[0]:
            return {"error": f"does not start within {STARTED_WITHIN:g} s"}
        part = os.read(process.stdout.fileno(), _LONGEST)
        if not part:
            return {"error": "ended before it served; what it said is above"}
        said += part
    found: dict[str, Any] = json.loads(said)
    return found


def serve() -> None:
    """Be the emulator that standard input asks for, until that is closed."""
    order = json.loads(sys.stdin.buffer.readline(_LONGEST))
    try:
        kind = load("emulators", order["kind"], EmulatorOptions, allow_plugins=True)
        asked = msgspec.convert(order["options"], kind, strict=False)
        with served_anywhere(order["kind"], asked) as device:
            said = {"what": device.what, "at": device.at, "ports": device.ports}
            print(json.dumps(said), flush=True)  # noqa: T201 - to who started it
            for line in iter(lambda: sys.stdin.buffer.readline(_LONGEST), b""):
                if isinstance(device.server, AsksForPage):
                    device.server.found_page(int(line))
    except (SeerobError, OSError) as error:
        print(json.dumps({"error": str(error)}), flush=True)  # noqa: T201


@contextmanager
def served_anywhere(kind: str, asked: EmulatorOptions) -> Iterator[Served]:
    """Be a device, at any free port where another program has its own.

    Raises:
        InputError: What it shall play is wrong, or it cannot listen.
    """
    with ExitStack() as stack:
        for left in reversed(range(ATTEMPTS)):
            try:
                device = stack.enter_context(served(kind, asked))
                break
            except InputError as error:
                reason = error.__cause__
                if not (left and isinstance(reason, OSError) and reason.errno == errno.EADDRINUSE):
                    raise
                option = reason.option if isinstance(reason, CannotListen) else "port"
                asked = replace(asked, **{option: 0})
        yield device


if __name__ == "__main__":
    serve()
