"""``seerob emulate rosbridge``: a rosbridge server with the joint states of a robot that plays a motion."""

from __future__ import annotations

import argparse

from seerob.app.emulating import Emulated
from seerob.app.emulating._ros import add_robot, robot_of

HELP = "a rosbridge server (ROS 1 or 2) with the joint states of a robot"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_robot(sub, port=9090)


def emulated(options: argparse.Namespace) -> Emulated:
    """The server.

    Raises:
        InputError: No such robot, or a motion that it cannot do.
    """
    from seerob.app.emulators.rosbridge import RosbridgeServer

    return robot_of(options, RosbridgeServer)
