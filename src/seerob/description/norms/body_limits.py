"""Biomechanical limits of the human body, ISO/TS 15066:2016 Annex A: a data file that can be replaced.

The file that ships is ``iso_ts_15066_2016.toml``; a licensed user names an own file of the same form.
What no file may do: permit contact with skull, forehead or face, or raise the transient multiplier
above 2.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec import Struct

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.files.bounded import TooLarge, content
from seerob.core.files.toml_file import loads

SHIPPED = "iso_ts_15066_2016.toml"
REGIONS = (
    "Skull and forehead",
    "Face",
    "Neck",
    "Back and shoulders",
    "Chest",
    "Abdomen",
    "Pelvis",
    "Upper arms and elbow joints",
    "Lower arms and wrist joints",
    "Hands and fingers",
    "Thighs and knees",
    "Lower legs",
)
"""The twelve body regions of ISO/TS 15066:2016 Table A.3."""
FORBIDDEN = frozenset(REGIONS[:2])
"""Contact is not permitted, ISO/TS 15066:2016 A.3.2, whatever a file says."""
LARGEST_MULTIPLIER = 2.0
"""Of the transient limits over the quasi-static ones."""
MAX_FILE_SIZE = 1 << 20

_TO_SI: dict[str, dict[str, float]] = {
    "force": {"N": 1.0},
    "pressure": {"Pa": 1.0, "kPa": 1e3, "N/cm2": 1e4, "MPa": 1e6},
    "stiffness": {"N/m": 1.0, "N/mm": 1e3},
    "mass": {"kg": 1.0},
    "energy": {"J": 1.0},
    "multiplier": {"": 1.0},
}
_SI = {"force": "N", "pressure": "Pa", "stiffness": "N/m", "mass": "kg", "energy": "J", "multiplier": ""}
_PLAUSIBLE = {
    "force": (50.0, 250.0, "N"),
    "pressure": (60e4, 300e4, "Pa"),
    "stiffness": (5e3, 200e3, "N/m"),
    "mass": (0.3, 100.0, "kg"),
    "energy": (0.05, 5.0, "J"),
}
"""Quasi-static figures outside, and transient energies, are usually a mistaken unit or column."""

Confidence = Literal["2S", "1S", "1S+M", "M", "D", "own"]


@dataclass(frozen=True)
class Figure:
    """One value with where it is from."""

    value: float
    """In ``unit``, SI."""
    unit: str
    source: str
    """Edition, clause, public sources and confidence."""
    confidence: Confidence


@dataclass(frozen=True)
class BodyArea:
    """One specific body area of Table A.2."""

    number: int
    name: str
    """With the side where the table tells dominant and non-dominant apart."""
    seen_from: str
    """``front`` or ``rear``: recollection in every row of the file that ships."""
    pressure: Figure
    """Quasi-static p_s [Pa]."""


@dataclass(frozen=True)
class BodyRegion:
    """One body region of Table A.3 with its areas; quasi-static figures."""

    name: str
    permitted: bool
    permission_source: str
    force: Figure
    """F_s [N]."""
    multiplier: Figure | None
    """Transient over quasi-static, of force and pressure; None where contact is not permitted."""
    stiffness: Figure
    """k [N/m]."""
    mass: Figure
    """m_H [kg]."""
    energy: Figure | None
    """Printed transient energy [J]; None when the file has none."""
    areas: tuple[BodyArea, ...]

    @property
    def pressure(self) -> Figure:
        """The least p_s of its areas [Pa]."""
        return min((area.pressure for area in self.areas), key=lambda figure: figure.value)


@dataclass(frozen=True)
class BodyLimits:
    """A table of limits."""

    title: str
    edition: str
    file: str
    reviewed_by: str
    """Who answers for figures outside the usual ranges; empty for none."""
    regions: dict[str, BodyRegion]

    def region(self, name: str) -> BodyRegion | None:
        """The region of that name; None when the table has no limit for it."""
        return self.regions.get(name)


# -- the file -----------------------------------------------------------------------------------


class _Cell(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    value: float
    confidence: Confidence
    sources: str


class _Permission(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    value: bool
    confidence: Confidence
    sources: str


class _Area(Struct, frozen=True, forbid_unknown_fields=True):
    number: int
    name: str
    pressure: _Cell
    seen_from: Literal["front", "rear"]
    side: Literal["", "dominant", "non-dominant"] = ""


class _Region(Struct, frozen=True, forbid_unknown_fields=True):
    name: str
    permitted: _Permission
    force: _Cell
    stiffness: _Cell
    mass: _Cell
    areas: tuple[_Area, ...]
    multiplier: _Cell | None = None
    energy: _Cell | None = None


class _Units(Struct, frozen=True, forbid_unknown_fields=True):
    force: Literal["N"]
    pressure: Literal["Pa", "kPa", "N/cm2", "MPa"]
    stiffness: Literal["N/m", "N/mm"]
    mass: Literal["kg"]
    energy: Literal["J"] = "J"


class _File(Struct, frozen=True, forbid_unknown_fields=True):
    title: str
    edition: str
    units: _Units
    sources: dict[str, str]
    regions: tuple[dict[str, Any], ...]
    clauses: dict[str, str] = {}
    reviewed_by: str = ""


@cache
def shipped() -> BodyLimits:
    """The limits of ISO/TS 15066:2016 as public sources tell them."""
    return parse(files("seerob.description.norms").joinpath(SHIPPED).read_bytes(), file=SHIPPED)


def read(path: Path) -> BodyLimits:
    """Limits of an own file of the form of the one that ships.

    Raises:
        InputError: With every mistake.
    """
    try:
        raw = content(path, MAX_FILE_SIZE)
    except OSError as error:
        raise InputError.at(path, "", f"cannot be read: {error.strerror}", "give a TOML file") from error
    except TooLarge:
        raise InputError.at(path, "", "larger than 1 MiB", "a table of limits is far smaller") from None
    return parse(raw, file=str(path))


def parse(raw: bytes, *, file: str) -> BodyLimits:
    """Limits from the content of a file.

    Raises:
        InputError: With every mistake; nothing is taken over in part.
    """
    try:
        table = msgspec.convert(loads(raw.decode("utf-8-sig")), _File)
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, ValueError, RecursionError) as error:
        raise InputError.at(file, "", str(error), f"take {SHIPPED} as the pattern") from error
    builder = _Builder(table, file)
    regions = [region for i, row in enumerate(table.regions) if (region := builder.region(i, row))]
    if not table.regions:
        builder.problem("regions", "no body region", "give at least one")
    if builder.problems:
        raise InputError(builder.problems)
    return BodyLimits(table.title, table.edition, file, table.reviewed_by, {r.name: r for r in regions})


class _Builder:
    """From rows to regions, collecting mistakes."""

    def __init__(self, table: _File, file: str) -> None:
        self.table, self.file = table, file
        self.problems: list[Problem] = []
        self.names: set[str] = set()
        self.numbers: set[int] = set()

    def problem(self, key: str, what: str, remedy: str) -> None:
        self.problems.append(Problem(self.file, key, what, remedy))

    def region(self, i: int, row: dict[str, object]) -> BodyRegion | None:
        key = f"regions[{i}]"
        try:
            read = msgspec.convert(row, _Region)
        except msgspec.ValidationError as error:
            self.problem(key, str(error), f"take {SHIPPED} as the pattern")
            return None
        key = f"{key} ({read.name})"
        if read.name not in REGIONS:
            self.problem(key, "unknown body region", suggestion(read.name, REGIONS))
        if read.name in self.names:
            self.problem(key, "given twice", "keep one")
        self.names.add(read.name)
        self._permission(key, read)
        if not read.areas:
            self.problem(f"{key}.areas", "no body area", "give at least one with its pressure")
        before = len(self.problems)
        areas = tuple(self._area(key, area) for area in read.areas)
        figures = {
            quantity: self._figure(f"{key}.{quantity}", quantity, cell)
            for quantity in ("force", "stiffness", "mass", "energy", "multiplier")
            if (cell := getattr(read, quantity)) is not None
        }
        if len(self.problems) > before or not areas:
            return None
        clause = self.table.clauses.get("contact", "")
        return BodyRegion(
            name=read.name,
            permitted=read.permitted.value,
            permission_source=self._source(clause, read.permitted.confidence, read.permitted.sources, key),
            force=figures["force"],
            multiplier=figures.get("multiplier"),
            stiffness=figures["stiffness"],
            mass=figures["mass"],
            energy=figures.get("energy"),
            areas=areas,
        )

    def _permission(self, key: str, read: _Region) -> None:
        if read.name in FORBIDDEN and read.permitted.value:
            what = "contact is said to be permitted"
            self.problem(f"{key}.permitted", what, "contact with skull, forehead and face never is")
        if not read.permitted.value and read.multiplier is not None:
            what = "a transient limit where contact is not permitted"
            self.problem(f"{key}.multiplier", what, "leave it out")
        if read.permitted.value and read.multiplier is None:
            self.problem(
                f"{key}.multiplier", "not given", "give the factor of the transient limits, at most 2"
            )
        if read.multiplier is not None and not 1 <= read.multiplier.value <= LARGEST_MULTIPLIER:
            what = f"{read.multiplier.value:g} is not between 1 and 2"
            self.problem(f"{key}.multiplier", what, "it may be lowered, never raised above 2")

    def _area(self, key: str, area: _Area) -> BodyArea:
        if area.number in self.numbers:
            self.problem(f"{key}.areas", f"number {area.number} is given twice", "number each area once")
        self.numbers.add(area.number)
        name = f"{area.name}, {area.side}" if area.side else area.name
        pressure = self._figure(f"{key}.areas ({name}).pressure", "pressure", area.pressure)
        return BodyArea(area.number, name, area.seen_from, pressure)

    def _figure(self, key: str, quantity: str, cell: _Cell) -> Figure:
        unit = getattr(self.table.units, quantity, "")
        value = cell.value * _TO_SI[quantity][unit]
        if not (math.isfinite(value) and value > 0):
            self.problem(key, f"{cell.value:g} {unit} is not a limit", "give a number above 0")
        elif quantity in _PLAUSIBLE and not self.table.reviewed_by:
            low, high, si = _PLAUSIBLE[quantity]
            if not low <= value <= high:
                what = f"{cell.value:g} {unit} is outside {low:g} to {high:g} {si}"
                remedy = "check unit and column; if it is meant, say in reviewed_by who answers for it"
                self.problem(key, what, remedy)
        clause = self.table.clauses.get(quantity, "")
        source = self._source(clause, cell.confidence, cell.sources, key)
        return Figure(value, _SI[quantity], source, cell.confidence)

    def _source(self, clause: str, confidence: str, keys: str, where: str) -> str:
        unknown = [key for key in keys.split() if key not in self.table.sources]
        if unknown or not keys.split():
            what = f"source {unknown[0]!r} is not in [sources]" if unknown else "no source"
            self.problem(where, what, "name who says so in [sources]")
        texts = "; ".join(self.table.sources.get(key, key) for key in keys.split())
        return f"{self.table.edition} {clause}, {texts} ({confidence})".replace(" ,", ",")
