"""Joint angles of a person from a file: OpenSim's .mot and .sto, or a table with units in the headers."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.samples import LARGEST_SPEED, JointSample, Quality
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.description import Description
from seerob.description.humans.posture import on_floor
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses, without_side
from seerob.devices.capture.options import Error, posture_error, unknown_error
from seerob.files.motion_capture import joint_angles
from seerob.files.motion_capture.frame_arrays import LATEST, SHORTEST, about
from seerob.files.motion_capture.joint_angles import LENGTHS, JointAngles
from seerob.files.trajectories.trajectory import derive_velocities
from seerob.workstation.source import Opened, PostureError, Source, Target

STORAGES = (".mot", ".sto")
PLACE = [JOINTS.index(name) for name in ("pelvis_x", "pelvis_y", "pelvis_z")]
FAR = 100.0
"""Nobody walks further from where the file begins [m]."""
ROUNDING = np.radians(0.5)
"""A value this far beyond a limit is put to it without a word [rad]."""
DOUBTFUL = np.radians(10.0)
"""Beyond a limit by more, a posture is shown and not judged [rad]."""


@dataclass(frozen=True, eq=False)
class _Samples:
    """Can be iterated again and again."""

    t: Array
    q: Array
    qd: Array
    degraded: NDArray[np.bool_]
    source: str
    target: str
    placed: bool
    unmeasured: tuple[str, ...]

    def __iter__(self) -> Iterator[JointSample]:
        rows = zip(self.t.tolist(), self.q.tolist(), self.qd.tolist(), self.degraded.tolist(), strict=True)
        for seq, (t, q, qd, degraded) in enumerate(rows):
            yield JointSample(
                source=self.source,
                target=self.target,
                seq=seq,
                t=t,
                q=tuple(q),
                qd=tuple(qd),
                quality=Quality.DEGRADED if degraded else Quality.GOOD,
                placed=self.placed,
                unmeasured=self.unmeasured,
            )


class JointAngleFile(Source, frozen=True, kw_only=True):
    """Joint angles of a person from OpenSim (.mot, .sto) or from a table (.csv, .txt)."""

    captured: ClassVar[str] = "file"

    human: str
    """The person it drives."""
    file: str
    """Path, from the folder of the workstation file."""
    floor: bool = True
    """Keep the lowest sole on the floor; else the pelvis is as high as the file says."""
    stays: bool = False
    """The person stays at its place ``at``; without it distances are undecided where it says no place."""
    rest_at_zero: bool = False
    """Bones of which the file has no joint are at 0; without it what asks for them is undecided."""
    accuracy: Error | None = None
    """How far each angle of a posture may be off [rad]."""

    def target(self) -> str:
        """The person."""
        return self.human

    def posture_error(self) -> PostureError | None:
        """What the workstation file gives: of no such file it is known."""
        return posture_error(self.accuracy, None)

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the file and put what is beyond a limit of the person to it.

        Raises:
            InputError: The file is missing or wrong, or what it drives is no person.
        """
        if target is None or target.description is None or len(target.joints) != len(JOINTS):
            raise InputError.at(self.file, "human", f"no person {self.human!r}", "name one of [[humans]]")
        path = folder / self.file
        read = joint_angles.from_storage if path.suffix.lower() in STORAGES else joint_angles.from_table
        found = read(path, file=self.file)
        found, left_out = _usable(found, self.file)
        q, degraded, limits = _within(found.q, target, self.file)
        q = self._placed(q, found, target.description)
        largest = np.array([LARGEST_SPEED[unit] for unit in target.units])
        placed = found.placed or self.stays
        if not placed:
            text = (
                f"{self.file}: it does not say where the person stands (pelvis_x, pelvis_y; pelvis_tx … in "
                "OpenSim): no distance is decided; write stays = true if the person stays at its at"
            )
            left_out = (*left_out, Finding(level="warning", subject="", text=text))
        unmeasured = () if self.rest_at_zero else _unmeasured(found.given, target.description)
        if unmeasured:
            text = (
                f"{self.file}: it has no joint of {', '.join(unmeasured)}: what asks for them is undecided; "
                "write rest_at_zero = true if they are at 0"
            )
            left_out = (*left_out, Finding(level="warning", subject="", text=text))
        left_out = (*left_out, *unknown_error(self.posture_error(), self.file, target.name))
        qd = derive_velocities(found.t, q, largest=largest).qd
        t = found.t - found.t[0]
        return Opened(
            samples=_Samples(
                t,
                q,
                qd,
                degraded,
                self.name or f"joint_angles {self.human}",
                target.name,
                placed,
                unmeasured,
            ),
            duration=float(t[-1]),
            began=float(found.t[0]),
            findings=about((*found.findings, *left_out, *limits), target.name),
        )

    def _placed(self, q: Array, found: JointAngles, description: Description) -> Array:
        """Joint values with the pelvis where the file says, from where it begins, and on the floor."""
        pelvis = found.pelvis
        known = np.isfinite(pelvis).all()
        if known:
            _, positions = bone_poses(description, q)
            q[:, PLACE] += pelvis - positions[:, 0]
            # The laboratory's origin means nothing in the workstation: begin where the person stands.
            q[:, PLACE[:2]] -= q[0, PLACE[:2]]
        return on_floor(description, q) if self.floor or not (known or found.high) else q


def _unmeasured(given: Collection[str], description: Description) -> tuple[str, ...]:
    """Bones that have joints, of which none is given; toes follow their foot."""
    return tuple(
        link.name
        for link in description.links
        if link.name in BONES
        and without_side(link.name) != "toes"
        and link.joints
        and not any(joint.name in given and joint.name not in LENGTHS for joint in link.joints)
    )


def _usable(found: JointAngles, file: str) -> tuple[JointAngles, tuple[Finding, ...]]:
    """Rows whose time advances and whose values are finite."""
    fine = np.isfinite(found.q).all(axis=1) & (np.abs(np.nan_to_num(found.t, nan=np.inf)) < LATEST)
    t = np.where(fine, found.t, -np.inf)
    latest = np.maximum.accumulate(np.concatenate([[-np.inf], t[:-1]])) if len(t) else t
    keep = fine & (t > latest + SHORTEST)
    if int(keep.sum()) < 2:
        raise InputError.at(file, "", f"{int(keep.sum())} rows with finite values and a time of their own")
    said = []
    if not keep.all():
        text = f"{file}: {int((~keep).sum())} rows left out: not finite, or their time does not advance"
        said.append(Finding(level="warning", subject="", text=text))
    pelvis = found.pelvis[keep]
    if np.isfinite(pelvis).all() and np.abs(pelvis - pelvis[0]).max() > FAR:
        what = f"the pelvis moves {np.abs(pelvis - pelvis[0]).max():.4g} m"
        raise InputError.at(file, "pelvis_tx", what, "lengths are in m in this format")
    return replace(found, t=found.t[keep], q=found.q[keep], pelvis=pelvis), tuple(said)


def _within(q: Array, target: Target, file: str) -> tuple[Array, NDArray[np.bool_], tuple[Finding, ...]]:
    """Values put to the limits; which postures are no longer what the file says; what was done."""
    lower, upper = np.array(target.lower), np.array(target.upper)
    clipped = np.clip(q, lower, upper)
    beyond = np.abs(q - clipped)
    said = []
    for place in np.flatnonzero(beyond.max(axis=0) > ROUNDING).tolist():
        rows = int((beyond[:, place] > ROUNDING).sum())
        text = (
            f"{file}: {target.joints[place]} goes up to {np.degrees(beyond[:, place].max()):.1f}° beyond "
            f"the limit of this person in {rows} of {len(q)} rows: put to the limit"
        )
        said.append(Finding(level="warning", subject="", text=text))
    return clipped, (beyond > DOUBTFUL).any(axis=1), tuple(said)
