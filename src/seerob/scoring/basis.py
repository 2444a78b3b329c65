"""What the basis of a posture rule says: what was entered, which thresholds hold, which choices were made."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum

import msgspec

from seerob.scoring.phases import Phase
from seerob.scoring.shoulder import ArmPolicy
from seerob.scoring.thresholds import Thresholds
from seerob.snapshot import Input, Origin

PROJECTION_NOTE = "sideways angles are taken out of the sagittal plane, not projected on the frontal one"
ACCURACY_NOTE = "errors of the angles that depend on each other: each angle is varied on its own"
_UNITS = {"load": "kg", "start": "s"}


def entered(phases: Sequence[Phase], unknown: Phase) -> tuple[Input, ...]:
    """What was entered for each phase, and what was not."""
    found = []
    listed = phases or (unknown,)
    if phases and phases[0].start > 0:
        text = f"nothing is entered before {phases[0].start:g} s"
        found.append(Input(name="phases", value=text, origin=Origin.MISSING))
    for phase in listed:
        where = f" from {phase.start:g} s" if len(listed) > 1 or phase.start > 0 else ""
        for field in msgspec.structs.fields(phase):
            value = getattr(phase, field.name)
            name = field.name.replace("_", " ") + where
            if field.name == "start":
                continue
            if value is None:
                found.append(Input(name=name, origin=Origin.MISSING, source="not entered"))
            elif value == "posture":
                found.append(
                    Input(
                        name=name, value="from the posture", origin=Origin.ESTIMATED, source="feet and knees"
                    )
                )
            else:
                found.append(
                    Input(
                        name=name,
                        value=_plain(value),
                        unit=_UNITS.get(field.name, ""),
                        origin=Origin.CHOICE if value == field.default else Origin.GIVEN,
                        source=f"workstation file, {_plain(field.default)} when not given"
                        if value == field.default
                        else "workstation file",
                    )
                )
    return tuple(found)


def choices(
    thresholds: Thresholds, arm: ArmPolicy, accuracy: float | None, unmeasured: Sequence[str]
) -> tuple[Input, ...]:
    """Thresholds, how an arm is read, accuracy, and bones that nobody measures."""
    return (
        *chosen(thresholds, Thresholds()),
        Input(
            name="arm angle",
            value=arm.value,
            origin=Origin.CHOICE if arm is ArmPolicy.PROJECTION else Origin.GIVEN,
            source="option arm, projection when not given",
        ),
        *posture_quality(accuracy, unmeasured),
    )


def chosen(thresholds: msgspec.Struct, usual: msgspec.Struct) -> tuple[Input, ...]:
    """Every threshold [deg], and whether it is the file's or this program's."""
    found = []
    for field in msgspec.structs.fields(thresholds):
        value = getattr(thresholds, field.name)
        own = value != getattr(usual, field.name)
        found.append(
            Input(
                name="threshold " + field.name.replace("_", " "),
                value=round(math.degrees(value), 6),
                unit="deg",
                origin=Origin.GIVEN if own else Origin.CHOICE,
                source="workstation file" if own else "a choice of seerob, the method leaves it open",
            )
        )
    return tuple(found)


def posture_quality(accuracy: float | None, unmeasured: Sequence[str]) -> tuple[Input, ...]:
    """How accurate the angles are, and bones that nobody measures."""
    missing = tuple(
        Input(name=bone.replace("_", " "), origin=Origin.MISSING, source="unmeasured") for bone in unmeasured
    )
    if accuracy is None:
        return (*missing, Input(name="accuracy of the angles", origin=Origin.MISSING, source="not given"))
    angle = round(math.degrees(accuracy), 6)
    given = Input(
        name="accuracy of the angles", value=angle, unit="deg", origin=Origin.GIVEN, source="workstation file"
    )
    return (*missing, given)


def _plain(value: object) -> float | str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return float(value)
    return str(value.value if isinstance(value, Enum) else value)
