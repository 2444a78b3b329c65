"""Who may do what, and who was connected: roles, tokens, addresses that guessed too often, visits.

A visitor of a server that asks for tokens has the role of the one that they know. Where none is asked for,
which only this machine can reach, everything is allowed.

Each goes to the log when it happens, and to whoever records the run. What one visitor or address can make
this remember is bounded.
"""

from __future__ import annotations

import logging
import os
import secrets
import stat
import tomllib
from collections import OrderedDict, deque
from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from enum import StrEnum
from hashlib import sha256
from hmac import compare_digest
from hmac import new as hmac
from ipaddress import IPv6Address, ip_address
from itertools import pairwise
from pathlib import Path
from threading import Lock
from time import monotonic
from typing import NamedTuple, Self

from seerob.core.errors import InputError
from seerob.core.snapshot import Introduction, Presences
from seerob.recording.format import Visitor


class Role(StrEnum):
    """What a token is for."""

    VIEW = "view"
    """Look."""
    TRACK = "track"
    """Look, and offer what a headset sees of a person."""
    CONTROL = "control"
    """Look, and play, pause and seek."""


EVERYTHING = frozenset(Role)
"""Of whoever is asked for no token."""
DIGITS = 32
"""Hexadecimal digits of a token at least: 128 bits."""
DIFFERENT = 8
"""Different digits, and different steps from one to the next, that 32 made at random always have, nearly."""


class Tokens(NamedTuple):
    """What visitors must know, by role."""

    view: str
    track: str
    control: str

    @classmethod
    def made(cls) -> Self:
        """Tokens of 128 random bits each."""
        return cls(*(_made() for _ in Role))

    @classmethod
    def checked(cls, given: dict[str, str], source: object) -> Self:
        """Tokens that somebody gave; a role without one gets a new one.

        Args:
            given: By role.
            source: Where they are from, for messages.

        Raises:
            InputError: One is weak, two are alike, or a role is unknown.
        """
        for name, token in given.items():
            if name not in list(Role):
                remedy = f"give any of {', '.join(Role)}"
                raise InputError.at(source, name, "is no role", remedy)
            if why := weakness(token):
                remedy = "leave it out and seerob makes it, or take what secrets.token_hex(16) gives"
                raise InputError.at(source, name, why, remedy)
        found = cls(*(given.get(role) or _made() for role in Role))
        if len(set(found)) < len(found):
            raise InputError.at(source, "", "two roles have one token", "give each a token of its own")
        return found

    def role(self, token: str) -> Role | None:
        """Whose token it is; None of a wrong one."""
        return matching(token, self)

    def cookie(self, role: Role) -> str:
        """What a browser keeps in place of the token of a role: it proves the token and does not tell it."""
        return hmac(
            self[list(Role).index(role)].encode(), b"seerob page " + role.encode(), sha256
        ).hexdigest()


def matching(said: str, known: Iterable[str]) -> Role | None:
    """The role whose secret somebody said; takes as long for a wrong one."""
    matches = [compare_digest(said.encode(), one.encode()) for one in known]
    return next((role for role, match in zip(Role, matches, strict=True) if match), None)


def _made() -> str:
    while weakness(token := secrets.token_hex(DIGITS // 2)):
        pass
    return token


def weakness(token: str) -> str:
    """Why a token can be guessed; empty when it is like one that was made at random."""
    if len(token) < DIGITS or set(token) - set("0123456789abcdef"):
        return f"is not {DIGITS} or more hexadecimal digits in lower case"
    steps = {ord(b) - ord(a) for a, b in pairwise(token)}
    if min(len(set(token)), len(steps)) < DIFFERENT or token in (token + token)[1:-1]:
        return "was not made at random: digits repeat, or follow one another"
    return ""


def read_tokens(file: Path) -> Tokens:
    """Tokens of a file, ``view = "…"`` and so on; roles without one get one, and a new file is written.

    Raises:
        InputError: It cannot be read or written, others may read it, or a token is weak.
    """
    try:
        try:
            handle = os.open(file, os.O_RDONLY)
        except FileNotFoundError:
            return _written(file, Tokens.made())
        with os.fdopen(handle, "rb") as opened:
            mode = os.fstat(opened.fileno()).st_mode
            text = opened.read(4096).decode()
    except (OSError, UnicodeDecodeError) as error:
        what = f"cannot be read: {getattr(error, 'strerror', None) or 'it is no text'}"
        raise InputError.at(file, "", what, "name a file, or one that does not exist yet") from error
    if os.name == "posix" and stat.S_IMODE(mode) & 0o077:
        what = f"others on this machine may read it (mode {stat.S_IMODE(mode):03o})"
        raise InputError.at(file, "", what, f"chmod 600 {file}")
    try:
        given = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError.at(file, "", str(error), 'write view = "…", track = "…", control = "…"') from None
    return Tokens.checked({name: str(token) for name, token in given.items()}, file)


def _written(file: Path, tokens: Tokens) -> Tokens:
    with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as opened:
        opened.writelines(f'{role} = "{token}"\n' for role, token in zip(Role, tokens, strict=True))
    return tokens


# -- who guesses --------------------------------------------------------------------------------

FREE = 10
"""Wrong tokens of one address before it is locked out."""
FIRST_LOCK, LONGEST_LOCK = 60.0, 900.0
"""How long [s]; doubled from the one to the other with each wrong token that follows."""
FORGOTTEN = 3600.0
"""After which a wrong token does not count any more [s]."""
MOST_ADDRESSES = 1024
"""That are remembered; the oldest is forgotten first."""


def neighbourhood(address: str) -> str:
    """Address of which failures are counted together: one of IPv4, or the 64 bits of an IPv6 network."""
    try:
        found = ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(found, IPv6Address):
        if found.ipv4_mapped is not None:
            return str(found.ipv4_mapped)
        if not found.is_loopback:
            return str(IPv6Address(int(found) >> 64 << 64)) + "/64"
    return str(found)


class _Guesser(NamedTuple):
    failures: int
    until: float
    last: float


class Guesses:
    """Wrong tokens by address, in bounded memory; nobody is locked out for what another address did.

    Args:
        now: Monotonic time [s].
    """

    def __init__(self, now: Callable[[], float] = monotonic) -> None:
        self._now = now
        self._of: OrderedDict[str, _Guesser] = OrderedDict()

    def __len__(self) -> int:
        return len(self._of)

    def locked(self, address: str) -> float:
        """How long an address is locked out from now on [s]; 0 when it is not."""
        found = self._of.get(neighbourhood(address))
        return 0.0 if found is None else max(0.0, found.until - self._now())

    def fail(self, address: str) -> None:
        """Count a wrong token."""
        now, who = self._now(), neighbourhood(address)
        last = self._of.pop(who, _Guesser(0, 0.0, now))
        failures = 1 if now - last.last > FORGOTTEN else last.failures + 1
        lock = 0.0
        if failures >= FREE:
            lock = min(FIRST_LOCK * 2.0 ** min(failures - FREE, 10), LONGEST_LOCK)
        self._of[who] = _Guesser(failures, now + lock, now)
        if len(self._of) > MOST_ADDRESSES:
            self._of.popitem(last=False)


_log = logging.getLogger(__name__)

WAITING = 4096
"""Events that wait for whoever records; the oldest is dropped first."""
MOST_REASONS = 16
MOST_STRANGERS = 256
"""Addresses of which refusals before they came in are counted."""


class Visit:
    """One connected page.

    Args:
        visits: All of them.
        role: What it may do.
        address: Where it is from.
    """

    def __init__(self, visits: Visits, role: str, address: str) -> None:
        self._visits = visits
        self.role, self.address = role, address
        self.since = _now()
        self.refused: dict[str, int] = {}
        self.id = 0
        """Number by which other visitors know it."""
        self.said = Introduction()

    def refuse(self, what: str) -> None:
        """Note that something was asked for and not done; told when it is the first of its kind."""
        if what in self.refused:
            self.refused[what] += 1
        elif len(self.refused) < MOST_REASONS:
            self.refused[what] = 1
            _log.warning("page of %s (%s): refused: %s", self.address, self.role, what)
            self._visits.add(self.event("refused"))

    def introduce(self, said: Introduction) -> None:
        """Note who the visitor is, and where their room stands."""
        self.said = said
        self._visits.add(self.event("introduced"))

    def leave(self) -> None:
        """The page is gone."""
        self._visits.leave(self)

    def event(self, what: str) -> Visitor:
        """What is recorded of it."""
        return Visitor(
            event=what,
            role=self.role,
            address=self.address,
            since=self.since,
            until=_now() if what == "left" else None,
            refused=dict(self.refused),
            id=self.id,
            name=self.said.name if self._visits.names else "",
            device=self.said.device if self.id else "",
            human=self.said.human,
            scale=self.said.scale,
            position=self.said.position,
            turn=self.said.turn,
        )


class Visits:
    """All visitors of a server; written in the server's thread, read from any."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._events: deque[Visitor] = deque(maxlen=WAITING)
        self._present: set[Visit] = set()
        self._strangers: OrderedDict[str, Visit] = OrderedDict()
        self.names = False
        """Whether whoever records is told what visitors call themselves."""
        self._seen: Presences | None = None

    def come(self, role: str, address: str, number: int = 0) -> Visit:
        """Somebody is connected, with a number that no other visitor has."""
        visit = Visit(self, role, address)
        visit.id = number
        with self._lock:
            self._present.add(visit)
            self._events.append(visit.event("came"))
        _log.info("page of %s (%s): connected", address, role)
        return visit

    def leave(self, visit: Visit) -> None:
        """Somebody is no longer connected."""
        with self._lock:
            self._present.discard(visit)
            self._events.append(visit.event("left"))
        _log.info("page of %s (%s): gone, refused %s", visit.address, visit.role, visit.refused or "nothing")

    def turn_away(self, address: str, why: str) -> None:
        """Somebody was not let in."""
        with self._lock:
            visit = self._strangers.get(address)
            if visit is None:
                visit = self._strangers[address] = Visit(self, "none", address)
                if len(self._strangers) > MOST_STRANGERS:
                    self._strangers.popitem(last=False)
        visit.refuse(why)

    def see(self, presences: Presences) -> None:
        """Somebody has moved: where all are."""
        self._seen = presences

    def seen(self) -> Presences | None:
        """Where all are, if anybody has moved since the last call."""
        found, self._seen = self._seen, None
        return found

    def add(self, event: Visitor) -> None:
        """Keep an event for whoever records."""
        with self._lock:
            self._events.append(event)

    def take(self, *, end: bool = False) -> tuple[Visitor, ...]:
        """What happened since the last call; at the ``end`` also who is there still, and all refusals."""
        if not (end or self._events):
            return ()
        with self._lock:
            taken = list(self._events)
            self._events.clear()
            if end:
                taken += [visit.event("there") for visit in self._present]
                taken += [visit.event("refused") for visit in self._strangers.values()]
        return tuple(taken)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
