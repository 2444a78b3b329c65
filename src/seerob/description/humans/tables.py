"""The published tables that ship with seerob, read once."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def table(name: str) -> dict[str, Any]:
    """One of the tables in ``data/``, by name without ending."""
    return tomllib.loads(files("seerob.description.humans").joinpath(f"data/{name}.toml").read_text("utf-8"))
