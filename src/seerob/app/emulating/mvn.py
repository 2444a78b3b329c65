"""``seerob emulate mvn``: the network streamer of Xsens MVN, with a moving person."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated

HELP = "Xsens MVN's network streamer, which sends a moving person"
LIBRARY = "library:reach"
"""What is played when nothing is given."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    what = f"motion to play: an .mvnx or .bvh recording, or keyframes (.toml, library:…; default: {LIBRARY})"
    sub.add_argument("--file", default=LIBRARY, help=what)
    sub.add_argument("--to", default="127.0.0.1", help="address to send to (default: this machine)")
    sub.add_argument("--port", type=port, default=9763, help="port to send to (default: 9763)")
    sub.add_argument("--rate", type=float, default=60.0, help="samples per second (default: 60)")
    sub.add_argument("--tcp", action="store_true", help="connect and send in a stream; else UDP")
    sub.add_argument("--cm", action="store_true", help="positions in centimetres, as the specification says")


def emulated(options: argparse.Namespace) -> Emulated:
    """The streamer.

    Raises:
        InputError: The motion is missing or wrong, or the rate is none of MVN's.
    """
    from seerob.app.emulators.mvn import MvnSender
    from seerob.app.emulators.mvn_person import animated, followed, recorded
    from seerob.core.errors import InputError

    if not 1 <= options.rate <= 240:
        raise InputError.at("seerob emulate", "--rate", f"{options.rate:g} Hz", "MVN sends 1 to 240 Hz")
    given = Path(options.file)
    match given.suffix.lower():
        case ".mvnx":
            person = recorded(given)
        case ".bvh":
            person = followed(given)
        case _:
            person = animated(options.file)
    server = MvnSender(
        {0: person},
        to=(options.to, options.port),
        rate=options.rate,
        units=100.0 if options.cm else 1.0,
        tcp=options.tcp,
    )
    return Emulated(server, f"a person, {options.file}", f"{options.to}:{options.port}")
