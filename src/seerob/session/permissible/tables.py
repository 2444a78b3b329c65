"""The map and the rescaled motion as files: rows for CSV, workbook and report alike, and URScript."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Scene
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
from seerob.model.model import Mechanism
from seerob.outputs import workbook as _workbook
from seerob.outputs.tables.growing_table import no_formula
from seerob.session.permissible.ceilings import BY, Ceiling
from seerob.session.permissible.evaluation import PermissibleSpeed
from seerob.session.permissible.rescaled import Rescaled
from seerob.session.permissible.speed_map import PathSegment, SpeedMap

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


# -- as a workbook --------------------------------------------------------------------------------

INPUT_HEAD: list[Cell] = ["of", "input", "value", "unit", "origin", "source"]
PROOF_HEAD: list[Cell] = [
    "criterion",
    "before",
    "after",
    "worst value",
    "unit",
    "limit",
    "at [s]",
    "what governs",
]


def workbook(found: PermissibleSpeed, cut: Sequence[PathSegment], scene: Scene, *, period: float) -> bytes:
    """The workbook.

    Args:
        found: What was found.
        cut: The segments of its map.
        scene: Of the workstation, for hashes and where inputs are from.
        period: Of the rescaled motion's rows [s].
    """
    out = io.BytesIO()
    with _workbook.workbook(out) as sheets:
        sheets.add("Summary", ["what", "value"], _summary(found, scene), fit=True)
        sheets.add("Segments", list(SEGMENT_HEAD), segment_rows(cut))
        sheets.add("Map", list(map_head(found.map)), map_rows(found.map))
        sheets.add("Map by region", list(REGION_HEAD), region_rows(found.map))
        if found.rescaled is not None:
            trajectory = found.rescaled.trajectory(period)
            head = trajectory_head(trajectory, found.map.limits.units)
            sheets.add("Rescaled", list(head), trajectory_rows(trajectory))
            sheets.add("Where the time goes", list(COST_HEAD), list(cost_rows(found)), fit=True)
            sheets.add("Evaluated again", PROOF_HEAD, proof_rows(found), fit=True)
        sheets.add("Inputs", INPUT_HEAD, _inputs(found, scene), fit=True)
        about: list[list[Cell]] = [[f.level, f.subject, f.text] for f in (*scene.findings, *found.findings)]
        sheets.add("Findings", ["level", "about", "text"], about, fit=True)
    return out.getvalue()


def proof_rows(found: PermissibleSpeed) -> list[list[Cell]]:
    """Every criterion of the given motion and of the rescaled one."""
    if found.after is None:
        return []
    rows: list[list[Cell]] = []
    for name, series in found.after.results.items():
        before = found.before.get(name)
        words = [
            "no limit" if one is None or one.verdict is None else one.verdict.value
            for one in (before, series)
        ]
        worst = series.worst() if series.known else None
        rows.append(
            [name, *words, "never gave a result"]
            if worst is None
            else [name, *words, worst.value, series.unit, worst.limit, worst.t, worst.reason]
        )
    return rows


def _summary(found: PermissibleSpeed, scene: Scene) -> list[list[Cell]]:
    rows: list[list[Cell]] = [
        ["workstation", scene.title],
        ["inputs, SHA-256", scene.workstation_hash],
        ["seerob", scene.version],
        ["edition", scene.edition],
        ["robot", found.map.robot],
        ["by", BY[found.map.by]],
        ["criteria asked", ", ".join(found.map.asked)],
        ["cycle time before [s]", found.motion.duration],
    ]
    if found.rescaled is None or found.check is None or found.verified is None:
        return [*rows, ["rescaled motion", f"none: {found.refused}"]]
    used, verified = found.check, found.verified
    return [
        *rows,
        ["cycle time after [s]", found.rescaled.duration],
        ["margin to the map", found.rescaled.margin],
        ["largest deviation of the path [rad or m]", float(found.path.deviation.max())],
        ["largest use of the map", used.map],
        ["largest use of a joint's speed", used.velocity],
        ["largest use of a joint's acceleration", used.acceleration],
        ["largest use of a joint's jerk", used.jerk],
        ["criteria asked of the plan every [s]", verified.period],
        ["largest use of what they permit then", verified.use if np.isfinite(verified.use) else "beyond"],
        ["instants that cannot be told", verified.undecided],
    ]


def _inputs(found: PermissibleSpeed, scene: Scene) -> list[list[Cell]]:
    rows: list[list[Cell]] = [
        ["joint limits", i.name, i.value, i.unit, i.origin.value, i.source] for i in found.map.limits.inputs
    ]
    for info in scene.criteria:
        if info.basis is not None and info.name in found.map.asked:
            rows.append([info.name, "formula", info.basis.formula, "", "", info.basis.source])
            rows += [
                [info.name, i.name, i.value, i.unit, i.origin.value, i.source] for i in info.basis.inputs
            ]
    return rows


# -- as a URScript program ------------------------------------------------------------------------

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
"""Of a robot that understands URScript, from the base on."""
PERIODS = (0.002, 0.004, 0.008)
"""Control periods that are whole steps of a controller: e-Series 2 ms, CB3 8 ms [s]."""
MOST_LINES = 100_000
APPROACH = 0.2
"""Speed [rad/s] and acceleration [rad/s²] with which the robot goes to the first position, unless a joint's
limits are lower."""


def refusal(robot: Mechanism) -> str:
    """Why URScript does not fit a robot; empty when it does."""
    names = [re.sub(r"_joint$", "", joint.name) for joint in robot.joints]
    if tuple(name.rsplit("/", 1)[-1] for name in names) == JOINTS and set(robot.units) == {"rad"}:
        return ""
    return f"URScript is for the six joints {', '.join(JOINTS)}; {robot.name} has {', '.join(names)}"


def urscript(
    motion: Rescaled, robot: Mechanism, *, period: float, title: str, version: str, digest: str
) -> str:
    """The program.

    Args:
        motion: The motion.
        robot: The robot.
        period: One of `PERIODS` [s].
        title: Of the workstation.
        version: Of seerob.
        digest: SHA-256 of the workstation file and all that it names.

    Raises:
        InputError: Another robot, another period, or a program that is too long.
    """
    why = refusal(robot)
    if why:
        raise InputError.at("URScript", robot.name, why, "export CSV or Excel instead")
    if period not in PERIODS:
        raise InputError.at("URScript", "period", f"{period} s", f"give one of {PERIODS}")
    n = math.ceil(motion.duration / period - 1e-9)
    if n > MOST_LINES:
        raise InputError.at(
            "URScript", "period", f"{n} positions", f"at most {MOST_LINES}: give a longer one"
        )
    t = np.minimum(np.arange(n + 1) * period, motion.duration)
    q = motion.at(t)[0]
    limits, found = motion.of.limits, motion.of
    speed = min(APPROACH, float(limits.velocity.min()))
    acceleration = min(APPROACH, float(limits.acceleration.min()))
    own = "joint limits, " + ", ".join(found.asked)
    head = [
        f"# Generated by seerob {version} from {_plain(title)}",
        f"# inputs, SHA-256: {digest}",
        f"# robot {_plain(robot.name)}; timing within {_plain(own)}, margin {motion.margin:g}",
        f"# cycle {motion.duration:.3f} s, before {motion.before:.3f} s; path off by at most "
        f"{float(found.path.deviation.max()):.2g} rad",
        f"# joint limits [rad/s], [rad/s2], [rad/s3]: {_list(limits.velocity)}, "
        f"{_list(limits.acceleration)}, {_list(limits.jerk)}",
        "# NOT verified on a controller, and no protective measure: try it in simulation, then at reduced",
        "# speed. A controller follows set positions with its own delay and gain; the safety functions of",
        "# the robot must limit speed and force whatever a program says.",
        f"# Angles in radians; one position every {period:g} s.",
    ]
    body = [
        f"  movej({_list(q[0])}, a={acceleration:.6g}, v={speed:.6g})",
        *(f"  servoj({_list(row)}, t={period:g}, lookahead_time=0.03, gain=2000)" for row in q[1:]),
        "  stopj(2.0)",
    ]
    return "\n".join([*head, "def seerob_rescaled():", *body, "end", ""])


def _list(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{v + 0.0:.9f}" for v in values.tolist()) + "]"


def _plain(text: str) -> str:
    """One line of visible text: what stands in a file must not become a line of a program."""
    return "".join(c if c.isprintable() and ord(c) < 128 else "?" for c in text)[:200]
