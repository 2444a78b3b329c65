"""Postures and movements at machinery by zones of angles and frequencies, after EN 1005-4.

The norm's text was not at hand: each row says how sure it is, and `table` takes another one.
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from seerob.core.snapshot import Level
from seerob.criteria.scoring.spans import published
from seerob.criteria.scoring.zone_rule import ZoneRule
from seerob.criteria.scoring.zones import ZoneTable, read_zones, zones_of
from seerob.model.model import Model


class En10054(ZoneRule, frozen=True, kw_only=True):
    """Zones of movements after EN 1005-4, partly from memory: 0, 1 conditional, 2 not acceptable."""

    limit: Annotated[float, Meta(ge=0, le=2)] | None = None
    """Greatest admissible zone: 0, or 1 for conditional ones too."""
    table: str | None = None
    """Another table of zones instead of the one that ships: an Excel, CSV or TOML file."""

    @property
    def levels(self) -> tuple[Level, ...]:
        """The zones."""
        names = ("acceptable", "conditional", "not acceptable")
        return tuple(Level(up_to=k, name=name) for k, name in enumerate(names))

    def zones(self, model: Model) -> ZoneTable:
        """Read the table of zones; raise `InputError` with every mistake in it."""
        if self.table is None:
            return zones_of(published("en_1005_4"), "en_1005_4.toml")
        return read_zones(model.folder / self.table, self.table)
