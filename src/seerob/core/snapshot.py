"""What goes out: plain frozen data that a recorder, a browser and a report can read.

``web/src/wire.ts`` is generated from this file by `seerob.app.wire`; docstrings go along.
What there are many of in each snapshot (results, rows, aspects, markers) is an array of its fields in this
order, so that no name travels with each figure; a new field goes to the end, with a default.
World frame: right-handed, z up, metres. Quaternions: unit, w first.
"""

from __future__ import annotations

from enum import StrEnum

import msgspec
from msgspec import Struct

from seerob.core.events import Event as Event  # noqa: PLC0414
from seerob.core.markers import (
    Arrow,
    Box,
    Ellipsoid,
    Highlight,
    Hull,
    Label,
    Marker,
    Polyline,
    Prism,
    Rays,
    Segment,
    Sphere,
    Vec3,
    Vec4,
)
from seerob.core.page_messages import (
    Change,
    Command,
    CriterionSoFar,
    Draft,
    Edit,
    Edited,
    Grab,
    Hello,
    History,
    Hold,
    Introduction,
    Measure,
    Mistake,
    Presence,
    Presences,
    Pull,
    Reach,
    Refused,
    Register,
    Registered,
    SoFar,
    Trace,
    Tracked,
    Tracking,
    Transport,
    VisitorInfo,
    VisitorPresence,
    Visitors,
)
from seerob.core.printable import printable
from seerob.core.verdict import Verdict, worst

__all__ = [
    "PROTOCOL",
    "Arrow",
    "Aspect",
    "Basis",
    "Box",
    "Change",
    "Command",
    "ControlInfo",
    "CriterionInfo",
    "CriterionSoFar",
    "Draft",
    "Edit",
    "Edited",
    "Ellipsoid",
    "Event",
    "Finding",
    "Grab",
    "Hello",
    "Highlight",
    "History",
    "Hold",
    "Hull",
    "Input",
    "Introduction",
    "JointInfo",
    "Label",
    "Level",
    "LinkMass",
    "Marker",
    "Measure",
    "Measured",
    "MechanismInfo",
    "Mistake",
    "Node",
    "Origin",
    "Place",
    "Polyline",
    "Presence",
    "Presences",
    "Prism",
    "Pull",
    "Rays",
    "Reach",
    "Refused",
    "Register",
    "Registered",
    "Result",
    "Row",
    "RowState",
    "Scene",
    "Segment",
    "Snapshot",
    "SoFar",
    "Sphere",
    "Trace",
    "Tracked",
    "Tracking",
    "Transport",
    "Vec3",
    "Vec4",
    "Verdict",
    "VisitorInfo",
    "VisitorPresence",
    "Visitors",
]

PROTOCOL = "seerob.v2.msgpack"
"""WebSocket sub-protocol; the server refuses any other."""


class Origin(StrEnum):
    """Where a number comes from, best first."""

    MEASURED = "measured"
    """Heard from the real thing."""
    STATED = "stated"
    """Published by the maker or by a norm; the source is named."""
    GIVEN = "given"
    """Written by the user in the workstation file."""
    COMPUTED = "computed"
    """Follows from the others by the formula."""
    ESTIMATED = "estimated"
    """By a stated method with a stated error, asked for by the user."""
    CHOICE = "choice"
    """What a method leaves open, decided by seerob in the open; the workstation file can choose otherwise."""
    ASSUMED = "assumed"
    """Nobody gave it; a verdict that needs it is UNDECIDED."""
    MISSING = "missing"


class Input(Struct, frozen=True, kw_only=True):
    """One number that a result was made from."""

    name: str
    value: float | str | None = None
    unit: str = ""
    origin: Origin
    source: str = ""
    """Document, file or device; for norms with edition, clause and confidence."""


class Basis(Struct, frozen=True, kw_only=True):
    """Why a result is what it is; enough to defend it line by line."""

    formula: str
    source: str
    """Clause and edition of the norm, or equation of the paper."""
    inputs: tuple[Input, ...] = ()
    not_modelled: tuple[str, ...] = ()
    """What this number leaves out."""


class Finding(Struct, frozen=True, kw_only=True):
    """Something noticed while a model was built that whoever reads a result must know."""

    level: str
    """``note``, ``assumed`` or ``warning``."""
    subject: str
    """Full name of the thing it is about."""
    text: str
    holds: tuple[str, ...] = ()
    """Robots, people, machines, parts, variables (``variable door``), or ``*`` for everything, of which no
    criterion is WITHIN as long as it stands."""

    def __post_init__(self) -> None:
        if not (self.text.isprintable() and self.subject.isprintable()):  # they may quote a file or a device
            msgspec.structs.force_setattr(self, "text", printable(self.text))
            msgspec.structs.force_setattr(self, "subject", printable(self.subject))


# -- results ------------------------------------------------------------------------------------


class RowState(StrEnum):
    """Why a row has, or has not, a figure to compare."""

    JUDGED = "judged"
    FORBIDDEN = "forbidden"
    """Contact is not permitted, whatever the figure."""
    NO_LIMIT = "no_limit"
    """No limit is available for this place."""
    EXCLUDED = "excluded"
    """Kept out by measures that are not evaluated here."""
    NOT_ASSESSED = "not_assessed"
    """What it needs is not measured or was not entered; never a least score."""


class Aspect(Struct, frozen=True, kw_only=True, array_like=True):
    """One figure behind a row: an angle of a component, the speed that one of several limits allows."""

    name: str
    value: float | None = None
    """None when it is not known or not measured."""
    unit: str = ""
    limit: float | None = None
    band: str = ""
    """Band of the method into which the value falls, with its thresholds: ``20° to 45°``."""


class Row(Struct, frozen=True, kw_only=True, array_like=True):
    """One line about a place of a person's body: for body map, posture panel and manikin.

    A component of a score (with `scale`) or a body area with a limit of its own.
    """

    name: str
    """Without its side: ``upper arm``, ``Palm``; ``score`` for the total of a side or of the whole."""
    group: str = ""
    """Body region or table of the method that it belongs to."""
    side: str = ""
    """``left`` or ``right``; empty for the middle or where both sides are meant."""
    state: RowState = RowState.JUDGED
    value: float | None = None
    unit: str = ""
    limit: float | None = None
    """Greatest admissible value, in ``unit``."""
    scale: tuple[float, float] | None = None
    """Best and worst score that there can be; None for a quantity."""
    interval: tuple[float, float] | None = None
    verdict: Verdict | None = None
    reason: str = ""
    """What governs, or why there is no verdict."""
    areas: tuple[int, ...] = ()
    """Numbers of specific body areas, ISO/TS 15066:2016 Table A.2, 1 to 29."""
    bones: tuple[str, ...] = ()
    """Full names of the nodes that it speaks of: ``operator/right_hand``."""
    aspects: tuple[Aspect, ...] = ()
    inputs: tuple[str, ...] = ()
    """Names of the inputs of the basis that its limit comes from."""


class Result(Struct, frozen=True, kw_only=True, array_like=True):
    """What one criterion says at one instant; its basis does not change in a run (`CriterionInfo.basis`).

    A result with a figure and without a limit has no verdict: it informs. UNDECIDED always carries a reason.
    One that says nothing is UNDECIDED, unless it says that there is nothing to judge, and why.
    """

    name: str
    value: float | int | None = None
    """The figure, in ``unit``; None when it could not be had. A score or a count is an ``int`` and exact."""
    unit: str = ""
    limit: float | None = None
    """Admissible value, in ``unit``."""
    at_most: bool = True
    """Whether the limit bounds from above (a speed) or from below (a distance)."""
    verdict: Verdict | None = None
    reason: str = ""
    """Why UNDECIDED, or what governs: ``forearm_link ↔ right hand``."""
    interval: tuple[float, float] | None = None
    """Where the true value lies, given the tolerances of the inputs."""
    parts: tuple[Result, ...] = ()
    """One result per link or body area; the worst one gives the verdict."""
    markers: tuple[Marker, ...] = ()
    rows: tuple[Row, ...] = ()
    """One row per place of a person's body, where a criterion judges such places."""
    t: float | None = None
    """Instant it speaks of [s] when that is not the snapshot's (a criterion with a period)."""
    muted: bool = False
    """Whether the criterion does not apply now, as a variable says: then it says nothing."""
    nothing: bool = False
    """Whether there is nothing to judge now, and ``reason`` says why: nobody is near."""

    def __repr__(self) -> str:
        value = "no figure" if self.value is None else f"{self.value:.6g} {self.unit}".rstrip()
        verdict = "no verdict" if self.verdict is None else self.verdict.value
        return f"<Result {self.name!r}: {value}, {verdict}>"


class Measured(Struct, frozen=True, kw_only=True, tag="measured"):
    """What a page's `Measure` or `Reach` came to."""

    id: int
    result: Result | None = None
    """Least distance of the surfaces at the instant that was shown (`Result.t`), with the line between them;
    it has no limit, and an interval where the real surfaces may be nearer than the shapes. Of a `Reach` how
    far outside of the outline, which its markers are, places can be [m]."""
    refusal: str = ""
    """Why there is none."""


class SourceLine(Struct, frozen=True, kw_only=True):
    """How a live source is heard, or where targets are sent to."""

    heard: bool = False
    """Whether it is heard now, or is let in where it is sent to."""
    rate: float | None = None
    """Mean while heard [1/s]."""
    jitter: float | None = None
    """Standard deviation of the interval between arrivals [s]."""
    latency: float | None = None
    """How much later than its fastest sample the newest one arrived [s]; None where it sends no time."""
    bound: float | None = None
    """How late a sample may be to count [s]."""
    received: int = 0
    """Samples with news."""
    lost: int = 0
    """Samples that its own time says are missing."""
    losses: int = 0
    """Times it was lost after it had been heard."""
    sent: int = 0
    """Targets and bools that were written to it."""
    word: str = ""
    """Why it was not heard last, or was not let in; empty before that happened."""

    def __str__(self) -> str:
        """In a line."""
        words = ["heard" if self.heard else "not heard"]
        if self.rate is not None and self.jitter is not None:
            words.append(f"{self.rate:.1f}/s, jitter {1e3 * self.jitter:.2f} ms")
        if self.latency is not None and self.bound is not None:
            words.append(f"latency {1e3 * self.latency:.1f} ms ({1e3 * self.bound:.0f} ms may be)")
        words.append(f"{self.received} received, {self.lost} lost, lost {self.losses} times")
        if self.sent:
            words.append(f"{self.sent} sent")
        if self.word:
            words.append(f"last word: {self.word}")
        return "; ".join(words)


class Snapshot(Struct, frozen=True, kw_only=True, tag="snapshot", omit_defaults=True):
    """The twin and its results at one tick."""

    seq: int
    t: float
    """Run time [s]."""
    poses: bytes
    """Little-endian float32, seven per node of `Scene.nodes`: x, y, z [m], w, x, y, z."""
    joints: dict[str, tuple[float, ...]] = {}
    """Joint positions of the twin per robot and human [rad or m]."""
    tracking: dict[str, float] = {}
    """Largest joint error between the twin and what was heard, per robot and human [rad or m]."""
    bones: dict[str, dict[str, tuple[float | None, float | None]]] = {}
    """Of people that devices see: bone → how far the twin's bone is from the device's, position [m] and
    angle [rad]; null where the device has none."""
    late: dict[str, tuple[float, float]] = {}
    """Per robot and human whose live device sends its time: how much later than the fastest sample the newest
    one arrived, and how late it may be to count [s]."""
    results: tuple[Result, ...] = ()
    looks: dict[str, tuple[float, float, float] | None] = {}
    """Nodes whose look follows a variable: red, green, blue in 0…1; null where one is not drawn."""
    doubts: dict[str, str] = {}
    """Robots, humans, machines (with all that they move, `Node.mover`) and single nodes that may not be where
    `poses` has them, with the reason."""
    sources: dict[str, SourceLine] = {}
    """How live sources are heard, and targets sent, by name; told about once a second and for a
    tenth of one, empty in between."""
    events: tuple[Event, ...] = ()
    """What happened to loose workpieces since the last tick."""

    def __repr__(self) -> str:
        verdict = worst([result.verdict for result in self.results])
        said = "no verdict" if verdict is None else verdict.value
        return f"<Snapshot {self.seq} at {self.t:.4f} s: {len(self.results)} results, {said}>"


# -- what does not change during a run ----------------------------------------------------------


class Node(Struct, frozen=True, kw_only=True):
    """One body of the scene; its index is its slot in `Snapshot.poses`."""

    name: str
    """Unique full name, such as ``ur10/forearm_link`` or ``line/fixture/pin_2``."""
    role: str
    """``robot``, ``human``, ``tool``, ``workpiece``, ``part``, ``machine`` or ``area``."""
    owner: str
    """The table entry of the workstation file it belongs to."""
    mover: str = ""
    """The robot, human or machine that decides where it is; empty for what stands."""
    mesh: str | None = None
    """Hash of its display mesh (binary glTF, metres, z up, in the body's frame), at ``/mesh/<hash>.glb``."""
    triangles: int = 0
    moves: bool = True
    mass: float | None = None
    """[kg]; None when nobody gave it."""
    mass_origin: Origin = Origin.MISSING
    note: str = ""
    """What to know of its geometry: ``envelope, not the maker's mesh``."""
    real: bool = False
    """Whether it exists in the real cell: over that it is not drawn, and hides what is behind it."""


class Level(Struct, frozen=True, kw_only=True):
    """A class of scores that a method acts upon, such as an action level."""

    up_to: float
    """Highest score that belongs to it."""
    name: str
    """``action level 2``."""


class CriterionInfo(Struct, frozen=True, kw_only=True):
    """A criterion of this run."""

    name: str
    kind: str
    group: str
    """``safety`` or ``ergonomics``."""
    title: str
    """First line of the criterion's documentation."""
    subjects: tuple[str, ...] = ()
    """Full names it speaks of."""
    unit: str = ""
    limit: float | None = None
    at_most: bool = True
    basis: Basis | None = None
    between: str = ""
    """What is known of the time between the instants at which it is asked: empty where it is bounded there,
    ``accepted: …`` with the reason, or why nothing is known; then the verdict of a run stays undecided."""
    levels: tuple[Level, ...] = ()
    """Classes of the scores, the lowest first; empty when the method has none."""


class ControlInfo(Struct, frozen=True, kw_only=True):
    """A lever, button or switch that people pull in the twin."""

    name: str
    kind: str
    """``lever``, ``switch``, ``button`` or ``enabling``."""
    of: str
    """What is pulled: an owner of nodes, or a node's full name."""
    sets: str
    """Variable."""
    lower: float
    upper: float
    start: float


class JointInfo(Struct, frozen=True, kw_only=True):
    """One joint of a robot or human."""

    name: str
    unit: str
    """``rad`` or ``m``."""
    lower: float | None = None
    upper: float | None = None


class LinkMass(Struct, frozen=True, kw_only=True):
    """What one link of a robot, or one thing mounted on it, weighs: a row of its mass table."""

    name: str
    """Full name."""
    mass: float | None = None
    """[kg]; None where nobody knows it."""
    origin: Origin
    source: str = ""
    moves: bool = True
    merged: str = ""
    """Link that it is fixed to and moves as one with; empty for that one itself."""
    note: str = ""
    """Why it weighs nothing, or why its mass is not known."""


class MechanismInfo(Struct, frozen=True, kw_only=True):
    """A robot or a human, as the page lists it."""

    name: str
    role: str
    """``robot`` or ``human``."""
    joints: tuple[JointInfo, ...]
    coarse: str = ""
    """Why what its source says is too coarse for energies and forces; empty when it is not."""
    masses: tuple[LinkMass, ...] = ()
    """What each link of a robot or machine and each thing on it weighs."""


class Place(Struct, frozen=True, kw_only=True):
    """A point of interest of the cell, and how it is turned."""

    name: str
    node: str = ""
    """Full name of the node that it goes along with; empty where it stands in the world."""
    position: Vec3
    """In that node's frame, or in the world [m]."""
    wxyz: Vec4 = (1.0, 0.0, 0.0, 0.0)
    accuracy: float = 0.0
    """How far it may be from there, standard deviation per axis [m]."""
    accuracy_turn: float | None = None
    """How far it may be turned from there, standard deviation per axis [rad]; None where nobody says."""
    board: str = ""
    """What is printed on the board that lies there; empty for none."""


class Taught(Struct, frozen=True, kw_only=True):
    """A robot to which waypoints can be given by hand: the tool point that they are of, and their frame."""

    source: int | None
    """Number of the source that has them among ``sources`` of the workstation file; None while nobody drives
    the robot, so that it can have one."""
    robot: str
    tip: Place
    """The tool point."""
    base: Place
    """In whose frame the file has poses."""
    points: int
    """How many it has already."""


class CameraInfo(Struct, frozen=True, kw_only=True):
    """A camera that looks at the real cell; over its picture the twin is shown."""

    name: str
    size: tuple[int, int]
    """Width and height of its pictures [px]."""
    lens: tuple[float, float, float, float, float, float, float, float, float]
    """fx, fy, cx, cy [px], k1, k2, p1, p2, k3, as OpenCV has them."""
    place: Place | None = None
    """Where it is: x to the right, y down, z ahead of it; None where nobody knows."""
    error: float | None = None
    """What 95 % of the error at ``tool`` stay within, across the line of sight [m]."""
    tool: str = ""
    error_px: float | None = None
    """Root mean square of what corners of boards are off in its pictures [px]."""
    fetched: bool = False
    """Whether the server has its pictures, at ``/camera/<its number here>``; else it is one of the device
    that shows the page."""
    mistake: str = ""
    """Why the twin is not drawn over its picture; empty where it is."""


class Scene(Struct, frozen=True, kw_only=True, tag="scene"):
    """Everything about a run that does not change while it runs; sent once."""

    title: str
    edition: str
    """Editions of norms that figures are from, as the bases of the criteria say; and the one that the file
    asks for, where no figure is from it."""
    version: str
    """Version of seerob that wrote this."""
    workstation_hash: str
    """SHA-256 of the workstation file and of every file it names."""
    period: float
    """Tick period [s]."""
    nodes: tuple[Node, ...]
    mechanisms: tuple[MechanismInfo, ...] = ()
    criteria: tuple[CriterionInfo, ...] = ()
    findings: tuple[Finding, ...] = ()
    controls: tuple[ControlInfo, ...] = ()
    """What people pull."""
    headsets: dict[str, tuple[float, float, float, float, float, float, float]] = {}
    """Person whom a page's headset drives → where the floor of its room lies: position [m], quaternion with w
    first; x is ahead there, z up."""
    landmarks: tuple[Place, ...] = ()
    """By which the room of a visitor, or a camera, is placed in the cell."""
    tips: tuple[Place, ...] = ()
    """Point of interest of each robot, by its name."""
    taught: tuple[Taught, ...] = ()
    """Where waypoints can be added by hand."""
    cameras: tuple[CameraInfo, ...] = ()
    """That look at the real cell."""

    def __repr__(self) -> str:
        count = f"{len(self.nodes)} bodies, {len(self.criteria)} criteria, {len(self.findings)} findings"
        return f"<Scene {self.title!r}: {count}>"
