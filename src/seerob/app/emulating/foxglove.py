"""``seerob emulate foxglove``: a Foxglove bridge with the joint states of a robot that plays a motion."""

from __future__ import annotations

import argparse

from seerob.app.emulating import Emulated
from seerob.app.emulating._ros import add_robot, robot_of

HELP = "a Foxglove bridge (ROS 1 or 2) with the joint states of a robot"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_robot(sub, port=8765)


def emulated(options: argparse.Namespace) -> Emulated:
    """The bridge.

    Raises:
        InputError: No such robot, or a motion that it cannot do.
    """
    from seerob.app.emulators.foxglove import FoxgloveBridge

    return robot_of(options, FoxgloveBridge)
