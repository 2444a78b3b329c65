"""Gaps in which a part of the body can be clamped, per body region; data in ``crushing_gaps.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from seerob.core.snapshot import Input, Origin

NOT_VERIFIED = "by a gap that is not verified (M)"
"""What rests on a gap of the table."""


@cache
def _table() -> dict[str, Any]:
    return tomllib.loads(files("seerob.description.norms").joinpath("crushing_gaps.toml").read_text("utf-8"))


@cache
def crushing_gaps() -> tuple[dict[str, float], str]:
    """Gap [m] per body region below which a body part in it is taken to be clamped, and the source."""
    table = _table()
    return {region: gap * 1e-3 for region, gap in table["gaps_mm"].items()}, table["source"]


@cache
def openings() -> tuple[dict[str, float], str]:
    """Narrowest opening [m] that lets anything of a body region in, per region, and the source."""
    table = _table()["opening"]
    return {region: gap * 1e-3 for region, gap in table["fits_mm"].items()}, table["source"]


def gap_inputs(given: Mapping[str, float], regions: Collection[str]) -> tuple[Input, ...]:
    """The gap of each body region that decides between free and clamped, and what lets it in.

    Args:
        given: By the workstation file, instead of the table's [m].
        regions: Which.
    """
    gaps, source = crushing_gaps()
    narrowest, of_openings = openings()
    return (
        *(
            Input(
                name=f"{region}: clamped in gaps up to",
                value=given.get(region, gaps[region]),
                unit="m",
                origin=Origin.GIVEN if region in given else Origin.ESTIMATED,
                source="workstation file" if region in given else source,
            )
            for region in regions
        ),
        *(
            Input(
                name=f"{region}: gets between parts of one robot that open to",
                value=narrowest[region],
                unit="m",
                origin=Origin.ESTIMATED,
                source=of_openings,
            )
            for region in regions
        ),
    )
