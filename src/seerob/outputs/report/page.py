"""The report's page, from the summary down to the evidence, with the sections that a command added."""

from __future__ import annotations

from base64 import b64encode

from seerob.core.report_section import ReportSection, ReportTable
from seerob.core.snapshot import Basis, CriterionInfo, Verdict
from seerob.outputs.html import Html, joined, table, tag, whole
from seerob.outputs.report import plots as _plots
from seerob.outputs.report.evidence import assumed, evaluated, not_covered
from seerob.outputs.report.page_style import STYLE
from seerob.outputs.report.posture_safety import told
from seerob.outputs.report.report import Report, badge, input_row
from seerob.outputs.report.time_shares import spread_over_time
from seerob.outputs.sentences import about, bound, extremum, listed, percent, reached, summary
from seerob.recording.series import Series


def added(sections: tuple[ReportSection, ...]) -> Html:
    """All of them, in order."""
    return joined([_section(section) for section in sections])


def _section(section: ReportSection) -> Html:
    picture = None
    if section.picture is not None:
        source = f"data:image/png;base64,{b64encode(section.picture).decode()}"
        image = tag("img", src=source, alt=section.caption)
        picture = tag("figure", image, tag("figcaption", section.caption))
    return joined(
        [
            tag("h2", section.title),
            [tag("p", sentence) for sentence in section.sentences],
            picture,
            [_table(one) for one in section.tables],
        ]
    )


def _table(one: ReportTable) -> Html:
    return joined(
        [table(list(one.head), [list(row) for row in one.rows]), tag("p", one.caption, class_="lead")]
    )


_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"


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
        tag("p", f"seerob {scene.version} · figures from {scene.edition} · {report.date}", class_="lead"),
        _opening(report),
        _verdicts(report),
        _criteria(report),
        told(report.scene, report.log),
        added(report.sections),
        assumed(report),
        not_covered(report),
        evaluated(report),
    )
    return "<!DOCTYPE html>\n" + tag("html", head, body, lang="en") + "\n"


_SHARES = (
    "Shares are of the run's time. Decided is what was within or exceeded; what is left of it was undecided, "
    "or a criterion did not apply (muted, nobody near)."
)


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
                [tag("p", sentence) for sentence in (*summary(report.log), *_unasked(report))],
                class_=f"verdict {'none' if verdict is None else verdict.value}",
            ),
            tag(
                "p",
                "This is an evaluation in simulation of one run of one described workstation. It supports a "
                "risk assessment; it neither replaces it nor the measurements at the real workstation. What "
                "was assumed, and what must be measured, has its own section.",
                class_="notice",
            ),
        ]
    )


def _unasked(report: Report) -> list[str]:
    """Whom and what no criterion asks about: the verdict does not speak of them."""
    names = [f.subject for f in report.scene.findings if f.text.startswith("not evaluated: ")]
    return [f"The verdict says nothing of {listed(names)}: no criterion asks about that."] if names else []


def _verdicts(report: Report) -> Html:
    rows = []
    for series in report.log.ranked():
        link = tag("a", series.name, href=f"#{_anchor(report, series)}")
        if not series.known:
            rows.append([link, badge(series.verdict), *["–"] * 6, "never gave a result"])
            continue
        worst, times = series.worst(), series.times()
        rows.append(
            [
                link,
                badge(series.verdict),
                whole(reached(worst, series)),
                whole(_limit(series)),
                whole(f"{worst.t:.2f} s"),
                "–" if series.verdict is None else percent(times.decided),
                percent(times.exceeded),
                percent(times.undecided + times.open),
                worst.reason or worst.part,
            ]
        )
    head = [
        "criterion",
        "verdict",
        "worst value",
        "limit",
        "at",
        "decided",
        "exceeded",
        "undecided",
        "what governs, or why",
    ]
    shown = [s for s in report.log.ranked() if s.known]
    return joined(
        [
            tag("h2", "Verdicts"),
            table(head, rows, class_="overview"),
            tag("p", _SHARES, class_="lead"),
            tag("figure", _plots.lanes(shown, salt="lanes"), tag("figcaption", "The verdicts over the run."))
            if shown
            else None,
        ]
    )


def _limit(series: Series) -> str:
    worst = series.worst()
    return "–" if worst.limit is None else ("≤ " if series.at_most else "≥ ") + bound(worst, series)


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
                spread_over_time(infos.get(series.name), series),
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
    between = f" Between the instants at which it was asked: {info.between or 'bounded'}."
    return tag("p", f"{info.title}{about_}{between}", class_="lead")


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
        worst, shares = part.worst(), part.shares()
        rows.append(
            [
                part.name,
                badge(part.verdict),
                whole(extremum(worst, part)),
                whole(bound(worst, part)),
                whole(f"{worst.t:.2f} s"),
                percent(shares.get(Verdict.EXCEEDED, 0.0)),
                percent(shares.get(Verdict.UNDECIDED, 0.0)),
            ]
        )
    head = ["part", "verdict", "worst value", "limit", "at", "exceeded", "undecided"]
    text = "Shares are of the ticks in which the part was spoken of."
    return joined([tag("h4", "By part"), table(head, rows), tag("p", text, class_="lead")])


def _basis(basis: Basis | None) -> Html:
    if basis is None:
        return tag("p", "The criterion did not say what its figure rests on.", class_="doubt")
    content: list[Html | None] = [
        tag("h4", "Where the figure comes from"),
        tag("p", basis.formula, class_="formula"),
        tag("p", basis.source),
        table(["input", "value", "origin", "source"], [input_row(i) for i in basis.inputs])
        if basis.inputs
        else None,
    ]
    if basis.not_modelled:
        content += [
            tag("h4", "What it leaves out"),
            tag("ul", [tag("li", item) for item in basis.not_modelled]),
        ]
    return joined(content)


def _anchor(report: Report, series: Series) -> str:
    return f"criterion-{list(report.log).index(series.name) + 1}"
