"""``seerob emulate rosbridge``: a rosbridge server with the joint states of a robot that plays a motion."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.commands import port
from seerob.commands.emulating import Emulated
from seerob.commands.emulating._motions import home_of, read, target_of

HELP = "a rosbridge server (ROS 1 or 2) with the joint states of a robot"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--robot", default="ur10", help="robot of the library (default: ur10)")
    sub.add_argument("--file", type=Path, help="motion to play: a table with joint columns (.csv, .xlsx)")
    sub.add_argument("--port", type=port, default=9090, help="port; 0 is any free one (default: 9090)")
    sub.add_argument("--ros", choices=("1", "2"), default="2", help="of ROS (default: 2)")
    sub.add_argument("--rate", type=float, default=100.0, help="messages per second (default: 100)")


def emulated(options: argparse.Namespace) -> Emulated:
    """The server.

    Raises:
        InputError: No such robot, or a motion that it cannot do.
    """
    from seerob.emulators.motions import SWING, swing
    from seerob.emulators.rosbridge import RosbridgeServer
    from seerob.errors import InputError
    from seerob.protocols.ros_serialised import Edition

    if not 1 <= options.rate <= 1000:
        raise InputError.at("seerob emulate", "--rate", f"{options.rate:g} Hz", "it does 1 to 1000 Hz")
    target = target_of(options.robot)
    motion = swing(home_of(target, SWING)) if options.file is None else read(options.file, target)
    server = RosbridgeServer(
        motion,
        target.joints,
        host=options.host,
        port=options.port,
        edition=Edition(f"ros{options.ros}"),
        rate=options.rate,
    )
    what = "a calm swing" if options.file is None else str(options.file)
    return Emulated(server, f"{target.name}, {what}", f"{options.host}:{options.port}")
