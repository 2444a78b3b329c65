"""Writes one recording: what `seerob.recording.recording` reads back, and what foreign viewers show.

Copies what is whole of a recording that was cut off, with an end and an index. Viewers get our scene and
markers as Foxglove's messages. Those of this family take glTF to be y up and turn it by +90° about x on
loading; our meshes are z up, so each model is placed with the inverse turn and ends where it belongs.
"""

from __future__ import annotations

import json
import math
import os
import struct
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.ModelPrimitive_pb2 import ModelPrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.data_stream import RecordBuilder
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, ChunkIndex, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from mcap.writer import Writer as McapWriter
from mcap_protobuf.schema import register_schema
from zstandard import ZstdError

from seerob.core.errors import InputError
from seerob.core.markers import plain
from seerob.core.samples import Sample
from seerob.core.snapshot import (
    Arrow,
    Box,
    CameraInfo,
    Ellipsoid,
    Highlight,
    Hull,
    Label,
    Marker,
    Polyline,
    Presences,
    Prism,
    Rays,
    Scene,
    Segment,
    Snapshot,
    Sphere,
    Vec3,
    Vec4,
    Verdict,
)
from seerob.core.transforms import Array, cross
from seerob.outputs.picture.marker_shapes import prism
from seerob.outputs.picture.stage_bodies import read_glb
from seerob.recording.format import (
    BROKEN_OFF,
    DIGEST,
    END_METADATA,
    FILE_PREFIX,
    LENS,
    MESH_PREFIX,
    METADATA,
    PICTURES,
    PRESENCES,
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
    versions,
)
from seerob.recording.series import Column, Spill

ROOT = "world"
"""Frame that every other hangs on."""

Z_UP_FROM_Y_UP_UNDONE: Vec4 = (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)
"""−90° about x, as w, x, y, z: cancels the turn that the viewer applies to a glTF."""

_COLORS: dict[Verdict | None, tuple[float, float, float]] = {
    Verdict.WITHIN: (0x14 / 255, 0xAA / 255, 0xB8 / 255),
    Verdict.UNDECIDED: (0xFC / 255, 0xEA / 255, 0x92 / 255),
    Verdict.EXCEEDED: (0xC1 / 255, 0x15 / 255, 0x40 / 255),
    None: (0.62, 0.68, 0.75),
}
_MARKS = {Verdict.WITHIN: "✓ ", Verdict.UNDECIDED: "? ", Verdict.EXCEEDED: "✕ ", None: ""}
_SOLID, _CLEAR = 1.0, 0.35


def timestamp(t: float) -> Timestamp:
    """Run time [s] as a message."""
    seconds, nanos = divmod(nanoseconds(t), 1_000_000_000)
    return Timestamp(seconds=seconds, nanos=nanos)


def calibration_of(info: CameraInfo, t: float) -> CameraCalibration:
    """A camera's lens, as viewers put a picture in a scene."""
    fx, fy, cx, cy, *distortion = info.lens
    return CameraCalibration(
        timestamp=timestamp(t),
        frame_id=frame_of(info),
        width=info.size[0],
        height=info.size[1],
        distortion_model="plumb_bob",
        D=distortion,
        K=[fx, 0, cx, 0, fy, cy, 0, 0, 1],
        R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
        P=[fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0],
    )


def scene_update(scene: Scene, meshes: dict[str, bytes]) -> SceneUpdate:
    """Every node's mesh, each in the frame of its node; sent once."""
    entities = []
    for node in scene.nodes:
        data = meshes.get(node.mesh or "")
        if data is None:
            continue
        model = ModelPrimitive(
            pose=_pose((0.0, 0.0, 0.0), Z_UP_FROM_Y_UP_UNDONE),
            scale=Vector3(x=1, y=1, z=1),
            media_type="model/gltf-binary",
            data=data,
        )
        color = clear_color(data)
        if color is not None:
            # Not every viewer reads the material's blending.
            model.override_color = True
            model.color.CopyFrom(color)
        entities.append(
            SceneEntity(
                timestamp=timestamp(0), frame_id=node.name, id=node.name, frame_locked=True, models=[model]
            )
        )
    return SceneUpdate(entities=entities)


def clear_color(data: bytes) -> Color | None:
    """Colour of a translucent mesh, such as a safety area; None for an opaque or unreadable one."""
    try:
        primitives = read_glb(data, "mesh")
    except InputError:
        return None
    clear = [p for p in primitives if p.alpha < 1]
    if not clear or len(clear) < len(primitives):
        return None
    r, g, b = clear[0].color
    return Color(r=r, g=g, b=b, a=clear[0].alpha)


def frame_transforms(scene: Scene, snapshot: Snapshot) -> FrameTransforms:
    """Pose of every node in the world, and of cameras."""
    stamp = timestamp(snapshot.t)
    poses = np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7).tolist()
    frames: list[tuple[str, str, Sequence[float]]] = [
        (ROOT, node.name, pose) for node, pose in zip(scene.nodes, poses, strict=True)
    ]
    for camera in scene.cameras:
        if (at := camera.place) is not None:
            frames.append((at.node or ROOT, frame_of(camera), (*at.position, *at.wxyz)))
    return FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=stamp,
                parent_frame_id=parent,
                child_frame_id=child,
                translation=Vector3(x=x, y=y, z=z),
                rotation=Quaternion(w=qw, x=qx, y=qy, z=qz),
            )
            for parent, child, (x, y, z, qw, qx, qy, qz) in frames
        ]
    )


def frame_of(camera: CameraInfo) -> str:
    """What viewers call the frame of a camera."""
    return f"camera {camera.name}"


def marker_update(snapshot: Snapshot) -> SceneUpdate:
    """One entity per result; it replaces the one before, so that old markers vanish."""
    return SceneUpdate(entities=[_entity(r.name, r.markers, snapshot.t) for r in snapshot.results])


def _entity(name: str, markers: Iterable[Marker], t: float) -> SceneEntity:
    entity = SceneEntity(timestamp=timestamp(t), frame_id=ROOT, id=name)
    for marker in markers:
        _draw(entity, marker)
    return entity


def _draw(entity: SceneEntity, marker: Marker) -> None:
    line, fill = _color(marker.verdict, _SOLID), _color(marker.verdict, _CLEAR)
    match marker:
        case Segment(start=start, end=end):
            entity.lines.append(_lines([start, end], line))
            _text(entity, marker, _middle(start, end))
        case Arrow(origin=origin, vector=vector):
            entity.lines.append(_lines(_arrow(np.array(origin), np.array(vector)), line))
            _text(entity, marker, origin)
        case Sphere(center=center, radius=r):
            size = Vector3(x=2 * r, y=2 * r, z=2 * r)
            entity.spheres.append(SpherePrimitive(pose=_pose(center), size=size, color=fill))
            _text(entity, marker, center)
        case Ellipsoid(center=center, wxyz=wxyz, radii=(a, b, c)):
            size = Vector3(x=2 * a, y=2 * b, z=2 * c)
            entity.spheres.append(SpherePrimitive(pose=_pose(center, wxyz), size=size, color=fill))
            _text(entity, marker, center)
        case Box(center=center, wxyz=wxyz, size=(a, b, c)):
            size = Vector3(x=a, y=b, z=c)
            entity.cubes.append(CubePrimitive(pose=_pose(center, wxyz), size=size, color=fill))
            _text(entity, marker, center)
        case Hull(vertices=vertices, faces=faces):
            entity.triangles.append(_triangles(vertices, [i for face in faces for i in face], fill))
            if vertices:
                _text(entity, marker, vertices[0])
        case Polyline(points=points):
            entity.lines.append(_lines([p for leg in marker.legs() for p in leg], line))
            if points:
                _text(entity, marker, points[0])
        case Prism():
            placed, prism_faces, edges = prism(marker)
            corners = [(float(x), float(y), float(z)) for x, y, z in placed]
            entity.triangles.append(_triangles(corners, [int(i) for i in prism_faces.ravel()], fill))
            entity.lines.append(_lines([corners[i] for edge in edges for i in edge], line))
            if corners:
                _text(entity, marker, corners[-1])
        case Rays(starts=starts):
            beams = list(enumerate(marker.beams()))
            for hit, color in ((True, line), (False, fill)):
                ends = [p for k, beam in beams if (k in marker.hits) is hit for p in beam]
                entity.lines.append(_lines(ends, color))
            if starts:
                _text(entity, marker, starts[0])
        case Label(position=position, text=text):
            _text(entity, marker, position, text)
        case Highlight():
            # A body's colour belongs to its model, which is sent once; the verdict is in /results.
            pass


def _text(entity: SceneEntity, marker: Marker, position: Vec3, text: str = "") -> None:
    text = text or getattr(marker, "label", "")
    if text:
        entity.texts.append(
            TextPrimitive(
                pose=_pose(position),
                billboard=True,
                font_size=14,
                scale_invariant=True,
                color=_color(marker.verdict, _SOLID),
                text=_MARKS[marker.verdict] + text,
            )
        )


def _lines(points: list[Vec3], color: Color) -> LinePrimitive:
    return LinePrimitive(
        type=LinePrimitive.LINE_LIST,
        pose=_pose((0.0, 0.0, 0.0)),
        thickness=3,
        scale_invariant=True,
        points=[_point(p) for p in points],
        color=color,
    )


def _triangles(points: Iterable[Vec3], indices: list[int], color: Color) -> TriangleListPrimitive:
    return TriangleListPrimitive(
        pose=_pose((0.0, 0.0, 0.0)), points=[_point(v) for v in points], indices=indices, color=color
    )


def _arrow(origin: Array, vector: Array) -> list[Vec3]:
    """Shaft and four barbs as a line list, shape (10, 3)."""
    tip = origin + vector
    length = float(np.linalg.norm(vector))
    points = [origin, tip]
    if length > 0:
        along = vector / length
        helper = np.eye(3)[int(np.abs(along).argmin())]
        across = cross(along, helper)
        across /= np.linalg.norm(across)
        upward = cross(along, across)
        for side in (across, -across, upward, -upward):
            points += [tip, tip - length * (0.2 * along + 0.08 * side)]
    return [(float(p[0]), float(p[1]), float(p[2])) for p in points]


def _middle(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2


def _point(p: Vec3) -> Point3:
    return Point3(x=p[0], y=p[1], z=p[2])


def _pose(position: Vec3, wxyz: Vec4 = (1.0, 0.0, 0.0, 0.0)) -> Pose:
    w, x, y, z = wxyz
    return Pose(
        position=Vector3(x=position[0], y=position[1], z=position[2]),
        orientation=Quaternion(w=w, x=x, y=y, z=z),
    )


def _color(verdict: Verdict | None, alpha: float) -> Color:
    r, g, b = _COLORS[verdict]
    return Color(r=r, g=g, b=b, a=alpha)


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
        with suppress(
            McapError, ZstdError, EOFError, LookupError, ValueError, struct.error
        ):  # here it is not
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
_LIMB, _POINT = struct.Struct("<7f"), struct.Struct("<3f")


def _limb(pose: tuple[float, ...]) -> tuple[float, ...] | None:
    return None if math.isnan(pose[0]) else pose


_NUMBERS = {"type": "array", "items": {"type": "number"}}
_PRESENCES_SCHEMA = {
    "type": "object",
    "properties": {
        "t": {"type": "number"},
        "visitors": {
            "type": "array",
            "items": {
                "type": "object",
                "properties": {
                    "id": {"type": "integer"},
                    **{key: {**_NUMBERS, "type": ["array", "null"]} for key in ("head", "left", "right")},
                    **{key: {"type": "array", "items": _NUMBERS} for key in ("points", "laser")},
                },
            },
        },
    },
}
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
        "id": {"type": "integer"},
        **{key: {"type": "string"} for key in ("name", "device", "human")},
        "scale": {"type": "number"},
        **dict.fromkeys(("position", "turn"), _NUMBERS),
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
        self._cameras = {camera.name: camera for camera in scene.cameras}
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
        channels = {
            topic: self._mcap.register_channel(topic, "msgpack", 0) for topic in (SCENE, SAMPLES, SNAPSHOT)
        }
        update = register_schema(self._mcap, SceneUpdate)
        transforms = register_schema(self._mcap, FrameTransforms)
        results = self._mcap.register_schema(
            "seerob.Results", "jsonschema", json.dumps(_RESULTS_SCHEMA).encode()
        )
        views = [
            (VIEW_SCENE, "protobuf", update),
            (VIEW_MARKERS, "protobuf", update),
            (VIEW_FRAMES, "protobuf", transforms),
            (VIEW_RESULTS, "json", results),
        ]
        if self._people:
            people = self._mcap.register_schema(
                "seerob.People", "jsonschema", json.dumps(_PEOPLE_SCHEMA).encode()
            )
            views.append((VIEW_PEOPLE, "json", people))
        for topic, encoding, schema in views:
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

    def presences(self, t: float, told: Presences) -> None:
        """Append where visitors were."""
        if PRESENCES not in self._channels:
            schema = self._mcap.register_schema(
                "seerob.Presences", "jsonschema", json.dumps(_PRESENCES_SCHEMA).encode()
            )
            self._channels[PRESENCES] = self._mcap.register_channel(PRESENCES, "json", schema)
        visitors = [
            {
                "id": one.id,
                **dict(zip(("head", "left", "right"), map(_limb, _LIMB.iter_unpack(one.poses)), strict=True)),
                "points": list(_POINT.iter_unpack(one.points)),
                "laser": list(_POINT.iter_unpack(one.laser)),
            }
            for one in told.visitors
        ]
        self._put(PRESENCES, 0, t, msgspec.json.encode({"t": t, "visitors": visitors}))

    def picture(self, t: float, camera: str, jpeg: bytes) -> None:
        """Append what a camera saw; before its first picture, its lens."""
        topic = f"{PICTURES}{camera}"
        if topic not in self._channels:
            for name, kind in ((topic, CompressedImage), (topic + LENS, CameraCalibration)):
                schema = register_schema(self._mcap, kind)
                self._channels[name] = self._mcap.register_channel(name, "protobuf", schema)
            self._put(topic + LENS, 0, t, calibration_of(self._cameras[camera], t).SerializeToString())
        frame = frame_of(self._cameras[camera])
        image = CompressedImage(timestamp=timestamp(t), frame_id=frame, format="jpeg", data=jpeg)
        self._put(topic, 0, t, image.SerializeToString())

    def flush(self) -> None:
        """End the chunk and hand it to the disk: what was written so far survives the process."""
        self._mcap.flush()
        os.fsync(self._file.fileno())
        self.kept = self.ticks

    def finish(self, counts: dict[str, int], broken_off: str = "") -> None:
        """Write the end mark and the index, and close.

        Args:
            counts: Of ticks, and of what was left out.
            broken_off: Why the run ended before it was over; empty when it did not.
        """
        try:
            self._mcap.flush()
            end = {DIGEST: self._digest.hexdigest(), **{k: str(n) for k, n in counts.items()}}
            end |= {BROKEN_OFF: broken_off} if broken_off else {}
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
