"""What a live source is, and everything that live sources share: thread, back-off, stop, time.

A `LiveSource` says in one asynchronous generator what it hears, `LiveSource.listen`. A `Listener` runs
that in a thread of its own, begins anew when it ends, puts each sample's time on the host's clock and
posts it to a mailbox, where only the newest waits. `seerob.devices.live.receivers.Receivers` is all of them
together, from which a run takes once per tick.

The twin runs a fixed delay behind the world, one period of the slowest source and a margin, so that
there is a sample on either side of what is shown and references interpolate.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import os
import time
from abc import abstractmethod
from collections.abc import AsyncGenerator, Callable, Coroutine, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Lock, Thread
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar
from urllib.parse import urlsplit

from msgspec import Meta
from msgspec.structs import replace

from seerob.core.errors import InputError, SeerobError
from seerob.core.extras import need
from seerob.core.host_name import check_host, check_url
from seerob.core.printable import printable
from seerob.core.samples import NO_PLACE, BodySample, JointSample, Quality, Sample, SignalSample, key
from seerob.core.snapshot import Finding, SourceLine
from seerob.devices.live.contradictions import Contradictions
from seerob.devices.live.device_clock import AFTER, HOLD, ClockState, DeviceClock
from seerob.devices.live.held_back import HeldBack
from seerob.protocols import NotLetIn
from seerob.protocols.links.datagrams import DISTRUST, HEARD
from seerob.protocols.links.reception import run_promptly
from seerob.workstation.source import Opened, Source, Target


@dataclass(frozen=True, slots=True)
class Statistics:
    """What arrived so far."""

    count: int = 0
    """Samples with news."""
    repeated: int = 0
    """Samples that were not newer than the one before."""
    rate: float | None = None
    """Mean rate while heard [1/s]; None below two samples."""
    jitter: float | None = None
    """Standard deviation of the interval between arrivals [s]."""
    longest_gap: float | None = None
    """Longest interval between arrivals, losses left out [s]."""
    missed: int = 0
    """Samples that the device's own time says are missing."""
    losses: int = 0
    """Times it was lost after it had been heard."""
    offset: float | None = None
    """Host's monotonic time less device time [s]."""

    def __str__(self) -> str:
        if self.rate is None or self.jitter is None or self.longest_gap is None:
            return f"{self.count} samples"
        return (
            f"{self.count} samples at {self.rate:.1f}/s, jitter {1e3 * self.jitter:.2f} ms, "
            f"longest gap {1e3 * self.longest_gap:.1f} ms, {self.missed} missed, "
            f"{self.repeated} repeated, {self.losses} losses"
        )


class Arrivals:
    """Counts what arrives; Welford's running mean and variance of the intervals.

    Args:
        period: Expected period of the source [s], to tell what is missing.
    """

    def __init__(self, period: float | None = None) -> None:
        self._period = period
        self._count = self._repeated = self._missed = self._losses = 0
        self._intervals, self._mean, self._squares, self._longest = 0, 0.0, 0.0, 0.0
        self._last: float | None = None
        self._last_device: float | None = None

    def add(self, host: float, device: float | None) -> None:
        """News arrived at ``host`` [s], stamped ``device`` [s]."""
        self._count += 1
        if self._last is not None:
            interval = host - self._last
            self._intervals += 1
            change = interval - self._mean
            self._mean += change / self._intervals
            self._squares += change * (interval - self._mean)
            self._longest = max(self._longest, interval)
        if device is not None and self._last_device is not None and self._period is not None:
            # Rounded: a device's clock has ticks of its own.
            self._missed += max(0, round((device - self._last_device) / self._period) - 1)
        self._last, self._last_device = host, device

    def repeat(self) -> None:
        """Something arrived that was not new."""
        self._repeated += 1

    def lose(self) -> None:
        """The source was lost: the silence until it returns is no interval."""
        self._losses += self._last is not None
        self._last = self._last_device = None

    def statistics(self, offset: float | None = None) -> Statistics:
        """What arrived so far."""
        known = self._intervals > 0 and self._mean > 0
        return Statistics(
            count=self._count,
            repeated=self._repeated,
            rate=1 / self._mean if known else None,
            jitter=math.sqrt(self._squares / self._intervals) if known else None,
            longest_gap=self._longest if known else None,
            missed=self._missed,
            losses=self._losses,
            offset=offset,
        )


SECRETS = ("password_env", "token_env")
"""Options that name a secret."""
ENCRYPTED = ("https", "wss")


class Contact(NamedTuple):
    """The other end of a live source."""

    where: str
    """``connects to 192.168.0.7:30004``, ``listens on 0.0.0.0:9763``."""
    user: str = ""
    """User name; empty for none."""
    secret: str = ""
    """Name of the secret that is sent; empty for none."""
    encrypted: bool | None = False
    """None of what comes over the run's own page, encrypted or not as that is."""
    listens: bool = False
    """Whether it waits for the other end, on its own port."""

    def __str__(self) -> str:
        """One line."""
        who = f" as {self.user!r}" if self.user else ""
        what = f" with the secret {self.secret}" if self.secret else ""
        how = {None: "over its page", True: "encrypted", False: "not encrypted"}[self.encrypted]
        return f"{self.where}{who}{what}, {how}"


def contact_of(source: Any, *, listens: bool) -> Contact:
    """The other end by the options of a source.

    Args:
        source: With ``url``, or with ``host``, ``bind`` and ``port``.
        listens: Whether it waits on ``bind`` for what is sent, instead of connecting to ``host``.
    """
    url, port = getattr(source, "url", ""), getattr(source, "port", "")
    host = getattr(source, "host", "") or getattr(source, "sender", "")
    if url:
        where = f"connects to {url}"
    elif listens:
        where = f"listens on {source.bind}:{port}" + (f" for {host}" if host else " for anybody")
    else:
        where = f"connects to {host}:{port}"
    secrets = (getattr(source, key, None) for key in SECRETS)
    security = str(getattr(source, "security", "none"))
    return Contact(
        where,
        getattr(source, "user", None) or "",
        next(filter(None, secrets), ""),
        getattr(source, "tls", False) or security != "none" or urlsplit(url).scheme in ENCRYPTED,
        listens and not url,
    )


_log = logging.getLogger(__name__)
T = TypeVar("T")

MARGIN = 0.005
"""Of the delay behind the world, for what is late on the way [s]."""
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 2.0
"""Before it is tried again [s]; doubled from the one to the other."""
STOP_WITHIN = 1.0
"""A listener that does not end by then is left behind [s]; its thread keeps no process alive."""
ASK_WITHIN = 1.5
"""At start [s]."""
TRIED_AGAIN = "it is tried again during the run"
STILL = "it says the same of the person to the last bit, again and again: is it still measured?"
"""What is measured has noise, and nobody stands so still."""
UNTIMED = "it sends no time, so that nobody knows how late it is: give a bound as delay of the source"


_said: ContextVar[set[str]] = ContextVar("said")
MOST_SAID = 1000


def say_once(log: logging.Logger, level: int, text: str) -> None:
    """Log a line that is as true of each connection, the first time only.

    Of a loss and of a return there is one line each; what was said at the first connection is not said
    again at the next.
    """
    said = _said.get(set())
    if text not in said:
        log.log(level, "%s", text)
        if len(said) < MOST_SAID:
            said.add(text)


class LiveSource(Source, frozen=True, kw_only=True):
    """Base of the sources whose future nobody knows: controllers, machines, trackers."""

    delay: Annotated[float, Meta(ge=0, extra={"unit": "s"}, extra_json_schema={"x-unit": "s"})] | None = None
    """How far the twin is behind the world [s]; one period of the source and 5 ms when not given. Of
    what is sent without a time also how late it is at most."""

    live: ClassVar[bool] = True
    own_process: ClassVar[bool] = True
    """Whether it may listen in another process: not who takes what this one has."""
    links: ClassVar[bool] = True
    """Whether `listen` needs the links of its target (`Target.description`); a process that does without
    them, and so without numpy, is a third smaller."""
    loads: ClassVar[tuple[str, ...]] = ()
    """Libraries that it needs when it listens: loaded before anybody does, since that holds others up."""
    asked: ClassVar[bool] = False
    """Whether what is sent without a time is the answer to a question that was asked at its ``t``, or comes
    from this process: then nothing is late unseen."""
    tells_changes: ClassVar[bool] = False
    """Whether it hears of each change, and that there was none: then no sample is missing between two."""
    asks: ClassVar[str] = ""
    """A line of the workstation file that it needs and that no device can say: `seerob probe` shows it."""

    def __post_init__(self) -> None:
        for option in ("host", "bind", "sender"):
            if host := getattr(self, option, None):
                check_host(option, host)
        if url := getattr(self, "url", None):
            check_url("url", url)
        if self.loop:
            raise ValueError("a live source has no end to start again from: remove loop")
        if self.behind() >= self.timeout:
            raise ValueError(
                f"a timeout of {self.timeout:g} s is not longer than the delay of {self.behind():g} s: "
                "give a longer timeout"
            )

    @abstractmethod
    def period(self) -> float:
        """Expected interval between its samples [s]."""
        raise NotImplementedError

    def behind(self) -> float:
        """Delay behind the world that it needs [s]."""
        return self.period() + MARGIN if self.delay is None else self.delay

    async def ask(self) -> tuple[Finding, ...]:
        """Connect briefly, for what the other end says of itself: what it is, what it does not have.

        Raises:
            OSError: There is no connection.
            SeerobError: It answers, but cannot be understood.
            InputError: It is understood, and is not what this source can use.
        """
        return ()

    async def inquire(self, folder: Path, target: Target | None) -> tuple[Finding, ...]:
        """Ask as `ask` does, at the start of a run, when the target is known; raises as `ask` does."""
        return await self.ask()

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Check what can be checked without a connection; what `Opened.reach` asks is asked by a run.

        Raises:
            InputError: An option that does not fit what it drives.
            MissingPackage: A package that it needs is not installed.
        """
        need(*self.loads)
        text = (
            f"the twin runs {1e3 * self.behind():.0f} ms behind the world, where samples lie on either side"
        )
        behind = Finding(level="note", subject=self.target() or self.name, text=text)
        return Opened(samples=(), duration=0.0, findings=(behind,), reach=partial(self.reach, folder, target))

    def reach(self, folder: Path, target: Target | None) -> tuple[Finding, ...]:
        """Ask the other end what it has, if it can be reached: a run may begin before it can.

        Raises:
            InputError: It can be reached, and is not what this source can use.
        """
        try:
            return at_start(self.inquire(folder, target), within=self.patience())
        except InputError:
            raise
        except (OSError, EOFError, SeerobError) as error:
            about = self.target() or self.name
            who = "" if about == self.name else f"{self.name}: "
            how = "not let in" if isinstance(error, NotLetIn) else "not reached"
            text = f"{who}{how} at start: {because(error)}; {TRIED_AGAIN}"
            return (Finding(level="warning", subject=about, text=text),)

    def contact(self) -> Contact:
        """Whom it connects to, or where it listens; by its ``url``, or ``host``, ``bind`` and ``port``."""
        return contact_of(self, listens=hasattr(self, "bind"))

    def patience(self) -> float:
        """How long a run waits for the answer at start [s]."""
        return ASK_WITHIN

    @abstractmethod
    def listen(self, target: Target | None) -> AsyncGenerator[Sample, None]:
        """Connect, and yield what is heard until the connection ends; then it is called again.

        ``t`` of a sample is when it arrived on the host's monotonic clock, ``t_device`` the device's
        own time. Runs in a thread and loop of its own, and must end promptly when it is cancelled.

        Raises:
            OSError: There is no connection, or no longer.
            SeerobError: What the other end says cannot be understood.
        """
        raise NotImplementedError


def at_start(question: Coroutine[Any, Any, T], *, within: float = ASK_WITHIN) -> T:
    """The answer to what is asked when a source is opened.

    Raises:
        TimeoutError: There was none within that time [s].
    """
    # In a thread: whoever opens it may be in an event loop, a notebook for one.
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, asyncio.wait_for(question, within)).result()


def because(error: BaseException) -> str:
    """Why there is no connection, in one line."""
    if isinstance(error, TimeoutError):
        return str(error) or "no answer in time"
    if isinstance(error, OSError) and error.errno is not None and error.errno > 0:
        # asyncio's own text hides the reason behind the address.
        return os.strerror(error.errno)
    return printable(str(error)) or type(error).__name__


def delay_of(sources: Iterable[Source]) -> float:
    """How far a run of these sources is behind the world [s]; 0 when none is live."""
    return max((s.behind() for s in sources if isinstance(s, LiveSource)), default=0.0)


class Listener:
    """One live source in a thread of its own.

    Args:
        source: The source.
        target: What it drives.
        post: Called with each sample, on the host's clock; from the listener's thread.
        again: Whether it was heard before, and lost.
        known: What was known of its clock then.
        waits: Whether what was posted last of a kind (`seerob.core.samples.key`) was taken by nobody yet.
    """

    def __init__(
        self,
        source: LiveSource,
        target: Target | None,
        post: Callable[[Sample], None],
        *,
        again: bool = False,
        known: ClockState | None = None,
        waits: Callable[[tuple[str, ...]], bool] = lambda _: False,
    ) -> None:
        self._waits = waits
        self.name = name_of(source)
        self.drives = bool(source.target())
        """Whether it drives a robot or a person, or only has signals."""
        self._source, self._target, self._post = source, target, post
        self._clock, self._arrivals = DeviceClock(known), Arrivals(source.period())
        self._bound = source.timeout
        self._distrusted = "", -math.inf
        """Why it may be somebody else who is heard, and until when that counts [s]."""
        self._senders: dict[int, str] = {}
        """Who was heard at which port, by datagrams."""
        self._told: dict[tuple[str, ...], _Told] = {}
        """What was said of each thing, by what it is about."""
        self._lock = Lock()
        self._thread = Thread(target=self._run, name=f"seerob-{self.name}", daemon=True)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._task: asyncio.Task[None] | None = None
        self._stopping = False
        self._up: bool | None = False if again else None
        self._word = ""
        """What it was when it was lost last, and why."""
        self._reason = ""

    def start(self) -> None:
        """Begin to listen; returns at once."""
        self._thread.start()

    def ask_to_stop(self) -> None:
        """Ask the thread to end; returns at once."""
        with self._lock:
            self._stopping = True
            if self._loop is not None and self._task is not None:
                with contextlib.suppress(RuntimeError):  # the loop ended by itself meanwhile
                    self._loop.call_soon_threadsafe(self._task.cancel)

    def join(self, seconds: float) -> bool:
        """Wait for the thread to end; whether it has."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def statistics(self) -> Statistics:
        """What arrived so far."""
        return self._arrivals.statistics(self._clock.offset)

    def line(self) -> SourceLine:
        """How it is heard."""
        found, timed = self.statistics(), self._clock.offset is not None
        return SourceLine(
            heard=bool(self._up),
            rate=found.rate,
            jitter=found.jitter,
            latency=self._clock.latency if timed else None,
            bound=self._bound if timed else None,
            received=found.count,
            lost=found.missed,
            losses=found.losses,
            word=self._word and f"{self._word}: {self._reason}",
        )

    def _run(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            run_promptly(self._listen())

    async def _listen(self) -> None:
        with self._lock:
            self._loop, self._task = asyncio.get_running_loop(), asyncio.current_task()
            if self._stopping:
                return
        _said.set(set())
        DISTRUST.set(self._distrust)
        HEARD.set(self._senders)
        pause = FIRST_PAUSE
        while True:
            self._clock.reconnect()
            begun = time.monotonic()
            word, reason = await self._session()
            if self._stopping:
                return
            # Who speaks for less than the last pause and falls silent again is tried less and less often.
            if self._up and time.monotonic() - begun > pause:
                pause = FIRST_PAUSE
            self._lose(word, reason)
            await asyncio.sleep(pause)
            pause = min(2 * pause, LONGEST_PAUSE)

    async def _session(self) -> tuple[str, str]:
        """Listen until the connection ends: what that is, and why it did."""
        try:
            async with contextlib.aclosing(self._source.listen(self._target)) as samples:
                async for sample in samples:
                    # `asyncio.wait_for`, which some libraries use, forgets a cancellation that comes
                    # together with what it waits for (Python 3.11).
                    if self._stopping:
                        break
                    self.take(sample)
        except NotLetIn as error:
            return "not let in", because(error)
        except (OSError, EOFError, SeerobError) as error:
            return "not heard", because(error)
        except Exception as error:
            if self._up is not False:  # once per loss
                _log.exception("%s: a mistake in the source itself", self.name)
            return "not heard", f"{type(error).__name__}: {error}"
        return "not heard", "the other end closed the connection"

    def take(self, sample: Sample) -> None:
        """Hear what the source has yielded, and post what is news.

        Raises:
            SeerobError: It has no time of its arrival.
        """
        if not math.isfinite(sample.t):
            raise SeerobError(f"it yields a sample without the time of its arrival (t is {sample.t})")
        if isinstance(sample, NO_PLACE):
            self._news(replace(sample, source=self.name), sample.t, self.drives)
            return
        if isinstance(sample, BodySample):  # whose key says who sees it
            sample = replace(sample, source=self.name)
        host, what = sample.t, key(sample)
        told = self._told.get(what) or self._begin(what)
        device, timed = sample.t_device, sample.t_device is not None
        t: float | None
        doubt: str
        t, doubt, content = host, "", _content(sample)
        if device is not None:
            t, doubt = self._clock.hear(device, host, content, forgeable=bool(self._senders))
        if t is None:
            self._arrivals.repeat()
            if doubt:
                # No news, and a doubt about what was said before.
                self._invalidate(told, doubt)
            return
        if isinstance(sample, BodySample):
            person = told.person = told.person or _Person()
            stood = person.stood(sample, content, host)
            if stood is not None:
                self._arrivals.repeat()
                if stood > self._source.timeout:
                    self._invalidate(told, STILL)
                return
            sample = replace(sample, points=person.frozen(sample.points, t))
        late = self._clock.latency if timed else (self._source.delay or 0.0) * (not self._source.asked)
        distrusted, until = self._distrusted
        # Also beside another doubt: what stands at once is seen by the one sample in which it stopped.
        reason = told.contradiction(sample, t, host, waits=self._waits(what)) or doubt
        if host <= until:
            reason = distrusted
        if not timed and not self._source.asked and self._source.delay is None:
            reason = reason or UNTIMED
        reason = reason or sample.reason
        quality = sample.quality
        if timed and late > self._bound:
            reason = f"heard {late:.2f} s later than at its best (bound {self._bound:g} s)"
            quality = Quality.LATE if quality is Quality.GOOD else quality
        if reason and quality is Quality.GOOD:
            quality = Quality.DEGRADED
        reason = reason and f"{self.name}: {reason}"
        seq = 0 if told.posted is None else told.posted.seq + 1
        self._heard(host, device)
        sample = told.posted = replace(
            sample, source=self.name, seq=seq, t=t, quality=quality, reason=reason, late=late
        )
        self._post(sample)

    def _begin(self, what: tuple[str, ...]) -> _Told:
        """Of something that was not heard of before."""
        self._told[what] = told = _Told(self._target, self._source.behind())
        return told

    def _news(self, sample: Sample, host: float, quiet: bool) -> None:
        """Post what is new.

        Args:
            sample: On the host's clock.
            host: When it arrived [s].
            quiet: It is not what this source is listened to for.
        """
        if not quiet:
            self._heard(host, sample.t_device)
        # Counted for what it is about alone: what is heard of variables meanwhile makes up for no sample
        # of the robot that is missing.
        told = self._told.get(what := key(sample)) or self._begin(what)
        seq = 0 if told.posted is None else told.posted.seq + 1
        sample = told.posted = replace(sample, seq=seq)
        self._post(sample)

    def _heard(self, host: float, device: float | None) -> None:
        """Count news that arrived at ``host`` [s], stamped ``device`` [s]."""
        self._arrivals.add(host, device)
        if self._up is False:
            _log.warning("%s: heard again", self.name)
        self._up = True

    def _invalidate(self, told: _Told, reason: str) -> None:
        """Say again what was said last, if anything, with a doubt: whoever has taken it would not know."""
        last, reason = told.posted, f"{self.name}: {reason}"
        if last is None or last.reason == reason:
            return
        quality = Quality.DEGRADED if last.quality is Quality.GOOD else last.quality
        told.posted = replace(last, t=last.t + AFTER, quality=quality, reason=reason, seq=last.seq + 1)
        self._post(told.posted)

    def _distrust(self, reason: str) -> None:
        """Doubt what was said last, and what comes for a while: it may be of somebody else."""
        self._distrusted = reason, time.monotonic() + HOLD
        say_once(_log, logging.WARNING, f"{self.name}: {reason}")
        for told in tuple(self._told.values()):
            if not isinstance(told.posted, SignalSample):
                self._invalidate(told, reason)

    def _lose(self, word: str, reason: str) -> None:
        """One line per loss, and per answer that is another, however often it is tried again."""
        if self._up is not False or (word, self._word) == ("not let in", "not heard"):
            _log.warning("%s: %s: %s", self.name, word, reason)
            self._arrivals.lose()
        self._up, self._word, self._reason = False, word, reason


class _Told:
    """What was said of one thing.

    Args:
        target: What the source drives.
        behind: How far a run is behind the world [s].
    """

    def __init__(self, target: Target | None, behind: float) -> None:
        self.posted: Sample | None = None
        """The last one."""
        self.person: _Person | None = None
        self._contradictions, self._held = Contradictions(target), HeldBack(behind)
        self._found, self._until = "", 0.0
        """What contradicted itself, and until when that counts [s]."""

    def contradiction(self, sample: Sample, t: float, host: float, *, waits: bool) -> str:
        """What in it contradicts what was said before, now or a moment ago, or shows that nobody judged that.

        Args:
            sample: As it was heard.
            t: When what it says was so, on the host's clock [s].
            host: When it arrived [s].
            waits: Whether the one before was taken by nobody yet.
        """
        unseen = self._held.reason(sample, t, host, waits=waits)
        if found := self._contradictions.find(sample) or unseen:
            self._found, self._until = found, host + HOLD
        return self._found if host <= self._until else ""


class _Person:
    """What one device said of a person."""

    def __init__(self) -> None:
        from seerob.description.capture.frozen import Frozen  # numpy, which who hears nobody does without

        self.frozen = Frozen(live=True)
        self._content: int | None = None
        self._since = 0.0

    def stood(self, sample: BodySample, content: int, host: float) -> float | None:
        """For how long it has said nothing but this [s]: that is silence; None where it is news.

        Args:
            sample: What it says.
            content: What tells that from what others say.
            host: When [s].
        """
        if content == self._content and any(p.position or p.wxyz for p in sample.points):
            return host - self._since
        self._content, self._since = content, host
        return None


def _content(sample: Sample) -> int:
    """What tells a sample's content from that of others."""
    if isinstance(sample, NO_PLACE):
        return 0
    said: tuple[tuple[float, ...] | None, ...]
    if isinstance(sample, JointSample):
        q, qd = said = sample.q, sample.qd
        unsure = math.isnan(sum(q) if qd is None else sum(q) + sum(qd))
    else:
        if isinstance(sample, BodySample):
            said = tuple([each for p in sample.points for each in (p.position, p.wxyz)])
        else:
            said = sample.position, sample.wxyz
        unsure = math.isnan(sum(map(sum, filter(None, said))))
    # What is no number differs from itself; its words do not.
    return hash(repr(said) if unsure else said)


def name_of(source: LiveSource) -> str:
    """What a source is called where a run tells of it."""
    return source.name or f"{type(source).__module__.rpartition('.')[2]} {source.target()}".strip()


def stop(listeners: Sequence[Listener]) -> None:
    """End all of them and log what they heard; one that does not end in time is left behind."""
    for listener in listeners:
        listener.ask_to_stop()
    end = time.monotonic() + STOP_WITHIN
    for listener in listeners:
        if not listener.join(max(0.0, end - time.monotonic())):
            _log.warning("%s: did not stop within %g s", listener.name, STOP_WITHIN)
        _log.info("%s: %s", listener.name, listener.statistics())
