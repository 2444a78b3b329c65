"""Where the approach speed and the intrusion distance of a protective separation distance are from."""

from __future__ import annotations

from seerob.core.snapshot import Input, Origin
from seerob.description.norms import iso_13855
from seerob.description.norms.iso_13855 import WALKING
from seerob.model import provenance


def approach_speed(v_h: float | None) -> Input:
    """v_h as given [m/s]; None for that of ISO 13855."""
    if v_h is None:
        return Input(
            name="v_h",
            value=f"{WALKING} m/s, {iso_13855.REACHING:g} m/s up to S_p = {iso_13855.ARM_REACH} m",
            unit="",
            origin=Origin.STATED,
            source="ISO/TS 15066:2016 5.5.4.2.3 and ISO 13855, from public sources that agree (2S); "
            f"that S_p with {WALKING} m/s is not below {iso_13855.ARM_REACH} m is from memory (M)",
        )
    if v_h == WALKING:
        return Input(
            name="v_h",
            value=v_h,
            unit="m/s",
            origin=Origin.STATED,
            source="ISO/TS 15066:2016 5.5.4.2.3, from public sources that agree (2S)",
        )
    return provenance.given("v_h", v_h, "m/s")


def intrusion(C: float | None) -> Input:
    """C as given [m]."""
    return Input(name="C", unit="m", origin=Origin.MISSING) if C is None else provenance.given("C", C, "m")
