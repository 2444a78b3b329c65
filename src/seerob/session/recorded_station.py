"""The workstation of a recording, made again from its files, and its sources, to be played again."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from msgspec.structs import replace

from seerob.core.errors import InputError, Problem
from seerob.core.samples import Sample
from seerob.recording.format import SOURCES
from seerob.recording.recording import Recording
from seerob.session.reading import read
from seerob.session.station import Station
from seerob.workstation.allowed import Allowed
from seerob.workstation.source import Opened, Source
from seerob.workstation.workstation import file_among

_REMEDY = "give the workstation that it was made with (--workstation)"


def load_recorded(
    recording: Recording,
    *,
    cache: Path | None = None,
    allow_plugins: bool = False,
    allow_outside: bool = False,
) -> Station:
    """The workstation that a recording was made with, from the files inside it.

    Args:
        recording: The recording.
        cache: Folder that keeps what takes long to make between starts.
        allow_plugins: Whether dotted kinds that no installed package offers are imported by their names.
        allow_outside: Whether descriptions that it names outside its folder are read from this machine.

    Raises:
        InputError: It needs files that the recording does not carry, or that have changed since.
    """
    with TemporaryDirectory(prefix="seerob-") as folder:
        recording.extract(Path(folder))
        allowed = Allowed(allow_plugins, allow_outside, replayed=True)
        try:
            file = Path(folder) / file_among(recording.files)
            station = Station(read(file, allowed), cache=cache)
        except InputError as error:
            problems = [p._replace(file=p.file.removeprefix(f"{folder}/")) for p in error.problems]
            raise InputError(
                [*problems, Problem(str(recording.path), "", "cannot be computed from itself", _REMEDY)]
            ) from error
        # Read while the folder is there.
        now, then = station.files, recording.files
        _ = station.bound
    compared = (name for name in {*now, *then} if not name.startswith(SOURCES))
    changed = sorted(name for name in compared if now.get(name) != then.get(name))
    if changed:
        what = f"was made with other files than are found now: {', '.join(changed[:6])}"
        raise InputError.at(recording.path, "", what, _REMEDY)
    return station


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
