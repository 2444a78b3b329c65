"""What a source is: options in, samples out. Sources know no physics.

A *recorded* source (a trajectory file, a recording) knows its future; the run loop pumps it in
run time, live and as fast as possible alike. The pump stays one sample ahead, so that references
are interpolated between two samples and nothing lags.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Protocol, runtime_checkable

from msgspec import Struct
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.core.quantities import NotBefore, Seconds
from seerob.core.samples import JointSample, PoseSample, Quality, Sample
from seerob.core.snapshot import Finding
from seerob.workstation.tables.controls import Control
from seerob.workstation.variables import Variable

if TYPE_CHECKING:  # numpy is not loaded where one source listens in a process of its own
    from seerob.core.transforms import Array
    from seerob.description.description import Description

Row4 = tuple[float, float, float, float]
Matrix4 = tuple[Row4, Row4, Row4, Row4]
"""Homogeneous matrix, row by row."""


class Target(Struct, frozen=True, kw_only=True):
    """What a source needs to know of the robot or human it drives."""

    name: str = ""
    """Empty for a source of variables, which drives nothing."""
    model: str = ""
    """Of a robot as the file names it: ``library:ur5e``."""
    joints: tuple[str, ...] = ()
    """Joint names in order."""
    units: tuple[str, ...] = ()
    """``rad`` or ``m`` per joint."""
    lower: tuple[float, ...] = ()
    """Position limits [rad or m]; -inf where there is none."""
    upper: tuple[float, ...] = ()
    velocity: tuple[float | None, ...] = ()
    """Speed limits [rad/s or m/s]; None where nobody stated one."""
    acceleration: tuple[float, ...] = ()
    """Acceleration limits [rad/s² or m/s²], one for each joint or for all; empty where nobody stated any."""
    jerk: tuple[float, ...] = ()
    """Jerk limits [rad/s³ or m/s³], likewise."""
    description: Description | None = None
    """Its links and joints, for sources that need lengths (where a person's feet are)."""
    world_from_base: Matrix4 | None = None
    """Where its root link stands."""
    frames: tuple[str, ...] = ()
    """Full names of what its joints move and a `PoseSample` may drive; empty when nobody says."""
    variables: tuple[Variable, ...] = ()
    """Variables of the workstation's dictionary that this source reads."""
    controls: tuple[Control, ...] = ()
    """Of a source of kind ``room``: what people pull."""
    folder: str = ""
    """Folder of the workstation file, where relative paths start."""


class PostureError(Struct, frozen=True, kw_only=True):
    """How far angles of a posture may be off that a device captured."""

    angles: float
    """[rad]"""
    joints: dict[str, float] = {}
    """Joint, by the names of `seerob.criteria.scoring.measured.ANGLES_OF` → of its angles [rad], where that
    differs."""
    given: bool = False
    """Whether the workstation file says so."""
    source: str
    """Who found it, and how."""


class Opened(Struct, frozen=True, kw_only=True):
    """A source that has read what it can read without a connection."""

    samples: Iterable[Sample]
    """In time order, ``t`` from 0; iterating again starts again."""
    duration: float
    """From run time 0 to the last sample [s]."""
    began: float | None = None
    """Instant of its first sample on the clock of its file [s]; None where it has none."""
    findings: tuple[Finding, ...] = ()
    """The mapping that was used, limits that were passed, losses in the file."""
    reach: Callable[[], tuple[Finding, ...]] | None = None
    """Connects, for what a live source says of itself; only a run and `seerob probe` call it. None where
    there is nothing to ask, or it was asked."""
    poses_of: str | None = None
    """Of a live source, full name of the link or tool whose poses it says; None where it says none. What a
    recorded one says is looked at."""

    def __repr__(self) -> str:
        return f"<Opened: {self.duration:g} s, {len(self.findings)} findings>"


class Source(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every source: one file, one class, one ``kind``. The fields are its table in the file."""

    name: str = ""
    """Made from the kind and the target when not given."""
    shares: ClassVar[bool] = False
    """Whether several sources of its sort may drive the same target."""
    captured: ClassVar[str] = ""
    """How it captured a person's motion, ``live`` from a device or from a ``file``; empty when it did not."""
    live: ClassVar[bool] = False
    """Whether nobody knows its future: a controller, a machine, a tracker."""
    pulled: ClassVar[bool] = False
    """Whether its variables are set by ``[[controls]]`` that people pull."""
    reads_variables: ClassVar[bool] = False
    """Whether it reads variables of the workstation's dictionary."""

    timeout: Seconds = 0.2
    """Age at which what it said no longer counts [s]: dependent verdicts turn UNDECIDED."""
    loop: bool = False
    """Start again at the end. Where the ends are the same place, it stands still for ``loop_pause``;
    where they differ, the way back takes as long and is UNDECIDED: nobody drove it."""
    loop_pause: Seconds = 1.0
    """[s]"""
    begins: NotBefore | None = None
    """Run time of its first sample [s], of a recorded source. Files that begin at different instants of their
    clocks need it, unless it is 0: the difference where they keep one clock, 0 where each has its own."""

    def target(self) -> str:
        """Name of the robot or human it drives; empty for signals."""
        return ""

    def posture_error(self) -> PostureError | None:
        """How far angles of a posture may be off that it captured; None when nobody knows."""
        return None

    @classmethod
    def undefined(cls) -> str:
        """What a class leaves out for which no default may stand, and what to define; empty when nothing."""
        if cls.target is Source.target and not cls.reads_variables:
            return (
                "drives nobody: define target, which returns the name of its robot or human, or "
                "reads_variables = True where it says values of machines"
            )
        return ""

    def coarse(self, folder: Path) -> str:
        """Why what it says is too coarse for energies and forces; empty when it is not.

        Args:
            folder: Folder of the workstation file; relative paths start there.
        """
        return ""

    @abstractmethod
    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read, and check against the target's limits; connects to nothing.

        Args:
            folder: Folder of the workstation file; relative paths start there.
            target: What it drives; None when `target` is empty.

        Raises:
            InputError: The file is missing or wrong; names file, place, value and remedy.
        """
        raise NotImplementedError


def driven_robot(
    target: Target | None,
    robot: str,
    where: str,
    *,
    joints: int,
    whose: str,
    give: str = "name another robot",
) -> Target:
    """The robot that a source drives, whose joints are as many as it says.

    Args:
        target: As the source was given it.
        robot: Name in the source's table.
        where: Kind and address of the source, for messages.
        joints: That it says.
        whose: Who says so many, with the verb: ``an LBR has``.
        give: What would be right.

    Raises:
        InputError: There is no such robot, or it has another number of joints.
    """
    if target is None:
        raise InputError.at("sources", "robot", f"no robot {robot!r}", "name a robot")
    if len(target.joints) != joints:
        what = f"{target.name} has {len(target.joints)} joints, {whose} {joints}"
        raise InputError.at(where, "robot", what, give)
    return target


@dataclass(frozen=True, eq=False)
class _Later:
    """Samples that come later than a source says."""

    samples: Iterable[Sample]
    by: float

    def __iter__(self) -> Iterator[Sample]:
        return (replace(sample, t=sample.t + self.by) for sample in self.samples)


def delayed(opened: Opened, by: float) -> Opened:
    """A recorded source that begins at another run time than 0 [s]."""
    if by == 0:
        return opened
    return replace(opened, samples=_Later(opened.samples, by), duration=opened.duration + by)


SAME_PLACE = 1e-3
"""A loop whose ends differ by no more than this [rad or m] is closed."""


HOLD = 0.05
"""Period at which a loop that is closed says, during its pause, that it stands still [s]."""


class Pump:
    """Feeds the samples of one recorded source to the loop as run time passes."""

    def __init__(self, opened: Opened, *, loop: bool = False, pause: float = 1.0) -> None:
        self._iterator = _rounds(opened, pause) if loop and opened.duration > 0 else iter(opened.samples)
        self._reached = -math.inf
        self._next = next(self._iterator, None)

    @property
    def finished(self) -> bool:
        """Whether there is nothing left to come."""
        return self._next is None

    def until(self, t: float) -> Iterator[Sample]:
        """Samples up to ``t`` [s] and the first one after it, each once."""
        while self._next is not None and self._reached <= t:
            sample, self._next = self._next, next(self._iterator, None)
            self._reached = sample.t
            yield sample


def _rounds(opened: Opened, pause: float) -> Iterator[Sample]:
    """The samples again and again, counted through, each round later than the one before."""
    seq, start = 0, 0.0
    last: Sample | None = None
    while True:
        for k, sample in enumerate(opened.samples):
            quality = sample.quality
            if k == 0 and last is not None and _jumps(last, sample):
                # Nobody drove this way back: it may be looked at, not judged.
                quality = Quality.DEGRADED
            elif k == 0 and last is not None:
                for held in _held(last, start, pause):
                    yield replace(held, seq=seq)
                    seq += 1
            last = sample
            yield replace(sample, seq=seq, t=sample.t + start, quality=quality)
            seq += 1
        if last is None:
            return
        start += opened.duration + pause


def _held(last: Sample, start: float, pause: float) -> Iterator[Sample]:
    """What a closed loop says before a round that begins at ``start``: it stands where it ended."""
    if not isinstance(last, JointSample):
        return
    still = None if last.qd is None else (0.0,) * len(last.qd)
    for k in range(1, math.ceil(pause / HOLD)):
        yield replace(last, t=start - pause + k * HOLD, qd=still)


def _jumps(last: Sample | None, first: Sample) -> bool:
    if isinstance(last, JointSample) and isinstance(first, JointSample):
        return max((abs(a - b) for a, b in zip(last.q, first.q, strict=True)), default=0.0) > SAME_PLACE
    if isinstance(last, PoseSample) and isinstance(first, PoseSample):
        # Between unit quaternions of either sign the chord is 2 sin(angle / 4).
        chord = min(math.dist(last.wxyz, first.wxyz), math.dist(last.wxyz, [-x for x in first.wxyz]))
        turn = 4 * math.asin(min(1.0, chord / 2))
        return max(turn, math.dist(last.position, first.position)) > SAME_PLACE
    return True


class WaypointTarget(NamedTuple):
    """Waypoints that the workstation file itself has: what their poses are of, and in which frame."""

    tip: str
    """Link that carries the tool point."""
    tip_from_tool: Array
    """The tool point in that link's frame, shape (4, 4)."""
    base: str
    """Link in whose frame poses are."""
    points: int
    """How many there are."""


@runtime_checkable
class TakesWaypoints(Protocol):
    """A source to which waypoints can be added by hand."""

    robot: str

    def waypoint_target(self, description: Description) -> WaypointTarget | None:
        """What its waypoints are of; None where they are a file's."""


class Emulator(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of the options of what stands for a device: one file, one class, one ``kind``.

    A workstation file may say which emulators stand for its devices. They are started on demand only
    (``seerob run --emulated``), each in a process of its own.
    """
