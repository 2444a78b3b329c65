"""Writing to machines: the only place where the twin does. Off unless file and command line both allow it.

What is written are edges: a verdict that came or went since the run began. A thread of its own writes, so
a slow device never slows the loop; each writing and each failure is one line of the log.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import Condition, Thread
from typing import Protocol, Self

from seerob.core.errors import InputError, SeerobError
from seerob.core.samples import Sample
from seerob.core.snapshot import Snapshot
from seerob.devices.live.listening import because
from seerob.model.model import Model
from seerob.outputs.sink import Closing
from seerob.workstation.tables.writing import Trigger
from seerob.workstation.variables import Variable

_log = logging.getLogger(__name__)

WITHIN = 2.0
"""A writing that takes longer has failed [s]."""
STOP_WITHIN = 3.0
"""[s]"""


class Writes(Protocol):
    """A source that can write."""

    async def write(self, variable: Variable, raw: bool, folder: Path) -> None:
        """Write one bool, as the device has it.

        Raises:
            OSError: There is no connection.
            SeerobError: The device refuses.
        """


class _Edge:
    """One trigger at work."""

    def __init__(self, trigger: Trigger, variable: Variable, writer: Writes) -> None:
        self.trigger, self.variable, self.writer = trigger, variable, writer
        self.wanted: bool | None = None
        """None before the first verdict, which is no edge."""
        self.written: bool | None = None
        self.due = 0.0
        """Not written before this instant, host's monotonic time [s]."""
        self.failing = False

    @property
    def waits(self) -> bool:
        """Whether there is something to write."""
        return self.wanted != self.written


def allowed(model: Model, *, on_command_line: bool) -> bool:
    """Whether anything may be written: only where workstation file and command line both say so."""
    station = model.workstation
    return bool(station.triggers) and station.allow_writing and on_command_line


class Triggers(Closing):
    """The triggers of a run: takes snapshots like a sink, and writes to machines.

    Args:
        model: The compiled workstation.
        on_command_line: Whether the command line allows writing.

    Raises:
        InputError: It is not allowed, or a source that is to write cannot.
    """

    def __init__(self, model: Model, *, on_command_line: bool) -> None:
        if not allowed(model, on_command_line=on_command_line):
            remedy = "allow_writing = true in the workstation file and --allow-writing on the command line"
            raise InputError.at(
                "triggers", "", "writing to machines is not allowed", f"it takes both: {remedy}"
            )
        sources = {source.name: source for source in model.workstation.sources}
        self._folder = model.folder
        self._edges: Sequence[_Edge] = [
            _Edge(trigger, variable, _writer(sources, variable))
            for trigger in model.workstation.triggers
            for variable in [model.dictionary[trigger.variable]]
        ]
        self._condition = Condition()
        self._stopping = False
        self._thread = Thread(target=self._run, name="seerob-triggers", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Note which verdicts came or went; returns at once."""
        verdicts = {result.name: result.verdict for result in snapshot.results}
        with self._condition:
            for edge in self._edges:
                wanted = edge.trigger.when.holds(verdicts.get(edge.trigger.criterion))
                if edge.wanted is None:
                    edge.written = wanted  # how it was at the start is no edge
                edge.wanted = wanted
            if any(edge.waits for edge in self._edges):
                self._condition.notify()

    def close(self) -> None:
        """End; what waits is not written any more."""
        with self._condition:
            self._stopping = True
            self._condition.notify()
        if self._thread.is_alive():
            self._thread.join(STOP_WITHIN)

    def _run(self) -> None:
        while (job := self._next()) is not None:
            edge, wanted = job
            reason = asyncio.run(_write(edge, wanted, self._folder))
            with self._condition:
                edge.due = time.monotonic() + edge.trigger.every
                if reason and not edge.failing:
                    _log.warning("%s: could not be written: %s", edge.variable.name, reason)
                elif not reason:
                    edge.written = wanted
                    word = str(wanted).lower()
                    _log.info("%s: %s written (%s)", edge.variable.name, word, edge.trigger.criterion)
                edge.failing = bool(reason)

    def _next(self) -> tuple[_Edge, bool] | None:
        """The edge that is to be written next; None when the run is over."""
        with self._condition:
            while not self._stopping:
                now = time.monotonic()
                waiting = [edge for edge in self._edges if edge.waits]
                first = min(waiting, key=lambda edge: edge.due, default=None)
                if first is not None and first.due <= now:
                    return first, bool(first.wanted)
                self._condition.wait(None if first is None else first.due - now)
        return None


async def _write(edge: _Edge, wanted: bool, folder: Path) -> str:
    """Write one edge; why it could not be, or nothing."""
    try:
        raw = wanted != edge.variable.inverted
        await asyncio.wait_for(edge.writer.write(edge.variable, raw, folder), WITHIN)
    except (OSError, EOFError, SeerobError) as error:
        return because(error)
    except Exception as error:
        _log.exception("%s: a mistake in the source itself", edge.variable.name)
        return type(error).__name__
    return ""


def _writer(sources: Mapping[str, object], variable: Variable) -> Writes:
    source = sources[variable.source]
    if not hasattr(source, "write"):
        what = f"{variable.source}, a source of this kind, writes nothing"
        remedy = "take one that can: modbus, mqtt, opcua, siemens_web"
        raise InputError.at("triggers", variable.name, what, remedy)
    found: Writes = source
    return found
