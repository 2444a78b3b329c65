"""The published score tables that ship with seerob, read once; each file says where it is from."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


@cache
def published(name: str) -> dict[str, Any]:
    """One of the files in ``data/``, by name without ending."""
    return tomllib.loads(files("seerob.criteria.scoring").joinpath(f"data/{name}.toml").read_text("utf-8"))


@cache
def cells(name: str, key: str) -> Ints:
    """A table of whole numbers as a read-only array."""
    array = np.array(published(name)[key], np.int64)
    array.flags.writeable = False
    return array
