"""Headers of tables of captured motion: which point, which coordinate, in which unit."""

from __future__ import annotations

import re
from typing import NamedTuple

from seerob.files.tables.headers import Role, understand

MAX_HEADER = 200
_BRACKET = re.compile(r"\s*[\[(]\s*([^\])]{0,20}?)\s*[\])]\s*")
_SPLIT = r"(?:[\s_.:/\-]+|(?<=[a-z0-9])(?=[A-Z]))"
_TURN = re.compile(
    rf"^(?P<name>.+?){_SPLIT}(?:q|quat|quaternion|rot|rotation|ori|orientation|Rotation|Quat|Q)"
    rf"[\s_.:/\-]*(?P<axis>[wxyzWXYZ])$"
)
_PLACE = re.compile(
    rf"^(?P<name>.+?)(?:{_SPLIT}(?:pos|position|Position|Pos|loc|location|translation|coord))?"
    rf"{_SPLIT}(?P<axis>[xyzXYZ])$"
)
_SURE = re.compile(rf"^(?P<name>.+?){_SPLIT}(?:conf|confidence|Confidence|tracking_?state|quality)$")
UNITS = {"mm": "mm", "cm": "cm", "m": "m", "millimeter": "mm", "meter": "m", "millimetre": "mm", "metre": "m"}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
"""Unit of time → seconds."""


class Column(NamedTuple):
    """What one column holds."""

    name: str
    """Name of the point, as the file has it; empty in a table with a row per point."""
    what: str
    """``position``, ``orientation``, ``confidence``, ``time``, ``person`` or ``point``."""
    axis: int = 0
    """0…2 for x, y, z; 0…3 for w, x, y, z."""
    unit: str = ""
    """Declared in the header; empty when it is not."""


def column(header: str) -> Column | None:
    """What a header says; None when it says nothing of captured motion."""
    text = " ".join(header.split())
    if not text or len(text) > MAX_HEADER:
        return None
    unit = ""
    bracket = _BRACKET.search(text)
    if bracket is not None:
        unit = bracket[1].lower()
        text = f"{text[: bracket.start()]} {text[bracket.end() :]}".strip()
    plain = re.sub(r"[\s_\-.]+", "_", text.lower())
    if (time := _time(plain, text, unit)) is not None:
        return time
    if plain in ("body", "body_id", "person", "person_id", "user", "user_id", "subject", "skeleton_id"):
        return Column("", "person")
    if plain in ("joint", "joint_name", "joint_id", "point", "marker", "segment", "bone", "name"):
        return Column("", "point")
    if plain in ("confidence", "conf", "joint_confidence", "tracking_state"):
        return Column("", "confidence")
    return _of_a_point(text, plain, UNITS.get(unit, unit))


def _time(plain: str, text: str, unit: str) -> Column | None:
    match = re.fullmatch(r"(?:device_)?(?:time|timestamp|time_stamp|t)(?:_(s|ms|us|usec|msec|sec))?", plain)
    if match is not None:
        found = {"usec": "us", "msec": "ms", "sec": "s"}.get(match[1] or "", match[1] or "")
        return Column("", "time", unit=found or {"µs": "us", "usec": "us", "sec": "s"}.get(unit, unit))
    header = understand(f"{text} [{unit}]" if unit else text)
    return Column("", "time", unit=header.unit or "") if header.role is Role.TIME else None


def _of_a_point(text: str, plain: str, unit: str) -> Column | None:
    if plain in ("x", "y", "z") or re.fullmatch(r"(?:pos|position)_?[xyz]", plain):
        return Column("", "position", "xyz".index(plain[-1]), unit)
    if re.fullmatch(r"(?:q|quat|rot|ori|orientation)_?[wxyz]", plain):
        return Column("", "orientation", "wxyz".index(plain[-1]))
    if (match := _SURE.match(text)) is not None:
        return Column(match["name"], "confidence")
    if (match := _TURN.match(text)) is not None:
        return Column(match["name"], "orientation", "wxyz".index(match["axis"].lower()))
    if (match := _PLACE.match(text)) is not None:
        return Column(match["name"], "position", "xyz".index(match["axis"].lower()), unit)
    return None
