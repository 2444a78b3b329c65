"""What the basis of a posture rule says: what was entered, which thresholds hold, which choices were made."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum

import msgspec

from seerob.core.snapshot import Input, Origin
from seerob.criteria.scoring.held_work import WorkDetection
from seerob.criteria.scoring.measured import ANGLES_OF, Accuracy, ArmPolicy, JointAccuracy
from seerob.criteria.scoring.phases import Phase
from seerob.criteria.scoring.spans import Thresholds
from seerob.model.model import Model
from seerob.workstation.source import PostureError

PROJECTION_NOTE = "sideways angles are taken out of the sagittal plane, not projected on the frontal one"
ACCURACY_NOTE = "errors of the angles that depend on each other: each angle is varied on its own"
_UNITS = {"load": "kg"}


def entered(phases: Sequence[Phase], unknown: Phase) -> tuple[Input, ...]:
    """What was entered for each phase, and what was not."""
    found = []
    listed = phases or (unknown,)
    if phases and phases[0].start > 0:
        text = f"nothing is entered before {phases[0].start:g} s"
        found.append(Input(name="phases", value=text, origin=Origin.MISSING))
    for phase in listed:
        where = _where(phase) if len(listed) > 1 or phase.start > 0 or phase.end is not None else ""
        for field in msgspec.structs.fields(phase):
            value = getattr(phase, field.name)
            name = f"entered {field.name.replace('_', ' ')}{where}"
            if field.name in Phase.__struct_fields__:
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


def _where(phase: Phase) -> str:
    until = "" if phase.end is None else f" to {phase.end:g} s"
    cycle = "" if phase.cycle is None else f" of each cycle of {phase.cycle:g} s"
    title = f" ({phase.title})" if phase.title else ""
    return f" from {phase.start:g} s{until}{cycle}{title}"


def choices(thresholds: Thresholds, arm: ArmPolicy) -> tuple[Input, ...]:
    """Thresholds, and how an arm is read."""
    return (
        *chosen(thresholds, Thresholds()),
        Input(
            name="arm angle",
            value=ArmPolicy(arm).value,
            origin=Origin.CHOICE if arm == ArmPolicy.PROJECTION else Origin.GIVEN,
            source="option arm, projection when not given",
        ),
    )


def watched(detection: WorkDetection | None, hold: float, count: int) -> tuple[Input, ...]:
    """How static and repeated work is found; nothing when it is entered."""
    if detection is None:
        return ()
    return (
        *chosen_angles(detection, WorkDetection(), ("tolerance", "movement"), "detection "),
        Input(name="static", value=hold, unit="s", origin=Origin.STATED, source="the method, at least"),
        Input(
            name="repeated", value=count, unit="1/min", origin=Origin.STATED, source="the method, at least"
        ),
        Input(
            name="before the run",
            value="nothing was held or repeated" if detection.from_rest else "unknown",
            origin=Origin.GIVEN if detection.from_rest else Origin.MISSING,
            source="option detect.from_rest",
        ),
    )


def chosen(thresholds: msgspec.Struct, usual: msgspec.Struct) -> tuple[Input, ...]:
    """Every threshold [deg], and whether it is the file's or this program's."""
    return chosen_angles(thresholds, usual, thresholds.__struct_fields__, "threshold ")


def chosen_angles(
    chosen: msgspec.Struct, usual: msgspec.Struct, names: Sequence[str], label: str
) -> tuple[Input, ...]:
    """Some angles of a table [deg], and whether they are the file's or this program's."""
    found = []
    for name in names:
        value = getattr(chosen, name)
        own = value != getattr(usual, name)
        found.append(
            Input(
                name=label + name.replace("_", " "),
                value=round(math.degrees(value), 6),
                unit="deg",
                origin=Origin.GIVEN if own else Origin.CHOICE,
                source="workstation file" if own else "a choice of seerob, the method leaves it open",
            )
        )
    return tuple(found)


def posture_quality(
    accuracy: float | None,
    joints: JointAccuracy | None,
    unmeasured: Sequence[str],
    model: Model,
    human: str,
) -> tuple[Input, ...]:
    """How accurate the angles are, and bones that nobody measures."""
    single = () if joints is None else ((k, v) for k, v in msgspec.structs.asdict(joints).items())
    found = [
        Input(name=bone.replace("_", " "), origin=Origin.MISSING, source="unmeasured") for bone in unmeasured
    ]
    for name, value in (("angles", accuracy), *single):
        label = f"accuracy of the {name}"
        if value is not None:
            angle = round(math.degrees(value), 6)
            source = "workstation file"
            found.append(Input(name=label, value=angle, unit="deg", origin=Origin.GIVEN, source=source))
        elif name == "angles":
            heard = _captured_errors(model, human) if joints is None else []
            found += heard or [Input(name=label, origin=Origin.MISSING, source="not given")]
    return tuple(found)


def captured_accuracy(model: Model, human: str) -> Accuracy | None:
    """The worst accuracy of the devices that see a person, by angle [rad]; None when nobody knows any."""
    known = [error for _, error in _devices(model, human) if error is not None]
    if not known:
        return None
    return {
        name: max(error.joints.get(joint, error.angles) for error in known)
        for joint, names in ANGLES_OF.items()
        for name in names
    }


def _devices(model: Model, human: str) -> list[tuple[str, PostureError | None]]:
    """Names of sources that captured a person, and how far angles may be off."""
    found = [(s, s.posture_error()) for s in model.workstation.sources if s.target() == human]
    return [(source.name, error) for source, error in found if source.captured or error is not None]


def _captured_errors(model: Model, human: str) -> list[Input]:
    found = []
    for name, error in _devices(model, human):
        if error is None:
            found.append(
                Input(name=f"accuracy of the angles, {name}", origin=Origin.MISSING, source="not known")
            )
            continue
        origin = Origin.GIVEN if error.given else Origin.STATED
        for joint, value in (("angles", error.angles), *error.joints.items()):
            found.append(
                Input(
                    name=f"accuracy of the {joint}, {name}",
                    value=round(math.degrees(value), 6),
                    unit="deg",
                    origin=origin,
                    source=error.source,
                )
            )
    return found


def _plain(value: object) -> float | str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return float(value)
    return str(value.value if isinstance(value, Enum) else value)
