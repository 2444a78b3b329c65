"""Tables in OpenSim's storage format (.mot, .sto): a header with ``inDegrees``, a line of labels, rows."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError, Problem
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.files.motion_capture.frame_arrays import MAX_VALUES
from seerob.files.tables.grid import MAX_PROBLEMS
from seerob.files.tables.table_files import encoding_of, lines

MAX_HEADER = 200
"""Lines before ``endheader``."""
MAX_LABELS = 5000


@dataclass(frozen=True, eq=False)
class Storage:
    """What a file holds, as it stands there."""

    title: str
    degrees: bool | None
    """Whether angles are in degrees; None when it does not say."""
    labels: tuple[str, ...]
    """Without the time."""
    t: Array
    """[s], shape (n,)."""
    values: Array
    """Shape (n, k)."""
    findings: tuple[Finding, ...] = ()


def read(path: Path, *, file: str) -> Storage:
    """A storage file.

    Raises:
        InputError: It is none, or a row is wrong.
    """
    text = enumerate(lines(path, file, encoding_of(path, file)), start=1)
    title, head = _head(text, file)
    number, labels = _labels(text, file)
    t, flat = array("d"), array("d")
    problems: list[Problem] = []
    for number, line in text:
        cells = line.split()
        if not cells:
            continue
        if len(cells) != len(labels):
            problems.append(Problem(file, f"line {number}", f"{len(cells)} values, {len(labels)} labels"))
        else:
            try:
                values = list(map(float, cells))
            except ValueError as error:
                problems.append(Problem(file, f"line {number}", str(error)[:120]))
            else:
                t.append(values[0])
                flat.extend(values[1:])
        if len(problems) >= MAX_PROBLEMS:
            break
        if len(flat) > MAX_VALUES:
            raise InputError.at(file, f"line {number}", f"more than {MAX_VALUES} numbers", "split the file")
    if problems:
        raise InputError(problems)
    said = []
    for key, there in (("nrows", len(t)), ("ncolumns", len(labels)), ("datarows", len(t))):
        if key in head and head[key] != str(there):
            said.append(f"its header says {key} = {head[key][:20]}, there are {there}")
    degrees = {"yes": True, "no": False}.get(head.get("indegrees", "").lower())
    return Storage(
        title=title,
        degrees=degrees,
        labels=tuple(labels[1:]),
        t=np.array(t),
        values=np.array(flat).reshape(len(t), len(labels) - 1),
        findings=tuple(Finding(level="warning", subject="", text=f"{file}: {text}") for text in said),
    )


def _head(text: Iterator[tuple[int, str]], file: str) -> tuple[str, dict[str, str]]:
    title = ""
    head: dict[str, str] = {}
    for number, line in text:
        plain = line.strip()
        if plain.lower() == "endheader":
            return title, head
        key, equals, value = plain.partition("=")
        if not equals:
            # The older form: a key, blanks, a value.
            key, _, value = plain.partition(" ")
        head[key.strip().lower()] = value.strip()
        title = title or plain[:200]
        if number > MAX_HEADER:
            break
    raise InputError.at(file, "", "no line endheader in it", "is it a storage file of OpenSim (.mot, .sto)?")


def _labels(text: Iterator[tuple[int, str]], file: str) -> tuple[int, list[str]]:
    for number, line in text:
        labels = line.split()
        if not labels:
            continue
        if labels[0].lower() != "time":
            raise InputError.at(
                file, f"line {number}", f"labels begin with {labels[0][:40]!r}", "time is expected"
            )
        if not 2 <= len(labels) <= MAX_LABELS:
            raise InputError.at(
                file, f"line {number}", f"{len(labels)} labels", f"2…{MAX_LABELS} are expected"
            )
        double = [name for name in dict.fromkeys(labels) if labels.count(name) > 1]
        if double:
            raise InputError.at(file, f"line {number}", f"twice: {', '.join(double)[:120]}", "rename one")
        return number, labels
    raise InputError.at(file, "", "nothing follows endheader", "was it cut short?")


# -- out ----------------------------------------------------------------------------------------


def written(
    labels: Sequence[str], t: Array, values: Array, *, name: str = "motion", degrees: bool = True
) -> Iterator[str]:
    """Lines of a storage file, as OpenSim reads it.

    Args:
        labels: Of the columns but the time; no blanks.
        t: [s], shape (n,).
        values: In the unit of the file, shape (n, k); NaN where not known.
        name: Title of the file.
        degrees: What its header says of angles.

    Yields:
        Lines with their ends.

    Raises:
        ValueError: Shapes that do not fit.
    """
    if values.shape != (len(t), len(labels)):
        raise ValueError(f"{values.shape} values for {len(labels)} labels at {len(t)} instants")
    yield from head(labels, len(t), name=name, degrees=degrees)
    for instant, row in zip(t.tolist(), values.tolist(), strict=True):
        yield "\t".join([f"{instant:.6f}", *cells(row)]) + "\n"


def head(
    labels: Sequence[str],
    rows: int,
    *,
    name: str = "motion",
    degrees: bool = True,
    remarks: Sequence[str] = (),
) -> Iterator[str]:
    """Lines of a storage file before its rows; see `written`.

    Args:
        labels: Of the columns but the time.
        rows: How many there are.
        name: Title of the file.
        degrees: What it says of angles.
        remarks: Lines that readers skip, with their ends; neither ``=`` nor ``endheader`` in them.
    """
    yield f"{' '.join(name.split())}\n"
    yield "version=1\n"
    yield f"nRows={rows}\n"
    yield f"nColumns={len(labels) + 1}\n"
    yield f"inDegrees={'yes' if degrees else 'no'}\n"
    yield from remarks
    yield "endheader\n"
    yield "\t".join(["time", *("_".join(label.split()) for label in labels)]) + "\n"


def cells(row: Sequence[float]) -> list[str]:
    """Cells of a row of a storage file, without the time."""
    return ["NaN" if isnan(x) else f"{x:.8f}" for x in row]
