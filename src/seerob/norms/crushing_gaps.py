"""Gaps in which a part of the body can be clamped, per body region; data in ``crushing_gaps.toml``."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files


@cache
def crushing_gaps() -> tuple[dict[str, float], str]:
    """Gap [m] per body region below which a body part in it is taken to be clamped, and the source."""
    table = tomllib.loads(files("seerob.norms").joinpath("crushing_gaps.toml").read_text("utf-8"))
    return {region: gap * 1e-3 for region, gap in table["gaps_mm"].items()}, table["source"]
