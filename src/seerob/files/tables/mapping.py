"""Which column of a table is what, in which unit: the ``[sources.mapping]`` of a workstation file."""

from __future__ import annotations

import json
import re
from enum import StrEnum
from math import pi

from msgspec import Struct, structs

Column = str | int
"""A header as it stands in the file, or a column number from 1."""


class Motion(StrEnum):
    """What a table is read for."""

    JOINTS = "joints"
    TOOL = "tool positions"


class TimeUnit(StrEnum):
    """Unit of a time column."""

    S = "s"
    MS = "ms"
    US = "us"
    MIN = "min"


class PositionUnit(StrEnum):
    """Unit of joint positions, angles or lengths."""

    DEG = "deg"
    RAD = "rad"
    MM = "mm"
    M = "m"


class RateUnit(StrEnum):
    """Unit of joint velocities."""

    DEG_S = "deg/s"
    RAD_S = "rad/s"
    MM_S = "mm/s"
    M_S = "m/s"


class AngleUnit(StrEnum):
    """Unit of angles."""

    DEG = "deg"
    RAD = "rad"


class LengthUnit(StrEnum):
    """Unit of lengths."""

    MM = "mm"
    M = "m"


SI: dict[str, tuple[str, float]] = {
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "min": ("s", 60.0),
    "deg": ("rad", pi / 180),
    "rad": ("rad", 1.0),
    "mm": ("m", 1e-3),
    "m": ("m", 1.0),
    "deg/s": ("rad/s", pi / 180),
    "rad/s": ("rad/s", 1.0),
    "mm/s": ("m/s", 1e-3),
    "m/s": ("m/s", 1.0),
    "Nm": ("N·m", 1.0),
}
"""Unit → SI unit and factor."""


class Mapping(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where things stand in a table. What is not given is guessed, and asked when in doubt."""

    sheet: str | None = None
    """Sheet of a workbook."""
    header_row: int | None = None
    """Row with the names of the columns, from 1; 0 where there is none, and columns go by their numbers."""
    group_row: int | None = None
    """Row above it whose cells stand for several columns (``Position``, ``Velocity``); they become
    the first word of the names below."""
    unit_row: int | None = None
    """Row below the names that holds their units."""
    delimiter: str | None = None
    """Delimiter of a text file: ``","``, ``";"``, a tab, ``"|"``; ``" "`` is any run of blanks."""
    decimal_comma: bool | None = None
    """Whether ``1,5`` is one and a half."""
    robot_column: Column | None = None
    """Column that names the robot, when several share the table."""
    robot: str | None = None
    """The name to take from it."""
    time: Column | None = None
    """Column of the instants, by header or number."""
    time_unit: TimeUnit | None = None
    """Unit of that column, when its header does not say."""
    joints: str | tuple[Column, ...] | None = None
    """Columns of the joint positions in joint order; or a regular expression for whole headers
    whose first group is the joint's number."""
    joint_unit: PositionUnit | tuple[PositionUnit, ...] | None = None
    """One unit for all joints, or one per joint."""
    velocities: str | tuple[Column, ...] | None = None
    """Columns, like ``joints``; ``[]`` leaves them out, and velocities are derived from the positions."""
    velocity_unit: RateUnit | tuple[RateUnit, ...] | None = None
    """One unit for all joints, or one per joint."""
    torques: str | tuple[Column, ...] | None = None
    """Columns [N·m or N], like ``joints``; ``[]`` leaves them out."""
    tcp_position: tuple[Column, ...] | None = None
    """Columns x, y, z of the tool; ``[]`` leaves them out."""
    tcp_position_unit: LengthUnit | None = None
    """Unit of those columns, when their headers do not say."""
    tcp_orientation: tuple[Column, ...] | None = None
    """Columns of the tool's orientation, in the order of the convention; ``[]`` leaves them out."""
    tcp_convention: str | None = None
    """``"ZYX"``: turned axes in the order of the columns; ``"xyz"``: fixed axes; ``"rpy"``;
    ``"rotation_vector"``; ``"wxyz"`` or ``"xyzw"``."""
    tcp_orientation_unit: AngleUnit | None = None
    """Unit of the angles, when the headers do not say."""

    def toml(self, remarks: dict[str, str] | None = None) -> str:
        """The table as it stands in a workstation file.

        Args:
            remarks: A comment per key, written above it.
        """
        lines = ["[sources.mapping]"]
        for name in self.__struct_fields__:
            value = getattr(self, name)
            if value is None:
                continue
            if remarks and name in remarks:
                lines.append(f"# {remarks[name]}")
            lines.append(f"{name} = {toml_value(value)}")
        return "\n".join(lines) + "\n"

    def without_joints(self) -> Mapping:
        """This mapping for a reading of the tool alone."""
        return structs.replace(
            self,
            joints=None,
            joint_unit=None,
            velocities=None,
            velocity_unit=None,
            torques=None,
        )

    def over(self, other: Mapping) -> Mapping:
        """This mapping, and where it says nothing the other."""
        given = {k: v for k, v in structs.asdict(self).items() if v is not None}
        return structs.replace(other, **given)


def toml_value(value: object) -> str:
    """A value as it stands in a TOML file, on one line; any text that is neither number nor table quoted."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml_value(str(k))} = {toml_value(v)}" for k, v in value.items()) + "}"
    text = json.dumps(str(value), ensure_ascii=False)
    return re.sub(r"[\x7f-\x9f\ud800-\udfff]", lambda m: f"\\u{ord(m[0]):04x}", text)
