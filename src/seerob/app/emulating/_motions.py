"""What an emulated robot does: a robot of the library, and a motion that it can do."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.core.errors import InputError

if TYPE_CHECKING:
    from seerob.app.emulators.motions import Motion
    from seerob.workstation.source import Opened, Target


def target_of(robot: str, *, joints: int | None = None, whose: str = "") -> Target:
    """A robot of the library, as a source sees it.

    Args:
        robot: Its name in the library.
        joints: How many it must have; None for any number.
        whose: What has that many: ``a Universal Robots arm``.

    Raises:
        UnknownName: The library has no such robot.
        InputError: It has another number of joints.
    """
    from seerob.description.description import JointKind
    from seerob.description.robots import library
    from seerob.workstation.source import Target

    description = library.load(robot)
    own = description.joints()
    if joints is not None and len(own) != joints:
        what = f"{robot} has {len(own)} joints, {whose} has {joints}"
        raise InputError.at("seerob emulate", "--robot", what, "name another robot")
    return Target(
        name=robot,
        joints=tuple(j.name for j in own),
        units=tuple("rad" if j.kind is JointKind.REVOLUTE else "m" for j in own),
        lower=tuple(-inf if j.lower is None else j.lower for j in own),
        upper=tuple(inf if j.upper is None else j.upper for j in own),
        velocity=tuple(None if j.velocity is None else j.velocity.value for j in own),
        description=description,
    )


def home_of(target: Target, amplitude: float) -> tuple[float, ...]:
    """Joint positions nearest to zero about which every joint has room to swing.

    Args:
        target: The robot.
        amplitude: Of the swing [rad or m].
    """
    limits = zip(target.lower, target.upper, strict=True)
    return tuple(
        (low + high) / 2 if high - low < 2 * amplitude else min(max(0.0, low + amplitude), high - amplitude)
        for low, high in limits
    )


def read(path: Path, target: Target) -> Motion:
    """A motion from a table.

    Raises:
        InputError: The file is missing or wrong, or the robot cannot do what it says.
    """
    from seerob.devices.sources.csv import Csv
    from seerob.devices.sources.excel import Excel
    from seerob.files.tables.candidates import WORKBOOKS

    kind = Excel if path.suffix.lower() in WORKBOOKS else Csv
    return _played(kind(robot=target.name, file=path.name).open(path.parent, target))


def _played(opened: Opened) -> Motion:
    from seerob.app.emulators.motions import played
    from seerob.core.samples import JointSample

    samples = [s for s in opened.samples if isinstance(s, JointSample)]
    speeds = [s.qd or (0.0,) * len(s.q) for s in samples]
    return played([s.t for s in samples], [s.q for s in samples], speeds)


CALM = {
    "joint_speed": 0.5,
    "joint_acceleration": 1.0,
    "joint_jerk": 10.0,
    "tool_speed": 0.1,
    "tool_acceleration": 0.5,
    "tool_jerk": 5.0,
    "tolerance": 0.005,
}
"""What an emulated controller does where its waypoints do not say [rad/s, m/s and their derivatives, rad]."""


def add_motion(sub: argparse.ArgumentParser) -> None:
    """Arguments that say what it plays."""
    what = sub.add_mutually_exclusive_group()
    what.add_argument("--file", type=Path, help="motion to play: a table with joint columns (.csv, .xlsx)")
    text = "waypoints to go through, timed here: .script, .urp, .toml, .yaml, .csv, .xlsx, RoboDK, KUKA log"
    what.add_argument("--waypoints", type=Path, help=text)


def motion_of(options: argparse.Namespace, target: Target, home: Sequence[float]) -> tuple[Motion, str]:
    """What it plays, and that in words.

    Args:
        options: With those of `add_motion`.
        target: The robot.
        home: What it swings about when nothing is given, and where it stands before waypoints that
            begin with a pose [rad].

    Raises:
        InputError: The file is missing or wrong, or the robot cannot do what it says.
    """
    from seerob.app.emulators.motions import swing

    if options.waypoints is not None:
        return _through(options.waypoints, target, home), f"through the waypoints of {options.waypoints}"
    if options.file is not None:
        return read(options.file, target), str(options.file)
    return swing(home), "a calm swing"


def _through(path: Path, target: Target, home: Sequence[float]) -> Motion:
    import msgspec

    from seerob.devices.sources.waypoints import Waypoints

    given = {"robot": target.name, "file": path.name, **CALM}
    source = msgspec.convert(given, Waypoints)
    program = source.program(path)
    if program.waypoints and program.waypoints[0].q is None:
        source = msgspec.structs.replace(source, start=tuple(home))
    return _played(source.open(path.parent, target))
