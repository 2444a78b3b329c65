"""What of a recorded motion can be implausible: its units, its speeds, and what of them is noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from seerob.errors import SeerobError
from seerob.model_io.description import Description
from seerob.plausibility.ranges import Quantity
from seerob.snapshot import Finding
from seerob.trajectories.checks import RESTS
from seerob.trajectories.trajectory import Trajectory
from seerob.transforms import Array
from seerob.waypoints.arm import Arm

TELLING = 0.005
"""Noise of the flange's speed that is told [m/s]: a fiftieth of the 250 mm/s of a reduced speed."""
THREE = 3.0
"""Standard deviations that are told: 99.7 % lie within."""
UNEVEN = 0.05
"""Share of the step that steps may differ by: what is sampled unevenly looks noisy where it is not."""
POSTURES = 50
"""In which the levers are looked at, evenly."""


def position_noise(q: Array) -> Array:
    r"""Standard deviation of the noise of evenly sampled positions [rad or m], shape (n,).

    Third differences :math:`q_{k+2} - 3 q_{k+1} + 3 q_k - q_{k-1}` of a smooth motion are nearly nothing, of
    noise they are √20 σ; the median of their size is that of whatever the motion does most of the time.

    Args:
        q: [rad or m], shape (N, n), N >= 4.
    """
    return np.asarray(np.median(np.abs(np.diff(q, n=3, axis=0)), axis=0) * 1.4826 / np.sqrt(20))


def noise_of_speeds(motion: Trajectory, description: Description, name: str) -> Finding | None:
    """How fast a robot seems to move that stands, when its speeds are derived from its positions."""
    valid = np.ones(len(motion.t), bool) if motion.invalid is None else ~motion.invalid
    t, q = motion.t[valid], motion.q[valid]
    step = np.diff(t)
    if len(t) < POSTURES or np.ptp(step) > UNEVEN * float(np.median(step)):
        return None
    try:
        arm = Arm(description)
    except SeerobError:
        return None
    if arm.n != q.shape[1]:
        return None
    sigma = position_noise(q) / (np.sqrt(2) * float(np.median(step)))
    levers = np.linalg.norm(arm.posture(q[:: max(1, len(q) // POSTURES)]).jacobian()[:, :3, :], axis=1)
    speed = THREE * float(np.sqrt(((levers * sigma) ** 2).sum(axis=1)).max())
    if speed < TELLING:
        return None
    text = (
        f"{motion.file}: speeds are derived from noisy positions: standing, its flange "
        f"seems to move at up to {1e3 * speed:.0f} mm/s, and figures of speed are uncertain by so much"
    )
    return Finding(level="assumed", subject=name, text=text)


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
