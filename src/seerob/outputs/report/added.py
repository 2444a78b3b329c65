"""Sections of the report that a command added."""

from __future__ import annotations

from base64 import b64encode

from seerob.core.report_section import ReportSection, ReportTable
from seerob.outputs.html import Html, joined, table, tag


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
