"""Siemens PLCs through their own web server (S7 web API): variables by their symbolic names."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import defaultdict, deque
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar
from urllib.parse import urlsplit

from msgspec import Meta

from seerob.core.errors import InputError, Problem
from seerob.core.extras import need
from seerob.core.host_name import is_loopback
from seerob.core.quantities import Seconds
from seerob.core.snapshot import Finding
from seerob.devices.variables.access import missing_access
from seerob.devices.variables.live_source import Change, Node, VariablesSource
from seerob.protocols import NotLetIn, ProtocolError
from seerob.protocols.links.credentials import Server, secret, server_of, trusting
from seerob.protocols.links.http_answer import Question
from seerob.protocols.plc import s7_web
from seerob.workstation.source import Opened, Target
from seerob.workstation.variables import Variable

if TYPE_CHECKING:
    import httpx

PATIENCE = 2.0
"""With each answer [s]."""
MOST_LEFT = 8
"""Sessions that are given back once the PLC is there again."""
DEEPEST = 4
"""Levels that `browse` goes down."""


class SiemensWeb(VariablesSource, frozen=True, kw_only=True):
    """Variables of a Siemens PLC, asked through its web server."""

    loads: ClassVar[tuple[str, ...]] = ("httpx",)
    by_exception: ClassVar[bool] = False

    url: Annotated[
        str, Meta(pattern=r"^https?://[^/\s]+/?$", description="an address such as https://192.168.0.1")
    ]
    """``https://192.168.0.1``; unencrypted only to this machine itself."""
    user: str
    """A user of the PLC who may read."""
    password_env: str
    """Environment variable that holds the password: a workstation file is no place for one."""
    ca: str | None = None
    """The PLC's own certificate, or that of who signed it: a PEM file beside the workstation."""
    every: Seconds = 0.2
    """Interval between questions [s]; a PLC answers 2 to 10 times a second."""

    def __post_init__(self) -> None:
        super().__post_init__()
        parts = urlsplit(self.url)
        if parts.scheme == "http" and not is_loopback(parts.hostname or ""):
            raise ValueError(f"url = {self.url!r} would send a password unencrypted: write https://")

    @property
    def _server(self) -> Server:
        return server_of(self.url, encrypted=self.url.startswith("https:"))

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return self.every

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Check the addresses, and log in once, if it can be reached.

        Raises:
            InputError: An address that is no text, no password, no certificate file.
        """
        where = f"siemens_web {self.url}"
        problems = [
            Problem(where, f"{v.name}.address", f"{v.address!r} is no name", r'write "\"Belt\".speed"')
            for v in (() if target is None else target.variables)
            if not isinstance(v.address, str) or not v.address
        ]
        problems += missing_access(self, folder, where=where, server=self._server)
        if problems:
            raise InputError(problems)
        return VariablesSource.open(self.beside(folder), folder, target)

    def sampling_gap(self) -> float:
        """Between two questions."""
        return self.every

    def times(self, variable: Variable) -> bool:
        """It is asked."""
        return True

    async def ask(self) -> tuple[Finding, ...]:
        """Log in and out."""
        async with self._session(Path()):
            text = f"variables asked from {self.url} every {self.every:g} s"
            return (Finding(level="note", subject=self.name or "siemens_web", text=text),)

    async def changes(
        self, variables: tuple[Variable, ...], folder: Path
    ) -> AsyncGenerator[tuple[Change, ...], None]:
        """Every variable, asked again and again."""
        names, addresses = [v.name for v in variables], [v.address for v in variables]
        clock = asyncio.get_running_loop()
        async with self._session(folder) as session:
            due = clock.time()
            parts = [addresses[k : k + s7_web.MOST] for k in range(0, len(addresses), s7_web.MOST)]
            questions = [(session.question(s7_web.reading(part)), len(part)) for part in parts]
            while True:
                asked = time.monotonic()
                said: list[tuple[object, str]] = []
                for question, count in questions:
                    said += s7_web.results(await question.answer(), count)
                age = time.monotonic() - asked
                yield tuple(
                    Change(n, raw, invalid_reason, age)
                    for n, (raw, invalid_reason) in zip(names, said, strict=True)
                )
                # What was asked late is not made up for.
                due = max(due + self.every, clock.time())
                await asyncio.sleep(due - clock.time())

    async def browse(self) -> AsyncGenerator[Node, None]:
        """The variables of the PLC's program, four levels down."""
        async with self._session(Path()) as session:
            waiting = [("", 0)]
            while waiting:
                address, depth = waiting.pop()
                found = s7_web.result(await session.post(s7_web.browsing(address)))
                for entry in found if isinstance(found, list) else ():
                    name = str(entry.get("name", "")) if isinstance(entry, dict) else ""
                    if not name:
                        continue
                    below = f"{address}.{name}" if address else f'"{name}"'
                    if entry.get("has_children") and depth < DEEPEST:
                        waiting.append((below, depth + 1))
                    elif not entry.get("has_children"):
                        yield Node(below, str(entry.get("datatype", "")), "", "")

    async def write(self, variable: Variable, raw: bool, folder: Path) -> None:
        """Write one bool; called by `seerob.session.writing` alone."""
        async with self._session(folder) as session:
            s7_web.result(await session.post(s7_web.writing(variable.address, raw)))

    @asynccontextmanager
    async def _session(self, folder: Path) -> AsyncGenerator[_Session, None]:
        need("httpx")
        import httpx

        context = trusting(None if self.ca is None else folder / self.ca, server=self.url)
        async with httpx.AsyncClient(verify=context, timeout=PATIENCE, trust_env=False) as client:
            session = _Session(client, self.url.rstrip("/") + s7_web.PATH)
            await _give_back(session)
            password = secret("password_env", self.password_env, self._server)
            said = await session.post(s7_web.login(self.user, password))
            try:
                found = s7_web.result(said)
            except ProtocolError as error:
                raise NotLetIn(f"login of {self.user!r}: {error}") from error
            token = found.get("token") if isinstance(found, dict) else None
            if not isinstance(token, str):
                raise ProtocolError("logged in without a token")
            session.token = token
            try:
                yield session
            finally:
                # A PLC has few sessions, and keeps a forgotten one for minutes.
                try:
                    s7_web.result(await session.post(s7_web.logout()))
                except (OSError, ProtocolError):
                    _left[session.url].append(token)


_left: defaultdict[str, deque[str]] = defaultdict(lambda: deque(maxlen=MOST_LEFT))
"""Sessions of each PLC that a lost connection has left open."""


async def _give_back(session: _Session) -> None:
    """Log out of what a lost connection has left: else a few losses would take all sessions."""
    left = _left[session.url]
    while left:
        session.token = left[0]
        with contextlib.suppress(ProtocolError):
            await session.post(s7_web.logout())
        left.popleft()
    session.token = ""


class _Session:
    def __init__(self, client: httpx.AsyncClient, url: str) -> None:
        self._client, self.url = client, url
        self.token = ""

    async def post(self, data: bytes) -> bytes:
        """The answer to a request.

        Raises:
            OSError: There is none.
            ProtocolError: It is too large, or no success.
        """
        return await self.question(data).answer()

    def question(self, data: bytes) -> Question:
        """A request that may be sent again and again, while it is logged in."""
        headers = {"Content-Type": "application/json"} | ({s7_web.TOKEN: self.token} if self.token else {})
        return Question(self._client, "POST", self.url, who="the PLC", headers=headers, content=data)
