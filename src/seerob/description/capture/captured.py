"""What a motion capture device or file said of one person, before anything is made of it.

Every format is read into these types and nothing else: positions in metres in a right-handed world with
z up, rotations as unit quaternions with w first, what was not seen as NaN. Which of the device's names
belongs to which bone, and how a device's segment is turned against ours, is for whoever follows it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import StrEnum

from seerob.core.snapshot import Finding
from seerob.core.transforms import Array


class Seen(StrEnum):
    """What the rows of a frame are."""

    SEGMENTS = "segments"
    """Bones: the position of the segment's origin, and how it is turned."""
    JOINTS = "joints"
    """Joint centres; an orientation, if any, is that of the bone that begins there."""
    MARKERS = "markers"
    """Points on the skin; no orientations."""
    TRACKERS = "trackers"
    """Rigid devices worn on the body: position and orientation of the device."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Names of what a device sees, in the order of every frame's rows."""

    seen: Seen
    names: tuple[str, ...]
    """In the device's own spelling."""
    convention: str = ""
    """Whose skeleton it is: ``xsens``, ``azure_kinect``, ``cmu`` …; empty when it is the file's own."""
    parents: tuple[int, ...] = ()
    """Index of the parent of each row, -1 for a root; empty when there is no tree."""


@dataclass(frozen=True, eq=False)
class CaptureFrame:
    """One person at one instant."""

    t: float
    """On the device's clock [s]."""
    positions: Array
    """World, z up [m], shape (n, 3); NaN where it was not seen or is not known."""
    orientations: Array | None = None
    """World from segment, w first, shape (n, 4), NaN where unknown; None when the device has none."""
    confidence: Array | None = None
    """From 0 (guessed) to 1 (seen), shape (n,); None when the device does not say."""
    subject: str = ""
    """The person, as the device names it: an id that may change when it loses somebody."""
    pose: str = ""
    """``tpose`` or ``npose`` when this is no motion but a calibration pose that the file contains."""


@dataclass(frozen=True, eq=False)
class Captured:
    """A whole recording of one person."""

    layout: Layout
    frames: Iterable[CaptureFrame]
    """In time order, first at its own t; iterating again starts again."""
    rate: float
    """Frames per second."""
    count: int
    """Number of frames in ``frames``."""
    calibration: tuple[CaptureFrame, ...] = ()
    """Calibration poses that the file contains."""
    placed: bool = True
    """Whether its positions say where the person stands, and not only how its points lie to each other."""
    lengths: dict[str, float] = field(default_factory=dict)
    """Bone lengths that the file states [m], in the device's names."""
    findings: tuple[Finding, ...] = ()
    """Units that were assumed, losses, repairs."""
