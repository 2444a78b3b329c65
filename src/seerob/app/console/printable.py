"""Text as a terminal may have it: it obeys what it is sent, and files and devices name things."""

from __future__ import annotations

import logging
import re

_OBEYED = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""What moves the cursor, colours, answers or turns the direction of reading, and what no encoding takes."""


def printable(text: str) -> str:
    """Text with what a terminal would obey written as its escape in Python; tabs and line ends stay."""
    return _OBEYED.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


class PrintableLines(logging.Formatter):
    """What is logged, which may quote a device, `printable`."""

    def format(self, record: logging.LogRecord) -> str:
        """The line, and the traceback where there is one."""
        return printable(super().format(record))
