"""Results of MediaPipe's pose landmarker: 33 landmarks per person in metres, about the middle of the hips.

Spellings of its results: Python's ``pose_world_landmarks``, JavaScript's and Swift's ``worldLandmarks``
(``poseWorldLandmarks`` before 2023), each a list of persons or one person; of protocol buffers,
``{"landmark": […]}``. Axes of the picture: x right, y down, z away from the camera. The time, which results
do not hold, stands beside them as ``timestamp_ms`` or ``timestampMs``, as `detect_for_video` takes it.
(ai.google.dev/edge/mediapipe/solutions/vision/pose_landmarker)
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from operator import mul
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta, Struct

from seerob.core.samples import Vec4
from seerob.core.transforms import Array, wxyz_from_rows
from seerob.description.capture.captured import Layout, Seen
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.kinect import BODY_FROM_OPTICAL

PORT = 9872
"""Of our live message; not taken by anybody we know."""
LARGEST = 1 << 17
"""Of a message [byte]; one of one person has 4 kB."""
VISIBLE = 0.5
"""From this visibility on a landmark is seen; below, MediaPipe only predicts it. A choice: its own default
for the confidence of a whole pose."""
OFF_CENTRE = 0.05
"""World landmarks have the middle of the hips at the origin, to 1 mm as measured; what is farther off [m] are
coordinates in a picture, or have been moved."""

LANDMARKS = (
    "nose",
    *(f"{side}_eye{part}" for side in ("left", "right") for part in ("_inner", "", "_outer")),
    "left_ear",
    "right_ear",
    "mouth_left",
    "mouth_right",
    *(
        f"{side}_{part}"
        for part in ("shoulder", "elbow", "wrist", "pinky", "index", "thumb", "hip", "knee", "ankle", "heel")
        for side in ("left", "right")
    ),
    "left_foot_index",
    "right_foot_index",
)
SEGMENTS = ("pelvis", "thorax", "head")
"""What landmarks turn beside the joints: the trunk, whose spine is taken as straight between hips and
shoulders, and the head, by ears and nose."""
LAYOUT = Layout(seen=Seen.JOINTS, names=(*LANDMARKS, *SEGMENTS), convention="mediapipe", scaled=True)
_DOWN = np.arctan2(0.005, 0.065)
NOSE_TURN = np.array(
    [[np.cos(_DOWN), -np.sin(_DOWN), 0.0], [np.sin(_DOWN), np.cos(_DOWN), 0.0], [0.0, 0.0, 1.0]]
)
"""Face (ears to tip of the nose, up, right) from head: the tip is as much below the ears as in the table of
the Azure Kinect's names (shares of the stature; a choice)."""
_LEFT, _RIGHT = (
    [LANDMARKS.index(f"{side}_{part}") for part in ("hip", "shoulder", "ear")] for side in ("left", "right")
)
"""Rows at both ends of what points right, by segment."""
_HIPS = _LEFT[0], _RIGHT[0]
_TRUNK = [*_LEFT[:2], *_RIGHT[:2]]
_USED = (_TRUNK, _TRUNK, [LANDMARKS.index("nose"), _LEFT[2], _RIGHT[2]])
"""What tells how a segment is turned."""
_Columns = tuple[tuple[float, float], tuple[float, float]]
_NOSE_COLUMNS: _Columns = tuple((float(c), float(s)) for c, s in NOSE_TURN[:2, :2].T)  # type: ignore[assignment]
NOWHERE = (math.nan,) * 4


class Landmark(Struct):
    """One landmark as the result has it."""

    x: float | None = None
    y: float | None = None
    z: float | None = None
    visibility: float | None = None


class _Wrapped(Struct):
    landmark: Annotated[list[Landmark], Meta(max_length=600)]


class ResultObject(Struct):
    """One result, in the spelling of any of MediaPipe's languages; keys that are not known are left alone."""

    timestamp_ms: float | None = None
    timestampMs: float | None = None  # JavaScript's spelling
    pose_world_landmarks: msgspec.Raw = msgspec.Raw()
    worldLandmarks: msgspec.Raw = msgspec.Raw()
    poseWorldLandmarks: msgspec.Raw = msgspec.Raw()
    pose_landmarks: msgspec.Raw = msgspec.Raw()
    landmarks: msgspec.Raw = msgspec.Raw()
    poseLandmarks: msgspec.Raw = msgspec.Raw()


_result = msgspec.json.Decoder(ResultObject)
_one = msgspec.json.Decoder(list[Landmark])
_many = msgspec.json.Decoder(Annotated[list[list[Landmark]], Meta(max_length=64)])
_wrapped = msgspec.json.Decoder(_Wrapped)


@dataclass(frozen=True, eq=False, slots=True)
class Result:
    """What was found in one picture."""

    t: float
    """[s]; NaN where nobody says it."""
    people: tuple[Array, ...]
    """Per person in the axes of the picture x right, y down, z away from the camera [m], and its visibility
    from 0 to 1, shape (33, 4); NaN where not said."""


def decode(data: bytes | str) -> Result:
    """One result.

    Raises:
        ProtocolError: It is none, has no world landmarks, or others than the 33.
    """
    if len(data) > LARGEST:
        raise ProtocolError(f"a result of {len(data)} bytes, more than {LARGEST}")
    try:
        said = _result.decode(data)
        people = _people(said)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ProtocolError(f"no result of MediaPipe's pose landmarker: {error}") from error
    except RecursionError as error:
        raise ProtocolError("no result of MediaPipe's pose landmarker: nested too deep") from error
    stamp = said.timestamp_ms if said.timestamp_ms is not None else said.timestampMs
    return Result(t=np.nan if stamp is None else stamp * 1e-3, people=people)


def decode_message(data: bytes | str) -> Result:
    """One live message: a result with its time.

    Raises:
        ProtocolError: It is no result, or says no time.
    """
    result = decode(data)
    if not np.isfinite(result.t):
        raise ProtocolError("no timestamp_ms in it")
    return result


def _people(said: ResultObject) -> tuple[Array, ...]:
    raw = said.pose_world_landmarks or said.worldLandmarks or said.poseWorldLandmarks
    if not raw:
        if said.pose_landmarks or said.landmarks or said.poseLandmarks:
            raise ProtocolError(
                "landmarks in the picture are no lengths: write the world landmarks (pose_world_landmarks, "
                "worldLandmarks)"
            )
        raise ProtocolError("no pose_world_landmarks or worldLandmarks in it")
    text = bytes(raw).strip()
    if text == b"null":
        return ()
    if text.startswith(b"{"):
        found = [_wrapped.decode(raw).landmark]
    elif text[1:].lstrip()[:1] == b"{":
        found = [_one.decode(raw)]
    else:
        found = _many.decode(raw)
    for landmarks in found:
        if len(landmarks) != len(LANDMARKS):
            raise ProtocolError(f"{len(landmarks)} landmarks, {len(LANDMARKS)} are expected")
    return tuple(
        np.array([(mark.x, mark.y, mark.z, mark.visibility) for mark in landmarks], dtype=float)
        for landmarks in found
    )


def centred(values: Array) -> bool:
    """Whether the middle of the hips is the origin, as it is of world landmarks.

    Args:
        values: Of people or instants, shape (…, 33, 4).
    """
    middles = ((values[..., _HIPS[0], :3] + values[..., _HIPS[1], :3]) / 2).reshape(-1, 3)
    far = [math.hypot(*middle) for middle in middles.tolist()]
    known = [way for way in far if math.isfinite(way)]
    return not known or statistics.median(known) <= OFF_CENTRE


def camera_points(values: Array) -> tuple[Array, Array, Array]:
    """What is seen in the camera's frame as a thing, x forward, y left, z up.

    Args:
        values: Landmarks in the axes of the picture [m] with visibilities, shape (n, 33, 4).

    Returns:
        In the order of `LAYOUT`, positions of landmarks about the middle of the hips [m], shape (n, 36, 3);
        orientations of segments, forward, up, right, w first, shape (n, 36, 4), NaN for landmarks;
        confidences 0 or 1, shape (n, 36): 0 also where nobody says a visibility.
    """
    count, n = len(values), len(LANDMARKS)
    positions = np.full((count, n + len(SEGMENTS), 3), np.nan)
    positions[:, :n] = values[..., :3] @ BODY_FROM_OPTICAL.T
    orientations = np.full((count, n + len(SEGMENTS), 4), np.nan)
    confidence = np.ones((count, n + len(SEGMENTS)))
    confidence[:, :n] = np.where(values[..., 3] >= VISIBLE, 1.0, 0.0)
    middles = (positions[:, _LEFT] + positions[:, _RIGHT]) / 2
    hips, shoulders, ears = middles.transpose(1, 0, 2)
    up, ahead = shoulders - hips, positions[:, LANDMARKS.index("nose")] - ears
    across = positions[:, _RIGHT] - positions[:, _LEFT]
    for k, (way, turn) in enumerate(((up, None), (up, None), (ahead, _NOSE_COLUMNS))):
        pairs = zip(across[:, k].tolist(), way.tolist(), strict=True)
        orientations[:, n + k] = [_orientation(right, other, turn) for right, other in pairs]
        confidence[:, n + k] = confidence[:, _USED[k]].min(axis=1)
    return positions, orientations, confidence


def _orientation(across: Sequence[float], way: Sequence[float], turn: _Columns | None) -> Vec4:
    """World from segment, w first; NaN where it is not known. In plain numbers: of one person they are few.

    Args:
        across: What points right.
        way: What points up, or forward where there is a turn.
        turn: How the segment is turned in the frame of both, about what points right.
    """
    z = _unit(across)
    along = sum(map(mul, way, z))
    y = _unit([a - along * b for a, b in zip(way, z, strict=True)])
    x = y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]
    first: Sequence[float] = x
    second: Sequence[float] = y
    if turn is not None:
        ahead, up = y, [-a for a in x]
        first, second = (tuple([c * a + s * b for a, b in zip(ahead, up, strict=True)]) for c, s in turn)
    rows = list(zip(first, second, z, strict=True))
    return wxyz_from_rows(rows) if math.isfinite(sum(map(sum, rows))) else NOWHERE


def _unit(v: Sequence[float]) -> tuple[float, float, float]:
    size = math.hypot(*v) or math.nan
    return v[0] / size, v[1] / size, v[2] / size
