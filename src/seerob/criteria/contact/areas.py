"""Verdicts of the specific areas of a body region: force belongs to the region, pressure to the area."""

from __future__ import annotations

import math

from seerob.core.snapshot import Result, Verdict
from seerob.core.transforms import Array
from seerob.core.verdict import keeps
from seerob.criteria.contact import collision
from seerob.criteria.contact.limits import Judged, RegionArrays
from seerob.criteria.contact.tolerances import area_verdict

NOT_MODELLED = (
    "larynx, eyes, ears and feet have no row in the table",
    "people other than adults, protective padding, clothing",
    "the contact itself: its area grows with the indentation F/k by a convention of seerob; "
    "up to the permitted force the pressure is within its limit",
    "free or clamped is decided by gaps that are not verified (M), unless thickness is given",
    "whether a moving part in a gap comes nearer to the surface or passes it: it counts as clamping",
    "surfaces that no part of the workstation shows, but for the floor",
    "parts of a tool that move without a joint of the model, as the fingers of a gripper that is one shape",
    "duration of the contact: what is free counts as transient, what is clamped as quasi-static",
    "forces that drives keep up after the impact, detection and stop of the robot",
)
"""By the limits and areas of any contact."""


def area_results(
    arrays: RegionArrays,
    forces: Array,
    at: tuple[int, int],
    judged: Judged,
    *,
    whole: Verdict,
    unknown: str,
    v: float,
) -> tuple[Result, ...]:
    """Each specific area of a region against the surface that governs it.

    Args:
        arrays: The limits.
        forces: Of the surface, that keep the pressure of every area of the table, shape (a,) [N].
        at: The surface and the region.
        judged: What the region was judged by.
        whole: Verdict of the region.
        unknown: Why the pressure is not known, where it is not.
        v: Relative speed [m/s].
    """
    row, column = at
    speeds, region = judged.speeds, arrays.regions[column]
    others = min(float(speeds.force[row, column]), float(speeds.energy[row, column]))
    own = forces[arrays.owner == column]
    pressed = collision.speed_at_force(own, speeds.mu[row, column], region.stiffness.value)
    found = []
    for area, v_P in zip(region.areas, pressed.tolist(), strict=True):
        open_ = math.isnan(v_P)
        limit = others if open_ else min(others, v_P)
        verdict = Verdict.EXCEEDED if not keeps(v, limit) else Verdict.UNDECIDED if open_ else Verdict.WITHIN
        verdict = area_verdict(verdict, whole, judged.ends)
        reason = "" if verdict is not Verdict.UNDECIDED else unknown or "decided as its region is"
        found.append(Result(name=area.name, value=v, unit="m/s", limit=limit, verdict=verdict, reason=reason))
    return tuple(found)


def margin(entry: tuple[Result, int]) -> float:
    """Without a limit it is the worst: nothing is permitted or known."""
    part = entry[0]
    return -math.inf if part.limit is None or part.value is None else part.limit - part.value
