"""The report's page, from the summary down to the evidence."""

from __future__ import annotations

import hashlib
from base64 import b64encode
from dataclasses import dataclass

from seerob.figures import figure
from seerob.results import ResultLog
from seerob.series import Series
from seerob.sinks import _plots
from seerob.sinks._html import Html, joined, table, tag
from seerob.sinks._page_style import STYLE
from seerob.sinks._palette import MARK, WORD
from seerob.sinks._sentences import about, bound, number, percent, reached, summary
from seerob.sinks._setup import UNKNOWN, Setup
from seerob.snapshot import Basis, CriterionInfo, Finding, Input, Origin, Scene, Verdict

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
_DOUBTFUL = (Origin.ASSUMED, Origin.MISSING, Origin.ESTIMATED)
_WHO = {
    Origin.MEASURED: "measured",
    Origin.STATED: "stated by its source",
    Origin.GIVEN: "given by the user",
    Origin.COMPUTED: "computed",
    Origin.ESTIMATED: "estimated",
    Origin.ASSUMED: "assumed, nobody gave it",
    Origin.MISSING: "missing",
}


@dataclass(frozen=True)
class Report:
    """Everything the page says."""

    scene: Scene
    log: ResultLog
    files: dict[str, bytes]
    bases: dict[str, Basis]
    """Per criterion, the one that its worst instant rests on."""
    pictures: dict[str, bytes]
    """PNG of the worst instant per criterion."""
    versions: dict[str, str]
    date: str
    """When the report was written."""
    findings: tuple[Finding, ...]
    """Of the model and of the run."""
    setup: Setup
    """Engine and sources."""
    command: str
    """What wrote the report."""


def page(report: Report) -> str:
    """The whole document."""
    scene = report.scene
    title = f"Evaluation of {scene.title}"
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="referrer", content="no-referrer"),
        tag("title", title),
        tag("style", Html(STYLE)),
    )
    body = tag(
        "body",
        tag("h1", title),
        tag("p", f"seerob {scene.version} · limits from {scene.edition} · {report.date}", class_="lead"),
        _opening(report),
        _verdicts(report),
        _criteria(report),
        _assumed(report),
        _not_covered(report),
        _evaluated(report),
    )
    return "<!DOCTYPE html>\n" + tag("html", head, body, lang="en") + "\n"


def badge(verdict: Verdict | None) -> Html:
    """Mark and word; colour comes third."""
    name = "none" if verdict is None else verdict.value
    return tag("span", f"{MARK[verdict]} {WORD[verdict]}", class_=f"badge {name}")


def _opening(report: Report) -> Html:
    verdict = report.log.verdict
    head = {
        Verdict.EXCEEDED: "At least one limit is exceeded.",
        Verdict.UNDECIDED: "No limit was seen exceeded, but not everything could be decided.",
        Verdict.WITHIN: "Every limit that was evaluated was kept in this run.",
        None: "No limit was given, so there is no verdict.",
    }[verdict]
    return joined(
        [
            tag(
                "div",
                tag("p", badge(verdict), " ", tag("strong", head)),
                [tag("p", sentence) for sentence in summary(report.log)],
                class_=f"verdict {'none' if verdict is None else verdict.value}",
            ),
            tag(
                "p",
                "This is an evaluation in simulation of one run of one described workstation. It supports a risk "
                "assessment; it neither replaces it nor the measurements at the real workstation. What was "
                "assumed, and what must be measured, has its own section.",
                class_="notice",
            ),
        ]
    )


def _verdicts(report: Report) -> Html:
    rows = []
    for series in report.log.ranked():
        link = tag("a", series.name, href=f"#{_anchor(report, series)}")
        if not series.known:
            rows.append([link, badge(series.verdict), "–", "–", "–", "–", "–", "never gave a result"])
            continue
        worst, shares = series.worst(), series.shares()
        rows.append(
            [
                link,
                badge(series.verdict),
                _whole(reached(worst, series)),
                _whole(_limit(series)),
                _whole(f"{worst.t:.2f} s"),
                percent(shares.get(Verdict.EXCEEDED, 0.0)),
                percent(shares.get(Verdict.UNDECIDED, 0.0)),
                worst.reason or worst.part,
            ]
        )
    head = [
        "criterion",
        "verdict",
        "worst value",
        "limit",
        "at",
        "exceeded",
        "undecided",
        "what governs, or why",
    ]
    shown = [s for s in report.log.ranked() if s.known]
    return joined(
        [
            tag("h2", "Verdicts"),
            table(head, rows, class_="overview"),
            tag("p", "Shares are of the evaluated ticks.", class_="lead"),
            tag("figure", _plots.lanes(shown, salt="lanes"), tag("figcaption", "The verdicts over the run."))
            if shown
            else None,
        ]
    )


def _limit(series: Series) -> str:
    worst = series.worst()
    return "–" if worst.limit is None else ("≤ " if series.at_most else "≥ ") + bound(worst, series)


def _whole(figure: str) -> Html:
    """A figure that is not broken between lines."""
    return tag("span", figure, class_="whole")


def _criteria(report: Report) -> Html:
    infos = {info.name: info for info in report.scene.criteria}
    sections = [tag("h2", "Criterion by criterion")]
    for series in report.log.ranked():
        sections.append(
            tag(
                "section",
                tag("h3", series.name, " ", badge(series.verdict)),
                _described(infos.get(series.name)),
                [tag("p", sentence) for sentence in about(series)],
                _picture(report, series),
                tag("figure", _plots.curve(series, salt=_anchor(report, series))) if series.known else None,
                _parts(series),
                _basis(report.bases.get(series.name)),
                id=_anchor(report, series),
                class_="criterion",
            )
        )
    return joined(sections)


def _described(info: CriterionInfo | None) -> Html | None:
    if info is None:
        return None
    about_ = f" Speaks of {', '.join(info.subjects)}." if info.subjects else ""
    return tag("p", f"{info.title}{about_}", class_="lead")


def _picture(report: Report, series: Series) -> Html | None:
    png = report.pictures.get(series.name)
    if png is None:
        return None
    worst = series.worst()
    what = f"{series.name} at {worst.t:.2f} s, its worst instant: {reached(worst, series)}"
    source = f"data:image/png;base64,{b64encode(png).decode()}"
    return tag("figure", tag("img", src=source, alt=what), tag("figcaption", f"{what}."))


def _parts(series: Series) -> Html | None:
    if not series.parts:
        return None
    rows = []
    for part in series.parts.values():
        worst = part.worst()
        share = percent(part.shares().get(Verdict.EXCEEDED, 0.0))
        rows.append(
            [
                part.name,
                badge(part.verdict),
                _whole(reached(worst, part)),
                _whole(bound(worst, part)),
                f"{worst.t:.2f} s",
                share,
            ]
        )
    head = ["part", "verdict", "worst value", "limit", "at", "exceeded"]
    return joined([tag("h4", "By part"), table(head, rows)])


def _basis(basis: Basis | None) -> Html:
    if basis is None:
        return tag("p", "The criterion did not say what its figure rests on.", class_="doubt")
    content: list[Html | None] = [
        tag("h4", "Where the figure comes from"),
        tag("p", basis.formula, class_="formula"),
        tag("p", basis.source),
        table(["input", "value", "origin", "source"], [_input(i) for i in basis.inputs])
        if basis.inputs
        else None,
    ]
    if basis.not_modelled:
        content += [
            tag("h4", "What it leaves out"),
            tag("ul", [tag("li", item) for item in basis.not_modelled]),
        ]
    return joined(content)


def _input(item: Input) -> list[str | Html]:
    value = item.value if isinstance(item.value, str) else number(item.value, item.unit)
    origin = (
        tag("span", f"! {_WHO[item.origin]}", class_="doubt")
        if item.origin in _DOUBTFUL
        else _WHO[item.origin]
    )
    return [item.name, value, origin, item.source or "–"]


def _assumed(report: Report) -> Html:
    rows: list[list[str | Html]] = []
    for finding in report.findings:
        mark = {"note": "note", "assumed": "! assumed", "warning": "! warning"}.get(
            finding.level, finding.level
        )
        rows.append([finding.subject, mark, finding.text])
    doubts: list[list[str | Html]] = []
    for name, basis in report.bases.items():
        for item in basis.inputs:
            if item.origin in _DOUBTFUL:
                doubts.append([name, *_input(item)])
    return joined(
        [
            tag("h2", "What was assumed, and by whom"),
            tag("p", "Nothing was assumed, repaired or found odd.") if not rows and not doubts else None,
            table(["about", "kind", "what was found while the model was built"], rows) if rows else None,
            joined(
                [
                    tag("h4", "Figures that nobody measured or stated"),
                    table(["criterion", "input", "value", "origin", "source"], doubts),
                ]
            )
            if doubts
            else None,
        ]
    )


def _not_covered(report: Report) -> Html:
    left_out: dict[str, list[str]] = {}
    for name, basis in report.bases.items():
        for item in basis.not_modelled:
            left_out.setdefault(item, []).append(name)
    silent = [s.name for s in report.log.values() if s.verdict is Verdict.UNDECIDED]
    return joined(
        [
            tag("h2", "What is not covered and must be measured"),
            tag(
                "p",
                "A twin shows the motion that it was given. Another program, another person, a failing part or a "
                "control system that reacts differently are other runs. Stopping times and distances, contact "
                "forces and pressures, and the response of protective devices are properties of the real machine: "
                "measure them there.",
            ),
            tag("p", f"Still to be decided by other means: {', '.join(silent)}.", class_="doubt")
            if silent
            else None,
            table(["left out", "by"], [[item, ", ".join(names)] for item, names in left_out.items()])
            if left_out
            else None,
        ]
    )


def _evaluated(report: Report) -> Html:
    scene, log, how = report.scene, report.log, report.setup
    span = f"{figure(log.start, 's')} to {figure(log.end, 's')}, {log.ticks} ticks, period {scene.period:g} s"
    facts: list[list[str | Html]] = [
        ["workstation", scene.title],
        ["edition of the limits", scene.edition],
        ["run time", span],
        *([what, value] for what, value in how.engine),
        *([f"largest tracking error, {e.name}", f"{number(e.error)} rad or m at {e.t:.2f} s"] for e in log.tracking),
    ]
    written: list[list[str | Html]] = [
        ["written", report.date],
        ["by", tag("code", report.command)],
        ["hash of all inputs (SHA-256)", tag("code", scene.workstation_hash)],
        *([f"version of {name}", version] for name, version in report.versions.items()),
    ]
    files = [
        [name, f"{len(data)} bytes", tag("code", hashlib.sha256(data).hexdigest())]
        for name, data in sorted(report.files.items())
    ]
    bodies = [
        [node.name, node.role, number(node.mass, "kg"), _WHO[node.mass_origin], node.note or "–"]
        for node in scene.nodes
    ]
    heads = ["source", "drives", "from", "what it is", "time-out", "at its end"]
    return joined(
        [
            tag("h2", "What was evaluated"),
            table(["", ""], facts),
            tag("h4", "Sources"),
            _sources(heads, how),
            tag("h4", "With what"),
            table(["", ""], written),
            tag("h4", "Input files") if files else None,
            table(["file", "size", "SHA-256"], files) if files else None,
            tag("h4", "Bodies of the twin"),
            table(["body", "role", "mass", "mass is", "geometry"], bodies),
        ]
    )


def _sources(heads: list[str], how: Setup) -> Html:
    if how.sources:
        text = (
            "What is older than its time-out no longer counts: every verdict that needs it is undecided from then on."
        )
        return joined([table(heads, how.sources), tag("p", text, class_="lead")])
    return tag("p", "No source: everything stands still." if how.readable else UNKNOWN)


def _anchor(report: Report, series: Series) -> str:
    return f"criterion-{list(report.log).index(series.name) + 1}"
