"""Machines that tell their variables as JSON documents: a URL that is asked, or a WebSocket that is heard."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncGenerator, Iterator, Mapping
from contextlib import aclosing
from pathlib import Path
from typing import Annotated, Any, ClassVar
from urllib.parse import urljoin, urlsplit

import msgspec
from msgspec import Meta

from seerob.core.errors import InputError, Problem
from seerob.core.extras import need
from seerob.core.host_name import is_loopback
from seerob.core.quantities import Seconds
from seerob.core.snapshot import Finding
from seerob.devices.variables.access import missing_access
from seerob.devices.variables.json_values import value_and_time
from seerob.devices.variables.live_source import Change, Node, VariablesSource
from seerob.protocols import ProtocolError
from seerob.protocols.links.credentials import Server, secret, server_of, trusting
from seerob.protocols.links.http_answer import LARGEST, Question
from seerob.protocols.links.json_pointer import document, parts
from seerob.protocols.links.websocket_link import linked_to
from seerob.workstation.source import Opened, Target
from seerob.workstation.variables import Variable

PATIENCE = 2.0
"""With each answer [s]."""
SILENCE = 5.0
"""A WebSocket that says nothing for so long is connected anew [s]."""
MOST_PATHS = 20
"""Documents that are asked for, one after the other."""
DEEPEST, MOST_NODES = 12, 5000
"""Levels of a document in which `browse` looks for values, and values that it names at most."""

Url = Annotated[
    str,
    Meta(
        pattern=r"^(https?|wss?)://[^/\s?#]+(/[^\s#]*)?$",
        max_length=500,
        description="an address that begins with http://, https://, ws:// or wss://",
    ),
]


class Spot(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a variable is."""

    pointer: Annotated[str, Meta(max_length=500)]
    """JSON pointer to the value."""
    path: Annotated[
        str, Meta(max_length=500, pattern=r"^[^\s#]*$", description="a path without blanks and #")
    ] = ""
    """Path of another document, relative to ``url``; not with a WebSocket."""
    time: Annotated[str, Meta(max_length=500)] | None = None
    """JSON pointer to when it was so: seconds or milliseconds since 1970, or an ISO 8601 text."""

    def __post_init__(self) -> None:
        parts(self.pointer)
        parts(self.time or "")


def spot(raw: object) -> Spot:
    """Where a variable is: ``"/belt/speed"``, or ``{ pointer = …, path = …, time = … }``.

    Raises:
        ValueError: It cannot be understood.
    """
    if isinstance(raw, str):
        return Spot(raw)
    if isinstance(raw, dict):
        return msgspec.convert(raw, Spot)
    raise ValueError('write "/belt/speed" or { pointer = …, path = …, time = … }')


class Web(VariablesSource, frozen=True, kw_only=True):
    """Variables of machines that tell them as JSON documents, over HTTP or by WebSocket."""

    loads: ClassVar[tuple[str, ...]] = ("httpx", "websockets.asyncio.client")
    by_exception: ClassVar[bool] = False

    url: Url
    """``https://192.168.0.7/api/state`` is asked; ``wss://192.168.0.7/live`` is listened to."""
    every: Seconds = 0.2
    """Interval between questions [s], over HTTP."""
    hello: Annotated[str, Meta(max_length=10_000)] | None = None
    """Text that is sent to a WebSocket once it is open, to ask it for what it has."""
    token_env: str | None = None
    """Environment variable that holds a token: a workstation file is no place for one."""
    header: Annotated[
        str, Meta(pattern=r"^[A-Za-z0-9\-]+$", max_length=100, description="letters, digits and -")
    ] = "Authorization"
    """Header that the token is sent in."""
    scheme: Annotated[
        str, Meta(pattern=r"^[A-Za-z0-9\-]*$", max_length=50, description="letters, digits and -")
    ] = "Bearer"
    """Word before the token; nothing when empty."""
    ca: str | None = None
    """Certificates that are trusted instead of the system's, a PEM file beside the workstation."""

    def __post_init__(self) -> None:
        super().__post_init__()
        asked = urlsplit(self.url)
        if self.token_env is not None and not self._encrypted and not is_loopback(asked.hostname or ""):
            raise ValueError(f"url = {self.url!r} would send a token unencrypted: write https:// or wss://")
        if "@" in asked.netloc:
            raise ValueError("url holds a password: put a token into an environment variable, token_env")
        if self.hello is not None and not self._pushed:
            raise ValueError("hello is sent to a WebSocket: write ws:// or wss://, or remove it")

    @property
    def _encrypted(self) -> bool:
        return urlsplit(self.url).scheme in ("https", "wss")

    @property
    def _server(self) -> Server:
        return server_of(self.url, encrypted=self._encrypted)

    @property
    def _pushed(self) -> bool:
        return urlsplit(self.url).scheme in ("ws", "wss")

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return VariablesSource.period(self) if self._pushed else self.every

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Understand every address, and ask once, if it can be reached.

        Raises:
            InputError: With every address that cannot be understood, and what is not there.
        """
        where, problems = f"web {self.url}", []
        spots = set()
        for variable in () if target is None else target.variables:
            try:
                found = spot(variable.address)
                spots.add(found.path)
                if self._pushed and found.path:
                    raise ValueError("a WebSocket has no paths: leave path out")
                self._place(found.path)
            except (ValueError, msgspec.ValidationError) as error:
                problems.append(Problem(where, f"{variable.name}.address", str(error)))
        if len(spots) > MOST_PATHS:
            problems.append(Problem(where, "address", f"{len(spots)} paths", f"at most {MOST_PATHS}"))
        problems += missing_access(self, folder, where=where, server=self._server, env="token_env")
        if problems:
            raise InputError(problems)
        return VariablesSource.open(self.beside(folder), folder, target)

    def sampling_gap(self) -> float:
        """Between two questions, over HTTP."""
        return 0.0 if self._pushed else self.every

    def times(self, variable: Variable) -> bool:
        """It is asked, or the document says when it was so."""
        return not self._pushed or spot(variable.address).time is not None

    def stamps(self, variable: Variable) -> bool:
        """Where the document says when it was so."""
        return spot(variable.address).time is not None

    async def ask(self) -> tuple[Finding, ...]:
        """Hear one document."""
        async with aclosing(self._documents(("",), Path())) as documents:
            await anext(documents)
        how = "heard from" if self._pushed else f"asked every {self.every:g} s from"
        return (Finding(level="note", subject=self.name or "web", text=f"variables {how} {self.url}"),)

    async def changes(
        self, variables: tuple[Variable, ...], folder: Path
    ) -> AsyncGenerator[tuple[Change, ...], None]:
        """What each document says of each variable."""
        spots = {v.name: spot(v.address) for v in variables}
        paths = tuple(dict.fromkeys(s.path for s in spots.values())) or ("",)
        async with aclosing(self._documents(paths, folder)) as documents:
            async for path, said, took in documents:
                wanted = {name: s for name, s in spots.items() if s.path == path}
                yield tuple(self._changes(wanted, said, took))

    def _changes(self, wanted: Mapping[str, Spot], said: Any, took: float) -> Iterator[Change]:
        now = time.time()
        for name, where in wanted.items():
            if isinstance(said, ProtocolError):
                yield Change(name, None, invalid_reason=str(said))
                continue
            try:
                value, age, stamp = value_and_time(said, where.pointer, where.time, now=now)
                yield Change(name, value, age=max(age, took), stamp=stamp)
            except KeyError as error:
                # Of what is pushed, a document may tell a part; what stays out grows old.
                if not self._pushed:
                    yield Change(
                        name, None, invalid_reason=f"the document has no {error.args[0]!r} ({where.pointer})"
                    )
            except ValueError as error:
                yield Change(name, None, invalid_reason=str(error))

    def _place(self, path: str) -> str:
        """The URL of a path, on the same server.

        Raises:
            ValueError: It leads elsewhere: a token is not sent there.
        """
        found = urljoin(self.url, path)
        if urlsplit(found)[:2] != urlsplit(self.url)[:2]:
            raise ValueError(f"path = {path!r} leads to another server: give it a source of its own")
        return found

    async def _documents(
        self, paths: tuple[str, ...], folder: Path
    ) -> AsyncGenerator[tuple[str, Any, float], None]:
        """Documents by path as they come, and how long ago they were asked for [s].

        In place of one with which something is wrong, what that is.
        """
        found: AsyncGenerator[tuple[str, bytes | str | ProtocolError, float], None]
        found = self._heard(folder) if self._pushed else self._asked(paths, folder)
        async with aclosing(found):
            async for path, data, took in found:
                try:
                    yield path, data if isinstance(data, ProtocolError) else document(data), took
                except ProtocolError as error:
                    yield path, error, took

    async def _asked(
        self, paths: tuple[str, ...], folder: Path
    ) -> AsyncGenerator[tuple[str, bytes | str | ProtocolError, float], None]:
        need("httpx")
        import httpx

        clock = asyncio.get_running_loop()
        verify = self._context(folder)
        async with httpx.AsyncClient(verify=verify, timeout=PATIENCE, trust_env=False) as client:
            due = clock.time()
            headers = {"Accept": "application/json"} | self._headers()
            questions = [
                (path, Question(client, "GET", self._place(path), who="the server", headers=headers))
                for path in paths
            ]
            while True:
                for path, question in questions:
                    try:
                        asked = time.monotonic()
                        said = await question.answer()
                        yield path, said, time.monotonic() - asked
                    except ProtocolError as error:
                        if len(paths) == 1:
                            raise
                        yield path, error, 0.0
                # What was asked late is not made up for.
                due = max(due + self.every, clock.time())
                await asyncio.sleep(due - clock.time())

    async def _heard(
        self, folder: Path
    ) -> AsyncGenerator[tuple[str, bytes | str | ProtocolError, float], None]:
        tls = self._context(folder) if self._encrypted else None
        async with linked_to(
            self.url, largest=LARGEST, what="WebSocket", headers=self._headers(), tls=tls
        ) as link:
            if self.hello is not None:
                await link.send(self.hello)
            while True:
                try:
                    heard = await link.receive(SILENCE)
                except TimeoutError as error:
                    raise TimeoutError(f"nothing said for {SILENCE:g} s") from error
                if heard is None:
                    raise ConnectionError("the server closed the connection")
                yield "", heard[1], 0.0

    def _headers(self) -> dict[str, str]:
        if self.token_env is None:
            return {}
        return {self.header: f"{self.scheme} {secret('token_env', self.token_env, self._server)}".strip()}

    def _context(self, folder: Path) -> Any:
        return trusting(None if self.ca is None else folder / self.ca, server=self.url)

    async def browse(self) -> AsyncGenerator[Node, None]:
        """The values of the first document, by their pointers."""
        async with aclosing(self._documents(("",), Path())) as documents:
            _, said, _ = await anext(documents)
        if isinstance(said, ProtocolError):
            raise said
        for node in leaves(said):
            yield node


def leaves(value: Any, pointer: str = "", depth: int = 0, left: list[int] | None = None) -> Iterator[Node]:
    """Every value of a document that is no table and no list, `MOST_NODES` at most."""
    left = [MOST_NODES] if left is None else left
    inside: Iterator[tuple[str, Any]] = iter(())
    if isinstance(value, dict):
        inside = ((key.replace("~", "~0").replace("/", "~1"), below) for key, below in value.items())
    elif isinstance(value, list):
        inside = ((str(k), below) for k, below in enumerate(value))
    else:
        if left[0] > 0:
            left[0] -= 1
            kind = {bool: "bool", str: "text"}.get(type(value), "")
            yield Node(pointer, kind, "", json.dumps(value)[:40])
        return
    if depth < DEEPEST:
        for key, below in inside:
            yield from leaves(below, f"{pointer}/{key}", depth + 1, left)
