"""How a person is detected: what the intrusion distance C follows from, and what a protective device adds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import Meta, Struct
from msgspec.structs import replace

from seerob.core.errors import InputError, Undecided, UnknownName
from seerob.core.snapshot import Input, Origin
from seerob.description.norms import iso_13855
from seerob.model import provenance
from seerob.model.model import Model
from seerob.model.mounting.specification import pose_matrix
from seerob.workstation.tables.sensors import Sensor

_m = Meta(ge=0, extra={"unit": "m"})


class Detection(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the person is detected, for C by ISO 13855."""

    edition: Literal["2010", "2024"] = "2024"
    """Edition of ISO 13855."""
    approach: Literal["orthogonal", "parallel"] = "parallel"
    """Across the field, or along it over the floor."""
    capability: Annotated[float, Meta(gt=0, extra={"unit": "m"})] | None = None
    """Smallest object that is always seen [m]; when none was demonstrated, the largest C holds."""
    height: Annotated[float, _m] | None = None
    """Height of a field along the floor [m]."""
    reach_over: Annotated[float, _m] | None = None
    """C_RO (D_DO) for reaching over a field across the approach, from the norm's table [m]; 0 where other
    measures exclude it. C is the larger of it and what the field gives."""
    reach_under: Annotated[float, _m] | None = None
    """D_DU for reaching under the field, or crawling under one more than 0.2 m above the floor [m]; 0 where
    other measures exclude it."""
    supplement: Annotated[float, _m] | None = None
    """Z of the 2024 edition [m]."""

    def intrusion(self) -> tuple[float | None, str, str]:
        """C [m] when known, why it is not complete, and its source."""
        try:
            found = iso_13855.intrusion(
                iso_13855.Approach(self.approach),
                iso_13855.Edition(self.edition),
                capability=self.capability,
                height=self.height,
                over=self.reach_over,
                under=self.reach_under,
            )
        except Undecided as unknown:
            return None, str(unknown), ""
        source = f"{found.source}; {found.note}" if found.note else found.source
        missing = [
            f"detection.{'reach_over' if 'over' in way else 'reach_under'} ({way}; 0 where it is excluded)"
            for way in found.uncovered
        ]
        if self.edition == "2024" and self.supplement is None:
            missing.append("detection.supplement (Z of ISO 13855:2024)")
        return found.value + (self.supplement or 0.0), ", ".join(missing), source

    def ways_around(self) -> tuple[str, ...]:
        """What C leaves out."""
        if self.approach == "orthogonal":
            return ("reaching over or under the detection field, beyond reach_over and reach_under",)
        return ("crawling under the detection field, beyond reach_under",)

    def stated(self) -> Input:
        """C as an input of a basis."""
        C, missing, source = self.intrusion()
        origin = Origin.MISSING if missing else Origin.STATED
        note = f"{source}; not known: {missing}" if missing else source
        return Input(name="C", value=C, unit="m", origin=origin, source=note)


@dataclass(frozen=True)
class Device:
    """What a protective device adds to a reaction that begins with its output."""

    response: float
    """[s]; 0 where it is not known."""
    undecided_reasons: tuple[str, ...]
    """What is not known of it."""
    detection: Detection
    inputs: tuple[Input, ...]


def device_of(model: Model, criterion: str, name: str, detection: Detection | None) -> Device:
    """What a sensor of a workstation adds.

    Args:
        model: Compiled workstation.
        criterion: Who asks, for errors.
        name: Of the sensor.
        detection: What the file says beside it: edition, reaching around, the supplement.

    Raises:
        UnknownName: There is no such sensor.
        InputError: ``detection`` says again, or against it, what the sensor says.
    """
    sensors = {sensor.name: sensor for sensor in model.workstation.sensors}
    if name not in sensors:
        raise UnknownName("sensor", name, sensors)
    sensor = sensors[name]
    across = sensor.light_curtain is not None
    if detection is None:
        detection = Detection(approach="orthogonal" if across else "parallel")
    for key, given in (("capability", detection.capability), ("height", detection.height)):
        if given is not None:
            what = f"{given:g} m, and the sensor {name!r} says it too"
            raise InputError.at(criterion, f"detection.{key}", what, "leave it out, or leave sensor out")
    if across and detection.approach == "parallel":
        what = f"{name!r} is a light curtain, which is crossed"
        raise InputError.at(criterion, "detection.approach", what, 'write approach = "orthogonal"')
    if not across:
        detection = replace(detection, height=_height(sensor))
    if sensor.pressure_mat is None:
        detection = replace(detection, capability=sensor.capability)
    known = sensor.response is not None
    given_by = sensor.source or "workstation file, which names no data sheet"
    response = (
        replace(provenance.given("response time of the sensor", sensor.response, "s"), source=given_by)
        if sensor.response is not None
        else Input(name="response time of the sensor", unit="s", origin=Origin.MISSING)
    )
    return Device(
        response=sensor.response or 0.0,
        undecided_reasons=() if known else (f"response of {name} (part of T_r)",),
        detection=detection,
        inputs=(response,),
    )


def _height(sensor: Sensor) -> float | None:
    """Of a field above the floor [m]; None where something carries it, or it is not level."""
    pose = pose_matrix(sensor.at)
    return float(pose[2, 3]) if sensor.on is None and abs(pose[2, 2] - 1.0) < 1e-6 else None
