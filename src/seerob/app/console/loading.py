"""The workstation of a command, read and compiled: every mistake in it at once.

A file with mistakes is read less what is wrong, so that the rest can be looked at too. An entry that is wrong
is left out, and with it what speaks of it: that it leads nowhere is no mistake of its own.
"""

from __future__ import annotations

import gc
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import msgspec

from seerob.app.console.progress import compile_loops, spinner
from seerob.app.console.terminal import cache_folder
from seerob.core.errors import InputError, Problem
from seerob.core.files.parser_process import begin
from seerob.description.formats.resolve import as_written_or_in_other_case
from seerob.workstation.allowed import NOTHING, Allowed
from seerob.workstation.naming import Entries, Named
from seerob.workstation.workstation import Workstation

if TYPE_CHECKING:
    from seerob.session.station import Station


_ENTRY = re.compile(r"(\w+)\[(\d+)\]")


@dataclass(frozen=True)
class Draft:
    """What of a workstation file can be looked at, whatever else is wrong in it."""

    file: str
    """Path that the user gave."""
    head: Workstation
    entries: Entries
    names: tuple[Named, ...]

    @property
    def station(self) -> Workstation:
        """Return a workstation whose entries are numbered without what is left out."""
        from seerob.session.reading import with_entries

        return with_entries(self.head, self.entries)

    @property
    def empty(self) -> bool:
        """Whether nothing is left that could be compiled."""
        return not any(self.entries[group] for group in ("robots", "humans", "parts", "machines"))

    def in_file(self, problems: Iterable[Problem]) -> list[Problem]:
        """Problems of `station` by the file's full name, with the numbers that its entries have there."""
        return [
            p._replace(
                file=self.file if p.file in self.head.files else p.file,
                key=_ENTRY.sub(self._number, p.key, count=1),
            )
            for p in problems
        ]

    def without(self, problems: Iterable[Problem]) -> Self:
        """Less the entries that problems name, and what speaks of them."""
        wrong = _named(problems)
        entries = {
            g: {i: e for i, e in found.items() if (g, i) not in wrong} for g, found in self.entries.items()
        }
        size = -1
        while size != (size := sum(map(len, entries.values()))):
            lost = {n.name for n in self.names if n.entry not in entries[n.table]}
            entries = {
                g: {i: _freed(e, lost) for i, e in found.items() if not _speaks_of(g, e, lost)}
                for g, found in entries.items()
            }
        return replace(self, entries=entries)

    def own(self, problems: Iterable[Problem]) -> list[Problem]:
        """The problems that do not follow from another of them."""
        problems = list(problems)
        wrong = _named(problems)
        kept = []
        for problem in problems:
            places = _named([problem])
            others = {n.name for n in self.names if (n.table, n.entry) in wrong - places}
            entries = ((g, self.entries[g][i]) for g, i in places if i in self.entries.get(g, {}))
            if not any(_speaks_of(group, entry, others) for group, entry in entries):
                kept.append(problem)
        return kept

    def less(self, other: Draft) -> Self:
        """The entries that another draft does not have."""
        entries = {
            g: {i: e for i, e in found.items() if i not in other.entries[g]}
            for g, found in self.entries.items()
        }
        return replace(self, entries=entries)

    def missing_files(self, known: Iterable[Problem], *, sources: bool) -> list[Problem]:
        """Files that do not exist, of entries that nothing else looked at.

        Args:
            known: Problems that have been found; what they name has been looked at.
            sources: Whether the files of sources are needed.
        """
        reported = _named(known)
        fields = {
            "tools": "mesh",
            "workpieces": "mesh",
            "areas": "mesh",
            **({"sources": "file"} if sources else {}),
        }
        problems = []
        for group, field in fields.items():
            for i, entry in self.entries[group].items():
                name = getattr(entry, field, None)
                if (group, i) in reported or not isinstance(name, str) or ":" in name:
                    continue
                if as_written_or_in_other_case(Path(self.head.folder) / name) is None:
                    what, remedy = f"no such file {name!r}", "name one that exists"
                    problems.append(Problem(self.file, f"{group}[{i}].{field}", what, remedy))
        return problems

    def _number(self, found: re.Match[str]) -> str:
        numbers = list(self.entries.get(found[1], ()))
        at = int(found[2])
        return f"{found[1]}[{numbers[at]}]" if at < len(numbers) else found[0]


def _named(problems: Iterable[Problem]) -> set[tuple[str, int]]:
    """Table and number of the entries that problems are in."""
    found = (_ENTRY.match(problem.key) for problem in problems)
    return {(match[1], int(match[2])) for match in found if match}


def _freed(entry: Any, lost: set[str]) -> Any:
    """A robot without its tool when that is lost: the rest of it can be looked at."""
    return msgspec.structs.replace(entry, tool=None) if getattr(entry, "tool", None) in lost else entry


def _speaks_of(group: str, entry: Any, lost: set[str]) -> bool:
    """Whether an entry needs one of the names that are lost."""
    if not lost or group in ("robots", "humans", "parts", "machines", "sinks"):
        return False
    if group in ("safety", "ergonomics") and not any(entry.subjects()):
        return True  # of all, or of the only one: who that is cannot be told any more
    where = entry.on if group in ("tools", "workpieces", "areas") else msgspec.to_builtins(entry)
    return any(_means(text, name) for text in _texts(where) for name in lost)


def _means(text: str, name: str) -> bool:
    below = text.startswith(f"{name}/") or name.startswith(f"{text}/")
    return text == name or below or any(sign in text for sign in "*?[")


def _texts(value: object) -> Iterator[str]:
    """Every text in a table, but for its own name."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, item in value.items():
            if key != "name":
                yield from _texts(item)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _texts(item)


def compiled(
    path: Path,
    allowed: Allowed = NOTHING,
    *,
    quiet: bool = False,
    sources: bool = True,
    raw: bytes | None = None,
) -> Station:
    """The workstation of a path: read, compiled, its criteria bound and its sources open.

    Args:
        path: Workstation file, or the folder of one.
        allowed: What the file may do.
        quiet: Show nothing meanwhile, not even on a terminal.
        sources: Whether its sources will be played.
        raw: What is to be read in place of the file, while a page edits it.

    Raises:
        InputError: With every mistake in the file and in the files it names, those of criteria and
            sources included, also where an entry before them is wrong; or it describes nothing.
    """
    from seerob.workstation.workstation import locate

    file = locate(path)
    # Drafts come and go: nothing that one of them made may be kept for good.
    with uncollected() if raw is None else nullcontext():
        return _compiled(path, file, allowed, quiet=quiet, sources=sources, raw=raw)


@contextmanager
def uncollected() -> Iterator[None]:
    """No search for garbage meanwhile, nor among what was made: it was a tenth of a start.

    A start makes much and leaves little behind.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.freeze()
            gc.enable()


def _compiled(
    path: Path, file: Path, allowed: Allowed, *, quiet: bool, sources: bool, raw: bytes | None
) -> Station:
    compile_loops()  # before the imports: many loops are compiled by them
    from seerob.session.reading import readable, shortened

    found = readable(path, allowed, raw)
    if sources and any(_is_workbook(source) for source in found.entries["sources"].values()):
        begin("seerob.files.tables.table_files", "openpyxl")
    if any(_is_mjcf(robot) for robot in found.entries["robots"].values()):
        begin("seerob.description.formats.mjcf_compiled", "mujoco")
    from seerob.session.station import Station

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


def _is_workbook(source: object) -> bool:
    return str(getattr(source, "file", "")).lower().endswith((".xlsx", ".xlsm"))


def _is_mjcf(robot: object) -> bool:
    return str(getattr(robot, "model", "")).lower().endswith(".xml")


def _unprepared(station: Station, *, sources: bool) -> list[Problem]:
    """Mistakes of all criteria and of all sources."""
    problems: list[Problem] = []
    for prepare in (lambda: station.bound, lambda: station.sources if sources else ()):
        try:
            prepare()
        except InputError as error:
            problems += error.problems
    return problems
