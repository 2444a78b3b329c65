r"""Approach speed and intrusion distance of ISO 13855, by edition and by how a person comes near.

Minimum distance of a protective device from the hazard, :math:`S = K T + C` (2010),
:math:`S = K T + D_{DS} + Z` (2024). No licensed text was opened: each figure carries how well the
public sources for it agree (``2S`` two that do not look copied, ``1S`` one, ``M`` from memory).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from seerob.core.errors import InputError, Undecided
from seerob.core.transforms import Array

WALKING = 1.6
"""K for distances above `ARM_REACH`, and of a person whose speed is not monitored [m/s] (2S)."""
REACHING = 2.0
"""K for distances up to `ARM_REACH` [m/s] (2S)."""
ARM_REACH = 0.5
"""Where K changes [m] (2S); that a distance with 1.6 m/s is not below it (M)."""
LEAST = 0.1
"""Least distance of a finely resolving field across the approach [m] (2S)."""

BODY = 0.85
"""Arm's length: C where only a body is detected [m] (2S)."""
FLOOR = 1.2
"""C of a field along the floor without credit for its height [m] (2S)."""
FINE, COARSE = 0.04, 0.07
"""Detection capability up to which hands and arms (2S), and up to which bodies (M), are detected [m]."""
HIGHEST = 1.0
"""Largest height of a field along the floor [m] (2S)."""
CRAWLING = 0.2
"""Height of a field along the floor above which somebody may crawl under it [m] (2S, weak)."""


class Edition(StrEnum):
    """Edition of ISO 13855."""

    E2010 = "2010"
    E2024 = "2024"


class Approach(StrEnum):
    """How the person moves relative to the detection field."""

    ORTHOGONAL = "orthogonal"
    """Through it, as through a light curtain."""
    PARALLEL = "parallel"
    """Along it, as in the plane of a scanner."""
    TWO_HAND = "two_hand"
    """From a two-hand control."""


@dataclass(frozen=True)
class Intrusion:
    """How far a person may have come before being detected."""

    value: float
    """C or D_DS [m]."""
    source: str
    """Edition, case and how well sources agree."""
    note: str = ""
    """What was assumed to the worse side."""
    uncovered: tuple[str, ...] = ()
    """Ways around the field for which no distance was given."""


@dataclass(frozen=True)
class Minimum:
    """Where a protective device must stand."""

    distance: float
    """S [m]."""
    speed: float
    """K that governs [m/s]."""
    intrusion: Intrusion


def intrusion(
    approach: Approach,
    edition: Edition,
    *,
    capability: float | None = None,
    height: float | None = None,
    over: float | None = None,
    under: float | None = None,
) -> Intrusion:
    """Intrusion distance C (2010) or D_DS without the supplement Z (2024).

    Args:
        approach: Across or along the field, or a two-hand control.
        edition: Of ISO 13855.
        capability: Detection capability d, d_e: the smallest object that is always seen [m]; None when
            none was demonstrated.
        height: Of the field above the floor, for an approach along it [m].
        over: C_RO, D_DO: for reaching over a field across the approach, from the norm's table [m]; 0 where
            other measures exclude it, None when nobody said.
        under: D_DU: for reaching or crawling under the field [m]; likewise.

    Raises:
        InputError: A capability or height that the norm does not admit.
        Undecided: A case of the edition that no public source settles.
    """
    approach, edition = Approach(approach), Edition(edition)
    _check(approach, capability, height)
    for what, way in (("over", over), ("under", under)):
        _distance(what, way)
    if approach is Approach.TWO_HAND:
        if edition is Edition.E2024:
            raise Undecided("ISO 13855:2024 for a two-hand control: no public source was found")
        return Intrusion(0.25, "ISO 13855:2010 two-hand control (M)")
    if approach is Approach.PARALLEL:
        found = _along(edition, capability, height)
        ways = {} if height is not None and height <= CRAWLING else {"crawling under the field": under}
    else:
        found = _across(edition, capability)
        ways = {"reaching over the field": over}
        if edition is Edition.E2024:
            ways["reaching under the field"] = under
    return _with_ways_around(found, ways)


def _with_ways_around(found: Intrusion, ways: dict[str, float | None]) -> Intrusion:
    """The largest of what the field gives and the ways around it: C = max(C_RO, reach-through) (1S)."""
    known = {way: value for way, value in ways.items() if value is not None}
    larger = [f"{way}: {value:g} m" for way, value in known.items() if value > found.value]
    return replace(
        found,
        value=max(found.value, *known.values()) if known else found.value,
        source="; ".join([found.source, *larger]),
        uncovered=tuple(way for way in ways if way not in known),
    )


def minimum_distance(
    approach: Approach,
    edition: Edition,
    time: float,
    *,
    capability: float | None = None,
    height: float | None = None,
    over: float | None = None,
    under: float | None = None,
    supplement: float | None = None,
) -> Minimum:
    """Minimum distance of a protective device from the hazard.

    Args:
        approach: See `intrusion`.
        edition: See `intrusion`.
        time: T: from the person entering the field to the end of the hazard [s].
        capability: See `intrusion`.
        height: See `intrusion`.
        over: See `intrusion`.
        under: See `intrusion`.
        supplement: Z of the 2024 edition [m].

    Raises:
        InputError: See `intrusion`; a time below 0.
        Undecided: See `intrusion`; a way around the field that nobody spoke of; 2024 without Z.
    """
    if not (np.isfinite(time) and time >= 0):
        raise InputError.at("ISO 13855", "time", f"{time} s is not a time", "seconds, 0 or more")
    approach, edition = Approach(approach), Edition(edition)
    _distance("supplement", supplement)
    found = intrusion(approach, edition, capability=capability, height=height, over=over, under=under)
    if found.uncovered:
        raise Undecided(f"ISO 13855:{edition}: nothing is said of {', '.join(found.uncovered)}")
    if edition is Edition.E2024 and supplement is None:
        raise Undecided("ISO 13855:2024: the supplement Z is not given")
    added = found.value + (supplement or 0.0)
    if approach is Approach.ORTHOGONAL and capability is not None and capability <= FINE:
        near = max(REACHING * time + added, LEAST)
        if near <= ARM_REACH:
            return Minimum(near, REACHING, found)
        return Minimum(max(WALKING * time + added, ARM_REACH), WALKING, found)
    return Minimum(WALKING * time + added, WALKING, found)


def least_distance(at_speed: Callable[[float], Array]) -> Array:
    """A distance that depends on the approach speed, with the approach speed that ISO 13855 asks for.

    2 m/s where that leads to 0.5 m or less; above, 1.6 m/s but not less than 0.5 m. Never below the
    distance for 1.6 m/s, and it grows wherever ``at_speed`` does.

    Args:
        at_speed: The distance for an approach speed [m/s], shape (...) [m].
    """
    near = at_speed(REACHING)
    return np.where(near <= ARM_REACH, near, np.maximum(at_speed(WALKING), ARM_REACH))


def _across(edition: Edition, capability: float | None) -> Intrusion:
    if capability is None:
        return Intrusion(
            BODY,
            f"ISO 13855:{edition} across the field (1S)",
            "no detection capability was demonstrated: only bodies count as detected",
        )
    if capability <= FINE:
        confidence = "2S" if edition is Edition.E2010 else "1S"
        fine = 8 * max(capability - 0.014, 0.0)
        return Intrusion(fine, f"ISO 13855:{edition} across the field, 8 (d - 14 mm) ({confidence})")
    if capability > COARSE:
        raise Undecided(
            f"ISO 13855:{edition}: a detection capability of {capability:g} m across the field is coarser "
            f"than {COARSE:g} m (M), for which no figure is known"
        )
    if edition is Edition.E2010:
        return Intrusion(BODY, "ISO 13855:2010 across the field, body detection (2S; up to 70 mm: M)")
    return Intrusion(
        BODY,
        "ISO 13855:2024 across the field (1S; up to 70 mm: M)",
        "sources for capabilities above 40 mm do not agree: an arm's length is taken, the larger figure",
    )


def _along(edition: Edition, capability: float | None, height: float | None) -> Intrusion:
    source = f"ISO 13855:{edition} along the floor"
    if capability is None:
        return Intrusion(
            FLOOR, f"{source} (1S)", "no detection capability was demonstrated: no credit for height"
        )
    lowest = _lowest(capability)
    if height is None and lowest > 0:
        raise Undecided(
            f"ISO 13855:{edition}: a field that resolves {capability:g} m must be at least {lowest:g} m "
            "above the floor, and its height is not given"
        )
    if edition is Edition.E2024:
        return Intrusion(FLOOR, f"{source} (2S)")
    if height is None:
        return Intrusion(FLOOR, f"{source} (2S)", "the field's height is not given: no credit for it")
    return Intrusion(max(FLOOR - 0.4 * height, BODY), f"{source}, 1200 mm - 0.4 H, at least 850 mm (2S)")


def _lowest(capability: float) -> float:
    """Least height of a field along the floor, 15 (d - 50 mm) [m] (2S)."""
    return max(15 * (capability - 0.05), 0.0)


def _distance(what: str, value: float | None) -> None:
    if value is not None and not (np.isfinite(value) and value >= 0):
        raise InputError.at("ISO 13855", what, f"{value} m is no distance", "metres, 0 or more")


def _check(approach: Approach, capability: float | None, height: float | None) -> None:
    where = "ISO 13855"
    if capability is not None and not (np.isfinite(capability) and capability > 0):
        raise InputError.at(
            where, "capability", f"{capability} m is no detection capability", "metres, above 0"
        )
    if approach is Approach.PARALLEL and capability is not None and _lowest(capability) > HIGHEST + 1e-12:
        raise InputError.at(
            where,
            "capability",
            f"{capability} m is too coarse for a field along the floor",
            f"at most {0.05 + HIGHEST / 15:.4f} m: H is at least 15 (d - 50 mm) and at most 1000 mm",
        )
    if height is None:
        return
    if approach is not Approach.PARALLEL:
        raise InputError.at(where, "height", "only a field along the floor has one", 'approach = "parallel"')
    if not 0 <= height <= HIGHEST:
        raise InputError.at(where, "height", f"{height} m is not admitted", "0 to 1 m above the floor")
    lowest = _lowest(capability) if capability is not None else 0.0
    if height < lowest - 1e-12:
        raise InputError.at(
            where,
            "height",
            f"{height} m is too low for a detection capability of {capability} m",
            f"at least {lowest:g} m, or a finer field",
        )
