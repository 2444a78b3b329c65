"""Payloads of NatNet as Motive writes them, for the versions 2.0 to 4.x."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from seerob.protocols.tracking.natnet import RIGID_BODY, SKELETON, BoneModel, Frame, Models, Skeleton, Version
from seerob.protocols.tracking.natnet import Body as RigidBody

ONE_MARKER = struct.pack("<i", 1) + struct.pack("<3f", 0.1, 0.2, 0.3)


def frame(said: Frame, version: Version) -> bytes:
    """Payload of a frame; with one marker set and one unlabelled marker, as real ones have."""
    markers = b"all\0" + ONE_MARKER
    parts = [
        struct.pack("<i", said.number),
        _listed([markers], version),
        _listed([struct.pack("<3f", 0.4, 0.5, 0.6)], version),
        _listed([_body(body, version) for body in said.bodies], version),
    ]
    if version >= (2, 1):
        parts.append(_listed([_skeleton(s, version) for s in said.skeletons], version))
    if version >= (4, 1):
        parts.append(_listed([], version))
    if version >= (2, 3):
        labeled = struct.pack("<i4f", 7, 0.1, 0.2, 0.3, 0.014)
        labeled += struct.pack("<H", 0) if version >= (2, 6) else b""
        labeled += struct.pack("<f", 0.0004) if version >= (3, 0) else b""
        parts.append(_listed([labeled], version))
    if version >= (2, 9):
        parts.append(_listed([struct.pack("<iiif", 1, 1, 1, 9.81)], version))
    if version >= (2, 11):
        parts.append(_listed([], version))
    parts.append(struct.pack("<II", 0, 0))
    parts.append(struct.pack("<d" if version >= (2, 7) else "<f", said.t))
    if version >= (3, 0):
        parts.append(struct.pack("<3Q", 1, 2, 3))
    if version >= (4, 1):
        parts.append(struct.pack("<II", 4, 5))
    parts.append(struct.pack("<HI", said.recording | said.models_changed << 1, 0))
    return b"".join(parts)


def models(said: Models, version: Version) -> bytes:
    """Payload of the model definitions."""
    found = [_defined(RIGID_BODY, _bone_model(body, version), version) for body in said.bodies]
    for skeleton in said.skeletons:
        bones = b"".join(_bone_model(bone, version) for bone in skeleton.bones)
        head = skeleton.name.encode() + b"\0" + struct.pack("<ii", skeleton.id, len(skeleton.bones))
        found.append(_defined(SKELETON, head + bones, version))
    markers = b"all\0" + struct.pack("<i", 1) + b"marker\0"
    found.append(_defined(0, markers, version))
    return struct.pack("<i", len(found)) + b"".join(found)


def server_info(name: str, version: Version, *, port: int, group: str | None) -> bytes:
    """Payload of the answer to a client that connects."""
    start = name.encode().ljust(256, b"\0") + bytes([1, 0, 0, 0, *version, 0, 0])
    if version < (3, 0):
        return start
    where = bytes(int(part) for part in (group or "0.0.0.0").split("."))  # noqa: S104  # none
    return start + struct.pack("<QH?", 10_000_000, port, group is not None) + where


def _listed(items: Sequence[bytes], version: Version) -> bytes:
    content = b"".join(items)
    size = struct.pack("<i", len(content)) if version >= (4, 1) else b""
    return struct.pack("<i", len(items)) + size + content


def _body(body: RigidBody, version: Version) -> bytes:
    data = struct.pack("<i7f", body.id, *body.position, *body.xyzw)
    if version < (3, 0):
        data += ONE_MARKER + struct.pack("<if", 1, 0.014)
    data += struct.pack("<f", body.error)
    return data + (struct.pack("<H", body.tracked) if version >= (2, 6) else b"")


def _skeleton(skeleton: Skeleton, version: Version) -> bytes:
    bones = b"".join(_body(bone, version) for bone in skeleton.bones)
    return struct.pack("<ii", skeleton.id, len(skeleton.bones)) + bones


def _bone_model(bone: BoneModel, version: Version) -> bytes:
    data = bone.name.encode() + b"\0" + struct.pack("<ii3f", bone.id, bone.parent, 0.0, 0.1, 0.0)
    if version >= (4, 2):
        data += struct.pack("<4f", 0.0, 0.0, 0.0, 1.0)
    if version >= (3, 0):
        data += struct.pack("<i3fi", 1, 0.0, 0.0, 0.0, 3)
        data += b"m1\0" if version >= (4, 0) else b""
    return data


def _defined(kind: int, content: bytes, version: Version) -> bytes:
    size = struct.pack("<i", len(content)) if version >= (4, 1) else b""
    return struct.pack("<i", kind) + size + content
