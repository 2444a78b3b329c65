"""Replay of one robot or person out of a recording of ours, beside other sources.

`seerob replay` repeats a whole run; this source takes one target's samples out of one, to judge the same
motion in another workstation, with another tool, or next to a live source. Run times stay those of the
recording, so that several targets taken from one recording stay in step.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from seerob.core.errors import InputError, suggestion
from seerob.core.motion_origin import MotionOrigin, origin_finding
from seerob.core.samples import JointSample, Sample
from seerob.core.snapshot import Finding
from seerob.files.trajectories.checks import Beyond, joint_count_check, limit_check, sampling_findings
from seerob.files.trajectories.trajectory import MAX_SAMPLES, Trajectory
from seerob.workstation.source import Opened, Source, Target

if TYPE_CHECKING:
    from seerob.recording.recording import Recording


class RecordedMotion(Source, frozen=True, kw_only=True):
    """The samples of one robot or human from a recording."""

    drives: str
    """Robot or human of this workstation."""
    file: str
    """The recording (.mcap), from the folder of the workstation file."""
    recorded: str | None = None
    """Its name in the recording, when that is another."""
    origin: MotionOrigin = MotionOrigin.RECORDING
    """What the recorded motion was a motion of, when that is known."""
    beyond_limits: Beyond = Beyond.REFUSE
    """``report`` goes on with positions beyond a limit, with a warning."""

    def target(self) -> str:
        """The robot or human."""
        return self.drives

    def coarse(self, folder: Path) -> str:
        """What was too coarse when it was recorded is so now."""
        from seerob.recording.recording import Recording

        path, recorded = folder / self.file, self.recorded or self.drives
        if not path.is_file():
            return ""  # `open` says so
        mechanisms = Recording.open(path).scene.mechanisms
        return next((m.coarse for m in mechanisms if m.name == recorded), "")

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the recording once, check its motion, and hand out its samples.

        Raises:
            InputError: No recording of ours, nobody of that name in it, or a motion that does not fit.
        """
        from seerob.recording.recording import Recording

        if target is None:
            raise InputError.at(
                self.file, "drives", f"nobody called {self.drives!r}", "name a robot or human"
            )
        path, recorded = folder / self.file, self.recorded or self.drives
        if not path.is_file():
            raise InputError.at(self.file, "", "no such file", "give a recording (.mcap) made by seerob")
        recording = Recording.open(path)
        name = self.name or f"recording {target.name}"
        samples = RecordedSamples(recording, recorded, target.name, name)
        trajectory, late = self._check(samples, target)
        findings = [
            origin_finding(self.origin, target.name, self.file),
            *(replace(f, holds=(target.name,)) if f.holds else f for f in recording.check()),
            *(
                replace(f, text=f"as it was recorded: {f.text}", subject=target.name, holds=(target.name,))
                for f in recording.scene.findings
                if {recorded, "*"} & {*f.holds}
            ),
        ]
        if late:
            text = f"{self.file}: {late} samples whose time did not advance were left out"
            findings.append(Finding(level="warning", subject=target.name, text=text))
        return Opened(
            samples=samples,
            duration=float(trajectory.t[-1]),
            findings=(
                *findings,
                *limit_check(trajectory, target, beyond=self.beyond_limits),
                *sampling_findings(trajectory, target.name, self.timeout),
            ),
        )

    def _check(self, samples: RecordedSamples, target: Target) -> tuple[Trajectory, int]:
        """The motion as arrays, and the number of samples that were left out."""
        t, q = array("d"), array("d")
        heard: dict[str, None] = {}
        late, dof = 0, None
        last = -np.inf
        for sample in samples.all(heard):
            if sample.t <= last:
                late += 1
                continue
            last = sample.t
            if dof is not None and len(sample.q) != dof:
                what = f"{len(sample.q)} joints at {sample.t:.3f} s, {dof} before"
                raise InputError.at(self.file, samples.recorded, what)
            dof = len(sample.q)
            t.append(sample.t)
            q.extend(sample.q)
            if len(t) > MAX_SAMPLES:
                raise InputError.at(self.file, "", f"more than {MAX_SAMPLES} samples of {samples.recorded!r}")
        if dof is None:
            what = f"no joints of {samples.recorded!r}"
            raise InputError.at(self.file, "recorded", what, suggestion(samples.recorded, heard))
        trajectory = Trajectory(file=self.file, t=np.array(t), q=np.array(q).reshape(-1, dof))
        joint_count_check(trajectory, target)
        return trajectory, late


@dataclass(frozen=True, eq=False)
class RecordedSamples:
    """Joint samples of one target, read from the recording each time they are iterated."""

    recording: Recording
    recorded: str
    """Name in the recording."""
    target: str
    """Name in this workstation."""
    source: str

    def all(self, heard: dict[str, None] | None = None) -> Iterator[JointSample]:
        """Every joint sample of the target; ``heard`` collects the names of all targets."""
        for tick in self.recording.ticks():
            for sample in tick.samples:
                if not isinstance(sample, JointSample):
                    continue
                if heard is not None:
                    heard[sample.target] = None
                if sample.target == self.recorded:
                    yield sample

    def __iter__(self) -> Iterator[Sample]:
        last = -np.inf
        for sample in self.all():
            if sample.t > last:
                last = sample.t
                yield replace(sample, source=self.source, target=self.target)
