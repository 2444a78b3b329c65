"""Writes one recording: what `seerob.recording.recording` reads back, and what foreign viewers show.

Copies what is whole of a recording that was cut off, with an end and an index.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgspec
from mcap.data_stream import RecordBuilder
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, ChunkIndex, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from mcap.writer import Writer as McapWriter
from mcap_protobuf.schema import register_schema

from seerob.core.markers import plain
from seerob.core.samples import Sample
from seerob.core.snapshot import Scene, Snapshot
from seerob.outputs.mcap.foxglove import frame_transforms, marker_update, scene_update
from seerob.outputs.versions import versions
from seerob.recording.column import Column, Spill
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
    VIEW_FRAMES,
    VIEW_MARKERS,
    VIEW_PEOPLE,
    VIEW_RESULTS,
    VIEW_SCENE,
    VISITORS,
    Tick,
    Visitor,
    nanoseconds,
)


def mend(source: Path, to: Path) -> int:
    """Copy every record up to the first that is not whole.

    Args:
        source: The recording; it is only read.
        to: The copy, which must not exist.

    Returns:
        How many messages were copied.

    Raises:
        OSError: One cannot be read, or the other not written.
    """
    schemas, channels, messages = {0: 0}, {}, 0
    with source.open("rb") as cut, to.open("xb") as whole:
        writer: Any = Writer(whole, enable_crcs=True)
        with suppress(McapError, EOFError):  # here it was cut off
            for record in StreamReader(cut, validate_crcs=True).records:
                if isinstance(record, Header):
                    writer.start(profile=record.profile, library=record.library)
                elif isinstance(record, Schema) and record.id not in schemas:
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                elif isinstance(record, Channel) and record.id not in channels:
                    schema = schemas[record.schema_id]
                    channels[record.id] = writer.register_channel(
                        record.topic, record.message_encoding, schema, record.metadata
                    )
                elif isinstance(record, Message):
                    writer.add_message(
                        channels[record.channel_id],
                        record.log_time,
                        record.data,
                        record.publish_time,
                        record.sequence,
                    )
                    messages += 1
                elif isinstance(record, Attachment):
                    writer.add_attachment(
                        record.create_time, record.log_time, record.name, record.media_type, record.data
                    )
                elif isinstance(record, Metadata):
                    writer.add_metadata(record.name, record.metadata)
        writer.finish()
    return messages


VIEW_PERIOD = 0.05
"""Least run time between two messages that only viewers read [s]."""

_RESULTS_SCHEMA = {
    "type": "object",
    "properties": {
        "t": {"type": "number"},
        "results": {
            "type": "array",
            "items": {
                "type": "object",
                "properties": {
                    "name": {"type": "string"},
                    "value": {"type": ["number", "null"]},
                    "limit": {"type": ["number", "null"]},
                    "unit": {"type": "string"},
                    "verdict": {"type": ["string", "null"]},
                    "reason": {"type": "string"},
                },
            },
        },
    },
}
_NUMBERS = {"type": "object", "additionalProperties": {"type": ["number", "null"]}}
_PEOPLE_SCHEMA = {
    "type": "object",
    "properties": {
        "t": {"type": "number"},
        "people": {
            "type": "object",
            "additionalProperties": {
                "type": "object",
                "properties": {
                    "joints": _NUMBERS,
                    "errors": {"type": "object", "additionalProperties": _NUMBERS},
                },
            },
        },
    },
}

_VISITOR_SCHEMA = {
    "type": "object",
    "properties": {
        "t": {"type": "number"},
        "event": {"type": "string"},
        "role": {"type": "string"},
        "address": {"type": "string"},
        "since": {"type": "string"},
        "until": {"type": ["string", "null"]},
        "refused": {"type": "object", "additionalProperties": {"type": "integer"}},
    },
}


class _ChunkIndexes:
    """Where the chunks are, in a temporary file: the library's own list of eight hours takes 50 MB."""

    def __init__(self) -> None:
        self._records = Column("B", Spill())

    def append(self, index: ChunkIndex) -> None:
        record: Any = RecordBuilder()
        index.write(record)
        for byte in record.end():
            self._records.append(byte)

    def __iter__(self) -> Iterator[_ChunkIndexes]:
        yield self

    def write(self, summary: RecordBuilder) -> None:
        """All records, where the library would write one."""
        summary.write(self._records.tobytes())


class McapTape:
    """An MCAP file that is only ever appended to."""

    def __init__(self, path: Path, scene: Scene, meshes: dict[str, bytes], files: dict[str, bytes]) -> None:
        """Write everything that does not change; on disk when this returns.

        Raises:
            OSError: The file exists or cannot be written.
        """
        self._scene = scene
        self._people = {m.name: [j.name for j in m.joints] for m in scene.mechanisms if m.role == "human"}
        self._encode = msgspec.msgpack.Encoder(enc_hook=plain).encode
        self._next_view = -math.inf
        self._digest = sha256()
        self.ticks = 0
        """Ticks that were taken."""
        self.kept = 0
        """Of these, ticks that are on disk."""
        self._file = path.open("xb")
        try:
            # The library types its constructor only.
            self._mcap: Any = McapWriter(self._file, enable_crcs=True)
            vars(self._mcap)["_Writer__chunk_indices"] = _ChunkIndexes()
            self._mcap.start(profile="", library=f"seerob {scene.version}")
            self._mcap.add_metadata(
                METADATA,
                {"layout": VERSION, "created": datetime.now(UTC).isoformat(timespec="seconds"), **versions()},
            )
            for name, data in files.items():
                self._mcap.add_attachment(0, 0, FILE_PREFIX + name, "application/octet-stream", data)
            for key, data in meshes.items():
                self._mcap.add_attachment(0, 0, f"{MESH_PREFIX}{key}.glb", "model/gltf-binary", data)
            self._channels = self._register()
            self._put(SCENE, 0, 0, self._encode(scene))
            self.flush()
            self._put(VIEW_SCENE, 0, 0, scene_update(scene, meshes).SerializeToString())
            self.flush()
        except BaseException:
            self._file.close()
            path.unlink(missing_ok=True)
            raise

    def _register(self) -> dict[str, int]:
        from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
        from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

        channels = {
            topic: self._mcap.register_channel(topic, "msgpack", 0) for topic in (SCENE, SAMPLES, SNAPSHOT)
        }
        update = register_schema(self._mcap, SceneUpdate)
        transforms = register_schema(self._mcap, FrameTransforms)
        results = self._mcap.register_schema(
            "seerob.Results", "jsonschema", json.dumps(_RESULTS_SCHEMA).encode()
        )
        people = 0
        if self._people:
            people = self._mcap.register_schema(
                "seerob.People", "jsonschema", json.dumps(_PEOPLE_SCHEMA).encode()
            )
        for topic, encoding, schema in (
            (VIEW_SCENE, "protobuf", update),
            (VIEW_MARKERS, "protobuf", update),
            (VIEW_FRAMES, "protobuf", transforms),
            (VIEW_RESULTS, "json", results),
            *([(VIEW_PEOPLE, "json", people)] if self._people else []),
        ):
            channels[topic] = self._mcap.register_channel(topic, encoding, schema)
        return channels

    def tick(self, seq: int, t: float, samples: tuple[Sample, ...], snapshot: Snapshot | None) -> None:
        """Append one tick; ``snapshot`` is None when it was dropped and only its input is kept."""
        self.ticks += 1
        self._seal(SAMPLES, seq, t, self._encode(Tick(seq=seq, t=t, samples=samples)))
        if snapshot is None:
            return
        self._seal(SNAPSHOT, seq, t, self._encode(snapshot))
        if t >= self._next_view:
            self._next_view = t + VIEW_PERIOD * (1 - 1e-6)
            self._put(VIEW_FRAMES, seq, t, frame_transforms(self._scene, snapshot).SerializeToString())
            self._put(VIEW_MARKERS, seq, t, marker_update(snapshot).SerializeToString())
            self._put(VIEW_RESULTS, seq, t, _results_json(snapshot))
            if self._people:
                self._put(VIEW_PEOPLE, seq, t, self._people_json(snapshot))

    def _people_json(self, snapshot: Snapshot) -> bytes:
        people = {
            name: {
                "joints": dict(zip(joints, snapshot.joints.get(name, ()), strict=False)),
                "errors": {
                    bone: {"position": position, "angle": angle}
                    for bone, (position, angle) in snapshot.bones.get(name, {}).items()
                },
            }
            for name, joints in self._people.items()
        }
        return msgspec.json.encode({"t": snapshot.t, "people": people}, enc_hook=plain)

    def visitors(self, t: float, visitors: tuple[Visitor, ...]) -> None:
        """Append who came, left or was refused."""
        if visitors and VISITORS not in self._channels:
            schema = self._mcap.register_schema(
                "seerob.Visitor", "jsonschema", json.dumps(_VISITOR_SCHEMA).encode()
            )
            self._channels[VISITORS] = self._mcap.register_channel(VISITORS, "json", schema)
        for visitor in visitors:
            self._put(VISITORS, 0, t, msgspec.json.encode({"t": t, **msgspec.to_builtins(visitor)}))

    def flush(self) -> None:
        """End the chunk and hand it to the disk: what was written so far survives the process."""
        self._mcap.flush()
        os.fsync(self._file.fileno())
        self.kept = self.ticks

    def finish(self, counts: dict[str, int]) -> None:
        """Write the end mark and the index, and close."""
        try:
            self._mcap.flush()
            end = {DIGEST: self._digest.hexdigest(), **{k: str(n) for k, n in counts.items()}}
            self._mcap.add_metadata(END_METADATA, end)
            self._mcap.finish()
            self._file.flush()
            os.fsync(self._file.fileno())
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close as it is, after an error."""
        with suppress(OSError):  # a full disk does not take what waits to be written either
            self._file.close()

    def _seal(self, topic: str, seq: int, t: float, data: bytes) -> None:
        self._digest.update(data)
        self._put(topic, seq, t, data)

    def _put(self, topic: str, seq: int, t: float, data: bytes) -> None:
        time = nanoseconds(t)
        self._mcap.add_message(self._channels[topic], time, data, time, seq & 0xFFFFFFFF)


def _results_json(snapshot: Snapshot) -> bytes:
    # msgspec writes nan and infinity as null, which is what JSON can say of them.
    return msgspec.json.encode(
        {
            "t": snapshot.t,
            "results": [
                {
                    "name": r.name,
                    "value": r.value,
                    "limit": r.limit,
                    "unit": r.unit,
                    "verdict": r.verdict,
                    "reason": r.reason,
                }
                for r in snapshot.results
            ],
        },
        enc_hook=plain,
    )
