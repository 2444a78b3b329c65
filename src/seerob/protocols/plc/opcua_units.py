"""Units of OPC UA's EngineeringUnits, which are UNECE Recommendation 20 codes written as numbers."""

from __future__ import annotations

NAMESPACE = "http://www.opcfoundation.org/UA/units/un/cefact"

CODES: dict[str, str] = {
    "MTR": "m",
    "CMT": "cm",
    "MMT": "mm",
    "INH": "inch",
    "MTS": "m/s",
    "C16": "mm/s",
    "2X": "m/min",
    "MSK": "m/s2",
    "C81": "rad",
    "DD": "deg",
    "2A": "rad/s",
    "E96": "deg/s",
    "RPM": "rpm",
    "SEC": "s",
    "C26": "ms",
    "MIN": "min",
    "HTZ": "Hz",
    "KGM": "kg",
    "GRM": "g",
    "TNE": "t",
    "NEW": "N",
    "NU": "N.m",
    "PAL": "Pa",
    "KPA": "kPa",
    "MPA": "MPa",
    "BAR": "bar",
    "KEL": "K",
    "CEL": "degC",
    "AMP": "A",
    "4K": "mA",
    "VLT": "V",
    "WTT": "W",
    "KWT": "kW",
    "JOU": "J",
    "P1": "%",
    "C62": "1",
}
"""UNECE common code → unit as the dictionary spells it."""


def number(code: str) -> int:
    """The ``UnitId`` of a common code: its letters as one big-endian number."""
    return int.from_bytes(code.encode("ascii"), "big")


_BY_NUMBER = {number(code): unit for code, unit in CODES.items()}


def unit(unit_id: int) -> str:
    """The unit of a ``UnitId``; empty for one that is not known."""
    return _BY_NUMBER.get(unit_id, "")
