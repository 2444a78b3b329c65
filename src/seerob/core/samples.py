"""What came in: one `Sample` is one thing heard from one source at one instant.

Samples know no physics. The latest wins: nothing queues, age is data.
"""

from __future__ import annotations

from enum import StrEnum
from threading import Lock

from msgspec import Struct, field

from seerob.core.printable import printable_record

Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]

LARGEST = 1e6
"""A value beyond it is no motion of a robot [rad, m, and per second; N·m or N]."""
LARGEST_SPEED = {"rad": 30.0, "m": 10.0}
"""Above it two samples are a jump [rad/s or m/s]: no arm and no person at work moves like that."""
REPEATED = 2e-6
"""What is said again with a doubt follows by less [s] (`device_clock.AFTER`): it is of the same
instant, also where that lies ahead."""


class Quality(StrEnum):
    """How good a sample is, as its source says, or as this machine heard it."""

    GOOD = "good"
    DEGRADED = "degraded"
    """Usable for the picture, not for a verdict (a guessed joint, a low confidence)."""
    INVALID = "invalid"
    """The source itself says that this is not the truth (robot off, tracking lost)."""
    LATE = "late"
    """Heard while this machine fell behind: run time stood still, and speeds across the gap are false."""

    def invalid_reason(self, who: str) -> str:
        """Why what somebody said may not be relied on; empty when it may."""
        if self is Quality.GOOD:
            return ""
        if self is Quality.LATE:
            return "this machine is too slow: run time fell behind"
        return f"{who} says {self.value}"


class SampleBase(Struct, frozen=True, kw_only=True, tag=True):
    """What every sample carries."""

    source: str
    """Name of the source."""
    seq: int
    """Counts up by one per sample of this source about the same; a gap is a loss."""
    t: float
    """Instant the sample speaks of [s], on the run's clock."""
    t_device: float | None = None
    """Instant the sample speaks of [s], on the device's own clock; None when it has none."""
    quality: Quality = Quality.GOOD
    reason: str = ""
    """Why it may not be relied on, as whoever heard it found; empty when nobody found anything."""
    late: float = 0.0
    """How much later it arrived than what came fastest from that device [s]; where that sends no time, how
    much older than ``t`` it may be, as the file says."""

    def invalid_reason(self, who: str) -> str:
        """Why it may not be relied on; empty when it may.

        Args:
            who: Whoever says so, for the words.
        """
        return self.reason or self.quality.invalid_reason(who)


class JointSample(SampleBase, frozen=True, kw_only=True, tag="joint"):
    """Joint values of a robot or of a person."""

    target: str
    """Robot or human it drives."""
    q: tuple[float, ...]
    """Joint positions in the target's joint order [rad or m]."""
    qd: tuple[float, ...] | None = None
    """Joint velocities [rad/s or m/s]."""
    qd_error: tuple[float, ...] | None = None
    """How far ``qd`` may be off where it was derived from noisy positions: three standard deviations
    [rad/s or m/s]; None where it was measured, or where nobody knows."""
    tau: tuple[float, ...] | None = None
    """Measured joint torques [N·m or N]."""
    tcp: Vec3 | None = None
    """Where the source itself has the tool's working point, in the base frame of its controller [m]."""
    tcp_speed: float | None = None
    """How fast the source itself has that point [m/s]."""
    payload: float | None = None
    """What the source itself has at the robot's flange [kg]."""
    placed: bool = True
    """Whether it says where a person stands; if not, it is of the posture alone."""
    unmeasured: tuple[str, ...] = ()
    """Bones of a person of which it says nothing, and that are in ``q`` all the same."""


class PoseSample(SampleBase, frozen=True, kw_only=True, tag="pose"):
    """Pose of one named thing: a tool, a part, a headset, a tracker."""

    target: str
    """Full name of the frame it drives, such as ``ur10/tool0`` or ``cart``."""
    position: Vec3
    """In the world [m]."""
    wxyz: Vec4
    """Orientation in the world, unit quaternion."""


class BodyPoint(Struct, frozen=True, kw_only=True):
    """One thing that a device sees on a person, as a pull on one bone."""

    name: str
    """What the device calls it."""
    bone: str
    """Bone of the person, such as ``right_hand``."""
    at: Vec3 = (0.0, 0.0, 0.0)
    """Where it is fixed, in the bone's frame [m]; the bone's proximal joint when not given."""
    position: Vec3 | None = None
    """Position of that point in the world [m]; None when it is not known."""
    wxyz: Vec4 | None = None
    """World from bone, unit quaternion; None when it is not known."""
    position_weight: float = 1.0
    """How much its position counts: 1 for one that is good to `POSITION_SCALE`."""
    orientation_weight: float = 1.0
    """How much its orientation counts: 1 for one that is good to `ORIENTATION_SCALE`."""
    confidence: float | None = None
    """From 0 (guessed) to 1 (seen), as the device says; None when it does not."""
    rolled: bool = True
    """Whether its orientation tells how the bone is turned about its long axis."""


POSITION_SCALE = 0.02
"""Error of a position of weight 1 [m]; twice as good weighs 4."""
ORIENTATION_SCALE = 0.1
"""Error of an orientation of weight 1 [rad]."""


class Placing(Struct, frozen=True, kw_only=True):
    """How well it is known where the world of a device lies in the cell."""

    covariance: tuple[float, ...] = ()
    """Of the error of that place, translation [m] before rotation [rad], in the cell's axes about ``about``:
    36 numbers row by row; none where it is exact by definition, or not known."""
    about: Vec3 = (0.0, 0.0, 0.0)
    """[m]"""
    reason: str = ""
    """Why nobody knows where it lies, or not well enough; empty when it is known."""


class BodySample(SampleBase, frozen=True, kw_only=True, tag="body"):
    """What one device sees of one person; several devices may speak of the same one."""

    target: str
    """Human it drives."""
    points: tuple[BodyPoint, ...]
    """What was seen. What the device has but did not see this time has neither position nor orientation."""
    subject: str = ""
    """The person, as the device calls it."""
    placed: bool = True
    """Whether positions say where the person stands; if not, they are of the posture alone."""
    upright: bool = True
    """Whether somebody who stands upright is upright by it; not where nobody knows where joints of the trunk
    are in a body."""
    latency: float = 0.0
    """By how much ``t`` was put earlier than the device's time of arrival or stamp [s]."""
    hold: float = 0.5
    """Age at which a bone that this device no longer sees does not count any more [s]."""
    smoothing: float = 0.0
    """Cut-off frequency of the low-pass filter through which the twin sees it [Hz]; 0 for none. The points
    here are raw, and ``latency`` holds the filter's delay, too."""
    placing: Placing | None = None
    """How well it is known where the device's world lies in the cell; None where the file says where, and
    that is taken as exact."""


class SignalSample(SampleBase, frozen=True, kw_only=True, tag="signal"):
    """Named values of a machine: a lamp, a light curtain, a conveyor's speed."""

    values: dict[str, float | bool | str]
    doubts: dict[str, str] = field(default_factory=dict)
    """Why what is known of a name may not be relied on: too old, called bad by its source, out of range."""
    ages: dict[str, float] = field(default_factory=dict)
    """How much older than ``t`` what is known of a name may be [s]: since it was asked for, was last known to
    stand, or the delay that the file allows; no older where nothing is said."""


class GrabSample(SampleBase, frozen=True, kw_only=True, tag="grab"):
    """What a hand holds from now on."""

    target: str
    """Full name of the hand: ``operator/right_hand``."""
    piece: str = ""
    """Loose workpiece that it takes; empty when it lets go."""


Sample = JointSample | PoseSample | BodySample | SignalSample | GrabSample
NO_PLACE = (SignalSample, GrabSample)
"""What says of nothing where it is."""


def printable_sample(sample: Sample) -> Sample:
    """A sample whose texts neither a terminal nor a page obeys: devices name people, points and values."""
    texts = [sample.source, sample.reason]
    if isinstance(sample, SignalSample):
        texts += [*sample.values, *sample.doubts.values()]
        texts += [value for value in sample.values.values() if isinstance(value, str)]
    else:
        texts.append(sample.target)
    if isinstance(sample, GrabSample):
        texts.append(sample.piece)
    if isinstance(sample, BodySample):
        texts.append(sample.subject)
        texts += [point.name for point in sample.points]
    return sample if "".join(texts).isprintable() else printable_record(sample)


def key(sample: Sample) -> tuple[str, ...]:
    """What a newer sample replaces: the same kind of thing about the same target.

    Of a person's body each source has its own: devices complement one another.
    """
    if isinstance(sample, SignalSample):
        return "signal", sample.source
    if isinstance(sample, BodySample):
        return "body", sample.target, sample.source
    return type(sample).__name__, sample.target


class Mailbox:
    """Where sources write and the engine reads: per target only the newest sample is kept, of grabs each.

    Safe to post from any thread; `take` empties it.
    """

    def __init__(self) -> None:
        self._latest: dict[tuple[str, ...], Sample] = {}
        self._lock = Lock()

    def post(self, sample: Sample) -> None:
        """Put a sample; it replaces an earlier one about the same target that nobody took.

        What a hand took and let go again happened, however late the run is.
        """
        each = (str(sample.seq),) if isinstance(sample, GrabSample) else ()
        with self._lock:
            self._latest[key(sample) + each] = sample

    def waits(self, what: tuple[str, ...]) -> bool:
        """Whether there is a sample of a kind (`key`) that nobody took."""
        return what in self._latest

    def take(self) -> tuple[Sample, ...]:
        """The samples posted since the last call, in order of first posting; empties the box."""
        with self._lock:
            taken = tuple(self._latest.values())
            self._latest.clear()
        return taken
