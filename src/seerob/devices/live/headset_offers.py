"""Where pages that offer what a headset sees, and sources that wait for it, find each other.

The server's thread offers, a source's thread takes; the run that has both hands the server's `Offers` to its
sources. One page per person: whoever offers first, until it falls silent or leaves.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING, Annotated, NamedTuple, Protocol, runtime_checkable

import numpy as np
from msgspec import Meta, Struct

from seerob.core.samples import Placing
from seerob.core.snapshot import Grab, Pull, Tracking
from seerob.core.transforms import Array
from seerob.devices.live.doings import Doings

if TYPE_CHECKING:
    from seerob.devices.live.listening import LiveSource

HELD = 2.0
"""A page that offers nothing for so long loses its place [s]."""
BACK = 3.0
"""Whoever waited in vain is back within that [s]: longer than a source that fails pauses."""
SHORTEST = 0.003
"""Offers of a page that follow one another faster are left out [s]; headsets do 60 to 144 Hz."""
MOST_NAMES = 160
LONGEST_NAME = 64
Angle = Annotated[float, Meta(ge=0, le=0.5, extra={"unit": "rad"}, extra_json_schema={"x-unit": "rad"})]
Metres = Annotated[float, Meta(ge=0, le=0.5, extra={"unit": "m"}, extra_json_schema={"x-unit": "m"})]
SCALES = (0.01, 100.0)
"""How large visitors may be: metres of the world in one of theirs."""


class Offer(NamedTuple):
    """What a headset sees at one instant, as it came: y up."""

    arrived: float
    """Host's monotonic time [s]."""
    t: float
    """On the page's clock [s]."""
    names: tuple[str, ...]
    positions: Array
    """[m], shape (n, 3)."""
    wxyz: Array
    """Shape (n, 4)."""
    guessed: tuple[bool, ...]
    space: str = ""
    """Which tracking space that is."""
    cell_from_room: Array | None = None
    """Where that lies, x ahead and z up in it, shape (4, 4), as was found out; None where the file says."""
    placing: Placing | None = None
    """How well that is known; None where what the file says is exact."""
    scale: float = 1.0
    """Metres of the world in a metre of the visitor, as they see it."""
    stands: str = ""
    """``tpose`` or ``npose`` while the visitor says that they stand so."""
    wearer: int = 0
    """Counts the visitors who were that person."""


class Registering(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the room of a headset is put in the cell; errors are standard deviations per axis."""

    level: Angle | None = None
    """How far the vertical of the headset may be from that of the cell [rad]; without it the tilt is found
    from what is touched, which takes more and farther touches."""
    touch: Metres | None = None
    """Error of one touch [m]; when not given, how well touches agree tells, and fewer count less."""
    pose: Metres | None = None
    """Error of where the device sees its controller [m], for one that lies at a known place."""
    pose_turn: Angle | None = None
    """Error of how the device sees it turned [rad]."""
    at: Metres | None = None
    """How far the floor of the room may be from the source's ``at`` [m], where that was measured."""
    at_turn: Angle | None = None
    """How far it may be turned from there [rad]."""
    limit: Annotated[float, Meta(gt=0, le=0.5, extra={"unit": "m"}, extra_json_schema={"x-unit": "m"})] = 0.05
    """Error at the tool, 95 %, beyond which nothing rests on where the person is [m]; a choice."""


class Room(NamedTuple):
    """Where the room of a page's headset lies in the cell."""

    visitor: object
    space: str
    cell_from_room: Array
    placing: Placing


NOT_REGISTERED = (
    "nobody found out where the room of this headset lies in the real cell: register it (docs/xr.md)"
)


class Held(NamedTuple):
    """Who offers for a person."""

    visitor: object
    last: float
    wearer: int


class Fit(NamedTuple):
    """What the newest calibration of a visitor found that they asked for."""

    accepted: bool
    text: str
    taller: float | None
    """How many times as tall as the person of the file."""


POSES = ("", "tpose", "npose")


def read(tracking: Tracking, now: float) -> Offer:
    """The offer in a message.

    Raises:
        ValueError: It contradicts itself, or is too large.
    """
    n = len(tracking.names)
    if not 0 < n <= MOST_NAMES or len(set(tracking.names)) < n:
        raise ValueError(f"tracking of {n} names: 1 to {MOST_NAMES} different ones are expected")
    if max(map(len, (tracking.human, tracking.space, *tracking.names))) > LONGEST_NAME:
        raise ValueError(f"a name of more than {LONGEST_NAME} characters")
    if len(tracking.poses) != 28 * n or len(tracking.guessed) not in (0, n):
        raise ValueError(f"tracking of {n} names with {len(tracking.poses)} bytes of poses")
    if not (math.isfinite(tracking.t) and tracking.t >= 0):
        raise ValueError("tracking without a time")
    if not SCALES[0] <= tracking.scale <= SCALES[1]:
        raise ValueError(f"a scale is from {SCALES[0]:g} to {SCALES[1]:g}")
    if tracking.stands not in POSES:
        raise ValueError("tracking in a pose that nobody knows")
    with np.errstate(invalid="ignore"):  # a signalling NaN is one more NaN
        rows = np.frombuffer(tracking.poses, "<f4").reshape(n, 7).astype(float)
    guessed = tuple(map(bool, tracking.guessed)) or (False,) * n
    turns = rows[:, 3:]
    return Offer(
        now, tracking.t, tracking.names, rows[:, :3], turns, guessed, tracking.space,
        scale=tracking.scale, stands=tracking.stands,
    )  # fmt: skip


class Offers:
    """The place where they meet; safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._waiting: dict[str, dict[object, Callable[[Offer], None]]] = {}
        self._held: dict[str, Held] = {}
        self._fits: dict[str, Fit] = {}
        self._wearers = 0
        self.doings = Doings()
        """What visitors do besides."""
        self._rooms: dict[str, Room] = {}
        self._registering: dict[str, Registering] = {}
        self._back: dict[str, float] = {}
        """Until when [s] a source that heard nobody is about to wait anew, by person."""
        self.mixed = False
        """Whether something of the cell is real: then where a room lies has an error, or is not known."""

    def wait(
        self,
        human: str,
        key: object,
        take: Callable[[Offer], None],
        registering: Registering = Registering(),  # noqa: B008 (frozen)
    ) -> None:
        """Have every offer for a person given to ``take``, in the server's thread; it must not block."""
        with self._lock:
            self._registering[human] = registering
            self._fits.pop(human, None)
            self._back.pop(human, None)
            self._waiting.setdefault(human, {})[key] = take

    def silent(self, human: str) -> None:
        """Know that whoever waits for a person has heard nobody for long, says so, and waits anew at once."""
        with self._lock:
            self._back[human] = now() + BACK

    def was_silent(self, human: str) -> bool:
        """Whether whoever waited for a person a moment ago heard nobody: then nobody has to be told again."""
        with self._lock:
            return now() <= self._back.get(human, -math.inf)

    def leave(self, human: str, key: object) -> None:
        """Wait no longer."""
        with self._lock:
            takers = self._waiting.get(human, {})
            takers.pop(key, None)
            if not takers:
                self._waiting.pop(human, None)

    def offer(self, human: str, visitor: object, offer: Offer) -> str:
        """Give an offer to whoever waits for it.

        Args:
            human: Name of the person.
            visitor: The page.
            offer: What it says.

        Returns:
            Why nobody takes it; empty when somebody does, or will in a moment.
        """
        with self._lock:
            takers = list(self._waiting.get(human, {}).values())
            if not takers and offer.arrived <= self._back.get(human, -math.inf):
                return ""
            if not takers:
                return f"nothing in this run waits for a headset of {human!r}"
            held = self._held.get(human)
            if held is not None and held.visitor is not visitor and offer.arrived - held.last < HELD:
                return f"another page is the headset of {human!r}"
            if held is not None and held.visitor is visitor and offer.arrived - held.last < SHORTEST:
                return ""
            if held is None or held.visitor is not visitor:
                self._wearers += 1
                self._fits.pop(human, None)
                held = Held(visitor, offer.arrived, self._wearers)
            self._held[human] = held._replace(last=offer.arrived)
            offer = offer._replace(wearer=held.wearer)
            room = self._rooms.get(human)
            if room is not None and room.visitor is visitor and room.space == offer.space:
                offer = offer._replace(cell_from_room=room.cell_from_room, placing=room.placing)
            elif self.mixed:
                offer = offer._replace(placing=Placing(reason=NOT_REGISTERED))
        for take in takers:
            take(offer)
        return ""

    def do(self, visitor: object, what: Grab | Pull) -> str:
        """Give what a visitor does in the room to whoever waits for it.

        Returns:
            Why nobody takes it; empty when somebody does.

        Raises:
            ValueError: It is too long, or no number.
        """
        if isinstance(what, Grab):
            human = what.hand.partition("/")[0]
            with self._lock:
                held = self._held.get(human)
            if held is None or held.visitor is not visitor:
                return f"this page is not the headset of {human!r}, whose hand that is"
        return self.doings.do(visitor, what)

    def fit(self, human: str, found: Fit) -> None:
        """Know what a calibration of a person found that their visitor asked for."""
        with self._lock:
            self._fits[human] = found

    def fit_of(self, human: str, visitor: object) -> Fit | None:
        """What the newest calibration of a visitor found; None when they are not that person or had none."""
        with self._lock:
            held = self._held.get(human)
            return self._fits.get(human) if held is not None and held.visitor is visitor else None

    def registering(self, human: str) -> Registering:
        """What the file says of how the room of a person's headset is put in the cell."""
        with self._lock:
            return self._registering.get(human, Registering())

    def place(self, human: str, room: Room | None, visitor: object) -> None:
        """Know from now on where a visitor's room lies; None for not any more."""
        with self._lock:
            before = self._rooms.get(human)
            if room is not None:
                self._rooms[human] = room
            elif before is not None and before.visitor is visitor:
                del self._rooms[human]

    def gone(self, visitor: object) -> None:
        """A page has left: its places are free."""
        self.doings.gone(visitor)
        with self._lock:
            self._held = {human: held for human, held in self._held.items() if held.visitor is not visitor}
            self._rooms = {human: room for human, room in self._rooms.items() if room.visitor is not visitor}


@runtime_checkable
class HasOffers(Protocol):
    """A writer of a run whose pages may offer what a headset sees."""

    offers: Offers


@runtime_checkable
class TakesOffers(Protocol):
    """A source that hears what such pages offer."""

    def taking(self, offers: Offers) -> LiveSource:
        """This source, which takes what is offered there."""


def now() -> float:
    """Host's monotonic time [s]."""
    return time.monotonic()
