"""What a column is, from what its header calls it: English, German and French, with or without units."""

from __future__ import annotations

import re
import unicodedata
from enum import StrEnum
from typing import NamedTuple


class Role(StrEnum):
    """What a column holds."""

    TIME = "time"
    JOINT = "joint position"
    VELOCITY = "joint velocity"
    ACCELERATION = "joint acceleration"
    TORQUE = "joint torque"
    TCP_POSITION = "tool position"
    TCP_ORIENTATION = "tool orientation"
    TCP_RATE = "tool velocity"
    ROBOT = "robot name"
    OTHER = "other"


class Header(NamedTuple):
    """A header, understood as far as possible."""

    text: str
    role: Role = Role.OTHER
    which: str = ""
    """Joint number, or the axis's own name: ``x``, ``rx``, ``roll``, ``qw``."""
    unit: str | None = None
    """Declared in the header; None when it is not."""
    commanded: bool = False
    """A set value rather than a measured one."""


_SPELLINGS = {
    "s": "s sec secs second seconds sekunde sekunden seconde secondes",
    "ms": "ms msec millisecond milliseconds millisekunde millisekunden milliseconde millisecondes",
    "us": "us µs μs usec",
    "min": "min minute minutes",
    # A degree in German, 0.9 of one in English: known as a word, never as a unit.
    "grad": "grad gon",
    "grad/s": "grad/s",
    "deg": "deg degs degree degrees ° degré degrés degre degres",
    "rad": "rad rads radian radians radiant",
    "mm": "mm millimeter millimetre",
    "m": "m meter metre mètre",
    "deg/s": "deg/s °/s deg/sec degree/s degrees/s deg_s degs/s",
    "rad/s": "rad/s rad/sec rad_s rads/s radian/s",
    "mm/s": "mm/s mm/sec mm_s",
    "m/s": "m/s m/sec m_s",
    "deg/s2": "deg/s2 deg/s^2 °/s2 °/s^2",
    "rad/s2": "rad/s2 rad/s^2",
    "mm/s2": "mm/s2 mm/s^2",
    "m/s2": "m/s2 m/s^2",
    "Nm": "nm n.m n*m n·m n⋅m",
}
UNITS = {spelling: unit for unit, all_of_it in _SPELLINGS.items() for spelling in all_of_it.split()}
"""Spelling, in lower case → unit."""

_BRACKET = re.compile(r"[\[({<]\s*([^\])}>]{0,40}?)\s*[\])}>]")
_SUFFIX = re.compile(
    r"(?:\s*/\s*|[\s_,]+(?:in\s+)?|(?=°))(" + "|".join(map(re.escape, sorted(UNITS, key=len)[::-1])) + r")$"
)
_CAMEL = re.compile(r"(?<=[a-zà-ÿ])(?=[A-Z])")
_TOKEN = re.compile(r"[^\W\d_]+|\d+")

_TIME = frozenset(["time", "zeit", "temps", "t", "timestamp", "zeitstempel", "horodatage", "clock"])
_TIME_EXTRA = frozenset(
    ["stamp", "elapsed", "simulation", "sim", "total", "in", "cycle", "run", "écoulé", "ecoule"]
)
_JOINT = frozenset(
    [
        "j",
        "jt",
        "jnt",
        "joint",
        "axis",
        "achse",
        "axe",
        "gelenk",
        "articulation",
        "a",
        "q",
        "theta",
        "dof",
        "qd",
        "dq",
        "qdd",
        "ddq",
        "v",
    ]
)
_VELOCITY = frozenset(
    ["velocity", "velocities", "vel", "speed", "geschwindigkeit", "vitesse", "v", "qd", "dq", "qdot", "omega"]
)
_ACCELERATION = frozenset(["acceleration", "acc", "accel", "beschleunigung", "accélération", "qdd", "ddq"])
_TORQUE = frozenset(["torque", "moment", "drehmoment", "couple", "effort", "tau"])
_ROBOT = frozenset(["robot", "roboter", "resource", "ressource", "robotname", "robotername"])
_COMMANDED = frozenset(
    ["target", "soll", "cmd", "command", "commanded", "setpoint", "desired", "consigne", "reference"]
)
_FILLER = frozenset(
    [
        "value",
        "values",
        "wert",
        "valeur",
        "angle",
        "angles",
        "winkel",
        "pos",
        "position",
        "positions",
        "actual",
        "ist",
        "act",
        "measured",
        "meas",
        "mesure",
        "mesuré",
        "msr",
        "current",
        "real",
        "of",
        "de",
        "du",
        "des",
        "la",
        "le",
        "l",
        "der",
        "the",
        "joint",
        "axis",
        "feedback",
        "name",
        "id",
        "nom",
    ]
)
_TCP = frozenset(
    [
        "tcp",
        "tool",
        "tip",
        "werkzeug",
        "outil",
        "cartesian",
        "cart",
        "kartesisch",
        "end",
        "effector",
        "eef",
        "flange",
        "p",
    ]
)
_ORIENTATION = frozenset(
    ["rx", "ry", "rz", "roll", "pitch", "yaw", "qw", "qx", "qy", "qz", "a", "b", "c", "w", "p", "r"]
)


def unit_of(text: str) -> str | None:
    """The unit a text spells, such as ``°/s``; None when it spells none."""
    return UNITS.get(unicodedata.normalize("NFKC", text).strip().casefold().strip("[](){}<>").strip())


_UR_POSE = re.compile(r"(?:actual|target)_tcp_pose_([0-5])")
"""Universal Robots' own names: x, y, z [m], then a rotation vector [rad], in the controller's base frame."""
UR_POSE = tuple(f"actual_TCP_pose_{i}" for i in range(6))
ROTATION_VECTOR = ("rotation_x", "rotation_y", "rotation_z")


def understand(text: str) -> Header:
    """What a header says; ``Role.OTHER`` when it says nothing that is known."""
    text = " ".join(text.split())
    if len(text) > 200:
        return Header(text)
    ours = _UR_POSE.fullmatch(text.casefold())
    if ours is not None:
        i = int(ours[1])
        # Known by its name alone; it takes no role from columns that a table means as its own.
        return Header(text, Role.OTHER, ("x", "y", "z", *ROTATION_VECTOR)[i], "m" if i < 3 else "rad")
    name = unicodedata.normalize("NFKC", text)
    unit: str | None = None
    for match in _BRACKET.finditer(name):
        found = unit_of(match[1])
        if found:
            unit = found
            name = name[: match.start()] + " " + name[match.end() :]
            break
    name = name.strip()
    suffix = _SUFFIX.search(name.casefold()) if unit is None else None
    if suffix is not None and suffix.start() > 0:
        unit = UNITS[suffix[1]]
        name = name[: suffix.start()]
    tokens = [token.casefold() for token in _TOKEN.findall(_CAMEL.sub(" ", name))]
    return _classify(text, tokens, unit)


def _classify(text: str, tokens: list[str], unit: str | None) -> Header:
    digits = [token for token in tokens if token.isdigit()]
    words = frozenset(token for token in tokens if not token.isdigit())
    commanded = bool(words & _COMMANDED)
    words -= _COMMANDED
    if not words and not (digits and unit):
        return Header(text, unit=unit)
    if words & _TIME and words <= _TIME | _TIME_EXTRA and not digits:
        return Header(text, Role.TIME, "", unit)
    if words & _ROBOT and words <= _ROBOT | _FILLER and not digits:
        return Header(text, Role.ROBOT, "", None)
    rate = bool(words & _VELOCITY) or unit in ("deg/s", "rad/s", "mm/s", "m/s")
    acceleration = bool(words & _ACCELERATION) or unit in ("deg/s2", "rad/s2", "mm/s2", "m/s2")
    torque = bool(words & _TORQUE) or unit == "Nm"
    kinds = _VELOCITY | _ACCELERATION | _TORQUE
    if len(digits) == 1 and words & (_JOINT | kinds) and words <= _JOINT | _FILLER | kinds:
        role = Role.JOINT
        if torque:
            role = Role.TORQUE
        elif acceleration:
            role = Role.ACCELERATION
        elif rate:
            role = Role.VELOCITY
        return Header(text, role, str(int(digits[0])), unit, commanded)
    if digits:
        return Header(text, unit=unit, commanded=commanded)
    return _tool(text, tokens, words, unit, rate=rate or acceleration, commanded=commanded)


def _tool(
    text: str, tokens: list[str], words: frozenset[str], unit: str | None, *, rate: bool, commanded: bool
) -> Header:
    rest = [t for t in tokens if t not in _COMMANDED and t not in _VELOCITY | _ACCELERATION]
    axis = [t for t in rest if t not in _TCP - {"p"} and t not in _FILLER]
    if len(axis) == 2 and axis[0] in ("r", "rot", "rotation", "q", "quat", "v") and axis[1] in "wxyz":
        axis = [axis[0][0] + axis[1]]
    elif len(axis) == 2 and axis[0] == "p" and axis[1] in "xyz":
        axis = axis[1:]
    if len(axis) != 1:
        return Header(text, unit=unit)
    name = axis[0]
    if name in ("vx", "vy", "vz"):
        return Header(text, Role.TCP_RATE, name, unit, commanded)
    if name in ("x", "y", "z") and (len(tokens) == 1 or words & (_TCP | _FILLER) or rate):
        return Header(text, Role.TCP_RATE if rate else Role.TCP_POSITION, name, unit, commanded)
    if name in _ORIENTATION:
        return Header(text, Role.TCP_RATE if rate else Role.TCP_ORIENTATION, name, unit, commanded)
    return Header(text, unit=unit)
