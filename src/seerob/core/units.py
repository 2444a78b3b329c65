"""Units at the door: ``rpy_deg = [0, 0, 90]`` in a file is ``rpy`` in radians inside."""

from __future__ import annotations

import math
from collections.abc import Iterator

SUFFIXES: dict[str, tuple[str, float]] = {
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "inch": ("m", 0.0254),
    "deg": ("rad", math.pi / 180),
    "deg_s": ("rad/s", math.pi / 180),
    "mm_s": ("m/s", 1e-3),
    "ms": ("s", 1e-3),
    "g": ("kg", 1e-3),
    "mJ": ("J", 1e-3),
    "g_cm3": ("kg/m³", 1e3),
}
"""Suffix of a key → SI unit and factor."""

LENGTHS: dict[str, float] = {
    "m": 1.0,
    "dm": 0.1,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "inch": 0.0254,
    "ft": 0.3048,
}
"""Units a mesh file may be in → metres."""


def splits(key: str) -> Iterator[tuple[str, str, float]]:
    """``('rpy', 'rad', π/180)`` of ``'rpy_deg'``: every way to read a suffix, the longest first."""
    for suffix in sorted(SUFFIXES, key=len, reverse=True):
        stem = key.removesuffix("_" + suffix)
        if stem and stem != key:
            unit, factor = SUFFIXES[suffix]
            yield stem, unit, factor


def split(key: str) -> tuple[str, str, float] | None:
    """The first of `splits`; None when the key carries no known suffix."""
    return next(splits(key), None)
