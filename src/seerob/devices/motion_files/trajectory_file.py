"""What every trajectory file has in common: options, checks, and the way from arrays to samples."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError
from seerob.core.samples import LARGEST_SPEED
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.files.trajectories.checks import (
    Beyond,
    joint_count_check,
    larger_velocities,
    limit_check,
    sampling_findings,
)
from seerob.files.trajectories.trajectory import (
    QUIET,
    MotionOrigin,
    Trajectory,
    TrajectorySamples,
    derive_velocities,
    derived_noise,
    origin_finding,
)
from seerob.workstation.source import Opened, Source, Target


class Velocities(StrEnum):
    """Which velocities a motion has."""

    GIVEN = "given"
    """The file's own where it has them, after a check against the positions; else derived."""
    DERIVE = "derive"
    """From the positions, whatever the file says."""


class TrajectoryFile(Source, frozen=True, kw_only=True):
    """Base of the sources that read one robot's motion from one file."""

    robot: str
    """The robot it drives; any with as many joints as the file has."""
    file: str
    """Path, from the folder of the workstation file."""
    origin: MotionOrigin = MotionOrigin.SIMULATOR
    """What the motion is a motion of; all but ``controller`` is preliminary."""
    beyond_limits: Beyond = Beyond.REFUSE
    """``report`` goes on with positions beyond a limit of the robot, with a warning."""
    velocities: Velocities = Velocities.GIVEN

    def target(self) -> str:
        """The robot."""
        return self.robot

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """The motion in SI units and what is to be said of how it was read.

        Args:
            path: The file.
            target: The robot it is to drive.

        Raises:
            InputError: The file is wrong, or something in it must be confirmed.
        """
        raise NotImplementedError

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the file and check the motion against the robot.

        Raises:
            InputError: The file is missing, wrong, ambiguous, or of another robot than this could be.
        """
        if target is None:
            raise InputError.at(
                self.file, "robot", f"no robot {self.robot!r}", "name a robot of the workstation"
            )
        trajectory, findings = self.read(folder / self.file, target)
        joint_count_check(trajectory, target)
        origin = origin_finding(self.origin, target.name, self.file)
        limits = limit_check(trajectory, target, beyond=self.beyond_limits)
        qd, about_velocities = self._velocities(trajectory, target)
        error = None
        if trajectory.qd is None or self.velocities is not Velocities.GIVEN:
            valid = slice(None) if trajectory.invalid is None else ~trajectory.invalid
            error = derived_noise(trajectory.t[valid], trajectory.q[valid])
        if error is not None and not (error > QUIET).any():
            error = None
        sampling = sampling_findings(trajectory, target.name, self.timeout)
        name = self.name or f"{type(self).__module__.rpartition('.')[2]} {target.name}"
        return Opened(
            samples=TrajectorySamples(trajectory, name, target.name, qd, error),
            duration=trajectory.duration,
            began=float(trajectory.t[0]),
            findings=(origin, *findings, *limits, *about_velocities, *sampling),
        )

    def _velocities(self, trajectory: Trajectory, target: Target) -> tuple[Array, tuple[Finding, ...]]:
        derived = derive_velocities(
            trajectory.t,
            trajectory.q,
            largest=np.array([LARGEST_SPEED[unit] for unit in target.units]),
            known=None if trajectory.invalid is None else ~trajectory.invalid,
        )
        if trajectory.qd is not None and self.velocities is Velocities.GIVEN:
            return larger_velocities(trajectory, target, derived.qd)
        why = "on request" if trajectory.qd is not None else "the file gives none"
        size = "too few samples to estimate their error"
        if derived.error is not None:
            size = f"largest estimated error {derived.error:.2g} rad/s or m/s"
        text = f"velocities derived by central differences of the positions ({why}); {size}"
        return derived.qd, (Finding(level="assumed", subject=target.name, text=text),)


def notes(texts: tuple[str, ...], subject: str, *, level: str = "note") -> tuple[Finding, ...]:
    """Findings of one level."""
    return tuple(Finding(level=level, subject=subject, text=text) for text in texts)
