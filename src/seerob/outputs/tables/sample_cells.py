"""What was heard, as cells with a title each that says the unit: for tables of raw data."""

from __future__ import annotations

from collections.abc import Mapping

from seerob.core.samples import BodySample, JointSample, PoseSample, Sample, SignalSample
from seerob.core.snapshot import Scene

Cell = str | float | bool | None
TIME = "t [s]"
DEVICE_TIME = "device clock [s]"
QUALITY = "quality"
HEAD = (TIME, DEVICE_TIME, "sequence number", QUALITY)
"""Columns that every table of samples begins with."""


def title(sample: Sample) -> str:
    """Which table it belongs to."""
    target = "" if isinstance(sample, SignalSample) else sample.target
    return sample.source if not target or target in sample.source else f"{sample.source} {target}"


def joint_titles(scene: Scene) -> dict[str, tuple[tuple[str, str], ...]]:
    """Name and unit of every joint, by robot and human."""
    return {m.name: tuple((j.name, j.unit) for j in m.joints) for m in scene.mechanisms}


def joint_head(joints: Mapping[str, tuple[tuple[str, str], ...]], name: str, n: int) -> list[str]:
    """Titles of the joints of a robot or human in a table, and of its tracking error.

    Args:
        joints: Of `joint_titles`.
        name: Robot or human.
        n: How many joints there are.
    """
    titles = [f"{joint} [{unit}]" for joint, unit in joints.get(name, ())][:n]
    titles += [f"joint {k + 1} [rad or m]" for k in range(len(titles), n)]
    return [*titles, "tracking error [rad or m]"]


def cells(sample: Sample, joints: Mapping[str, tuple[tuple[str, str], ...]]) -> dict[str, Cell]:
    """Title → what was heard.

    Args:
        sample: As it came in: nothing is interpolated, and what was not seen is None.
        joints: Of `joint_titles`.
    """
    found: dict[str, Cell] = dict(
        zip(HEAD, (sample.t, sample.t_device, float(sample.seq), sample.quality.value), strict=True)
    )
    if isinstance(sample, JointSample):
        found |= _joints(sample, joints.get(sample.target, ()))
    elif isinstance(sample, PoseSample):
        found |= _pose("", sample.position, sample.wxyz)
    elif isinstance(sample, BodySample):
        found["subject"], found["latency [s]"] = sample.subject, sample.latency
        for point in sample.points:
            found |= _pose(f"{point.name} ", point.position, point.wxyz)
            if point.confidence is not None:
                found[f"{point.name} confidence"] = point.confidence
    else:
        found |= sample.values
    return found


def _joints(sample: JointSample, known: tuple[tuple[str, str], ...]) -> dict[str, Cell]:
    found: dict[str, Cell] = {}
    names = [*known, *((f"joint {k + 1}", "rad or m") for k in range(len(known), len(sample.q)))]
    torques = {"rad": "N·m", "m": "N"}
    for what, values in (("", sample.q), (" velocity", sample.qd), (" torque", sample.tau)):
        for (name, unit), value in zip(names, values or (), strict=False):
            shown = {"": unit, " velocity": f"{unit}/s", " torque": torques.get(unit, "N·m or N")}[what]
            found[f"{name}{what} [{shown}]"] = value
    return found


def _pose(name: str, position: tuple[float, ...] | None, wxyz: tuple[float, ...] | None) -> dict[str, Cell]:
    found: dict[str, Cell] = {}
    if position is not None:
        found |= {f"{name}{axis} [m]": value for axis, value in zip("xyz", position, strict=True)}
    if wxyz is not None:
        found |= {f"{name}q{axis} [1]": value for axis, value in zip("wxyz", wxyz, strict=True)}
    return found
