"""Zones copied from a robot controller's safety configuration, as safety areas: a table in TOML or JSON.

No maker's own format is read: none is public enough to be sure of what its figures mean. The table holds
what the configuration shows on the teach pendant or prints, in the frame that the controller states it in.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, NamedTuple

import msgspec

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.files.bounded import TooLarge, content
from seerob.core.files.toml_file import read_toml
from seerob.core.quantities import Coordinate, Corners, Metres3, Name, Pose, Table, unit
from seerob.core.shapes import check_polygon
from seerob.workstation.conversion import convert, tables
from seerob.workstation.tables.simple_shape import MAX_SIZE

MOST_ZONES = 500
MAX_SIZE_OF_JSON = 1 << 20
"""[bytes]"""


class Zone(Table, frozen=True, kw_only=True):
    """A zone as the controller states it."""

    name: Name
    """The area is called like it."""
    polygon: Corners | None = None
    """Corners (x, y) of a floor plan, in either sense, concave or not [m]."""
    height: Annotated[tuple[Coordinate, Coordinate], unit("m")] | None = None
    """Lower and upper end along z of what stands over ``polygon`` [m]."""
    low: Metres3 | None = None
    """Corner of a box with the smallest coordinates [m]."""
    high: Metres3 | None = None
    """The opposite corner [m]."""

    def __post_init__(self) -> None:
        ways = (
            self.polygon is not None or self.height is not None,
            self.low is not None or self.high is not None,
        )
        whole = (
            self.polygon is not None and self.height is not None,
            self.low is not None and self.high is not None,
        )
        if sum(ways) != 1 or ways != whole:
            raise ValueError("give either polygon and height, or low and high")
        if self.polygon is not None:
            check_polygon(self.polygon)
        corners = ((-MAX_SIZE,) * 3, (MAX_SIZE,) * 3)
        low, high = self.low or corners[0], self.high or corners[1]
        if self.height is not None:
            low, high = (*low[:2], self.height[0]), (*high[:2], self.height[1])
        for axis, a, b in zip("xyz", low, high, strict=True):
            if a >= b:
                raise ValueError(f"{axis} from {a:g} to {b:g} m is no interval: the lower end comes first")

    def shape(self) -> dict[str, object]:
        """Table of a simple shape."""
        if self.low is not None and self.high is not None:
            (x0, y0, z0), (x1, y1, z1) = self.low, self.high
            return {"polygon": [[x0, y0], [x1, y0], [x1, y1], [x0, y1]], "height": [z0, z1]}
        assert self.polygon is not None
        assert self.height is not None
        return {"polygon": [list(corner) for corner in self.polygon], "height": list(self.height)}


class Frame(Table, frozen=True, kw_only=True):
    """What a file of zones says beside them."""

    source: str
    """Where the figures come from: controller, its safety checksum, date."""
    on: str | None = None
    """Full name of the link whose frame they are in, such as ``ur10/base_link``; the world when not given."""
    at: Pose = Pose()
    """Pose of their frame in that one."""

    def __post_init__(self) -> None:
        if not self.source.strip():
            raise ValueError("source is empty: say which configuration the figures were copied from")


class Zones(NamedTuple):
    """What a file of zones gives."""

    areas: tuple[dict[str, Any], ...]
    """Tables of ``[[areas]]``."""
    files: dict[str, bytes]
    """The file, by the name that the workstation gives it."""


def zones_of(name: object, folder: Path, file: str, problems: list[Problem]) -> Zones:
    """Areas of the file of zones that a workstation names.

    Args:
        name: What the workstation says, a path beside it.
        folder: Of the workstation.
        file: The workstation file, for messages.
        problems: Receives every mistake; a zone with one is left out.
    """
    if not isinstance(name, str) or not name.strip():
        problems.append(Problem(file, "zones", f"{name!r} is no file name", "a file beside this one"))
        return Zones((), {})
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name:
        what = f"{name} is not beside the workstation file"
        problems.append(Problem(file, "zones", what, "put it into the folder of the workstation"))
        return Zones((), {})
    try:
        table, raw = _read(folder / path)
    except InputError as error:
        problems += error.problems
        return Zones((), {})
    where = str(folder / path)
    entries = tables(table.get("zones", []), "zones", where, problems)
    if not 1 <= len(entries) <= MOST_ZONES:
        what = f"{len(entries)} zones"
        problems.append(Problem(where, "zones", what, f"give 1 to {MOST_ZONES} tables [[zones]]"))
        return Zones((), {})
    head = {key: value for key, value in table.items() if key != "zones"}
    frame = convert(head, Frame, file=where, key="", problems=problems, beside=("zones",))
    areas = []
    for i, entry in enumerate(entries):
        zone = convert(entry, Zone, file=where, key=f"zones[{i}]", problems=problems)
        if zone is not None and frame is not None:
            area: dict[str, object] = {"name": zone.name, "shape": zone.shape()}
            if frame.on is not None:
                area["on"] = frame.on
            areas.append({**area, "at": _plain(frame.at)})
    return Zones(tuple(areas), {path.as_posix(): raw})


def _plain(pose: Pose) -> dict[str, object]:
    given: dict[str, object] = msgspec.to_builtins(pose)
    return {key: value for key, value in given.items() if value is not None}


def _read(path: Path) -> tuple[Mapping[str, object], bytes]:
    """Content of a file of zones, parsed and raw.

    Raises:
        InputError: Neither TOML nor JSON, too large, not readable, or no table.
    """
    if path.suffix.lower() == ".toml":
        return read_toml(path)
    if path.suffix.lower() != ".json":
        remedy = suggestion(path.suffix, [".toml", ".json"])
        raise InputError.at(path, "", f"{path.suffix or 'no ending'!r} is no format of zones", remedy)
    try:
        raw = content(path, MAX_SIZE_OF_JSON)
    except OSError as error:
        what = f"cannot be read: {error.strerror}"
        raise InputError.at(path, "", what, "check name and permissions") from error
    except TooLarge:
        remedy = "give a table of zones, which is far smaller"
        raise InputError.at(path, "", "larger than 1 MiB", remedy) from None
    try:
        table = msgspec.json.decode(raw)
    except (msgspec.DecodeError, RecursionError) as error:
        raise InputError.at(path, "", f"not JSON: {error}", "export it again, or write TOML") from error
    if not isinstance(table, dict):
        raise InputError.at(path, "", "no object at the top", 'write { "source": …, "zones": [ … ] }')
    return table, raw
