"""The live sources of one run together, and running in real time: the loop's clock, samples put on it.

Each listens in a process of its own (`seerob.devices.live.source_process`). Only those listen here that take
what this process has.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from types import TracebackType
from typing import Self

from msgspec.structs import replace

from seerob.core.errors import InputError, Problem
from seerob.core.samples import GrabSample, Mailbox, Quality, Sample, SignalSample, key
from seerob.core.snapshot import SourceLine
from seerob.devices.live.headset_offers import Offers, TakesOffers
from seerob.devices.live.listening import Listener, LiveSource, delay_of, name_of, stop
from seerob.devices.live.source_process import SourceProcess, pickled_source
from seerob.workstation.source import Target
from seerob.workstation.workstation import Workstation

PATIENCE = 1.0
"""How long a run waits for the first samples before it begins without them [s]."""
PROMPT = 1e-4
"""How long a thread keeps the interpreter while others wait for it [s], during a live run. Python's own 5 ms
is as long as what is heard here, or shown to somebody, would wait for the twin's computations."""


class Receivers:
    """The live sources of one run: started on entry, stopped on exit.

    Args:
        sources: With what each drives.
        offers: What pages of this run offer; nothing when None.

    Attributes:
        delay: How far the run is behind the world [s].
    """

    def __init__(
        self, sources: Sequence[tuple[LiveSource, Target | None]], offers: Offers | None = None
    ) -> None:
        self.delay = delay_of(source for source, _ in sources)
        self._awaited = {name_of(source) for source, _ in sources if source.target()}
        self._box = Mailbox()
        self._here: list[Listener] = []
        self._processes: list[SourceProcess] = []
        for source, target in sources:
            pair = pickled_source(source, target)
            if pair is None:
                if offers is not None and isinstance(source, TakesOffers):
                    source = source.taking(offers)  # noqa: PLW2901
                self._here.append(Listener(source, target, self._box.post, waits=self._box.waits))
            else:
                self._processes.append(SourceProcess(name_of(source), pair))

    def __enter__(self) -> Self:
        self._interval = sys.getswitchinterval()
        sys.setswitchinterval(min(self._interval, PROMPT))
        for listener in self._here:
            listener.start()
        for process in self._processes:
            process.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in self._processes:
            process.ask_to_stop()
        stop(self._here)
        for process in self._processes:
            process.join()
        sys.setswitchinterval(self._interval)

    def first(self, patience: float = PATIENCE) -> tuple[Sample, ...]:
        """What is heard from now on, once all that drive something were, or when that takes too long.

        Args:
            patience: How long that is, once everybody listens [s].
        """
        for process in self._processes:
            process.wait()
        end = time.monotonic() + patience
        self.take()
        heard: dict[tuple[str, ...], Sample] = {}
        while time.monotonic() < end:
            heard |= {key(sample): sample for sample in self.take()}
            if {s.source for s in heard.values() if not isinstance(s, SignalSample)} >= self._awaited:
                break
            time.sleep(0.001)
        return tuple(heard.values())

    def take(self) -> tuple[Sample, ...]:
        """What was heard since the last call, the newest of each; ``t`` on the host's clock."""
        return (*self._box.take(), *(sample for process in self._processes for sample in process.take()))

    def lines(self) -> dict[str, SourceLine]:
        """How each is heard, by name."""
        here = {listener.name: listener.line() for listener in self._here}
        return here | {process.name: process.line for process in self._processes}


AFTER = 1e-6
"""Between a sample and its repetition [s]: two of one instant there are not."""
SETTLE = 0.5
"""After a slip [s]: the twin swings to where the robot went meanwhile, faster than the robot ever was, and is
in the right place for a moment on its way."""


class Clock:
    """Holds a loop to real time; one that falls behind slips instead of hurrying after it."""

    SLIP = 0.25
    """Lag that is made up for [s]; beyond it the clock is set back."""

    def __init__(self) -> None:
        self.start = time.monotonic()
        """Host's monotonic time at which the tick of run time 0 is due [s]."""
        self.slipped = 0.0
        """How much later than real time the run is by now [s]."""
        self._due = 0.0
        self._asleep = _asleep()

    def begin(self, start: float) -> None:
        """Let run time 0 be due at ``start`` [s], host's monotonic time, and wait for it."""
        self.start = start
        self.wait(0.0)

    def wait(self, t: float) -> None:
        """Sleep until run time ``t`` [s] has come."""
        self._due = t
        ahead = self.start + t - time.monotonic()
        if ahead > 0:
            time.sleep(ahead)
        self.look()

    def look(self) -> None:
        """Look how late it is: whoever slept may have slept longer, and been held up since.

        A computer that was suspended has a monotonic clock that stood still; another one tells.
        """
        lag = time.monotonic() - (self.start + self._due)
        if lag > self.SLIP:
            self.start += lag
            self.slipped += lag
        asleep = _asleep()
        if asleep > self._asleep + self.SLIP:
            self.slipped += asleep - self._asleep
        self._asleep = asleep


def _asleep() -> float:
    """Time that this computer was suspended since it was switched on [s]; 0 where nobody says."""
    if not hasattr(time, "CLOCK_BOOTTIME"):
        return 0.0
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.monotonic()


def hear(
    recorded: Iterable[tuple[Sample, ...]], listening: Receivers, clock: Clock
) -> Iterator[tuple[Sample, ...]]:
    """The newest samples of live sources, beside those of recorded ones.

    Run time t is the world's instant ``clock.start + t - delay``: when a tick is computed, what it
    speaks of is a delay old, and samples on either side of it have been heard. The run begins at the
    first sample, or without one when that takes too long. Where the clock slipped, what each source said
    last is older than run time shows, and is late from then on; so are its next and those of `SETTLE`.
    Of grabs none is left out or told twice: a hand that let go while the run stood still holds nothing.

    Args:
        recorded: From `seerob.session.run.pump`, endless.
        listening: Live sources, already started.
        clock: Is set to begin when the first tick is due.
    """
    heard = listening.first()
    origin = max((sample.t for sample in heard), default=time.monotonic() - listening.delay)
    clock.begin(origin + listening.delay)
    newest: dict[tuple[str, ...], Sample] = {}
    invalid: set[tuple[str, ...]] = set()
    settled: dict[tuple[str, ...], float] = {}
    grabbed = -math.inf
    slipped = clock.slipped
    for samples in recorded:
        waiting: set[tuple[str, ...]] = set()
        # First taken, then looked: whatever held the run up until now, these samples lie where it is then.
        came = (*heard, *listening.take())
        clock.look()
        if clock.slipped > slipped:
            slipped, invalid, waiting = clock.slipped, set(newest), set(newest)
            settled = {what: sample.t + SETTLE for what, sample in newest.items()}
        zero = clock.start - listening.delay
        taken: list[Sample] = []
        for sample in came:
            t = sample.t - zero
            if isinstance(sample, GrabSample):
                # In the order in which they came, also where the clock was set back between two.
                grabbed = max(t, grabbed + AFTER)
                taken.append(replace(sample, t=grabbed))
                continue
            what = key(sample)
            if what in newest and not _is_newer(sample, t, newest[what].t):
                continue
            quality = sample.quality
            swings = what in invalid or t < settled.get(what, t)
            if swings and quality in (Quality.GOOD, Quality.DEGRADED):
                # Run time stood still while the robot went on: the speed between both samples is false.
                quality = Quality.LATE
            invalid.discard(what)
            waiting.discard(what)
            newest[what] = replace(sample, t=t, quality=quality)
            taken.append(newest[what])
        for what in sorted(waiting):
            if newest[what].quality is Quality.GOOD:
                newest[what] = replace(newest[what], t=newest[what].t + AFTER, quality=Quality.LATE)
                taken.append(newest[what])
        yield (*samples, *taken)
        heard = ()


def _is_newer(sample: Sample, t: float, last: float) -> bool:
    # A source may tell of several changes of one instant.
    return t >= last if isinstance(sample, SignalSample) else t > last


def require_recorded(workstation: Workstation) -> None:
    """Refuse to run live sources in any other than real time.

    Raises:
        InputError: With every live source.
    """
    file = next(iter(workstation.files), "workstation")
    remedy = "use seerob run (in Python: live=True), or drive it from a recording"
    problems = [
        Problem(file, f"sources[{i}]", "a live source, which is heard in real time only", remedy)
        for i, source in enumerate(workstation.sources)
        if isinstance(source, LiveSource)
    ]
    if problems:
        raise InputError(problems)
