"""The report's page, from the summary down to the evidence, with the sections that a command added.

It looks right on a screen, on paper, and without colour.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence

from seerob.core.snapshot import Basis, CriterionInfo, Verdict
from seerob.outputs.html import Content, Html, joined, table, tag, whole
from seerob.outputs.palette import DARK_HEX, HEX
from seerob.outputs.report import plots as _plots
from seerob.outputs.report.events import events_section
from seerob.outputs.report.evidence import assumed, evaluated, not_covered
from seerob.outputs.report.posture_safety import posture_safety_section
from seerob.outputs.report.report import DOUBTFUL, Report, ReportSection, ReportTable, badge, grouped_inputs
from seerob.outputs.report.time_shares import spread_over_time
from seerob.outputs.sentences import about, bound, extremum, listed, percent, reached, summary
from seerob.outputs.words import said, speaking, spoken, told, word
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
h4, .minor {{ font-size: .95rem; margin: 1.2rem 0 .3rem; padding: 0; border: 0; color: var(--soft); }}
p, ul {{ margin: .5rem 0; }}
.lead {{ color: var(--soft); margin: 0 0 1.4rem; }}
.notice {{ border-left: 4px solid var(--soft); background: var(--wash); padding: .6rem 1rem; }}
table {{ border-collapse: collapse; width: 100%; margin: .6rem 0; font-size: .88rem; line-height: 1.4; }}
th, td {{ text-align: left; vertical-align: top; padding: .32rem .6rem; border-bottom: 1px solid var(--rule);
  font-variant-numeric: tabular-nums; font-weight: normal; }}
thead th, thead td {{ font-weight: 600; color: var(--soft); border-bottom: 1.5px solid var(--ink);
  white-space: nowrap; }}
tbody th {{ font-weight: 600; min-width: 7rem; }}
.instants tbody th {{ min-width: 0; }}
td {{ min-width: 4.6rem; }}
.overview {{ font-size: .8rem; }}
.overview th, .overview td {{ padding: .32rem .4rem; }}
.overview tbody th {{ min-width: 8rem; }}
.overview td {{ min-width: 0; }}
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
.cover dl {{ display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1rem; margin: .8rem 0;
  font-size: .88rem; }}
.cover dt {{ color: var(--soft); }}
.cover dd {{ margin: 0; }}
.cover ol {{ columns: 2; margin: .4rem 0; font-size: .88rem; }}
.cover a {{ color: var(--ink); text-decoration-color: var(--rule); text-underline-offset: .2em; }}
.inputs {{ table-layout: fixed; }}
.inputs th:nth-child(2) {{ width: 16%; }}
.inputs th:nth-child(3) {{ width: 10%; }}
.inputs th:last-child {{ width: 39%; }}
.inputs tbody th {{ font-weight: normal; }}
.logo {{ float: right; max-width: 11rem; max-height: 4.5rem; }}
section.criterion {{ border-top: 1px solid var(--rule); padding-top: .2rem; margin-top: 1.6rem; }}
h2 + section.criterion {{ border-top: none; margin-top: 0; }}
.evidence > :only-child {{ grid-column: 1 / -1; }}
@media screen and (min-width: 56rem) {{
  .evidence {{ display: grid; grid-template-columns: 4fr 5fr; gap: 1rem; align-items: center; }}
}}
@media screen and (max-width: 56rem) {{
  table {{ display: block; overflow-x: auto; }}
}}
@page {{ size: A4; margin: 14mm 14mm 16mm;
  @bottom-right {{ content: counter(page) " / " counter(pages); font: 8pt sans-serif; color: #5a6672; }} }}
@media print {{
  body {{ max-width: none; padding: 0; font-size: 9.5pt; line-height: 1.4; }}
  h2 {{ margin: 1.4rem 0 .5rem; }}
  h3 {{ margin: .9rem 0 .2rem; }}
  h4, .minor {{ margin: .6rem 0 .2rem; }}
  p, ul {{ margin: .25rem 0; }}
  figure {{ margin: .3rem 0; }}
  h2, h3, h4 {{ break-after: avoid; }}
  table {{ font-size: 7.5pt; line-height: 1.3; margin: .3rem 0; }}
  th, td {{ padding: .1rem .4rem; }}
  section.criterion {{ margin-top: .6rem; }}
  .evidence {{ display: grid; grid-template-columns: 4fr 6fr; gap: 1rem; align-items: center; }}
  .lanes {{ width: 80%; }}
  .lead {{ margin: .1rem 0 .3rem; font-size: 8pt; }}
  .parts {{ font-size: 6.8pt; }}
  .parts th, .parts td {{ padding: .02rem .4rem; }}
  .parts .badge {{ font-size: 6pt; padding: 0 .3rem; border-width: 1px; }}
  .appendix {{ font-size: 8.5pt; }}
  .appendix .minor {{ margin: .4rem 0 .1rem; }}
  .appendix table {{ font-size: 6.5pt; }}
  .appendix th, .appendix td {{ padding: .05rem .4rem; }}
  .appendix td {{ overflow-wrap: break-word; min-width: 0; }}
  .appendix td code {{ overflow-wrap: anywhere; }}
  .formula {{ padding: .25rem .6rem; font-size: 7.5pt; }}
  .badge {{ font-size: 7.5pt; padding: .05rem .4rem; }}
  thead th {{ white-space: normal; overflow-wrap: normal; }}
  td {{ min-width: 3.4rem; }}
  .overview {{ font-size: 7.5pt; }}
  .overview th, .overview td {{ padding: .15rem .25rem; }}
  .overview .badge {{ font-size: 6.5pt; padding: .02rem .3rem; }}
  .overview tbody th {{ min-width: 6rem; }}
  .overview td {{ min-width: 0; }}
  .overview td:last-child {{ min-width: 15rem; }}
  figure, tr, .verdict {{ break-inside: avoid; }}
  thead {{ display: table-header-group; }}
  * {{ print-color-adjust: exact; -webkit-print-color-adjust: exact; }}
}}
"""


def _section(section: ReportSection) -> Html:
    picture = None
    if section.picture is not None:
        source = f"data:image/png;base64,{b64encode(section.picture).decode()}"
        image = tag("img", src=source, alt=section.caption)
        picture = tag("figure", image, tag("figcaption", section.caption))
    return joined(
        [
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
    """The whole document, in the language that the file asks for."""
    with speaking(report.setup.cover.language):
        return _page(report)


def _page(report: Report) -> str:
    scene = report.scene
    title = said("Evaluation of {title}", title=scene.title)
    sections = [
        (word("Verdicts"), _verdicts(report)),
        (word("Criterion by criterion"), _criteria(report)),
        (word("Posture against safety"), posture_safety_section(scene, report.log)),
        (word("What happened to workpieces"), events_section(report.log)),
        *((section.title, _section(section)) for section in report.sections),
        (word("What is not covered and must be measured"), not_covered(report)),
        (word("What was assumed, and by whom"), assumed(report)),
        (word("Where the figures come from"), _origins(report)),
        (word("What was evaluated"), evaluated(report)),
    ]
    written = [(name, content) for name, content in sections if content]
    content = [
        _cover(report, title, [name for name, _ in written]),
        [
            tag(
                "div",
                tag("h2", said(name), id=_place(k)),
                content,
                class_="appendix" if name in APPENDIX else None,
            )
            for k, (name, content) in enumerate(written)
        ],
    ]
    return document(title, content)


def document(title: str, content: Content) -> str:
    """A whole document around its content, with the report's style; nothing in it is from elsewhere."""
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="referrer", content="no-referrer"),
        tag("title", title),
        tag("style", Html(STYLE)),
    )
    return "<!DOCTYPE html>\n" + tag("html", head, tag("body", tag("main", content)), lang=spoken()) + "\n"


_SHARES = word(
    "Shares are of the run's time. Decided is what was within or exceeded; what is left of it was undecided, "
    "or a criterion did not apply (muted, nobody near)."
)


APPENDIX = ("What was assumed, and by whom", "Where the figures come from", "What was evaluated")
"""What a first reader may leave out."""


def _place(k: int) -> str:
    return f"section-{k + 1}"


def _cover(report: Report, title: str, contents: Sequence[str]) -> Html:
    """The first page: what, for whom, by whom, when; the verdict, what to do, and what is where."""
    scene, cover = report.scene, report.setup.cover
    facts = {
        word("customer"): cover.customer,
        word("author"): cover.author,
        word("revision"): cover.revision,
        word("written"): said("{date}, by seerob {version}", date=report.date, version=scene.version),
        word("figures from"): told(scene.edition),
        word("inputs, SHA-256"): scene.workstation_hash,
    }
    return tag(
        "div",
        _logo(report),
        tag("h1", title),
        tag("dl", [[tag("dt", said(name)), tag("dd", text)] for name, text in facts.items() if text]),
        _opening(report),
        tag("h2", said("What to do"), class_="minor"),
        tag("ul", [tag("li", text) for text in to_do(report)]),
        tag("h2", said("Contents"), class_="minor"),
        tag("ol", [tag("li", tag("a", said(name), href=f"#{_place(k)}")) for k, name in enumerate(contents)]),
        class_="cover",
    )


_IMAGES = {b"\x89PNG\r\n\x1a\n": "png", b"\xff\xd8\xff": "jpeg"}
_LARGEST_LOGO = 1 << 20
"""[byte]"""


def _logo(report: Report) -> Html | None:
    name = report.setup.cover.logo
    if name is None:
        return None
    data = report.files.get(name, b"")
    kind = next((kind for begin, kind in _IMAGES.items() if data.startswith(begin)), None)
    if kind is None or len(data) > _LARGEST_LOGO:
        text = said("{name} is no PNG or JPEG file of at most 1 MB: no logo.", name=name)
        return tag("p", text, class_="lead")
    return tag("img", src=f"data:image/{kind};base64,{b64encode(data).decode()}", alt="", class_="logo")


_LISTED = 6
"""What is to be done of one kind, at most."""


def to_do(report: Report) -> list[str]:
    """What stands between this run and a verdict that all is within, the worst first."""
    exceeded, undecided = [], []
    for series in report.log.ranked():
        if series.verdict is Verdict.EXCEEDED:
            worst = series.worst()
            exceeded.append(
                said(
                    "Change the cell, its motion or its task: {name} is {value} at {t} s, {limit} is "
                    "admissible.",
                    name=series.name, value=reached(worst, series), t=f"{worst.t:.2f}", limit=_limit(series),
                )
            )  # fmt: skip
        elif series.verdict is Verdict.UNDECIDED:
            reason = (series.worst().reason if series.known else "") or said(
                "it was not decided all the time"
            )
            undecided.append(
                said("Give what is not known: {name}: {reason}.", name=series.name, reason=told(reason))
            )
    texts = []
    for each in (exceeded, undecided):
        more = len(each) - _LISTED
        texts += [*each[:_LISTED], *([said("And {n} more, below.", n=more)] if more > 0 else [])]
    inputs = (item for basis in report.bases.values() for item in basis.inputs)
    doubtful = {(item.name, item.origin) for item in inputs if item.origin in DOUBTFUL}
    if doubtful:
        texts.append(
            said(
                "Measure or state inputs that nobody did ({n}), marked among where the figures come from.",
                n=len(doubtful),
            )
        )
    return [
        *texts,
        said("Measure at the real workstation what no twin can tell, listed under what is not covered."),
    ]


def _opening(report: Report) -> Html:
    verdict = report.log.verdict
    head = {
        Verdict.EXCEEDED: said("At least one limit is exceeded."),
        Verdict.UNDECIDED: said("No limit was seen exceeded, but not everything could be decided."),
        Verdict.WITHIN: said("Every limit that was evaluated was kept in this run."),
        None: said("No limit was given, so there is no verdict."),
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
                said(
                    "This is an evaluation in simulation of one run of one described workstation. It "
                    "supports a risk assessment; it neither replaces it nor the measurements at the real "
                    "workstation. What was assumed, and what must be measured, has its own section."
                ),
                class_="notice",
            ),
        ]
    )


def _unasked(report: Report) -> list[str]:
    """Whom and what no criterion asks about: the verdict does not speak of them."""
    names = [f.subject for f in report.scene.findings if f.text.startswith("not evaluated: ")]
    return (
        [said("The verdict says nothing of {names}: no criterion asks about that.", names=listed(names))]
        if names
        else []
    )


def _verdicts(report: Report) -> Html:
    rows = []
    for series in report.log.ranked():
        link = tag("a", series.name, href=f"#{_anchor(report, series)}")
        if not series.known:
            rows.append([link, badge(series.verdict), *["–"] * 6, said("never gave a result")])
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
                told(worst.reason) or worst.part,
            ]
        )
    head = [
        said("criterion"),
        said("verdict"),
        said("worst value"),
        said("limit"),
        said("at"),
        said("decided"),
        said("exceeded"),
        said("undecided"),
        said("what governs, or why"),
    ]
    shown = [s for s in report.log.ranked() if s.known]
    return joined(
        [
            table(head, rows, class_="overview"),
            tag("p", said(_SHARES), class_="lead"),
            tag(
                "figure",
                _plots.lanes(shown, salt="lanes"),
                tag("figcaption", said("The verdicts over the run.")),
                class_="lanes",
            )
            if shown
            else None,
        ]
    )


def _limit(series: Series) -> str:
    worst = series.worst()
    return "–" if worst.limit is None else ("≤ " if series.at_most else "≥ ") + bound(worst, series)


def _criteria(report: Report) -> Html:
    infos = {info.name: info for info in report.scene.criteria}
    sections = []
    for series in report.log.ranked():
        sections.append(
            tag(
                "section",
                tag("h3", series.name, " ", badge(series.verdict)),
                _described(infos.get(series.name)),
                [tag("p", sentence) for sentence in about(series)],
                tag(
                    "div",
                    _picture(report, series),
                    tag("figure", _plots.curve(series, salt=_anchor(report, series)))
                    if series.known
                    else None,
                    class_="evidence",
                ),
                spread_over_time(infos.get(series.name), series),
                _parts(series),
                _formula(report.bases.get(series.name)),
                id=_anchor(report, series),
                class_="criterion",
            )
        )
    return joined(sections)


def _described(info: CriterionInfo | None) -> Html | None:
    if info is None:
        return None
    about_ = f" {said('Speaks of {names}.', names=', '.join(info.subjects))}" if info.subjects else ""
    between = " " + said(
        "Between the instants at which it was asked: {how}.", how=told(info.between) or said("bounded")
    )
    return tag("p", f"{told(info.title)}{about_}{between}", class_="lead")


def _picture(report: Report, series: Series) -> Html | None:
    png = report.pictures.get(series.name)
    if png is None:
        return None
    worst = series.worst()
    what = said("{value} at {t} s, its worst instant", value=reached(worst, series), t=f"{worst.t:.2f}")
    source = f"data:image/png;base64,{b64encode(png).decode()}"
    return tag("figure", tag("img", src=source, alt=f"{series.name}: {what}"), tag("figcaption", f"{what}."))


def _parts(series: Series) -> Html | None:
    if not series.parts:
        return None
    rows = []
    for part in series.parts.values():
        worst, shares = part.worst(), part.shares()
        rows.append(
            [
                told(part.name),
                badge(part.verdict),
                whole(extremum(worst, part)),
                whole(bound(worst, part)),
                whole(f"{worst.t:.2f} s"),
                percent(shares.get(Verdict.EXCEEDED, 0.0)),
                percent(shares.get(Verdict.UNDECIDED, 0.0)),
            ]
        )
    head = [
        said(one) for one in (word("part"), "verdict", "worst value", "limit", "at", "exceeded", "undecided")
    ]
    text = said("Shares are of the ticks in which the part was spoken of.")
    return joined(
        [tag("h4", said("By part")), table(head, rows, class_="parts"), tag("p", text, class_="lead")]
    )


def _formula(basis: Basis | None) -> Html:
    if basis is None:
        return tag("p", said("The criterion did not say what its figure rests on."), class_="doubt")
    return joined(
        [tag("p", told(basis.formula), class_="formula"), tag("p", told(basis.source), class_="lead")]
    )


def _origins(report: Report) -> Html:
    """Every input of every criterion with where it comes from; what nobody measured or stated first."""
    items = [(name, item) for name, basis in report.bases.items() for item in basis.inputs]
    items.sort(key=lambda one: one[1].origin not in DOUBTFUL)
    text = said("What is marked ! nobody measured or stated: it is assumed, estimated or missing.")
    head = [said("inputs"), said("criteria"), said("origin"), said("source")]
    return (
        joined([tag("p", text), table(head, grouped_inputs(items), class_="inputs")]) if items else Html("")
    )


def _anchor(report: Report, series: Series) -> str:
    return f"criterion-{list(report.log).index(series.name) + 1}"
