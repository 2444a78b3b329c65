"""What is logged, as a terminal may have it."""

from __future__ import annotations

import logging

from seerob.core.printable import printable


class PrintableLines(logging.Formatter):
    """What is logged, which may quote a device, `printable`."""

    def format(self, record: logging.LogRecord) -> str:
        """The line, and the traceback where there is one."""
        return printable(super().format(record))
