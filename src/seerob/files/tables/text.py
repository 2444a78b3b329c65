"""Delimited text as a grid: encodings, delimiters, and files that are something else."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TextIO

from seerob.core.errors import InputError
from seerob.core.printable import printable

MAX_BYTES = 4 << 30
MAX_LINE = 4 << 20
"""Longest line that is taken, in characters."""

BLANKS = " "
"""As a delimiter: any run of blanks and tabs."""

BOMS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))


def check_file(path: Path, name: str, max_bytes: int = MAX_BYTES) -> bytes:
    """The first bytes of a readable file of a bearable size; InputError otherwise."""
    try:
        there = path.is_file()
    except (OSError, ValueError) as error:
        raise InputError.at(name[:200], "", f"is no name of a file: {error.args[-1]}", "name one") from error
    if not there:
        if path.is_dir():
            raise InputError.at(name, "", "is a folder", "give the file that is meant")
        raise InputError.at(name, "", "no such file", f"looked for {path}")
    size = path.stat().st_size
    if size == 0:
        raise InputError.at(name, "", "the file is empty")
    if size > max_bytes:
        raise InputError.at(name, "", f"{size} bytes, more than {max_bytes}", "split the file")
    try:
        with path.open("rb") as file:
            return file.read(1 << 16)
    except OSError as error:
        raise InputError.at(name, "", f"cannot be read: {error.strerror}") from error


def encoding_of(path: Path, name: str) -> str:
    """Encoding of a text file: by its byte order mark, else UTF-8 if it is, else Windows-1252.

    Raises:
        InputError: The file is missing, empty, too large, or not text.
    """
    head = check_file(path, name)
    if head.startswith(b"PK\x03\x04"):
        raise InputError.at(name, "", "a zip archive, not text", 'for a workbook use kind = "excel"')
    if head.startswith(b"\xd0\xcf\x11\xe0"):
        raise InputError.at(name, "", "an old Excel file (.xls), not text", "save it as .xlsx or .csv")
    for mark, encoding in BOMS:
        if head.startswith(mark):
            return encoding
    if b"\0" in head:
        raise InputError.at(name, "", "binary data, not text", "export the trajectory as text")
    try:
        # A cut through a character at the end of the head is no mistake.
        head.decode("utf-8") if len(head) < 1 << 16 else head[: head.rfind(b"\n") + 1].decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def lines(path: Path, name: str, encoding: str) -> Iterator[str]:
    """Lines of a text file, each of bounded length."""
    with path.open(encoding=encoding, newline="") as file:
        count = 0
        while True:
            line = _line(file, name, count + 1)
            if not line:
                return
            count += 1
            body = line.rstrip("\r\n")
            # Names of columns and cells that are no number go into messages and results.
            yield line if body.replace("\t", " ").isprintable() else printable(body) + line[len(body) :]


def _line(file: TextIO, name: str, number: int) -> str:
    try:
        line = file.readline(MAX_LINE)
    except UnicodeError as error:
        raise InputError.at(name, f"row {number}", f"not text: {error}", "save the file as UTF-8") from error
    if len(line) >= MAX_LINE:
        raise InputError.at(name, f"row {number}", f"a line longer than {MAX_LINE} characters")
    return line


@dataclass(frozen=True)
class TextGrid:
    """A delimited text file."""

    path: Path
    file: str
    encoding: str
    delimiter: str
    comment: str = ""
    """A mark that is taken away where a line starts with it: ``%`` before a header."""
    sheet: str = ""

    def rows(self) -> Iterator[Sequence[str]]:
        """Rows as lists of text; a blank line is an empty list."""
        if self.delimiter == BLANKS:
            for line in self._lines():
                yield line.split()
            return
        reader = csv.reader(self._lines(), delimiter=self.delimiter)
        count = 0
        while True:
            count += 1
            try:
                row = next(reader)
            except StopIteration:
                return
            except csv.Error as error:
                raise InputError.at(self.file, f"row {count}", f"not delimited text: {error}") from error
            yield row

    def _lines(self) -> Iterator[str]:
        for line in lines(self.path, self.file, self.encoding):
            yield line.removeprefix(self.comment) if self.comment else line


def head(grid: TextGrid, count: int) -> list[Sequence[str]]:
    """The first rows."""
    return list(islice(grid.rows(), count))
