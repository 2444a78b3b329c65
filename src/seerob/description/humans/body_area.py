"""Words for where on a person something is: written into reasons, and found in them again for tables."""

from __future__ import annotations

import re

FEET = "feet, in no region of the table"
NOWHERE = ""


def words(bone: str, region: str | None, *, front: bool, dominant: bool, area: str | None = None) -> str:
    """A bone with its body area: ``op/right_hand (Hands and fingers, front, palm, dominant side)``.

    Args:
        bone: Full name.
        region: Of ISO/TS 15066:2016 Table A.3; None where that has none.
        front: Whether in front.
        dominant: Whether on the side of the dominant hand.
        area: Of Table A.2 (`seerob.description.humans.body_areas`); None where that has none.
    """
    told = [FEET] if region is None else [region, "front" if front else "rear"]
    told += [area.partition(",")[0]] if area else []
    told += ["dominant side"] if dominant else []
    return f"{bone} ({', '.join(told)})"


def area_in(reason: str, human: str) -> tuple[str, str]:
    """Bone without the person's name and body area that a reason names; empty where it names none."""
    found = re.search(rf"(?:^|[\s↔]){re.escape(human)}/(\w+)(?: \(([^()]*)\))?", reason)
    return (NOWHERE, NOWHERE) if found is None else (found[1], found[2] or NOWHERE)
