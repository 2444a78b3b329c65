"""Reading a recording back: its scene, its snapshots at any time, and its samples for exact replay.

Only record headers are read. Nothing in the file is trusted: every length is checked against the
file's real size before it is used, and sizes after decompression are bounded.
"""

from __future__ import annotations

import math
import struct
import zlib
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from itertools import repeat
from pathlib import Path, PurePosixPath
from threading import Lock
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple, TypeVar, get_args

import msgspec
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.core.printable import printable, printable_record
from seerob.core.samples import Sample
from seerob.core.snapshot import Aspect, Finding, Marker, Result, Row, Scene, Snapshot
from seerob.recording import frames
from seerob.recording.format import (
    BROKEN_OFF,
    DIGEST,
    END_METADATA,
    FILE_PREFIX,
    MESH_PREFIX,
    METADATA,
    PRESENCES,
    SAMPLES,
    SCENE,
    SNAPSHOT,
    VERSION,
    VIEW_SCENE,
    VISITORS,
    WITH_NAMES,
    Tick,
    Visitor,
    content_hash,
    nanoseconds,
)
from seerob.recording.result_log import ResultLog, log_of

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

MAGIC = b"\x89MCAP0\r\n"
MAX_CHUNK = 256 * 2**20
"""Largest decompressed chunk that is read [bytes]."""
MAX_TEXT = 2**20
"""Longest name or metadata record that is read [bytes]."""

_FOOTER, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX = 0x02, 0x04, 0x05, 0x06, 0x07
_ATTACHMENT, _METADATA, _DATA_END = 0x09, 0x0C, 0x0F


class Damaged(Exception):
    """A record that cannot be read; the message says why."""


class ChunkPlace(NamedTuple):
    """One chunk; times are the log times of its messages [ns]."""

    start: int
    end: int
    offset: int
    """Offset of the compressed data in the file."""
    length: int
    size: int
    """Decompressed [bytes]."""
    crc: int
    compression: str
    channels: list[int]
    """Channels that its message indexes name, as far as they were written; no checksum covers them."""


class Attachment(NamedTuple):
    """A file inside the file."""

    name: str
    offset: int
    length: int
    crc: int
    crc_start: int


class Message(NamedTuple):
    """One message of a chunk."""

    channel: int
    time: int
    data: bytes


@dataclass
class McapIndex:
    """What a scan of record headers found."""

    chunks: list[ChunkPlace] = field(default_factory=list)
    attachments: dict[str, Attachment] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    finished: bool = False
    """Whether the writer came to write the end mark."""
    unread: int = 0
    """Bytes at the end that hold no whole record."""
    beyond: int = 0
    """Bytes behind the end of the file's own records, as of another file that was joined to it."""


def scan(path: Path) -> McapIndex:
    """Find chunks, attachments and metadata.

    Raises:
        InputError: The file cannot be opened or is not MCAP.
    """
    index = McapIndex()
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(0)
            if file.read(8) != MAGIC:
                raise InputError.at(path, "", "is not an MCAP file", "give a recording made by seerob")
            position = 8
            while not index.finished:
                header = file.read(9)
                if len(header) < 9:
                    break
                opcode, length = struct.unpack("<BQ", header)
                if length > size - position - 9:
                    break
                try:
                    _record(index, file, opcode, position + 9, length)
                except (Damaged, struct.error, UnicodeDecodeError):
                    break
                position += 9 + length
                file.seek(position)
            index.unread = 0 if index.finished else size - position
            index.beyond = _beyond(file, position, size) if index.finished else 0
            if index.chunks and not index.finished:
                # Its message indexes may have been cut off halfway.
                index.chunks[-1].channels.clear()
    except OSError as error:
        what = f"cannot be read: {error.strerror}"
        raise InputError.at(path, "", what, "check path and permission") from error
    return index


def _beyond(file: BinaryIO, position: int, size: int) -> int:
    """Bytes behind the footer of a file whose records of data end at a position."""
    footer = False
    while not footer and position + 9 <= size:
        file.seek(position)
        opcode, length = struct.unpack("<BQ", file.read(9))
        position += 9 + length
        footer = opcode == _FOOTER
    return max(size - position - len(MAGIC), 0)


def _record(index: McapIndex, file: BinaryIO, opcode: int, start: int, length: int) -> None:
    if opcode == _CHUNK:
        t0, t1, size, crc = struct.unpack("<QQQI", file.read(28))
        compression = _text(file, 64)
        (stored,) = struct.unpack("<Q", file.read(8))
        if file.tell() + stored > start + length:
            raise Damaged("chunk is longer than its record")
        index.chunks.append(ChunkPlace(t0, t1, file.tell(), stored, size, crc, compression, []))
    elif opcode == _MESSAGE_INDEX and index.chunks:
        index.chunks[-1].channels.append(struct.unpack("<H", file.read(2))[0])
    elif opcode == _ATTACHMENT:
        file.seek(16, 1)
        name = _text(file, MAX_TEXT)
        _text(file, MAX_TEXT)
        (stored,) = struct.unpack("<Q", file.read(8))
        place = file.tell()
        if place + stored + 4 != start + length:
            raise Damaged("attachment does not fill its record")
        file.seek(stored, 1)
        (crc,) = struct.unpack("<I", file.read(4))
        index.attachments[name] = Attachment(name, place, stored, crc, start)
    elif opcode == _METADATA:
        if length > MAX_TEXT:
            raise Damaged("metadata is too long")
        name = _text(file, MAX_TEXT)
        (stored,) = struct.unpack("<I", file.read(4))
        end = file.tell() + stored
        if end > start + length:
            raise Damaged("metadata is longer than its record")
        entries = {}
        while file.tell() < end:
            key = _text(file, MAX_TEXT)
            entries[key] = _text(file, MAX_TEXT)
        index.metadata[name] = entries
    elif opcode == _DATA_END:
        index.finished = True


def _text(file: BinaryIO, limit: int) -> str:
    (length,) = struct.unpack("<I", file.read(4))
    if length > limit:
        raise Damaged("text is too long")
    data = file.read(length)
    if len(data) != length:
        raise Damaged("text is cut off")
    return data.decode()


def read_attachment(path: Path, attachment: Attachment) -> bytes:
    """Content of an attachment.

    Raises:
        Damaged: Its checksum does not fit.
    """
    with path.open("rb") as file:
        file.seek(attachment.crc_start)
        record = file.read(attachment.offset - attachment.crc_start + attachment.length)
    if attachment.crc and zlib.crc32(record) != attachment.crc:
        raise Damaged(f"attachment {attachment.name!r} has a wrong checksum")
    return record[attachment.offset - attachment.crc_start :]


def read_chunk(path: Path, chunk: ChunkPlace) -> tuple[dict[int, str], list[Message]]:
    """Topics by channel id that the chunk defines, and its messages in order.

    Raises:
        Damaged: Too large, wrong checksum, unknown compression, or not what it says it is.
    """
    if chunk.size > MAX_CHUNK:
        raise Damaged(f"chunk of {chunk.size} bytes, more than the {MAX_CHUNK} that are read")
    with path.open("rb") as file:
        file.seek(chunk.offset)
        data = _decompress(file.read(chunk.length), chunk)
    if len(data) != chunk.size or (chunk.crc and zlib.crc32(data) != chunk.crc):
        raise Damaged("chunk has a wrong checksum")
    topics: dict[int, str] = {}
    messages: list[Message] = []
    position = 0
    try:
        while position < len(data):
            opcode, length = struct.unpack_from("<BQ", data, position)
            position += 9
            if length > len(data) - position:
                raise Damaged("record is longer than its chunk")
            if opcode == _MESSAGE:
                channel, _, time, _ = struct.unpack_from("<HIQQ", data, position)
                messages.append(Message(channel, time, data[position + 22 : position + length]))
            elif opcode == _CHANNEL:
                channel, _, n = struct.unpack_from("<HHI", data, position)
                topics[channel] = data[position + 8 : position + 8 + n].decode()
            position += length
    except (struct.error, UnicodeDecodeError) as error:
        raise Damaged(f"chunk holds a broken record: {error}") from error
    return topics, messages


def _decompress(data: bytes, chunk: ChunkPlace) -> bytes:
    if chunk.compression == "":
        return data
    if chunk.compression != "zstd":
        raise Damaged(f"compression {chunk.compression!r} is not one that seerob writes")
    import zstandard

    try:
        # The frame's own size wins over max_output_size, so it is compared first.
        declared = zstandard.frame_content_size(data)
        if declared not in (-1, chunk.size):
            raise Damaged("chunk and compressed frame disagree about the size")
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=max(chunk.size, 1))
    except zstandard.ZstdError as error:
        raise Damaged(f"chunk cannot be decompressed: {error}") from error


T = TypeVar("T")

MOST_MISSING = 1_000_000
"""Ticks in a row that a recording may lack, hours of them."""
AFTER_HOLE = "the recording lacks what was heard before"
_POSE = 7 * 4
_CACHED_CHUNKS = 8
_TICK = {SAMPLES, SNAPSHOT}
_REMEDY = "give a recording (.mcap) made by seerob"
_DISTRUST = "do not trust this recording"

_decode_scene = msgspec.msgpack.Decoder(Scene).decode
_decode_snapshot = msgspec.msgpack.Decoder(Snapshot).decode
_decode_tick = msgspec.msgpack.Decoder(Tick).decode
_decode_visitor: Callable[[bytes], Visitor] = msgspec.json.Decoder(Visitor).decode


def snapshot_reader(layout: str) -> Callable[[bytes], Snapshot]:
    """Decoder of the snapshots of a recording of this layout; raises `msgspec.DecodeError`."""
    return _with_names if layout == WITH_NAMES else _decode_snapshot


_NESTED: dict[str, type[msgspec.Struct] | None] = {
    "parts": Result,
    "rows": Row,
    "aspects": Aspect,
    "markers": None,
}
"""Fields that list what has fields of its own; markers say by their tag what they are."""
_MARKERS = {cls.__struct_config__.tag: cls for cls in get_args(Marker)}


def _with_names(data: bytes) -> Snapshot:
    given = msgspec.msgpack.decode(data)
    if isinstance(given, dict) and isinstance(given.get("results"), list):
        given["results"] = [_in_order(result, Result) for result in given["results"]]
    return msgspec.convert(given, Snapshot)


def _in_order(given: object, cls: type[msgspec.Struct] | None) -> object:
    """A map of fields as the array that it is by now; the decoder refuses what is no such map."""
    if not isinstance(given, dict):
        return given
    tag = given.get("type")
    cls = cls or (_MARKERS.get(tag) if isinstance(tag, str) else None)
    if cls is None:
        return given
    found = [] if cls.__struct_config__.tag is None else [tag]
    for each in msgspec.structs.fields(cls):
        if each.required and each.name not in given:
            raise msgspec.ValidationError(f"Object missing required field `{each.name}`")
        value = given.get(each.name, each.default)
        if each.name in _NESTED and isinstance(value, list):
            value = [_in_order(one, _NESTED[each.name]) for one in value]
        found.append(value)
    return found


def unpack(files: Mapping[str, bytes], folder: Path, recording: Path) -> None:
    """Write files of a recording below a folder.

    Args:
        files: Content by the name that the recording has for it.
        folder: Where to.
        recording: The file, for messages.

    Raises:
        InputError: A name leads out of the folder, in which case nothing is written, or is none of a file.
    """
    for name in files:
        parts = PurePosixPath(name.replace("\\", "/")).parts
        if not parts or ".." in parts or parts[0] == "/" or ":" in parts[0]:
            raise InputError.at(recording, FILE_PREFIX + name, "leads out of the folder", _DISTRUST)
    for name, data in files.items():
        target = folder / PurePosixPath(name.replace("\\", "/"))
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
        except (OSError, ValueError) as error:
            what = f"cannot be unpacked: {error.args[-1]}"
            raise InputError.at(recording, FILE_PREFIX + name[:200], what, _DISTRUST) from error


class Recording:
    """A recording on disk. Opened with `open`; keeps no file handle, may be read from several threads.

    A recording whose writer was killed opens as far as it was written; `complete` and `findings`
    say what is missing. A damaged stretch is left out, never filled.
    """

    def __init__(self, path: Path, index: McapIndex) -> None:
        """Use `open`."""
        self.path = path
        self._index = index
        self._decode_snapshot = snapshot_reader(index.metadata.get(METADATA, {}).get("layout", VERSION))
        self._lock = Lock()
        self._cache: OrderedDict[int, list[Message]] = OrderedDict()
        self._topics: dict[int, str] = {}
        self._damage: dict[str, None] = {}
        self.scene = self._read_scene()
        """What did not change during the run."""
        # Message indexes have no checksum: only what holds nothing else by them is left unread.
        self._tick_chunks = [c for c in index.chunks if self._listed(c) not in ([SCENE], [VIEW_SCENE])]
        self._starts = [c.start for c in self._tick_chunks]
        self.start, self.end = self._span()

    @classmethod
    def open(cls, path: Path | str) -> Recording:
        """Open and index a recording.

        Raises:
            InputError: No such file, not an MCAP file, not one of ours, or cut off before its scene.
        """
        path = Path(path)
        index = scan(path)
        layout = index.metadata.get(METADATA, {}).get("layout")
        if layout is None and index.finished:
            raise InputError.at(path, "", "is an MCAP file, but not one of seerob", _REMEDY)
        if layout not in (None, WITH_NAMES, VERSION):
            raise InputError.at(
                path,
                "layout",
                f"is {layout!r}, this version reads {WITH_NAMES!r} and {VERSION!r}",
                "use the seerob that wrote it",
            )
        return cls(path, index)

    def __repr__(self) -> str:
        return f"<Recording {self.scene.title!r}: {self.path.name}, {self.duration:g} s>"

    def _repr_html_(self) -> str:
        whole = "" if self.complete else ", not whole"
        title = f"{self.scene.title}: {self.path.name}, {self.start:g} to {self.end:g} s{whole}"
        rows = ((c.name, c.kind, ", ".join(c.subjects)) for c in self.scene.criteria)
        return frames.html(title, ("criterion", "kind", "of"), rows)

    # -- what it is -----------------------------------------------------------------------------

    start: float
    """Run time of the first tick [s]; 0 when there is none."""
    end: float
    """Run time of the last tick that can be read [s]; 0 when there is none."""

    @property
    def duration(self) -> float:
        """From the first to the last tick [s]."""
        return self.end - self.start

    @property
    def complete(self) -> bool:
        """Whether the writer finished the file and nothing read so far was damaged."""
        return self._ended and not self._damage

    @property
    def _ended(self) -> bool:
        """Whether the recorder itself ended the file: another program may have closed what was cut off."""
        return self._index.finished and END_METADATA in self._index.metadata

    @property
    def metadata(self) -> dict[str, str]:
        """Versions of the software and wall-clock time of the start, as the recorder wrote them."""
        return dict(self._index.metadata.get(METADATA, {}))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is missing from this recording, as far as it is known by now (`check`).

        Where that is part of what was heard, nothing that is computed from it is within.
        """
        short = list(self._damage)
        texts: list[str] = []
        if not self._ended:
            short.append(
                f"the recording was cut off: it can be read until t = {self.end:.3f} s, less than a second "
                f"after that may be lost ({self._index.unread} bytes at the end hold no whole record)"
            )
        if self._index.beyond:
            short.append(f"{self._index.beyond} bytes lie behind its end: more was joined to the recording")
        end = self._index.metadata.get(END_METADATA, {})
        if reason := end.get(BROKEN_OFF):
            short.append(f"the run broke off at t = {self.end:.3f} s: {printable(reason)}")
        for key, text, heard in (
            (
                "dropped",
                "snapshots were dropped because the disk could not keep up; their samples are there",
                True,
            ),
            (
                "lost",
                "ticks are missing altogether because the disk could not keep up: replay is not exact",
                False,
            ),
            ("out_of_order", "ticks were left out because their time did not advance", False),
        ):
            if end.get(key, "0") != "0":
                (texts if heard else short).append(f"{end[key]} {text}")
        name = self.path.name
        return (
            *(Finding(level="warning", subject=name, text=text, holds=("*",)) for text in short),
            *(Finding(level="warning", subject=name, text=text) for text in texts),
        )

    def check(self) -> tuple[Finding, ...]:
        """Read all of it, and say what is missing, or not as it was written."""
        digest = sha256()
        for chunk in self._tick_chunks:
            for message in self._chunk(chunk):
                if self._topics.get(message.channel) in _TICK:
                    digest.update(message.data)
        then = self._index.metadata.get(END_METADATA, {}).get(DIGEST)
        if self._ended and not self._damage and then != digest.hexdigest():
            what = "changed since it was written" if then else "written by a version that does not seal"
            self._damage[f"the recording was {what}: nothing says that it is all that was heard"] = None
        if content_hash(self.files) != self.scene.workstation_hash:
            self._damage["the files in the recording are not those that it was made with"] = None
        return self.findings

    @cached_property
    def meshes(self) -> dict[str, bytes]:
        """Binary glTF per mesh hash."""
        found = self._attachments(MESH_PREFIX)
        return {name.removesuffix(".glb"): data for name, data in found.items()}

    @cached_property
    def files(self) -> dict[str, bytes]:
        """The workstation file and every file that it named: relative name → content.

        Names come from the recording; use `extract` to write them to disk.
        """
        return self._attachments(FILE_PREFIX)

    def extract(self, folder: Path) -> None:
        """Write `files` below ``folder``; raises as `unpack` does."""
        unpack(self.files, folder, self.path)

    # -- what happened --------------------------------------------------------------------------

    def snapshots(self, start: float | None = None, end: float | None = None) -> Iterator[Snapshot]:
        """Snapshots with ``start <= t <= end`` [s] in order; all of them when not given.

        Raises:
            InputError: A snapshot is not what it should be.
        """
        for chunk in self._tick_chunks:
            if end is not None and chunk.start > nanoseconds(end):
                return
            if start is not None and chunk.end < nanoseconds(start):
                continue
            for message in self._messages(chunk, SNAPSHOT):
                snapshot = self._snapshot(message)
                if (start is None or snapshot.t >= start) and (end is None or snapshot.t <= end):
                    yield snapshot

    def snapshot_at(self, t: float) -> Snapshot:
        """The last snapshot at or before ``t`` [s]; the first one when all are later.

        Raises:
            InputError: The recording holds no snapshot, or this one is broken.
        """
        for chunk in reversed(self._tick_chunks[: bisect_right(self._starts, nanoseconds(t))]):
            for message in reversed(self._messages(chunk, SNAPSHOT)):
                if message.time <= nanoseconds(t):
                    snapshot = self._snapshot(message)
                    if snapshot.t <= t:
                        return snapshot
        for snapshot in self.snapshots():
            return snapshot
        raise InputError.at(self.path, "", "holds no snapshot", "record at least one tick")

    @cached_property
    def results(self) -> ResultLog:
        """What was said when it was recorded, nothing computed again; all of it is read for that.

        Of a recording that is not whole, or not as it was written (`check`), nothing is within.
        """
        log = log_of(self.snapshots(), self.scene.criteria)
        if lacks := [finding.text for finding in self.check() if finding.holds]:
            log.break_off("; ".join(lacks))
        return log

    def to_pandas(self, form: frames.Form = "wide") -> pd.DataFrame:
        """Results as a DataFrame, as of `ResultLog.to_pandas`; ``rows`` and ``aspects`` too.

        Raises:
            UnknownName: There is no such form.
            MissingPackage: pandas is not installed.
            InputError: A snapshot is not what it should be.
        """
        return self.results.table(form, self.snapshots()).to_pandas()

    def to_arrow(self, form: frames.Form = "wide") -> pa.Table:
        """Results as an Arrow table, as of `ResultLog.to_arrow`; ``rows`` and ``aspects`` too.

        Raises:
            UnknownName: There is no such form.
            MissingPackage: pyarrow is not installed.
            InputError: A snapshot is not what it should be, or a criterion of a wide table is called ``t``.
        """
        return self.results.table(form, self.snapshots()).to_arrow()

    def __getstate__(self) -> dict[str, Any]:
        """Where it is, and how large; who reads it back opens it again, if it is still that."""
        return {"path": self.path, "size": self.path.stat().st_size, "metadata": self._index.metadata}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Open it again.

        Raises:
            InputError: It is another than it was, or not there any more.
        """
        path = state["path"]
        self.__init__(path, scan(path))  # type: ignore[misc]
        if (path.stat().st_size, self._index.metadata) != (state["size"], state["metadata"]):
            raise InputError.at(path, "", "changed since it was pickled", "open it again in this process")

    def visits(self) -> tuple[tuple[float, Visitor], ...]:
        """Who came, introduced themselves, left or was refused, with run time [s], in order.

        Raises:
            InputError: One is not what it should be.
        """
        return self._visits

    @cached_property
    def _visits(self) -> tuple[tuple[float, Visitor], ...]:
        return tuple(
            (message.time / 1e9, printable_record(self._decode(_decode_visitor, message, VISITORS)))
            for chunk in self._with(VISITORS)
            for message in self._messages(chunk, VISITORS)
        )

    def presences_at(self, t: float) -> bytes:
        """What was last said before ``t`` [s] of where visitors are, JSON; empty when nothing was."""
        for chunk in reversed(self._with(PRESENCES, nanoseconds(t))):
            for message in reversed(self._messages(chunk, PRESENCES)):
                if message.time <= nanoseconds(t):
                    return message.data
        return b""

    def _with(self, topic: str, until: float = math.inf) -> list[ChunkPlace]:
        """Chunks that begin until then [ns] and hold something of a topic, as far as their index says."""
        chunks = (chunk for chunk in self._tick_chunks if chunk.start <= until)
        return [c for c in chunks if not c.channels or {topic, None} & set(self._listed(c))]

    def ticks(self) -> Iterator[Tick]:
        """What the engine consumed at each tick, in order: playing it back repeats the run exactly.

        Raises:
            InputError: A tick is not what it should be.
        """
        for chunk in self._tick_chunks:
            for message in self._messages(chunk, SAMPLES):
                yield self._decode(_decode_tick, message, SAMPLES)

    def heard(self) -> Iterator[tuple[Sample, ...]]:
        """What was heard for each tick, in order; nothing for one that is missing.

        Raises:
            InputError: More are missing than any damage leaves out.
        """
        due = 0
        for tick in self.ticks():
            lacking = max(tick.seq - due, 0)
            if lacking > MOST_MISSING:
                what = f"tick {tick.seq} follows tick {due - 1}"
                raise InputError.at(self.path, f"at {tick.t:.3f} s", what, "do not trust this recording")
            yield from repeat((), lacking)
            # On the way here from what was heard before the hole the twin is as fast as nobody was.
            yield tuple(replace(s, reason=s.reason or AFTER_HOLE) if lacking else s for s in tick.samples)
            due = tick.seq + 1

    # -- inside ---------------------------------------------------------------------------------

    def _decode(self, decode: Callable[[bytes], T], message: Message, topic: str) -> T:
        try:
            return decode(message.data)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            place = f"{topic} at {message.time / 1e9:.3f} s"
            raise InputError.at(self.path, place, f"is not what it should be: {error}", _REMEDY) from error

    def _snapshot(self, message: Message) -> Snapshot:
        snapshot: Snapshot = self._decode(self._decode_snapshot, message, SNAPSHOT)
        if len(snapshot.poses) != _POSE * len(self.scene.nodes):
            what = f"has {len(snapshot.poses)} bytes of poses for {len(self.scene.nodes)} nodes"
            raise InputError.at(self.path, f"{SNAPSHOT} seq {snapshot.seq}", what, _REMEDY)
        return snapshot

    def _read_scene(self) -> Scene:
        for chunk in self._index.chunks[:4]:
            for message in self._messages(chunk, SCENE):
                scene: Scene = self._decode(_decode_scene, message, SCENE)
                return printable_record(scene)
        if self._index.finished:
            raise InputError.at(self.path, "", f"has no readable {SCENE}", _REMEDY)
        raise InputError.at(self.path, "", "was cut off before anything was recorded", "record again")

    def _span(self) -> tuple[float, float]:
        def said(chunks: Iterable[ChunkPlace], which: int) -> float:
            for chunk in chunks:
                if ticks := self._messages(chunk, SAMPLES):
                    tick: Tick = self._decode(_decode_tick, ticks[which], SAMPLES)
                    return tick.t
            return 0.0

        return said(self._tick_chunks, 0), said(reversed(self._tick_chunks), -1)

    def _listed(self, chunk: ChunkPlace) -> list[str | None]:
        return [self._topics.get(channel) for channel in chunk.channels]

    def _messages(self, chunk: ChunkPlace, topic: str) -> list[Message]:
        return [m for m in self._chunk(chunk) if self._topics.get(m.channel) == topic]

    def _chunk(self, chunk: ChunkPlace) -> list[Message]:
        with self._lock:
            if chunk.offset in self._cache:
                self._cache.move_to_end(chunk.offset)
                return self._cache[chunk.offset]
            try:
                topics, messages = read_chunk(self.path, chunk)
            except (Damaged, OSError) as error:
                where = f"from {chunk.start / 1e9:.3f} to {chunk.end / 1e9:.3f} s"
                self._damage[f"what was recorded {where} cannot be read: {error}"] = None
                topics, messages = {}, []
            self._topics.update(topics)
            self._cache[chunk.offset] = messages
            if len(self._cache) > _CACHED_CHUNKS:
                self._cache.popitem(last=False)
            return messages

    def _attachments(self, prefix: str) -> dict[str, bytes]:
        found = {}
        for name, attachment in self._index.attachments.items():
            if name.startswith(prefix):
                try:
                    found[name.removeprefix(prefix)] = read_attachment(self.path, attachment)
                except (Damaged, OSError) as error:
                    self._damage[str(error)] = None
        return found
