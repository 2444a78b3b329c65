"""``seerob emulate rokoko``: Rokoko Studio's live stream, with a moving person."""

from __future__ import annotations

import argparse

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated
from seerob.app.emulating._people import add_person, person_of

HELP = "Rokoko Studio's live stream (JSON), which sends a moving person"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_person(sub, rate=100.0)
    sub.add_argument("--to", default="127.0.0.1", help="address to send to (default: this machine)")
    sub.add_argument("--port", type=port, default=14043, help="port to send to (default: 14043)")
    sub.add_argument("--version", choices=("2", "3"), default="3", help="of the JSON (default: 3)")
    sub.add_argument("--lz4", action="store_true", help="compressed")


def emulated(options: argparse.Namespace) -> Emulated:
    """Studio.

    Raises:
        InputError: The motion is missing or wrong, or the rate is none of Studio's.
    """
    from seerob.app.emulators.rokoko import RokokoSender

    server = RokokoSender(
        {"Anna": person_of(options, fastest=200.0)},
        to=(options.to, options.port),
        rate=options.rate,
        version=options.version,
        compressed=options.lz4,
    )
    return Emulated(server, f"a person, {options.file}", f"{options.to}:{options.port}")
