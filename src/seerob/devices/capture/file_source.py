"""Base of the sources that read captured motion of a person from a file.

What files of markers are told alike: unit and vertical, where the file does not say them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import ClassVar

import numpy as np
from msgspec import field

from seerob.core.errors import InputError
from seerob.core.quantities import Pose, Seconds
from seerob.core.samples import BodySample, Quality
from seerob.core.snapshot import Finding
from seerob.description.capture.calibration import CalibrationPose
from seerob.description.capture.captured import Captured, CaptureFrame, Exchanges
from seerob.description.capture.mapping import read_conventions
from seerob.description.capture.observing import Observer
from seerob.description.capture.rest_pose import by_rest_pose
from seerob.devices.capture.options import (
    Calibration,
    CutOff,
    Error,
    Instant,
    Mapped,
    Weights,
    calibrated,
    lateness,
    observer,
    person,
    placed_only,
    posture_error,
    unknown_error,
)
from seerob.files.motion_capture.markers import MarkerReading
from seerob.files.motion_capture.upright import Up
from seerob.workstation.source import Opened, PostureError, Source, Target


class Length(StrEnum):
    """Unit of coordinates."""

    M = "m"
    CM = "cm"
    MM = "mm"
    INCH = "inch"


MOST_FRAMES = 5_000_000
"""Of one recording: over five hours at 240 frames per second."""


class CaptureFile(Source, frozen=True, kw_only=True):
    """Base of a file of captured motion: one module, one class, one function `read`."""

    shares: ClassVar[bool] = True
    captured: ClassVar[str] = "file"
    known_error: ClassVar[PostureError | None] = None
    """How far angles of a posture may be off, as somebody found."""

    human: str
    """The person it drives; several devices may drive the same one."""
    file: str
    """Path, from the folder of the workstation file."""
    subject: str = ""
    """Which person of the file, as the device calls it; the only one, or the first, when not given."""
    at: Pose = Pose()
    """Where the device's world lies in the workstation (its origin, its z up)."""
    latency: Instant = 0.0
    """How much later than the motion its time stamps are, against other devices [s]."""
    hold: Seconds = 0.5
    """Age at which a bone that is no longer seen does not count any more [s]."""
    smoothing: CutOff | None = None
    """Cut-off frequency of a low-pass filter against the device's noise [Hz]; no filter when not given."""
    weights: Weights = Weights()
    """How much it counts beside other devices."""
    accuracy: Error | None = None
    """How far each angle of a posture may be off [rad]; what is known of the device when not given."""
    convention: str = ""
    """Whose names they are (``xsens``, ``azure_kinect`` …); what the file says, or found by the names."""
    mapping: dict[str, str | Mapped] = field(default_factory=dict)
    """Device's name → bone of ours, in place of the convention's; ``""`` for what shall not be used."""
    mapping_file: str = ""
    """TOML file of further names, from the folder of the workstation file."""
    calibration: Calibration = Calibration()
    """How the mounting of the sensors is found."""

    def target(self) -> str:
        """The person."""
        return self.human

    def posture_error(self) -> PostureError | None:
        """What the file gives, else what is known of the device."""
        return posture_error(self.accuracy, self.known_error)

    def read(self, path: Path) -> Captured:
        """What the file holds of the person `subject`.

        Args:
            path: The file; it may not be there.

        Raises:
            InputError: The file is missing or wrong, or has no such person; with `file` as its name.
        """
        raise NotImplementedError

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the file, calibrate, and check every frame.

        Raises:
            InputError: The file is missing or wrong, a name is not there, or what it drives is no person.
        """
        from seerob.description.capture.fit_check import registered

        description = person(target, self.human, self.file)
        captured = self.read(folder / self.file)
        subject = self.human
        known = None
        if self.mapping_file:
            known = read_conventions(folder / self.mapping_file, self.mapping_file)
        bound, findings = observer(self, captured.layout, description, known=known, file=self.file)
        # First of all: what is wrong with a frame must be said before anything is made of frames.
        duration, checked = _check(
            BodySamples(self, captured, bound), len(captured.layout.names), subject, self.file
        )
        stands = captured.joints_known
        rest = captured.rest
        if self.calibration.pose is not CalibrationPose.NONE:
            window = list(self._window(captured))
            bound, calibration = calibrated(self, window, captured.layout, bound, description)
            findings = (*findings, *calibration.findings)
            rest = window[len(window) // 2]
        if not stands and rest is not None:
            bound, found, stands = by_rest_pose(
                rest,
                captured.layout,
                bound,
                description,
                subject=subject,
                orientation=self.weights.orientation,
                bones=self.weights.bones,
                mapped=self.mapping,
            )
            findings = (*findings, *found)
        world_from_root = np.eye(4) if target is None else np.array(target.world_from_base or np.eye(4))
        bound, fit = registered(captured, bound, description, world_from_root, subject)
        bound, left_out = placed_only(bound, subject, "no frame shows where")
        unknown = unknown_error(self.posture_error(), self.file, subject)
        findings = (*findings, *fit, *left_out, *unknown)
        upright = stands or self.accuracy is not None
        if not upright:
            text = (
                "flexion of trunk, neck and upper arms is not assessed: programs have joints of a trunk in "
                "different places, and who stands upright may lean by 20°; give a calibration, or accuracy"
            )
            findings = (*findings, Finding(level="warning", subject=subject, text=text))
        samples = BodySamples(self, captured, bound, upright=upright)
        return Opened(
            samples=samples,
            duration=duration,
            began=next(iter(captured.frames)).t,
            findings=(*captured.findings, *findings, *checked),
        )

    def _window(self, captured: Captured) -> Iterator[CaptureFrame]:
        """Calibration frames: those of the file that are in the pose, else those of the time given."""
        pose = self.calibration.pose
        stated = [frame for frame in captured.calibration if frame.pose == pose]
        if stated:
            yield from stated
            return
        first: float | None = None
        for frame in captured.frames:
            first = frame.t if first is None else first
            since = frame.t - first - self.calibration.start
            if since > self.calibration.duration:
                return
            if since >= 0:
                yield frame


class MarkerFile(CaptureFile, frozen=True, kw_only=True):
    """Base of the files of points whose unit or vertical may be open."""

    up: Up | None = None
    """Axis of the file that points up; what the file says, or told by heads being above feet."""
    unit: Length | None = None
    """Unit of the coordinates; what the file says when not given."""

    def reading(self) -> MarkerReading:
        """How the file is to be read."""
        return MarkerReading(
            file=self.file,
            subject=self.subject,
            up=self.up,
            unit=self.unit or "",
            convention=self.convention,
            unused=frozenset(name for name, bone in self.mapping.items() if bone == ""),
        )


@dataclass(frozen=True, eq=False)
class BodySamples:
    """Samples of a recording; can be iterated again and again."""

    source: CaptureFile
    captured: Captured
    observer: Observer
    upright: bool = True

    def __iter__(self) -> Iterator[BodySample]:
        source = self.source
        first: float | None = None
        last, seq = -1e-9, 0
        late = lateness(source)
        for frame in self.captured.frames:
            first = frame.t if first is None else first
            t = frame.t - first - late
            if not t > last:  # also what is not a number
                continue
            points = self.observer.points(frame)
            if not any(point.position or point.wxyz for point in points):
                continue  # nothing was seen: the silence shows by itself
            last = t
            yield BodySample(
                source=source.name or f"{type(source).__module__.rpartition('.')[2]} {source.human}",
                target=source.human,
                seq=seq,
                t=max(t, 0.0),
                t_device=frame.t,
                points=points,
                subject=frame.subject,
                latency=late,
                hold=source.hold,
                smoothing=source.smoothing or 0.0,
                placed=self.captured.placed,
                upright=self.upright,
                quality=Quality.GOOD,
                placing=frame.placing,
            )
            seq += 1


def _check(samples: BodySamples, rows: int, subject: str, file: str) -> tuple[float, tuple[Finding, ...]]:
    """Go through all frames once: the duration [s], and what is missing or out of order."""
    count, late, gap, gap_at, last = 0, 0, 0.0, 0.0, -1.0
    first: float | None = None
    people: Counter[str] = Counter()
    unseen: Counter[str] = Counter()
    exchanges = Exchanges()
    for frame in samples.captured.frames:
        if len(frame.positions) != rows:
            what = f"frame {count} has {len(frame.positions)} rows, the layout has {rows}"
            raise InputError.at(file, "", what)
        first = frame.t if first is None else first
        t = frame.t - first
        count += 1
        if count > MOST_FRAMES:
            raise InputError.at(file, "", f"more than {MOST_FRAMES} frames", "cut the recording")
        if not t > last:
            late += 1
            continue
        if count > 1 and t - last > gap:
            gap, gap_at = t - last, last
        last = t
        people[frame.subject] += 1
        exchanges.add(t, np.asarray(frame.positions, float))
        for point in samples.observer.points(frame):
            if point.position is None and point.wxyz is None:
                unseen[point.name] += 1
    if not count:
        raise InputError.at(file, "", "no frame of this person in it", "give another subject or recording")
    notes = [("note", f"{count} frames in {last:.2f} s, {samples.captured.rate:g} per second")]
    if late:
        notes.append(("warning", f"{late} frames whose time does not advance were left out"))
    period = 1.0 / samples.captured.rate if samples.captured.rate > 0 else 0.0
    if gap > max(1.5 * period, samples.source.timeout):
        text = f"nothing was seen for up to {gap:.2f} s (at {gap_at:.2f} s): UNDECIDED there"
        notes.append(("warning", text))
    if unseen:
        worst = ", ".join(f"{name} ({100 * n / count:.0f} %)" for name, n in unseen.most_common(6))
        notes.append(("warning", f"not seen in a share of the frames: {worst}"))
    if text := exchanges.text(samples.captured.layout.names):
        notes.append(("warning", text))
    if len(people) > 1:
        shown = ", ".join(f"{name or 'nameless'} ({n})" for name, n in people.most_common(4))
        notes.append(("warning", f"the device changed its name of the person: {shown}"))
    found = (Finding(level=level, subject=subject, text=f"{file}: {text}") for level, text in notes)
    return max(last - lateness(samples.source), 0.0), tuple(found)
