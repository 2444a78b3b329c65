"""What the page and the server say to each other beside scene and snapshots; see `seerob.core.snapshot`."""

from __future__ import annotations

from msgspec import Struct

from seerob.core.events import Event
from seerob.core.markers import Vec3, Vec4
from seerob.core.verdict import Verdict


class Hello(Struct, frozen=True, kw_only=True, tag="hello"):
    """First message of the server."""

    server: str
    mode: str
    """``live``, ``replay`` or ``edit`` (no run: where everything is at its begin)."""
    duration: float | None = None
    """Length of the recording [s]; None when there is none."""
    schema: str = ""
    """Hash of the message types; a page built for another one must be built anew."""
    may: tuple[str, ...] = ()
    """What this page may do, as its token says: ``view``, ``track`` (offer what a headset sees), ``control``
    (play, pause, seek), ``edit`` (change the workstation file), ``measure`` (ask how far things are from one
    another)."""
    visitor: int = 0
    """Number of this visitor, which no other has."""


class Trace(Struct, frozen=True, kw_only=True):
    """One criterion over a stretch of time, for plots and the timeline's lanes."""

    name: str
    t: bytes
    """Little-endian float64 run times [s]."""
    values: bytes
    """Little-endian float64, NaN where there was no value."""
    limits: bytes
    """Little-endian float64, NaN where there was none."""
    verdicts: bytes
    """One byte each: 0 within, 1 exceeded, 2 undecided, 255 none."""


class History(Struct, frozen=True, kw_only=True, tag="history"):
    """What happened so far (live) or all of it (replay), thinned without losing an extremum."""

    traces: tuple[Trace, ...]
    beside: tuple[Trace, ...] = ()
    """Of another run, on the same axis: to look at, and of no verdict here."""
    beside_title: str = ""
    """What that run is called."""
    beside_refusal: str = ""
    """Why the run that was asked for is not there."""
    others: tuple[str, ...] = ()
    """What can be asked for: other runs in the folder of the one that is replayed, newest first."""


class CriterionSoFar(Struct, frozen=True, kw_only=True):
    """What one criterion came to."""

    verdict: Verdict | None
    decided: float
    """Share of the run in which it was within or exceeded, 0…1."""
    undecided: float
    muted: float
    """It did not apply."""
    nothing: float
    """It was asked, and there was nothing to judge, or no limit to judge by."""
    open: float
    """It was not asked, and nothing says what it would have said."""
    reason: str = ""
    """Why what was within whenever it was asked is not known to be within throughout."""


class SoFar(Struct, frozen=True, kw_only=True, tag="so_far"):
    """What the run came to by now (live) or as far as the recording was read; sent when it changes."""

    verdict: Verdict | None
    decided: float | None
    """Least share that a criterion with a verdict decided of the time in which it was muted or had something
    to judge, 0…1."""
    criteria: dict[str, CriterionSoFar]
    whole: bool = False
    """Whether that is all of the run."""
    slipped: float = 0.0
    """How much later than real time a live run is by now, because it fell behind [s]."""
    slipped_at: float | None = None
    """Run time at which it fell behind last [s]; None when it never did."""
    events: tuple[Event, ...] = ()
    """What happened to loose workpieces, the newest 200 at most."""


class Transport(Struct, frozen=True, kw_only=True, tag="transport"):
    """State of the player; sent on every change."""

    playing: bool
    t: float
    speed: float = 1.0
    live: bool = False
    loop: bool = False
    """Whether the player starts again at the end."""


class Tracking(Struct, frozen=True, kw_only=True, tag="tracking"):
    """What a page's headset sees of the person who wears it; only a live run that waits for it takes it."""

    human: str
    """Name of the person in the workstation file."""
    t: float
    """On the page's clock [s]."""
    names: tuple[str, ...]
    """``viewer``, ``left-grip``, ``right-grip``, and joints as WebXR Body Tracking names them."""
    poses: bytes
    """Little-endian float32, seven per name: x, y, z [m], w, x, y, z in ``local-floor`` (x right, y up,
    z backward); NaN for what is not tracked."""
    guessed: bytes = b""
    """One byte per name, 1 where the headset itself only estimates the position; empty for nowhere."""
    space: str = ""
    """Which tracking space that is: another one after each recentring and in each session. Where a room lies
    in the cell is known of the space in which that was found out."""
    scale: float = 1.0
    """Metres of the world in a metre of theirs, as they see it. Poses are in theirs: whoever works at another
    scale than 1 is judged by postures alone."""
    stands: str = ""
    """``tpose`` (arms to the sides, palms down) or ``npose`` (arms hanging) while the wearer says that they
    stand still in that pose: once they say so no more, what was seen meanwhile calibrates the person."""


class Register(Struct, frozen=True, kw_only=True, tag="register"):
    """One step of finding out where the room of a page's headset lies in the cell."""

    id: int
    """The page's own number, by which it knows the answer."""
    human: str = ""
    """The person that the visitor is; empty for one who looks."""
    space: str
    """Which tracking space that is (`Tracking.space`); a step in another one begins anew."""
    step: str
    """``sweep`` (the controller was turned about its tip), ``touch`` (the tip is on a landmark), ``strapped``
    (the controller is fixed to what carries a landmark), ``known`` (the controller lies in the pose of a
    landmark), ``seen`` (the device's camera sees the board at a landmark), ``check`` (as touch, of what is
    known already), ``nudge``, ``restore``, ``drop`` (the last touch or look), ``forget``."""
    landmark: str = ""
    """Of ``touch``, ``strapped``, ``known``, ``seen`` and ``check``."""
    poses: bytes = b""
    """Of the controller while it was held: little-endian float32, seven each as in `Tracking.poses`.
    ``seen``: of the camera, one, as WebXR turns it: x to the right, y up, -z ahead."""
    corners: bytes = b""
    """``seen``: corners of the board, as ``POST /board`` found them: little-endian float32, four each, x and
    y on the board [m] before x and y in the picture [px]."""
    by: tuple[float, ...] = ()
    """``seen``: fx, fy, cx and cy of the picture [px]. ``nudge``: translation [m] and rotation vector [rad]
    in the cell's axes. ``restore``: what `Registered` said: its ``at``, ``about`` and ``covariance``, 46
    numbers."""


class Registered(Struct, frozen=True, kw_only=True, tag="registered"):
    """What a page's `Register` came to, and all that is known of where its room lies."""

    id: int
    accepted: bool
    reason: str = ""
    """Why the step was refused."""
    at: tuple[float, ...] = ()
    """Where the floor of the room lies: position [m], quaternion with w first; x is ahead there, z up. Empty
    while too little is known."""
    about: tuple[float, ...] = ()
    """Point of the cell that ``covariance`` is about [m]."""
    covariance: tuple[float, ...] = ()
    """36 numbers row by row: translation [m] before rotation [rad], in the cell's axes."""
    error: float | None = None
    """What 95 % of the error at ``tool`` stay within [m]."""
    tool: str = ""
    """The robot whose point of interest is meant: of several the one with the largest error."""
    doubt: str = ""
    """Why nothing rests on where the visitor is all the same; empty when it may."""
    landmarks: tuple[str, ...] = ()
    """What was touched so far, in order."""
    residuals: tuple[float, ...] = ()
    """How far each is from where the registration puts it [m]."""
    tip: float | None = None
    """What 95 % of the error of the controller's tip stay within [m]; null before it was turned about it."""


class Tracked(Struct, frozen=True, kw_only=True, tag="tracked"):
    """What became of a page's `Tracking`; sent at its first, and when that changes."""

    human: str
    accepted: bool
    reason: str = ""
    """Why not."""
    fits: bool | None = None
    """Whether the newest calibration that the page asked for (`Tracking.stands`) holds; None before one."""
    found: str = ""
    """What it found, or why it was refused."""
    taller: float | None = None
    """How many times as tall as the person of the workstation file the wearer is, by the height of the eyes;
    null when that was not found."""


class Command(Struct, frozen=True, kw_only=True, tag="command"):
    """What a page asks of the server."""

    action: str
    """``play``, ``pause``, ``seek``, ``speed``, ``step``, ``loop``, ``beside`` or ``ack``."""
    value: float | None = None
    """``seek``: run time [s]; ``speed``: factor; ``step``: recorded snapshots forward or back;
    ``loop``: 1 or 0; ``beside``: number in `History.others`, -1 for none;
    ``ack``: `Snapshot.seq` that was received."""


class Change(Struct, frozen=True, kw_only=True):
    """One change of the workstation file."""

    kind: str
    """``set`` a key, ``add`` a table to a list, ``remove`` a key or an entry, or ``copy`` an entry."""
    path: tuple[str | int, ...]
    """Keys and numbers of entries: ``["robots", 0, "base", "position"]``; for ``add`` those of the list."""
    value: object = None
    """``set``: the value; ``add``: the table; ``copy``: what is different in the copy."""


class Edit(Struct, frozen=True, kw_only=True, tag="edit"):
    """What a page asks of the workstation file, all of it or nothing; only where editing is allowed."""

    id: int
    """The page's own number, by which it knows the answer."""
    action: str
    """``change``, ``undo``, ``redo``, ``save``, ``discard``, ``run`` or ``stop``."""
    revision: int
    """`Draft.revision` that the page saw."""
    changes: tuple[Change, ...] = ()
    brought: int = 0
    """Instead of ``changes``, the number of those that a CAD file makes that a page brought; 0 for none."""


class Measure(Struct, frozen=True, kw_only=True, tag="measure"):
    """What a page that may control asks of the twin: how far two things are from one another."""

    id: int
    """The page's own number, by which it knows the answer."""
    between: tuple[str, str]
    """Full names of bodies, or of all that belongs to a robot, a person or another entry."""
    t: float | None = None
    """Instant that the page shows [s]; None for the newest."""


class Reach(Struct, frozen=True, kw_only=True, tag="reach"):
    """What a page that may control asks of the twin: where somebody can reach."""

    id: int
    """The page's own number, by which it knows the answer; not one of a `Measure`."""
    of: str
    """A robot (its working point), a person (both hands), or the full name of a body of them."""
    t: float | None = None
    """Instant that the page shows [s]; None for the newest."""


class Mistake(Struct, frozen=True, kw_only=True):
    """One mistake that an edit would make, in the words of ``seerob check-file``."""

    key: str
    """The place: ``robots[0].base.position``; empty for the whole file."""
    what: str
    remedy: str = ""


class Edited(Struct, frozen=True, kw_only=True, tag="edited"):
    """What became of a page's `Edit`."""

    id: int
    accepted: bool
    revision: int
    """Of the draft now."""
    mistakes: tuple[Mistake, ...] = ()
    """Why it was refused; nothing is changed then."""


class Draft(Struct, frozen=True, kw_only=True, tag="draft"):
    """The workstation file as it is edited; sent on every change, to each page what it may take back."""

    file: str
    revision: int
    diff: str
    """What a save would change, as a unified diff; empty for nothing."""
    tables: dict[str, object]
    """The file as it is read."""
    undo: bool
    """Whether this page has a change to take back."""
    redo: bool
    runs: bool = False
    """Whether the draft is tried: its run begins anew with every edit, and nothing of it is recorded."""
    ended: str = ""
    """Why the newest of its runs ended or was not begun; empty otherwise."""


class Introduction(Struct, frozen=True, kw_only=True, tag="introduction"):
    """Who a visitor is, and where and how large they stand; sent first, and when it changes.

    A point of their room p [m] (x right, y up, z backward) is in the world at
    ``scale · R(turn) · p + position``.
    """

    name: str = ""
    """What others read; ``visitor`` and a number when empty. Recorded only where the run was told to."""
    color: str = ""
    """``#rrggbb``; one of the server's when empty."""
    shape: str = ""
    """Of the head: ``ball``, ``box``, ``cone`` or ``drop``; one of the server's when empty."""
    device: str = "desk"
    """``desk``, ``vr``, ``ar`` or ``program``."""
    human: str = ""
    """Person of the workstation file whom they are; empty for nobody."""
    scale: float = 1.0
    """Metres of the world in a metre of theirs: 10 for a visitor ten times as large."""
    position: Vec3 = (0.0, 0.0, 0.0)
    """Where the floor of their room lies in the world [m]."""
    turn: Vec4 = (1.0, 0.0, 0.0, 0.0)
    """How the axes of their room are turned in the world, unit quaternion, w first."""
    calls: bool = False
    """Whether they ask the others to follow them."""


class Presence(Struct, frozen=True, kw_only=True, tag="presence"):
    """Where a visitor is now, in the world."""

    poses: bytes
    """Little-endian float32, seven each of head, left and right hand: x, y, z [m], w, x, y, z; the axes of
    each are right, up and backward; NaN for what is not there."""
    points: bytes = b""
    """Little-endian float32, x, y, z [m] of joints of body and hands that the device sees."""
    laser: bytes = b""
    """Little-endian float32: from where to where they point, six numbers [m]; empty when they do not."""


class Hold(Struct, frozen=True, kw_only=True, tag="hold"):
    """What a page of `seerob edit` has in its hands: all of it, said again every second.

    What is not said again for two seconds is let go.
    """

    names: tuple[str, ...]
    """Entries of the workstation file by name, such as ``ur10``; none when nothing is held."""


class VisitorInfo(Struct, frozen=True, kw_only=True):
    """One visitor, as all others know them."""

    id: int
    """Number that `Hello.visitor` told them; no other visitor of this server ever has it."""
    role: str
    """``viewer``, ``operator`` or ``supervisor``, as the token says; where none is asked for, ``operator`` of
    whoever is a person and ``supervisor`` of others."""
    introduced: bool
    """Whether they said who they are; if not, name, colour and shape are the server's."""
    name: str
    color: str
    shape: str
    device: str
    human: str
    scale: float
    position: Vec3
    turn: Vec4
    calls: bool
    holds: tuple[str, ...]
    """What nobody else may change meanwhile."""
    recorded: bool = False
    """Whether they were there when what is replayed was recorded; then the number is negative."""


class Grab(Struct, frozen=True, kw_only=True, tag="grab"):
    """What a hand of the person whose headset a page is holds from now on."""

    hand: str
    """Full name: ``operator/right_hand``."""
    piece: str = ""
    """Loose workpiece; empty where it lets go."""


class Pull(Struct, frozen=True, kw_only=True, tag="pull"):
    """A control that somebody pulls, presses or lets go; while it is held, said four times a second."""

    control: str
    value: float
    """In SI; 1 and 0 of a bool."""


class Refused(Struct, frozen=True, kw_only=True, tag="refused"):
    """Why a `Grab` or `Pull` of a page is not taken."""

    what: str
    """Hand or control."""
    reason: str


class Visitors(Struct, frozen=True, kw_only=True, tag="visitors"):
    """Who is there; to whoever has introduced themselves, then and on every change."""

    visitors: tuple[VisitorInfo, ...]


class VisitorPresence(Struct, frozen=True, kw_only=True):
    """Where one visitor is; what they said last, see `Presence`."""

    id: int
    poses: bytes
    points: bytes
    laser: bytes


class Presences(Struct, frozen=True, kw_only=True, tag="presences"):
    """Where all are who said so, in the order of `Visitors`; of several only the newest is sent."""

    visitors: tuple[VisitorPresence, ...]
