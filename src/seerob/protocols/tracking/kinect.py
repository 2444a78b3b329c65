"""Skeletons of Azure Kinect body tracking: the 32 joints, the object per frame in JSON, and live messages.

The object is that of Microsoft's ``offline_processor`` (Azure-Kinect-Samples): ``timestamp_usec``,
``frame_id``, ``num_bodies``, ``bodies``; per body ``body_id``, ``joint_positions`` [mm] and
``joint_orientations`` (w, x, y, z), in the frame of the depth camera: x right, y down, z forward. Our live
message is the same object with a few keys more, one per datagram or WebSocket message. Orbbec's Femto cameras
run the same tracker through a wrapper and say the same.
"""

from __future__ import annotations

from collections.abc import AsyncGenerator
from dataclasses import dataclass
from typing import Annotated, TypeVar

import msgspec
import numpy as np
from msgspec import Meta, Struct

from seerob.core.transforms import Array, left_product, multiplied, turned, wxyz_from_rotation
from seerob.description.capture.captured import Layout, Seen
from seerob.protocols import ProtocolError
from seerob.protocols.links import live_messages
from seerob.protocols.links.live_messages import NONSENSE, SILENCE

T = TypeVar("T")

PORT = 9871
"""Of our live message, UDP and WebSocket alike; not taken by anybody we know."""
MAX_MESSAGE = 1 << 20
MAX_BODIES = 64
"""The tracker's own bound is 20 or so."""

_BONES = (
    ("PELVIS", -1),
    ("SPINE_NAVEL", 0),
    ("SPINE_CHEST", 1),
    ("NECK", 2),
    ("CLAVICLE_LEFT", 2),
    ("SHOULDER_LEFT", 4),
    ("ELBOW_LEFT", 5),
    ("WRIST_LEFT", 6),
    ("HAND_LEFT", 7),
    ("HANDTIP_LEFT", 8),
    ("THUMB_LEFT", 7),
    ("CLAVICLE_RIGHT", 2),
    ("SHOULDER_RIGHT", 11),
    ("ELBOW_RIGHT", 12),
    ("WRIST_RIGHT", 13),
    ("HAND_RIGHT", 14),
    ("HANDTIP_RIGHT", 15),
    ("THUMB_RIGHT", 14),
    ("HIP_LEFT", 0),
    ("KNEE_LEFT", 18),
    ("ANKLE_LEFT", 19),
    ("FOOT_LEFT", 20),
    ("HIP_RIGHT", 0),
    ("KNEE_RIGHT", 22),
    ("ANKLE_RIGHT", 23),
    ("FOOT_RIGHT", 24),
    ("HEAD", 3),
    ("NOSE", 26),
    ("EYE_LEFT", 26),
    ("EAR_LEFT", 26),
    ("EYE_RIGHT", 26),
    ("EAR_RIGHT", 26),
)
JOINTS = tuple(name for name, _ in _BONES)
"""In the order of ``k4abt_joint_id_t``."""
LAYOUT = Layout(
    seen=Seen.JOINTS,
    names=JOINTS,
    convention="azure_kinect",
    parents=tuple(parent for _, parent in _BONES),
)
CONFIDENCE = np.array([0.0, 0.0, 1.0, 1.0])
"""Of the tracker's levels none, low, medium and high: none is out of the picture or too far, low is not
observed but predicted, behind something else; medium is the best that the tracker gives."""

BODY_FROM_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""The camera's optical axes (x right, y down, z forward) in the camera as a thing (x forward, y left, z up).
"""

_TURN = left_product(wxyz_from_rotation(BODY_FROM_OPTICAL))

Number = float | None
"""null is how JSON libraries write NaN."""
_Vec3 = tuple[Number, Number, Number]
_Vec4 = tuple[Number, Number, Number, Number]
_Whole = Annotated[int, Meta(ge=0, le=2**53)]


class BodyObject(Struct, kw_only=True):
    """One person, as the message has it."""

    body_id: Annotated[int, Meta(ge=-1, le=2**53)]
    joint_positions: Annotated[list[_Vec3], Meta(max_length=64)]
    joint_orientations: Annotated[list[_Vec4], Meta(max_length=64)] = []
    joint_confidences: Annotated[list[int], Meta(max_length=64)] = []
    """Live only: 0 none … 3 high."""


class FrameObject(Struct, kw_only=True):
    """One picture of the camera, as the message has it; keys that are not known are left alone."""

    timestamp_usec: _Whole
    frame_id: _Whole = 0
    num_bodies: _Whole | None = None
    bodies: Annotated[list[BodyObject], Meta(max_length=MAX_BODIES)] = []
    camera: Annotated[str, Meta(max_length=100)] = ""
    """Live only: serial number."""
    gravity: _Vec3 | None = None
    """Live only: what the camera's accelerometer feels at rest [m/s²], in the depth camera's frame;
    it points up."""


class LiveObject(FrameObject, kw_only=True):
    """The live message."""

    seerob: str
    """``kinect/1``."""


VAST = 1e100
"""Counts as infinitely far, and is still a number [m]."""
VERSION = "kinect/1"


@dataclass(frozen=True, eq=False, slots=True)
class Body:
    """One person in one picture, in metres, in the camera's frame x forward, y left, z up."""

    id: int
    positions: Array
    """[m], shape (32, 3); NaN where not seen."""
    orientations: Array | None
    """Camera from joint, w first, shape (32, 4)."""
    confidence: Array | None
    """From 0 to 1, shape (32,)."""


@dataclass(frozen=True, eq=False, slots=True)
class Picture:
    """All persons at one instant."""

    t: float
    """On the camera's clock [s]."""
    bodies: tuple[Body, ...]
    frame: int = 0
    camera: str = ""
    up: Array | None = None
    """Away from the centre of the earth, in the camera's frame x forward, y left, z up, shape (3,)."""


_frames = msgspec.json.Decoder(FrameObject)
_live = msgspec.json.Decoder(LiveObject)


def decode_frame(data: bytes) -> Picture:
    """One object of the list ``frames``.

    Raises:
        ProtocolError: It is not such an object.
    """
    return _picture(_decoded(_frames, data))


def decode_message(data: bytes | str) -> Picture:
    """One live message.

    Raises:
        ProtocolError: It is not such a message.
    """
    if len(data) > MAX_MESSAGE:
        raise ProtocolError(f"a message of {len(data)} bytes, more than {MAX_MESSAGE}")
    heard = _decoded(_live, data)
    if heard.seerob != VERSION:
        raise ProtocolError(f"version {heard.seerob[:40]!r}, not {VERSION!r}: sender and receiver differ")
    return _picture(heard)


def encode_message(picture: Picture) -> bytes:
    """A live message; what is NaN becomes null."""
    up = None
    if picture.up is not None:
        up = tuple((BODY_FROM_OPTICAL.T @ picture.up * 9.81).tolist())
    message = LiveObject(
        seerob=VERSION,
        timestamp_usec=round(picture.t * 1e6),
        frame_id=picture.frame,
        num_bodies=len(picture.bodies),
        camera=picture.camera,
        gravity=up,
        bodies=[body_object(body) for body in picture.bodies],
    )
    return msgspec.json.encode(message)


def body_object(body: Body) -> BodyObject:
    """A person as the camera says it: mm, x right, y down, z forward."""
    turn = BODY_FROM_OPTICAL.T
    positions = np.round(body.positions @ turn.T * 1e3, 2)
    orientations: list[_Vec4] = []
    if body.orientations is not None:
        orientations = [tuple(row) for row in _optical(body.orientations, back=True).round(6).tolist()]
    levels: list[int] = []
    if body.confidence is not None:
        predicted = np.isfinite(body.positions).all(axis=1)
        levels = np.where(body.confidence > 0.0, 2, np.where(predicted, 1, 0)).tolist()
    return BodyObject(
        body_id=body.id,
        joint_positions=[tuple(row) for row in positions.tolist()],
        joint_orientations=orientations,
        joint_confidences=levels,
    )


def camera_body(body_id: int, positions: Array, wxyz: Array | None, levels: Array | None) -> Body:
    """A person of what the tracker gives.

    Args:
        body_id: The tracker's number.
        positions: In the optical frame x right, y down, z forward [m], shape (32, 3).
        wxyz: Optical frame from joint, shape (32, 4).
        levels: 0 none … 3 high, shape (32,).
    """
    # A tracker that knows nothing of a joint leaves zeros: the camera itself.
    unknown = (positions == 0).all(axis=1)
    # Infinity stays far when it is turned, and does not become a joint that is not seen.
    positions = np.clip(positions, -VAST, VAST)
    return Body(
        id=body_id,
        positions=np.where(unknown[:, None], np.nan, positions @ BODY_FROM_OPTICAL.T),
        orientations=None if wxyz is None else _optical(wxyz),
        confidence=None if levels is None else CONFIDENCE[np.clip(levels, 0, 3).astype(int)],
    )


def _optical(wxyz: Array, *, back: bool = False) -> Array:
    return turned(BODY_FROM_OPTICAL.T, wxyz) if back else multiplied(_TURN, wxyz)


def _decoded(decoder: msgspec.json.Decoder[T], data: bytes | str) -> T:
    try:
        return decoder.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ProtocolError(f"not a frame of body tracking: {error}") from error
    except RecursionError as error:
        raise ProtocolError("not a frame of body tracking: nested too deep") from error


def _picture(said: FrameObject) -> Picture:
    if said.num_bodies is not None and said.num_bodies != len(said.bodies):
        raise ProtocolError(f"num_bodies is {said.num_bodies}, and {len(said.bodies)} bodies are there")
    up = None
    if said.gravity is not None:
        felt = BODY_FROM_OPTICAL @ _floats(said.gravity)
        size = float(np.linalg.norm(felt))
        # Anything else is an accelerometer in motion, or none.
        up = felt / size if 8.8 < size < 10.8 else None
    return Picture(
        t=said.timestamp_usec * 1e-6,
        bodies=tuple(_body(body) for body in said.bodies),
        frame=said.frame_id,
        camera=said.camera,
        up=up,
    )


def _body(said: BodyObject) -> Body:
    count = len(JOINTS)
    for name in ("joint_positions", "joint_orientations", "joint_confidences"):
        rows = getattr(said, name)
        if len(rows) != count and (rows or name == "joint_positions"):
            raise ProtocolError(f"body {said.body_id}: {len(rows)} {name}, {count} are expected")
    return camera_body(
        said.body_id,
        _floats(said.joint_positions) * 1e-3,
        _floats(said.joint_orientations) if said.joint_orientations else None,
        np.clip(np.array(said.joint_confidences, float), 0, 3) if said.joint_confidences else None,
    )


def _floats(rows: object) -> Array:
    return np.array(rows, dtype=float)


__all__ = ["NONSENSE", "SILENCE", "Sieve", "from_datagrams", "from_websocket"]


class Sieve(live_messages.Sieve[Picture]):
    """Lets through pictures that are newer."""

    def __init__(self) -> None:
        super().__init__(decode_message, "the camera")


def from_datagrams(
    bind: str, port: int, sender: str | None, silence: float = SILENCE
) -> AsyncGenerator[tuple[float, Picture], None]:
    """Pictures that somebody sends to this machine; see `live_messages.from_datagrams`."""
    return live_messages.from_datagrams(Sieve(), bind, port, sender, silence)


def from_websocket(
    host: str, port: int, silence: float = SILENCE
) -> AsyncGenerator[tuple[float, Picture], None]:
    """Pictures over a connection to the sender; see `live_messages.from_websocket`."""
    return live_messages.from_websocket(Sieve(), host, port, silence)
