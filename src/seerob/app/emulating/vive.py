"""``seerob emulate vive``: the sender beside SteamVR, with the trackers of a moving person."""

from __future__ import annotations

import argparse

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated
from seerob.app.emulating._people import add_person, person_of

HELP = "the sender beside SteamVR (Vive trackers), which sends those of a moving person"

CONNECT = "seerob probe vive --set link=websocket --set host={host} --port {port}"
"""How one that listens is heard."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_person(sub, rate=90.0)
    sub.add_argument("--to", default="127.0.0.1", help="address to send datagrams to (default: this machine)")
    sub.add_argument("--port", type=port, default=9872, help="port (default: 9872)")
    sub.add_argument("--websocket", action="store_true", help="let listeners connect; else UDP")
    sub.add_argument("--all", action="store_true", help="nine trackers; else the least five")


def emulated(options: argparse.Namespace) -> Emulated:
    """The sender.

    Raises:
        InputError: The motion is missing or wrong, or the rate is none of SteamVR's.
    """
    from seerob.app.emulators.vive import FIVE, WORN, ViveSender, worn

    trackers = worn(person_of(options, fastest=250.0), tuple(WORN) if options.all else FIVE)
    to = None if options.websocket else (options.to, options.port)
    server = ViveSender(trackers, to=to, host=options.host, port=options.port, rate=options.rate)
    where = options.host if options.websocket else options.to
    hear = (CONNECT,) if options.websocket else ()
    return Emulated(server, f"trackers on a person, {options.file}", f"{where}:{options.port}", hear)
