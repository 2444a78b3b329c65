"""A recording for others: computed again from its samples, without what says where, by whom and of whom.

Nothing is cut out of the bytes of the recording. Its workstation file is written anew with what is judged,
its samples are named anew, and both are run and recorded like any run; what comes of that has to be judged as
the recording was, or nothing is written.
"""

from __future__ import annotations

import getpass
import io
import re
import shutil
import socket
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile, ZipInfo

from msgspec.structs import replace

from seerob.core.errors import InputError, Problem
from seerob.core.files.bounded import TooLarge, unpacked
from seerob.core.files.toml_file import parsed_toml
from seerob.core.files.whole_file import whole_file
from seerob.core.samples import BodySample, GrabSample, Sample, SignalSample
from seerob.core.snapshot import Finding
from seerob.files.tables.mapping import toml_value
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.format import OUTSIDE, SOURCES
from seerob.recording.recording import Recording, unpack
from seerob.recording.result_log import log_of
from seerob.session.reading import read
from seerob.session.scene import scene_of
from seerob.session.station import Station
from seerob.workstation.allowed import Allowed
from seerob.workstation.workstation import FILE_NAME, file_among

NOWHERE = "192.0.2.1"
"""Instead of hosts: an address for documentation, which nobody has (RFC 5737)."""
_UNNAMED = "…"
MAX_WORKBOOK = 256 << 20
"""Most that a workbook which is kept unpacks to [byte]."""

_HOSTS = ("host", "sender", "bind", "server")
_OF_ACCESS = ("user", "ca", "certificate", "key", "server_certificate", "security")
_FREE = ("title", "description", "why", "published_mass_source", "source_note")
_DROPPED_TABLES = ("cameras", "sinks", "triggers", "targets", "allow_writing", "description")
_ROOTS = r"(?:home|Users|root|mnt|media|data|tmp|var|etc|opt|srv|private|Volumes|run|usr)"
_PATH = re.compile(rf"""(?:file://|(?<![\w.:/])/{_ROOTS}/|~[\w.-]*/|\b[A-Za-z]:[\\/]|\\\\)[^\s"'<>|;,]*""")
_ANY_PATH = re.compile(r"""(?<![\w.:/…])/[\w.-]+/[^\s"'<>|;,]*""")
_OWNER = re.compile(r"(?:/home/|/Users/|[A-Za-z]:[\\/]Users[\\/])([^\s/\\\"'<>|;,]+)")
_URL = re.compile(r"\b(?!package:|model:|library:|file:)(\w+://)[^/\s\"']+[^\s\"']*")
_MAIL = re.compile(r"(?<![\w.+-])[\w.+-]++@[\w-]++\.[\w.]+")
_IP = re.compile(r"(?<![\w.])(?!127\.|0\.0\.0\.0|192\.0\.2\.1\b)\d{1,3}(?:\.\d{1,3}){3}(?![\w.])")
_IP6 = re.compile(r"(?<![\w:])(?:[0-9a-fA-F]{0,4}:){3,7}[0-9a-fA-F]{0,4}(?![\w:])")
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_AUTHORS = re.compile(rb"<(author|authoring_tool|source_data|comments|copyright)>[^<]*</\1>")
_XML = (".urdf", ".xacro", ".xml", ".dae")
_COMMON = {"root", "user", "admin", "localhost", "operator", "person", "human", "worker"}


class Shared(NamedTuple):
    """What became of a recording."""

    dropped: tuple[str, ...]
    """What is not in it any more, in words."""
    kept: tuple[str, ...]
    """Files that are in it, for whoever shares it to look through."""


class _Words:
    """Names and places that are written over, and what by."""

    def __init__(self) -> None:
        self._by: dict[str, str] = {}
        self._pattern: re.Pattern[str] | None = None

    def add(self, word: str, by: str) -> None:
        if len(word) > 2 and word != by:
            self._by.setdefault(word.casefold(), by)
            longest = sorted(self._by, key=len, reverse=True)
            self._pattern = re.compile(
                rf"(?<![\w-])(?:{'|'.join(map(re.escape, longest))})(?![\w-])", re.IGNORECASE
            )

    def named(self, text: str) -> str:
        """A text with words, addresses and paths that are known to be such written over."""
        if self._pattern is not None:
            text = self._pattern.sub(lambda found: self._by[found[0].casefold()], text)
        text = _PATH.sub(_UNNAMED, text)
        text = _MAIL.sub(_UNNAMED, _URL.sub(rf"\g<1>{NOWHERE}/", text))
        return _IP6.sub(_UNNAMED, _IP.sub(NOWHERE, text))

    def without_paths(self, text: str) -> str:
        """A sentence, in which whatever looks like a path is one."""
        return _ANY_PATH.sub(_UNNAMED, self.named(text))


def share(
    recording: Recording, to: Path, *, cache: Path | None = None, allow_plugins: bool = False
) -> Shared:
    """Write a recording for others.

    Args:
        recording: Of a whole run.
        to: The file to write, which must not exist.
        cache: Folder that keeps what takes long to make between starts.
        allow_plugins: Whether dotted kinds that no installed package offers are imported by their names.

    Raises:
        InputError: Something of the recording is missing, it cannot be computed without what is left out, or
            it would be judged otherwise.
    """
    if missing := recording.check():
        raise InputError(Problem(str(recording.path), "", f.text, "share one that is whole") for f in missing)
    if (own := file_among(recording.files)) not in recording.files:
        raise InputError.at(recording.path, own, "is not in it", "share one that seerob recorded")
    table = parsed_toml(recording.files[own], recording.path)
    words = _Words()
    dropped: list[str] = []
    _learn(words, table, recording)
    kept, new = _written(table, recording, words, dropped)
    with TemporaryDirectory(prefix="seerob-") as folder:
        unpack({**kept, FILE_NAME: new}, Path(folder), recording.path)
        try:
            station = Station(read(folder, Allowed(allow_plugins, replayed=True)), cache=cache)
            _run(station, recording, words, Path(folder) / "out")
        except InputError as error:
            problems = [p._replace(file=p.file.removeprefix(f"{folder}/")) for p in error.problems]
            what = "cannot be computed without what is left out, and is not shared"
            raise InputError([*problems, Problem(str(recording.path), "", what)]) from error
        with whole_file(to) as hidden:
            shutil.copyfile(Path(folder) / "out" / "run.mcap", hidden)
    return Shared(tuple(dropped), tuple(sorted(kept)))


def _run(station: Station, recording: Recording, words: _Words, folder: Path) -> None:
    """Record it again, and compare.

    Raises:
        InputError: It is judged otherwise.
    """
    findings = [
        replace(
            f,
            subject=words.named(f.subject),
            text=words.without_paths(f.text),
            holds=tuple(map(words.named, f.holds)),
        )
        for f in recording.scene.findings
        if f.holds or f.level != "note"
    ]
    again = Renamed(words)
    fed = not station.workstation.sources and any(tick.samples for tick in recording.ticks())
    scene = scene_of(
        station.model, station.bound, _new(findings, station.model.findings), files=station.files, fed=fed
    )
    scene = replace(
        scene, findings=tuple(replace(f, text=words.without_paths(f.text)) for f in scene.findings)
    )
    summary = station.run(
        folder=folder,
        sinks=[Recorder(lossless=True)],
        feed=(tuple(map(again, samples)) for samples in recording.heard()),
        end=recording.end,
        scene=scene,
    )
    then = log_of(recording.snapshots(), recording.scene.criteria)
    for (name, before), now in zip(then.items(), summary.results.values(), strict=True):
        if before.verdict != now.verdict:
            what = f"was {before.verdict}, and is {now.verdict} without what is left out"
            raise InputError.at(recording.path, name, what)


def _new(findings: list[Finding], known: tuple[Finding, ...]) -> Iterator[Finding]:
    said = {(f.subject, f.text) for f in known}
    return (f for f in findings if (f.subject, f.text) not in said)


# -- what is written over ---------------------------------------------------------------------------


def _learn(words: _Words, table: Mapping[str, Any], recording: Recording) -> None:
    """Names of people, hosts and files of sources, and who made it and where."""
    with suppress(OSError, KeyError):
        for name in (getpass.getuser(), Path.home().name, socket.gethostname()):
            if name.casefold() not in _COMMON:
                words.add(name, _UNNAMED)
    said = [*_texts(table), *(f.text for f in recording.scene.findings)]
    for owner in {found for text in said for found in _OWNER.findall(text)} - _COMMON:
        words.add(owner, _UNNAMED)
    for i, human in enumerate(_tables(table, "humans"), start=1):
        if isinstance(human.get("name"), str):
            words.add(human["name"], f"person_{i}")
    for i, source in enumerate(_tables(table, "sources")):
        for key, value in source.items():
            if key in _HOSTS and isinstance(value, str):
                words.add(value, NOWHERE)
            if isinstance(value, str) and _is_file(value, recording):
                words.add(value, f"source_{i}{PurePosixPath(value).suffix}")
                words.add(PurePosixPath(value).name, f"source_{i}{PurePosixPath(value).suffix}")


def _is_file(value: str, recording: Recording) -> bool:
    plain = PurePosixPath(value).as_posix()
    outside = f"{SOURCES}{PurePosixPath(value).name}.sha256"
    return plain in recording.files or outside in recording.files


def _tables(table: Mapping[str, Any], group: str) -> list[dict[str, Any]]:
    entries = table.get(group, [])
    return [entry for entry in entries if isinstance(entry, dict)] if isinstance(entries, list) else []


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping | list):
        for inner in value.values() if isinstance(value, Mapping) else value:
            yield from _texts(inner)


def _written(
    table: Mapping[str, Any], recording: Recording, words: _Words, dropped: list[str]
) -> tuple[dict[str, bytes], bytes]:
    """Files that are kept, and the workstation file anew; says what is dropped."""
    programs = any(rule.get("kind") == "waypoints" for rule in _tables(table, "safety"))
    own = {
        PurePosixPath(value).as_posix()
        for source in _tables(table, "sources")
        for value in _texts(source)
        if not (programs and source.get("kind") == "waypoints")
    }
    others = {
        PurePosixPath(text).as_posix()
        for group in table
        if group != "sources"
        for text in _texts(table[group])
    }
    kept = {}
    for name, content in recording.files.items():
        if name == file_among(recording.files):
            continue
        if name.startswith(f"{OUTSIDE}/") and not name.startswith(SOURCES):
            continue  # what ships or is installed is found again
        if name in own - others or name.startswith(SOURCES):
            dropped.append(f"the file {name}: what was asked of it is in the samples")
        else:
            kept[name] = _cleaned(name, content, words)
    dropped.append("who looked on (/visitors, /presences), where anybody did")
    new = {key: value for key, value in table.items() if key not in _DROPPED_TABLES}
    gone = [key for key in _DROPPED_TABLES if key in table]
    dropped += [f"{', '.join(gone)} of the workstation file"] if gone else []
    new["sources"] = [_anonymous(source, i, dropped) for i, source in enumerate(_tables(table, "sources"))]
    dropped += [
        "comments, title and remarks of the workstation file",
        "notes that were made when it was recorded, the time of recording",
        f"names of people, hosts, users and paths, which are written over (person_1, {NOWHERE}, {_UNNAMED})",
    ]
    return kept, _toml(_renamed(new, words)).encode()


def _anonymous(source: dict[str, Any], i: int, dropped: list[str]) -> dict[str, Any]:
    """A source without whom it spoke to and as whom."""
    found: dict[str, Any] = {}
    for key, value in source.items():
        if key in _OF_ACCESS or key.endswith("_env"):
            dropped.append(f"sources[{i}].{key}")
        elif key in _HOSTS:
            found[key] = NOWHERE
        elif key == "url" and isinstance(value, str):
            found[key] = f"{value.partition('://')[0]}://{NOWHERE}/"
        elif isinstance(value, str) and key.endswith("file") and _PATH.match(value):
            found[key] = f"source_{i}{PurePosixPath(value).suffix}"
        else:
            found[key] = value
    return found


def _renamed(value: Any, words: _Words, key: str = "") -> Any:
    if isinstance(value, str):
        if key in _FREE:
            return "left out"
        shipped = key == "kind" or value.startswith(("library:", "package:", "description:"))
        return value if shipped else words.named(value)
    if isinstance(value, Mapping):
        return {words.named(name): _renamed(inner, words, name) for name, inner in value.items()}
    if isinstance(value, list):
        return [_renamed(inner, words, key) for inner in value]
    return value


def _toml(table: Mapping[str, Any]) -> str:
    """A file of a table: what is no list of tables first."""
    lists = {key: v for key, v in table.items() if isinstance(v, list) and v and isinstance(v[0], dict)}
    lines = [f"{toml_value(key)} = {toml_value(v)}" for key, v in table.items() if key not in lists]
    for key, entries in lists.items():
        for entry in entries:
            lines += [f"[[{key}]]", *(f"{toml_value(name)} = {toml_value(v)}" for name, v in entry.items())]
    return "\n".join(lines) + "\n"


def _cleaned(name: str, content: bytes, words: _Words) -> bytes:
    """A file that is needed, without what its format has for remarks."""
    ending = PurePosixPath(name).suffix.lower()
    if ending in _XML:
        content = _AUTHORS.sub(rb"<\1></\1>", _COMMENT.sub(b"", content))
    if ending == ".toml":
        return _toml(_renamed(parsed_toml(content, Path(name)), words)).encode()
    if (
        ending == ".stl"
        and len(content) >= 84
        and len(content) == 84 + 50 * int.from_bytes(content[80:84], "little")
    ):
        return bytes(80) + content[80:]
    if ending in (".xlsx", ".xlsm"):
        return _workbook(name, content)
    with suppress(UnicodeDecodeError):
        text = content.decode()
        if ending in (".obj", ".mtl"):
            text = re.sub(r"(?m)^#.*$", "#", text)
        if ending in (*_XML, ".csv", ".txt", ".json", ".yaml", ".obj", ".mtl"):
            return words.named(text).encode() if ending not in (".obj", ".mtl") else text.encode()
    return content


def _workbook(name: str, content: bytes) -> bytes:
    """A workbook without its properties, which name whoever wrote it.

    Raises:
        InputError: It is none, or unpacks to too much.
    """
    made, left = io.BytesIO(), MAX_WORKBOOK
    try:
        with ZipFile(io.BytesIO(content)) as old, ZipFile(made, "w", ZIP_DEFLATED) as new:
            for member in old.infolist():
                if not member.filename.startswith(("docProps/", "customXml/")):
                    data = unpacked(old, member, left)
                    left -= len(data)
                    new.writestr(ZipInfo(member.filename), data)
    except (BadZipFile, TooLarge, OSError, ValueError, NotImplementedError, zlib.error) as error:
        raise InputError.at(name, "", f"cannot be read: {error}", "do not trust this recording") from error
    return made.getvalue()


class Renamed:
    """Samples as others may have them; what a device calls things and people is counted through."""

    def __init__(self, words: _Words) -> None:
        self._words = words
        self._names: dict[str, str] = {}
        self._people: dict[str, str] = {}

    def __call__(self, sample: Sample) -> Sample:
        """A sample."""
        named, without_paths = self._words.named, self._words.without_paths
        more: dict[str, Any] = {}
        if isinstance(sample, SignalSample):
            values = {k: without_paths(v) if isinstance(v, str) else v for k, v in sample.values.items()}
            more = {"values": values, "doubts": _each(sample.doubts, without_paths)}
        else:
            more = {"target": named(sample.target)}
        if isinstance(sample, GrabSample):
            more |= {"piece": named(sample.piece)}
        if isinstance(sample, BodySample):
            points = tuple(replace(p, name=self._count(self._names, p.name, "point")) for p in sample.points)
            subject = self._count(self._people, sample.subject, "subject") if sample.subject else ""
            more |= {"points": points, "subject": subject}
        return replace(sample, source=named(sample.source), reason=without_paths(sample.reason), **more)

    @staticmethod
    def _count(known: dict[str, str], name: str, word: str) -> str:
        return known.setdefault(name, f"{word}_{len(known) + 1}")


def _each(texts: Mapping[str, str], change: Callable[[str], str]) -> dict[str, str]:
    return {name: change(text) for name, text in texts.items()}
