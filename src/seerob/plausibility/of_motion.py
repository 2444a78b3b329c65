"""What of a recorded motion can be implausible: its unit of time, its unit of angles, its speeds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from seerob.plausibility.ranges import Quantity
from seerob.trajectories.checks import RESTS
from seerob.trajectories.trajectory import Trajectory


def quantities(
    motion: Trajectory, limits: Sequence[float | None], *, key: str, about: str
) -> Iterator[Quantity]:
    """What is looked at of a motion.

    Args:
        motion: As it was read, in SI.
        limits: Largest speed of each joint [rad/s or m/s]; None where nobody stated one.
        key: Of its source in the file.
        about: Whom it drives.
    """
    valid = np.ones(len(motion.t), bool) if motion.invalid is None else ~motion.invalid
    if valid.sum() < 2:
        return
    t, q = motion.t[valid], motion.q[valid]
    step = np.diff(t)
    said = f"median of {motion.file}"
    yield Quantity(f"{key}.step", "sources.step", "s", (float(np.median(step)),), (about,), said)
    if motion.degrees:
        largest = float(np.degrees(np.abs(q).max()))
        if largest > RESTS:
            said = f"the largest angle of {motion.file}"
            yield Quantity(f"{key}.degrees", "sources.degrees", "°", (largest,), (about,), said)
    known = [j for j, limit in enumerate(limits) if limit is not None and j < q.shape[1]]
    if not known:
        return
    bounds = np.array([limits[j] for j in known], float)
    speeds = np.abs(np.diff(q[:, known], axis=0) / step[:, None]).max(axis=0) / bounds
    if motion.qd is not None:
        speeds = np.maximum(speeds, (np.abs(motion.qd[valid][:, known]) / bounds).max(axis=0))
    said = f"fastest joint of {motion.file}, share of its limit"
    yield Quantity(f"{key}.speed", "sources.speed", "", (float(speeds.max()),), (about,), said)
