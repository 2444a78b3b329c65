"""Rokoko Studio's live stream: one JSON object per datagram, plain or in an LZ4 frame.

Version 3 has the persons under ``scene.actors``, version 2 under ``actors``; a datagram that calls itself 3
and has ``trackers`` is a version 2. Metres, y up, left-handed, as Unity has it (from memory, as is the
port); here turned into a right-handed world with z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter
from typing import Annotated

import msgspec
import numpy as np
from msgspec import UNSET, Meta, Struct, UnsetType

from seerob.core.transforms import Array
from seerob.description.capture.captured import Layout, Seen
from seerob.protocols import ProtocolError

PORT = 14043
LARGEST = 1 << 17
"""Of a datagram [byte]; Studio's own are 80 kB at most."""
UNPACKED = 1 << 20
"""An LZ4 frame may hold at most so much [byte]."""
MOST_ACTORS = 32

WORLD_FROM_UNITY = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""z is forward there, x right, y up: x forward, y left, z up. Its determinant is -1."""
_LZ4 = b"\x04\x22\x4d\x18"
_Name = Annotated[str, Meta(max_length=200)]


class Vector(Struct, frozen=True, gc=False):
    """A position or, with ``w``, a rotation."""

    x: float | None = None
    y: float | None = None
    z: float | None = None
    w: float | None = None


class Segment(Struct, frozen=True):
    """One bone as the datagram has it."""

    position: Vector
    rotation: Vector | None = None


_NOT_SAID = Segment(Vector())


class Segments(Struct):
    """Bones of one person; keys that are not known are left alone."""

    hip: Segment = _NOT_SAID
    spine: Segment = _NOT_SAID
    chest: Segment = _NOT_SAID
    neck: Segment = _NOT_SAID
    head: Segment = _NOT_SAID
    leftShoulder: Segment = _NOT_SAID
    leftUpperArm: Segment = _NOT_SAID
    leftLowerArm: Segment = _NOT_SAID
    leftHand: Segment = _NOT_SAID
    leftUpLeg: Segment = _NOT_SAID
    leftLeg: Segment = _NOT_SAID
    leftFoot: Segment = _NOT_SAID
    leftToe: Segment = _NOT_SAID
    rightShoulder: Segment = _NOT_SAID
    rightUpperArm: Segment = _NOT_SAID
    rightLowerArm: Segment = _NOT_SAID
    rightHand: Segment = _NOT_SAID
    rightUpLeg: Segment = _NOT_SAID
    rightLeg: Segment = _NOT_SAID
    rightFoot: Segment = _NOT_SAID
    rightToe: Segment = _NOT_SAID


SEGMENTS = Segments.__struct_fields__
LAYOUT = Layout(seen=Seen.JOINTS, names=SEGMENTS, convention="rokoko")
_in_order = attrgetter(*SEGMENTS)


class ActorObject(Segments):
    """One person as the datagram has it; ``body`` in version 3, the segments themselves in version 2."""

    name: _Name = ""
    body: Segments | UnsetType = UNSET


class SceneObject(Struct):
    """What version 3 puts around the persons."""

    timestamp: float | None = None
    actors: Annotated[list[ActorObject], Meta(max_length=MOST_ACTORS)] = []


class Datagram(Struct):
    """The whole object; keys that are not known are left alone."""

    version: str | float | None = None
    fps: float | None = None
    scene: SceneObject | None = None
    timestamp: float | None = None
    actors: Annotated[list[ActorObject], Meta(max_length=MOST_ACTORS)] = []


@dataclass(frozen=True, eq=False, slots=True)
class Actor:
    """One person."""

    name: str
    positions: Array
    """World, z up [m], shape (21, 3) in the order of `SEGMENTS`; NaN where not said."""
    orientations: Array
    """World from segment, w first, shape (21, 4); NaN where not said."""


@dataclass(frozen=True, eq=False, slots=True)
class Scene:
    """Everybody at one instant."""

    t: float
    """On Studio's clock [s]; NaN when it does not say."""
    version: str
    """``2`` or ``3``."""
    actors: tuple[Actor, ...]
    fps: float | None = None


_datagrams = msgspec.json.Decoder(Datagram)


def decode(data: bytes | str) -> Scene:
    """One datagram.

    Raises:
        ProtocolError: It is none of Studio's, or too large, or a damaged LZ4 frame.
    """
    raw = data.encode() if isinstance(data, str) else bytes(data)
    if len(raw) > LARGEST:
        raise ProtocolError(f"a datagram of {len(raw)} bytes, more than {LARGEST}")
    try:
        return _scene(_unpacked(raw) if raw.startswith(_LZ4) else raw)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ProtocolError(f"not a datagram of Rokoko Studio in JSON: {error}") from error
    except RecursionError as error:
        raise ProtocolError("not a datagram of Rokoko Studio: nested too deep") from error


def _unpacked(raw: bytes) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    frame = LZ4FrameDecompressor()
    try:
        text: bytes = frame.decompress(raw, max_length=UNPACKED + 1)
    except (RuntimeError, MemoryError, ValueError) as error:
        raise ProtocolError(f"a damaged LZ4 frame: {error}") from error
    if len(text) > UNPACKED:
        raise ProtocolError(f"an LZ4 frame of more than {UNPACKED} bytes")
    if not frame.eof:
        raise ProtocolError("an LZ4 frame that is cut short")
    return text


def _scene(text: bytes) -> Scene:
    said = _datagrams.decode(text)
    # One that says 3 and has its persons at the root is really a 2.
    if said.scene is not None:
        version, when, actors = "3", said.scene.timestamp, said.scene.actors
    elif said.actors or said.timestamp is not None:
        version, when, actors = "2", said.timestamp, said.actors
    else:
        raise ProtocolError("neither scene nor actors: not a datagram of Rokoko Studio in JSON v2 or v3")
    return Scene(
        t=float("nan") if when is None else float(when),
        version=version,
        actors=tuple([_actor(said) for said in actors]),
        fps=said.fps,
    )


def _actor(said: ActorObject) -> Actor:
    segments = _in_order(said if said.body is UNSET else said.body)
    both = [(each.position, each.rotation or _NOT_SAID.position) for each in segments]
    # What is None becomes NaN.
    values = np.array([(p.x, p.y, p.z, r.w, r.x, r.y, r.z) for p, r in both], float)
    return Actor(said.name, values[:, :3] @ WORLD_FROM_UNITY.T, _mirrored(values[:, 3:]))


def _mirrored(wxyz: Array) -> Array:
    """Rotations of a left-handed frame, in the world: ``M R Mᵀ``, whose axis is ``det(M) M`` times theirs."""
    out = wxyz.copy()
    out[:, 1:] = -(wxyz[:, 1:] @ WORLD_FROM_UNITY.T)
    return out


def encode(scene: Scene, *, compressed: bool = False) -> bytes:
    """A datagram as Studio sends it; what is NaN becomes null."""
    actors = [_actor_object(actor, nested=scene.version == "3") for actor in scene.actors]
    when = None if np.isnan(scene.t) else scene.t
    if scene.version == "3":
        said: dict[str, object] = {
            "version": "3,0",
            "fps": scene.fps,
            "scene": {"timestamp": when, "actors": actors, "props": []},
        }
    else:
        said = {"version": 2, "timestamp": when, "props": [], "trackers": [], "faces": [], "actors": actors}
    text = msgspec.json.encode(said)
    if not compressed:
        return text
    import lz4.frame

    packed: bytes = lz4.frame.compress(text)
    return packed


def _actor_object(actor: Actor, *, nested: bool) -> dict[str, object]:
    positions = (actor.positions @ WORLD_FROM_UNITY).tolist()
    turns = actor.orientations.copy()
    turns[:, 1:] = -(turns[:, 1:] @ WORLD_FROM_UNITY)
    body = {
        name: {
            "position": dict(zip("xyz", positions[row], strict=True)),
            "rotation": dict(zip("wxyz", turns[row].tolist(), strict=True)),
        }
        for row, name in enumerate(SEGMENTS)
    }
    return (
        {"name": actor.name, "meta": {"hasBody": True}, "body": body}
        if nested
        else {"name": actor.name, **body}
    )
