"""The report's page, from the summary down to the evidence, with the sections that a command added.

It looks right on a screen, on paper, and without colour.
"""

from __future__ import annotations

from base64 import b64encode

from seerob.core.snapshot import Basis, CriterionInfo, Verdict
from seerob.outputs.html import Html, joined, table, tag, whole
from seerob.outputs.palette import DARK_HEX, HEX
from seerob.outputs.report import plots as _plots
from seerob.outputs.report.evidence import assumed, evaluated, not_covered
from seerob.outputs.report.posture_safety import posture_safety_section
from seerob.outputs.report.report import Report, ReportSection, ReportTable, badge, input_row
from seerob.outputs.report.time_shares import spread_over_time
from seerob.outputs.sentences import about, bound, extremum, listed, percent, reached, summary
from seerob.recording.series import Series

STYLE = f"""
:root {{ --ink: #1a2430; --soft: #5a6672; --rule: #d8dee4; --wash: #f5f7f9; }}
* {{ box-sizing: border-box; }}
body {{ margin: 0 auto; max-width: 64rem; padding: 2.5rem 1.5rem 4rem; color: var(--ink); background: #fff;
  font: 16px/1.55 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif;
  overflow-wrap: anywhere; }}
h1 {{ font-size: 1.9rem; line-height: 1.2; margin: 0 0 .3rem; }}
h2 {{ font-size: 1.3rem; margin: 2.8rem 0 .8rem; padding-bottom: .3rem;
  border-bottom: 2px solid var(--ink); }}
h3 {{ font-size: 1.1rem; margin: 2.2rem 0 .5rem; }}
h4 {{ font-size: .95rem; margin: 1.2rem 0 .3rem; color: var(--soft); }}
p, ul {{ margin: .5rem 0; }}
.lead {{ color: var(--soft); margin: 0 0 1.4rem; }}
.notice {{ border-left: 4px solid var(--soft); background: var(--wash); padding: .6rem 1rem; }}
table {{ border-collapse: collapse; width: 100%; margin: .6rem 0; font-size: .88rem; line-height: 1.4; }}
th, td {{ text-align: left; vertical-align: top; padding: .32rem .6rem; border-bottom: 1px solid var(--rule);
  font-variant-numeric: tabular-nums; font-weight: normal; }}
thead th {{ font-weight: 600; color: var(--soft); border-bottom: 1.5px solid var(--ink);
  white-space: nowrap; }}
tbody th {{ font-weight: 600; min-width: 7rem; }}
.instants tbody th {{ min-width: 0; }}
td {{ min-width: 4.6rem; }}
.overview tbody th {{ min-width: 9.5rem; }}
.overview td:last-child {{ min-width: 9rem; }}
.overview a {{ color: var(--ink); text-decoration-color: var(--rule); text-underline-offset: .2em; }}
code {{ font-family: ui-monospace, Consolas, "DejaVu Sans Mono", monospace; font-size: .85em; }}
.whole {{ white-space: nowrap; }}
.formula {{ background: var(--wash); padding: .5rem .8rem; font-family: ui-monospace, Consolas, monospace;
  font-size: .88rem; white-space: pre-wrap; }}
.badge {{ display: inline-block; padding: .08rem .55rem; border-radius: .8rem; font-size: .82rem;
  font-weight: 650; border: 1.5px solid; white-space: nowrap; }}
.within {{ background: {HEX[Verdict.WITHIN]}22; border-color: {DARK_HEX[Verdict.WITHIN]};
  color: {DARK_HEX[Verdict.WITHIN]}; }}
.undecided {{ background: {HEX[Verdict.UNDECIDED]}; border-color: {DARK_HEX[Verdict.UNDECIDED]};
  color: #3b3000; border-style: dashed; }}
.exceeded {{ background: {HEX[Verdict.EXCEEDED]}; border-color: {HEX[Verdict.EXCEEDED]}; color: #fff; }}
.none {{ background: #fff; border-color: {HEX[None]}; color: {DARK_HEX[None]}; }}
.verdict {{ padding: .9rem 1.1rem; border: 2px solid; border-radius: .5rem; margin: 1.2rem 0; }}
.verdict p {{ color: var(--ink); }}
.verdict.exceeded, .verdict.within, .verdict.none {{ background: #fff; color: inherit; }}
.verdict strong {{ font-size: 1.15rem; }}
.doubt {{ font-weight: 600; color: {DARK_HEX[Verdict.UNDECIDED]}; }}
figure {{ margin: .8rem 0; }}
figure img, figure svg {{ width: 100%; height: auto; display: block; }}
figure img {{ border: 1px solid var(--rule); border-radius: .3rem; }}
figcaption {{ font-size: .84rem; color: var(--soft); margin-top: .3rem; }}
section.criterion {{ border-top: 1px solid var(--rule); padding-top: .2rem; margin-top: 1.6rem; }}
h2 + section.criterion {{ border-top: none; margin-top: 0; }}
@media screen and (max-width: 56rem) {{
  table {{ display: block; overflow-x: auto; }}
}}
@page {{ size: A4; margin: 16mm 14mm; }}
@media print {{
  body {{ max-width: none; padding: 0; font-size: 10.5pt; }}
  h2, h3, h4 {{ break-after: avoid; }}
  table {{ font-size: 8.5pt; }}
  th, td {{ padding: .2rem .4rem; }}
  .badge {{ font-size: 7.5pt; padding: .05rem .4rem; }}
  thead th {{ white-space: normal; overflow-wrap: normal; }}
  td {{ min-width: 3.4rem; }}
  .overview {{ font-size: 7.5pt; }}
  .overview th, .overview td {{ padding: .15rem .25rem; }}
  .overview .badge {{ font-size: 6.5pt; padding: .02rem .3rem; }}
  .overview tbody th {{ min-width: 6rem; }}
  .overview td {{ min-width: 0; }}
  .overview td:last-child {{ min-width: 6.5rem; }}
  figure, tr, .verdict {{ break-inside: avoid; }}
  thead {{ display: table-header-group; }}
  * {{ print-color-adjust: exact; -webkit-print-color-adjust: exact; }}
}}
"""


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
        posture_safety_section(report.scene, report.log),
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
