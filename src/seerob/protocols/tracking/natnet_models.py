"""NatNet's model definitions: which number is which rigid body, which person, which bone."""

from __future__ import annotations

from typing import NamedTuple

from seerob.protocols import ProtocolError
from seerob.protocols.links.little_endian import Cursor
from seerob.protocols.tracking.natnet import MOST, MOST_BONES, Version

MARKER_SET, RIGID_BODY, SKELETON, FORCE_PLATE, DEVICE, CAMERA, ASSET = range(7)


class BoneModel(NamedTuple):
    """A rigid body, or a bone of a skeleton."""

    id: int
    name: str
    parent: int
    """Number of the parent; -1 or 0 for none."""


class SkeletonModel(NamedTuple):
    """One person."""

    id: int
    name: str
    bones: tuple[BoneModel, ...]


class Models(NamedTuple):
    """Everything that has a name and is followed here."""

    bodies: tuple[BoneModel, ...] = ()
    skeletons: tuple[SkeletonModel, ...] = ()


def models(payload: bytes, version: Version) -> Models:
    """Definitions of the rigid bodies and skeletons.

    Args:
        payload: Of a datagram `Message.MODELS`.
        version: Of NatNet, as the server says.

    Raises:
        ProtocolError: It contradicts itself or ends too early, or has a kind whose size is not known.
    """
    cursor = Cursor(payload, "NatNet model definitions")
    bodies, skeletons = [], []
    for _ in range(cursor.count(4, MOST)):
        kind = cursor.whole()
        end = None
        if version >= (4, 1):
            size = cursor.whole()
            if not 0 <= size <= cursor.left:
                raise ProtocolError(f"NatNet model definitions: one of {size} bytes, {cursor.left} are left")
            end = cursor.at + size
        if kind == RIGID_BODY:
            bodies.append(_bone(cursor, version))
        elif kind == SKELETON:
            skeletons.append(_skeleton(cursor, version))
        elif end is None:
            _over(cursor, kind, version)
        if end is not None:
            cursor.skip(end - cursor.at)
    return Models(tuple(bodies), tuple(skeletons))


def _bone(cursor: Cursor, version: Version) -> BoneModel:
    name = cursor.name()
    number, parent = cursor.whole(), cursor.whole()
    cursor.skip(12)
    if version >= (4, 2):
        cursor.skip(16)
    if version >= (3, 0):
        markers = cursor.count(16, MOST)
        cursor.skip(16 * markers)
        if version >= (4, 0):
            for _ in range(markers):
                cursor.name()
    return BoneModel(number, name, parent)


def _skeleton(cursor: Cursor, version: Version) -> SkeletonModel:
    name, number = cursor.name(), cursor.whole()
    bones = tuple(_bone(cursor, version) for _ in range(cursor.count(21, MOST_BONES)))
    return SkeletonModel(number, name, bones)


def _over(cursor: Cursor, kind: int, version: Version) -> None:
    """Read over a kind that is not needed, in versions that do not say its size."""
    if kind == MARKER_SET:
        cursor.name()
        for _ in range(cursor.count(1, MOST)):
            cursor.name()
    elif kind == FORCE_PLATE:
        cursor.whole()
        cursor.name()
        # Width, length, origin, calibration matrix 12 x 12, four corners, two kinds.
        cursor.skip(4 * (2 + 3 + 144 + 12 + 2))
        for _ in range(cursor.count(1, MOST)):
            cursor.name()
    elif kind == DEVICE:
        cursor.whole()
        cursor.name()
        cursor.name()
        cursor.skip(8)
        for _ in range(cursor.count(1, MOST)):
            cursor.name()
    elif kind == CAMERA:
        cursor.name()
        cursor.skip(28)
    else:
        raise ProtocolError(f"NatNet model definitions: kind {kind} in version {version[0]}.{version[1]}")
