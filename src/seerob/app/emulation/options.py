"""What ``seerob emulate`` makes a device of: typed options, one class in each file of `seerob.app.emulators`.

The fields are the options of the command line: ``primary_port`` is ``--primary-port``. Types carry units and
bounds, `option` says what each is.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Protocol, runtime_checkable

from msgspec import Meta

from seerob.app.emulation.wire import Faults
from seerob.core.errors import InputError
from seerob.core.host_name import check_host
from seerob.core.transforms import Array
from seerob.workstation.source import Emulator

if TYPE_CHECKING:
    from seerob.app.emulation.motions import Motion
    from seerob.app.emulation.mvn_person import Person
    from seerob.workstation.source import Opened, Target

COMMAND = "seerob emulate"
"""What messages call the place of a mistake."""
HOSTS = ("host", "to", "unity")
"""Options that name a machine."""


def option(text: str, unit: str = "", **limits: Any) -> Any:
    """Metadata of an option.

    Args:
        text: What it is, for ``--help`` and documentation.
        unit: Of a quantity.
        limits: As `msgspec.Meta` has them: ``ge``, ``le``, ``gt``, ``lt``.
    """
    return Meta(description=text, extra={"unit": unit} if unit else None, **limits)


def port(text: str = "port; 0 is any free one") -> object:
    """Metadata of a port."""
    return option(text, ge=0, le=65535)


To = Annotated[str, option("address to send to")]
Rate = Annotated[float, option("messages per second", "Hz", ge=1, le=1000)]


class Server(Protocol):
    """What is emulated, in a thread of its own."""

    def start(self) -> object:
        """Begin to serve or to send; returns when it does.

        Raises:
            OSError: The address cannot be listened on.
        """

    def stop(self) -> None:
        """End it."""


@runtime_checkable
class AsksForPage(Protocol):
    """A server that comes to the page of a run."""

    def found_page(self, port: int) -> None:
        """Where the page is."""


class Ready(NamedTuple):
    """A server that is ready to start, and what to say of it."""

    server: Server
    what: str
    """What it plays: ``ur10, a calm swing``."""
    where: str
    """Where it listens or what it sends to, for a message when that cannot be had: ``127.0.0.1:30004``."""
    commands: tuple[str, ...] = ()
    """That hear it, where ``seerob probe`` with its kind and address is not the way; see
    `seerob.app.emulation.serving`."""


class EmulatorOptions(Emulator, frozen=True, kw_only=True):
    """Base of every emulator's options: one file, one class; its first line says what is emulated."""

    host: Annotated[str, option("address to listen on")] = "127.0.0.1"
    seconds: Annotated[float, option("end after this time", "s", gt=0)] | None = None
    drop: Annotated[float, option("share of its packets that are lost", ge=0, le=1)] = 0.0
    delay: Annotated[float, option("by which all it says comes late", "s", ge=0, le=60)] = 0.0
    jitter: Annotated[float, option("by up to which each packet comes later", "s", ge=0, le=60)] = 0.0
    garble: Annotated[float, option("share of its packets in which a bit is flipped", ge=0, le=1)] = 0.0
    seed: Annotated[int, option("of which packets these are", ge=0)] = 1

    @property
    def sends(self) -> bool:
        """Whether it sends to somebody by itself, instead of listening."""
        return hasattr(self, "to") and not getattr(self, "websocket", False)

    @property
    def listens(self) -> tuple[str, ...]:
        """Options of the ports that it listens on."""
        return () if self.sends or not hasattr(self, "port") else ("port",)

    def faults(self) -> Faults:
        """What happens on the way to whoever hears it."""
        return Faults(self.drop, self.delay, self.jitter, self.garble, self.seed)

    def __post_init__(self) -> None:
        for key in HOSTS:
            if host := getattr(self, key, None):
                check_host(f"--{key}", host)

    def ready(self) -> Ready:
        """The device that the options ask for.

        Raises:
            InputError: What it shall play is missing or wrong.
            MissingPackage: A package of an extra is not installed.
        """
        raise NotImplementedError

    def person_before(self) -> tuple[str, Array] | None:
        """Keyframes of the person whom it sees in rounds, and the device's world from theirs, (4, 4).

        None where it sees nobody, or nobody who keeps step with others.
        """
        return None


# -- people -------------------------------------------------------------------------------------

LIBRARY = "library:reach"
"""What is played when nothing is given."""
NOISE = 2e-4
"""Standard deviation of what a device measures [m]: that of optical trackers; without it a person is taken
for frozen."""
Noise = Annotated[float, option("noise of what is measured, standard deviation", "m", ge=0, le=0.1)]


class PersonOptions(EmulatorOptions, frozen=True, kw_only=True):
    """What an emulated device sees that sees a person."""

    file: Annotated[
        str, option("motion to play: an .mvnx or .bvh recording, or keyframes (.toml, library:…)")
    ] = LIBRARY
    noise: Noise = NOISE

    def person(self) -> Person:
        """Who moves.

        Raises:
            InputError: The motion is missing or wrong.
        """
        from seerob.app.emulation.mvn_person import animated, followed, measured, recorded

        given = Path(self.file)
        match given.suffix.lower():
            case ".mvnx":
                person = recorded(given)
            case ".bvh":
                person = followed(given)
            case _:
                person = animated(self.file)
        return measured(person, self.noise)


# -- robots -------------------------------------------------------------------------------------

IN_ROUNDS = (
    "period of the person's rounds, which begin at whole multiples of it by the clock of this machine; "
    "before the first they stand still"
)
IN_STEP = "period of its rounds, which begin at whole multiples of it by the clock of this machine"
CALM = {
    "joint_speed": 0.5,
    "joint_acceleration": 1.0,
    "joint_jerk": 10.0,
    "tool_speed": 0.1,
    "tool_acceleration": 0.5,
    "tool_jerk": 5.0,
    "tolerance": 0.005,
}
"""What an emulated controller does where its waypoints do not say [rad/s, m/s and their derivatives, rad]."""
_WAYPOINTS = "waypoints to go through, timed here: .script, .urp, .toml, .yaml, .csv, .xlsx, RoboDK, KUKA log"


class RobotOptions(EmulatorOptions, frozen=True, kw_only=True):
    """What an emulated robot is and does: a robot of the library, and a motion that it can do."""

    robot: Annotated[str, option("robot of the library, whose limits hold")] = "ur10"
    file: Annotated[str, option("motion to play: a table with joint columns (.csv, .xlsx)")] | None = None
    waypoints: Annotated[str, option(_WAYPOINTS)] | None = None
    in_step: Annotated[float, option(IN_STEP, "s", gt=0)] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.file is not None and self.waypoints is not None:
            raise ValueError("--file and --waypoints are both given: keep one")

    def target(self, *, joints: int | None = None, whose: str = "") -> Target:
        """The robot as a source sees it.

        Args:
            joints: How many it must have; None for any number.
            whose: What has that many: ``a Universal Robots arm``.

        Raises:
            UnknownName: The library has no such robot.
            InputError: It has another number of joints.
        """
        found = target_of(self.robot)
        if joints is not None and len(found.joints) != joints:
            what = f"{self.robot} has {len(found.joints)} joints, {whose} has {joints}"
            raise InputError.at(COMMAND, "--robot", what, "name another robot")
        return found

    def motion(self, target: Target, home: Sequence[float] | None = None) -> tuple[Motion, str]:
        """What it plays, and that in words.

        Args:
            target: The robot.
            home: What it swings about when nothing is given, and where it stands before waypoints that
                begin with a pose [rad]; when not given, the place nearest to zero with room to swing.

        Raises:
            InputError: The file is missing or wrong, or the robot cannot do what it says.
        """
        from seerob.app.emulation.motions import SWING, in_step

        start = home_of(target, SWING) if home is None else home
        motion, what = self._motion(target, start)
        if self.in_step is None:
            return motion, what
        return in_step(motion, self.in_step), f"{what}, every {self.in_step:g} s"

    def one_round(self, target: Target) -> Motion:
        """What it plays from the beginning of a round on, with ``in_step``; raises as `motion`."""
        from seerob.app.emulation.motions import SWING

        return self._motion(target, home_of(target, SWING))[0]

    def _motion(self, target: Target, start: Sequence[float]) -> tuple[Motion, str]:
        once = self.in_step is not None  # whoever keeps step waits for the next round
        from seerob.app.emulation.motions import swing

        if self.waypoints is not None:
            motion, left_out = _through(Path(self.waypoints), target, start, once=once)
            without = f", without {'; '.join(left_out)}" if left_out else ""
            return motion, f"through the waypoints of {self.waypoints}{without}"
        if self.file is not None:
            return read(Path(self.file), target, once=once), self.file
        return swing(start), "a calm swing"


def target_of(robot: str) -> Target:
    """A robot of the library, as a source sees it.

    Raises:
        UnknownName: The library has no such robot.
    """
    from seerob.description.description import JointKind
    from seerob.description.robots import library
    from seerob.workstation.source import Target

    description = library.load(robot)
    own = description.joints()
    return Target(
        name=robot,
        joints=tuple(j.name for j in own),
        units=tuple("rad" if j.kind is JointKind.REVOLUTE else "m" for j in own),
        lower=tuple(-inf if j.lower is None else j.lower for j in own),
        upper=tuple(inf if j.upper is None else j.upper for j in own),
        velocity=tuple(None if j.velocity is None else j.velocity.value for j in own),
        description=description,
    )


def home_of(target: Target, amplitude: float) -> tuple[float, ...]:
    """Joint positions nearest to zero about which every joint has room to swing.

    Args:
        target: The robot.
        amplitude: Of the swing [rad or m].
    """
    limits = zip(target.lower, target.upper, strict=True)
    return tuple(
        (low + high) / 2 if high - low < 2 * amplitude else min(max(0.0, low + amplitude), high - amplitude)
        for low, high in limits
    )


def read(path: Path, target: Target, *, once: bool = False) -> Motion:
    """A motion from a table.

    Raises:
        InputError: The file is missing or wrong, or the robot cannot do what it says.
    """
    from seerob.devices.sources.csv import Csv
    from seerob.devices.sources.excel import Excel
    from seerob.files.tables.table_files import WORKBOOKS

    kind = Excel if path.suffix.lower() in WORKBOOKS else Csv
    return _played(kind(robot=target.name, file=path.name).open(path.parent, target), once=once)


def _played(opened: Opened, *, once: bool) -> Motion:
    from seerob.app.emulation.motions import played
    from seerob.core.samples import JointSample

    samples = [s for s in opened.samples if isinstance(s, JointSample)]
    speeds = [s.qd or (0.0,) * len(s.q) for s in samples]
    return played([s.t for s in samples], [s.q for s in samples], speeds, once=once)


def _through(
    path: Path, target: Target, home: Sequence[float], *, once: bool
) -> tuple[Motion, tuple[str, ...]]:
    """Its motion, and which parts of the program are left out since only a controller knows them."""
    import msgspec

    from seerob.devices.sources.waypoints import Waypoints

    given = {"robot": target.name, "file": path.name, **CALM}
    source = msgspec.convert(given, Waypoints)
    program = source.program(path)
    if program.waypoints and program.waypoints[0].q is None:
        source = msgspec.structs.replace(source, start=tuple(home))
    return _played(source.open(path.parent, target), once=once), program.left_out
