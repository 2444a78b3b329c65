"""Base of the sources that hear captured motion of a person while it happens."""

from __future__ import annotations

import contextlib
import logging
import math
import time
from collections.abc import AsyncGenerator
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from msgspec import field
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.core.quantities import Pose, Seconds, unit
from seerob.core.samples import BodyPoint, BodySample, Placing, Quality, Sample, SignalSample
from seerob.core.snapshot import Finding
from seerob.description.capture.calibration import Calibrated, CalibrationPose
from seerob.description.capture.captured import CaptureFrame, Layout
from seerob.description.capture.observing import Observer
from seerob.description.description import Description
from seerob.description.humans import manikin
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
from seerob.devices.live.listening import LiveSource, name_of, say_once
from seerob.workstation.source import Opened, PostureError, Target

_log = logging.getLogger(__name__)

MOST_CALIBRATION_FRAMES = 20_000
FEWEST_STANDING = 5
"""Frames of a person who says that they stand in a pose."""
MOST_UNLIKE = 0.03
"""Share of the stature in the workstation file by which a person may be taller or smaller; our choice: shoes,
and how one stands, are as much."""
SAME_PERSON = 0.5
"""A person of another name who appears no farther away [m] from where one was lost is the same one."""


class CaptureStream(LiveSource, frozen=True, kw_only=True):
    """Base of a stream of captured motion: one module, one class, one generator `frames`."""

    shares: ClassVar[bool] = True
    captured: ClassVar[str] = "live"
    known_error: ClassVar[PostureError | None] = None
    """How far angles of a posture may be off, as somebody found."""
    placed: ClassVar[bool] = True
    """Whether its positions say where the person stands, and not only how they lie to each other."""

    human: str
    """The person it drives; several devices may drive the same one."""
    subject: str = ""
    """Which person, as the device calls it; the first that is heard when not given."""
    at: Pose = Pose()
    """Where the device's world lies in the workstation (its origin, its z up)."""
    at_accuracy: Annotated[float, unit("m", gt=0, le=1)] | None = None
    """How well its place is known, standard deviation per axis [m]; exactly when neither this nor
    ``at_accuracy_turn`` is given. 95 % of it are in every distance to the person and in every area."""
    at_accuracy_turn: Annotated[float, unit("rad", gt=0, le=1)] | None = None
    """How well its turn is known, standard deviation about each axis [rad]: what is farther from ``at`` is
    off by more."""
    latency: Instant = 0.0
    """Time from the motion to the arrival of what the device says of it [s]."""
    hold: Seconds = 0.5
    """Age at which a bone that is no longer seen does not count any more [s]."""
    smoothing: CutOff | None = None
    """Cut-off frequency of a low-pass filter against the device's noise [Hz]; no filter when not given."""
    weights: Weights = Weights()
    """How much it counts beside other devices."""
    accuracy: Error | None = None
    """How far each angle of a posture may be off [rad]; what is known of the device when not given."""
    convention: str = ""
    """Whose names they are (``xsens``, ``azure_kinect`` …); what the device says, or found by the names."""
    mapping: dict[str, str | Mapped] = field(default_factory=dict)
    """Device's name → bone of ours, in place of the convention's; ``""`` for what shall not be used."""
    calibration: Calibration = Calibration()
    """How the mounting of the sensors is found; its time begins with the first frame."""

    def target(self) -> str:
        """The person."""
        return self.human

    def stated(self) -> Placing | None:
        """How well the file says that its world is known to lie; None where it says nothing of it."""
        if self.at_accuracy is None and self.at_accuracy_turn is None:
            return None
        covariance = np.diag(np.repeat([self.at_accuracy or 0.0, self.at_accuracy_turn or 0.0], 3) ** 2)
        return Placing(covariance=tuple(covariance.ravel().tolist()), about=self.at.position)

    def posture_error(self) -> PostureError | None:
        """What the file gives, else what is known of the device."""
        return posture_error(self.accuracy, self.known_error)

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Check what can be checked without a connection, and say what nobody knows of the device.

        Raises:
            InputError: An option that does not fit what it drives.
        """
        opened = super().open(folder, target)
        unknown = unknown_error(self.posture_error(), name_of(self), self.human)
        return replace(opened, findings=(*opened.findings, *unknown))

    def behind(self) -> float:
        """Delay behind the world that it needs [s]; latency and filter come on top of the period."""
        return super().behind() + (lateness(self) if self.delay is None else 0.0)

    def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        """Connect, and yield every frame of every person until the connection ends.

        The layout is the same object as long as the names are the same. A frame whose time is not finite
        is taken as of its arrival.

        Raises:
            OSError: There is no connection, or no longer.
            SeerobError: What the other end says cannot be understood.
        """
        raise NotImplementedError

    def fitted(self, said: str, taller: float | None, *, accepted: bool) -> None:
        """Tell what a calibration found that the person asked for.

        Args:
            said: In words, or why it was refused.
            taller: How many times as tall as the person of the file; None where that was not seen.
            accepted: Whether it holds from now on.
        """

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Pulls on the bones of the person, as they arrive."""
        description = _anybody() if target is None else person(target, self.human, self.name)
        hearing = _Hearing(self, description)
        async with contextlib.aclosing(self.frames()) as frames:
            async for layout, frame in frames:
                sample = hearing.take(layout, frame, time.monotonic())
                if sample is not None:
                    yield sample


class _Hearing:
    """One connection: the names that are bound, the person who is followed, the calibration."""

    def __init__(self, source: CaptureStream, description: Description) -> None:
        self._source, self._description = source, description
        self._layout: Layout | None = None
        self._observer: Observer | None = None
        self._subject: str | None = source.subject or None
        self._last_seen = -np.inf
        self._last_frame: CaptureFrame | None = None
        """In which anything of them was seen."""
        self._begun: float | None = None
        self._window: list[CaptureFrame] = []
        self._calibrated = source.calibration.pose is CalibrationPose.NONE
        self._standing: list[CaptureFrame] = []
        """While the person says that they stand in a pose."""
        self._wearer: int | None = None
        self._unlike = ""
        """Why nothing rests on where this person is: they are not as tall as that of the file."""

    def take(self, layout: Layout, frame: CaptureFrame, now: float) -> BodySample | SignalSample | None:
        """The sample of a frame that arrived at ``now`` [s]; None while there is nothing to say."""
        if len(frame.positions) != len(layout.names):
            return None
        followed, changed = self._follows(frame, now)
        if not followed:
            return None
        bound = self._bind(layout)
        if frame.wearer != self._wearer:
            if self._wearer is not None and self._calibrated:
                bound = self._begin(layout)
            self._wearer, self._unlike, self._standing = frame.wearer, "", []
        if frame.pose and len(self._standing) < MOST_CALIBRATION_FRAMES:
            self._standing.append(frame)
        elif self._standing:
            return self._fit(layout, now)
        if not self._calibrated:
            return None if frame.pose else self._calibrate(layout, frame, now)
        points = bound.points(frame)
        late = lateness(self._source)
        return BodySample(
            source=self._source.name,
            target=self._source.human,
            seq=0,
            t=now - late,
            t_device=frame.t if math.isfinite(frame.t) else None,
            points=points,
            subject=frame.subject,
            latency=late,
            hold=self._source.hold,
            smoothing=self._source.smoothing or 0.0,
            placed=self._source.placed,
            quality=_quality(points, changed),
            placing=Placing(reason=self._unlike) if self._unlike else frame.placing or self._source.stated(),
        )

    def _bind(self, layout: Layout) -> Observer:
        if self._observer is None or layout is not self._layout:
            again = self._layout is not None and layout.names == self._layout.names
            self._layout = layout
            if self._observer is None or not again:
                self._begin(layout)
        assert self._observer is not None  # begun before
        return self._observer

    def _begin(self, layout: Layout) -> Observer:
        """Bind the names as nobody has calibrated them yet."""
        source = self._source
        self._observer, findings = observer(source, layout, self._description, file=source.name or "stream")
        _say(findings)
        if self._calibrated:
            self._drop_unplaced()
        return self._observer

    def _fit(self, layout: Layout, now: float) -> SignalSample | None:
        """What a calibration found that the person asked for; None where it is refused."""
        frames, self._standing, source = self._standing, [], self._source
        try:
            if len(frames) < FEWEST_STANDING:
                raise InputError.at(source.human, "calibration", "too short", "stand still a little longer")
            bound, _ = observer(source, layout, self._description, file=source.name or "stream")
            pose = CalibrationPose(frames[0].pose)
            bound, found = calibrated(source, frames, layout, bound, self._description, pose=pose)
        except InputError as error:
            source.fitted(str(error), None, accepted=False)
            return None
        _say(found.findings)
        if wrong := [finding.text for finding in found.findings if finding.level == "warning"]:
            source.fitted(wrong[0], found.taller, accepted=False)
            return None
        self._observer, self._calibrated = bound, True
        self._drop_unplaced()
        self._unlike = unlike(found.taller)
        source.fitted(self._unlike or found.findings[0].text, found.taller, accepted=True)
        return SignalSample(source=source.name, seq=0, t=now, values=_residuals(found))

    def _drop_unplaced(self) -> None:
        assert self._observer is not None  # bound before
        remedy = 'a calibration with pose = "npose" finds out where'
        self._observer, findings = placed_only(self._observer, self._source.human, remedy)
        _say(findings)

    def _follows(self, frame: CaptureFrame, now: float) -> tuple[bool, bool]:
        """Whether the frame is of the person who is followed, and whether that has another name now."""
        if self._subject is None or frame.subject == self._subject:
            self._subject = frame.subject
            self._note(frame, now)
            return True, False
        if self._source.subject or now - self._last_seen < self._source.timeout or not self._is_there(frame):
            return False, False
        _log.warning(
            "%s: %r is taken for %r, who was lost there", self._source.name, frame.subject, self._subject
        )
        self._subject = frame.subject
        self._note(frame, now)
        return True, True

    def _is_there(self, frame: CaptureFrame) -> bool:
        """Whether somebody is where the person was seen last."""
        place, last = _middle(frame), None if self._last_frame is None else _middle(self._last_frame)
        near = place is not None and last is not None and np.linalg.norm(place - last) <= SAME_PERSON
        return bool(near)

    def _note(self, frame: CaptureFrame, now: float) -> None:
        # Most frames have all of a person.
        if math.isfinite(np.add.reduce(frame.positions, axis=None)) or _middle(frame) is not None:
            self._last_frame, self._last_seen = frame, now

    def _calibrate(self, layout: Layout, frame: CaptureFrame, now: float) -> SignalSample | None:
        """What a calibration found, when it has ended."""
        wanted = self._source.calibration
        self._begun = now if self._begun is None else self._begun
        since = now - self._begun - wanted.start
        if since < 0:
            return None
        if since <= wanted.duration and len(self._window) < MOST_CALIBRATION_FRAMES:
            self._window.append(frame)
            return None
        assert self._observer is not None  # bound before
        self._observer, found = calibrated(
            self._source, self._window, layout, self._observer, self._description
        )
        _say(found.findings)
        self._drop_unplaced()
        self._window, self._calibrated = [], True
        return SignalSample(source=self._source.name, seq=0, t=now, values=_residuals(found))


def unlike(taller: float | None) -> str:
    """Why a person is not that of the file, who is so many times as tall; empty when they may be."""
    if taller is None or abs(taller - 1) <= MOST_UNLIKE:
        return ""
    way = f"{100 * abs(taller - 1):.0f} % {'taller' if taller > 1 else 'smaller'}"
    return f"this person is {way} than that of the workstation file: give their stature"


def _residuals(found: Calibrated) -> dict[str, float | bool | str]:
    """Per sensor how far it was from where it is expected [m] and how it is turned [rad], where known."""
    values: dict[str, float | bool | str] = {"calibration heading [rad]": found.heading}
    for r in found.residuals:
        for what, value in (("off [m]", r.off), ("moved [m]", r.moved), ("turned [rad]", r.turn)):
            if np.isfinite(value):
                values[f"calibration {r.name} {what}"] = value
    return values


def _say(findings: tuple[Finding, ...]) -> None:
    for finding in findings:
        level = logging.WARNING if finding.level == "warning" else logging.INFO
        say_once(_log, level, f"{finding.subject}: {finding.text}")


def _quality(points: tuple[BodyPoint, ...], changed: bool) -> Quality:
    if not any(point.position is not None or point.wxyz is not None for point in points):
        return Quality.INVALID
    return Quality.DEGRADED if changed else Quality.GOOD


def _middle(frame: CaptureFrame) -> np.ndarray | None:
    positions = np.asarray(frame.positions, float)
    seen = positions[np.isfinite(positions).all(axis=1)]
    return np.asarray(seen.mean(axis=0)) if len(seen) else None


def _anybody() -> Description:
    """Somebody of medium size, for looking at a stream that drives nobody."""
    return manikin.build(name="anybody", stature=1.75, mass=75.0, sex="male")
