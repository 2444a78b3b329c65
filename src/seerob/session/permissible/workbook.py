"""The map, the rescaled motion and what they rest on as an Excel workbook."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

from seerob.core.snapshot import Scene
from seerob.outputs.workbook import sheets as _sheets
from seerob.session.permissible.evaluation import PermissibleSpeed
from seerob.session.permissible.methods import BY
from seerob.session.permissible.segments import PathSegment
from seerob.session.permissible.tables import (
    COST_HEAD,
    REGION_HEAD,
    SEGMENT_HEAD,
    Cell,
    cost_rows,
    map_head,
    map_rows,
    region_rows,
    segment_rows,
    trajectory_head,
    trajectory_rows,
)

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
    with _sheets.workbook(out) as sheets:
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
