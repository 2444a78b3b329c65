"""``seerob emulate drfl``: what the bridge of a Doosan controller sends, without either."""

from __future__ import annotations

import argparse

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated
from seerob.app.emulating._motions import add_motion, motion_of, target_of

HELP = "the bridge of a Doosan controller (DRFL), which sends to this software"
HOME = (0.0, 0.3, 1.2, 0.0, 1.2, 0.0)
"""What it swings about when no motion is given [rad]."""
RATES = (10, 50, 100, 200, 250, 500, 1000)
"""Messages per second [Hz]."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--robot", default="doosan_m1013", help="robot of the library (default: doosan_m1013)")
    add_motion(sub)
    sub.add_argument("--to", default="127.0.0.1", help="address to send to (default: this machine)")
    sub.add_argument("--port", type=port, default=20128, help="port to send to (default: 20128)")
    sub.add_argument("--rate", type=int, default=100, choices=RATES, help="messages per second [Hz]")


def emulated(options: argparse.Namespace) -> Emulated:
    """The bridge.

    Raises:
        InputError: No such robot, or a motion that it cannot do.
    """
    from seerob.app.emulators.drfl import DrflSender
    from seerob.protocols.robots.doosan_drfl import JOINTS

    target = target_of(options.robot, joints=JOINTS, whose="a Doosan arm")
    motion, what = motion_of(options, target, HOME)
    sender = DrflSender(motion, to=(options.to, options.port), rate=options.rate)
    return Emulated(sender, f"{target.name}, {what}", f"to {options.to}:{options.port}")
