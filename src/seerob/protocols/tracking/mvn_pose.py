"""A person from MVN's numbers: metres, z up, right-handed, whatever kind of datagram they came in.

Three kinds hold a pose, each in a frame of its own (MV0305P revision N, §2.5). What the specification
leaves open, and what is taken here:

- Centimetres or metres: §2.5.6 says centimetres, MVN's manual metres. `unit_of` looks at the trunk, whose
  length no posture changes.
- y up (kinds 01 and 05, and 02 when MVN is set so): z forward, x to the left, so that
  ``(x, y, z)`` up is ``(z, x, y)`` here; left-handed (05) x is to the right.
- Euler angles (01): about the fixed axes x, then y, then z, :math:`R = R_z R_y R_x`.
- Positions of kind 05 against the parent: in the parent's frame.

Xsens MVN's skeleton: names of segments and joints, their order, and which hangs on which.

Order and numbers: MVN real-time network streaming protocol specification, MV0305P revision N (2018),
tables 1 to 3; the names are those of MVNX files. A segment's identifier is its place plus one. Segment
frames have x forward, y to the left and z up when the person stands in the T-pose.
"""

from __future__ import annotations

from enum import StrEnum
from functools import cache

import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array, wxyz_from
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.mvn import Items, Kind

SPINE = ("Pelvis", "L5", "L3", "T12", "T8", "Neck", "Head")
_ARM = ("Shoulder", "UpperArm", "ForeArm", "Hand")
_LEG = ("UpperLeg", "LowerLeg", "Foot", "Toe")


def _limb(side: str, parts: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(side + part for part in parts)


SEGMENTS: tuple[str, ...] = (
    *SPINE,
    *_limb("Right", _ARM),
    *_limb("Left", _ARM),
    *_limb("Right", _LEG),
    *_limb("Left", _LEG),
)
"""The 23 segments, table 1."""

UNITY: tuple[str, ...] = (
    "Pelvis",
    *_limb("Right", _LEG),
    *_limb("Left", _LEG),
    *SPINE[1:5],
    *_limb("Left", _ARM),
    *_limb("Right", _ARM),
    "Neck",
    "Head",
)
"""The 23 segments in the order of the Unity3D protocol, table 3."""


def _joints() -> tuple[tuple[str, str, str], ...]:
    rows = [
        ("jL5S1", "Pelvis", "L5"),
        ("jL4L3", "L5", "L3"),
        ("jL1T12", "L3", "T12"),
        ("jT9T8", "T12", "T8"),
        ("jT1C7", "T8", "Neck"),
        ("jC1Head", "Neck", "Head"),
    ]
    for names, first, segments in (
        (("T4Shoulder", "Shoulder", "Elbow", "Wrist"), "T8", _ARM),
        (("Hip", "Knee", "Ankle", "BallFoot"), "Pelvis", _LEG),
    ):
        for side in ("Right", "Left"):
            chain = (first, *_limb(side, segments))
            rows += [(f"j{side}{name}", chain[k], chain[k + 1]) for k, name in enumerate(names)]
    return tuple(rows)


JOINTS: tuple[tuple[str, str, str], ...] = _joints()
"""Label, parent and child of the 22 joints, as MVNX files list them; files before 2018 write C7 for T4."""

PARENTS: tuple[int, ...] = (
    -1,
    *(next(SEGMENTS.index(p) for _, p, child in JOINTS if child == name) for name in SEGMENTS[1:]),
)
"""Place of the parent of each of `SEGMENTS`, -1 for the pelvis."""

_FINGERS = (
    "Carpus",
    *(
        f"{number}{bone}"
        for number in ("First", "Second", "Third", "Fourth", "Fifth")
        for bone in ("MC", *(("PP", "DP") if number == "First" else ("PP", "MP", "DP")))
    ),
)
MAX_PROPS = 4
FINGERS = 2 * len(_FINGERS)
"""Segments of both hands: 40."""


@cache
def names(props: int = 0, fingers: int = 0) -> tuple[str, ...]:
    """Names in the order of identifiers: body, props, left hand, right hand (§2.5.1).

    Args:
        props: Number of props, 0 to 4.
        fingers: 0, or 40 for both hands; MC is a metacarpal, PP, MP and DP are phalanges.
    """
    hands = [f"{side}{part}" for side in ("Left", "Right") for part in _FINGERS]
    return (*SEGMENTS, *(f"Prop{k + 1}" for k in range(props)), *hands[:fingers])


POSES = (Kind.QUATERNION, Kind.EULER, Kind.UNITY)
"""Kinds that hold a pose, the one that says most first."""
FARTHEST = 1e6
"""No position is as large, in any unit."""
NOT_UNIT = 0.05
"""A quaternion whose norm is further from 1 is none."""
TRUNK = (0.3, 1.2)
"""Pelvis to head along the spine, of any person [m]."""
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_SPINE = [SEGMENTS.index(name) for name in ("Pelvis", "L5", "L3", "T12", "T8", "Neck", "Head")]
_UNITY_ROWS = [SEGMENTS.index(name) for name in UNITY]
_BODY = len(SEGMENTS)
_WHOLE = np.arange(1, _BODY + 1)
"""Numbers of a body's items that are all there, in order."""
Row = list[float]


class Up(StrEnum):
    """Axis that points up in datagrams of kind 02."""

    Z = "z"
    Y = "y"


def pose(items: Items, *, up: Up = Up.Z, lengths: float) -> tuple[tuple[str, ...], Array, Array]:
    """Where the segments are.

    Args:
        items: A whole sample of one of `POSES`.
        up: Of kind 02; the others have y up always.
        lengths: Metres per unit of the stream.

    Returns:
        Names, positions [m], shape (n, 3), and orientations, w first, shape (n, 4), in a right-handed
        world with z up. The body's 23 segments are always there, first; what was not heard, or is no
        number, is NaN.

    Raises:
        ProtocolError: It holds no pose.
    """
    kind = items.header.kind
    if kind not in POSES:
        raise ProtocolError("this MVN datagram holds no pose")
    body = items.ids.shape == _WHOLE.shape and bool((items.ids == _WHOLE).all())  # as nearly always
    table = items.numbers() if body else _table(items)
    positions, turns = table[:, :3], table[:, 3:]
    if kind is Kind.EULER:
        positions, turns = _z_up(positions), _z_up_turn(_euler(turns))
    elif kind is Kind.UNITY:
        positions, turns = _placed(_right_handed(positions), _right_handed_turn(turns))
    elif up is Up.Y:
        positions, turns = _z_up(positions), _z_up_turn(turns)
    norms = np.sqrt(np.einsum("ij,ij->i", turns, turns))
    with np.errstate(invalid="ignore"):
        bad = ~(np.abs(norms - 1) <= NOT_UNIT)
        far = ~(np.abs(positions).max(axis=1) <= FARTHEST)
    turns = turns / np.where(bad, np.nan, norms)[:, None]
    said = SEGMENTS if body else _names(items)
    return said, np.where(far[:, None], np.nan, lengths * positions), turns


def unit_of(positions: Array) -> str | None:
    """``m``, ``cm`` or ``mm``: the unit in which the trunk is as long as a person's; None for none.

    Args:
        positions: Of `SEGMENTS` in that unit, shape (n, 3).
    """
    steps = np.diff(positions[_SPINE], axis=0)
    trunk = float(np.sqrt(np.einsum("ij,ij->i", steps, steps)).sum())
    return next((unit for unit, m in METRES.items() if TRUNK[0] <= m * trunk <= TRUNK[1]), None)


def looks_y_up(positions: Array) -> bool:
    """Whether somebody extends along y and not along z, from the toes to the head, (n, 3)."""
    p = positions
    toes = [SEGMENTS.index("RightToe"), SEGMENTS.index("LeftToe")]
    way = np.abs(p[SEGMENTS.index("Head")] - p[toes].mean(axis=0))
    return bool(way[1] > 2 * way[2])


def _rows(items: Items) -> NDArray[np.intp]:
    """Row of each item: the body's by their identifiers, props and fingers after them in their order."""
    ids = items.ids.astype(np.intp)
    if ids.size and (ids.min() < 1 or ids.max() > _BODY + MAX_PROPS + FINGERS + 1):
        raise ProtocolError(f"an MVN segment has the number {ids.min() if ids.min() < 1 else ids.max()}")
    beyond = ids > _BODY
    if np.count_nonzero(beyond) > MAX_PROPS + FINGERS:
        raise ProtocolError(f"an MVN sample has {np.count_nonzero(beyond)} segments beyond the body's")
    if beyond.any():
        ids[beyond] = _BODY + 1 + np.argsort(np.argsort(ids[beyond], kind="stable"), kind="stable")
    return np.asarray(ids - 1)


def _names(items: Items) -> tuple[str, ...]:
    more = max(0, int(np.count_nonzero(items.ids > _BODY)))
    props = min(items.header.props, MAX_PROPS, more)
    if not items.header.fingers:
        props = min(more, MAX_PROPS)  # versions before 2019 do not say how many
    return names(props, more - props)[: _BODY + more]


def _table(items: Items) -> Array:
    rows = _rows(items)
    table = np.full((_BODY + np.count_nonzero(rows >= _BODY), items.values.shape[1]), np.nan)
    table[rows] = items.numbers()
    return table


def _z_up(positions: Array) -> Array:
    return positions[:, [2, 0, 1]]


def _z_up_turn(wxyz: Array) -> Array:
    return wxyz[:, [0, 3, 1, 2]]


def _right_handed(positions: Array) -> Array:
    """Right, up, forward → forward, left, up."""
    return positions[:, [2, 0, 1]] * (1.0, -1.0, 1.0)


def _right_handed_turn(wxyz: Array) -> Array:
    # Seen in a mirror an axis goes with the points and the sense of the turn is the other one.
    return wxyz[:, [0, 3, 1, 2]] * (1.0, -1.0, 1.0, -1.0)


def _euler(degrees: Array) -> Array:
    known = np.where(np.abs(degrees) <= FARTHEST, degrees, np.nan)
    return wxyz_from("xyz", np.radians(known))


def _placed(offsets: Array, turns: Array) -> tuple[Array, Array]:
    """World poses in the order of `SEGMENTS`, of offsets and turns against the parents in that of `UNITY`."""
    positions, world = np.empty((len(offsets), 3)), np.empty((len(turns), 4))
    positions[_BODY:], world[_BODY:] = offsets[_BODY:], turns[_BODY:]
    known: dict[int, tuple[Row, Row]] = {}
    for k, offset, turn in zip(_UNITY_ROWS, offsets.tolist(), turns.tolist(), strict=False):
        parent = PARENTS[k]
        if parent >= 0:
            origin, about = known[parent]
            shifted = [a + b for a, b in zip(origin, _turned(about, offset), strict=True)]
            known[k] = shifted, _product(about, turn)
        else:
            known[k] = offset, turn
        positions[k], world[k] = known[k]
    return positions, world


def _product(p: Row, q: Row) -> Row:
    # Plain numbers: 23 small products a sample, for which an array each is ten times as slow.
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return [
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy + py * qw + pz * qx - px * qz,
        pw * qz + pz * qw + px * qy - py * qx,
    ]


def _turned(q: Row, v: Row) -> Row:
    return _product(_product(q, [0.0, *v]), [q[0], -q[1], -q[2], -q[3]])[1:]
