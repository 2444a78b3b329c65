"""Which of the 29 specific body areas of ISO/TS 15066:2016 Table A.2 a point on the skin is in, in words.

The table names areas and draws no borders. The borders here are choices, fractions of a bone's length and
breadth; names and numbers are the table's, front and rear as it is remembered (no public source was found). A
point of a region that is in none of its areas, such as the back of a thigh, has no area. The words are
written into reasons, and found in them again for tables.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

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


BODY_REGION: dict[str, tuple[str | None, str | None]] = {
    "pelvis": ("Pelvis", "Pelvis"),
    "lumbar": ("Abdomen", "Back and shoulders"),
    "thorax": ("Chest", "Back and shoulders"),
    "neck": ("Neck", "Neck"),
    "head": ("Face", "Skull and forehead"),
    "clavicle": ("Chest", "Back and shoulders"),
    "upper_arm": ("Upper arms and elbow joints", "Upper arms and elbow joints"),
    "forearm": ("Lower arms and wrist joints", "Lower arms and wrist joints"),
    "hand": ("Hands and fingers", "Hands and fingers"),
    "thigh": ("Thighs and knees", "Thighs and knees"),
    "shank": ("Lower legs", "Lower legs"),
    "foot": (None, None),
    "toes": (None, None),
}
"""Bone without side → body region of ISO/TS 15066:2016 Table A.3 in front and behind.

The shoulder girdle counts in front as chest, its outer half as shoulder.
Feet are in no region of that table. The face is the front of the head below the eyes.
"""

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


class Borders:
    """Where areas and regions on the skin of one bone end, bound once.

    Args:
        bone: Bone, with its side.
        body: The person.
        hand: Dominant side, ``right`` or ``left``.
    """

    def __init__(self, bone: str, *, body: Body, hand: str) -> None:
        self._bone, self._length, self._eyes = without_side(bone), body.length, eyes(body)
        self._dominant, self._left = bone.startswith(f"{hand}_"), bone.startswith("left_")
        girdle = self._bone == "clavicle"
        way = body.offset[bone.replace("clavicle", "upper_arm")].tolist() if girdle else (0.0, 0.0, 0.0)
        a, b, c = self._way = way
        self._square = a * a + b * b + c * c

    def in_front(self, x: float, y: float, z: float) -> bool:
        """Whether a point is before the bone; the shoulder girdle runs backward, and its own line divides it.

        Args:
            x: In the bone's frame [m], as y and z.
            y: Along the bone.
            z: To the right.
        """
        if self._bone != "clavicle":
            return x > 0
        return x > self._along(x, y, z) * self._way[0]

    def outer_shoulder(self, x: float, y: float, z: float) -> bool:
        """Whether a point of a clavicle is nearer to the shoulder's joint than to the sternum."""
        return self._along(x, y, z) > 0.5

    def _along(self, x: float, y: float, z: float) -> float:
        """Share of the way from sternum to shoulder joint that a point is beside."""
        a, b, c = self._way
        return (x * a + y * b + z * c) / self._square

    def region(self, x: float, y: float, z: float) -> str | None:
        """Region of ISO/TS 15066:2016 Table A.3 of a point on the skin; None where the table has none."""
        front, behind = BODY_REGION[self._bone]
        if self._bone == "head":
            return front if x > 0 and y < self._eyes else behind
        if self._bone == "clavicle" and self.outer_shoulder(x, y, z):
            return behind
        return front if self.in_front(x, y, z) else behind

    def area(self, x: float, y: float, z: float) -> int:
        """Number of the area of a point on the skin; 0 where the table has none; see `in_front`."""
        front, length = self.in_front(x, y, z), self._length
        number = 0
        match self._bone:
            case "head":
                number = _head(x, y, z, self._eyes)
            case "neck" if not front:
                middle = y < SEVENTH * length["neck"] and abs(z) < MIDDLE * length["chest_breadth"]
                number = 5 if middle else 4
            case "thorax" if front:
                number = 8 if abs(z) < MIDDLE * length["chest_breadth"] else 9
            case "clavicle" if front:
                number = 6 if self.outer_shoulder(x, y, z) else 9
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
                radius = y < -length["forearm"] / 2 and (z < 0 if self._left else z > 0)
                number = 16 if front else 14 if radius else 15
            case "hand":
                finger, outward = y < -(1 - FINGERS) * length["hand"], z < 0 if self._left else z > 0
                number = _hand(front, outward=outward, finger=finger, dominant=self._dominant)
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


def _hand(front: bool, *, outward: bool, finger: bool, dominant: bool) -> int:
    if finger:
        first = 17 if front else 19
    elif front and outward:
        return 21
    else:
        first = 22 if front else 24
    return first if dominant else first + 1
