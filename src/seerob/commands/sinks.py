"""The sinks of a run: those of the workstation file, and the usual ones where it names none of a kind."""

from __future__ import annotations

from msgspec.structs import replace

from seerob.sink import Sink
from seerob.sinks.dossier import Dossier
from seerob.sinks.excel import Excel
from seerob.sinks.recorder import Recorder
from seerob.workstation import Workstation


def sinks_of(workstation: Workstation, *, lossless: bool, record: bool = True) -> list[Sink]:
    """Sinks for a run.

    Args:
        workstation: Whose ``[[sinks]]`` come first.
        lossless: Whether the recorder may hold the run up: only when the run is not live.
        record: Whether to record at all; not when a recording is computed again.
    """
    usual: list[Sink] = [Recorder(), Dossier(), Excel()]
    named = list(workstation.sinks)
    chosen = named + [sink for sink in usual if not any(type(sink) is type(other) for other in named)]
    if not record:
        chosen = [sink for sink in chosen if not isinstance(sink, Recorder)]
    return [replace(s, lossless=lossless) if isinstance(s, Recorder) else s for s in chosen]
