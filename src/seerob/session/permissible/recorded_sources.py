"""The sources of a recording: what each of them said, to be played again."""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from seerob.core.samples import Sample
from seerob.workstation.source import Opened, Source


def recorded_sources(
    sources: Iterable[Source], samples: Iterable[Sample], duration: float
) -> tuple[tuple[Source, Opened], ...]:
    """Every source with its recorded samples; rounds of a loop follow each other as they were played.

    Args:
        sources: Of the workstation.
        samples: Of the recording, in order.
        duration: Of the recording [s].
    """
    heard: dict[str, list[Sample]] = {}
    for sample in samples:
        own = heard.setdefault(sample.source, [])
        # A sample that speaks of no later instant says nothing new.
        if not own or sample.t > own[-1].t:
            own.append(sample)
    return tuple(
        (replace(source, loop=False), Opened(samples=heard.get(source.name, []), duration=duration))
        for source in sources
    )
