"""The command line: ``seerob run``, ``seerob assess`` and the rest; see ``seerob --help``."""

from __future__ import annotations

import argparse
import logging
import os
import sys
import traceback
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version

from seerob.app.console.interruption import Interrupts, stopped
from seerob.app.console.terminal import Exit, Leaves, Parser, PrintableLines
from seerob.core.errors import SeerobError, ended_by
from seerob.core.printable import printable

COMMANDS = (
    "demo",
    "new",
    "inspect",
    "check_file",
    "edit",
    "run",
    "assess",
    "replay",
    "report",
    "compare",
    "repair",
    "share",
    "swept",
    "permissible",
    "plan",
    "kinds",
    "robots",
    "schema",
    "completion",
    "emulate",
    "probe",
    "variables",
    "opcua",
    "explain",
    "measure",
    "capture",
    "calibrate",
    "import_",
    "export",
)
"""One module each in `seerob.app.commands`, with ``HELP``, ``EXAMPLE``, ``add`` and ``run``."""


def parser(asked: str = "") -> argparse.ArgumentParser:
    """The parser of the whole command line, or of the command that is asked alone where there is one."""
    top = Parser(
        prog="seerob",
        description="Evaluate the safety and ergonomics of a cobotic workstation with a physics-based twin.",
        epilog="exit code: 0 within, 1 exceeded, 2 undecided, 3 error\nexample: seerob new my_cell",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"seerob {version('seerob')}")
    commands = top.add_subparsers(dest="command", required=True, metavar="command")
    named = {name.rstrip("_").replace("_", "-"): name for name in COMMANDS}
    for command in [asked] if asked in named else named:
        name = named[command]
        module = import_module(f"seerob.app.commands.{name}")
        sub = commands.add_parser(
            command,
            help=module.HELP,
            description=module.HELP,
            epilog=f"example: {module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add(sub)
        sub.set_defaults(run=module.run)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; errors end in a message, faults in a traceback and one."""
    interrupts = Interrupts()
    if logging.lastResort is not None:
        logging.lastResort.setFormatter(PrintableLines())
    try:
        with interrupts:
            words = sys.argv[1:] if arguments is None else arguments
            options = parser(*words[:1]).parse_args(words)
            code = _asked(options)
            sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        return stopped()
    except Exception as error:
        if interrupts.came:
            return stopped()
        return _failed(error)


def _asked(options: argparse.Namespace) -> int:
    """Exit code of the command that was asked.

    Raises:
        RuntimeError: A plug-in or a library would end the program, with a code that is no verdict of it.
    """
    try:
        return int(options.run(options))
    except (Exception, KeyboardInterrupt, Leaves):
        raise
    except BaseException as error:
        raise RuntimeError(ended_by(error)) from error


def _failed(error: Exception) -> Exit:
    if not isinstance(error, SeerobError | OSError):
        # A fault of seerob or of what somebody added to it; its own exit code 1 would read as exceeded.
        traceback.print_exception(error)
        sys.stderr.write("seerob: a fault of the program or of a plug-in, see above; nothing is judged\n")
    elif isinstance(error, BrokenPipeError):
        # Whoever read has gone; the interpreter must not try to write the rest at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    elif isinstance(error, OSError):
        remedy = "; check that it exists and may be read and written" if error.filename else ""
        text = f"{error.filename or 'seerob'}: {error.strerror or error}{remedy}"
        sys.stderr.write(f"{printable(text)}\n")
    else:
        sys.stderr.write(f"{printable(str(error))}\n")
    return Exit.ERROR


if __name__ == "__main__":
    sys.exit(main())
