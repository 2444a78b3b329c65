"""The map and the rescaled motion as tables: rows for a CSV file, a workbook and the report alike."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence

import numpy as np

from seerob.permissible.ceilings import Ceiling
from seerob.permissible.evaluation import PermissibleSpeed
from seerob.permissible.speed_map import SpeedMap
from seerob.trajectory import Trajectory

Cell = str | float | int | None

MAP_HEAD: tuple[str, ...] = (
    "piece",
    "way in joint space [rad or m]",
    "given motion is there at [s]",
    "permissible path speed [rad/s or m/s]",
    "path speed of the given motion [rad/s or m/s]",
    "path speed at the joints' limits [rad/s or m/s]",
    "permissible share of it",
    "permissible speed of the governing part [m/s]",
    "criterion",
    "body region",
    "contact",
    "governed by",
    "part of the robot",
    "why undecided, or why none",
)
REGION_HEAD: tuple[str, ...] = (
    "piece",
    "given motion is there at [s]",
    "criterion",
    "body region",
    "contact",
    "governed by",
    "part of the robot",
    "permissible path speed [rad/s or m/s]",
    "permissible speed of that part [m/s]",
    "why undecided, or why none",
)


def _number(value: float) -> float | None:
    """What is not known, or without a limit, is an empty cell."""
    return value if math.isfinite(value) else None


def map_rows(found: SpeedMap) -> Iterator[list[Cell]]:
    """One row per station, in `MAP_HEAD`'s order."""
    for n, stations in enumerate(found.stations, 1):
        permissible, share = stations.permissible, stations.share
        for k, ceiling in enumerate(stations.governing):
            joint = found.limits.joints[int(stations.joint[k])]
            about: list[Cell] = ["joint speed", "", "", joint, "", ""]
            speed: float | None = None
            if ceiling is not None:
                about, speed = _about(ceiling), _number(ceiling.speed)
            yield [
                n,
                float(stations.s[k]),
                float(stations.t[k]),
                _number(float(permissible[k])),
                float(stations.given[k]),
                float(stations.reference[k]),
                _number(float(share[k])),
                speed,
                *about,
            ]


def _about(ceiling: Ceiling) -> list[Cell]:
    governs = "undecided" if ceiling.undecided else ceiling.governs
    return [
        ceiling.criterion,
        ceiling.region,
        ceiling.contact,
        governs,
        ceiling.surface,
        ceiling.reason,
    ]


def region_rows(found: SpeedMap) -> Iterator[list[Cell]]:
    """One row per station and ceiling, in `REGION_HEAD`'s order: every body region, not only the worst."""
    for n, stations in enumerate(found.stations, 1):
        for k, ceilings in enumerate(stations.ceilings):
            for c in ceilings:
                criterion, region, contact, governs, surface, reason = _about(c)
                path_speed = _number(c.share * float(stations.reference[k]))
                yield [
                    n, float(stations.t[k]), criterion, region, contact, governs, surface,
                    path_speed, _number(c.speed), reason,
                ]  # fmt: skip


def least_by_region(found: SpeedMap) -> list[tuple[Ceiling, float, bool]]:
    """Per criterion and body region the least ceiling, when it is, and whether any place is undecided."""
    least: dict[tuple[str, str], tuple[Ceiling, float, bool]] = {}
    for stations in found.stations:
        for t, ceilings in zip(stations.t.tolist(), stations.ceilings, strict=True):
            for c in ceilings:
                key = (c.criterion, c.region)
                now = least.get(key)
                doubt = c.undecided or (now is not None and now[2])
                smaller = now is None or now[0].undecided or (not c.undecided and c.share < now[0].share)
                least[key] = (c, t, doubt) if now is None or smaller else (now[0], now[1], doubt)
    return sorted(least.values(), key=lambda entry: (math.isnan(entry[0].share), entry[0].share))


def trajectory_head(trajectory: Trajectory, units: Sequence[str]) -> list[str]:
    """Columns that `seerob.sources.csv` and `excel` read back as they are."""
    joints = [f"J{j + 1} [{unit}]" for j, unit in enumerate(units)]
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
        writer.writerow(
            ["" if cell is None else repr(cell) if isinstance(cell, float) else cell for cell in row]
        )
    return out.getvalue().encode()


COST_HEAD: tuple[str, ...] = ("what governs", "time [s]", "share of the cycle")


def cost_rows(found: PermissibleSpeed) -> Iterator[list[Cell]]:
    """Where the time of the rescaled motion goes."""
    if found.rescaled is None:
        return
    whole = found.rescaled.duration
    for spent in found.spent:
        yield [spent.what, spent.time, spent.time / whole]
