"""``seerob emulate rtde``: a Universal Robots controller that plays a motion."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.commands import port
from seerob.commands.emulating import Emulated
from seerob.commands.emulating._motions import read, target_of

if TYPE_CHECKING:
    from seerob.emulators.rtde import RtdeServer

HELP = "a Universal Robots controller (RTDE)"
HOME = (0.0, -1.2, 1.4, -1.5, -1.5, 0.0)
"""What it swings about when no motion is given [rad]: elbow up, tool down."""
JOINTS = 6


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--robot", default="ur10", help="robot of the library whose limits hold (default: ur10)")
    sub.add_argument("--file", type=Path, help="motion to play: a table with joint columns (.csv, .xlsx)")
    sub.add_argument("--port", type=port, default=30004, help="port; 0 is any free one (default: 30004)")


def emulated(options: argparse.Namespace) -> Emulated:
    """The controller.

    Raises:
        InputError: No such robot, or a motion that it cannot do.
    """
    from seerob.emulators.motions import swing
    from seerob.emulators.rtde import RtdeServer

    target = target_of(options.robot, joints=JOINTS, whose="a Universal Robots arm")
    motion = swing(HOME) if options.file is None else read(options.file, target)
    server: RtdeServer = RtdeServer(motion, host=options.host, port=options.port)
    what = "a calm swing" if options.file is None else str(options.file)
    return Emulated(server, f"{target.name}, {what}", f"{options.host}:{options.port}")
