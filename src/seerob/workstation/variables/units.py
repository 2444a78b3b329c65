"""Units that machines state, and what they are in SI."""

from __future__ import annotations

import math
from typing import NamedTuple


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
"""As they are written in a variable dictionary."""

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
