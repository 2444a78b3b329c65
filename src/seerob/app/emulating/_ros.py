"""What emulated servers of ROS share: a robot, a motion, an edition and a rate."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from seerob.app.console.terminal import port as a_port
from seerob.app.emulating import Emulated
from seerob.app.emulating._motions import add_motion, home_of, motion_of, target_of


def add_robot(sub: argparse.ArgumentParser, *, port: int) -> None:
    """Arguments; ``port`` is the usual one."""
    sub.add_argument("--robot", default="ur10", help="robot of the library (default: ur10)")
    add_motion(sub)
    sub.add_argument("--port", type=a_port, default=port, help=f"port; 0 is any free one (default: {port})")
    sub.add_argument("--ros", choices=("1", "2"), default="2", help="of ROS (default: 2)")
    sub.add_argument("--rate", type=float, default=100.0, help="messages per second (default: 100)")


def robot_of(options: argparse.Namespace, server: Callable[..., Any]) -> Emulated:
    """A server that speaks for the robot that is asked for.

    Args:
        options: With those of `add_robot`.
        server: Made of a motion, the names of the joints, and ``host``, ``port``, ``edition``, ``rate``.

    Raises:
        InputError: No such robot, or a motion that it cannot do.
    """
    from seerob.app.emulators.motions import SWING
    from seerob.core.errors import InputError
    from seerob.protocols.ros.ros_serialised import Edition

    if not 1 <= options.rate <= 1000:
        raise InputError.at("seerob emulate", "--rate", f"{options.rate:g} Hz", "it does 1 to 1000 Hz")
    target = target_of(options.robot)
    motion, what = motion_of(options, target, home_of(target, SWING))
    made = server(
        motion,
        target.joints,
        host=options.host,
        port=options.port,
        edition=Edition(f"ros{options.ros}"),
        rate=options.rate,
    )
    return Emulated(made, f"{target.name}, {what}", f"{options.host}:{options.port}")
