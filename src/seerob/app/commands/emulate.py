"""``seerob emulate``: a device without the device, for a try-out and for demonstrations.

What it can be is in `seerob.app.emulating`, one file per kind.
"""

from __future__ import annotations

import argparse
import time
from importlib import import_module

from seerob.app.console.interruption import Stopped
from seerob.app.console.terminal import Exit, line, seconds
from seerob.core.errors import InputError
from seerob.core.host_name import check_host
from seerob.core.plugin import home, kinds

HELP = "be a controller or a device without the hardware: a real server that plays a motion"
EXAMPLE = "seerob emulate rtde --robot ur10 --file motion.csv"
PACKAGE = "emulating"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments, those of each kind below it."""
    each = sub.add_subparsers(dest="kind", required=True, metavar="kind")
    for kind in kinds(PACKAGE):
        module = import_module(f"{home(PACKAGE)}.{kind}")
        own = each.add_parser(kind, help=module.HELP, description=module.HELP)
        module.add(own)
        own.add_argument("--host", default="127.0.0.1", help="address to listen on (default: this machine)")
        own.add_argument("--seconds", type=seconds, help="end after this time")


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C.

    Raises:
        InputError: What it shall play is wrong, or it cannot listen there.
    """
    from seerob.app.emulating._hint import probes_of
    from seerob.devices.live.listening import because

    for key in ("host", "to", "unity"):
        if host := getattr(options, key, None):
            try:
                check_host(f"--{key}", host)
            except ValueError as error:
                raise InputError.at("seerob emulate", f"--{key}", str(error)) from None
    made = import_module(f"{home(PACKAGE)}.{options.kind}").emulated(options)
    server, where = made.server, made.where
    stopped = Stopped()
    try:
        server.start()
    except OSError as error:
        found = f"cannot listen on {where}: {because(error)}"
        raise InputError.at(
            "seerob emulate", "--port", found, "choose another, or 0 for any free one"
        ) from error
    try:
        line("emulates", made.what, "bold")
        to = getattr(server, "to", None)
        host, port = to or (getattr(server, "host", options.host), getattr(server, "port", options.port))
        way = ("sends", "to") if to else ("listens", "at")
        line(way[0], f"{options.kind} {way[1]} {host}:{port}  (Ctrl-C ends)")
        for command in probes_of(options.kind, host, port, sends=bool(to), commands=made.commands):
            line("try", command)
        end = time.monotonic() + (options.seconds if options.seconds is not None else float("inf"))
        while not stopped() and time.monotonic() < end:
            time.sleep(0.05)
    finally:
        server.stop()
    return Exit.WITHIN
