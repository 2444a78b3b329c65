"""Text in a CSV file that spreadsheets do not take for a formula.

Whoever writes a workstation file says what criteria, links and devices are called, and a spreadsheet
computes every cell that begins like a formula.
"""

from __future__ import annotations

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a formula begins with."""


def no_formula(text: str) -> str:
    """The text, with an apostrophe before it where it begins like a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text
