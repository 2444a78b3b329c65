"""What was found, in sentences, tables and a picture for the report.

The picture of the map is drawn in the cell; the table lists segments.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import starmap

import numpy as np

from seerob.core.extras import need
from seerob.core.figures import figure, rounded_down, rounded_up
from seerob.core.snapshot import Result, Scene
from seerob.core.transforms import Array
from seerob.files.trajectories.path_map import Place, path_markers
from seerob.outputs.report.report import ReportSection, ReportTable
from seerob.session.permissible.between_samples import METHOD, Bound
from seerob.session.permissible.ceilings import BY, EITHER_NEEDS, By, Ceiling
from seerob.session.permissible.evaluation import PermissibleSpeed
from seerob.session.permissible.speed_map import PathSegment, SpeedMap
from seerob.session.permissible.survey import Verified
from seerob.session.permissible.tables import COST_HEAD, Cell, cost_rows, least_by_region


@dataclass(frozen=True, eq=False)
class ReportPlace:
    """What a report needs beside the result."""

    scene: Scene
    meshes: Mapping[str, bytes]
    """Binary glTF per mesh hash of the scene's nodes."""
    segments: tuple[PathSegment, ...]

    def picture(self, found: PermissibleSpeed) -> bytes:
        """The way of the tool point in the cell, PNG."""
        from seerob.outputs.picture.picture import Stage

        drawn = Result(name=found.map.robot, unit="m/s", markers=path_markers(places(found.map)))
        stage = Stage(self.scene, dict(self.meshes))
        return stage.picture(found.first, drawn, subjects=(found.map.robot,))


def places(found: SpeedMap) -> list[list[Place]]:
    """The stations of every piece as they are drawn."""
    return [
        list(
            starmap(
                Place,
                zip(
                    map(tuple, one.tool.tolist()),
                    (one.permissible * one.lever).tolist(),
                    (one.given * one.lever).tolist(),
                    strict=True,
                ),
            )
        )
        for one in found.stations
    ]


LONGEST = 12
"""Rows of what governs; the rest is in the workbook."""
BOUNDS_TITLE = "Between the samples"
TITLE = "Permissible speed along the path"
BY_REGION = "Permissible speed by body region"


def sentences(found: PermissibleSpeed) -> tuple[str, ...]:
    """The result in words."""
    asked = ", ".join(found.map.asked)
    head = [
        f"The largest speed of {found.map.robot} along the path of its given motion, {BY[found.map.by]}, and "
        f"within the speed limits of its joints. Criteria: {asked}."
    ]
    if found.map.by is By.EITHER:
        head.append(f"What this rests on: {EITHER_NEEDS}.")
    if found.rescaled is None or found.check is None or found.verified is None:
        return *head, f"There is no rescaled motion: {found.refused}."
    motion, used, verified = found.rescaled, found.check, found.verified
    change = motion.duration - motion.before
    return (
        *head,
        f"Cycle time {motion.before:.3f} s as given, {motion.duration:.3f} s rescaled ({change:+.3f} s); "
        f"the map is kept with a margin of {motion.margin:.1%}.",
        f"At 1 kHz and wherever the jerk jumps, the rescaled motion uses at most {_used(used.map)} of the "
        f"map, {_used(used.velocity)} of a joint's speed, {_used(used.acceleration)} of its acceleration and "
        f"{_used(used.jerk)} of its jerk. Its path is off the given one by at most "
        f"{rounded_up(float(found.path.deviation.max()), 'rad or m')} in any joint.",
        _between(verified),
        "The rescaled motion is a plan: no controller has executed it. The criteria were asked again of a "
        "run of it, and their verdicts are those of the whole run.",
    )


def _used(share: float) -> str:
    """A share of a limit, rounded up."""
    return rounded_up(100 * share, "%")


def _between(verified: Verified) -> str:
    """What holds between two stations of the map, and how that is known."""
    head = f"Between the stations of the map: the criteria were asked of the plan every {verified.period:g} s"
    if verified.undecided:
        return f"{head}; at {verified.undecided} of {verified.asked} instants it cannot be told."
    worst = f", at {verified.at:.3f} s ({verified.what})" if verified.use > 0 else ""
    return (
        f"{head} while it moves, {verified.asked} times; it uses at most {_used(verified.use)} of what they "
        f"permit there{worst}. That is a sampling, not a bound."
    )


def sections(found: PermissibleSpeed, place: ReportPlace) -> tuple[ReportSection, ...]:
    """For the report: the segments with the way in the room, then what governs and where the time goes.

    Args:
        found: What was found.
        place: The cell it is drawn in.
    """
    by_segment = ReportTable(
        ("segment", "from, to", "way", "permitted", "largest given", "criterion, body region", "contact",
         "governed by", "limit", "part"),
        tuple(_segment(one) for one in place.segments),
        "Permitted: speed of the tool point at the place where it may be slowest. Cut where the robot stands "
        "or turns back, and into parts of equal way.",
    )  # fmt: skip
    tables = [
        ReportTable(
            ("criterion, body region", "least permissible speed", "contact", "governed by", "part", "at"),
            tuple(_least(found)),
            "Per body region the place of the path where the least is permitted; speeds are those of the "
            "part of the robot that governs.",
        )
    ]
    if found.rescaled is not None:
        rows = list(cost_rows(found))
        tables.append(
            ReportTable(
                COST_HEAD,
                tuple((str(w), f"{_float(t):.3f}", f"{_float(s):.1%}") for w, t, s in rows[:LONGEST]),
                "Where the time of the rescaled motion goes.",
            )
        )
    return (
        ReportSection(TITLE, sentences(found), (by_segment,), place.picture(found), _IN_THE_ROOM),
        ReportSection(BY_REGION, (), tuple(tables), picture(found), _CAPTION),
    )


_CAPTION = "Path speed over the given motion's time: permissible, and as given. Gaps are undecided."
_IN_THE_ROOM = (
    "The way of the tool point, coloured by what the given motion does there: within what is permitted, "
    "above it, or undecided."
)


def limit_words(ceiling: Ceiling | None) -> str:
    """``190 N/cm²``: the figure that governs, in the unit of its table."""
    if ceiling is None or ceiling.limit is None:
        return "–"
    value, unit = ceiling.limit.value, ceiling.limit.unit
    return f"{value / 1e4:.4g} N/cm²" if unit == "Pa" else f"{value:.4g} {unit}"


def segment_words(one: PathSegment) -> str:
    """One segment as a line."""
    number, when, way, permitted, given, name, contact, governs, limit, part = _segment(one)
    why = ", ".join(x for x in (contact, governs, limit, part) if x not in {"–", name})
    if permitted in {"none", "undecided"}:
        permitted, why = "no speed" if permitted == "none" else "an undecided speed", governs
    return f"{number:>3}  {when}, {way}: tool point {permitted} permitted, {given} given; {name}: {why}"


def _segment(one: PathSegment) -> tuple[str, ...]:
    c = one.governing
    blocked = c is not None and c.share == 0
    permitted = (
        "undecided"
        if np.isnan(one.permissible)
        else "none"
        if blocked
        else rounded_down(one.tool_speed, "m/s")
    )
    name = "speed of a joint" if c is None else f"{c.criterion}: {c.region}" if c.region else c.criterion
    governs = one.joint if c is None else c.reason if c.undecided or blocked else c.governs
    part = "–" if c is None or blocked else c.surface or "–"
    return (
        str(one.number),
        f"{one.start:.2f} s to {one.end:.2f} s",
        f"{one.way:.3f} m",
        permitted,
        rounded_up(one.given, "m/s"),
        name,
        (c.contact if c is not None else "") or "–",
        governs,
        limit_words(c),
        part,
    )


def _float(cell: Cell) -> float:
    return float(cell) if isinstance(cell, int | float) else float("nan")


def _least(found: PermissibleSpeed) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for c, t, invalid_reason in least_by_region(found.map):
        speed = (
            "undecided" if c.undecided else "–" if not np.isfinite(c.speed) else rounded_down(c.speed, "m/s")
        )
        if not c.undecided and c.share == 0:
            speed = "none"
        if invalid_reason and not c.undecided:
            speed += ", elsewhere undecided"
        name = f"{c.criterion}: {c.region}" if c.region else c.criterion
        why = c.reason if c.undecided or c.share == 0 else c.governs
        rows.append((name, speed, c.contact or "–", why or "–", c.surface or "–", f"{t:.2f} s"))
    return rows


def bounds_section(bounds: Sequence[Bound]) -> ReportSection:
    """Bounds that hold between samples, for the report."""
    rows = tuple(
        (
            b.what,
            b.worded() if np.isfinite(b.value) else "no bound",
            f"{figure(b.found, b.unit)} at {b.at:.3f} s",
            f"{b.start:.3f} s to {b.end:.3f} s",
            b.note or "–",
        )
        for b in bounds
    )
    head = ("what", "at every instant", "worst met", "from, to", "note")
    method = f"Bounds for the shapes as modelled and the motion as planned or recorded. Method: {METHOD}."
    return ReportSection(BOUNDS_TITLE, (method,), (ReportTable(head, rows),))


def picture(found: PermissibleSpeed) -> bytes:
    """The map over time, PNG."""
    need("matplotlib")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)  # type: ignore[no-untyped-call, unused-ignore]
    axes = figure.add_subplot()
    for k, stations in enumerate(found.map.stations):
        names = ("permissible", "given") if k == 0 else ("_", "_")
        permitted = stations.permissible
        axes.plot(stations.t, permitted, color="#B3261E", label=names[0])
        axes.plot(stations.t, stations.given, color="#44505C", label=names[1])
        _shade(axes, stations.t, permitted)
    axes.set_xlabel("given motion [s]")
    axes.set_ylabel("path speed [rad/s or m/s]")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    out = io.BytesIO()
    figure.savefig(out, format="png")
    return out.getvalue()


def _shade(axes: object, t: Array, permitted: Array) -> None:
    """Hatch where it cannot be told."""
    for i in np.flatnonzero(np.isnan(permitted)).tolist():
        low, high = t[max(i - 1, 0)], t[min(i + 1, len(t) - 1)]
        axes.axvspan(low, high, facecolor="none", edgecolor="#8A6D00", hatch="....", linewidth=0)  # type: ignore[attr-defined]
