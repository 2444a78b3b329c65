"""What came in: one `Sample` is one thing heard from one source at one instant.

Samples know no physics. The latest wins: nothing queues, age is data.
"""

from __future__ import annotations

from enum import StrEnum
from threading import Lock

from msgspec import Struct

Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]


class Quality(StrEnum):
    """How good a sample is, as its source says."""

    GOOD = "good"
    DEGRADED = "degraded"
    """Usable for the picture, not for a verdict (a guessed joint, a low confidence)."""
    INVALID = "invalid"
    """The source itself says that this is not the truth (robot off, tracking lost)."""


class SampleBase(Struct, frozen=True, kw_only=True, tag=True):
    """What every sample carries."""

    source: str
    """Name of the source."""
    seq: int
    """Counts up by one per sample of this source; a gap is a loss."""
    t: float
    """Instant the sample speaks of [s], on the run's clock."""
    t_device: float | None = None
    """The same instant on the device's own clock [s], if it has one."""
    quality: Quality = Quality.GOOD


class JointSample(SampleBase, frozen=True, kw_only=True, tag="joint"):
    """Joint values of a robot or of a person."""

    target: str
    """Robot or human it drives."""
    q: tuple[float, ...]
    """Joint positions in the target's joint order [rad or m]."""
    qd: tuple[float, ...] | None = None
    """Joint velocities [rad/s or m/s]."""
    tau: tuple[float, ...] | None = None
    """Measured joint torques [N·m or N]."""


class PoseSample(SampleBase, frozen=True, kw_only=True, tag="pose"):
    """Pose of one named thing: a tool, a part, a headset, a tracker."""

    target: str
    """Full name of the frame it drives, such as ``ur10/tool0`` or ``cart``."""
    position: Vec3
    """In the world [m]."""
    wxyz: Vec4
    """Orientation in the world, unit quaternion."""


class SignalSample(SampleBase, frozen=True, kw_only=True, tag="signal"):
    """Named values of a machine: a lamp, a light curtain, a conveyor's speed."""

    values: dict[str, float | bool | str]


Sample = JointSample | PoseSample | SignalSample


def key(sample: Sample) -> tuple[str, str]:
    """What a newer sample replaces: the same kind of thing about the same target."""
    if isinstance(sample, SignalSample):
        return "signal", sample.source
    return type(sample).__name__, sample.target


class Mailbox:
    """Where sources write and the engine reads: per target only the newest sample is kept.

    Safe to post from any thread; `take` empties it.
    """

    def __init__(self) -> None:
        self._latest: dict[tuple[str, str], Sample] = {}
        self._lock = Lock()

    def post(self, sample: Sample) -> None:
        """Put a sample; it replaces an earlier one about the same target that nobody took."""
        with self._lock:
            self._latest[key(sample)] = sample

    def take(self) -> tuple[Sample, ...]:
        """The samples posted since the last call, in order of first posting; empties the box."""
        with self._lock:
            taken = tuple(self._latest.values())
            self._latest.clear()
        return taken
