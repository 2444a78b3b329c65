"""What sources of machine variables share: values that come one by one become one picture of them all.

A device says what changes, or is asked again and again. Either way a sample is everything that is known
of its variables now, in SI and under the dictionary's names; what is too old, what the device calls bad
and what cannot be is a doubt with its reason.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing
from pathlib import Path
from typing import ClassVar, NamedTuple, Self

from msgspec.structs import replace

from seerob.live import LiveSource
from seerob.quantities import Seconds
from seerob.samples import Sample, SignalSample
from seerob.source import Target
from seerob.variables.dictionary import BadValue, Value, Variable

BEAT = 0.05
"""A sample is sent at least this often while there is a connection [s]: no news is news, too."""


FILES = ("ca", "certificate", "key", "server_certificate")
"""Options that name a file beside the workstation."""


class Change(NamedTuple):
    """What a device said of one variable."""

    name: str
    """In the dictionary."""
    raw: object
    """As it was sent."""
    doubt: str = ""
    """Why the device itself does not stand by it."""
    age: float = 0.0
    """How old it was when it arrived, by the device's own stamps [s]."""


class Node(NamedTuple):
    """One variable that a device has, found by browsing."""

    address: str
    """As the dictionary has it."""
    type: str
    """As the device calls it."""
    unit: str
    """As the device states it; empty when it does not."""
    value: str
    """What it was, for whoever reads the skeleton."""


class VariablesSource(LiveSource, frozen=True, kw_only=True):
    """Base of the sources that read the variables of machines; which ones, the dictionary says."""

    reads_variables: ClassVar[bool] = True
    by_exception: ClassVar[bool] = True
    """Whether the device speaks up when something changes: then a value stands as long as the connection
    does. Else it grows old from when it was said."""

    timeout: Seconds = 1.0
    """Age at which what it said no longer counts [s], beside the time-out of each variable."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return BEAT

    def beside(self, folder: Path) -> Self:
        """The same source with the files that it names found from the folder of the workstation file."""
        named = {key: getattr(self, key, None) for key in FILES}
        return replace(self, **{key: str(folder / path) for key, path in named.items() if path is not None})

    def changes(
        self, variables: tuple[Variable, ...], folder: Path
    ) -> AsyncGenerator[tuple[Change, ...], None]:
        """Connect, and yield what the device says of the variables until the connection ends.

        Args:
            variables: Those to read.
            folder: Where relative paths start: the folder of the workstation file.

        Raises:
            OSError: There is no connection, or no longer.
            SeerobError: What the device says cannot be understood, or it has not what is asked for.
        """
        raise NotImplementedError

    async def browse(self) -> AsyncGenerator[Node, None]:
        """The variables that the device has, for a skeleton of a dictionary.

        Raises:
            OSError: There is no connection.
            SeerobError: The device cannot be asked what it has.
        """
        raise NotImplementedError
        yield

    async def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Everything that is known, whenever something changes and at least every `BEAT`."""
        variables = () if target is None else target.variables
        picture = Picture(variables, by_exception=self.by_exception)
        folder = Path("" if target is None else target.folder)
        read = tuple(v for v in variables if not v.write)
        async with aclosing(self.changes(read, folder)) as said:
            async for changes in _beating(said):
                now = time.monotonic()
                picture.take(changes, now)
                if picture.begun:
                    yield picture.sample(now)


class Picture:
    """What is known of a device's variables.

    Args:
        variables: Of the dictionary.
        by_exception: Whether a value stands until the device says another.
    """

    def __init__(self, variables: tuple[Variable, ...], *, by_exception: bool) -> None:
        self._variables = {v.name: v for v in variables}
        self._by_exception = by_exception
        self._said: dict[str, float] = {}
        self._values: dict[str, Value] = {}
        self._bad: dict[str, str] = {}
        self.begun = False
        """Whether the device has said anything yet."""

    def take(self, changes: tuple[Change, ...], now: float) -> None:
        """Hear what the device says.

        Args:
            changes: What it says.
            now: Host's monotonic time [s].
        """
        for change in changes:
            variable = self._variables.get(change.name)
            if variable is None:
                continue
            self.begun = True
            self._said[change.name] = now - change.age
            self._bad.pop(change.name, None)
            if change.doubt:
                self._bad[change.name] = f"{change.name}: {change.doubt}"
                continue
            try:
                self._values[change.name] = variable.value(change.raw)
            except BadValue as error:
                self._bad[change.name] = str(error)

    def sample(self, now: float) -> SignalSample:
        """What is known at a time on the host's monotonic clock [s]."""
        doubts = dict(self._bad)
        for name, variable in self._variables.items():
            if variable.write or name in doubts:
                continue
            said = self._said.get(name)
            if said is None:
                doubts[name] = f"{name}: nothing heard yet"
            elif not self._by_exception and now - said > variable.timeout:
                doubts[name] = f"{name}: not heard for {now - said:.2f} s (time-out {variable.timeout:g} s)"
        return SignalSample(source="", seq=0, t=now, values=dict(self._values), doubts=doubts)


async def _beating(said: AsyncIterator[tuple[Change, ...]]) -> AsyncGenerator[tuple[Change, ...], None]:
    """What is said, and nothing every `BEAT` in which nothing is."""
    waiting: asyncio.Task[tuple[Change, ...]] | None = None
    try:
        while True:
            if waiting is None:
                waiting = asyncio.ensure_future(anext(said))
            done, _ = await asyncio.wait({waiting}, timeout=BEAT)
            if not done:
                yield ()
                continue
            heard, waiting = waiting, None
            try:
                yield heard.result()
            except StopAsyncIteration:
                return
    finally:
        if waiting is not None:
            waiting.cancel()
            await asyncio.gather(waiting, return_exceptions=True)
