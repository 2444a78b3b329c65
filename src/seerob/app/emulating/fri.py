"""``seerob emulate fri``: a KUKA LBR controller that plays a motion to whoever listens."""

from __future__ import annotations

import argparse

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated
from seerob.app.emulating._motions import add_motion, motion_of, target_of

HELP = "a KUKA LBR controller (FRI), which sends to a client"
HOME = (0.0, 0.5, 0.0, -1.4, 0.0, 1.2, 0.0)
"""What it swings about when no motion is given [rad]."""
JOINTS = 7


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--robot", default="iiwa14", help="robot of the library (default: iiwa14)")
    add_motion(sub)
    sub.add_argument("--to", default="127.0.0.1", help="address of the client (default: this machine)")
    sub.add_argument("--port", type=port, default=30200, help="port of the client (default: 30200)")
    sub.add_argument("--edition", choices=("1", "2.5", "2.7"), default="2.7", help="FRI (default: 2.7)")
    sub.add_argument("--period", type=int, default=5, choices=range(1, 101), metavar="MS", help="[ms]")


def emulated(options: argparse.Namespace) -> Emulated:
    """The controller.

    Raises:
        InputError: No such robot, or a motion that it cannot do.
    """
    from seerob.app.emulators.fri import FriServer
    from seerob.protocols.robots.fri import Edition

    target = target_of(options.robot, joints=JOINTS, whose="an LBR")
    motion, what = motion_of(options, target, HOME)
    server = FriServer(
        motion,
        to=(options.to, options.port),
        host=options.host,
        edition=Edition(options.edition),
        period=1e-3 * options.period,
    )
    where = f"{options.host}, to {options.to}:{options.port}"
    return Emulated(server, f"{target.name}, {what}", where, (f"seerob probe fri {options.host}{{option}}",))
