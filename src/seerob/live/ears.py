"""The live sources of one run together, from which it takes once per tick.

They listen in a process of their own (`seerob.live.apart`), where nobody computes: in this one a packet would
wait for the interpreter's lock while the twin has it. Only those listen here that take what this process has.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from seerob.live.apart import Apart, Pair, may_be_apart
from seerob.live.listening import PROMPT, Listeners, delay_of, name_of
from seerob.samples import Mailbox, Sample, SignalSample, key

PATIENCE = 1.0
"""How long a run waits for the first samples before it begins without them [s]."""


class Listening:
    """The live sources of one run: started on entry, stopped on exit.

    Args:
        sources: With what each drives.

    Attributes:
        delay: How far the run is behind the world [s].
    """

    def __init__(self, sources: Sequence[Pair]) -> None:
        self.delay = delay_of(source for source, _ in sources)
        self._awaited = {name_of(source) for source, _ in sources if source.target()}
        self._box = Mailbox()
        here: list[Pair] = []
        apart: list[Pair] = []
        for pair in sources:
            (apart if may_be_apart(*pair) else here).append(pair)
        self._here = Listeners(here, self._box.post)
        self._apart = Apart(apart) if apart else None

    def __enter__(self) -> Self:
        self._interval = sys.getswitchinterval()
        sys.setswitchinterval(min(self._interval, PROMPT))
        try:
            self._here.start()
            if self._apart is not None:
                self._apart.start()
        except BaseException:  # an interrupt while it waits
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._apart is not None:
            self._apart.ask_to_stop()
        self._here.stop()
        if self._apart is not None:
            self._apart.join()
        sys.setswitchinterval(self._interval)

    def first(self, patience: float = PATIENCE) -> tuple[Sample, ...]:
        """What is heard from now on, once all that drive something were, or when that takes too long."""
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
        here = self._box.take()
        return here if self._apart is None else (*here, *self._apart.take())
