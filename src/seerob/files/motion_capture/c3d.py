"""C3D: the markers of a person; what was computed from them (angles, forces) is left out.

The bytes of a file are header, parameters, points (www.c3d.org, "The C3D File Format User Guide"). They are
read here and not by a library: of 477 files with changed bytes the usual reader crashed the process on 15 and
did not come back from 5. It is a peer in the tests.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.capture.captured import Captured
from seerob.files.motion_capture.frame_arrays import check_size
from seerob.files.motion_capture.markers import MarkerReading, Points, recording
from seerob.files.tables.table_files import check_file

BLOCK = 512
MAGIC = 0x50
MAX_BYTES = 16 << 30
MAX_POINTS = 10_000
MAX_PARAMETERS = 10_000
INTEL, DEC, MIPS = 84, 85, 86
CHUNK = 64 << 20
"""Bytes of frames that are looked at together."""


class Parameter(NamedTuple):
    """One entry of a group."""

    dims: tuple[int, ...]
    """Column-major; empty for a single value."""
    values: tuple[float, ...] | tuple[str, ...]


Groups = dict[str, dict[str, Parameter]]


@dataclass(frozen=True, eq=False)
class C3d:
    """What a C3D file holds, in its own units and axes."""

    labels: tuple[str, ...]
    """Labels of the points."""
    points: Array
    """Shape (n, k, 3), NaN where a point was not seen."""
    rate: float
    """Frames per second."""
    first: int
    """Number of the first frame."""
    units: str
    """``mm``; empty when the file does not say."""
    groups: Groups
    missing_frames: int = 0
    """Frames that the header promises and the file does not have."""
    zeros: int = 0
    """Points at exactly 0, 0, 0, which count as not seen."""


def read_points(path: Path, *, file: str) -> C3d:
    """A C3D file.

    Args:
        path: The file.
        file: As messages name it.

    Raises:
        InputError: It is none, or contradicts itself.
    """
    head = check_file(path, file, MAX_BYTES)
    size = path.stat().st_size
    if len(head) < BLOCK or head[1] != MAGIC or head[0] == 0:
        raise InputError.at(file, "", "no C3D file: its second byte is not 80", "export it as C3D")
    with path.open("rb") as stream:
        order, section = _section(stream, head[0], size, file)
        groups = _groups(section, order)
        layout = _layout(head, order, groups, size, file)
        points, zeros = _points(stream, layout)
    return C3d(
        labels=_labels(groups, layout.points),
        points=points,
        rate=layout.rate,
        first=layout.first,
        units=_text(groups, "POINT", "UNITS"),
        groups=groups,
        missing_frames=layout.promised - layout.frames,
        zeros=zeros,
    )


class _Order(NamedTuple):
    sign: str
    """Of `struct` and numpy: ``<`` or ``>``."""
    dec: bool

    def floats(self, raw: bytes) -> NDArray[np.float64]:
        words = np.frombuffer(raw, self.sign + "u4")
        if self.dec:
            # The DEC format has its 16-bit halves exchanged and its exponent two higher.
            words = (words << 16) | (words >> 16)
            with np.errstate(all="ignore"):
                return (words.astype("<u4").view("<f4") / 4).astype(float)
        with np.errstate(invalid="ignore"):  # a signalling NaN
            return words.view(self.sign + "f4").astype(float)


class _Layout(NamedTuple):
    order: _Order
    points: int
    analog: int
    """Analogue values per frame of points."""
    first: int
    frames: int
    promised: int
    start: int
    """Offset of the first frame [byte]."""
    scale: float
    rate: float

    @property
    def width(self) -> int:
        """Bytes per value."""
        return 4 if self.scale < 0 else 2


# -- parameters ---------------------------------------------------------------------------------


def _section(stream: Any, block: int, size: int, file: str) -> tuple[_Order, bytes]:
    at = (block - 1) * BLOCK
    stream.seek(at)
    start = stream.read(4)
    if len(start) < 4:
        raise InputError.at(file, "", f"its parameters should begin at byte {at}, it has {size}")
    count, processor = start[2], start[3]
    if processor not in (INTEL, DEC, MIPS):
        what = f"processor {processor} is none of {INTEL}, {DEC}, {MIPS}"
        raise InputError.at(file, "", what, "the file is damaged: export it anew")
    # Some writers leave the number of blocks at 0 or too small: what follows tells where it ends.
    raw = stream.read(max(count, 255) * BLOCK)
    return _Order(">" if processor == MIPS else "<", processor == DEC), raw


def _groups(raw: bytes, order: _Order) -> Groups:
    """Parameters by group; reading ends where they end or stop making sense."""
    names: dict[int, str] = {}
    entries: list[tuple[int, str, Parameter]] = []
    at = 0
    for _ in range(MAX_PARAMETERS):
        if at + 4 > len(raw):
            break
        length, number = struct.unpack_from("bb", raw, at)
        count = abs(length)
        if count == 0 or number == 0:
            break
        name = raw[at + 2 : at + 2 + count].decode("latin-1").strip().upper()
        at += 2 + count
        if at + 2 > len(raw):
            break
        (step,) = struct.unpack_from(order.sign + "h", raw, at)
        if number < 0:
            names.setdefault(-number, name)
        else:
            parameter = _parameter(raw, at + 2, order)
            if parameter is not None:
                entries.append((number, name, parameter))
        if step <= 0:
            break
        at += step
    groups: Groups = {}
    for number, name, parameter in entries:
        groups.setdefault(names.get(number, str(number)), {}).setdefault(name, parameter)
    return groups


def _parameter(raw: bytes, at: int, order: _Order) -> Parameter | None:
    if at + 2 > len(raw):
        return None
    kind, rank = struct.unpack_from("bB", raw, at)
    if rank > 7 or at + 2 + rank > len(raw):
        return None
    dims = tuple(raw[at + 2 : at + 2 + rank])
    at += 2 + rank
    count = int(np.prod(dims, dtype=np.int64)) if dims else 1
    width = abs(kind)
    if width not in (1, 2, 4) or at + count * width > len(raw):
        return None
    data = raw[at : at + count * width]
    if kind == -1:
        each = dims[0] if dims else 1
        texts = (data[k * each : (k + 1) * each] for k in range(count // each if each else 0))
        return Parameter(dims, tuple(text.decode("latin-1").rstrip("\0 ").strip() for text in texts))
    if kind == 4:
        return Parameter(dims, tuple(order.floats(data).tolist()))
    return Parameter(dims, tuple(np.frombuffer(data, f"{order.sign}i{width}").astype(float).tolist()))


def _number(groups: Groups, group: str, name: str, index: int = 0) -> float | None:
    parameter = groups.get(group, {}).get(name)
    if parameter is None or len(parameter.values) <= index:
        return None
    value = parameter.values[index]
    return None if isinstance(value, str) or not np.isfinite(value) else float(value)


def _text(groups: Groups, group: str, name: str) -> str:
    parameter = groups.get(group, {}).get(name)
    values = parameter.values if parameter is not None else ()
    return values[0] if values and isinstance(values[0], str) else ""


def _labels(groups: Groups, count: int) -> tuple[str, ...]:
    """Names of the points: LABELS, and from the 256th on LABELS2 …; those without one by their number."""
    found: list[str] = []
    for suffix in ("", *range(2, MAX_POINTS // 255 + 2)):
        parameter = groups.get("POINT", {}).get(f"LABELS{suffix}")
        if parameter is None:
            break
        found += [str(value) for value in parameter.values]
    found += [""] * (count - len(found))
    return tuple(name or f"*{k + 1}" for k, name in enumerate(found[:count]))


# -- points -------------------------------------------------------------------------------------


def _layout(head: bytes, order: _Order, groups: Groups, size: int, file: str) -> _Layout:
    words = struct.unpack_from(order.sign + "10H", head, 0)
    scale, rate = order.floats(head[12:16])[0], order.floats(head[20:24])[0]
    points, analog, first, last, start = words[1], words[2], words[3], words[4], words[8]
    said = _number(groups, "POINT", "RATE")
    rate = said if said is not None and said > 0 else float(rate)
    scale = _number(groups, "POINT", "SCALE") or float(scale)
    block = _number(groups, "POINT", "DATA_START")
    start = start or (int(block) & 0xFFFF if block is not None else 0)
    if points == 0 or points > MAX_POINTS:
        raise InputError.at(file, "", f"{points} points per frame", f"1…{MAX_POINTS} are expected")
    if not (np.isfinite(rate) and 0.1 <= rate <= 100_000):
        raise InputError.at(file, "POINT:RATE", f"{rate:g} frames per second")
    if not np.isfinite(scale) or scale == 0:
        raise InputError.at(file, "POINT:SCALE", f"{scale:g}")
    if start < 2:
        raise InputError.at(file, "POINT:DATA_START", f"block {start}", "the file is damaged")
    promised = _promised(groups, first, last)
    bytes_per_frame = (4 * points + analog) * (4 if scale < 0 else 2)
    offset = (start - 1) * BLOCK
    there = max(0, size - offset) // bytes_per_frame
    # 65535 is all that the header can say; longer files are as long as they are.
    frames = there if promised >= 0xFFFF and _long(groups) is None else min(promised, there)
    check_size(file, frames, 3 * points)
    if frames < 1:
        raise InputError.at(file, "", "no frames in it", "was it cut short?")
    return _Layout(order, points, analog, first, frames, max(promised, frames), offset, scale, rate)


def _long(groups: Groups) -> int | None:
    """Number of frames where the header's 16 bits do not hold it."""
    ends = []
    for name in ("ACTUAL_START_FIELD", "ACTUAL_END_FIELD"):
        low, high = _number(groups, "TRIAL", name), _number(groups, "TRIAL", name, 1)
        if low is None or high is None:
            break
        ends.append((int(low) & 0xFFFF) + ((int(high) & 0xFFFF) << 16))
    if len(ends) == 2 and 0 < ends[0] <= ends[1]:
        return ends[1] - ends[0] + 1
    long = _number(groups, "POINT", "LONG_FRAMES")
    return int(long) if long is not None and 0 < long < 2**31 else None


def _promised(groups: Groups, first: int, last: int) -> int:
    count = last - first + 1 if last >= first else 0
    long = _long(groups)
    if long is not None and (long > count or long > 0xFFFF):
        return long
    said = _number(groups, "POINT", "FRAMES")
    return count or (int(said) & 0xFFFF if said is not None and abs(said) < 2**31 else 0)


def _points(stream: Any, layout: _Layout) -> tuple[Array, int]:
    values = 4 * layout.points + layout.analog
    step = max(1, CHUNK // (values * layout.width))
    result = np.empty((layout.frames, layout.points, 3))
    zeros = 0
    stream.seek(layout.start)
    for begin in range(0, layout.frames, step):
        count = min(step, layout.frames - begin)
        raw = stream.read(count * values * layout.width)
        if layout.scale < 0:
            table, factor = layout.order.floats(raw), 1.0
        else:
            table, factor = np.frombuffer(raw, layout.order.sign + "i2").astype(float), layout.scale
        rows = table.reshape(count, values)[:, : 4 * layout.points].reshape(count, -1, 4)
        xyz, state = rows[..., :3] * factor, rows[..., 3]
        with np.errstate(invalid="ignore"):
            unseen = ~(state >= 0) | ~np.isfinite(xyz).all(axis=-1)
        at_zero = (xyz == 0).all(axis=-1) & ~unseen
        zeros += int(at_zero.sum())
        result[begin : begin + count] = np.where((unseen | at_zero)[..., None], np.nan, xyz)
    return result, zeros


NO_POINTS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
"""Entries of POINT that list what stands among the points and is none (Vicon)."""


def read(path: Path, reading: MarkerReading) -> Captured:
    """The markers of one person.

    Raises:
        InputError: It is no C3D file, or the unit, the vertical or the person is not clear.
    """
    found = read_points(path, file=reading.file)
    said: list[Finding] = []

    def note(text: str, level: str = "warning") -> None:
        said.append(Finding(level=level, subject="", text=f"{reading.file}: {text}"))

    if found.missing_frames:
        note(f"it ends early: {found.missing_frames} frames are missing at the end")
    if found.zeros:
        note(f"{found.zeros} points at exactly 0, 0, 0 count as not seen")
    computed = _computed(found)
    kept = [k for k, label in enumerate(found.labels) if label not in computed]
    if len(kept) < len(found.labels):
        note(f"{len(found.labels) - len(kept)} computed quantities among the points are left out", "note")
    points = Points(
        names=tuple(found.labels[k] for k in kept),
        t=(found.first - 1 + np.arange(len(found.points))) / found.rate,
        values=found.points[:, kept],
        unit=found.units,
        up=vertical(found),
    )
    return recording(points, reading, notes=tuple(said))


def _computed(found: C3d) -> set[str]:
    point = found.groups.get("POINT", {})
    lists = (point[name].values for name in NO_POINTS if name in point)
    return {value for values in lists for value in values if isinstance(value, str)}


def vertical(found: C3d) -> str:
    """The axis that points up on the screen, ``z``; empty when the file does not say."""
    screen = found.groups.get("POINT", {}).get("Y_SCREEN")
    value = screen.values[0] if screen is not None and screen.values else ""
    text = value.strip().upper() if isinstance(value, str) else ""
    axis = text.lstrip("+-").lower()
    if axis not in ("x", "y", "z"):
        return ""
    return ("-" if text.startswith("-") else "") + axis
