"""``seerob emulate vrpn``: a VRPN server whose trackers a moving person wears."""

from __future__ import annotations

import argparse

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated
from seerob.app.emulating._people import add_person, person_of

HELP = "a VRPN server (TCP) whose trackers a moving person wears"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_person(sub, rate=100.0)
    sub.add_argument("--port", type=port, default=3883, help="port; 0 is any free one (default: 3883)")


def emulated(options: argparse.Namespace) -> Emulated:
    """The server.

    Raises:
        InputError: The motion is missing or wrong, or the rate is too high.
    """
    from seerob.app.emulators.vive import FIVE, WORN
    from seerob.app.emulators.vrpn import VrpnServer

    worn = {role: WORN[role] for role in FIVE}
    person = person_of(options, fastest=1000.0)
    server = VrpnServer(person, worn, host=options.host, port=options.port, rate=options.rate)
    return Emulated(server, f"five trackers, {options.file}", f"{options.host}:{options.port}")
