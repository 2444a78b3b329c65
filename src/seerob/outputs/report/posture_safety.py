"""Posture against safety: the scores of a person beside the distances to it, at the same instants.

A posture that is better for the back may bring the head nearer to the robot: each figure alone hides it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from seerob.core.figures import figure, rounded_up
from seerob.core.snapshot import CriterionInfo, Scene
from seerob.core.transforms import Array
from seerob.description.humans.body_areas import area_in
from seerob.outputs.html import Html, joined, table, tag, whole
from seerob.outputs.palette import WORD
from seerob.outputs.words import said, told
from seerob.recording.result_log import ResultLog
from seerob.recording.series import CODES, Series

Cell = str | float | int | None
_VERDICT_OF = {code: verdict for verdict, code in CODES.items()}
SHOWN = 12
"""Instants in the report at most; the workbook has more."""


@dataclass(frozen=True)
class Sides:
    """What is known of one person: how it is for the person, and how near the robot is."""

    person: str
    scores: tuple[Series, ...]
    measures: tuple[Series, ...]


def sides(scene: Scene, log: ResultLog) -> tuple[Sides, ...]:
    """People of whom both a posture is scored and something of safety is judged."""
    found = []
    for person in (m.name for m in scene.mechanisms if m.role == "human"):
        of = [info for info in scene.criteria if any(_about(s, person) for s in info.subjects)]
        scores, measures = (_known(of, log, group) for group in ("ergonomics", "safety"))
        if scores and measures:
            found.append(Sides(person, scores, measures))
    return tuple(found)


def _about(subject: str, person: str) -> bool:
    return subject == person or subject.startswith(f"{person}/")


def _known(infos: Sequence[CriterionInfo], log: ResultLog, group: str) -> tuple[Series, ...]:
    found = (log.get(info.name) for info in infos if info.group == group)
    return tuple(series for series in found if series is not None and series.known)


def share(values: Array, limits: Array, *, at_most: bool) -> Array:
    """How much of a limit is used: 1 at the limit, more beyond it; NaN when one of both is not known.

    Of a distance it is the limit over the distance, and infinite where nothing is left of that.
    """
    over, under = (values, limits) if at_most else (limits, values)
    with np.errstate(divide="ignore", invalid="ignore"):
        used = np.maximum(over, 0.0) / under
    nothing = (over > 0) | (not at_most)
    known = ~(np.isnan(over) | np.isnan(under))
    return np.where(known & (under <= 0), np.where(nothing, np.inf, np.nan), used)


def head(one: Sides) -> list[Cell]:
    """Titles of `rows`."""
    titles: list[Cell] = ["person", "t [s]", *(f"{s.name} [points]" for s in one.scores)]
    for series in one.measures:
        unit = f" [{series.unit}]" if series.unit else ""
        titles += [
            f"{series.name}{unit}",
            f"{series.name}: share of the limit [1]",
            f"{series.name}: verdict",
            f"{series.name}: body part",
            f"{series.name}: body area",
        ]
    return titles


def rows(one: Sides, most: int) -> Iterator[list[Cell]]:
    """The person at chosen instants, in time order; no extreme of any score or measure is lost.

    Args:
        one: A person.
        most: Instants at most.
    """
    every = (*one.scores, *one.measures)
    each = max(most // len(every), 7)
    chosen = sorted({float(t) for s in every for t in s.t[s.thinned(each)]})
    yield from _at(one, chosen)


def worst_rows(one: Sides, most: int = SHOWN) -> list[list[Cell]]:
    """Rows at the highest score, and where most of a limit is used; without a limit, at the extreme."""
    chosen: dict[float, None] = {}
    for series in (*one.scores, *one.measures):
        n = len(series)
        values, limits = series.values[:n], series.limits[:n]
        used = share(values, limits, at_most=series.at_most)
        extreme = values if series.at_most else -values
        wanted = extreme if series in one.scores or np.isnan(used).all() else used
        if not np.isnan(wanted).all():
            chosen[float(series.t[int(np.nanargmax(wanted))])] = None
    return list(_at(one, sorted(list(chosen)[:most])))


def _at(one: Sides, instants: Sequence[float]) -> Iterator[list[Cell]]:
    t = np.array(instants)
    # A criterion with a period speaks until its next result.
    at = {s.name: np.searchsorted(s.t, t, side="right") - 1 for s in (*one.scores, *one.measures)}
    scores = [(s.values, at[s.name]) for s in one.scores]
    measures = [(s, s.values, s.limits, s.verdicts, s.reasons, at[s.name]) for s in one.measures]
    for i, instant in enumerate(instants):
        row: list[Cell] = [one.person, instant]
        row += [float(values[k[i]]) if k[i] >= 0 else None for values, k in scores]
        for series, values, limits, codes, reasons, k in measures:
            if k[i] < 0:
                row += [None] * 5
                continue
            value, limit = float(values[k[i]]), float(limits[k[i]])
            verdict = _VERDICT_OF[int(codes[k[i]])]
            word = "" if verdict is None else verdict.value
            used = float(share(np.array(value), np.array(limit), at_most=series.at_most))
            row += [value, used, word, *_place(series, reasons[k[i]], one.person)]
        yield row


def _place(series: Series, reason: str, person: str) -> tuple[str, str]:
    """Bone and body area that a reason speaks of."""
    region = reason.partition(": ")[0]
    return ("", region) if region in series.parts else area_in(reason, person)


def posture_safety_section(scene: Scene, log: ResultLog) -> Html | None:
    """The report's table; nothing where no person has both."""
    parts = []
    for one in sides(scene, log):
        head_ = [said("at"), *(s.name for s in one.scores), *(s.name for s in one.measures), said("where")]
        parts += [
            tag("h3", one.person),
            table(head_, [_line(one, row) for row in worst_rows(one)], class_="instants"),
        ]
    if not parts:
        return None
    text = said(
        "The same instants: those at which a score is highest, or most of a limit is used. In brackets "
        "how much of its limit is used; 100 % is the limit. – is not known or not assessed."
    )
    return joined([tag("p", text), *parts])


def _line(one: Sides, row: list[Cell]) -> list[str | Html]:
    n = len(one.scores)
    cells: list[str | Html] = [whole(f"{row[1]:.2f} s")]
    cells += [_figure(value, "") for value in row[2 : 2 + n]]
    places: dict[str, None] = {}
    for series, k in zip(one.measures, range(2 + n, len(row), 5), strict=True):
        value, used, word, bone, area = row[k : k + 5]
        percent = "" if not isinstance(used, float) or math.isnan(used) else f" ({_percent(used)})"
        verdict = next((v for v in WORD if v is not None and v.value == word), None)
        shown = f"{_figure(value, series.unit)}{percent}" + (f", {said(WORD[verdict])}" if verdict else "")
        cells.append(shown)
        if bone or area:
            places[": ".join(filter(None, (str(bone), told(str(area)))))] = None
    return [*cells, "; ".join(places) or "–"]


def _figure(value: Cell, unit: str) -> str:
    return "–" if not isinstance(value, float) or math.isnan(value) else figure(value, unit)


def _percent(used: float) -> str:
    return said("no distance left") if math.isinf(used) else rounded_up(100 * used, "%")
