"""Units that machines state, and what they are in SI.

The variable dictionary: what the variables of controllers and machines mean, one file per workstation.

Each entry gives a variable a name of its own, says where it is read, what its numbers are and how old they
may be. Units are stated, never guessed; what cannot be read is a doubt, never an old value that looks new.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from msgspec import Meta, field

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.files.toml_file import read_toml
from seerob.core.quantities import PathName, Seconds, Table
from seerob.workstation.conversion import convert, tables


class Unit(NamedTuple):
    """One unit: ``SI = factor * value + offset``."""

    si: str
    factor: float
    offset: float = 0.0


UNITS: dict[str, Unit] = {
    "1": Unit("1", 1.0),
    "%": Unit("1", 0.01),
    "m": Unit("m", 1.0),
    "cm": Unit("m", 1e-2),
    "mm": Unit("m", 1e-3),
    "um": Unit("m", 1e-6),
    "inch": Unit("m", 0.0254),
    "m/s": Unit("m/s", 1.0),
    "mm/s": Unit("m/s", 1e-3),
    "m/min": Unit("m/s", 1 / 60),
    "m/s2": Unit("m/s²", 1.0),
    "mm/s2": Unit("m/s²", 1e-3),
    "rad": Unit("rad", 1.0),
    "deg": Unit("rad", math.pi / 180),
    "rev": Unit("rad", 2 * math.pi),
    "rad/s": Unit("rad/s", 1.0),
    "deg/s": Unit("rad/s", math.pi / 180),
    "rpm": Unit("rad/s", math.pi / 30),
    "s": Unit("s", 1.0),
    "ms": Unit("s", 1e-3),
    "min": Unit("s", 60.0),
    "Hz": Unit("Hz", 1.0),
    "kg": Unit("kg", 1.0),
    "g": Unit("kg", 1e-3),
    "t": Unit("kg", 1e3),
    "N": Unit("N", 1.0),
    "kN": Unit("N", 1e3),
    "N.m": Unit("N·m", 1.0),
    "N.mm": Unit("N·m", 1e-3),
    "Pa": Unit("Pa", 1.0),
    "hPa": Unit("Pa", 1e2),
    "kPa": Unit("Pa", 1e3),
    "MPa": Unit("Pa", 1e6),
    "bar": Unit("Pa", 1e5),
    "N/cm2": Unit("Pa", 1e4),
    "K": Unit("K", 1.0),
    "degC": Unit("K", 1.0, 273.15),
    "A": Unit("A", 1.0),
    "mA": Unit("A", 1e-3),
    "V": Unit("V", 1.0),
    "W": Unit("W", 1.0),
    "kW": Unit("W", 1e3),
    "J": Unit("J", 1.0),
}
"""Units by the names that a variable dictionary writes."""

_SPELLINGS = {
    "°": "deg",
    "degree": "deg",
    "degrees": "deg",
    "°/s": "deg/s",
    "1/min": "rpm",
    "°C": "degC",
    "Nm": "N.m",
    "N·m": "N.m",
    "µm": "um",
    "m/s²": "m/s2",
    "mm/s²": "mm/s2",
    "": "1",
}


def unit(text: str) -> Unit | None:
    """The unit of a spelling; None when it is not known."""
    return UNITS.get(_SPELLINGS.get(text, text))


VARIABLE = "variable "
"""Before the name of a variable among the names that answers depend on: robots have no blank in theirs."""
MOST_VARIABLES = 10_000
WHOLE = re.compile(r"0|-?[1-9][0-9]{0,18}")
"""Spelling of a whole number: another one would never be heard."""
LONGEST_TEXT = 1000
"""Longest text that a value may be."""

Value = float | bool | str
"""In SI, as a signal carries it."""


class Kind(StrEnum):
    """What the values of a variable are."""

    NUMBER = "number"
    BOOL = "bool"
    TEXT = "text"
    CHOICE = "choice"
    """A whole number that stands for a word."""


class WhenStale(StrEnum):
    """What becomes of a value that is too old, or that its source calls bad."""

    UNDECIDED = "undecided"
    """What depends on it is undecided, and what shows it looks unknown."""
    HOLD = "hold"
    """What shows it (``[[displays]]``) stays as it was; what is judged by it is undecided all the same."""


class BadValue(ValueError):
    """A value that cannot be what its variable says; says why."""


class Variable(Table, frozen=True, kw_only=True):
    """One variable of a controller or machine."""

    name: PathName
    """Its name in the workstation: ``conveyor/speed``."""
    source: str
    """Name of the source that reads it."""
    address: Any
    """Where that source finds it; what is written here depends on its kind."""
    type: Kind = Kind.NUMBER
    unit: str | None = None
    """Unit of the device's numbers, ``1`` for none; must be given for numbers."""
    scale: float = 1.0
    """The device's raw number times ``scale`` plus ``offset`` is in ``unit``."""
    offset: float = 0.0
    inverted: bool = False
    """A bool that is true there is false here."""
    choices: dict[str, str] = field(default_factory=dict)
    """Number → word, for a variable that is a choice."""
    range: tuple[float, float] | None = None
    """Least and largest believable number, in ``unit``; what is outside is bad."""
    timeout: Seconds = 0.5
    """Age from which it is stale [s]."""
    when_stale: WhenStale = WhenStale.UNDECIDED
    write: bool = False
    """It is a trigger, written by the twin, when the workstation and the command line both allow writing."""
    comment: Annotated[str, Meta(max_length=LONGEST_TEXT)] = ""

    def __post_init__(self) -> None:
        if self.type is Kind.NUMBER:
            if self.unit is None:
                raise ValueError(f'{self.name}: unit is missing; a number without one has unit = "1"')
            if unit(self.unit) is None:
                raise ValueError(f"{self.name}: unknown unit {self.unit!r}; {suggestion(self.unit, UNITS)}")
            if self.scale == 0 or not math.isfinite(self.scale) or not math.isfinite(self.offset):
                raise ValueError(f"{self.name}: scale = {self.scale}, offset = {self.offset} lose the value")
        elif self.unit is not None:
            raise ValueError(f"{self.name}: a {self.type} has no unit")
        elif (self.scale, self.offset, self.range) != (1.0, 0.0, None):
            raise ValueError(f"{self.name}: a {self.type} has no scale, offset or range")
        if self.inverted and self.type is not Kind.BOOL:
            what = "inverted belongs to a bool; of a number scale = -1 turns the sign"
            raise ValueError(f"{self.name}: {what}")
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError(
                f"{self.name}: range = {list(self.range)} is no interval: the lower end comes first"
            )
        if (self.type is Kind.CHOICE) != bool(self.choices):
            raise ValueError(
                f'{self.name}: type = "choice" and choices = {{ 0 = "idle", … }} belong together'
            )
        if wrong := [number for number in self.choices if not WHOLE.fullmatch(number)]:
            what = f"the keys of choices are whole numbers such as 0, 12, -1, not {wrong[0][:20]!r}"
            raise ValueError(f"{self.name}: {what}")

    @property
    def si_unit(self) -> str:
        """Unit of its value here; empty where it has none."""
        known = None if self.unit is None else unit(self.unit)
        return "" if known is None else known.si

    def value(self, raw: object) -> Value:
        """Its value in SI.

        Args:
            raw: As the device sent it.

        Raises:
            BadValue: It is of another type, not finite, out of range, or no known choice.
        """
        if self.type is Kind.TEXT:
            if not isinstance(raw, str) or len(raw) > LONGEST_TEXT:
                raise BadValue(f"{self.name}: {_short(raw)} is no text of up to {LONGEST_TEXT} characters")
            return raw
        if self.type is Kind.BOOL:
            if raw not in (True, False, 0, 1):
                raise BadValue(f"{self.name}: {_short(raw)} is neither true nor false")
            return bool(raw) != self.inverted
        if isinstance(raw, bool) or not isinstance(raw, int | float):
            raise BadValue(f"{self.name}: {_short(raw)} is no number")
        if self.type is Kind.CHOICE:
            if raw != raw // 1 or (word := self.choices.get(str(int(raw)))) is None:
                raise BadValue(f"{self.name}: {_short(raw)} is none of {', '.join(self.choices)}")
            return word
        try:
            number = float(raw)
        except OverflowError:  # a whole number of more digits than any float has
            number = math.inf
        return self._number(number)

    def _number(self, raw: float) -> float:
        value = self.scale * raw + self.offset
        if not math.isfinite(value):
            raise BadValue(f"{self.name}: {raw} is not a finite number")
        if self.range is not None and not self.range[0] <= value <= self.range[1]:
            raise BadValue(f"{self.name}: {value:g} {self.unit} is not in {list(self.range)}")
        known = unit(self.unit or "")
        return value if known is None else known.factor * value + known.offset


def _short(raw: object) -> str:
    text = repr(raw)
    return text if len(text) <= 40 else text[:37] + "…"


def read(path: Path) -> tuple[Variable, ...]:
    """The variables of a dictionary file.

    Raises:
        InputError: With every mistake in it.
    """
    table, _ = read_toml(path)
    problems = [
        Problem(str(path), key, "unknown key", suggestion(key, ["variables"]))
        for key in table
        if key != "variables"
    ]
    entries = tables(table.get("variables", []), "variables", str(path), problems)
    if len(entries) > MOST_VARIABLES:
        what = f"{len(entries)} variables"
        raise InputError.at(
            path, "variables", what, f"at most {MOST_VARIABLES}: leave out what the twin does not use"
        )
    found = [
        variable
        for i, entry in enumerate(entries)
        if (variable := convert(entry, Variable, file=str(path), key=f"variables[{i}]", problems=problems))
    ]
    problems += _twice(found, str(path))
    if problems:
        raise InputError(problems)
    return tuple(found)


def _twice(variables: Iterable[Variable], file: str) -> list[Problem]:
    count = Counter(v.name for v in variables)
    return [
        Problem(file, f"variables ({name})", f"is there {n} times", "keep one, or rename the others")
        for name, n in count.items()
        if n > 1
    ]
