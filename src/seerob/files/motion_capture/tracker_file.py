"""Recordings of worn trackers: JSON lines (our live message, one per line), or a table in CSV.

The table has one row per device and instant: ``t [s],serial,role,tracking,x [m],y [m],z [m],qw,qx,qy,qz``,
axes as OpenVR has them (x right, y up, -z forward), empty cells where nothing is known. Rows of one instant
follow one another.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import TextIO

import numpy as np

from seerob.core.errors import InputError
from seerob.core.files.bounded import regular
from seerob.protocols import ProtocolError
from seerob.protocols.links.live_messages import MAX_MESSAGE
from seerob.protocols.tracking.vive import (
    MOST_DEVICES,
    Device,
    Devices,
    decode,
    device,
    encode,
    xr_positions,
    xr_turns,
)

HEADER = ("t [s]", "serial", "role", "tracking", "x [m]", "y [m]", "z [m]", "qw", "qx", "qy", "qz")
LARGEST = 2 << 30
"""Largest size of a file [byte]."""
YES, NO = ("1", "true", "yes"), ("0", "false", "no")


def read(path: Path, *, file: str) -> Iterator[Devices]:
    """Instants of a recording, in the file's order.

    Args:
        path: ``.csv``, or JSON lines under any other name.
        file: As messages name it.

    Raises:
        InputError: The file is missing, too large, or a line is wrong; with its number.
    """
    try:
        if regular(path) > LARGEST:
            raise InputError.at(file, "", f"more than {LARGEST >> 30} GiB", "cut the recording")
        with path.open(encoding="utf-8", newline="") as text:
            yield from _from_table(text, file) if path.suffix.lower() == ".csv" else _from_lines(text, file)
    except UnicodeDecodeError as error:
        raise InputError.at(file, "", f"is not text in UTF-8: {error}") from error
    except OSError as error:
        raise InputError.at(file, "", error.strerror or str(error), "give the recording") from error


def write(path: Path, instants: Iterable[Devices]) -> int:
    """Write a recording that `read` reads back.

    Args:
        path: ``.csv`` for a table, any other name for JSON lines.
        instants: In time order.

    Returns:
        How many instants were written.
    """
    count = 0
    with path.open("w", encoding="utf-8", newline="") as text:
        rows = csv.writer(text) if path.suffix.lower() == ".csv" else None
        if rows is not None:
            rows.writerow(HEADER)
        for instant in instants:
            count += 1
            if rows is None:
                text.write(encode(instant).decode() + "\n")
            else:
                rows.writerows(_row(instant.t, each) for each in instant.devices)
    return count


def _from_lines(text: TextIO, file: str) -> Iterator[Devices]:
    number = 0
    while line := text.readline(MAX_MESSAGE):
        number += 1
        if not line.strip():
            continue
        try:
            yield decode(line)
        except ProtocolError as error:
            raise InputError.at(file, f"line {number}", str(error)) from error


def _from_table(text: TextIO, file: str) -> Iterator[Devices]:
    rows = csv.reader(text, strict=True)
    try:
        head = tuple(cell.strip() for cell in next(rows, ()))
        if head != HEADER:
            what = f"the first line is {','.join(head)[:200]!r}"
            raise InputError.at(file, "line 1", what, f"write {','.join(HEADER)}")
        for t, group in groupby(_numbered(rows, file), key=lambda item: item[0]):
            devices = [each for _, each in group]
            if len(devices) > MOST_DEVICES or len({d.serial for d in devices}) < len(devices):
                what = f"a device twice, or more than {MOST_DEVICES} devices"
                raise InputError.at(file, f"line {rows.line_num}", what, f"at {t:g} s")
            yield Devices(t, tuple(devices))
    except csv.Error as error:
        raise InputError.at(file, f"line {rows.line_num}", str(error)) from error


def _numbered(rows: Iterator[list[str]], file: str) -> Iterator[tuple[float, Device]]:
    for number, row in enumerate(rows, 2):
        if not any(cell.strip() for cell in row):
            continue
        try:
            yield _parsed(row)
        except ValueError as error:
            raise InputError.at(file, f"line {number}", str(error), f"write {','.join(HEADER)}") from error


def _parsed(row: list[str]) -> tuple[float, Device]:
    cells = [cell.strip() for cell in row]
    if len(cells) != len(HEADER):
        raise ValueError(f"{len(cells)} cells, {len(HEADER)} are expected")
    t = float(cells[0])
    if not math.isfinite(t) or not cells[1] or len(cells[1]) > 128 or cells[3].lower() not in YES + NO:
        raise ValueError("t is no number, serial is missing, or tracking is neither 1 nor 0")
    numbers = [float(cell) if cell else math.nan for cell in cells[4:]]
    tracking = cells[3].lower() in YES
    return t, device(
        cells[1], cells[2], tracking=tracking, result=200, position=numbers[:3], wxyz=numbers[3:]
    )


def _row(t: float, d: Device) -> list[str]:
    numbers = np.concatenate([xr_positions(d.position), xr_turns(d.wxyz)])
    shown = ["" if math.isnan(x) else repr(round(x, 7)) for x in numbers.tolist()]
    return [repr(t), d.serial, d.role, "1" if d.tracking else "0", *shown]
