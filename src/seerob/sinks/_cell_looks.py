"""How cells of a workbook look: SpreadsheetML styles, each made once."""

from __future__ import annotations

from html import escape

from seerob.sinks._palette import DARK_HEX, HEX
from seerob.snapshot import Verdict

HEAD, WRAP = "head", "wrap"
"""Looks beside the verdicts' words and number formats such as ``0.000``."""
WORDS = {v.value: v for v in Verdict}
"""Of verdicts, which have a look each."""
_FIRST_FORMAT = 164
"""Smaller numbers are the format's own."""
_SIZE, _FACE = '<sz val="11"/>', '<name val="Calibri"/><family val="2"/>'
_WRAPPED = '<alignment vertical="top" wrapText="1"/>'


class Looks:
    """Looks by name, numbered as they are first used; 0 is plain."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[str, bool], int] = {("", False): 0}
        self._formats: list[str] = []
        self._fonts: list[str] = [f"<font>{_SIZE}{_FACE}</font>"]
        self._fills: list[str] = [
            '<fill><patternFill patternType="none"/></fill>',
            '<fill><patternFill patternType="gray125"/></fill>',
        ]
        self._looks: list[str] = ['<xf numFmtId="0" fontId="0" fillId="0" borderId="0" xfId="0"/>']

    def number(self, look: str, *, quoted: bool = False) -> int:
        """Number of a look.

        Args:
            look: `HEAD`, `WRAP`, the word of a verdict, a number format, or nothing.
            quoted: Text that spreadsheets would take for a formula stays text when it is edited, too.
        """
        found = self._numbers.get((look, quoted))
        if found is None:
            found = self._numbers[look, quoted] = len(self._looks)
            self._looks.append(self._made(look, quoted))
        return found

    def _made(self, look: str, quoted: bool) -> str:
        form = font = fill = 0
        inside = ""
        if look == HEAD:
            font, inside = self._font(bold=True), _WRAPPED
        elif look == WRAP:
            inside = _WRAPPED
        elif look in WORDS:
            verdict = WORDS[look]
            font = self._font(bold=verdict is not Verdict.WITHIN, color=DARK_HEX[verdict])
            if verdict is Verdict.UNDECIDED:
                fill = self._fill(HEX[verdict])
        elif look:
            self._formats.append(look)
            form = _FIRST_FORMAT + len(self._formats) - 1
        marks = "".join(
            f' {name}="1"'
            for name, used in (
                ("applyNumberFormat", form),
                ("applyFont", font),
                ("applyFill", fill),
                ("applyAlignment", inside),
                ("quotePrefix", quoted),
            )
            if used
        )
        ids = f'numFmtId="{form}" fontId="{font}" fillId="{fill}" borderId="0" xfId="0"'
        return f"<xf {ids}{marks}>{inside}</xf>"

    def _font(self, *, bold: bool, color: str = "") -> int:
        shade = f'<color rgb="FF{color[1:]}"/>' if color else ""
        weight = "<b/>" if bold else ""
        self._fonts.append(f"<font>{weight}{_SIZE}{shade}{_FACE}</font>")
        return len(self._fonts) - 1

    def _fill(self, color: str) -> int:
        shade = f'<fgColor rgb="FF{color[1:]}"/><bgColor indexed="64"/>'
        self._fills.append(f'<fill><patternFill patternType="solid">{shade}</patternFill></fill>')
        return len(self._fills) - 1

    def xml(self) -> str:
        """``xl/styles.xml`` (ECMA-376 part 1, 18.8)."""
        formats = [
            f'<numFmt numFmtId="{_FIRST_FORMAT + k}" formatCode="{escape(code)}"/>'
            for k, code in enumerate(self._formats)
        ]
        plain = '<xf numFmtId="0" fontId="0" fillId="0" borderId="0"/>'
        border = "<border><left/><right/><top/><bottom/><diagonal/></border>"
        parts = (
            *((_list("numFmts", formats),) if formats else ()),
            _list("fonts", self._fonts),
            _list("fills", self._fills),
            _list("borders", [border]),
            _list("cellStyleXfs", [plain]),
            _list("cellXfs", self._looks),
            _list("cellStyles", ['<cellStyle name="Normal" xfId="0" builtinId="0"/>']),
        )
        return "".join(parts)


def _list(name: str, entries: list[str]) -> str:
    return f'<{name} count="{len(entries)}">{"".join(entries)}</{name}>'
