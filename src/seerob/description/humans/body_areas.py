"""Which of the 29 specific body areas of ISO/TS 15066:2016 Table A.2 a point on the skin is in, in words.

The table names areas and draws no borders. The borders here are choices, fractions of a bone's length and
breadth; names and numbers are the table's, front and rear as it is remembered (no public source was found). A
point of a region that is in none of its areas, such as the back of a thigh, has no area. The words are
written into reasons, and found in them again for tables.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from seerob.core.transforms import Array
from seerob.description.humans.anthropometry import Body
from seerob.description.humans.skeleton import without_side

FEET = "feet, in no region of the table"
NOWHERE = ""


def words(bone: str, region: str | None, *, front: bool, dominant: bool, area: str | None = None) -> str:
    """A bone with its body area: ``op/right_hand (Hands and fingers, front, palm, dominant side)``.

    Args:
        bone: Full name.
        region: Of ISO/TS 15066:2016 Table A.3; None where that has none.
        front: Whether in front.
        dominant: Whether on the side of the dominant hand.
        area: Of Table A.2; None where that has none.
    """
    bones = [FEET] if region is None else [region, "front" if front else "rear"]
    bones += [area.partition(",")[0]] if area else []
    bones += ["dominant side"] if dominant else []
    return f"{bone} ({', '.join(bones)})"


def area_in(reason: str, human: str) -> tuple[str, str]:
    """Bone without the person's name and body area that a reason names; empty where it names none."""
    found = re.search(rf"(?:^|[\s↔]){re.escape(human)}/(\w+)(?: \(([^()]*)\))?", reason)
    return (NOWHERE, NOWHERE) if found is None else (found[1], found[2] or NOWHERE)


EYE_HEIGHT = 0.936
"""Share of the stature (Drillis and Contini)."""
MIDDLE = 0.15
"""Share of the chest's breadth on either side that is the sternum, or of the loins' the spine: a choice."""
FINGERS = 0.5
"""Share of the hand's length that is fingers: a choice."""
KNEE = 0.15
"""Share of the thigh's length that is the knee: a choice."""
SEVENTH = 0.3
"""Share of the neck's length, from below, that is its seventh vertebra: a choice."""


@dataclass(frozen=True)
class SkinArea:
    """One area."""

    number: int
    """In the order of Table A.2."""
    name: str
    """With ``dominant`` or ``non-dominant`` where the table tells them apart."""


_NAMES = (
    "middle of forehead", "temple", "masticatory muscle", "neck muscle", "seventh neck muscle",
    "shoulder joint", "fifth lumbar vertebra", "sternum", "pectoral muscle", "abdominal muscle",
    "pelvic bone", "deltoid muscle", "humerus", "radial bone", "forearm muscle", "arm nerve",
    "forefinger pad, dominant", "forefinger pad, non-dominant", "forefinger end joint, dominant",
    "forefinger end joint, non-dominant", "thenar eminence", "palm, dominant", "palm, non-dominant",
    "back of the hand, dominant", "back of the hand, non-dominant", "thigh muscle", "kneecap",
    "middle of shin", "calf muscle",
)  # fmt: skip
AREAS = tuple(SkinArea(number, name) for number, name in enumerate(_NAMES, 1))
"""All of them; area n is ``AREAS[n - 1]``."""


def eyes(body: Body) -> float:
    """Height of the eyes in the head's frame [m]."""
    return body.length["head"] - (1 - EYE_HEIGHT) * body.stature


def in_front(bone: str, point: Array | Sequence[float], body: Body) -> bool:
    """Whether a point is before its bone; the shoulder girdle runs backward, and its own line divides it.

    Args:
        bone: Bone, with its side.
        point: In the bone's frame [m], shape (3,).
        body: The person.
    """
    if without_side(bone) != "clavicle":
        return bool(point[0] > 0)
    share, along = _along_clavicle(bone, point, body)
    return bool(point[0] > share * along)


def outer_shoulder(bone: str, point: Array | Sequence[float], body: Body) -> bool:
    """Whether a point of a clavicle is nearer to the shoulder's joint than to the sternum.

    Args:
        bone: ``right_clavicle`` or ``left_clavicle``.
        point: In the bone's frame [m], shape (3,).
        body: The person.
    """
    return _along_clavicle(bone, point, body)[0] > 0.5


def _along_clavicle(bone: str, point: Array | Sequence[float], body: Body) -> tuple[float, float]:
    """Share of the way from sternum to shoulder joint that a point is beside, and x of all that way [m]."""
    a, b, c = body.offset[bone.replace("clavicle", "upper_arm")].tolist()
    x, y, z = map(float, point)
    return (x * a + y * b + z * c) / (a * a + b * b + c * c), a


def body_area(bone: str, point: Array | Sequence[float], *, body: Body, hand: str) -> SkinArea | None:
    """Area of a point on the skin; None where the table has none.

    Args:
        bone: Bone, with its side.
        point: In the bone's frame [m], shape (3,).
        body: The person.
        hand: Dominant side, ``right`` or ``left``.
    """
    number = _number(bone, point, body, dominant=bone.startswith(f"{hand}_"))
    return AREAS[number - 1] if number else None


def _number(bone: str, point: Array | Sequence[float], body: Body, *, dominant: bool) -> int:
    x, y, z = map(float, point)
    front, length, plain = in_front(bone, point, body), body.length, without_side(bone)
    outward = -z if bone.startswith("left_") else z
    number = 0
    match plain:
        case "head":
            number = _head(x, y, z, eyes(body))
        case "neck" if not front:
            middle = y < SEVENTH * length["neck"] and abs(z) < MIDDLE * length["chest_breadth"]
            number = 5 if middle else 4
        case "thorax" if front:
            number = 8 if abs(z) < MIDDLE * length["chest_breadth"] else 9
        case "clavicle" if front:
            number = 6 if outer_shoulder(bone, point, body) else 9
        case "lumbar" if front:
            number = 10
        case "lumbar" if y < length["lumbar"] / 2 and abs(z) < MIDDLE * length["hip_breadth"]:
            number = 7
        case "pelvis" if front:
            number = 11
        case "upper_arm" if not front:
            number = 12 if y > -length["upper_arm"] / 2 else 13
        case "forearm":
            # With the palm forward the radius is on the outer side, and near the wrist under the skin.
            radius = y < -length["forearm"] / 2 and outward > 0
            number = 16 if front else 14 if radius else 15
        case "hand":
            number = _hand(front, outward, finger=y < -(1 - FINGERS) * length["hand"], dominant=dominant)
        case "thigh" if front:
            number = 26 if y > -(1 - KNEE) * length["thigh"] else 27
        case "shank":
            number = 28 if front else 29
    return number


def _head(x: float, y: float, z: float, height: float) -> int:
    if abs(z) > abs(x):
        # The side: the temple above the eyes, the muscle of the jaw below and in front of the ear.
        return 2 if y >= height else 3 if x > 0 else 0
    return 1 if x > 0 and y >= height else 0


def _hand(front: bool, outward: float, *, finger: bool, dominant: bool) -> int:
    if finger:
        first = 17 if front else 19
    elif front and outward > 0:
        return 21
    else:
        first = 22 if front else 24
    return first if dominant else first + 1
