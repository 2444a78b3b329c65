"""Densities of materials that come with seerob, by words in their names, with how far they may be off."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple


class Material(NamedTuple):
    """A family of materials."""

    name: str
    low: float
    """Least density of it [kg/m³]."""
    high: float
    source: str

    @property
    def density(self) -> float:
        """The middle [kg/m³]."""
        return (self.low + self.high) / 2

    @property
    def tolerance(self) -> float:
        """How far a density may be from the middle, as a share."""
        return (self.high - self.low) / (self.high + self.low)


def material(name: str) -> Material | None:
    """The family that a material's name has a word of; None where it has none, or words of two.

    Args:
        name: As a CAD file has it: ``S235JR``, ``Steel, mild``.
    """
    found = [one for one, words in _families() if words.search(name)]
    return found[0] if len(found) == 1 else None


@cache
def _families() -> tuple[tuple[Material, re.Pattern[str]], ...]:
    rows: list[dict[str, Any]] = tomllib.loads(
        Path(__file__).with_name("materials.toml").read_text(encoding="utf-8")
    )["materials"]
    return tuple(
        (
            Material(row["name"], row["low"], row["high"], row["source"]),
            re.compile(rf"(?<!\w)(?:{'|'.join(row['words'])})(?!\w)", re.I),
        )
        for row in rows
    )
