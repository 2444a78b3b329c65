"""What sources of machine variables share: values that come one by one become one picture of them all.

A device says what changes, or is asked again and again. Either way a sample is everything that is known
of its variables now, in SI and under the dictionary's names; what is too old, what the device calls bad
and what cannot be is a doubt with its reason.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import AsyncGenerator, AsyncIterator, Mapping
from contextlib import aclosing
from contextvars import ContextVar
from pathlib import Path
from typing import ClassVar, NamedTuple, Self

from msgspec.structs import replace

from seerob.core.errors import SeerobError
from seerob.core.quantities import Seconds
from seerob.core.samples import Sample, SignalSample
from seerob.core.snapshot import Finding
from seerob.devices.live.device_clock import AGAIN, BUFFERED, HOLD, REORDERED, RESTART_HOLD
from seerob.devices.live.listening import ASK_WITHIN, LiveSource, because
from seerob.workstation.source import Target
from seerob.workstation.variables import BadValue, Value, Variable

COVER_WITHIN = 1.0
"""How long a device is listened to for what it has of the dictionary, at start [s]."""
LONGEST_PULSE = 0.25
"""A device that speaks of changes is asked so often at least whether it is there [s]: what stands is as old
as the last answer, and a change is a motion since then."""
BEAT = 0.05
"""A sample is sent at least this often while there is a connection [s]: no news is news, too."""
REMEMBERED = 1 << 16
"""Stamps of which it is known what was said with them."""
PULSES = 4
"""A device that says nothing is asked so often within its source's time-out whether it is there."""


FILES = ("ca", "certificate", "key", "server_certificate")
"""Options that name a file beside the workstation."""


class Change(NamedTuple):
    """What a device said of one variable."""

    name: str
    """In the dictionary."""
    raw: object
    """Value that was sent."""
    invalid_reason: str = ""
    """Why the device itself does not stand by it."""
    age: float = 0.0
    """How old it may have been when it arrived [s]: since it was asked for, or by the device's own stamps."""
    stamp: float | None = None
    """When it was so, by the device's own clock [s]; None where it does not say."""


class Shown(NamedTuple):
    """That a device was there, and that what it had to say until then has arrived."""

    asked: float
    """When it was asked, of what has answered since: host's monotonic time [s]."""


class Node(NamedTuple):
    """One variable that a device has, found by browsing."""

    address: str
    """Address in the dictionary."""
    type: str
    """What the device calls it."""
    unit: str
    """Unit that the device states; empty when it does not."""
    value: str
    """What it was, for whoever reads the skeleton."""


class VariablesSource(LiveSource, frozen=True, kw_only=True):
    """Base of the sources that read the variables of machines; which ones, the dictionary says."""

    reads_variables: ClassVar[bool] = True
    links: ClassVar[bool] = False
    by_exception: ClassVar[bool] = True
    """Whether the device speaks up when something changes: then a value stands as long as the connection
    does. Else it grows old from when it was said."""

    timeout: Seconds = 1.0
    """Age at which what it said no longer counts [s], beside the time-out of each variable."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return BEAT

    def beside(self, folder: Path) -> Self:
        """Return this source with its files named from the folder of the workstation file."""
        named = {key: getattr(self, key, None) for key in FILES}
        return replace(self, **{key: str(folder / path) for key, path in named.items() if path is not None})

    def patience(self) -> float:
        """How long a run waits for the answer at start [s]."""
        return ASK_WITHIN + COVER_WITHIN

    async def inquire(self, folder: Path, target: Target | None) -> tuple[Finding, ...]:
        """What the device says of itself, and what of the dictionary it does not have."""
        found = await self.ask()
        read = tuple(v for v in (() if target is None else target.variables) if not v.write)
        return (*found, *(await self._covered(read, folder))) if read else found

    async def _covered(self, variables: tuple[Variable, ...], folder: Path) -> tuple[Finding, ...]:
        """Each variable once: heard and believable, in doubt, or not heard in time."""
        picture, clock = Picture(variables, by_exception=True), asyncio.get_running_loop()
        end, waiting, ended = clock.time() + COVER_WITHIN, {v.name for v in variables}, ""
        try:
            async with aclosing(self.changes(variables, folder)) as said, asyncio.timeout_at(end):
                async for changes in said:
                    picture.take(changes, time.monotonic())
                    waiting -= {change.name for change in changes if isinstance(change, Change)}
                    if not waiting:
                        break
        except TimeoutError:
            pass
        except (OSError, EOFError, SeerobError) as error:
            ended = because(error)
        doubts = picture.sample(time.monotonic()).doubts
        unheard = f"not heard within {COVER_WITHIN:g} s" + (f": {ended}" if ended else "")
        texts = {name: unheard if name in waiting else doubts[name] for name in doubts}
        heard = f"{len(variables) - len(texts)} of {len(variables)} variables are heard at start"
        unstamped = [v.name for v in variables if not self.stamps(v)]
        shown = ", ".join(unstamped[:6]) + (f" and {len(unstamped) - 6} more" if len(unstamped) > 6 else "")
        blind = f"no time is said of {shown}: values that are played again cannot be told from new ones"
        return (
            Finding(level="note", subject=self.name, text=heard),
            *((Finding(level="note", subject=self.name, text=blind),) if unstamped else ()),
            *(
                Finding(level="warning", subject=name, text=text.removeprefix(f"{name}: "))
                for name, text in texts.items()
            ),
        )

    def times(self, variable: Variable) -> bool:
        """Whether it shows how late a variable is heard: it is asked for it, or told when it was so."""
        return False

    def sampling_gap(self) -> float:
        """How long a variable may be something else that is never heard [s]; 0 where each change is told."""
        return 0.0

    def stamps(self, variable: Variable) -> bool:
        """Whether the device says when a variable was so: else values that are played again look like new."""
        return False

    def changes(
        self, variables: tuple[Variable, ...], folder: Path
    ) -> AsyncGenerator[tuple[Change | Shown, ...], None]:
        """Connect, and yield what the device says of the variables until the connection ends.

        Each time it yields, the device was there at that moment. A device that only speaks of changes has to
        be asked now and then: what stands is as old as the newest question that it has answered.

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
        stamps = _STAMPS.get(None)
        if stamps is None:
            _STAMPS.set(stamps := Stamps())
        bounds = self._bounds(variables)
        picture = Picture(variables, by_exception=self.by_exception, bounds=bounds, stamps=stamps)
        folder = Path("" if target is None else target.folder)
        read = tuple(v for v in variables if not v.write)
        alive = time.monotonic()
        async with aclosing(self.changes(read, folder)) as said, aclosing(_beating(said)) as beats:
            async for changes in beats:
                now = time.monotonic()
                if changes is not None:
                    alive = now
                    picture.take(changes, now)
                if picture.begun:
                    # Silence is no news: what stood when the device was last heard is as old as that.
                    yield picture.sample(now, alive)

    def _bounds(self, variables: tuple[Variable, ...]) -> dict[str, float]:
        """How late what nobody shows to be late may be, as the file says [s]."""
        late = {v.name for v in variables if not v.write and not self.times(v)}
        return dict.fromkeys(late, self.delay or 0.0)


PASSED = "older, by its own clock, than what it said before: came it late, or was that set back?"


class Stamps:
    """When variables were what they were said to be, by the device: whether that can be so now."""

    def __init__(self) -> None:
        self._last: dict[str, float] = {}
        self._newest: dict[str, float] = {}
        self._said: dict[tuple[str, float], int] = {}
        """What was said of a variable with a stamp."""
        self._lately: dict[str, list[tuple[float, int]]] = {}
        """The newest stamps of each and what was said, as far back as something may be overtaken."""
        self._back: dict[str, tuple[float, str]] = {}
        """Variables whose time went back: until when nothing rests on them [s], and why."""
        self._restarted: dict[str, float] = {}
        self._passed: dict[str, float] = {}
        """Variables whose value is older than one that was heard: stamp of that [s]."""

    def is_old(self, change: Change, stamp: float, now: float) -> bool:
        """Whether a value was overtaken on the way; time that goes back by more is a restart, then a loop.

        What is said again with the stamp that it had is a recording, also over a new connection. On what is
        older than a value that was heard, by less than a buffer explains, nothing rests until something newer
        comes: it came late, or the clock was set back, and nobody knows which. Nor for a while after that:
        what it was then was judged by another value. As `seerob.devices.live.device_clock.DeviceClock` has it
        of samples.

        Args:
            change: What is said.
            stamp: When it was so, by the device's clock [s].
            now: Host's monotonic time [s].
        """
        name, said = change.name, hash(repr(change.raw))
        last = self._last.get(name, -math.inf)
        back = last - stamp
        if 0 < back <= REORDERED and self._was_known(name, stamp, said):
            return True
        if 0 < back < BUFFERED:
            self._passed.setdefault(name, last)
            if now + HOLD > self._back.get(name, (-math.inf, ""))[0]:
                self._back[name] = now + HOLD, PASSED
            if back <= REORDERED:
                self._keep(name, stamp, said)
                return True
        elif back > 0 or stamp >= self._passed.get(name, -math.inf):
            self._passed.pop(name, None)
        ago = self._newest.get(name, -math.inf) - stamp
        self._last[name] = stamp
        self._newest[name] = max(stamp, self._newest.get(name, -math.inf))
        if ago > REORDERED and self._said.get((name, stamp)) == said:
            why = f"says again what it said {ago:.3g} s before: is a recording played to it?"
            self._back[name] = now + AGAIN, why
        elif back > 0:
            what = f"its time went back by {back:.3g} s"
            if now - self._restarted.get(name, -math.inf) < AGAIN:
                hold, why = AGAIN, f"{what}, not for the first time within {AGAIN:g} s: a loop?"
            else:
                hold, why = RESTART_HOLD, f"{what}: it seems to have started again"
            until, before = self._back.get(name, (now, ""))
            self._back[name] = (until, before) if until > now + hold else (now + hold, why)
            self._restarted[name] = now
        self._keep(name, stamp, said)
        return False

    def _keep(self, name: str, stamp: float, said: int) -> None:
        if len(self._said) >= REMEMBERED:
            del self._said[next(iter(self._said))]
        self._said[name, stamp] = said
        lately = [*self._lately.get(name, ()), (stamp, said)]
        old = [k for k, (t, _) in enumerate(lately) if t < self._last[name] - REORDERED]
        self._lately[name] = sorted(lately[old[-1] if old else 0 :])

    def _was_known(self, name: str, stamp: float, said: int) -> bool:
        """Whether a variable was what is said now, when that was so and ever since, as was heard before."""
        if self._said.get((name, stamp)) == said:
            return True
        lately = self._lately.get(name, [])
        before = [known for t, known in lately if t <= stamp][-1:]
        return bool(before) and {*before, *(known for t, known in lately if t > stamp)} == {said}

    def invalid_reasons(self, now: float) -> list[tuple[str, str]]:
        """Variables on which nothing rests at ``now`` [s], each with the reason."""
        holds = {name: why for name, (until, why) in self._back.items() if now <= until}
        return [*(dict.fromkeys(self._passed, PASSED) | holds).items()]


_STAMPS: ContextVar[Stamps] = ContextVar("stamps")
"""Of whoever listens, over all its connections."""


class Picture:
    """What is known of a device's variables.

    Args:
        variables: Of the dictionary.
        by_exception: Whether a value stands until the device says another.
        bounds: How much older than it seems a variable may be [s], by name.
        stamps: What was said when, over connections before this one too.
    """

    def __init__(
        self,
        variables: tuple[Variable, ...],
        *,
        by_exception: bool,
        bounds: Mapping[str, float] | None = None,
        stamps: Stamps | None = None,
    ) -> None:
        self._variables = {v.name: v for v in variables}
        self._bounds = bounds or {}
        self._shown: float | None = None
        """Until when everything was said that is known [s]; None where that was not asked."""
        self._by_exception = by_exception
        self._said: dict[str, float] = {}
        self._values: dict[str, Value] = {}
        self._bad: dict[str, str] = {}
        self._stamps = Stamps() if stamps is None else stamps
        self.begun = False
        """Whether the device has said anything yet."""

    def take(self, changes: tuple[Change | Shown, ...], now: float) -> None:
        """Hear what the device says.

        Args:
            changes: What it says.
            now: Host's monotonic time [s].
        """
        for change in changes:
            if isinstance(change, Shown):
                self._shown = max(change.asked, self._shown or change.asked)
                continue
            variable = self._variables.get(change.name)
            if variable is None:
                continue
            self.begun = True
            stamp = None if change.invalid_reason else change.stamp
            if stamp is not None and self._stamps.is_old(change, stamp, now):
                continue
            self._said[change.name] = now - change.age
            self._bad.pop(change.name, None)
            if change.invalid_reason:
                self._bad[change.name] = f"{change.name}: {change.invalid_reason}"
                continue
            try:
                self._values[change.name] = variable.value(change.raw)
            except BadValue as error:
                self._bad[change.name] = str(error)

    def sample(self, now: float, heard: float | None = None) -> SignalSample:
        """What is known.

        Args:
            now: Host's monotonic time [s].
            heard: When the device was heard last [s]; now when not given.
        """
        t = now if heard is None else heard
        doubts = dict(self._bad)
        for name, why in self._stamps.invalid_reasons(now):
            doubts.setdefault(name, f"{name}: {why}")
        for name, variable in self._variables.items():
            if variable.write or name in doubts:
                continue
            said = self._said.get(name)
            if said is None:
                doubts[name] = f"{name}: nothing heard yet"
            elif not self._by_exception and now - said > variable.timeout:
                doubts[name] = f"{name}: not heard for {now - said:.2f} s (time-out {variable.timeout:g} s)"
        ages = {name: age for name in self._values if (age := self._age(name, t)) > 0}
        return SignalSample(source="", seq=0, t=t, values=dict(self._values), doubts=doubts, ages=ages)

    def _age(self, name: str, t: float) -> float:
        """How much older than ``t`` what is known of a variable may be [s]."""
        said = self._shown if self._by_exception else self._said[name]
        return max(0.0, t - (t if said is None else said)) + self._bounds.get(name, 0.0)


async def _beating(
    said: AsyncIterator[tuple[Change | Shown, ...]],
) -> AsyncGenerator[tuple[Change | Shown, ...] | None, None]:
    """What is said, and None every `BEAT` in which nothing is."""
    waiting: asyncio.Task[tuple[Change | Shown, ...]] | None = None
    try:
        while True:
            if waiting is None:
                waiting = asyncio.ensure_future(anext(said))
            done, _ = await asyncio.wait({waiting}, timeout=BEAT)
            if not done:
                yield None
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
