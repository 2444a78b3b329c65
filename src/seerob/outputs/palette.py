"""Colours and marks of verdicts on paper; never colour alone.

The three fills differ by at least 36 CIEDE2000 in normal, protan, deutan and tritan vision; the dark
variants are for text and lines on white.
"""

from __future__ import annotations

from seerob.core.snapshot import Verdict
from seerob.outputs.words import word

Color = tuple[float, float, float]

HEX = {
    Verdict.WITHIN: "#14AAB8",
    Verdict.UNDECIDED: "#FCEA92",
    Verdict.EXCEEDED: "#C11540",
    None: "#9AA7B4",
}
DARK_HEX = {
    Verdict.WITHIN: "#0B6C76",
    Verdict.UNDECIDED: "#6E5A00",
    Verdict.EXCEEDED: "#A30F35",
    None: "#44505C",
}
MARK = {Verdict.WITHIN: "✓", Verdict.UNDECIDED: "?", Verdict.EXCEEDED: "✕", None: "–"}
WORD = {
    Verdict.WITHIN: word("within"),
    Verdict.UNDECIDED: word("UNDECIDED"),
    Verdict.EXCEEDED: word("EXCEEDED"),
    None: word("no limit"),
}


def rgb(code: str) -> Color:
    """Colour as sRGB 0…1 of ``#rrggbb``."""
    r, g, b = (int(code[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return r, g, b


FILL = {verdict: rgb(code) for verdict, code in HEX.items()}
DARK = {verdict: rgb(code) for verdict, code in DARK_HEX.items()}
