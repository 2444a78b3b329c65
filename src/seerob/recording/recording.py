"""Reading a recording back: its scene, its snapshots at any time, and its samples for exact replay."""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from hashlib import sha256
from itertools import repeat
from pathlib import Path, PurePosixPath
from threading import Lock
from typing import TypeVar

import msgspec
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.core.printable import printable_record
from seerob.core.samples import Sample
from seerob.core.snapshot import Finding, Scene, Snapshot
from seerob.recording.format import (
    DIGEST,
    END_METADATA,
    FILE_PREFIX,
    MESH_PREFIX,
    METADATA,
    SAMPLES,
    SCENE,
    SNAPSHOT,
    VERSION,
    VIEW_SCENE,
    VIEWS,
    Tick,
    nanoseconds,
)
from seerob.recording.mcap_index import (
    ChunkPlace,
    Damaged,
    McapIndex,
    Message,
    read_attachment,
    read_chunk,
    scan,
)

T = TypeVar("T")

MOST_MISSING = 1_000_000
"""Ticks in a row that a recording may lack, hours of them."""
AFTER_HOLE = "the recording lacks what was heard before"
_POSE = 7 * 4
_CACHED_CHUNKS = 8
_TICK = {SAMPLES, SNAPSHOT}
_TICK_VIEWS = {SAMPLES, SNAPSHOT, *VIEWS}
_REMEDY = "give a recording (.mcap) made by seerob"
_DISTRUST = "do not trust this recording"

_decode_scene = msgspec.msgpack.Decoder(Scene).decode
_decode_snapshot = msgspec.msgpack.Decoder(Snapshot).decode
_decode_tick = msgspec.msgpack.Decoder(Tick).decode


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
        self._lock = Lock()
        self._cache: OrderedDict[int, list[Message]] = OrderedDict()
        self._topics: dict[int, str] = {}
        self._damage: dict[str, None] = {}
        self.scene = self._read_scene()
        """What did not change during the run."""
        self._tick_chunks = [c for c in index.chunks if self._has(c, SAMPLES, SNAPSHOT)]
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
        if layout is not None and layout != VERSION:
            raise InputError.at(
                path,
                "layout",
                f"is {layout!r}, this version reads {VERSION!r}",
                "use the seerob that wrote it",
            )
        return cls(path, index)

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
        end = self._index.metadata.get(END_METADATA, {})
        for key, text, heard in (
            (
                "dropped",
                "snapshots were dropped because the disk could not keep up; their samples are there",
                1,
            ),
            (
                "lost",
                "ticks are missing altogether because the disk could not keep up: replay is not exact",
                0,
            ),
            ("out_of_order", "ticks were left out because their time did not advance", 0),
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
        first = 0 if start is None else max(0, bisect_right(self._starts, nanoseconds(start) - 1) - 1)
        for chunk in self._tick_chunks[first:]:
            if end is not None and chunk.start > nanoseconds(end) + 1:
                return
            if start is not None and chunk.end < nanoseconds(start) - 1:
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
        last = bisect_right(self._starts, nanoseconds(t) + 1) - 1
        for chunk in reversed(self._tick_chunks[: last + 1]):
            for message in reversed(self._messages(chunk, SNAPSHOT)):
                if message.time <= nanoseconds(t) + 1:
                    snapshot = self._snapshot(message)
                    if snapshot.t <= t:
                        return snapshot
        for snapshot in self.snapshots():
            return snapshot
        raise InputError.at(self.path, "", "holds no snapshot", "record at least one tick")

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
        except msgspec.DecodeError as error:
            place = f"{topic} at {message.time / 1e9:.3f} s"
            raise InputError.at(self.path, place, f"is not what it should be: {error}", _REMEDY) from error

    def _snapshot(self, message: Message) -> Snapshot:
        snapshot: Snapshot = self._decode(_decode_snapshot, message, SNAPSHOT)
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
        first = next((t for c in self._tick_chunks for t in self._times(c)), 0.0)
        last = next((t for c in reversed(self._tick_chunks) for t in reversed(self._times(c))), first)
        return first, last

    def _times(self, chunk: ChunkPlace) -> list[float]:
        ticks = self._messages(chunk, SAMPLES)
        ends = ticks if len(ticks) < 2 else [ticks[0], ticks[-1]]
        return [
            tick.t
            for tick in (self._decode(_decode_tick, m, SAMPLES) for m in ends)
            if isinstance(tick, Tick)
        ]

    def _has(self, chunk: ChunkPlace, *topics: str) -> bool:
        listed = [self._topics.get(channel) for channel in chunk.channels]
        # Message indexes have no checksum: what no recorder would write is looked up in the chunk.
        plausible = len(set(listed)) == len(listed) and None not in listed
        if not plausible or (
            listed not in ([SCENE], [VIEW_SCENE]) and not _TICK <= set(listed) <= _TICK_VIEWS
        ):
            listed = [self._topics.get(m.channel) for m in self._chunk(chunk)]
        return any(topic in topics for topic in listed)

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
