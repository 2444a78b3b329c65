"""Two runs, recordings or workstations compared: ``sr.compare(a, b)`` and ``seerob compare``."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from seerob.core.errors import InputError
from seerob.core.samples import Sample
from seerob.core.snapshot import Finding, Scene, Snapshot
from seerob.devices.live.receivers import require_recorded
from seerob.outputs.comparison import (
    Change,
    Compared,
    Comparison,
    Side,
    Turn,
    compared,
    conditions,
)
from seerob.outputs.picture.picture import Stage
from seerob.outputs.sink import AtEndWithResults
from seerob.recording.format import SOURCES
from seerob.recording.recording import Recording
from seerob.recording.result_log import result_named
from seerob.session.run import Summary
from seerob.session.station import Station, load
from seerob.workstation.workstation import file_among

Say = Callable[[str, float], None]
"""Told what is done, and how far it is [s of the run]."""

Comparable = Path | str | Recording | Station | Summary
"""What can be compared: a recording, a folder of a run, a workstation, or what Python has of them."""


@dataclass(frozen=True)
class _Opened:
    side: Side
    files: Mapping[str, bytes] | None
    meshes: dict[str, bytes]
    at_worst: Callable[[str], Snapshot | None]
    """The snapshot in which a criterion is at its worst; None where nobody kept it."""


class _KeepsWorst(AtEndWithResults):
    """Keeps one snapshot per criterion, that of its worst instant."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene.criteria)
        self.worst: dict[str, Snapshot] = {}

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick."""
        for name in self.log.add(snapshot):
            self.worst[name] = snapshot

    def close(self) -> None:
        """Nothing is written."""


def compare(
    before: Comparable,
    after: Comparable,
    *,
    pictures: int = 0,
    opened: Callable[[Path], Station] = load,
    say: Say = lambda what, t: None,
) -> Comparison:
    """Compare two evaluations: what changed in the file, which verdicts turned, and margins.

    A recording says what was said when it was recorded; a workstation is run, as fast as it can be.

    Args:
        before: A recording, the folder of a run with its recording in it, a workstation (folder or file), or
            an opened recording, a station, or what a run came to.
        after: The other.
        pictures: Of so many criteria that turned their worst instants are drawn, both from one viewpoint.
        opened: How a workstation is read and compiled.
        say: Told what is run, and how far [s].

    Returns:
        `Comparison`: ``changes``, ``conditions``, ``criteria``, ``turn``, ``json()``, ``html()``.

    Raises:
        InputError: There is nothing to compare at a path, a folder holds several recordings, or a workstation
            has mistakes or live sources.
    """
    one, other = (_opened(which, opened, say) for which in (before, after))
    if one.side.title == other.side.title:
        first, second = (replace(s.side, title=f"{s.side.title}{n}") for s, n in ((one, ""), (other, " (2)")))
        one, other = replace(one, side=first), replace(other, side=second)
    changes, files = _changes(one.files, other.files)
    criteria = compared(one.side, other.side)
    return Comparison(
        before=one.side,
        after=other.side,
        conditions=conditions(one.side, other.side),
        changes=changes,
        files=files,
        criteria=criteria,
        pictures=_pictures(one, other, criteria, pictures) if pictures else {},
    )


# -- what is compared -----------------------------------------------------------------------------


def _opened(given: Comparable, opened: Callable[[Path], Station], say: Say) -> _Opened:
    if isinstance(given, Recording):
        return _recorded(given, given.path.name)
    if isinstance(given, Summary):
        return _Opened(_side(given.scene.title, given), None, {}, lambda name: None)
    if isinstance(given, Station):
        return _run(given, given.workstation.title, say)
    path = Path(given)
    if path.is_dir():
        recordings = sorted(path.glob("*.mcap"))
        if len(recordings) > 1:
            names = ", ".join(file.name for file in recordings)
            raise InputError.at(path, "", f"holds several recordings: {names}", "name one of them")
        if recordings and not (path / "workstation.toml").exists():
            return _recorded(Recording.open(recordings[0]), str(given))
    elif path.suffix == ".mcap":
        return _recorded(Recording.open(path), str(given))
    return _run(opened(path), str(given), say)


def _side(title: str, summary: Summary) -> Side:
    return Side(title, summary.scene, summary.results, summary.duration, _worth(summary.scene.findings))


def _worth(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    return tuple(dict.fromkeys(f for f in findings if f.holds or f.level != "note"))


def _recorded(recording: Recording, title: str) -> _Opened:
    results = recording.results

    def at_worst(name: str) -> Snapshot | None:
        series = results[name]
        worst = series.worst() if series.known else None
        return None if worst is None else recording.snapshot_at(worst.t)

    findings = _worth((*recording.scene.findings, *recording.findings))
    side = Side(title, recording.scene, results, recording.duration, findings)
    return _Opened(side, recording.files, recording.meshes, at_worst)


def _run(station: Station, title: str, say: Say) -> _Opened:
    require_recorded(station.workstation)
    scene = station.scene()
    keeps = _KeepsWorst(scene)
    summary = station.run(writers=[keeps], scene=scene, progress=lambda t: say(title, t))
    return _Opened(_side(title, summary), station.files, station.model.meshes, keeps.worst.get)


# -- what changed in the file ---------------------------------------------------------------------


def _changes(
    before: Mapping[str, bytes] | None, after: Mapping[str, bytes] | None
) -> tuple[tuple[Change, ...] | None, tuple[str, ...]]:
    """Keys of the workstation file that differ, and what became of the others."""
    if before is None or after is None:
        return None, ()
    one, other = file_among(before), file_among(after)
    texts = (before[one], after[other])
    then, now = (tomllib.loads(text.decode("utf-8-sig")) for text in texts)
    changes = tuple(_differing(then, now))
    said = []
    if not changes and before[one] != after[other]:
        said.append(f"{other}: only comments, order or layout differ")
    rest = dict.fromkeys((*before, *after))
    for name in (name for name in rest if name not in (one, other)):
        shown = name.removeprefix(SOURCES).removesuffix(".sha256" if name.startswith(SOURCES) else "")
        if name not in after:
            said.append(f"{shown}: is named no more")
        elif name not in before:
            said.append(f"{shown}: was not named before")
        elif sha256(before[name]).digest() != sha256(after[name]).digest():
            said.append(f"{shown}: has other content")
    return changes, tuple(said)


def _differing(then: Any, now: Any, key: str = "") -> Iterator[Change]:
    """Keys of two tables that say other things; an entry that only one has is one key."""
    if isinstance(then, dict) and isinstance(now, dict):
        for name in dict.fromkeys((*then, *now)):
            yield from _differing(then.get(name), now.get(name), f"{key}.{name}" if key else name)
    elif _is_list_of_tables(then) and _is_list_of_tables(now):
        named, other = (dict(zip(_names(each), each, strict=True)) for each in (then, now))
        for name in dict.fromkeys((*named, *other)):
            yield from _differing(named.get(name), other.get(name), f"{key}[{name}]")
    # In Python 1 is True.
    elif then != now or isinstance(then, bool) is not isinstance(now, bool):
        yield Change(key, then, now)


def _is_list_of_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(one, dict) for one in value)


def _names(entries: Sequence[Mapping[str, Any]]) -> list[str]:
    """Of tables in a list: by their names, else the first, second… of their kind or of all."""
    named = [entry.get("name") for entry in entries]
    counts, found = Counter(str(name) for name in named if name is not None), []
    seen: Counter[str] = Counter()
    for entry, name in zip(entries, named, strict=True):
        kind = str(entry.get("kind", ""))
        seen[kind] += 1
        if name is not None and counts[str(name)] == 1:
            found.append(f'"{name}"')
        else:
            found.append(f"{kind} {seen[kind]}".strip())
    return found


# -- pictures -------------------------------------------------------------------------------------


def _pictures(
    before: _Opened, after: _Opened, criteria: Sequence[Compared], most: int
) -> dict[str, tuple[bytes | None, bytes | None]]:
    """Worst instants of criteria that turned, each pair from the viewpoint that shows the second best."""
    turned = [one for one in criteria if one.turn in (Turn.EXCEEDED, Turn.UNDECIDED, Turn.WITHIN)]
    sides = (before, after)
    stages = [Stage(each.side.scene, each.meshes) for each in sides] if turned else []
    found: dict[str, tuple[bytes | None, bytes | None]] = {}
    for one in turned:
        if len(found) == most:
            break
        snapshots = [
            each.at_worst(one.name) if series is not None else None
            for each, series in zip(sides, (one.before, one.after), strict=True)
        ]
        results = [None if s is None else result_named(s, one.name) for s in snapshots]
        drawn: list[bytes | None] = [None, None]
        camera = None
        for k in (1, 0):
            snapshot, result = snapshots[k], results[k]
            if snapshot is None or not sides[k].meshes:
                continue
            info = sides[k].side.criterion(one.name)
            subjects = () if info is None else info.subjects
            camera = camera or stages[k].view(snapshot, result, subjects=subjects)
            drawn[k] = stages[k].picture(snapshot, result, camera=camera)
        if any(drawn):
            found[one.name] = drawn[0], drawn[1]
    return found
