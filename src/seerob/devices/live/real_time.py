"""Running in real time: the clock of the loop, and live samples put on it."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator

from msgspec.structs import replace

from seerob.core.errors import InputError, Problem
from seerob.core.samples import Quality, Sample, SignalSample, key
from seerob.devices.live.listening import LiveSource
from seerob.devices.live.receivers import Receivers
from seerob.workstation.workstation import Workstation

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

    Args:
        recorded: From `seerob.session.run.pump`, endless.
        listening: Live sources, already started.
        clock: Is set to begin when the first tick is due.
    """
    heard = listening.first()
    origin = max((sample.t for sample in heard), default=time.monotonic() - listening.delay)
    clock.begin(origin + listening.delay)
    newest: dict[tuple[str, ...], Sample] = {}
    doubtful: set[tuple[str, ...]] = set()
    settled: dict[tuple[str, ...], float] = {}
    slipped = clock.slipped
    for samples in recorded:
        waiting: set[tuple[str, ...]] = set()
        # First taken, then looked: whatever held the run up until now, these samples lie where it is then.
        came = (*heard, *listening.take())
        clock.look()
        if clock.slipped > slipped:
            slipped, doubtful, waiting = clock.slipped, set(newest), set(newest)
            settled = {what: sample.t + SETTLE for what, sample in newest.items()}
        zero = clock.start - listening.delay
        taken: list[Sample] = []
        for sample in came:
            t = sample.t - zero
            what = key(sample)
            if what in newest and not _is_newer(sample, t, newest[what].t):
                continue
            quality = sample.quality
            swings = what in doubtful or t < settled.get(what, t)
            if swings and quality is Quality.GOOD:
                # Run time stood still while the robot went on: the speed between both samples is false.
                quality = Quality.LATE
            doubtful.discard(what)
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
