"""What all sources of captured motion are told alike, and how it is applied to what they read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Protocol

import numpy as np
from msgspec import Meta, Struct

from seerob.core.errors import InputError, Problem, UnknownName, suggestion
from seerob.core.quantities import Pose, Seconds
from seerob.core.samples import BodyPoint
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, rotation_from_rpy, rotation_from_wxyz, transform
from seerob.description.capture import mapping as names
from seerob.description.capture.calibration import Calibrated, CalibrationPose, calibrate
from seerob.description.capture.captured import CaptureFrame, Layout
from seerob.description.capture.estimated import bare, turned
from seerob.description.capture.estimated import estimated as without_neighbours
from seerob.description.capture.observing import Observer, bind, with_mounts, with_places, without_unplaced
from seerob.description.capture.smoothing import HIGHEST, LOWEST, group_delay
from seerob.description.description import Description
from seerob.description.humans.skeleton import BONES
from seerob.workstation.source import PostureError, Target

Weight = Annotated[float, Meta(ge=0, le=1e6)]
Instant = Annotated[float, Meta(ge=0, extra={"unit": "s"}, extra_json_schema={"x-unit": "s"})]
Metres3 = Annotated[tuple[float, float, float], Meta(extra={"unit": "m"}, extra_json_schema={"x-unit": "m"})]


class Mapped(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where one thing that the device sees is on the person."""

    bone: str
    """Bone of ours, such as ``right_hand``."""
    at: Metres3 = (0.0, 0.0, 0.0)
    """Place in the bone's frame: forward, up, right in the anatomical position [m]."""
    position: Weight = 1.0
    """Weight of its position; 1 is good to 2 cm."""
    orientation: Weight = 0.0
    """Weight of its orientation; 1 is good to 0.1 rad."""


class Weights(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How much a device counts beside others that see the same person."""

    position: Weight = 1.0
    """Factor on its positions."""
    orientation: Weight = 1.0
    """Factor on its orientations."""
    bones: dict[str, Weight] = {}
    """Further factors by bone; 0 for a bone that it shall not move."""


class Calibration(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Finding out how sensors are mounted, from a time in which the person stands in a known pose."""

    pose: CalibrationPose = CalibrationPose.NONE
    """``npose`` (arms hanging, thumbs forward), ``tpose`` (arms to the sides, palms down) or ``none``."""
    start: Instant = 0.0
    """Begin of that time, from the first frame [s]."""
    duration: Seconds = 1.0
    """Its length [s]."""


Error = Annotated[float, Meta(ge=0, lt=np.pi / 2, extra={"unit": "rad"}, extra_json_schema={"x-unit": "rad"})]

_NINE, _TWELVE, _FIFTEEN = math.radians(9.0), math.radians(12.0), math.radians(15.0)
XSENS = PostureError(
    angles=_NINE,
    joints=dict.fromkeys(("clavicle", "shoulder", "elbow", "forearm", "wrist"), _FIFTEEN),
    source=(
        "Mavor et al. 2020 (Sensors 20, 4280), Xsens against optical markers in walking, running, kneeling: "
        "root mean square below 9° (legs), 15° (arms); of trunk and neck none was found, that of legs holds"
    ),
)
AZURE_KINECT = PostureError(
    angles=_FIFTEEN,
    joints={"knee": _TWELVE},
    source=(
        "Ma et al. 2020 (APSIPA), two Azure Kinects against Vicon in walking: root mean square 11.9° "
        "(knees), 15.1° (hips); of other joints none was found, that of hips is taken"
    ),
)
MEDIAPIPE = PostureError(
    angles=math.radians(20.6),
    source=(
        "Cosoli et al. 2026, MediaPipe against an inertial sensor in squats seen from 45° to 90°: knees "
        "-13.9° ± 15.1°, root mean square below 20.6°; of other joints none was found, that of knees is taken"
    ),
)


def posture_error(given: float | None, known: PostureError | None) -> PostureError | None:
    """What the workstation file gives [rad], else what is known of the device."""
    if given is None:
        return known
    return PostureError(angles=given, given=True, source="workstation file")


def unknown_error(known: PostureError | None, device: str, subject: str) -> tuple[Finding, ...]:
    """What is to be said where nobody knows how far angles may be off."""
    if known is not None:
        return ()
    text = (
        f"how far angles of a posture may be off that {device} captures nobody says: scores are those of the "
        "angles as they are; give its accuracy"
    )
    return (Finding(level="assumed", subject=subject, text=text),)


CutOff = Annotated[
    float, Meta(ge=LOWEST, le=HIGHEST, extra={"unit": "Hz"}, extra_json_schema={"x-unit": "Hz"})
]
"""Cut-off frequency of the low-pass filter through which the twin sees a device [Hz]."""


class Options(Protocol):
    """The options that a source of captured motion has."""

    @property
    def human(self) -> str:
        """Name of the person whom it drives."""

    @property
    def at(self) -> Pose:
        """Where the device's world lies."""

    @property
    def weights(self) -> Weights:
        """How much each bone counts."""

    @property
    def mapping(self) -> Mapping[str, str | Mapped]:
        """Names of the device, and the bones that they mean."""

    @property
    def convention(self) -> str:
        """Whose names they are."""

    @property
    def calibration(self) -> Calibration:
        """How the sensors' mounting is found."""

    @property
    def latency(self) -> float:
        """By how much later than it happened the device says it [s]."""

    @property
    def smoothing(self) -> float | None:
        """Cut-off frequency of the low-pass filter [Hz]; None is none."""


def lateness(options: Options) -> float:
    """By how much later than it happened the twin sees it [s]: the device's delay and the filter's."""
    return options.latency + group_delay(options.smoothing or 0.0)


Conventions = Mapping[str, names.Convention]


def person(target: Target | None, human: str, file: str) -> Description:
    """The person that is driven.

    Raises:
        InputError: There is none of that name.
    """
    if (
        target is None
        or target.description is None
        or BONES[-1] not in (link.name for link in target.description.links)
    ):
        raise InputError.at(file, "human", f"no person {human!r}", "name one of [[humans]]")
    return target.description


def observer(
    options: Options, layout: Layout, description: Description, *, known: Conventions | None = None, file: str
) -> tuple[Observer, tuple[Finding, ...]]:
    """Bind a device's names to the person's bones as the options say.

    Args:
        options: Of the source.
        layout: The device's names.
        description: The person.
        known: Conventions of names; those that ship with seerob when not given.
        file: For messages.

    Raises:
        InputError: Every name of the options that is not there.
    """
    subject = options.human
    try:
        convention, findings = names.choose(layout, subject, convention=options.convention, known=known)
    except UnknownName as error:
        raise InputError.at(file, "convention", str(error)) from error
    given, problems = _given(options.mapping, file)
    for bone in options.weights.bones:
        if bone not in BONES:
            problems.append(Problem(file, f"weights.bones.{bone}", "no such bone", suggestion(bone, BONES)))
    if problems:
        raise InputError(problems)
    try:
        places = names.places(layout, convention, given, file=file)
    except InputError as error:
        if convention is not None or not findings:
            raise
        raise InputError.at(file, "convention", findings[0].text) from error
    bound = bind(
        layout,
        places,
        description,
        convention=convention,
        world_from_capture=placement(options.at),
        position=options.weights.position,
        orientation=options.weights.orientation,
        bones=options.weights.bones,
    )
    return bound, (*findings, *_calibration_findings(layout, bound, subject, options.calibration))


def calibrated(
    options: Options,
    frames: Iterable[CaptureFrame],
    layout: Layout,
    bound: Observer,
    description: Description,
    *,
    pose: CalibrationPose | None = None,
) -> tuple[Observer, Calibrated]:
    """Calibrate an observer: returns it with the mounting that the frames show, and what was found.

    Args:
        options: Of the source.
        frames: Of the window.
        layout: The device's names.
        bound: From `observer`.
        description: The person.
        pose: How the person stood; what the options say when not given.
    """
    pose = pose or options.calibration.pose
    found = calibrate(list(frames), bound, description, pose, seen=layout.seen, subject=options.human)
    placed = with_places(with_mounts(bound, found.mounts), found.places)
    return placed, found


def placed_only(bound: Observer, subject: str, remedy: str) -> tuple[Observer, tuple[Finding, ...]]:
    """Drop positions that devices place as they like and whose place nothing has told.

    Args:
        bound: From `observer` or `calibrated`.
        subject: Whom findings are about.
        remedy: How its place could be found.
    """
    bound, names = without_unplaced(bound)
    if not names:
        return bound, ()
    text = (
        f"positions of {', '.join(names)} are not used: every device places this joint as it likes; {remedy}"
    )
    return bound, (Finding(level="note", subject=subject, text=text),)


def placement(at: Pose) -> Array:
    """Cell from the device's world, shape (4, 4)."""
    if at.wxyz is not None:
        return transform(rotation_from_wxyz(at.wxyz), at.position)
    return transform(rotation_from_rpy(at.rpy or (0.0, 0.0, 0.0)), at.position)


def _given(
    mapping: Mapping[str, str | Mapped], file: str
) -> tuple[dict[str, names.Place | None], list[Problem]]:
    given: dict[str, names.Place | None] = {}
    problems: list[Problem] = []
    for name, value in mapping.items():
        entry = Mapped(bone=value) if isinstance(value, str) else value
        if entry.bone == "":
            given[name] = None
        elif entry.bone not in BONES:
            remedy = f'{suggestion(entry.bone, BONES)}; "" for none'
            problems.append(Problem(file, f"mapping.{name}", f"no bone {entry.bone!r}", remedy))
        elif not np.isfinite(entry.at).all():
            problems.append(Problem(file, f"mapping.{name}.at", f"{entry.at}", "give finite numbers"))
        else:
            at = np.array(entry.at, float)
            given[name] = names.Place(entry.bone, at, entry.position, entry.orientation, metres=True)
    return given, problems


def _bare(bound: Observer, calibration: Calibration) -> frozenset[str]:
    """Bones of which the joint will be seen at most, not where they point."""
    mounted = calibration.pose is not CalibrationPose.NONE
    points = [
        BodyPoint(
            name=row.name,
            bone=row.bone,
            at=(float(row.at[0]), float(row.at[1]), float(row.at[2])),
            position=(0.0, 0.0, 0.0),
            wxyz=(1.0, 0.0, 0.0, 0.0) if mounted or row.segment_from_bone is not None else None,
            position_weight=row.position,
            orientation_weight=row.orientation,
        )
        for row in bound.rows
    ]
    placed = {row.bone for row in bound.rows if row.position > 0}
    return bare({row.bone for row in bound.rows}, placed, turned(points))


def _calibration_findings(
    layout: Layout, bound: Observer, subject: str, calibration: Calibration
) -> Iterable[Finding]:
    """What is used, what is not, and which bones nobody measures."""
    used = {row.name for row in bound.rows}
    text = ", ".join(f"{row.name} → {row.bone}" for row in bound.rows)
    yield Finding(level="note", subject=subject, text=f"names: {text}")
    unused = [name for name in layout.names if name not in used]
    if unused:
        shown = ", ".join(unused[:12]) + (f" and {len(unused) - 12} more" if len(unused) > 12 else "")
        yield Finding(level="note", subject=subject, text=f"not used, no bone is known for it: {shown}")
    estimated = [bone for bone in BONES if bone not in {row.bone for row in bound.rows}]
    if estimated:
        text = f"not measured but estimated from the bones beside them: {', '.join(estimated)}"
        yield Finding(level="assumed", subject=subject, text=text)
    if unseen := without_neighbours({row.bone for row in bound.rows}, _bare(bound, calibration)):
        text = f"no verdict rests on {', '.join(unseen)}: neither measured nor told by the bones beside them"
        yield Finding(level="warning", subject=subject, text=text)
    if calibration.pose is CalibrationPose.NONE:
        blind = [r.name for r in bound.rows if r.orientation > 0 and r.segment_from_bone is None]
        if blind:
            text = (
                f"orientations of {', '.join(blind[:12])} are not used: nobody says how they are mounted; "
                'give a calibration with pose = "npose" or "tpose"'
            )
            yield Finding(level="warning", subject=subject, text=text)
