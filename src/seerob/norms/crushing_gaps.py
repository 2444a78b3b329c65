"""Gaps in which a part of the body can be clamped, per body region; data in ``crushing_gaps.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from functools import cache
from importlib.resources import files

from seerob.snapshot import Input, Origin

NOT_VERIFIED = "by a gap that is not verified (M)"
"""What rests on a gap of the table."""


@cache
def crushing_gaps() -> tuple[dict[str, float], str]:
    """Gap [m] per body region below which a body part in it is taken to be clamped, and the source."""
    table = tomllib.loads(files("seerob.norms").joinpath("crushing_gaps.toml").read_text("utf-8"))
    return {region: gap * 1e-3 for region, gap in table["gaps_mm"].items()}, table["source"]


def gap_inputs(given: Mapping[str, float], regions: Collection[str]) -> tuple[Input, ...]:
    """The gap of each body region that decides between free and clamped.

    Args:
        given: By the workstation file, instead of the table's [m].
        regions: Which.
    """
    gaps, source = crushing_gaps()
    return tuple(
        Input(
            name=f"{region}: clamped in gaps up to",
            value=given.get(region, gaps[region]),
            unit="m",
            origin=Origin.GIVEN if region in given else Origin.ESTIMATED,
            source="workstation file" if region in given else source,
        )
        for region in regions
    )
