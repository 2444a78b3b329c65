"""What an emulated robot does: a robot of the library, and a motion that it can do."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.errors import InputError

if TYPE_CHECKING:
    from seerob.emulators.motions import Motion
    from seerob.source import Target


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
    from seerob.model_io import library
    from seerob.model_io.description import JointKind
    from seerob.source import Target

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
