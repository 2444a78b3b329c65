"""What of a recorded motion can be implausible: its units, its speeds, and what of them is noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from seerob.core.errors import SeerobError
from seerob.core.snapshot import Finding
from seerob.description.description import Description
from seerob.files.trajectories.checks import RESTS
from seerob.files.trajectories.trajectory import Trajectory, derived_noise
from seerob.files.waypoints.arm import Arm
from seerob.workstation.plausibility.ranges import Quantity

TELLING = 0.005
"""Noise of the flange's speed that is told [m/s]: a fiftieth of the 250 mm/s of a reduced speed."""
POSTURES = 50
"""In which the levers are looked at, evenly."""


def noise_of_speeds(motion: Trajectory, description: Description, name: str) -> Finding | None:
    """How fast a robot seems to move that stands, when its speeds are derived from its positions."""
    valid = np.ones(len(motion.t), bool) if motion.invalid is None else ~motion.invalid
    q, error = motion.q[valid], derived_noise(motion.t[valid], motion.q[valid])
    if error is None:
        return None
    try:
        arm = Arm(description)
    except SeerobError:
        return None
    if arm.n != q.shape[1]:
        return None
    levers = np.linalg.norm(arm.posture(q[:: max(1, len(q) // POSTURES)]).jacobian()[:, :3, :], axis=1)
    speed = float(np.sqrt(((levers * error) ** 2).sum(axis=1)).max())
    if speed < TELLING:
        return None
    text = (
        f"{motion.file}: speeds are derived from noisy positions: standing, its flange "
        f"seems to move at up to {1e3 * speed:.0f} mm/s, and figures of speed are uncertain by so much "
        "(what rests on them is not within where that could exceed a limit)"
    )
    return Finding(level="assumed", subject=name, text=text)


def quantities(
    motion: Trajectory, limits: Sequence[float | None], *, key: str, about: str, of: str
) -> Iterator[Quantity]:
    """What is looked at of a motion.

    Args:
        motion: As it was read, in SI.
        limits: Largest speed of each joint [rad/s or m/s]; None where nobody stated one.
        key: Of its source in the file.
        about: Whom it drives.
        of: Name of its source.
    """
    valid = np.ones(len(motion.t), bool) if motion.invalid is None else ~motion.invalid
    if valid.sum() < 2:
        return
    t, q = motion.t[valid], motion.q[valid]
    step = np.diff(t)
    said = f"median of {motion.file}"
    yield Quantity(f"{key}.step", "sources.step", "s", (float(np.median(step)),), (about,), said, of)
    if motion.degrees:
        largest = float(np.degrees(np.abs(q).max()))
        if largest > RESTS:
            said = f"the largest angle of {motion.file}"
            yield Quantity(f"{key}.degrees", "sources.degrees", "°", (largest,), (about,), said, of)
    known = [j for j, limit in enumerate(limits) if limit is not None and j < q.shape[1]]
    if not known:
        return
    bounds = np.array([limits[j] for j in known], float)
    speeds = np.abs(np.diff(q[:, known], axis=0) / step[:, None]).max(axis=0) / bounds
    if motion.qd is not None:
        speeds = np.maximum(speeds, (np.abs(motion.qd[valid][:, known]) / bounds).max(axis=0))
    said = f"fastest joint of {motion.file}, share of its limit"
    yield Quantity(f"{key}.speed", "sources.speed", "", (float(speeds.max()),), (about,), said, of)
