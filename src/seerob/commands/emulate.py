"""``seerob emulate``: a robot controller without a robot, for a try-out and for demonstrations."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.commands import Exit, line, port, seconds
from seerob.commands.run import Stopped
from seerob.errors import InputError

if TYPE_CHECKING:
    from seerob.emulators.motions import Motion
    from seerob.source import Target

HELP = "be a robot controller without a robot: a real server that plays a motion"
EXAMPLE = "seerob emulate rtde --robot ur10 --file motion.csv"
KINDS = ("rtde",)
HOME = (0.0, -1.2, 1.4, -1.5, -1.5, 0.0)
"""What it swings about when no motion is given [rad]: elbow up, tool down."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("kind", choices=KINDS, help="what it speaks")
    sub.add_argument("--robot", default="ur10", help="robot of the library whose limits hold (default: ur10)")
    sub.add_argument("--file", type=Path, help="motion to play: a table with joint columns (.csv, .xlsx)")
    sub.add_argument("--host", default="127.0.0.1", help="address to listen on (default: this machine only)")
    sub.add_argument("--port", type=port, default=30004, help="port; 0 is any free one (default: 30004)")
    sub.add_argument("--seconds", type=seconds, help="end after this time")


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C.

    Raises:
        InputError: No such robot, or a motion that it cannot do.
    """
    from seerob.emulators.motions import swing
    from seerob.emulators.rtde import RtdeServer
    from seerob.live import because

    target = target_of(options.robot)
    motion = swing(HOME) if options.file is None else read(options.file, target)
    server = RtdeServer(motion, host=options.host, port=options.port)
    stopped = Stopped()
    try:
        server.start()
    except OSError as error:
        what = f"cannot listen on {options.host}:{options.port}: {because(error)}"
        raise InputError.at(
            "seerob emulate", "--port", what, "choose another, or 0 for any free one"
        ) from error
    try:
        what = "a calm swing" if options.file is None else str(options.file)
        line("emulates", f"{target.name}, {what}", "bold")
        line("listens", f"rtde at {options.host}:{server.port}  (Ctrl-C ends)")
        end = time.monotonic() + (options.seconds if options.seconds is not None else float("inf"))
        while not stopped() and time.monotonic() < end:
            time.sleep(0.05)
    finally:
        server.stop()
    return Exit.WITHIN


def target_of(robot: str) -> Target:
    """A robot of the library, as a source sees it.

    Raises:
        UnknownName: The library has no such robot.
        InputError: It does not have the six joints of this kind of controller.
    """
    from math import inf

    from seerob.model_io import library
    from seerob.model_io.description import JointKind
    from seerob.source import Target

    description = library.load(robot)
    joints = description.joints()
    if len(joints) != 6:
        what = f"{robot} has {len(joints)} joints, a Universal Robots arm has 6"
        raise InputError.at("seerob emulate", "--robot", what, "name another robot")
    return Target(
        name=robot,
        joints=tuple(j.name for j in joints),
        units=tuple("rad" if j.kind is JointKind.REVOLUTE else "m" for j in joints),
        lower=tuple(-inf if j.lower is None else j.lower for j in joints),
        upper=tuple(inf if j.upper is None else j.upper for j in joints),
        velocity=tuple(None if j.velocity is None else j.velocity.value for j in joints),
        description=description,
    )


def read(path: Path, target: Target) -> Motion:
    """A motion from a table.

    Raises:
        InputError: The file is missing or wrong, or the robot cannot do what it says.
    """
    from seerob.emulators.motions import played
    from seerob.samples import JointSample
    from seerob.sources.csv import Csv
    from seerob.sources.excel import Excel
    from seerob.tables.candidates import WORKBOOKS

    kind = Excel if path.suffix.lower() in WORKBOOKS else Csv
    opened = kind(robot=target.name, file=path.name).open(path.parent, target)
    samples = [s for s in opened.samples if isinstance(s, JointSample)]
    speeds = [s.qd or (0.0,) * len(s.q) for s in samples]
    return played([s.t for s in samples], [s.q for s in samples], speeds)
