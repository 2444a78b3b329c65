"""Markers in the format of OpenSim, TRC: tab-separated text.

Line 1 ``PathFileType 4 (X/Y/Z) name``; 2 names and 3 values of ``DataRate``, ``NumFrames``, ``NumMarkers``,
``Units`` …; 4 ``Frame# Time`` and a name per marker, which stands over three columns; 5 ``X1 Y1 Z1`` …;
then a blank line and the rows. OpenSim 4.6 refuses rows that end with blank cells: what was not seen is
written as ``NaN``.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from math import isnan
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.quantities import LENGTHS
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.capture.captured import Captured
from seerob.files.motion_capture.frame_arrays import MAX_VALUES
from seerob.files.motion_capture.markers import MarkerReading, Points, recording
from seerob.files.motion_capture.upright import world_from_file
from seerob.files.tables.grid import MAX_PROBLEMS
from seerob.files.tables.table_files import encoding_of, lines

HEAD = (
    "DataRate",
    "CameraRate",
    "NumFrames",
    "NumMarkers",
    "Units",
    "OrigDataRate",
    "OrigDataStartFrame",
    "OrigNumFrames",
)
MAX_MARKERS = 2000
RATE_OFF = 0.02
"""The rate of the header may differ from that of the times by this share."""


def read(path: Path, reading: MarkerReading) -> Captured:
    """The markers of one person.

    Raises:
        InputError: It is no TRC, or the unit, the vertical or the person is not clear.
    """
    points, notes = read_points(path, file=reading.file)
    return recording(points, reading, notes=notes)


def read_points(path: Path, *, file: str) -> tuple[Points, tuple[Finding, ...]]:
    """Markers in the unit and the axes of the file, and what is to be said of it.

    Raises:
        InputError: It is no TRC, or a row is wrong.
    """
    text = enumerate(lines(path, file, encoding_of(path, file)), start=1)
    head = _head(text, file)
    names = _names(text, file)
    t, flat = array("d"), array("d")
    problems: list[Problem] = []
    for number, line in text:
        if not line.strip() or (not t and line.lstrip().upper().startswith("X1")):
            continue
        cells = _cells(line, 2 + 3 * len(names))
        try:
            values = [float(cell) if cell.strip() else float("nan") for cell in cells[1:]]
        except ValueError as error:
            values = []
            problems.append(Problem(file, f"line {number}", str(error)[:120]))
        if not values and not problems:
            problems.append(Problem(file, f"line {number}", "no time in this row"))
        # OpenSim itself writes rows without the blank cells at their end.
        missing = 1 + 3 * len(names) - len(values)
        if missing < 0 and not all(map(isnan, values[missing:])):
            problems.append(Problem(file, f"line {number}", f"{-missing} cells more than markers"))
        if len(problems) >= MAX_PROBLEMS:
            raise InputError(problems)
        if not problems:
            t.append(values[0])
            flat.extend((values[1:] + [float("nan")] * max(missing, 0))[: 3 * len(names)])
        if len(flat) > MAX_VALUES:
            raise InputError.at(file, f"line {number}", f"more than {MAX_VALUES} numbers", "split the file")
    if problems:
        raise InputError(problems)
    times = np.array(t)
    points = Points(
        names=names,
        t=times,
        values=np.array(flat).reshape(len(times), len(names), 3),
        unit=head.get("Units", ""),
        x_forward=True,
    )
    return points, _findings(head, points, file)


def _head(text: Iterator[tuple[int, str]], file: str) -> dict[str, str]:
    _, first = next(text, (1, ""))
    if not first.startswith("PathFileType"):
        what = f"line 1 begins with {first[:30]!r}"
        raise InputError.at(file, "", what, "PathFileType is expected: is it a TRC file?")
    if "(X/Y/Z)" not in first.upper():
        raise InputError.at(file, "line 1", f"columns {first.strip()[:60]!r}", "(X/Y/Z) is expected")
    _, keys = next(text, (2, ""))
    _, values = next(text, (3, ""))
    return dict(zip(keys.split(), values.split(), strict=False))


def _names(text: Iterator[tuple[int, str]], file: str) -> tuple[str, ...]:
    number, line = next(text, (4, ""))
    cells = line.rstrip("\r\n").split("\t") if "\t" in line else line.split()
    if len(cells) < 3 or not cells[0].strip().startswith("Frame") or cells[1].strip() != "Time":
        what = f"{line.strip()[:60]!r}"
        raise InputError.at(
            file, f"line {number}", what, "Frame#, Time and the names of markers are expected"
        )
    names = tuple(cell.strip() for cell in cells[2:] if cell.strip())
    if not 1 <= len(names) <= MAX_MARKERS:
        raise InputError.at(file, f"line {number}", f"{len(names)} markers", f"1…{MAX_MARKERS} are expected")
    double = {name for name in names if names.count(name) > 1} if len(set(names)) < len(names) else set()
    if double:
        raise InputError.at(file, f"line {number}", f"twice: {', '.join(sorted(double))[:120]}", "rename one")
    return names


def _cells(line: str, count: int) -> list[str]:
    line = line.rstrip("\r\n")
    if "\t" not in line:
        return line.split()
    cells = line.split("\t")
    return cells[:count] if len(cells) > count and not any(c.strip() for c in cells[count:]) else cells


def _findings(head: dict[str, str], points: Points, file: str) -> tuple[Finding, ...]:
    said = []
    count = len(points.t)
    for key, there in (("NumFrames", count), ("NumMarkers", len(points.names))):
        if key in head and head[key] != str(there):
            said.append(f"its header says {key} {head[key][:20]}, there are {there}")
    try:
        stated = float(head.get("DataRate", "nan"))
    except ValueError:
        stated = float("nan")
    with np.errstate(invalid="ignore"):
        step = float(np.median(np.diff(points.t))) if count > 1 else 0.0
    if stated > 0 and step > 0 and abs(step * stated - 1) > RATE_OFF:
        said.append(f"its header says {stated:g} frames per second, its times {1 / step:.4g}")
    return tuple(Finding(level="warning", subject="", text=f"{file}: {text}") for text in said)


# -- out ----------------------------------------------------------------------------------------


def written(
    names: Sequence[str],
    t: Array,
    positions: Array,
    *,
    name: str = "markers.trc",
    up: str = "y",
    unit: str = "mm",
) -> Iterator[str]:
    """Lines of a TRC file, as OpenSim reads it.

    Args:
        names: Of the markers; blanks become underscores.
        t: [s], shape (n,), evenly spaced.
        positions: World, z up [m], shape (n, k, 3); NaN where not known.
        name: That the file states of itself.
        up: Axis of the file that points up; OpenSim has y, and x forward.
        unit: Of the file.

    Yields:
        Lines with their ends.

    Raises:
        ValueError: Shapes that do not fit, or fewer than two instants.
    """
    if positions.shape != (len(t), len(names), 3) or len(t) < 2:
        raise ValueError(f"{positions.shape} positions of {len(names)} markers at {len(t)} instants")
    rate = 1 / float(np.median(np.diff(t)))
    yield from head(names, len(t), rate, name=name, unit=unit)
    rows = cells(np.asarray(positions @ world_from_file(up, x_forward=True)), unit=unit)
    for number, (instant, row) in enumerate(zip(t.tolist(), rows, strict=True)):
        yield "\t".join([str(number + 1), f"{instant:.6f}", *row]) + "\n"


def head(
    names: Sequence[str], frames: int, rate: float, *, name: str = "markers.trc", unit: str = "mm"
) -> Iterator[str]:
    """Lines of a TRC file before its rows.

    Args:
        names: Of the markers; blanks become underscores.
        frames: How many rows follow.
        rate: Of the rows [1/s].
        name: That the file states of itself.
        unit: Of the file.
    """
    plain = ["_".join(text.split()) or f"M{k + 1}" for k, text in enumerate(names)]
    shown, count = f"{rate:.6g}", len(names)
    yield f"PathFileType\t4\t(X/Y/Z)\t{' '.join(name.split())}\n"
    yield "\t".join(HEAD) + "\n"
    yield f"{shown}\t{shown}\t{frames}\t{count}\t{unit}\t{shown}\t1\t{frames}\n"
    yield "Frame#\tTime\t" + "\t\t\t".join(plain) + "\t\t\n"
    yield "\t\t" + "\t".join(f"{axis}{k + 1}" for k in range(count) for axis in "XYZ") + "\n"
    yield "\n"


def cells(positions: Array, *, unit: str = "mm") -> Iterator[list[str]]:
    """Cells of the markers in each row of a TRC file, three per marker.

    Args:
        positions: In the axes of the file [m], shape (n, k, 3); NaN where not known.
        unit: Of the file.
    """
    values = positions / LENGTHS[unit]
    for row in values.reshape(len(values), -1).tolist():
        yield ["NaN" if isnan(x) else f"{x:.5f}" for x in row]
