"""HTML whose text is always escaped: only what `tag` built counts as markup."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape

_NOT_TEXT = re.compile(
    r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
_EMPTY = {"meta", "img", "br", "col"}


class Html(str):
    """Markup that is right as it is."""

    __slots__ = ()


Content = str | Iterable["Content"] | None


def legal(value: str) -> str:
    """Characters that HTML forbids, or that turn the direction of what stands around them, become �."""
    return _NOT_TEXT.sub("\ufffd", value)


def text(value: str) -> Html:
    """Escaped text, all of it `legal`."""
    return Html(escape(legal(value), quote=True))


def joined(content: Content) -> Html:
    """Content as markup: strings are escaped, `Html` is kept, None is nothing, the rest is joined."""
    if content is None:
        return Html("")
    if isinstance(content, Html):
        return content
    if isinstance(content, str):
        return text(content)
    return Html("".join(joined(part) for part in content))


def tag(name: str, /, *content: Content, **attributes: str | None) -> Html:
    """An element; ``class_`` is written ``class``, ``_`` becomes ``-``, None attributes are left out."""
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{text(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in _EMPTY:
        return Html(f"<{name}{written}>")
    return Html(f"<{name}{written}>{joined(content)}</{name}>")


def whole(figure: str) -> Html:
    """Words or a figure that are not broken between lines."""
    return tag("span", figure, class_="whole")


def table(head: Iterable[Content], rows: Iterable[Iterable[Content]], *, class_: str | None = None) -> Html:
    """A table with a header row, unless all its titles are empty; the first cell of each row heads it.

    On a narrow screen it scrolls, so keys have to reach it.
    """
    head, body = list(head), []
    for row in rows:
        first, *rest = row
        body.append(tag("tr", tag("th", first, scope="row"), [tag("td", cell) for cell in rest]))
    titles = [tag("th", cell, scope="col") if cell else tag("td") for cell in head]
    first_row = tag("thead", tag("tr", titles)) if any(head) else None
    return tag("table", first_row, tag("tbody", body), class_=class_, tabindex="0")
