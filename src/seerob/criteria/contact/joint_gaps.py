r"""Gaps between two parts that one joint moves against each other: an elbow, fingers, a bearing.

Such parts are near wherever the joint stands, so how near they are says nothing. Each place on the surface of
the one is looked at by itself, over the whole range of the joint: it has the gap :math:`g(q)` to the other
part. A place clamps a body part of the thickness D while it faces the other part, while

.. math:: \dot g < 0, \qquad g \le D

and where something of the body part gets in at all: where the joint opens it as wide as the thinnest of
the body part, and by more than a fingertip. What slides in its bearing never closes (a housing that is not
quite round comes nearer by a hair, see `SLOWEST`), and what is always in touch never opens. That the places
of one part see it close is enough: an overhang that passes at a constant width comes over what lies there,
and shears it. Nothing is remembered: the range of the joint is part of the model.

All of this depends on the joint, so it is settled once, on a grid of its positions. Between two of them, of
which a place is s apart, its gap counts as no wider than :math:`(g_0 + g_1 - s)/2` and closes with the
largest of the rates there. A surface is looked at in pieces half as large as the thinnest of the body part,
those of a hand half a finger, wherever that can change anything: from place to place a gap changes by no
more than the way, so what is wide or buried as a whole, or could only repeat what is known of the same
positions, is settled by one place on it.
"""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seerob.core.files.whole_file import whole_file
from seerob.core.shapes import Solid
from seerob.core.transforms import Array
from seerob.criteria.contact.clamping import STILL, Coordinate, Flags, RelativeJoints, distances_from
from seerob.kernels._kept_loops import key_of
from seerob.model.model import Mechanism, Model
from seerob.twin.spans import Span
from seerob.twin.state import State

STEPS = 72
"""Positions of a joint that are looked at, of a whole turn or of a slide."""
PIECE = 0.0125
"""Into which a surface is divided [m]: half a finger."""
AT_ONCE = 2048
"""Places that are looked at together: a door of 2 m² has 30 000, at 73 positions each."""
MOST_PIECES = 200
"""Into so many the largest extent of a part is divided at most: what is larger is known less finely."""
SLOWEST = 0.025
"""What closes by less than the thickness of a finger in a radian or metre only slides [m/rad or m/m], and so
does less in a gap that is narrower and would not be shut by then, down to a fingertip."""
RIPPLE = 2e-4
"""A joint that is slower keeps its place [rad/s or m/s]: so fast the servo of the physics goes to and fro
where other joints drag it along; a gap at a lever of 1 m closes by less than 1 mm in 5 s."""
ASIDE = 0.05
"""Cosine of the largest angle at which a place faces another surface: whatever is not beside it."""
ROUNDING = 1e-9
"""What bounds give away against rounding."""
ROUND = 8
"""Places around a capsule, at least."""
MOST_KNOWN = 1024
"""Pairs that are remembered, those that were asked last, since a cell is often bound several times."""
_KNOWN: dict[bytes, Array] = {}


@dataclass(frozen=True, eq=False)
class Places:
    """Places on the surface of a body, in its own frame."""

    points: Array
    """[m], shape (k, 3)."""
    normals: Array
    """Outward unit vectors, shape (k, 3)."""
    about: float
    """How far around each it speaks of the surface [m]."""


def places(solids: Sequence[Solid]) -> Places:
    """Places all over the surface of a body, none inside another of its solids."""
    points = np.concatenate([s.points if s.mesh is None else s.mesh.vertices for s in solids])
    size = float(np.ptp(points, axis=0).max() + 2 * max(s.radius for s in solids))
    h = max(PIECE, size / MOST_PIECES)
    found = [_of_solid(solid, h) for solid in solids]
    if len(solids) > 1:
        found = [_outside(of, k, solids) for k, of in enumerate(found)]
    return Places(np.concatenate([p for p, _ in found]), np.concatenate([n for _, n in found]), h / 2)


def closing(looks: Looks, about: Array, step: Array, thickness: Array, fits: Array, *, least: float) -> Array:
    """How fast places close that clamp, between positions of the joint.

    Args:
        looks: The places.
        about: How far around each it speaks of the surface for each body part [m], shape (p, r).
        step: From each position to the next [rad or m], shape (m,).
        thickness: Of body parts [m], shape (r,).
        fits: Thinnest that a body part is [m], shape (r,).
        least: By how much a gap changes that closes at all [m].

    Returns:
        Per unit of the joint, as it grows and as it falls, 0 where nothing clamps, shape (2, m, r).
    """
    gaps = looks.gaps
    found = np.zeros((2, len(step), len(thickness)))
    if not gaps.shape[1]:
        return found
    widest, narrowest = gaps.max(axis=0), gaps.min(axis=0)
    opens = (widest - narrowest >= least - ROUNDING)[:, None] & (widest[:, None] + about >= fits - ROUNDING)
    slowest = np.clip(np.minimum(gaps[1:], gaps[:-1]), least, SLOWEST)
    mean = np.diff(gaps, axis=0) / step[:, None]
    for k, way in enumerate((1, -1)):
        fast = np.maximum(np.maximum(way * looks.falls[1:], way * looks.falls[:-1]), -way * mean)
        closes = (looks.faces[1:] | looks.faces[:-1]) & (fast >= slowest - ROUNDING)
        fast = np.where(closes, fast, 0.0)
        for r, thick in enumerate(thickness):
            counts = opens[:, r] & (looks.near - about[:, r] <= thick + ROUNDING)
            found[k, :, r] = np.where(counts, fast, 0.0).max(axis=1)
    return found


@dataclass(frozen=True, eq=False)
class Looks:
    """Some places on a part as another one sees them, at m + 1 positions of the joint between."""

    gaps: Array
    """To the other part [m], not below 0, shape (m + 1, p)."""
    faces: Flags
    """Whether it faces the other part, likewise."""
    falls: Array
    """How fast that gap falls while the joint grows [m/rad or m/m], likewise."""
    near: Array
    """Bound on the gap from one position to the next [m], shape (m, p)."""


def _looks(on: Places, other: Sequence[Solid], poses: Sequence[tuple[Array, Array]], step: Array) -> Looks:
    """The places on one body of a pair, as the other sees them at positions of the joint, `step` apart."""
    (R, x), (S, y) = poses
    # As seen from the other body, place by place: from one position to the next little changes.
    across = np.swapaxes(S, 1, 2)
    turn, shift = across @ R, np.einsum("mij,mj->mi", across, x - y)
    points = np.einsum("mij,pj->pmi", turn, on.points) + shift
    normals = np.einsum("mij,pj->pmi", turn, on.normals)
    distance, nearest = (
        part.reshape(*points.shape[:2], -1) for part in distances_from(other)(points.reshape(-1, 3))
    )
    distance, way = distance[..., 0], nearest - points
    faces = (distance > 0) & ((way * normals).sum(axis=-1) > ASIDE * distance)
    moved = np.gradient(points, np.concatenate([[0.0], np.cumsum(step)]), axis=1)
    falls = np.where(distance > 0, (moved * way).sum(axis=-1) / np.maximum(distance, ROUNDING), 0.0)
    half = np.minimum(step / 2, np.pi / 2)
    arcs = np.linalg.norm(np.diff(points, axis=1), axis=-1) * half / np.sin(half)
    gaps = np.maximum(distance, 0.0)
    return Looks(gaps.T, faces.T, falls.T, ((gaps[:, 1:] + gaps[:, :-1] - arcs) / 2).T)


@dataclass(frozen=True, eq=False)
class _Joint:
    """Between a pair of bodies, and the grid of its positions."""

    mechanism: str
    column: int
    low: float
    step: float
    turns: bool
    """Whether it goes round without end."""

    @classmethod
    def of(cls, model: Model, joints: RelativeJoints, coordinate: Coordinate) -> _Joint:
        low, high = joints.range(coordinate)
        mechanism = model.mechanisms[coordinate[0]]
        whole = mechanism.coupling[:, coordinate[1]]
        turns = (
            mechanism.joints[coordinate[1]].kind == "revolute"
            and high - low >= 2 * np.pi - 1e-9
            and bool((whole == np.round(whole)).all())
        )
        high = low + 2 * np.pi if turns else high
        return cls(*coordinate, low, max((high - low) / STEPS, 1e-12), turns)

    @property
    def grid(self) -> Array:
        """Its positions [rad or m], shape (STEPS + 1,)."""
        return np.linspace(self.low, self.low + STEPS * self.step, STEPS + 1)

    def seen(self, start: float, end: float) -> NDArray[np.int64]:
        """Steps from one position to another."""
        first, last = np.sort((np.array([start, end]) - self.low) // self.step)
        if not self.turns:
            first, last = np.clip([first, last], 0, STEPS - 1)
        return np.arange(int(first), int(min(last, first + STEPS)) + 1) % STEPS


@dataclass(frozen=True, eq=False)
class _Table:
    """Of a pair of bodies and the joint between them."""

    joint: _Joint
    rows: tuple[int, ...]
    """Of the moving bodies of the pair."""
    rates: Array
    """How fast places close, per unit of the joint, as `closing` returns them."""

    def at(self, way: tuple[float, float], qd: tuple[float, float]) -> Array:
        """How fast the pair clamps each body part [m/s], 0 where it does not, shape (r,).

        Args:
            way: From where to where is looked at [rad or m].
            qd: Least and largest speed [rad/s or m/s].
        """
        cells, (slowest, fastest) = self.joint.seen(*way), qd
        speed = np.zeros(self.rates.shape[-1])
        for sense, most in enumerate((fastest, -slowest)):
            if most > RIPPLE:
                speed = np.maximum(speed, self.rates[sense, cells].max(axis=0) * most)
        return np.where(speed > STILL, speed, 0.0)


class JointGaps:
    """The gaps of all such pairs of a robot, bound once."""

    def __init__(
        self,
        model: Model,
        robot: Mechanism,
        pairs: Sequence[tuple[int, int, Coordinate]],
        thickness: Array,
        fits: Array,
        *,
        least: float,
    ) -> None:
        """Bind.

        Args:
            model: The compiled workstation.
            robot: The robot.
            pairs: Two of its bodies and the joint between them.
            thickness: Of body parts [m], shape (r,).
            fits: Thinnest that a body part is [m], shape (r,).
            least: See `closing`.
        """
        row = {body: k for k, body in enumerate(robot.moving)}
        joints = RelativeJoints(model)
        self._tables: list[_Table] = []
        for a, b, coordinate in pairs:
            rows = tuple(row[i] for i in (a, b) if i in row)
            if not rows:
                continue
            joint = _Joint.of(model, joints, coordinate)
            rotations, positions = joints.poses({coordinate: joint.grid})
            poses = [(rotations[:, i], positions[:, i]) for i in (a, b)]
            solids = [model.bodies[i].solids for i in (a, b)]
            rates = _rates(solids, poses, np.diff(joint.grid), thickness, fits, least, model.cache)
            if rates.any():
                self._tables.append(_Table(joint, rows, rates))

    def speeds(self, state: State, wanted: Flags, span: Span | None = None) -> Array:
        """At which speed moving bodies clamp body parts now [m/s], 0 where they do not, shape (b, r).

        Args:
            state: The twin.
            wanted: Of which bodies, that move now, and which body parts that matters, shape (b, r).
            span: At any instant of that instead, of which the twin is at one end.
        """
        found = np.zeros(wanted.shape)
        for table in self._tables:
            rows = list(table.rows)
            if not wanted[rows].any():
                continue
            mechanism, column = state.model.mechanisms[table.joint.mechanism], table.joint.column
            q, qd = (float(each(mechanism)[column]) for each in (state.q, state.qd))
            way, change = 0.0, 0.0
            if span is not None:
                dof = mechanism.v_address[mechanism.own[column]]
                way, change = span.qd[dof] * span.T, span.qdd[dof] * span.T + span.joint_noise[dof]
            if qd or change:
                found[rows] = np.maximum(
                    found[rows], table.at((q - way, q + way), (qd - change, qd + change))
                )
        return found * wanted


def _rates(
    solids: Sequence[Sequence[Solid]],
    poses: Sequence[tuple[Array, Array]],
    step: Array,
    thickness: Array,
    fits: Array,
    least: float,
    cache: Path | None,
) -> Array:
    """How fast two bodies close on each other, as `closing` tells it; remembered, and kept, by content."""
    cores = [_core(solid) for of in solids for solid in of]
    radii = [[s.radius for s in of] for of in solids]
    of_pair = repr((radii, [core.shape for core in cores], least)).encode()
    arrays = [*cores, *(part for pose in poses for part in pose), step, thickness, fits]
    key = hashlib.sha256(
        b"".join([_how(), of_pair, *(np.ascontiguousarray(array).tobytes() for array in arrays)])
    ).digest()
    found = _KNOWN.pop(key, None)
    if found is None:
        file = None if cache is None else cache / f"{key.hex()}.gaps"
        shape = (2, len(step), len(thickness))
        found = None if file is None else _read(file, shape)
        if found is None:
            found = np.zeros(shape)
            for i, j in ((0, 1), (1, 0)):
                on, both = places(solids[i]), (poses[i], poses[j])
                for first in range(0, len(on.points), AT_ONCE):
                    some = slice(first, first + AT_ONCE)
                    looks = _looks(Places(on.points[some], on.normals[some], on.about), solids[j], both, step)
                    around = np.full((looks.gaps.shape[1], len(fits)), on.about)
                    np.maximum(found, closing(looks, around, step, thickness, fits, least=least), out=found)
            if file is not None:
                _write(file, found)
        if len(_KNOWN) >= MOST_KNOWN:
            _KNOWN.pop(next(iter(_KNOWN)), None)
    _KNOWN[key] = found
    return found


@functools.cache
def _how() -> bytes:
    """What makes rates of content: this file, and what measures distances."""
    return Path(__file__).read_bytes() + key_of("nearest").encode()


def _read(file: Path, shape: tuple[int, ...]) -> Array | None:
    """The rates in a file; None when there is none or it is not what was written."""
    try:
        kept = file.read_bytes()
    except OSError:
        return None
    check, rates = kept[:32], kept[32:]
    if hashlib.sha256(rates).digest() != check or len(rates) != 8 * math.prod(shape):
        return None
    return np.frombuffer(rates).reshape(shape)


def _write(file: Path, rates: Array) -> None:
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(file) as hidden:
            hidden.write_bytes(hashlib.sha256(rates.tobytes()).digest() + rates.tobytes())


def _core(solid: Solid) -> Array:
    if solid.mesh is not None:
        return np.asarray(solid.mesh.vertices[solid.mesh.faces])
    assert solid.points is not None
    return solid.points


def _of_solid(solid: Solid, h: float) -> tuple[Array, Array]:
    """Places on a solid and their normals."""
    if solid.mesh is not None:
        return _on_triangles(solid.mesh.vertices[solid.mesh.faces], h, solid.radius)
    assert solid.points is not None
    if len(solid.points) == 3:
        a, b, c = solid.points
        both = np.array([[a, b, c], [b, b + c - a, c], [a, c, b], [b, c, b + c - a]])
        return _on_triangles(both, h, solid.radius)
    start, end = solid.points
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length if length > 0 else np.array([0.0, 0, 1])
    side = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    side /= np.linalg.norm(side)
    around = _circle(axis, side, max(ROUND, math.ceil(2 * np.pi * solid.radius / h)))
    along = np.linspace(0, 1, int(np.ceil(length / h)) + 1)[:, None] * (end - start) + start
    caps = [_cap(way, side, solid.radius / h) for way in (-axis, axis)]
    normals = np.concatenate([np.tile(around, (len(along), 1)), *caps])
    inside = np.concatenate([np.repeat(along, len(around), axis=0), *(
        np.tile(at, (len(cap), 1)) for at, cap in zip((start, end), caps, strict=True)
    )])  # fmt: skip
    return inside + solid.radius * normals, normals


def _circle(axis: Array, side: Array, count: int) -> Array:
    """So many directions around an axis, of which ``side`` is one, shape (count, 3)."""
    angles = (2 * np.pi * np.arange(count) / count)[:, None]
    return np.asarray(np.cos(angles) * side + np.sin(angles) * np.cross(axis, side))


def _cap(axis: Array, side: Array, radius: float) -> Array:
    """Directions all over a hemisphere, its rim left out, shape (k, 3); its radius in pieces."""
    rings = math.ceil(np.pi / 2 * radius)
    found = [axis[None]]
    for up in (np.pi / 2 * np.arange(1, rings) / rings).tolist():
        ring = _circle(axis, side, math.ceil(2 * np.pi * radius * math.cos(up)))
        found.append(math.cos(up) * ring + math.sin(up) * axis)
    return np.concatenate(found)


def _on_triangles(triangles: Array, h: float, radius: float) -> tuple[Array, Array]:
    """One place for every piece of about the size h of a surface that looks one way."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(normals, axis=1)
    triangles, normals = triangles[area > 0], normals[area > 0] / area[area > 0, None]
    done, of = [], []
    while len(triangles):
        edges = np.linalg.norm(triangles[:, [1, 2, 0]] - triangles, axis=2)
        long = edges.max(axis=1) > h
        done.append(triangles[~long].mean(axis=1))
        of.append(normals[~long])
        k, triangles, normals = edges[long].argmax(axis=1), triangles[long], normals[long]
        i = np.arange(len(triangles))
        a, b, c = (triangles[i, (k + s) % 3] for s in range(3))
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
        normals = np.concatenate([normals, normals])
    points, normals = np.concatenate(done or [np.zeros((0, 3))]), np.concatenate(of or [np.zeros((0, 3))])
    key = np.column_stack([np.floor(points / h), np.round(normals)])
    # The first of each kind, as NumPy's unique tells it in three times as long.
    order = np.lexsort(key.T[::-1])
    new = np.ones(len(order), bool)
    new[1:] = (key[order[1:]] != key[order[:-1]]).any(axis=1)
    first = order[new]
    return points[first] + radius * normals[first], normals[first]


def _outside(found: tuple[Array, Array], k: int, solids: Sequence[Solid]) -> tuple[Array, Array]:
    """Those of the places of solid k that lie inside no other of the solids."""
    points, normals = found
    if not len(points):
        return found
    free = distances_from([solid for i, solid in enumerate(solids) if i != k])(points)[0] >= 0
    return points[free], normals[free]
