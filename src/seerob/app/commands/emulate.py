"""``seerob emulate``: a device without the device, for a try-out and for demonstrations.

What it can be is in `seerob.app.emulators`, one file per kind; its options are the fields of a class there.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Literal, get_args, get_origin

from seerob.app.console.interruption import Stopped
from seerob.app.console.terminal import Exit, Parser, line
from seerob.app.emulation.options import EmulatorOptions
from seerob.app.emulation.serving import served
from seerob.core.errors import InputError, Problem, suggestion
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
    asked = options_of(options.kind, options.options)
    stopped = Stopped()
    with served(options.kind, asked) as (_, what, at, commands, _):
        line("emulates", what, "bold")
        way, address = at.split(" ", 1)
        line(way, f"{options.kind} {address}  (Ctrl-C ends)")
        for command in commands:
            line("try", command)
        end = time.monotonic() + (asked.seconds if asked.seconds is not None else float("inf"))
        while not stopped() and time.monotonic() < end:
            time.sleep(0.05)
    return Exit.WITHIN
