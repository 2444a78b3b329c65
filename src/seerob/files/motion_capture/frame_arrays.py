"""The frames of one person as arrays, and what every reader checks of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, turned
from seerob.description.capture.captured import CaptureFrame

MAX_VALUES = 1 << 26
"""Numbers that one recording may hold: half a GiB, some two hours of a depth camera."""
FAR = 100.0
"""No point of a person is further from the origin of a capture [m]."""
VAST = 1e100
"""Counts as infinitely far, and is still a number [m]."""
LATEST = 1e12
"""No time stamp is as late [s]."""
SHORTEST = 1e-5
"""Frames that are no further apart are the same one [s]."""


@dataclass(frozen=True, eq=False)
class FrameArrays:
    """Iterating gives a `CaptureFrame` per instant, again and again."""

    t: Array
    """On the device's clock [s], shape (n,), strictly increasing."""
    positions: Array
    """World, z up [m], shape (n, k, 3); NaN where not seen."""
    orientations: Array | None = None
    """World from segment, w first, shape (n, k, 4)."""
    confidence: Array | None = None
    """From 0 to 1, shape (n, k)."""
    subjects: Sequence[str] | str = ""
    """The person, once or per frame, as the device names it."""

    def __len__(self) -> int:
        return len(self.t)

    def __iter__(self) -> Iterator[CaptureFrame]:
        subjects = self.subjects
        for k, t in enumerate(self.t.tolist()):
            yield CaptureFrame(
                t=t,
                positions=self.positions[k],
                orientations=None if self.orientations is None else self.orientations[k],
                confidence=None if self.confidence is None else self.confidence[k],
                subject=subjects if isinstance(subjects, str) else subjects[k],
            )

    def only(self, keep: NDArray[np.bool_]) -> FrameArrays:
        """The frames that are marked, shape (n,)."""
        chosen = np.flatnonzero(keep)
        return replace(
            self,
            t=self.t[chosen],
            positions=self.positions[chosen],
            orientations=None if self.orientations is None else self.orientations[chosen],
            confidence=None if self.confidence is None else self.confidence[chosen],
            subjects=self.subjects
            if isinstance(self.subjects, str)
            else [self.subjects[k] for k in chosen.tolist()],
        )

    def turned(self, world_from_capture: Array) -> FrameArrays:
        """Express positions and orientations in the world of the workstation.

        Args:
            world_from_capture: Rigid transform, shape (4, 4).
        """
        rotation = world_from_capture[:3, :3]
        # What is infinite would turn into what is not seen, and nobody would hear of it.
        near = np.clip(self.positions, -VAST, VAST)
        positions = near @ rotation.T + world_from_capture[:3, 3]
        orientations = self.orientations
        if orientations is not None:
            orientations = turned(rotation, orientations)
        return replace(self, positions=positions, orientations=orientations)


def check_size(file: str, frames: int, values: int) -> None:
    """Refuse what does not fit.

    Args:
        file: As messages name it.
        frames: Number of frames.
        values: Numbers per frame.

    Raises:
        InputError: More than `MAX_VALUES` in all.
    """
    if frames * max(values, 1) > MAX_VALUES:
        what = f"{frames} frames of {values} numbers, more than {MAX_VALUES} numbers"
        raise InputError.at(file, "", what, "split the recording")


def checked(
    frames: FrameArrays, *, file: str, subject: str
) -> tuple[FrameArrays, float, tuple[Finding, ...]]:
    """What holds for the frames of every format: time advances, nothing is infinitely far, quaternions turn.

    Args:
        frames: As they were read; ``t`` may repeat or go back, values may be anything.
        file: As messages name it.
        subject: Whom findings are about.

    Returns:
        The frames that can be used, with NaN where a value cannot; frames per second; what was left out.

    Raises:
        InputError: Fewer than two frames are left, or no value in any of them.
    """
    findings: list[Finding] = []

    def tell(text: str) -> None:
        findings.append(Finding(level="warning", subject=subject, text=f"{file}: {text}"))

    with np.errstate(invalid="ignore"):
        t = np.where(np.abs(frames.t) < LATEST, frames.t, np.nan)
        latest = np.fmax.accumulate(np.concatenate([[-np.inf], t[:-1]]))
        keep = t - latest > SHORTEST
    if not keep.all():
        tell(f"{int((~keep).sum())} of {len(t)} frames were left out: their time does not advance")
        frames = frames.only(keep)
    if len(frames) < 2:
        raise InputError.at(file, "", f"{len(frames)} frames with a time of their own", "two are needed")
    positions, far = without_far(frames.positions)
    if far:
        tell(f"{far} points further than {FAR:g} m from the origin, or not finite, count as not seen")
    if not np.isfinite(positions).any():
        remedy = "is the unit right, is it the right person?"
        raise InputError.at(file, "", "nobody is seen in any frame", remedy)
    orientations = None
    if frames.orientations is not None:
        orientations, bad = without_bad_turns(frames.orientations)
        if bad:
            tell(f"{bad} orientations are no unit quaternions and count as not known")
    rate = 1 / float(np.median(np.diff(frames.t)))
    findings += gaps(frames.t, positions, file=file, subject=subject)
    return replace(frames, positions=positions, orientations=orientations), rate, tuple(findings)


def without_far(positions: Array) -> tuple[Array, int]:
    """Positions with NaN for what is infinite or beyond `FAR`, and how many points that were."""
    with np.errstate(invalid="ignore"):
        bad = (~(np.abs(positions) <= FAR)).any(axis=-1)
    unseen = np.isnan(positions).any(axis=-1)
    clean = positions.copy()
    clean[bad] = np.nan
    return clean, int((bad & ~unseen).sum())


def without_bad_turns(wxyz: Array) -> tuple[Array, int]:
    """Unit quaternions, NaN for those that are off by more than a tenth, and how many these were."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        norm = np.linalg.norm(wxyz, axis=-1, keepdims=True)
        fine = np.abs(norm - 1) < 0.1
        # All zeros is how several devices say that they do not know.
        bad = ~fine & ~np.isnan(norm) & (norm > 0)
        return np.where(fine, wxyz / norm, np.nan), int(bad.sum())


def gaps(t: Array, positions: Array, *, file: str, subject: str) -> list[Finding]:
    """When nobody is seen, and when the file has no frame: each as one finding with instants."""
    findings = []
    lost = np.isnan(positions).all(axis=(1, 2))
    if lost.any():
        edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(int)))
        spans = [(float(t[a]), float(t[b - 1])) for a, b in edges.reshape(-1, 2).tolist()]
        longest = max(spans, key=lambda span: span[1] - span[0])
        text = (
            f"{file}: the person is not seen in {int(lost.sum())} of {len(t)} frames, {len(spans)} times; "
            f"the longest is {longest[0] - float(t[0]):.2f}…{longest[1] - float(t[0]):.2f} s"
        )
        findings.append(Finding(level="warning", subject=subject, text=text))
    steps = np.diff(t)
    median = float(np.median(steps))
    missing = steps > 1.5 * median
    if missing.any():
        count = int(np.round(steps[missing] / median - 1).sum())
        text = f"{file}: about {count} frames are missing, in {int(missing.sum())} places"
        findings.append(Finding(level="warning", subject=subject, text=text))
    return findings


def about(findings: tuple[Finding, ...], subject: str) -> tuple[Finding, ...]:
    """The findings of a file with the name of the person whom it drives."""
    return tuple(structs.replace(f, subject=f.subject or subject) for f in findings)
