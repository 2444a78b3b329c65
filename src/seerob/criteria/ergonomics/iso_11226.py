"""Static working postures by zones of angles and holding times, after ISO 11226:2000.

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


class Iso11226(ZoneRule, frozen=True, kw_only=True):
    """Zones of static postures after ISO 11226, from memory: 0, 1 conditional, 2 not recommended."""

    limit: Annotated[float, Meta(ge=0, le=2)] | None = None
    """Greatest admissible zone: 0, or 1 for conditional ones too."""
    table: str | None = None
    """Another table of zones instead of the one that ships: an Excel, CSV or TOML file."""

    @property
    def levels(self) -> tuple[Level, ...]:
        """The zones."""
        names = ("acceptable", "conditional", "not recommended")
        return tuple(Level(up_to=k, name=name) for k, name in enumerate(names))

    def zones(self, model: Model) -> ZoneTable:
        """Read the table of zones; raise `InputError` with every mistake in it."""
        if self.table is None:
            return zones_of(published("iso_11226"), "iso_11226.toml")
        return read_zones(model.folder / self.table, self.table)
