"""What a colleague would write about a run: sentences from numbers, no judgement beyond the verdict."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

from seerob.core.figures import against, ends, figure, margin, with_unit
from seerob.core.snapshot import Finding, Verdict
from seerob.outputs.words import said as spoken_as
from seerob.outputs.words import told, word
from seerob.recording.result_log import ResultLog
from seerob.recording.series import CODES, Series, Worst

_NUMBERS = (
    "no",
    "one",
    "two",
    "three",
    "four",
    "five",
    "six",
    "seven",
    "eight",
    "nine",
    "ten",
    "eleven",
    "twelve",
)

_LEVELS = ("warning", "assumed", "note")
_LISTED = 15
"""Names in a sentence."""


def grouped(findings: Iterable[Finding], most: int | None = None) -> list[Finding]:
    """What was found, equal texts as one that names what it is about; what holds a verdict first.

    Args:
        findings: In any order.
        most: So many names at most; all of them when not given.
    """
    about: dict[tuple[str, str, bool], list[str]] = {}
    for one in findings:
        about.setdefault((one.level, one.text, bool(one.holds)), []).append(one.subject)
    order = sorted(about, key=lambda key: (not key[2], _LEVELS.index(key[0]) if key[0] in _LEVELS else -1))
    found = []
    for level, text, holds in order:
        subjects = list(dict.fromkeys(about[level, text, holds]))
        more = f" and {len(subjects) - most} more" if most is not None and len(subjects) > most else ""
        who = f"{', '.join(subjects[:most])}{more}"
        found.append(Finding(level=level, subject=who, text=text, holds=("*",) * holds))
    return found


def number(value: float | None, unit: str = "") -> str:
    """Four significant digits with the unit, for inputs; a dash for what is not there."""
    if value is None or math.isnan(value):
        return "–"
    text = f"{value:.4g}".replace("-", "−")
    return f"{text} {unit}".rstrip()


def reached(worst: Worst, series: Series) -> str:
    """The worst value with its unit, not kinder than it is."""
    if worst.value is None or worst.limit is None:
        return figure(worst.value, series.unit)
    return with_unit(
        against(worst.value, worst.limit, series.unit, at_most=series.at_most).value, series.unit
    )


def extremum(worst: Worst, series: Series) -> str:
    """The worst value; where nothing is judged, with the side on which it is the extreme one."""
    text = reached(worst, series)
    if series.verdict is not None or worst.value is None:
        return text
    return f"{spoken_as('largest') if series.at_most else spoken_as('smallest')} {text}"


def bound(worst: Worst, series: Series) -> str:
    """The limit at the worst instant with its unit, not kinder than it is."""
    if worst.value is None or worst.limit is None:
        return figure(worst.limit, series.unit)
    return with_unit(
        against(worst.value, worst.limit, series.unit, at_most=series.at_most).limit, series.unit
    )


def shortened(text: str, most: int) -> str:
    """A text of at most so many characters: what is left out is in its middle, its end often is a figure."""
    end = (most - 1) // 2
    return text if len(text) <= most else f"{text[: most - 1 - end]}…{text[len(text) - end :]}"


def percent(share: float) -> str:
    """A share 0…1; never rounded to 0 or to 100 % when it is neither."""
    if 0 < share < 0.001:
        return "< 0.1 %"
    if 0.999 < share < 1:
        return "> 99.9 %"
    return f"{100 * share:.1f} %".replace(".0 %", " %")


def counted(n: int, what: str, many: str | None = None) -> str:
    """``one criterion``, ``two criteria``."""
    name = _NUMBERS[n] if n < len(_NUMBERS) else str(n)
    return f"{name} {what if n == 1 else many or what + 's'}"


def listed(names: Sequence[str]) -> str:
    """``a, b and c``; of very many the first, as the table has all."""
    if len(names) > _LISTED:
        names = [*names[: _LISTED - 1], f"{len(names) - _LISTED + 1} more"]
    if len(names) == 1:
        return names[0]
    return spoken_as("{first} and {last}", first=", ".join(names[:-1]), last=names[-1])


def summary(log: ResultLog) -> list[str]:
    """What the first paragraph says."""
    span = (log.end or 0.0) - (log.start or 0.0)
    by: dict[Verdict | None, list[str]] = {v: [] for v in (*Verdict, None)}
    for series in log.values():
        by[series.verdict].append(series.name)
    if not log.ticks:
        return [spoken_as("Nothing was evaluated: the run has no tick.")]
    counts = counted(len(log), "criterion was", "criteria were")
    said = [
        spoken_as(
            "Over {span} of motion ({ticks} ticks) {counted} evaluated.",
            span=figure(span, "s"), ticks=log.ticks, counted=counts, n=len(log),
        )
    ]  # fmt: skip
    if names := by[Verdict.EXCEEDED]:
        counts = counted(len(names), "limit was", "limits were").capitalize()
        said.append(
            spoken_as("{counted} exceeded: {names}.", counted=counts, n=len(names), names=listed(names))
        )
    if names := by[Verdict.UNDECIDED]:
        counts = counted(len(names), "criterion", "criteria").capitalize()
        text = word(
            "{counted} could not be decided for at least a part of the run: {names}. Undecided is not a "
            "pass; what is missing is said below."
        )
        said.append(spoken_as(text, counted=counts, n=len(names), names=listed(names)))
    partly = [name for name in by[Verdict.WITHIN] if covered(log[name])]
    if n := len(by[Verdict.WITHIN]) - len(partly):
        counts = counted(n, "criterion", "criteria").capitalize()
        said.append(spoken_as("{counted} stayed within the limit throughout.", counted=counts, n=n))
    if partly:
        shares = listed(
            [
                spoken_as("{name} ({share} of the run)", name=name, share=percent(log[name].times().decided))
                for name in partly
            ]
        )
        text = word(
            "{counted} stayed within the limit, but not throughout the run: asked and decided in a part of "
            "it only, {shares}."
        )
        counts = counted(len(partly), "criterion", "criteria").capitalize()
        said.append(spoken_as(text, counted=counts, n=len(partly), shares=shares))
    if names := by[None]:
        counts = counted(len(names), "figure").capitalize()
        said.append(
            spoken_as(
                "{counted} without a limit for information: {names}.",
                counted=counts, n=len(names), names=listed(names),
            )
        )  # fmt: skip
    return said


def covered(series: Series) -> str:
    """Say for which share of the run a verdict holds: ``decided 40 % of the run, did not apply in 60 %``.

    Empty when that is all of it, or when there is no verdict.
    """
    times = series.times()
    if series.verdict is None or times.decided > 1 - 1e-12:
        return ""
    said = [spoken_as("decided {share} of the run", share=percent(times.decided))]
    for share, what in (
        (times.undecided, word("undecided in {share}")),
        (times.open, word("not asked in {share}")),
        (times.muted, word("did not apply in {share}")),
        (times.nothing, word("nothing to judge in {share}")),
    ):
        if share > 1e-12:
            said.append(spoken_as(what, share=percent(share)))
    return ", ".join(said)


def about(series: Series) -> list[str]:
    """What the paragraph of one criterion says."""
    if not series.known:
        text = word(
            "This criterion was set up but never gave a result, so nothing can be said. It is not a pass: "
            "find out why it was silent."
        )
        return [spoken_as(text)]
    worst, shares = series.worst(), series.shares()
    said = []
    if share := shares.get(Verdict.EXCEEDED):
        text = (
            word("The value was above the limit in {share} of the evaluated ticks, {stretches}.")
            if series.at_most
            else word("The value was below the limit in {share} of the evaluated ticks, {stretches}.")
        )
        said.append(spoken_as(text, share=percent(share), stretches=_stretches(series, Verdict.EXCEEDED)))
        said.append(
            spoken_as(
                "Worst at {t} s: {value}{against}.",
                t=f"{worst.t:.2f}", value=reached(worst, series), against=_against(series),
            )
        )  # fmt: skip
    if share := shares.get(Verdict.UNDECIDED):
        said.append(
            spoken_as(
                "In {share} of the evaluated ticks nothing can be said, {stretches}. {reasons}",
                share=percent(share), stretches=_stretches(series, Verdict.UNDECIDED),
                reasons=_reasons(series),
            )
        )  # fmt: skip
    if series.asked:
        asked = told(series.asked)
        said.append(f"{asked[0].upper()}{asked[1:]}.")
    if gap := told(series.gap()):
        said.append(f"{gap[0].upper()}{gap[1:]}.")
    if part := covered(series):
        said.append(f"{part[0].upper()}{part[1:]}.")
    if series.verdict is Verdict.WITHIN:
        text = (
            word("Within the limit whenever it applied. Closest to it at {t} s: {value}{against}.")
            if part
            else word("Within the limit throughout. Closest to it at {t} s: {value}{against}.")
        )
        said.append(
            spoken_as(text, t=f"{worst.t:.2f}", value=reached(worst, series), against=_against(series))
        )
    if series.verdict is None:
        text = (
            word("No limit was given. Largest value {value} at {t} s.")
            if series.at_most
            else word("No limit was given. Smallest value {value} at {t} s.")
        )
        said.append(spoken_as(text, value=reached(worst, series), t=f"{worst.t:.2f}"))
    if worst.interval is not None and worst.value is not None:
        low, high = ends(*worst.interval, series.unit)
        there = spoken_as("{low} and {high}", low=low, high=high)
        said.append(
            spoken_as(
                "Given the tolerances of the inputs, the true value there is between {limits}.", limits=there
            )
        )
    if worst.verdict is not Verdict.UNDECIDED and (worst.reason or worst.part):
        governs = worst.reason or worst.part
        extra = f" ({worst.part})" if worst.part and worst.part not in governs else ""
        said.append(spoken_as("What governs there: {what}.", what=f"{told(governs)}{extra}"))
    return said


def _stretches(series: Series, verdict: Verdict) -> str:
    found = series.intervals(verdict)
    longest = figure(max(b - a for a, b in found), "s")
    if len(found) == 1:
        return spoken_as("in one stretch; the longest lasted {longest}", longest=longest)
    return spoken_as(
        "in {counted}; the longest lasted {longest}",
        counted=counted(len(found), "stretch", "stretches"), n=len(found), longest=longest,
    )  # fmt: skip


def _against(series: Series) -> str:
    worst = series.worst()
    if worst.limit is None or worst.value is None:
        return ""
    gap = worst.limit - worst.value if series.at_most else worst.value - worst.limit
    size = margin(worst.value, worst.limit, series.unit, at_most=series.at_most)
    text = (
        word(", {size} inside the limit of {limit}")
        if gap >= 0
        else word(", {size} beyond the limit of {limit}")
    )
    return spoken_as(text, size=size, limit=bound(worst, series))


def _reasons(series: Series) -> str:
    """The most frequent reasons; those that differ in their numbers only count as one."""
    seen: dict[str, list[str]] = {}
    for verdict, reason in zip(series.verdicts.tolist(), series.reasons, strict=False):
        if verdict == CODES[Verdict.UNDECIDED]:
            seen.setdefault(re.sub(r"\d+(\.\d+)?", "0", reason), []).append(
                reason or spoken_as("no reason given")
            )
    most = sorted(seen.values(), key=len, reverse=True)
    alike = spoken_as(" and alike")
    texts = [told(one[0]) + (alike if len(set(one)) > 1 else "") for one in most[:3]]
    more = spoken_as("; and {n} more", n=len(most) - 3) if len(most) > 3 else ""
    head = spoken_as("Reason") if len(most) == 1 else spoken_as("Reasons")
    return f"{head}: {'; '.join(texts)}{more}."
