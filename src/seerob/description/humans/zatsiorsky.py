"""Segment masses and moments of inertia of men by the regressions of Zatsiorsky and Seluyanov 1979.

``y = b0 + b1 · body mass [kg] + b2 · stature [cm]``; the table is ``data/zatsiorsky.toml``. They are made
for ordinary builds: far from them a mass or a moment becomes impossible, and the person is refused.
"""

from __future__ import annotations

from seerob.description.humans.tables import table

KG_CM2 = 1e-4
"""[kg·m²]"""


def masses(*, mass: float, stature: float) -> dict[str, float]:
    """Masses [kg] of the segments of a man of that body mass [kg] and stature [m]; limbs of one side."""
    return {name: _value(row["mass"], mass, stature) for name, row in table("zatsiorsky")["segments"].items()}


def moments(segment: str, *, mass: float, stature: float) -> tuple[float, float, float]:
    """Moments [kg·m²] about the sagittal, transverse and longitudinal axis through a segment's centre."""
    row = table("zatsiorsky")["segments"][segment]
    sagittal, transverse, longitudinal = (
        _value(row[axis], mass, stature) * KG_CM2 for axis in ("sagittal", "transverse", "longitudinal")
    )
    return sagittal, transverse, longitudinal


def _value(row: list[float], mass: float, stature: float) -> float:
    b0, b1, b2 = row
    return b0 + b1 * mass + b2 * stature * 100
