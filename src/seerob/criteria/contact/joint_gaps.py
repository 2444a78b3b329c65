r"""Gaps between two parts that touch at their joints: an elbow, fingers, an upper arm that folds on its base.

Parts that one joint moves against each other, or a few whose axes lie close together, are near wherever
these stand, so how near they are says nothing. Each place on the surface of the one is looked at by itself,
over the whole range of the joints: it has the gap :math:`g(q)` to the other part. A place clamps a body part
of the thickness D while it faces the other part, while

.. math:: \dot g < 0, \qquad g \le D

and where something of the body part gets in at all: where the joints open it as wide as the thinnest of
the body part, and by more than a fingertip. What slides in its bearing never closes (a housing that is not
quite round comes nearer by a hair, see `SLOWEST`), and what is always in touch never opens. Nothing is
remembered: the range of the joints is part of the model.

All of this depends on these joints, so it is settled once, on a grid of their positions; between its nodes
the nearest gap counts, and of each joint the largest of the mean rates along it. Of several joints that move
at once those that close count, as if no other opened, and both parts must see it close, somewhere on each:
a housing that turns past another one at a constant distance brings its own places nearer and nobody's else.
"""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from seerob.core.files.whole_file import whole_file
from seerob.core.shapes import Solid
from seerob.core.transforms import Array
from seerob.criteria.contact.clamping import STILL, Coordinate, Flags, OwnJoints
from seerob.distance.least import Query, Shapes
from seerob.kernels._kept_loops import key_of
from seerob.model.model import Mechanism, Model
from seerob.twin.spans import Span
from seerob.twin.state import State

STEPS = {1: 72, 2: 30, 3: 12}
"""By how many joints are between two parts: positions of each on the grid, of a whole turn or of a slide."""
DETAIL = 8
"""Into so many pieces the largest extent of a part is divided."""
FINEST, COARSEST = 0.01, 0.06
"""Smallest and largest piece [m]: half a fingertip, half a hand."""
SLOWEST = 0.025
"""What closes by less than the thickness of a finger in a radian or metre only slides [m/rad or m/m]."""
ASIDE = 0.05
"""Cosine of the largest angle at which a place faces another surface: whatever is not beside it."""
ROUNDING = 1e-9
"""What bounds give away against rounding."""
ROUND = 8
"""Places around a capsule."""
MOST_KNOWN = 256
"""Pairs that are remembered, since a cell is often bound several times."""
_KNOWN: dict[bytes, Array] = {}
Value = TypeVar("Value", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Places:
    """Places on the surface of a body, in its own frame."""

    points: Array
    """[m], shape (k, 3)."""
    normals: Array
    """Outward unit vectors, shape (k, 3)."""


def places(solids: Sequence[Solid]) -> Places:
    """Places all over the surface of a body, none inside another of its solids."""
    points = np.concatenate([s.points if s.mesh is None else s.mesh.vertices for s in solids])
    size = float(np.ptp(points, axis=0).max() + 2 * max(s.radius for s in solids))
    h = float(np.clip(size / DETAIL, FINEST, COARSEST))
    found = [_of_solid(solid, h) for solid in solids]
    if len(solids) > 1:
        found = [_outside(of, k, solids) for k, of in enumerate(found)]
    return Places(np.concatenate([p for p, _ in found]), np.concatenate([n for _, n in found]))


def closing(
    gaps: Array, faces: Flags, steps: Sequence[Array], thickness: Array, fits: Array, *, least: float
) -> Array:
    """How fast places close that clamp, between the nodes of a grid of k joints.

    Args:
        gaps: Of each place at each node [m], not below 0, shape (m_1, ..., m_k, p).
        faces: Whether it faces the other part there, likewise.
        steps: Of each joint, from each position to the next [rad or m], shape (m_j - 1,).
        thickness: Of body parts [m], shape (r,).
        fits: Thinnest that a body part is [m], shape (r,).
        least: By how much a gap changes that closes at all [m].

    Returns:
        Per unit of each joint, as it grows and as it falls, 0 where nothing clamps, shape (2, k,
        m_1 - 1, ..., m_k - 1, r).
    """
    joints = len(steps)
    found = np.zeros((2, joints, *(len(step) for step in steps), len(thickness)))
    if not gaps.shape[-1]:
        return found
    widest, nodes = gaps.max(axis=tuple(range(joints))), tuple(range(joints))
    varies = widest - gaps.min(axis=nodes) >= least - ROUNDING
    opens = varies[:, None] & (widest[:, None] >= fits - ROUNDING)
    faced, nearest = faces, gaps
    for axis in nodes:
        (one, other), (near, also) = _neighbours(faced, axis), _neighbours(nearest, axis)
        faced, nearest = one | other, np.minimum(near, also)
    for axis, step in enumerate(steps):
        rate = np.diff(gaps, axis=axis) / step.reshape([-1 if j == axis else 1 for j in (*nodes, joints)])
        for k, way in enumerate((-1, 1)):
            fast = np.maximum(way * rate, 0.0)
            for node in nodes:
                fast = fast if node == axis else np.maximum(*_neighbours(fast, node))
            fast = np.where(faced & (fast >= SLOWEST - ROUNDING), fast, 0.0)
            for r, thick in enumerate(thickness):
                counts = opens[:, r] & (nearest <= thick + ROUNDING)
                found[k, axis, ..., r] = np.where(counts, fast, 0.0).max(axis=-1)
    return found


def _neighbours(values: NDArray[Value], axis: int) -> tuple[NDArray[Value], NDArray[Value]]:
    """Both ends of each step along an axis."""
    m = values.shape[axis]
    return values.take(range(1, m), axis), values.take(range(m - 1), axis)


@dataclass(frozen=True, eq=False)
class _Joint:
    """Of those between a pair of bodies, and the grid of its positions."""

    mechanism: str
    column: int
    low: float
    step: float
    count: int
    """Of steps."""
    turns: bool
    """Whether it goes round without end."""

    @classmethod
    def of(cls, model: Model, joints: OwnJoints, coordinate: Coordinate, count: int) -> _Joint:
        low, high = joints.range(coordinate)
        mechanism = model.mechanisms[coordinate[0]]
        whole = mechanism.coupling[:, coordinate[1]]
        turns = (
            mechanism.joints[coordinate[1]].kind == "revolute"
            and high - low >= 2 * np.pi - 1e-9
            and bool((whole == np.round(whole)).all())
        )
        high = low + 2 * np.pi if turns else high
        return cls(*coordinate, low, max((high - low) / count, 1e-12), count, turns)

    @property
    def grid(self) -> Array:
        """Its positions [rad or m], shape (count + 1,)."""
        return np.linspace(self.low, self.low + self.count * self.step, self.count + 1)

    def seen(self, start: float, end: float) -> NDArray[np.int64]:
        """Steps from one position to another."""
        ends = sorted(int((q - self.low) // self.step) for q in (start, end))
        seen = np.arange(ends[0], min(ends[1], ends[0] + self.count) + 1)
        return seen % self.count if self.turns else np.clip(seen, 0, self.count - 1)


@dataclass(frozen=True, eq=False)
class _Table:
    """Of a pair of bodies and the joints between them."""

    joints: tuple[_Joint, ...]
    rows: tuple[int, ...]
    """Of the moving bodies of the pair."""
    rates: Array
    """How fast places close, per unit of each joint, as `closing` returns them."""

    def at(self, ways: Sequence[tuple[float, float]], qd: Sequence[tuple[float, float]]) -> Array:
        """How fast the pair clamps each body part [m/s], 0 where it does not, shape (r,).

        Args:
            ways: From where to where on each joint is looked at [rad or m].
            qd: Least and largest speed of each [rad/s or m/s].
        """
        cells = np.ix_(*(joint.seen(*way) for joint, way in zip(self.joints, ways, strict=True)))
        nodes = tuple(range(len(self.joints)))
        speed = np.zeros(self.rates.shape[-1])
        for j, (slowest, fastest) in enumerate(qd):
            senses = [sense for sense, moves in enumerate((fastest > 0, slowest < 0)) if moves]
            most = [self.rates[sense, j][cells].max(axis=nodes) for sense in senses]
            speed += np.max([np.zeros_like(speed), *most], axis=0) * max(abs(slowest), abs(fastest))
        return np.where(speed > STILL, speed, 0.0)


class JointGaps:
    """The gaps of all such pairs of a robot, bound once."""

    def __init__(
        self,
        model: Model,
        robot: Mechanism,
        pairs: Sequence[tuple[int, int, tuple[Coordinate, ...]]],
        thickness: Array,
        fits: Array,
        *,
        least: float,
    ) -> None:
        """Bind.

        Args:
            model: The compiled workstation.
            robot: The robot.
            pairs: Two of its bodies and the joints between them, at most three.
            thickness: Of body parts [m], shape (r,).
            fits: Thinnest that a body part is [m], shape (r,).
            least: See `closing`.
        """
        row = {body: k for k, body in enumerate(robot.moving)}
        joints = OwnJoints(model)
        self._tables: list[_Table] = []
        for a, b, coordinates in pairs:
            rows = tuple(row[i] for i in (a, b) if i in row)
            if not rows:
                continue
            between = tuple(_Joint.of(model, joints, c, STEPS[len(coordinates)]) for c in coordinates)
            grids = np.meshgrid(*(joint.grid for joint in between), indexing="ij")
            rotations, positions = joints.poses(
                {c: grid.reshape(-1) for c, grid in zip(coordinates, grids, strict=True)}
            )
            poses = [(rotations[:, i], positions[:, i]) for i in (a, b)]
            solids = [model.bodies[i].solids for i in (a, b)]
            steps = [np.diff(joint.grid) for joint in between]
            rates = _rates(solids, poses, steps, thickness, fits, least, model.cache)
            if rates.any():
                self._tables.append(_Table(between, rows, rates))

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
            ways, speeds = [], []
            for joint in table.joints:
                mechanism = state.model.mechanisms[joint.mechanism]
                q, qd = (float(each(mechanism)[joint.column]) for each in (state.q, state.qd))
                way, change = 0.0, 0.0
                if span is not None:
                    dof = mechanism.v_address[mechanism.own[joint.column]]
                    way, change = span.qd[dof] * span.T, span.qdd[dof] * span.T + span.joint_noise[dof]
                least, most = qd - change, qd + change
                ways.append((q - way, q + way))
                speeds.append((least, most))
            if any(least or most for least, most in speeds):
                found[rows] = np.maximum(found[rows], table.at(ways, speeds))
        return found * wanted


def _rates(
    solids: Sequence[Sequence[Solid]],
    poses: Sequence[tuple[Array, Array]],
    steps: Sequence[Array],
    thickness: Array,
    fits: Array,
    least: float,
    cache: Path | None,
) -> Array:
    """How fast two bodies close on each other, as `closing` tells it; remembered, and kept, by content."""
    cores = [_core(solid) for of in solids for solid in of]
    radii = [[s.radius for s in of] for of in solids]
    of_pair = repr((radii, [core.shape for core in cores], least)).encode()
    arrays = [*cores, *(part for pose in poses for part in pose), *steps, thickness, fits]
    key = hashlib.sha256(
        b"".join([_how(), of_pair, *(np.ascontiguousarray(array).tobytes() for array in arrays)])
    ).digest()
    if key not in _KNOWN:
        file = None if cache is None else cache / f"{key.hex()}.gaps"
        cells = tuple(len(step) for step in steps)
        shape = (2, len(steps), *cells, len(thickness))
        found = None if file is None else _read(file, shape)
        if found is None:
            nodes, sides = tuple(count + 1 for count in cells), []
            for one, other in ((0, 1), (1, 0)):
                gaps, faces = _gaps(places(solids[one]), solids[other], (poses[one], poses[other]))
                gaps, faces = gaps.reshape(*nodes, -1), faces.reshape(*nodes, -1)
                sides.append(closing(gaps, faces, steps, thickness, fits, least=least))
            found = np.maximum(*sides) if len(steps) == 1 else np.minimum(*sides)
            if file is not None:
                _write(file, found)
        if len(_KNOWN) >= MOST_KNOWN:
            _KNOWN.clear()
        _KNOWN[key] = found
    return _KNOWN[key]


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


def _gaps(on: Places, other: Sequence[Solid], poses: Sequence[tuple[Array, Array]]) -> tuple[Array, Flags]:
    """Gap [m] of each place to another body and whether it faces it, shape (m, p) each."""
    (R, x), (S, y) = poses
    count = len(on.points)
    if not count:
        return np.zeros((len(R), 0)), np.zeros((len(R), 0), bool)
    # As seen from the other body, place by place: from one position of the joint to the next little changes.
    across = np.swapaxes(S, 1, 2)
    points = np.einsum("mij,mpj->pmi", across, np.einsum("mij,pj->mpi", R, on.points) + (x - y)[:, None])
    normals = np.einsum("mij,pj->pmi", across @ R, on.normals)
    distance, nearest = _distances(other, points.reshape(-1, 3))
    distance, nearest = distance.reshape(count, -1).T, nearest.reshape(points.shape)
    towards = ((nearest - points) * normals).sum(axis=2).T
    return np.maximum(distance, 0.0), (distance > 0) & (towards > ASIDE * distance)


def _distances(solids: Sequence[Solid], points: Array) -> tuple[Array, Array]:
    """How far points are from a body, shape (k,), and where it is nearest, (k, 3) [m]."""
    shapes = Shapes.build([("body", solids), ("point", [Solid(points=np.zeros((2, 3)))])])
    positions = np.zeros((len(points), 2, 3))
    positions[:, 1] = points
    found = Query(shapes, [0], [1]).batch(np.broadcast_to(np.eye(3), (len(points), 2, 3, 3)), positions)
    return found.distance[:, 0], found.point_a[:, 0]


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
    angles = 2 * np.pi * np.arange(ROUND) / ROUND
    around = np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * np.cross(axis, side)
    along = np.linspace(0, 1, int(np.ceil(length / h)) + 1)[:, None] * (end - start) + start
    points = (along[:, None] + solid.radius * around).reshape(-1, 3)
    caps = np.array([start - solid.radius * axis, end + solid.radius * axis])
    normals = np.concatenate([np.tile(around, (len(along), 1)), [-axis, axis]])
    return np.concatenate([points, caps]), normals


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
    _, first = np.unique(key, axis=0, return_index=True)
    return points[first] + radius * normals[first], normals[first]


def _outside(found: tuple[Array, Array], k: int, solids: Sequence[Solid]) -> tuple[Array, Array]:
    """Those of the places of solid k that lie inside no other of the solids."""
    points, normals = found
    if not len(points):
        return found
    free = _distances([solid for i, solid in enumerate(solids) if i != k], points)[0] >= 0
    return points[free], normals[free]
