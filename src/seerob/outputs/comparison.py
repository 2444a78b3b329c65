"""Two evaluations beside each other: what differs between them, which verdicts turned, and by how much.

Nothing of it flatters the second: a criterion that is asked no more, or has no limit any more, counts as
undecided there; what is within by another limit, unit or kind is said to be so; and a shorter run is.
"""

from __future__ import annotations

import json
import math
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NamedTuple

from seerob.core.figures import figure, margin
from seerob.core.printable import printable
from seerob.core.snapshot import CriterionInfo, Finding, Scene, Verdict
from seerob.outputs.html import Content, Html, table, tag, whole
from seerob.outputs.report.page import document
from seerob.outputs.report.plots import both
from seerob.outputs.report.report import badge
from seerob.outputs.sentences import bound, extremum, grouped, percent
from seerob.recording.result_log import ResultLog
from seerob.recording.series import Series


class Turn(StrEnum):
    """What became of a criterion, from the first to the second."""

    EXCEEDED = "exceeded"
    """It is EXCEEDED, and was not."""
    UNDECIDED = "undecided"
    """It is UNDECIDED, without a limit or not asked any more, and was not."""
    WITHIN = "within"
    """It is within, and was not."""
    SAME = "same"
    NEW = "new"
    """It is asked of the second alone, and within there, or informs."""


_ORDER = tuple(Turn)


class Change(NamedTuple):
    """A key of a workstation file that says another thing; None where it is not there."""

    key: str
    """``safety["tcp speed"].limit``."""
    before: object
    after: object

    def __str__(self) -> str:
        """``safety["tcp speed"].limit: 1.0 → 0.5``."""
        return f"{self.key}: {_toml(self.before)} → {_toml(self.after)}"


def _toml(value: object) -> str:
    if value is None:
        return "not there"
    text = json.dumps(_plain(value), ensure_ascii=False)
    return printable(text if len(text) <= 120 else f"{text[:119]}…")


def _plain(value: object) -> object:
    """What JSON can say: TOML has times, and numbers that are not finite, in words."""
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    if value is None or isinstance(value, str | int) or (isinstance(value, float) and math.isfinite(value)):
        return value
    return str(value)


@dataclass(frozen=True)
class Side:
    """One of the two evaluations."""

    title: str
    """How the user named it."""
    scene: Scene
    results: ResultLog
    duration: float
    """Run time [s]."""
    findings: tuple[Finding, ...] = ()
    """What holds verdicts of it."""

    def criterion(self, name: str) -> CriterionInfo | None:
        """What was asked under a name; None when nothing was."""
        return next((info for info in self.scene.criteria if info.name == name), None)


@dataclass(frozen=True)
class Compared:
    """One criterion of both."""

    name: str
    turn: Turn
    before: Series | None
    """What the first said; None where it was not asked."""
    after: Series | None
    notes: tuple[str, ...] = ()
    """Why the two are not about one thing, and parts that turned."""
    parts: tuple[str, ...] = ()
    """Parts that are EXCEEDED in the second and were not."""

    @property
    def verdicts(self) -> tuple[str, str]:
        """In words."""
        return _word(self.before), _word(self.after)


def _word(series: Series | None) -> str:
    if series is None:
        return "not asked"
    return "no verdict" if series.verdict is None else series.verdict.value


def margin_of(series: Series | None) -> float | None:
    """Distance to the limit at the worst instant, negative beyond it, in the unit of the criterion."""
    if series is None or not series.known:
        return None
    worst = series.worst()
    if worst.value is None or worst.limit is None:
        return None
    return worst.limit - worst.value if series.at_most else worst.value - worst.limit


@dataclass(frozen=True, repr=False)
class Comparison:
    """What differs between two evaluations.

    Attributes:
        before: The first of the two.
        after: The second.
        conditions: What else is not alike: edition, version, tick, duration, findings; one sentence each.
        changes: Keys of the workstation file that say other things; None where one has no file.
        files: Other files that the workstation names, and what became of each.
        criteria: Those that became worse first.
        pictures: Of criteria that turned, at the worst instants of the first and the second, seen from
            one viewpoint (PNG); None where that one drew nothing.
    """

    before: Side
    after: Side
    conditions: tuple[str, ...]
    changes: tuple[Change, ...] | None
    files: tuple[str, ...]
    criteria: tuple[Compared, ...]
    pictures: Mapping[str, tuple[bytes | None, bytes | None]] = field(default_factory=dict)

    @property
    def turn(self) -> Turn:
        """What became of it as a whole: EXCEEDED before UNDECIDED before the rest."""
        return min((one.turn for one in self.criteria), key=_ORDER.index, default=Turn.SAME)

    def __repr__(self) -> str:
        return f"<Comparison of {self.before.title!r} and {self.after.title!r}: {self.turn.value}>"

    def _repr_html_(self) -> str:
        return tag("div", list(self._content()))

    def html(self) -> str:
        """One page that stands alone: no script, nothing from elsewhere."""
        title = f"{self.before.title} compared with {self.after.title}"
        return document(title, [tag("h1", title), list(self._content())])

    def json(self) -> dict[str, Any]:
        """All of it but pictures, as what JSON can say; a figure that there is not is None."""
        sides = {
            key: {
                "title": side.title,
                "workstation": side.scene.title,
                "workstation_hash": side.scene.workstation_hash,
                "edition": side.scene.edition,
                "version": side.scene.version,
                "duration": side.duration,
                "verdict": side.results.verdict,
                "decided": side.results.decided,
            }
            for key, side in (("before", self.before), ("after", self.after))
        }
        changes = None
        if self.changes is not None:
            changes = [
                {"key": c.key, "before": _plain(c.before), "after": _plain(c.after)} for c in self.changes
            ]
        return {
            **sides,
            "turn": self.turn,
            "conditions": list(self.conditions),
            "changes": changes,
            "files": list(self.files),
            "criteria": [
                {
                    "name": one.name,
                    "turn": one.turn,
                    "notes": list(one.notes),
                    "parts_exceeded": list(one.parts),
                    "before": _figures(one.before),
                    "after": _figures(one.after),
                }
                for one in self.criteria
            ],
        }

    def _content(self) -> Iterator[Html]:
        yield tag("p", self.sentence(), class_="notice")
        head = ("", self.before.title, self.after.title)
        sides = (self.before, self.after)
        yield table(
            head,
            [
                ("verdict", *(badge(side.results.verdict) for side in sides)),
                ("workstation", *(side.scene.title for side in sides)),
                ("run time", *(figure(side.duration, "s") for side in sides)),
                ("edition", *(side.scene.edition for side in sides)),
                ("seerob", *(side.scene.version for side in sides)),
                ("files, SHA-256", *(side.scene.workstation_hash[:16] for side in sides)),
            ],
        )
        if self.conditions:
            yield tag("h2", "What else differs")
            yield tag("ul", [tag("li", text) for text in self.conditions])
        yield tag("h2", "What changed in the workstation")
        if self.changes is None:
            yield tag("p", _NO_FILE)
        elif not (self.changes or self.files):
            yield tag("p", "Nothing that is read.")
        if self.changes:
            rows = [(tag("code", c.key), _toml(c.before), _toml(c.after)) for c in self.changes]
            yield table(("key", "before", "after"), rows)
        if self.files:
            yield tag("ul", [tag("li", text) for text in self.files])
        yield tag("h2", "Criteria")
        columns = ("criterion", "is now", "before", "after", "decided", "notes")
        yield table(columns, [self._row(one) for one in self.criteria], class_="overview")
        for k, one in enumerate(self.criteria):
            runs = [
                (what, series)
                for what, series in (("before", one.before), ("after", one.after))
                if series is not None and series.known and len(series.t) > 1
            ]
            together = len(runs) == 2 and runs[0][1].unit == runs[1][1].unit
            if not (together or one.name in self.pictures):
                continue
            yield tag("h3", one.name)
            if together:
                yield tag("figure", both(runs, salt=f"both{k}"))
            if one.name in self.pictures:
                shown = [
                    _figure(one, png, series, what)
                    for png, series, what in zip(
                        self.pictures[one.name], (one.before, one.after), ("before", "after"), strict=True
                    )
                ]
                yield tag("div", shown, class_="evidence", style="grid-template-columns: 1fr 1fr")

    def _row(self, one: Compared) -> tuple[Content, ...]:
        said = [
            [badge(series.verdict) if series else "not asked", tag("p", margin_words(series))]
            for series in (one.before, one.after)
        ]
        return one.name, whole(one.turn.value), *said, decided_words(one), "; ".join(one.notes)

    def sentence(self) -> str:
        """What it comes to."""
        counts = {turn: sum(one.turn is turn for one in self.criteria) for turn in Turn}
        said = [
            f"{counts[turn]} {words}"
            for turn, words in (
                (Turn.EXCEEDED, "exceeded now that were not"),
                (Turn.UNDECIDED, "undecided or not judged now that were"),
                (Turn.WITHIN, "within now that were not"),
                (Turn.NEW, "asked of the second alone"),
                (Turn.SAME, "of which the verdict is what it was"),
            )
            if counts[turn]
        ]
        return f"Of {len(self.criteria)} criteria: {', '.join(said)}." if said else "Nothing is judged."


_NO_FILE = "Not known: one of the two keeps no file. Compare recordings or workstations."


def _figure(one: Compared, png: bytes | None, series: Series | None, what: str) -> Html:
    if png is None or series is None:
        return tag("p", f"{what}: nothing to show")
    worst = series.worst()
    caption = f"{what}: {extremum(worst, series)} at {worst.t:.2f} s"
    source = f"data:image/png;base64,{b64encode(png).decode()}"
    return tag(
        "figure", tag("img", src=source, alt=f"{one.name}, {caption}"), tag("figcaption", f"{caption}.")
    )


def margin_words(series: Series | None) -> str:
    """``0.020 m/s inside 1 m/s at 3.20 s``, ``0.500 m/s beyond …``; why there is none."""
    if series is None:
        return "–"
    if not series.known:
        return "never gave a result"
    worst, room = series.worst(), margin_of(series)
    if room is None or worst.value is None or worst.limit is None:
        text = f"{extremum(worst, series)} at {worst.t:.2f} s"
        return text if worst.value is not None or not worst.reason else f"{worst.reason} at {worst.t:.2f} s"
    size = margin(worst.value, worst.limit, series.unit, at_most=series.at_most)
    side = "inside" if room >= 0 else "beyond"
    return f"{size} {side} {bound(worst, series)} at {worst.t:.2f} s"


def decided_words(one: Compared) -> str:
    """Share of the time that each decided: ``100 % → 40 %``, or one figure where they are alike."""
    shares = [
        percent(s.times().decided) if s is not None and s.verdict is not None else "–"
        for s in (one.before, one.after)
    ]
    return shares[0] if shares[0] == shares[1] else " → ".join(shares)


def _figures(series: Series | None) -> dict[str, Any] | None:
    if series is None:
        return None
    worst = series.worst() if series.known else None
    return {
        "verdict": series.verdict,
        "unit": series.unit,
        "at_most": series.at_most,
        "margin": _finite(margin_of(series)),
        "t": worst and worst.t,
        "value": worst and _finite(worst.value),
        "limit": worst and _finite(worst.limit),
        "part": worst.part if worst else "",
        "reason": worst.reason if worst else "never gave a result",
        "times": series.times()._asdict(),
        "decided": series.times().decided,
    }


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else value


# -- what differs ---------------------------------------------------------------------------------


def compared(before: Side, after: Side) -> tuple[Compared, ...]:
    """Every criterion of either, those that became worse first, else in the order of the second."""
    names = dict.fromkeys((*after.results, *before.results))
    found = [_compared(name, before, after) for name in names]
    return tuple(sorted(found, key=lambda one: _ORDER.index(one.turn)))


def _compared(name: str, before: Side, after: Side) -> Compared:
    then, now = before.results.get(name), after.results.get(name)
    notes = [*_other_question(before.criterion(name), after.criterion(name), then, now)]
    parts: tuple[str, ...] = ()
    if now is None:
        notes.append("is asked no more")
    elif then is None:
        notes.append("was not asked before")
    else:
        parts = tuple(_parts_exceeded(then, now))
        if parts:
            notes.append(f"exceeded now: {', '.join(parts)}")
        share = then.times().decided - now.times().decided
        if share > 1e-12 and now.verdict is then.verdict is not None:
            notes.append("less of the time is decided")
    return Compared(name, _turn(then, now, parts), then, now, tuple(notes), parts)


def _turn(then: Series | None, now: Series | None, parts: Sequence[str]) -> Turn:
    # A series that never had a result is empty, and false as such.
    was, is_ = (None if each is None else each.verdict for each in (then, now))
    if (is_ is Verdict.EXCEEDED and was is not Verdict.EXCEEDED) or parts:
        return Turn.EXCEEDED
    if (is_ is Verdict.UNDECIDED or (is_ is None and was is not None)) and was is not is_:
        return Turn.UNDECIDED
    if then is None:
        return Turn.NEW
    return Turn.WITHIN if is_ is Verdict.WITHIN and was is not is_ else Turn.SAME


def _parts_exceeded(then: Series, now: Series) -> Iterator[str]:
    for name, part in now.parts.items():
        earlier = then.parts.get(name)
        if part.verdict is Verdict.EXCEEDED and (earlier is None or earlier.verdict is not Verdict.EXCEEDED):
            yield name


def _other_question(
    then: CriterionInfo | None, now: CriterionInfo | None, before: Series | None, after: Series | None
) -> Iterator[str]:
    """Why a criterion of one name is not one and the same question in both."""
    if before is not None and after is not None:
        for what, one, other in (
            ("unit", before.unit, after.unit),
            ("side of the limit", _side(before), _side(after)),
        ):
            if one != other:
                yield f"another {what}: {one or 'none'} → {other or 'none'}, margins do not compare"
    if then is None or now is None:
        return
    if then.kind != now.kind:
        yield f"another kind: {then.kind} → {now.kind}, margins do not compare"
    if then.limit != now.limit:
        yield f"another limit: {figure(then.limit, then.unit)} → {figure(now.limit, now.unit)}"
    if then.subjects != now.subjects:
        yield f"of others: {', '.join(then.subjects) or '–'} → {', '.join(now.subjects) or '–'}"
    if then.between != now.between:
        yield f"between instants: {then.between or 'bounded'} → {now.between or 'bounded'}"
    if then.basis is not None and now.basis is not None:
        if then.basis.formula != now.basis.formula:
            yield "another formula"
        if then.basis.source != now.basis.source:
            yield f"another source: {then.basis.source} → {now.basis.source}"


def _side(series: Series) -> str:
    return "at most" if series.at_most else "at least"


def conditions(before: Side, after: Side) -> tuple[str, ...]:
    """What two evaluations differ in besides their files, one sentence each."""
    one, other = before.scene, after.scene
    said = [
        f"{what}: {then} → {now}"
        for what, then, now in (
            ("edition", one.edition, other.edition),
            ("tick", f"{one.period:g} s", f"{other.period:g} s"),
            ("run time", figure(before.duration, "s"), figure(after.duration, "s")),
        )
        if then != now
    ]
    if one.version != other.version:
        said.append(
            f"judged by seerob {one.version} and by {other.version}; seerob report computes a recording again"
        )
    if after.duration < before.duration - one.period / 2:
        said.append("the second run is shorter: what would come after its end is not judged")
    for side, than in ((before, after), (after, before)):
        known = {(f.subject, f.text) for f in than.findings}
        alone = [f for f in side.findings if (f.subject, f.text) not in known]
        said += [f"only {side.title}: {f.subject}: {f.text}" for f in grouped(alone)]
    return tuple(said)
