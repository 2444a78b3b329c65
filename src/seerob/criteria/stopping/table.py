"""Stopping times and distances that a robot's maker publishes: tables over speed, payload, extension.

Tables are shipped as cited data in ``norms/stopping``; a user's own has the same keys.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from importlib.resources import files
from typing import Annotated, TypeVar

import msgspec
import numpy as np
from msgspec import Meta, Struct

from seerob.core.errors import InputError, Undecided, UnknownName
from seerob.core.transforms import Array

FOLDER = "stopping"
MOST = 100
"""Nodes of a table along one axis."""

_nodes = Meta(min_length=1, max_length=MOST)
Fractions = Annotated[tuple[Annotated[float, Meta(gt=0)], ...], _nodes]
Grid = Annotated[
    tuple[Annotated[tuple[Annotated[tuple[Annotated[float, Meta(ge=0)], ...], _nodes], ...], _nodes], ...],
    _nodes,
]


class JointStop(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How one joint stops."""

    joint: Annotated[int, Meta(ge=0, le=MOST)]
    """Its place from the base, 0 is the first."""
    full_speed: Annotated[float, Meta(gt=0)] | None = None
    """Speed that 1 means [rad/s or m/s]; the robot's velocity limit when the source does not say."""
    speed: Fractions = (1.0,)
    """Nodes: share of the full speed, ascending."""
    payload: Fractions = (1.0,)
    """Nodes: share of the rated payload, ascending."""
    extension: Fractions = (1.0,)
    """Nodes: share of the reach, ascending."""
    way: Grid
    """Stopping distance [rad or m] per speed, payload and extension."""
    time: Grid
    """Stopping time [s] per speed, payload and extension."""

    def shares(self, full_speed: float) -> tuple[float, ...]:
        """Each way as a share of that at its speed for all of its time; at most 1 of what only brakes.

        Args:
            full_speed: [rad/s or m/s].
        """
        nodes = zip(self.speed, self.way, self.time, strict=False)
        return tuple(
            way / (full_speed * speed * time) if time > 0 else (math.inf if way > 0 else 0.0)
            for speed, ways, times in nodes
            for rows in zip(ways, times, strict=False)
            for way, time in zip(*rows, strict=False)
        )

    def derived(self) -> Iterator[tuple[str, str, tuple[float, ...]]]:
        """What follows from several of its figures: name, unit and values."""
        shares = () if self.full_speed is None else self.shares(self.full_speed)
        if some := tuple(share for share in shares if share > 0):
            yield "share", "", some


class SpeedStop(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Stopping time by the speed of the tool's centre point."""

    speed: Fractions
    """Nodes [m/s], ascending."""
    time: Annotated[tuple[Annotated[float, Meta(gt=0)], ...], _nodes]
    """[s] per node."""


class StoppingTable(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a maker publishes on stopping."""

    robot: str
    """Whose figures these are: in a table of your own, the name of the robot in the workstation file."""
    models: Annotated[tuple[str, ...], Meta(max_length=MOST)] = ()
    """What ``model`` of a robot in the workstation file is that robot, such as ``library:ur10``."""
    category: Annotated[int, Meta(ge=0, le=2)]
    """Stop category, IEC 60204-1."""
    source: str
    confidence: str
    """How well sources agree: ``2S``, ``1S``, ``M``."""
    note: str = ""
    rated_payload: Annotated[float, Meta(gt=0)] | None = None
    """[kg]; None when the source does not say."""
    reach: Annotated[float, Meta(gt=0)] | None = None
    """Distance of the flange from the first axis that extension 1 means [m]; needed with several nodes."""
    joints: Annotated[tuple[JointStop, ...], Meta(max_length=MOST)] = ()
    tool: SpeedStop | None = None

    def __post_init__(self) -> None:
        if bool(self.joints) == (self.tool is not None):
            raise ValueError("a stopping table has either joints or tool")
        if len({j.joint for j in self.joints}) < len(self.joints):
            raise ValueError("a joint is there twice")
        for j in self.joints:
            shape = (len(j.speed), len(j.payload), len(j.extension))
            for name, axis in (("speed", j.speed), ("payload", j.payload), ("extension", j.extension)):
                _ascending(f"joint {j.joint}: {name}", axis)
            for name, grid in (("way", j.way), ("time", j.time)):
                _filled(f"joint {j.joint}: {name}", grid, shape)
            if len(j.extension) > 1 and self.reach is None:
                raise ValueError("reach is needed where stopping depends on extension")
        if self.tool is not None:
            _ascending("tool: speed", self.tool.speed)
            if len(self.tool.time) != len(self.tool.speed):
                raise ValueError("tool: as many times as speeds")


def _ascending(where: str, axis: Sequence[float]) -> None:
    if not np.all(np.isfinite(axis)) or np.any(np.diff(axis) <= 0):
        raise ValueError(f"{where}: {list(axis)} does not ascend")


def _filled(where: str, grid: Grid, shape: tuple[int, ...]) -> None:
    lengths = {(len(grid), len(row), len(cells)) for row in grid for cells in row}
    if lengths != {shape} or not np.all(np.isfinite(grid)):
        raise ValueError(f"{where}: finite numbers for {shape} nodes are needed")


def shipped() -> tuple[str, ...]:
    """Names of the tables that come with seerob."""
    folder = files("seerob.description.norms") / FOLDER
    return tuple(sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")))


def table(name: str) -> StoppingTable:
    """A table that comes with seerob.

    Raises:
        UnknownName: There is none of that name.
    """
    if name not in shipped():
        raise UnknownName("stopping table", name, shipped())
    text = (files("seerob.description.norms") / FOLDER / f"{name}.toml").read_bytes()
    try:
        return msgspec.toml.decode(text, type=StoppingTable)
    except (msgspec.ValidationError, msgspec.DecodeError) as error:
        raise InputError.at(f"{name}.toml", "", str(error), "see the tables that come with seerob") from error


Value = TypeVar("Value", float, Array)


def interpolate(axes: Sequence[Sequence[float]], values: Array, at: Sequence[float]) -> float:
    """Value of a table between its nodes, linear along each axis; below the first node the first.

    Where figures fall along an axis, the largest so far is taken: the worse corner.

    Args:
        axes: Nodes of each axis, ascending.
        values: One per node, shape of the axes' lengths.
        at: Where.

    Raises:
        Undecided: Beyond the last node of an axis.
    """
    found = np.asarray(values, float)
    for k in range(found.ndim):
        found = np.maximum.accumulate(found, axis=k)
    for axis, x in zip(axes, at, strict=True):
        found = np.asarray(along_axis(axis, list(found), x))
    return float(found)


def along_axis(axis: Sequence[float], values: Sequence[Value], x: float) -> Value:
    """Value between the nodes of an axis, linear; below the first node the first.

    Raises:
        Undecided: Beyond the last node.
    """
    if not x <= axis[-1] * (1 + 1e-9):
        raise Undecided(f"{x:.3g} is beyond the table, which ends at {axis[-1]:g}")
    if len(axis) == 1:
        return values[0]
    k = min(max(bisect_right(axis, x) - 1, 0), len(axis) - 2)
    share = max((x - axis[k]) / (axis[k + 1] - axis[k]), 0.0)
    return (1 - share) * values[k] + share * values[k + 1]


def joint_stop(entry: JointStop, speed: float, payload: float, extension: float) -> tuple[float, float]:
    """Way [rad or m] and time [s] that a joint needs to stop; nothing when it stands.

    Args:
        entry: The joint's tables.
        speed: Share of the full speed.
        payload: Share of the rated payload.
        extension: Share of the reach.

    Raises:
        Undecided: Beyond the tables.
    """
    axes, at = (entry.speed, entry.payload, entry.extension), (abs(speed), payload, extension)
    for what, axis, x in zip(("speed", "payload", "extension"), axes, at, strict=True):
        if not x <= axis[-1] * (1 + 1e-9):
            raise Undecided(
                f"joint {entry.joint}: {what} is {x:.3g} of the full figure, the table ends at {axis[-1]:g}"
            )
    if speed == 0:
        return 0.0, 0.0
    return interpolate(axes, np.array(entry.way), at), interpolate(axes, np.array(entry.time), at)
