"""Visitors who see each other: who is there, where they are, and what they hold.

Everybody who is connected is listed; whoever introduces themselves is told of the others. Where they are is
latest wins: it is gathered for a moment, encoded once, and offered to all; a visitor who does not read costs
nobody else a frame.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from itertools import count
from math import hypot, inf, isnan
from struct import Struct, unpack
from time import monotonic

import msgspec
import numpy as np

from seerob.app.server.access import Role, Visit
from seerob.app.server.client import PRESENCES, Client
from seerob.core.printable import printable
from seerob.core.snapshot import (
    Hold,
    Introduction,
    Presence,
    Presences,
    VisitorInfo,
    VisitorPresence,
    Visitors,
)
from seerob.devices.live.headset_offers import SCALES

EVERY = 1 / 30
"""Least time between two messages that say where all are [s]."""
LEASE = 2.0
"""What a page does not say again is let go after so long [s]."""
FARTHEST = 1e4
"""From the origin of the world nobody is farther [m]."""
MOST_POINTS = 160
MOST_HELD = 16
LONGEST_NAME = 40
POSES = 3
"""Head, left and right hand."""
SHAPES = ("ball", "box", "cone", "drop")
DEVICES = ("desk", "vr", "ar", "program")
COLORS = ("#56b4e9", "#e69f00", "#cc79a7", "#f0e442", "#8da0ff", "#ff9e80", "#b3de69", "#d9d9d9")
"""Of who names none: none of them is a verdict's (Okabe and Ito 2008, and lighter ones)."""
TITLES = {Role.VIEW: "viewer", Role.TRACK: "operator", Role.CONTROL: "supervisor"}
"""What people call the role that a token gives."""

_POSE = Struct("<7f")
_FARTHEST_BITS = int(np.float32(FARTHEST).view(np.uint32))
"""A float that is nearer to 0 has fewer; one that is no number has more."""
_COLOR = re.compile(r"#[0-9a-f]{6}")
_encode = msgspec.msgpack.Encoder().encode


def checked(said: Introduction) -> Introduction:
    """What a visitor says of themselves.

    Raises:
        ValueError: It cannot be.
    """
    if len(said.name) > LONGEST_NAME or len(said.human) > 64:
        raise ValueError(f"a name of more than {LONGEST_NAME} characters")
    if said.color and not _COLOR.fullmatch(said.color):
        raise ValueError("a colour is #rrggbb, in lower case")
    if said.shape and said.shape not in SHAPES:
        raise ValueError(f"a shape is one of {', '.join(SHAPES)}")
    if said.device not in DEVICES:
        raise ValueError(f"a device is one of {', '.join(DEVICES)}")
    if not SCALES[0] <= said.scale <= SCALES[1]:
        raise ValueError(f"a scale is from {SCALES[0]:g} to {SCALES[1]:g}")
    if not all(abs(x) <= FARTHEST for x in said.position):
        raise ValueError(f"a place is within {FARTHEST:g} m")
    if not abs(hypot(*said.turn) - 1) < 1e-3:
        raise ValueError("a turn is a unit quaternion")
    return msgspec.structs.replace(said, name=printable(said.name.strip()), human=printable(said.human))


def titled(role: str, human: str) -> str:
    """What people call a visitor: by the role of the token, or where none is asked for by whom they are."""
    found = next((TITLES[one] for one in Role if one.value == role), "")
    return found or ("operator" if human else "supervisor")


def place_mistake(said: Presence | VisitorPresence) -> str:
    """Why a visitor cannot be where they say; empty when they can.

    Raises:
        ValueError: It is no presence.
    """
    if len(said.poses) != 28 * POSES or len(said.points) % 12 or len(said.laser) not in (0, 24):
        raise ValueError("a presence has three poses, points of three numbers and six of a laser")
    if len(said.points) > 12 * MOST_POINTS:
        raise ValueError(f"a presence has {MOST_POINTS} points at most")
    for x, y, z, a, b, c, d in _POSE.iter_unpack(said.poses):
        if isnan(x) and isnan(y) and isnan(z):
            continue
        if not hypot(x, y, z) <= FARTHEST:
            return f"a pose beyond {FARTHEST:g} m, or that is no number"
        if not abs(a * a + b * b + c * c + d * d - 1) < 1e-2:
            return "an orientation that is no unit quaternion"
    more = said.points + said.laser
    # Where all together are near, each is; and it is no number where one is none.
    if more and not hypot(*unpack(f"<{len(more) // 4}f", more)) <= FARTHEST:
        numbers = np.frombuffer(more, "<u4")
        # As integers, so that a number that is none is no matter for whoever is told of such.
        if int((numbers & 0x7FFFFFFF).max()) > _FARTHEST_BITS:
            return f"a point beyond {FARTHEST:g} m, or that is no number"
    return ""


@dataclass(eq=False)
class Companion:
    """One visitor among others."""

    id: int
    client: Client
    visit: Visit
    rights: frozenset[Role]
    said: Introduction | None = None
    presence: VisitorPresence | None = None
    holds: dict[str, float] = field(default_factory=dict)
    """Until when [s], monotonic time, by name."""

    @property
    def name(self) -> str:
        """What others call them."""
        return (self.said.name if self.said else "") or f"visitor {self.id}"

    def info(self) -> VisitorInfo:
        """What all know of them."""
        said = self.said or Introduction(device="program")
        return VisitorInfo(
            id=self.id,
            role=titled(self.visit.role, said.human),
            introduced=self.said is not None,
            name=self.name,
            color=said.color or COLORS[self.id % len(COLORS)],
            shape=said.shape or SHAPES[self.id % len(SHAPES)],
            device=said.device,
            human=said.human,
            scale=said.scale,
            position=said.position,
            turn=said.turn,
            calls=said.calls,
            holds=tuple(self.holds),
        )


class Company:
    """All visitors of a server; everything here runs in the server's loop.

    Args:
        see: Is told where all are, whenever the others are.
    """

    def __init__(self, see: Callable[[Presences], None] = lambda _: None) -> None:
        self._see = see
        self._of: dict[Client, Companion] = {}
        self._recorded: tuple[VisitorInfo, ...] = ()
        self._recorded_presences: tuple[VisitorPresence, ...] = ()
        self._numbers = count(1)
        self._told = -inf
        self._due: asyncio.TimerHandle | None = None
        self._release: asyncio.TimerHandle | None = None

    def come(self, client: Client, visit: Visit, rights: frozenset[Role], number: int) -> None:
        """Somebody is connected."""
        self._of[client] = Companion(number, client, visit, rights)
        self._tell()

    def number(self) -> int:
        """Of the next visitor."""
        return next(self._numbers)

    def gone(self, client: Client) -> None:
        """Somebody has left; what they held is free, and nobody sees them any more."""
        if self._of.pop(client, None) is not None:
            self._tell()
            self._soon()

    def introduce(self, client: Client, said: Introduction) -> None:
        """Somebody says who they are; they are told of the others from now on.

        Raises:
            ValueError: It cannot be.
        """
        one = self._of[client]
        said = checked(said)
        if said.human and Role.TRACK not in one.rights:
            one.visit.refuse("to be a person")
            said = msgspec.structs.replace(said, human="")
        first, one.said = one.said is None, said
        one.visit.introduce(said)
        self._tell()
        if first:
            client.offer(PRESENCES, _encode(self._presences()))

    def move(self, client: Client, said: Presence) -> None:
        """Somebody says where they are.

        Raises:
            ValueError: It contradicts itself.
        """
        one = self._of[client]
        if mistake := place_mistake(said):
            one.visit.refuse(f"presence: {mistake}")
            return
        one.presence = VisitorPresence(id=one.id, poses=said.poses, points=said.points, laser=said.laser)
        self._soon()

    def recall(self, visitors: tuple[VisitorInfo, ...], presences: tuple[VisitorPresence, ...]) -> None:
        """Who was there when it was recorded, and where, at the instant that is shown."""
        if visitors != self._recorded:
            self._recorded = visitors
            self._tell()
        if presences != self._recorded_presences:
            self._recorded_presences = presences
            self._soon()

    def hold(self, client: Client, said: Hold, *, may: bool) -> None:
        """Somebody says what they hold; what another holds is not theirs.

        Raises:
            ValueError: It cannot be.
        """
        if len(said.names) > MOST_HELD or max(map(len, said.names), default=0) > 200:
            raise ValueError(f"{MOST_HELD} things with names of 200 characters are held at most")
        one = self._of[client]
        if not may:
            one.visit.refuse("hold")
            return
        until, before = monotonic() + LEASE, tuple(one.holds)
        one.holds = {}
        for name in map(printable, said.names):
            if other := self.holder(name, but=client):
                one.visit.refuse(f"hold: {name[:60]}, held by visitor {other.id}")
            else:
                one.holds[name] = until
        if tuple(one.holds) != before:
            self._tell()
        if self._release is None and one.holds:
            self._release = asyncio.get_running_loop().call_later(LEASE / 4, self._let_go)

    def holder(self, name: str, *, but: Client) -> Companion | None:
        """Who else holds something."""
        now = monotonic()
        every = (one for one in self._of.values() if one.client is not but)
        return next((one for one in every if one.holds.get(name, -inf) > now), None)

    def held_by_another(self, client: Client, names: Collection[str]) -> str:
        """Why a page may not change things of these names; empty when it may."""
        for name in sorted(names):
            if other := self.holder(name, but=client):
                return f"{name} is in the hands of {other.name}"
        return ""

    def _let_go(self) -> None:
        self._release, now, changed = None, monotonic(), False
        for one in self._of.values():
            kept = {name: until for name, until in one.holds.items() if until > now}
            changed |= len(kept) < len(one.holds)
            one.holds = kept
        if changed:
            self._tell()
        if any(one.holds for one in self._of.values()):
            self._release = asyncio.get_running_loop().call_later(LEASE / 4, self._let_go)

    def _tell(self) -> None:
        listeners = [one.client for one in self._of.values() if one.said is not None]
        if listeners:
            payload = _encode(
                Visitors(visitors=(*(one.info() for one in self._of.values()), *self._recorded))
            )
            for client in listeners:
                client.offer("Visitors", payload)

    def _presences(self) -> Presences:
        there = (one.presence for one in self._of.values() if one.presence is not None)
        return Presences(visitors=(*there, *self._recorded_presences))

    def _soon(self) -> None:
        """Say where all are with the next frame, or as soon as it may be said again."""
        if self._due is None:
            wait = max(0.0, self._told + EVERY - monotonic())
            self._due = asyncio.get_running_loop().call_later(wait, self.show)

    def show(self, *, with_frame: bool = False) -> None:
        """Say where all are, if anybody has moved; with a frame that comes next, which is then one write."""
        if self._due is None:
            return
        self._due.cancel()
        self._due, self._told = None, monotonic()
        presences = self._presences()
        self._see(presences)
        payload = _encode(presences)
        for one in self._of.values():
            if one.said is not None:
                (one.client.put if with_frame else one.client.offer)(PRESENCES, payload)
