"""The live sources of one run together, from which it takes once per tick.

Each listens in a process of its own (`seerob.devices.live.source_process`). Only those listen here that take
what this process has.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from seerob.core.samples import Mailbox, Sample, SignalSample, key
from seerob.devices.live.headset_offers import Offers, TakesOffers
from seerob.devices.live.listening import Listener, LiveSource, delay_of, name_of, stop
from seerob.devices.live.source_process import SourceProcess, pickled_source
from seerob.workstation.source import Target

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
        self._apart: list[SourceProcess] = []
        for source, target in sources:
            pair = pickled_source(source, target)
            if pair is None:
                if offers is not None and isinstance(source, TakesOffers):
                    source = source.taking(offers)  # noqa: PLW2901
                self._here.append(Listener(source, target, self._box.post))
            else:
                self._apart.append(SourceProcess(name_of(source), pair))

    def __enter__(self) -> Self:
        self._interval = sys.getswitchinterval()
        sys.setswitchinterval(min(self._interval, PROMPT))
        for listener in self._here:
            listener.start()
        for process in self._apart:
            process.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in self._apart:
            process.ask_to_stop()
        stop(self._here)
        for process in self._apart:
            process.join()
        sys.setswitchinterval(self._interval)

    def first(self, patience: float = PATIENCE) -> tuple[Sample, ...]:
        """What is heard from now on, once all that drive something were, or when that takes too long.

        Args:
            patience: How long that is, once everybody listens [s].
        """
        for process in self._apart:
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
        return (*self._box.take(), *(sample for process in self._apart for sample in process.take()))
