"""What a motion capture device or file said of one person, before anything is made of it.

Every format is read into these types and nothing else: positions in metres in a right-handed world with
z up, rotations as unit quaternions with w first, what was not seen as NaN. Which of the device's names
belongs to which bone, and how a device's segment is turned against ours, is for whoever follows it.

Points of a recording that exchange their places from one frame to the next: labels that were swapped.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import combinations

import numpy as np

from seerob.core.samples import Placing
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array

FAR = 0.05
"""Points that are nearer to each other [m] may as well have moved there."""
NEAR = 0.02
"""How far each may be from where the other was [m]; a choice, half a frame of a quick hand."""
LATE = 0.2
"""After a longer gap [s] nothing is said: both may have moved."""
MOST = 40
"""Points that move so far in one frame beyond which a device lost them altogether."""


class Exchanges:
    """Watches a recording frame by frame."""

    def __init__(self) -> None:
        self._t = -np.inf
        self._before: Array | None = None
        self.found: dict[tuple[int, int], list[float]] = {}
        """Two rows → when they exchanged their places [s]."""

    def add(self, t: float, positions: Array) -> None:
        """A frame at an instant [s] after the one before; positions of shape (n, 3), NaN where not seen."""
        before, since = self._before, t - self._t
        self._t, self._before = t, positions
        if before is None or len(before) != len(positions) or since > LATE:
            return
        with np.errstate(invalid="ignore", over="ignore"):
            moved = np.flatnonzero(np.linalg.norm(positions - before, axis=1) > FAR)
        if not 2 <= len(moved) <= MOST:
            return
        for i, j in combinations(moved.tolist(), 2):
            if (
                np.linalg.norm(positions[i] - before[j]) < NEAR
                and np.linalg.norm(positions[j] - before[i]) < NEAR
            ):
                self.found.setdefault((i, j), []).append(t)

    def text(self, names: Sequence[str]) -> str:
        """What is to be said; empty when nothing was exchanged.

        Args:
            names: Of the rows.
        """
        if not self.found:
            return ""
        shown = [
            f"{names[i]} and {names[j]} "
            + (f"({len(times)} times, first at " if len(times) > 1 else "(at ")
            + f"{times[0]:.2f} s)"
            for (i, j), times in sorted(self.found.items(), key=lambda item: -len(item[1]))
        ]
        more = f" and {len(shown) - 6} more" if len(shown) > 6 else ""
        return (
            f"exchange their places from one frame to the next: {', '.join(shown[:6])}{more}; labels swapped?"
        )


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
    scaled: bool = False
    """Whether its metres are a guess: only directions count then, with the lengths of the person."""


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
    """``tpose`` or ``npose`` when this is a calibration pose: of a file it is no motion, live the person says
    so."""
    placing: Placing | None = None
    """How well it is known where the device's world lies in the cell; None where the file says where."""
    wearer: int = 0
    """Another number for whoever else wears the device: what a calibration found of the one before holds no
    more."""


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
    joints_known: bool = True
    """Whether its convention says where its joints are in a body; else only its pose of rest, or a
    calibration, tells how somebody leans."""
    rest: CaptureFrame | None = None
    """A skeleton's pose when nothing is turned, in any axes; None where turns do not tell how it moves."""
    placed: bool = True
    """Whether its positions say where the person stands, and not only how its points lie to each other."""
    lengths: dict[str, float] = field(default_factory=dict)
    """Bone lengths that the file states [m], in the device's names."""
    findings: tuple[Finding, ...] = ()
    """Units that were assumed, losses, repairs."""
