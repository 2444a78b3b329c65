"""What opening, checking, assessing, running and serving a workstation would do, told without any of it.

Nothing is read but the workstation file and, in its folder, the descriptions of robots, as text; nothing of
them is evaluated. No process is started, no connection made, no name looked up, and nothing imported that is
not of seerob: what installed packages offer is known by their entry points.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import NamedTuple

from seerob.core import plugin
from seerob.core.errors import InputError, SeerobError
from seerob.core.files.bounded import leads_outside
from seerob.core.files.toml_file import parsed_toml, read_toml
from seerob.devices.live.camera_pictures import allowed
from seerob.devices.live.listening import SECRETS, Contact, LiveSource
from seerob.recording.recording import Recording
from seerob.workstation.allowed import Named, named_outside, texts
from seerob.workstation.conversion import convert
from seerob.workstation.source import Source
from seerob.workstation.workstation import PLUGINS, file_among, locate

LARGEST = 64 * 2**20
"""A description that is larger [byte] is not looked into."""
PARSERS = {
    ".xacro": "xacro, which evaluates expressions",
    ".dae": "the parser of COLLADA",
    ".xlsx": "the parser of workbooks",
    ".xlsm": "the parser of workbooks",
    ".bag": "the parser of bags",
    ".db3": "the parser of bags",
}
"""Ending of a file → what reads it in a process of its own."""
_DESCRIPTIONS = (".urdf", ".xacro", ".xml")
_NAMES = re.compile(rb"""(?:\bfile(?:name)?\s*=\s*["']|load_yaml\(\s*["'])([^"'<>\n]{1,4096})""")
_MJCF = re.compile(rb"<(?:\w+:)?mujoco\b")
_SHOWN = 500


class Fact(NamedTuple):
    """One thing that would be done."""

    does: str
    """``reads``, ``outside``, ``starts``, ``imports``, ``connects``, ``listens``, ``sends``, ``writes``,
    ``refused`` or ``note``."""
    what: str


def inspected(path: Path | str) -> list[Fact]:
    """What would be done with a folder, a workstation file or a recording.

    Raises:
        InputError: There is no such file, or it is not what it should be.
    """
    path = Path(path)
    if path.suffix.lower() == ".mcap" and path.is_file():
        return _of_recording(Recording.open(path))
    file = locate(path)
    folder = file.parent
    if (real := leads_outside(file, folder)) is not None:
        return [Fact("outside", f"{file} leads to {real}: refused without --allow-outside")]
    table, _ = read_toml(file)
    facts = [Fact("reads", str(file))]
    return [*facts, *_shortened([*_files(table, file, folder), *_rest(table, file)])]


def _of_recording(recording: Recording) -> list[Fact]:
    file = file_among(recording.files)
    facts = [Fact("reads", f"{recording.path}, with {len(recording.files)} files in it")]
    facts += [Fact("reads", f"{name}, {len(data)} bytes, in it") for name, data in recording.files.items()]
    facts.append(
        Fact(
            "note",
            "replay serves the page, and opens none of its files before somebody measures there; "
            "report opens them, as here:",
        )
    )
    table = parsed_toml(recording.files[file], Path(file)) if file in recording.files else {}
    nowhere = recording.path.parent / "…"
    found = (outside for outside in _outside(table, file, nowhere) if not outside.key.startswith("sources["))
    facts += [_refused(outside) for outside in found]
    facts += [fact for name in recording.files for fact in _parser(name)]
    live = [fact for fact in _rest(table, Path(file)) if fact.does not in ("connects", "listens", "sends")]
    return _shortened([*facts, *live])


def _shortened(facts: list[Fact]) -> list[Fact]:
    facts = list(dict.fromkeys(facts))
    kept = facts[:_SHOWN]
    return kept if len(kept) == len(facts) else [*kept, Fact("note", f"and {len(facts) - _SHOWN} more")]


def _outside(table: Mapping[str, object], file: object, folder: Path) -> list[Named]:
    try:
        return list(named_outside(table, folder))
    except ValueError as error:
        raise InputError.at(file, "", str(error), "no table needs more than four levels") from None


def _refused(outside: Named) -> Fact:
    return Fact("outside", f"{outside.real} ({outside.key}): refused without --allow-outside")


# -- files ------------------------------------------------------------------------------------


def _files(table: Mapping[str, object], file: Path, folder: Path) -> Iterator[Fact]:
    """What is read, inside and outside the folder."""
    outside = _outside(table, file, folder)
    yield from map(_refused, outside)
    away = {named.key for named in outside}
    for key, text in texts(table):
        if text.startswith("package:"):
            yield Fact("reads", f"files of the installed package {text.split(':')[1].split('/')[0]} ({key})")
        elif text.startswith("description:"):
            yield Fact("reads", f"a repository in the cache of robot_descriptions, {text} ({key})")
        if key in away or not 0 < len(text) <= 4096:
            continue
        try:
            path = folder / text
            if path.is_file():
                yield Fact("reads", f"{text} ({key})")
                yield from _parser(text)
                if path.suffix.lower() in _DESCRIPTIONS:
                    yield from _named_in(path, text, folder)
            elif path.is_dir() and path.resolve() != folder.resolve():
                yield Fact("reads", f"files in the folder {text} ({key})")
        except (OSError, ValueError):
            continue  # no name of a file


def _parser(name: str) -> Iterator[Fact]:
    if (what := PARSERS.get(Path(name).suffix.lower())) is not None:
        yield _started(what, name)


def _started(what: str, name: str) -> Fact:
    return Fact("starts", f"a process with limits of memory and time for {what} ({name})")


def _named_in(path: Path, shown: str, folder: Path) -> Iterator[Fact]:
    """What a description names in turn, found as text."""
    if path.stat().st_size > LARGEST:
        yield Fact("note", f"{shown} has more than {LARGEST} bytes and is refused")
        return
    text = path.read_bytes()
    if _MJCF.search(text):
        yield _started("MuJoCo's reader of MJCF", shown)
    for found in dict.fromkeys(match[1].decode(errors="replace") for match in _NAMES.finditer(text)):
        plain = found.removeprefix("file://")
        if "://" in plain or "$" in plain:
            yield Fact("reads", f"{found}, where that is in the folder or installed (named in {shown})")
        elif (real := leads_outside(path.parent / plain, folder)) is not None:
            yield Fact("outside", f"{real} (named in {shown}): refused without --allow-outside")
        else:
            yield Fact("reads", f"{found} (named in {shown})")
            yield from _parser(found)


# -- what runs, who is connected to, what is written --------------------------------------------


def _rest(table: Mapping[str, object], file: Path) -> Iterator[Fact]:
    for group in PLUGINS:
        offered = plugin.offered(group)
        entries = table.get(group, [])
        for i, entry in enumerate(entries if isinstance(entries, list) else ()):
            kind = entry.get("kind") if isinstance(entry, dict) else None
            if not isinstance(kind, str):
                continue
            if "." in kind:
                yield _imported(kind, f"{group}[{i}].kind", offered.get(kind))
            elif group == "sources":
                yield from _source(kind, entry, f"sources[{i}]", file)
            elif group == "emulators":
                yield Fact("starts", f"{kind}, only with run --emulated (emulators[{i}])")
            elif group == "sinks":
                yield Fact("writes", f"{entry.get('file', kind)}, in the folder of results (sinks[{i}])")
    yield from _writing(table)
    cameras = table.get("cameras", [])
    for i, camera in enumerate(cameras if isinstance(cameras, list) else ()):
        if isinstance(camera, dict) and isinstance(address := camera.get("address"), str):
            host = "" if allowed(address, ()) else ", only with run --allow-camera"
            yield Fact("connects", f"run: cameras[{i}] fetches pictures from {address[:200]}{host}")
    yield Fact("starts", "at the first start on a machine, processes that compile the inner loops")
    yield Fact("listens", "run and replay serve the page on 127.0.0.1; --host says where else")
    yield Fact("writes", "what takes long to make, in seerob's cache folder")
    yield Fact("writes", "run, assess: a recording, a report and a workbook in runs/<time>, or in -o")


def _imported(kind: str, key: str, point: EntryPoint | None) -> Fact:
    if point is None:
        text = "offered by no installed package; --allow-plugins imports it, which runs it"
        return Fact("refused", f"module {kind} ({key}): {text}")
    who = f"{point.dist.name} {point.dist.version}" if point.dist else "an installed package"
    return Fact("imports", f"{point.value} of {who}, which runs its code ({key} = {kind!r})")


def _source(kind: str, entry: Mapping[str, object], key: str, file: Path) -> Iterator[Fact]:
    rest = {name: value for name, value in entry.items() if name != "kind"}
    try:
        wanted = plugin.load("sources", kind, Source)
    except SeerobError:
        yield Fact("refused", f"{key}: there is no kind {kind!r}")
        return
    if not issubclass(wanted, LiveSource):
        return
    source = convert(rest, wanted, file=str(file), key=key, problems=[], beside=("kind",))
    contact = _raw(rest) if source is None else source.contact()
    does = "listens" if contact.where.startswith("listens") else "connects"
    yield Fact(does, f"run, probe: {key} ({kind}) {contact}" + (" (has mistakes)" if source is None else ""))
    if wanted.own_process:
        yield Fact("starts", f"run: a process that listens for {key}")
    if contact.secret:
        to = "only where your environment or your credentials file allows that host"
        yield Fact("sends", f"run, probe: the secret {contact.secret} to whom {key} {contact.where}, {to}")


def _raw(rest: Mapping[str, object]) -> Contact:
    """Whom an entry with mistakes would speak to, as far as it says."""
    where = ", ".join(
        f"{key} = {rest[key]}" for key in ("url", "host", "bind", "sender", "port") if key in rest
    )
    secret = next((str(rest[key]) for key in SECRETS if key in rest), "")
    return Contact(f"connects or listens: {where or 'as the kind has it'}", str(rest.get("user", "")), secret)


def _writing(table: Mapping[str, object]) -> Iterator[Fact]:
    """Triggers and targets, which write to machines."""
    may = (
        "" if table.get("allow_writing") is True else "; allow_writing is not set, so that nothing is written"
    )
    for group in ("triggers", "targets"):
        entries = table.get(group, [])
        for i, entry in enumerate(entries if isinstance(entries, list) else ()):
            if isinstance(entry, dict):
                whom = entry.get("variable") or f"{entry.get('topic')} at {entry.get('host')}"
                yield Fact("writes", f"run --allow-writing: to machines, {whom} ({group}[{i}]){may}")
