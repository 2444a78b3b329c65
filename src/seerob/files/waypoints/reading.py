"""Which reader a file of waypoints is for; told by its name."""

from __future__ import annotations

from pathlib import Path

from seerob.core.errors import InputError
from seerob.files.tables.candidates import WORKBOOKS
from seerob.files.tables.text import check_file
from seerob.files.waypoints.sheet import read_sheet
from seerob.files.waypoints.structured import read_structured
from seerob.files.waypoints.urp import read_urp
from seerob.files.waypoints.urscript import read_urscript
from seerob.files.waypoints.waypoint import Program

MAX_BYTES = 16 << 20
TABLES = (".csv", ".tsv", ".txt", *WORKBOOKS)
KNOWN = ".script .urp .toml .yaml .yml .csv .tsv .txt .xlsx"


def read_program(path: Path, file: str) -> Program:
    """The waypoints of a file.

    Args:
        path: Where it is.
        file: Its name, for messages.

    Raises:
        InputError: It is missing, too large, of no known kind, or wrong.
    """
    check_file(path, file, MAX_BYTES)
    suffix = path.suffix.lower()
    if suffix in TABLES:
        return read_sheet(path, file)
    if suffix not in KNOWN.split():
        raise InputError.at(file, "", f"{suffix or 'no'} extension", f"waypoints are read from {KNOWN}")
    content = path.read_bytes()
    if suffix == ".script":
        return read_urscript(content, file)
    if suffix == ".urp":
        return read_urp(content, file)
    return read_structured(content, file, yaml=suffix != ".toml")
