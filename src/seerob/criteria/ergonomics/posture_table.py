"""A company's own posture rule, written as a table by whoever knows the work: no program needed."""

from __future__ import annotations

from typing import Literal

from seerob.criteria.scoring.zone_rule import ZoneRule
from seerob.criteria.scoring.zones import ZoneTable, read_zones
from seerob.model.model import Model


class PostureTable(ZoneRule, frozen=True, kw_only=True):
    """Score of a posture by a table of angles, ranges and points."""

    table: str
    """The table: an Excel, CSV or TOML file beside the workstation file."""
    sheet: str | None = None
    """Sheet of a workbook; the first that has the columns when not given."""
    combine: Literal["max", "sum"] = "max"
    """The worst angle counts, or the sum of all; of the worse side."""

    def zones(self, model: Model) -> ZoneTable:
        """Read the table of zones; raise `InputError` with every mistake in it."""
        return read_zones(model.folder / self.table, self.table, sheet=self.sheet)

    def combination(self) -> Literal["max", "sum"]:
        """Say how the scores of several angles become one: their maximum or their sum."""
        return self.combine
