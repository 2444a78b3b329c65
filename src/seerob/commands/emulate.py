"""``seerob emulate``: a device without the device, for a try-out and for demonstrations.

What it can be is in `seerob.commands.emulating`, one file per kind.
"""

from __future__ import annotations

import argparse
import time
from importlib import import_module

from seerob.commands import Exit, line, seconds
from seerob.commands.interruption import Stopped
from seerob.errors import InputError
from seerob.plugin import kinds

HELP = "be a controller or a device without the hardware: a real server that plays a motion"
EXAMPLE = "seerob emulate rtde --robot ur10 --file motion.csv"
PACKAGE = "commands.emulating"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments, those of each kind below it."""
    each = sub.add_subparsers(dest="kind", required=True, metavar="kind")
    for kind in kinds(PACKAGE):
        module = import_module(f"seerob.{PACKAGE}.{kind}")
        own = each.add_parser(kind, help=module.HELP, description=module.HELP)
        module.add(own)
        own.add_argument("--host", default="127.0.0.1", help="address to listen on (default: this machine)")
        own.add_argument("--seconds", type=seconds, help="end after this time")


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C.

    Raises:
        InputError: What it shall play is wrong, or it cannot listen there.
    """
    from seerob.live.listening import because

    server, what, where = import_module(f"seerob.{PACKAGE}.{options.kind}").emulated(options)
    stopped = Stopped()
    try:
        server.start()
    except OSError as error:
        found = f"cannot listen on {where}: {because(error)}"
        raise InputError.at(
            "seerob emulate", "--port", found, "choose another, or 0 for any free one"
        ) from error
    try:
        line("emulates", what, "bold")
        port = getattr(server, "port", None)
        if port is not None and getattr(server, "to", None) is None:
            where = f"{getattr(server, 'host', options.host)}:{port}"
        line("listens", f"{options.kind} at {where}  (Ctrl-C ends)")
        end = time.monotonic() + (options.seconds if options.seconds is not None else float("inf"))
        while not stopped() and time.monotonic() < end:
            time.sleep(0.05)
    finally:
        server.stop()
    return Exit.WITHIN
