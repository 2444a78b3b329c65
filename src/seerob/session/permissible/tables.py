"""The map and the rescaled motion as tables: rows for a CSV file, a workbook and the report alike."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence

import numpy as np

from seerob.core.files.no_formula import no_formula
from seerob.files.trajectories.path_map import (
    GIVEN,
    PERMISSIBLE,
    PIECE,
    TOOL,
    TOOL_GIVEN,
    TOOL_PERMISSIBLE,
    WHO,
    WHY,
    joint_columns,
)
from seerob.files.trajectories.trajectory import Trajectory
from seerob.session.permissible.ceiling import Ceiling
from seerob.session.permissible.evaluation import PermissibleSpeed
from seerob.session.permissible.segments import PathSegment
from seerob.session.permissible.speed_map import SpeedMap

Cell = str | float | int | None

MAP_HEAD: tuple[str, ...] = (
    PIECE,
    "way in joint space [rad or m]",
    "given motion is there at [s]",
    PERMISSIBLE,
    GIVEN,
    "path speed at the joints' limits [rad/s or m/s]",
    "permissible share of it",
    "permissible speed of the governing part [m/s]",
    TOOL_PERMISSIBLE,
    TOOL_GIVEN,
    *TOOL,
    *WHO,
    "part of the robot",
    WHY,
    "limit that governs",
    "unit of that limit",
    "source of that limit",
)
SEGMENT_HEAD: tuple[str, ...] = (
    "segment",
    "piece",
    "from [s]",
    "to [s]",
    "way of the tool point [m]",
    *(f"{end} {axis} [m]" for end in ("from", "to") for axis in "xyz"),
    TOOL_PERMISSIBLE,
    "least at [s]",
    "largest speed of the tool point as given [m/s]",
    "least permissible share of the given speed",
    PERMISSIBLE,
    *MAP_HEAD[13:],
)
REGION_HEAD: tuple[str, ...] = (
    PIECE,
    "given motion is there at [s]",
    *WHO,
    "part of the robot",
    PERMISSIBLE,
    "permissible speed of that part [m/s]",
    *MAP_HEAD[18:],
)


def _number(value: float) -> float | None:
    """What is not known, or without a limit, is an empty cell."""
    return value if math.isfinite(value) else None


def map_head(found: SpeedMap) -> list[str]:
    """Of `map_rows`: `MAP_HEAD`, and the joint positions of each place."""
    return [*MAP_HEAD, *joint_columns(found.limits.units)]


def map_rows(found: SpeedMap) -> Iterator[list[Cell]]:
    """One row per station, in `map_head`'s order."""
    for n, stations in enumerate(found.stations, 1):
        permissible, share = stations.permissible, stations.share
        for k, ceiling in enumerate(stations.governing):
            lever = float(stations.lever[k])
            yield [
                n,
                float(stations.s[k]),
                float(stations.t[k]),
                _number(float(permissible[k])),
                float(stations.given[k]),
                float(stations.reference[k]),
                _number(float(share[k])),
                None if ceiling is None else _number(ceiling.speed),
                _number(float(permissible[k]) * lever),
                float(stations.given[k]) * lever,
                *stations.tool[k].tolist(),
                *_about(ceiling, found.limits.joints[int(stations.joint[k])]),
                *stations.q[k].tolist(),
            ]


def segment_rows(found: Sequence[PathSegment]) -> Iterator[list[Cell]]:
    """One row per segment, in `SEGMENT_HEAD`'s order."""
    for one in found:
        (x, y, z), (x2, y2, z2) = (end.tolist() for end in one.tool)
        yield [
            one.number, one.piece, one.start, one.end, one.way, x, y, z, x2, y2, z2,
            _number(one.tool_speed), one.at, one.given, _number(one.share), _number(one.permissible),
            *_about(one.governing, one.joint),
        ]  # fmt: skip


def _about(ceiling: Ceiling | None, joint: str = "") -> list[Cell]:
    """Criterion, region, contact, what governs, part, why, and the figure with its unit and source."""
    if ceiling is None:
        return ["joint speed", "", "", "", joint, "", None, "", ""]
    figure = ceiling.limit
    return [
        ceiling.criterion,
        ceiling.region,
        ceiling.contact,
        "undecided" if ceiling.undecided else ceiling.governs,
        ceiling.surface,
        ceiling.reason,
        *((None, "", "") if figure is None else (figure.value, figure.unit, figure.source)),
    ]


def region_rows(found: SpeedMap) -> Iterator[list[Cell]]:
    """One row per station and ceiling, in `REGION_HEAD`'s order: every body region, not only the worst."""
    for n, stations in enumerate(found.stations, 1):
        for k, ceilings in enumerate(stations.ceilings):
            for c in ceilings:
                criterion, region, contact, governs, surface, *rest = _about(c)
                path_speed = _number(c.share * float(stations.reference[k]))
                yield [
                    n, float(stations.t[k]), criterion, region, contact, governs, surface,
                    path_speed, _number(c.speed), *rest,
                ]  # fmt: skip


def least_by_region(found: SpeedMap) -> list[tuple[Ceiling, float, bool]]:
    """Per criterion and body region the least ceiling, when it is, and whether any place is undecided."""
    least: dict[tuple[str, str], tuple[Ceiling, float, bool]] = {}
    for stations in found.stations:
        for t, ceilings in zip(stations.t.tolist(), stations.ceilings, strict=True):
            for c in ceilings:
                key = (c.criterion, c.region)
                now = least.get(key)
                invalid_reason = c.undecided or (now is not None and now[2])
                smaller = now is None or now[0].undecided or (not c.undecided and c.share < now[0].share)
                least[key] = (
                    (c, t, invalid_reason) if now is None or smaller else (now[0], now[1], invalid_reason)
                )
    return sorted(least.values(), key=lambda entry: (math.isnan(entry[0].share), entry[0].share))


def trajectory_head(trajectory: Trajectory, units: Sequence[str]) -> list[str]:
    """Columns that `seerob.devices.sources.csv` and `excel` read back as they are."""
    joints = joint_columns(units)
    speeds = [f"J{j + 1} velocity [{unit}/s]" for j, unit in enumerate(units)]
    return ["t [s]", *joints, *speeds]


def trajectory_rows(trajectory: Trajectory) -> Iterator[list[Cell]]:
    """One row per sample."""
    qd = np.zeros_like(trajectory.q) if trajectory.qd is None else trajectory.qd
    for t, q, v in zip(trajectory.t.tolist(), trajectory.q.tolist(), qd.tolist(), strict=True):
        yield [t, *q, *v]


def csv_bytes(head: Sequence[str], rows: Iterator[list[Cell]]) -> bytes:
    """A table as text: commas, decimal points, every digit, UTF-8."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(head)
    for row in rows:
        writer.writerow([no_formula(cell) if isinstance(cell, str) else _exact(cell) for cell in row])
    return out.getvalue().encode()


def _exact(cell: float | None) -> str:
    return "" if cell is None else repr(cell)


COST_HEAD: tuple[str, ...] = ("what governs", "time [s]", "share of the cycle")


def cost_rows(found: PermissibleSpeed) -> Iterator[list[Cell]]:
    """Where the time of the rescaled motion goes."""
    if found.rescaled is None:
        return
    whole = found.rescaled.duration
    for spent in found.spent:
        yield [spent.what, spent.time, spent.time / whole]
