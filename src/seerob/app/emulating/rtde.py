"""``seerob emulate rtde``: a Universal Robots controller that plays a motion."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated
from seerob.app.emulating._motions import add_motion, motion_of, target_of
from seerob.core.errors import InputError

if TYPE_CHECKING:
    from seerob.app.emulators.rtde import RtdeServer
    from seerob.protocols.robots.ur_primary import Kinematics

HELP = "a Universal Robots controller (RTDE)"
HOME = (0.0, -1.2, 1.4, -1.5, -1.5, 0.0)
"""What it swings about when no motion is given [rad]: elbow up, tool down."""
JOINTS = 6


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--robot", default="ur10", help="robot of the library whose limits hold (default: ur10)")
    add_motion(sub)
    sub.add_argument("--port", type=port, default=30004, help="port; 0 is any free one (default: 30004)")
    sub.add_argument("--calibration", type=Path, help="kinematics it says it has: a file of seerob probe")
    sub.add_argument(
        "--primary-port", type=port, default=30011, help="port where it says them (default: 30011); 0 is any"
    )


def emulated(options: argparse.Namespace) -> Emulated:
    """The controller.

    Raises:
        InputError: No such robot, or a motion that it cannot do.
    """
    from seerob.app.emulators.rtde import RtdeServer

    target = target_of(options.robot, joints=JOINTS, whose="a Universal Robots arm")
    motion, what = motion_of(options, target, HOME)
    server: RtdeServer = RtdeServer(
        motion,
        host=options.host,
        port=options.port,
        kinematics=None if options.calibration is None else _kinematics(options.calibration),
        primary_port=options.primary_port,
    )
    return Emulated(server, f"{target.name}, {what}", f"{options.host}:{options.port}")


def _kinematics(path: Path) -> Kinematics:
    from seerob.description.robots.calibration import read_calibration
    from seerob.protocols.robots.ur_primary import Kinematics

    try:
        found = read_calibration(path.read_bytes(), str(path))
    except OSError as error:
        raise InputError.at(path, "", f"cannot be read: {error.strerror}", "give another file") from error
    return Kinematics(found.theta, found.a, found.d, found.alpha, found.checksum or (0,) * 6)
