"""Files of markers: whose they are, in which unit and which way up; then one person's recording."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from seerob.core.errors import InputError
from seerob.core.quantities import LENGTHS
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, transform
from seerob.description.capture.captured import Captured, Layout, Seen
from seerob.description.capture.mapping import plain
from seerob.files.motion_capture.frame_arrays import FrameArrays, checked
from seerob.files.motion_capture.upright import CLEAR, Up, up_axis, world_from_file

WIDE = 50.0
"""Points of one person that are further apart than this are in another unit [m]."""
SEEN = 0.02
"""A marker that is seen in a smaller share of the frames is left out."""
ALIKE = 0.01
"""Points of one name that are never farther apart [m] are one point twice; a choice, a marker's size."""


@dataclass(frozen=True, kw_only=True)
class MarkerReading:
    """What the user says of a file of markers; what is left open the file or the person tells."""

    file: str
    """What messages call it."""
    subject: str = ""
    """The part of the names before the colon."""
    up: Up | None = None
    """Axis of the file that points up."""
    unit: str = ""
    """Unit of the coordinates."""
    convention: str = ""
    """Whose set of markers it is."""
    unused: frozenset[str] = frozenset()
    """Names that shall not be used."""


@dataclass(frozen=True, eq=False)
class Points:
    """Points as a file has them."""

    names: tuple[str, ...]
    t: Array
    """[s], shape (n,)."""
    values: Array
    """In the file's unit and axes, shape (n, k, 3)."""
    unit: str = ""
    """That the file states; empty when it does not."""
    up: str = ""
    """Axis that points up, as the file states it; empty when it does not."""
    x_forward: bool = False
    """With y up, x points forward in it, as in OpenSim."""
    wxyz: Array | None = None
    """Orientations in the file's axes, w first, shape (n, k, 4)."""
    confidence: Array | None = None
    """From 0 to 1, shape (n, k)."""


def recording(
    points: Points, reading: MarkerReading, *, seen: Seen = Seen.MARKERS, notes: tuple[Finding, ...] = ()
) -> Captured:
    """One person's recording.

    Args:
        points: As the file has them.
        reading: What the user says.
        seen: What the points are.
        notes: What is to be said of the file.

    Raises:
        InputError: The unit, the vertical or the person is not clear, or nothing is seen.
    """
    if len(points.t) < 2 or not points.names:
        what = f"{len(points.t)} frames of {len(points.names)} points"
        raise InputError.at(reading.file, "", what, "two frames are needed")
    said = list(notes)
    chosen, subject = _whose(points, reading, said)
    if seen is Seen.MARKERS:
        chosen = _named_and_seen(points, chosen, reading.file, said)
    factor = LENGTHS[_unit(points, reading, said)]
    points, chosen = _each_once(points, chosen, factor, reading, said)
    values = points.values[:, chosen] * factor
    _check_width(values, reading.file)
    names = tuple(points.names[k].rpartition(":")[2] for k in chosen)
    up = _up(names, values, points.up, reading, said)
    frames = FrameArrays(
        t=points.t,
        positions=values,
        orientations=None if points.wxyz is None else points.wxyz[:, chosen],
        confidence=None if points.confidence is None else points.confidence[:, chosen],
        subjects=subject,
    ).turned(transform(world_from_file(up, x_forward=points.x_forward)))
    frames, rate, found = checked(frames, file=reading.file, subject="")
    return Captured(
        layout=Layout(seen=seen, names=names, convention=reading.convention),
        frames=frames,
        rate=rate,
        count=len(frames),
        findings=(*said, *found),
    )


def _note(said: list[Finding], file: str, text: str, level: str = "note") -> None:
    said.append(Finding(level=level, subject="", text=f"{file}: {text}"))


def _whose(points: Points, reading: MarkerReading, said: list[Finding]) -> tuple[list[int], str]:
    """Columns of the person: by the part of the names before the colon."""
    owners = [name.rpartition(":")[0] for name in points.names]
    counts = Counter(owners)
    if reading.subject:
        if reading.subject not in counts:
            known = ", ".join(sorted(filter(None, counts))) or "no name has a part before a colon"
            raise InputError.at(reading.file, "subject", f"nobody called {reading.subject!r}", known)
        return [k for k, owner in enumerate(owners) if owner == reading.subject], reading.subject
    if len(counts) == 1:
        return list(range(len(owners))), owners[0]
    (most, count), (_, second) = counts.most_common(2)
    shown = ", ".join(f"{name or '(without)'} ({n})" for name, n in counts.most_common(12))
    if count < 2 * second:
        raise InputError.at(
            reading.file, "subject", f"markers of several: {shown}", f'name one: subject = "{most}"'
        )
    text = f"markers of several: {shown}; {most or 'those without'} is taken for the person, as it has most"
    _note(said, reading.file, text, "assumed")
    return [k for k, owner in enumerate(owners) if owner == most], most


def _named_and_seen(points: Points, chosen: list[int], file: str, said: list[Finding]) -> list[int]:
    """Without what has no name, and without what is hardly ever there."""
    named = [k for k in chosen if not points.names[k].rpartition(":")[2].startswith(("*", "Unlabeled", "U_"))]
    if len(named) < len(chosen):
        _note(said, file, f"{len(chosen) - len(named)} points without a name are left out")
    share = np.isfinite(points.values[:, named]).all(axis=2).mean(axis=0)
    kept = [k for k, s in zip(named, share.tolist(), strict=True) if s >= SEEN]
    if len(kept) < len(named):
        lost = ", ".join(points.names[k] for k in named if k not in kept)
        _note(said, file, f"hardly ever seen and left out: {lost[:200]}", "warning")
    if not kept:
        raise InputError.at(file, "", "no marker that has a name and is seen")
    weak = [
        f"{points.names[k]} ({100 * s:.0f} %)"
        for k, s in zip(named, share.tolist(), strict=True)
        if SEEN <= s < 0.9
    ]
    if weak:
        _note(said, file, f"seen in less than 90 % of the frames: {', '.join(weak)[:200]}", "warning")
    return kept


def _each_once(
    points: Points, chosen: list[int], factor: float, reading: MarkerReading, said: list[Finding]
) -> tuple[Points, list[int]]:
    """One column per name: the mean of columns that show one point.

    Raises:
        InputError: Columns of one name show several points: which is meant nobody knows.
    """
    columns: dict[str, list[int]] = {}
    for k in chosen:
        columns.setdefault(plain(points.names[k]) or points.names[k], []).append(k)
    values, one, apart = points.values, [], []
    for own in columns.values():
        one.append(own[0])
        name = points.names[own[0]].rpartition(":")[2]
        if len(own) == 1 or name in reading.unused:
            continue
        group = points.values[:, own]
        seen = np.asarray(np.isfinite(group).all(axis=2))[..., None]
        together = group[seen.all(axis=(1, 2))] * factor
        extent = together.max(axis=1) - together.min(axis=1)
        far = float(np.linalg.norm(extent, axis=1).max()) if len(together) else np.inf
        if far > ALIKE:
            how = f"up to {far:.3g} m apart" if len(together) else "never seen together"
            apart.append(f"{name} ({len(own)} times, {how})")
        else:
            values = values.copy() if values is points.values else values
            count = seen.sum(axis=1)
            values[:, own[0]] = np.where(
                count > 0, np.where(seen, group, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan
            )
            text = f"{name} is there {len(own)} times, at most {1e3 * far:.2g} mm apart: their mean is used"
            _note(said, reading.file, text, "warning")
    if apart:
        remedy = f'rename one, or use none: mapping = {{ "{apart[0].partition(" (")[0]}" = "" }}'
        raise InputError.at(
            reading.file, "", f"one name for several points: {', '.join(apart)[:300]}", remedy
        )
    return replace(points, values=values), one


def _unit(points: Points, reading: MarkerReading, said: list[Finding]) -> str:
    stated = points.unit.strip().lower().replace("metres", "m").replace("meters", "m")
    stated = {"millimeters": "mm", "centimeters": "cm", "in": "inch"}.get(stated, stated)
    if reading.unit:
        if stated and stated != reading.unit:
            _note(
                said, reading.file, f"the file says {points.unit}, {reading.unit} is used as told", "warning"
            )
        return reading.unit
    if stated in LENGTHS:
        return stated
    what = f"unit {points.unit!r} is not known" if stated else "the file does not say its unit"
    size = _width(points.values)
    guess = next((u for u, f in (("m", 1.0), ("cm", 0.01), ("mm", 0.001)) if 0.3 <= size * f <= 4.0), "mm")
    remedy = f'give unit = "{guess}" if the points of the person are {size:.4g} {guess} apart at most'
    raise InputError.at(reading.file, "unit", what, remedy)


def _width(values: Array) -> float:
    """Median over the frames of the largest extent of the points, in their unit."""
    some = values[:: max(1, len(values) // 300)]
    low, high = np.where(np.isnan(some), np.inf, some).min(1), np.where(np.isnan(some), -np.inf, some).max(1)
    with np.errstate(invalid="ignore", over="ignore"):
        extent = (high - low).max(axis=1)
    extent = extent[np.isfinite(extent)]
    return float(np.median(extent)) if len(extent) else 0.0


def _check_width(values: Array, file: str) -> None:
    width = _width(values)
    if width > WIDE:
        what = f"the points of one person are {width:.4g} m apart"
        raise InputError.at(file, "unit", what, 'give the unit in which the file really is: unit = "mm"')


def _up(
    names: tuple[str, ...], values: Array, stated: str, reading: MarkerReading, said: list[Finding]
) -> str:
    found = up_axis(names, values)
    clear = found is not None and found[1] >= CLEAR
    up = (reading.up.value if reading.up is not None else "") or stated
    if up:
        if clear and found is not None and found[0] != up:
            who = "you say" if reading.up is not None else "the file says"
            text = f"{who} that {up} is up, but along {found[0]} the head is above the feet"
            _note(said, reading.file, text, "warning")
        elif reading.up is None:
            _note(said, reading.file, f"{up} is up, as the file says")
        return up
    if found is None or not clear:
        what = "the file does not say which axis is up, and its names do not show it"
        raise InputError.at(reading.file, "up", what, 'give up = "z", "y" …')
    text = f"{found[0]} is taken for up: the head is above the feet along it; give up if that is wrong"
    _note(said, reading.file, text, "assumed")
    return found[0]
