"""Numbers with a decimal comma, as spreadsheets of many countries write them."""

from __future__ import annotations

import re

from seerob.core.errors import InputError

_WITH_COMMA = re.compile(r"[+-]?(\d+),(\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_GROUP = 3
"""Digits between the separators of thousands."""


class Commas:
    """Reads the cells of one file and finds out whether its commas can be taken for decimal ones.

    Args:
        file: For messages.
    """

    def __init__(self, file: str) -> None:
        self._file = file
        self._seen = ""
        self._sure = False

    def number(self, text: str) -> float:
        """The number in a cell.

        Raises:
            ValueError: It is none.
        """
        if "," not in text:
            return float(text)
        match = _WITH_COMMA.fullmatch(text)
        if match is None:
            raise ValueError(f"{text[:40]!r} is no number")
        whole, after = match.groups()
        self._seen = self._seen or text
        # Thousands come in groups of three and do not begin with 0.
        self._sure = self._sure or len(after) != _GROUP or len(whole) > _GROUP or whole[0] == "0"
        return float(text.replace(",", "."))

    def check(self) -> None:
        """Refuse a file whose commas may as well separate thousands.

        Raises:
            InputError: Every comma in it is followed by three digits.
        """
        if self._seen and not self._sure:
            what = (
                f"every comma is followed by three digits, as in {self._seen[:40]!r}: decimals or thousands?"
            )
            raise InputError.at(self._file, "", what, "write numbers with a decimal point")
