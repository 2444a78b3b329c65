"""``seerob emulate``: a device without the device, for a try-out and for demonstrations.

What it can be is in `seerob.app.emulators`, one file per kind; its options are the fields of a class there.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Literal, get_args, get_origin

from msgspec.structs import replace

from seerob.app.console.interruption import Stopped
from seerob.app.console.terminal import Exit, Parser, line
from seerob.app.emulation.options import EmulatorOptions, Ready
from seerob.app.emulation.wire import FaultyWire
from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.host_name import is_loopback
from seerob.core.plugin import kinds, load

HELP = "be a controller or a device without the hardware: a real server that plays a motion"
EXAMPLE = "seerob emulate rtde --robot ur10 --file motion.csv"
PACKAGE = "emulators"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments; those of a kind are read when it is known."""
    sub.add_argument("kind", help=f"what it is: {', '.join(kinds(PACKAGE))}")
    text = "its own, as `seerob emulate KIND --help` and `seerob kinds emulators` list them"
    sub.add_argument("options", nargs=argparse.REMAINDER, help=text)


def parser_of(kind: str) -> Parser:
    """The parser of a kind's options, made from the fields of its class; its own first.

    Args:
        kind: A module of `seerob.app.emulators`.

    Raises:
        UnknownName: There is none of that name.
    """
    import msgspec

    from seerob.app.emulation.options import COMMAND, EmulatorOptions
    from seerob.workstation.conversion import choices, described, members, unit_of

    wanted = load(PACKAGE, kind, EmulatorOptions)
    title = (wanted.__doc__ or "").strip().split("\n")[0].rstrip(".")
    made = Parser(
        prog=f"{COMMAND} {kind}",
        description=title,
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
    )
    common = EmulatorOptions.__struct_fields__
    for field in sorted(msgspec.structs.fields(wanted), key=lambda f: f.name in common):
        unit = unit_of(field.type)
        text = (described(field.type) or "") + (f" [{unit}]" if unit else "")
        if bool in members(field.type):
            made.add_argument(_option(field.name), action="store_true", help=text)
            continue
        if field.default not in (msgspec.NODEFAULT, None, ""):
            shown = f"{field.default:g}" if isinstance(field.default, float) else field.default
            text += f" (default: {shown})"
        value = " or ".join(choices(field.type)) or field.name.upper()
        made.add_argument(_option(field.name), metavar=value, help=text)
    return made


def options_of(kind: str, words: Sequence[str]) -> EmulatorOptions:
    """The options of a kind that the words of a command line say.

    Args:
        kind: A module of `seerob.app.emulators`.
        words: After it: ``--robot ur10 --port 0``.

    Raises:
        UnknownName: There is no such kind.
        InputError: With every mistake: an option that it does not have, a value that is none.
    """
    import msgspec

    from seerob.app.emulation.options import COMMAND, EmulatorOptions
    from seerob.workstation.conversion import convert

    parser = parser_of(kind)
    said, rest = parser.parse_known_args(list(words))
    wanted = load(PACKAGE, kind, EmulatorOptions)
    fields = {field.name: field.type for field in msgspec.structs.fields(wanted)}
    place = f"{COMMAND} {kind}"
    if rest:
        word = next((w.partition("=")[0] for w in rest if w.startswith("-")), rest[0])
        what = "unknown option" if word.startswith("-") else "belongs to no option"
        raise InputError.at(place, word, what, suggestion(word, map(_option, fields)))
    table = {name: _value(text, fields[name]) for name, text in vars(said).items()}
    problems: list[Problem] = []
    found = convert(table, wanted, file=place, key="", problems=problems)
    if found is None:
        raise InputError(p._replace(key=_option(p.key) if p.key else "") for p in problems)
    return found


def _option(name: str) -> str:
    """A field as the command line has it: ``primary_port`` is ``--primary-port``."""
    return "--" + name.replace("_", "-")


def _value(text: Any, wanted: Any) -> Any:
    """The number that a word is, where the option takes one; what is none is left for the type to refuse."""
    from seerob.workstation.conversion import members

    for member in members(wanted):
        said = get_args(member) if get_origin(member) is Literal else ()
        if member in (int, float) or any(isinstance(value, int) for value in said):
            with suppress(ValueError):
                return int(text)
            with suppress(ValueError):
                return float(text)
    return text


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C.

    Raises:
        InputError: What it shall play is wrong, or it cannot listen there.
    """
    from seerob.app.commands.emulate import probes_of
    from seerob.app.emulation.options import COMMAND
    from seerob.devices.live.listening import because

    asked = options_of(options.kind, options.options)
    made = with_faults(asked) if asked.faults().any else asked.ready()
    server, where = made.server, made.where
    stopped = Stopped()
    try:
        server.start()
    except OSError as error:
        found = f"cannot listen on {where}: {because(error)}"
        raise InputError.at(COMMAND, "--port", found, "choose another, or 0 for any free one") from error
    try:
        line("emulates", made.what, "bold")
        to = getattr(server, "to", None)
        host, port = to or (getattr(server, "host", asked.host), getattr(server, "port", 0))
        way = ("sends", "to") if to else ("listens", "at")
        line(way[0], f"{options.kind} {way[1]} {host}:{port}  (Ctrl-C ends)")
        for command in probes_of(options.kind, host, port, sends=bool(to), commands=made.commands):
            line("try", command)
        end = time.monotonic() + (asked.seconds if asked.seconds is not None else float("inf"))
        while not stopped() and time.monotonic() < end:
            time.sleep(0.05)
    finally:
        server.stop()
    return Exit.WITHIN


class _Behind:
    """An emulator and the bad network before it."""

    def __init__(self, asked: EmulatorOptions) -> None:
        self._asked, self._sends = asked, sends(asked)
        self.to: tuple[str, int] | None = None
        if self._sends:
            self.to = asked.to, asked.port  # type: ignore[attr-defined]
            self._wire = FaultyWire(
                asked.faults(), at=("127.0.0.1", 0), to=self.to, device_listens=False
            ).start()
            self.made = replace(asked, to="127.0.0.1", port=self._wire.port).ready()
        else:
            self.made = replace(asked, host="127.0.0.1", port=0).ready()
        self.host, self.port = asked.host, getattr(asked, "port", 0)

    def start(self) -> None:
        """Begin both.

        Raises:
            OSError: The address cannot be listened on.
        """
        self.made.server.start()
        if not self._sends:
            inner = "127.0.0.1", getattr(self.made.server, "port", 0)
            at = self.host, self.port
            self._wire = FaultyWire(self._asked.faults(), at=at, to=inner, device_listens=True)
            try:
                self.port = self._wire.start().port
            except OSError:
                self.made.server.stop()
                raise

    def stop(self) -> None:
        """End both."""
        self._wire.stop()
        self.made.server.stop()


def sends(asked: EmulatorOptions) -> bool:
    """Whether it sends to somebody by itself, instead of listening."""
    return hasattr(asked, "to") and not getattr(asked, "websocket", False)


def with_faults(asked: EmulatorOptions) -> Ready:
    """The device that the options ask for, behind a bad network.

    Raises:
        InputError: What it shall play is missing or wrong.
        OSError: The network cannot be had.
    """
    behind = _Behind(asked)
    faults = asked.faults()
    said = (
        f"{faults.drop:.3g} of its packets lost, {faults.garble:.3g} damaged, late by {faults.delay:g} s "
        f"and up to {faults.jitter:g} s more"
    )
    where = f"{asked.host}:{getattr(asked, 'port', 0)}"
    return behind.made._replace(server=behind, what=f"{behind.made.what}; {said}", where=where)


# -- what to type to hear it ----------------------------------------------------------------------

ANYWHERE = ("0.0.0.0", "::", "")  # noqa: S104 - compared with, not listened on


def probes_of(kind: str, host: str, port: int, *, sends: bool, commands: tuple[str, ...]) -> tuple[str, ...]:
    """Commands that hear it.

    Args:
        kind: What is emulated.
        host: Where it listens, or whom it sends to.
        port: The same.
        sends: Whether it sends by itself, so that its source listens.
        commands: Given when its own kind with the address is not the way to hear it; with ``{at}`` for
            both, ``{host}``, ``{port}``, and ``{option}`` for a port that its source does not expect.
    """
    option = _port_option(kind, port)
    if sends:
        option += "" if is_loopback(host) else f" --set bind={host}"
    host = "127.0.0.1" if host in ANYWHERE else host
    at = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    if commands:
        return tuple(command.format(at=at, host=host, port=port, option=option) for command in commands)
    address = "" if sends else f" {host}"
    return (f"seerob probe {kind}{address}{option}",)


def _port_option(kind: str, port: int) -> str:
    """The port, where the source expects another one."""
    from msgspec.structs import fields

    from seerob.core.plugin import load
    from seerob.workstation.source import Source

    usual = {field.name: field.default for field in fields(load("sources", kind, Source))}.get("port", port)
    return "" if port == usual else f" --port {port}"
