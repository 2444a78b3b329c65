"""Protective devices in the workstation file: what a maker's data sheet says of each."""

from __future__ import annotations

import math
from typing import Annotated

from seerob.core.errors import suggestion
from seerob.core.quantities import Corners, Length, Metres3, Name, Pose, Seconds, Table, unit
from seerob.core.shapes import check_polygon

MOST_RAYS = 20_000
"""Most rays of one scanner, or beams of one curtain."""
MOST_FIELDS = 32

Capability = Annotated[float, unit("m", gt=0, le=0.5)]
Angle = Annotated[float, unit("rad", gt=0, le=2 * math.pi)]


class MonitoredField(Table, frozen=True, kw_only=True):
    """A monitored field of a laser scanner."""

    name: Name
    """Such as ``protective`` or ``warning``."""
    corners: Corners
    """Its border (x, y) in the scanner's plane [m]; the scanner is at the origin and looks along x."""

    def __post_init__(self) -> None:
        check_polygon(self.corners)


class LaserScanner(Table, frozen=True, kw_only=True):
    """A laser scanner that looks along x of its frame and turns about z."""

    range: Length
    """Distance up to which it measures [m]."""
    angle: Angle
    """Whole angle that it scans, half to each side of x [rad]; ``angle_deg = 275``."""
    resolution: Angle
    """Angle between two beams [rad]."""
    fields: tuple[MonitoredField, ...]
    """One or more fields."""

    def __post_init__(self) -> None:
        if not 1 <= len(self.fields) <= MOST_FIELDS:
            raise ValueError(f"fields: 1 to {MOST_FIELDS} are needed, not {len(self.fields)}")
        names = [field.name for field in self.fields]
        if len(set(names)) < len(names):
            raise ValueError(f"two fields have the same name: {', '.join(names)}")
        if self.angle / self.resolution > MOST_RAYS:
            what = f"{self.angle / self.resolution:.0f} beams"
            raise ValueError(f"resolution = {self.resolution:g} rad makes {what}, at most {MOST_RAYS}")
        for field in self.fields:
            farthest = max(math.hypot(x, y) for x, y in field.corners)
            if farthest > self.range:
                raise ValueError(
                    f"field {field.name!r} reaches {farthest:g} m, beyond the range of {self.range:g} m: "
                    "make it smaller, or give the right range"
                )


class Curtain(Table, frozen=True, kw_only=True):
    """A light curtain between two posts."""

    ends: tuple[Metres3, Metres3]
    """Lowest beam at the sender and at the receiver, in its frame [m]."""
    height: Length
    """From the lowest to the highest beam, along z of its frame [m]."""
    pitch: Length | None = None
    """Distance between two beams [m]; the detection capability when not given, which is never too fine."""

    def __post_init__(self) -> None:
        a, b = self.ends
        if math.hypot(b[0] - a[0], b[1] - a[1]) < 1e-3:
            raise ValueError("ends: sender and receiver stand at the same place, give two posts")
        if abs(a[2] - b[2]) > 1e-6:
            raise ValueError(
                f"ends: the lowest beam is level, but z is {a[2]:g} and {b[2]:g} m; tilt it with at"
            )
        if self.pitch is not None and self.height / self.pitch > MOST_RAYS:
            raise ValueError(f"pitch = {self.pitch:g} m makes more than {MOST_RAYS} beams")


class Mat(Table, frozen=True, kw_only=True):
    """A pressure-sensitive mat, or any device that senses presence on or above a piece of floor."""

    corners: Corners
    """Its border (x, y) in its frame [m]."""
    height: Annotated[float, unit("m", gt=0, le=3)] = 0.02
    """Above it, up to which somebody counts as standing on it [m]."""

    def __post_init__(self) -> None:
        check_polygon(self.corners)


class Sensor(Table, frozen=True, kw_only=True):
    """A protective device: what it sees is computed, what nobody said of it stays unknown."""

    one_of = ((("laser_scanner",), ("light_curtain",), ("pressure_mat",)),)

    name: Name
    at: Pose = Pose()
    """Pose in the world, or in the frame that carries it."""
    on: str | None = None
    """Full name of the link or tool that carries it; stands still when not given."""
    laser_scanner: LaserScanner | None = None
    """It is a laser scanner, with these figures."""
    light_curtain: Curtain | None = None
    """It is a light curtain, with these figures."""
    pressure_mat: Mat | None = None
    """It is a pressure mat, with these figures."""
    capability: Capability | None = None
    """Detection capability d: the smallest object that it always sees [m], from its data sheet."""
    response: Seconds | None = None
    """Response time: from the object in the field to the output that has switched [s]."""
    ignores: tuple[str, ...] = ()
    """What its beams pass: its own housing and mount."""
    source: str = ""
    """Data sheet or measurement that the figures come from."""

    def __post_init__(self) -> None:
        kinds = (self.laser_scanner, self.light_curtain, self.pressure_mat)
        if sum(kind is not None for kind in kinds) != 1:
            raise ValueError("give exactly one of laser_scanner, light_curtain, pressure_mat")
        curtain = self.light_curtain
        if curtain is None:
            return
        if curtain.pitch is None and self.capability is None:
            raise ValueError("a light curtain needs capability, or light_curtain.pitch")
        if curtain.height / (curtain.pitch or self.capability or 1.0) > MOST_RAYS:
            raise ValueError(f"capability = {self.capability:g} m makes more than {MOST_RAYS} beams")

    def field(self, name: str | None) -> MonitoredField:
        """A field of a scanner; its only one when no name is given.

        Raises:
            ValueError: It is no scanner, has no such field, or has several.
        """
        if self.laser_scanner is None:
            raise ValueError(f"{self.name} is no laser scanner")
        fields = {field.name: field for field in self.laser_scanner.fields}
        if name is None and len(fields) == 1:
            return self.laser_scanner.fields[0]
        if name is None or name not in fields:
            what = "several fields, name one" if name is None else f"no field {name!r}"
            raise ValueError(f"{self.name} has {what}; {suggestion(name or '', fields)}")
        return fields[name]
