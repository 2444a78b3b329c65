"""``seerob emulate natnet``: OptiTrack Motive's stream, with a moving person."""

from __future__ import annotations

import argparse

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated
from seerob.app.emulating._people import add_person, person_of

HELP = "OptiTrack Motive's stream (NatNet), with a moving person"
VERSIONS = ("2.6", "2.9", "3.0", "3.1", "4.0", "4.1", "4.2")
WORN = {"waist": "Pelvis", "left_foot": "LeftFoot", "right_foot": "RightFoot"}
WORN |= {"left_hand": "LeftHand", "right_hand": "RightHand"}


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_person(sub, rate=120.0)
    sub.add_argument("--port", type=port, default=1510, help="port for questions (default: 1510)")
    sub.add_argument("--version", choices=VERSIONS, default="4.1", help="of NatNet (default: 4.1)")
    sub.add_argument("--multicast", metavar="GROUP", help="send to this group, port 1511; else to who asks")


def emulated(options: argparse.Namespace) -> Emulated:
    """Motive.

    Raises:
        InputError: The motion is missing or wrong, or the rate is none of Motive's.
    """
    from seerob.app.emulators.natnet import NatnetServer
    from seerob.protocols.tracking.natnet import DATA_PORT

    person = person_of(options, fastest=1000.0)
    major, minor = map(int, options.version.split("."))
    server = NatnetServer(
        {"Anna": person},
        worn={name: (person, segment) for name, segment in WORN.items()},
        version=(major, minor),
        host=options.host,
        port=options.port,
        group=(options.multicast, DATA_PORT) if options.multicast else None,
        rate=options.rate,
    )
    return Emulated(
        server, f"a skeleton and five rigid bodies, {options.file}", f"{options.host}:{options.port}"
    )
