"""How cells of a workbook look: each look is made once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from seerob.core.snapshot import Verdict
from seerob.outputs.palette import DARK_HEX, HEX

if TYPE_CHECKING:
    from xlsxwriter import Workbook
    from xlsxwriter.format import Format

HEAD, WRAP = "head", "wrap"
"""Looks beside the verdicts' words and number formats such as ``0.000``."""
WORDS = {v.value: v for v in Verdict}
"""Of verdicts, which have a look each."""
_WRAPPED: dict[str, Any] = {"text_wrap": True, "valign": "top"}


class Formats:
    """Formats of a workbook by the name of their look.

    Args:
        book: Whose formats they are.
    """

    def __init__(self, book: Workbook) -> None:
        self._book = book
        self._made: dict[tuple[str, bool], Format | None] = {("", False): None}

    def of(self, look: str, *, quoted: bool = False) -> Format | None:
        """Format of a look; None for a plain one.

        Args:
            look: `HEAD`, `WRAP`, the word of a verdict, a number format, or nothing.
            quoted: Text that spreadsheets would take for a formula stays text when it is edited, too.
        """
        key = look, quoted
        if key not in self._made:
            self._made[key] = self._book.add_format(_properties(look) | {"quote_prefix": quoted})
        return self._made[key]


def _properties(look: str) -> dict[str, Any]:
    if look == HEAD:
        return {"bold": True, **_WRAPPED}
    if look == WRAP:
        return _WRAPPED
    if look in WORDS:
        verdict = WORDS[look]
        fill = {"bg_color": HEX[verdict]} if verdict is Verdict.UNDECIDED else {}
        return {"bold": verdict is not Verdict.WITHIN, "font_color": DARK_HEX[verdict], **fill}
    return {"num_format": look} if look else {}
