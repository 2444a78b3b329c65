"""The workstation of a command, read and compiled: every mistake in it at once."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.console.loops import tell_compiling
from seerob.app.console.progress import spinner
from seerob.app.console.terminal import cache_folder
from seerob.core.errors import InputError, Problem

if TYPE_CHECKING:
    from seerob.session.station import Station


def compiled(path: Path, *, quiet: bool = False, sources: bool = True) -> Station:
    """The workstation of a path: read, compiled, its criteria bound and its sources open.

    Args:
        path: Workstation file, or the folder of one.
        quiet: Show nothing meanwhile, not even on a terminal.
        sources: Whether its sources will be played.

    Raises:
        InputError: With every mistake in the file and in the files it names, those of criteria and
            sources included, also where an entry before them is wrong; or it describes nothing.
    """
    from seerob.workstation.workstation import locate

    file = locate(path)
    tell_compiling()  # before the imports: many loops are compiled by them
    from seerob.app.console.draft import Draft
    from seerob.session.reading import readable, shortened
    from seerob.session.station import Station

    found = readable(path)
    problems = list(found.problems)
    whole = Draft(str(file), found.head, found.entries, tuple(found.names))
    draft = whole.without(found.between)
    station = None
    if draft.empty and not problems:
        what = "describes nothing: no robot, no human, no part"
        raise InputError.at(whole.file, "", what, "add [[robots]]; `seerob new` shows how")
    with spinner(quiet=quiet) as say:
        while station is None and not draft.empty:
            try:
                station = Station(draft.station, cache=cache_folder(), progress=say)
            except InputError as error:
                more = draft.in_file(error.problems)
                problems += draft.own(more)
                left = draft.without(more)
                if left.entries == draft.entries:
                    break
                draft = left
        if station is not None:
            problems += draft.in_file(_unprepared(station, sources=sources))
    if problems or station is None:
        unseen = whole if station is None else whole.less(draft)
        raise InputError(shortened([*problems, *unseen.missing_files(problems, sources=sources)]))
    return station


def _unprepared(station: Station, *, sources: bool) -> list[Problem]:
    """Mistakes of all criteria and of all sources."""
    problems: list[Problem] = []
    for prepare in (lambda: station.bound, lambda: station.sources if sources else ()):
        try:
            prepare()
        except InputError as error:
            problems += error.problems
    return problems
