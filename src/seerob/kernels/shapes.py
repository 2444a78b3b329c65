"""The solids of a model as the distance kernel wants them: trees, cores and boxes, built once."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from operator import add
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.shapes import Solid
from seerob.core.transforms import Array
from seerob.kernels.lanes import WIDTH
from seerob.kernels.pairs import COLUMNS, Solids
from seerob.kernels.tree_file import Tree, tree_of
from seerob.kernels.wide import NONE

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Shapes:
    """The solids of all bodies of a model with their trees; immutable, shared by queries and threads."""

    names: tuple[str, ...]
    """Names of the bodies, in the order of all pose arrays."""
    solids: tuple[tuple[int, ...], ...]
    """Columns of the arrays below that each body carries."""
    which: Indices
    """One row per solid: its body, its kind and where its data lie in the arrays below;
    `seerob.kernels.pairs` lists the columns."""
    local: Array
    ball: Array
    corners: Array
    radius: Array
    nodes: Array
    links: NDArray[np.int32]
    triangles: Array
    boxes: NDArray[np.float32]
    kids: NDArray[np.int32]
    """Of all meshes, in numbers of all; see `seerob.kernels.wide`."""
    probes: Array
    lids: tuple[tuple[int, ...], ...]
    """Columns of what may close openings of each body (`Solid.lids`), which no question is about."""

    @classmethod
    def build(cls, bodies: Sequence[tuple[str, Sequence[Solid]]], *, cache: Path | None = None) -> Shapes:
        """Shapes of bodies.

        Args:
            bodies: Name and solids (in the body's frame [m]) of each body; a body may have none.
            cache: Folder in which trees of meshes are kept between starts, by content.

        Raises:
            InputError: A mesh without triangles or with indices out of range, or a coordinate that
                is not finite; names every such solid.
        """
        _check(bodies)
        made: list[_Made] = []
        # Instances share a mesh, which lives as long as their solids, and the rows of its arrays.
        known: dict[int, tuple[_Made, list[int], int]] = {}
        stored: list[_Made] = []
        owned: list[tuple[int, ...]] = []
        lids: list[tuple[int, ...]] = []
        radii: list[float] = []
        which: list[list[int]] = []
        ends = np.zeros(3, int)
        wide = 0
        for body, (_, solids) in enumerate(bodies):
            closings = [lid for solid in solids for lid in solid.closings]
            columns = tuple(range(len(made), len(made) + len(solids) + len(closings)))
            owned.append(columns[: len(solids)])
            lids.append(columns[len(solids) :])
            for solid in (*solids, *closings):
                radii.append(solid.radius)
                found = None if solid.mesh is None else known.get(id(solid.mesh))
                if found is None:
                    core = _made(solid, cache)
                    tree = core.tree
                    size = np.array([0, 0, len(core.probes)])
                    if tree is not None:
                        size[:2] = len(tree.nodes), len(tree.triangles)
                    found = core, np.column_stack([ends, ends + size]).ravel().tolist(), wide
                    ends += size
                    wide += 0 if tree is None else len(tree.boxes)
                    stored.append(core)
                    if solid.mesh is not None:
                        known[id(solid.mesh)] = found
                core, spans, first = found
                flags = [core.tree is not None, core.volume, core.closed]
                which.append([body, *map(int, flags), *spans, core.corner_count, first])
                made.append(core)
        trees = [m.tree for m in stored if m.tree is not None]
        shapes = cls(
            names=tuple(name for name, _ in bodies),
            solids=tuple(owned),
            which=np.array(which, np.int64).reshape(-1, COLUMNS),
            local=_rows([m.local for m in made], (12,)),
            ball=_rows([m.ball for m in made], (4,)),
            corners=_rows([m.corners for m in made], (8, 3)),
            radius=np.array(radii, float),
            nodes=np.concatenate([np.zeros((0, 20)), *(t.nodes for t in trees)]),
            links=np.concatenate([np.zeros((0, 2), np.int32), *(t.links for t in trees)]),
            triangles=np.concatenate([np.zeros((0, 13)), *(t.triangles for t in trees)]),
            boxes=np.concatenate([np.zeros((0, 120), np.float32), *(t.boxes for t in trees)]),
            kids=_joined(trees),
            probes=np.concatenate([np.zeros((0, 3)), *(m.probes for m in stored)]),
            lids=tuple(lids),
        )
        return shapes

    def closed(self) -> Shapes:
        """Return these arrays with what may close openings as solids of its body, after the others."""
        every = tuple(map(add, self.solids, self.lids))
        return replace(self, solids=every, lids=((),) * len(every))

    def copied(self) -> Shapes:
        """Shapes in arrays of their own."""
        return deepcopy(self)

    def arrays(self) -> Solids:
        """The arrays as kernels take them."""
        return Solids(
            self.which, self.local, self.ball, self.corners, self.radius, self.nodes, self.links,
            self.triangles, self.boxes, self.kids, self.probes,
        )  # fmt: skip

    def index(self, name: str) -> int:
        """Index of a body.

        Raises:
            UnknownName: No such body.
        """
        try:
            return self.names.index(name)
        except ValueError:
            raise UnknownName("body", name, self.names) from None


@dataclass(frozen=True, eq=False)
class _Made:
    """A solid as the kernel wants it."""

    tree: Tree | None
    probes: Array
    volume: bool
    closed: bool
    local: Array
    ball: Array
    corners: Array
    corner_count: int


_KNOWN: WeakKeyDictionary[Solid, _Made] = WeakKeyDictionary()
"""Of solids that live; nobody changes one, and cells share those of the library."""


def _made(solid: Solid, cache: Path | None) -> _Made:
    """A solid as the kernel wants it, made once."""
    found = _KNOWN.get(solid)
    if found is None:
        found = _KNOWN[solid] = _make(solid, cache)
    return found


def _make(solid: Solid, cache: Path | None) -> _Made:
    local = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
    corners = np.zeros((8, 3))
    if solid.points is not None and len(solid.points) == 2:
        ends = solid.points.astype(float)
        corners[:2] = ends
        ball = np.append(ends.mean(0), np.linalg.norm(ends[1] - ends[0]) / 2)
        return _Made(None, ends[:1], False, True, local, ball, corners, 2)
    if solid.mesh is not None:
        vertices = np.ascontiguousarray(solid.mesh.vertices, float)
        tree = tree_of(vertices, np.ascontiguousarray(solid.mesh.faces, np.int32), cache=cache)
    else:
        assert solid.points is not None
        local, vertices = _flat_frame(solid.points)
        tree = tree_of(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    centre, half = tree.nodes[0, :3], tree.nodes[0, 3:6]
    corners[:] = centre + half * (np.indices((2, 2, 2)).reshape(3, 8).T * 2 - 1)
    ball = np.append(centre, np.linalg.norm(vertices - centre, axis=1).max())
    volume = solid.mesh is not None
    return _Made(tree, tree.probes, volume, tree.closed or not volume, local, ball, corners, 8)


def _flat_frame(points: Array) -> tuple[Array, Array]:
    """Frame along a rectangle's edges, as body_from_solid (12,), and its four corners there (4, 3)."""
    corner, u, v = points[0], points[1] - points[0], points[2] - points[0]
    longest, other = (u, v) if u @ u >= v @ v else (v, u)
    basis = np.eye(3)
    if longest @ longest > 0:
        x = longest / np.linalg.norm(longest)
        beside = other - (other @ x) * x
        if not beside @ beside > 0:
            beside = np.eye(3)[np.abs(x).argmin()]
            beside = beside - (beside @ x) * x
        y = beside / np.linalg.norm(beside)
        basis = np.column_stack([x, y, np.cross(x, y)])
    four = np.array([np.zeros(3), u, u + v, v]) @ basis
    return np.concatenate([basis.ravel(), corner]), four


def _joined(trees: list[Tree]) -> NDArray[np.int32]:
    """Children of the nodes of all trees, in numbers of all nodes and triangles."""
    parts = [np.zeros((0, WIDTH), np.int32)]
    nodes = triangles = 0
    for tree in trees:
        shift = np.where(tree.kids < 0, -triangles, np.where(tree.kids == NONE, 0, nodes))
        parts.append((tree.kids + shift).astype(np.int32))
        nodes += len(tree.boxes)
        triangles += len(tree.triangles)
    return np.concatenate(parts)


def _rows(parts: list[Array], shape: tuple[int, ...]) -> Array:
    return np.array(parts, float).reshape(-1, *shape)


def _check(bodies: Sequence[tuple[str, Sequence[Solid]]]) -> None:
    problems = []
    for name, solids in bodies:
        for k, solid in enumerate(solids):
            key = solid.name or f"shape {k}"
            points = solid.points if solid.mesh is None else solid.mesh.vertices
            if points is not None and not np.isfinite(points).all():
                row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
                what = f"point {row} is {points[row].tolist()}"
                problems.append(Problem(name, key, what, "coordinates must be finite numbers"))
            if solid.mesh is None:
                continue
            faces = solid.mesh.faces
            if len(faces) == 0:
                problems.append(Problem(name, key, "the mesh has no triangles", "give at least one"))
            elif int(faces.min()) < 0 or int(faces.max()) >= len(solid.mesh.vertices):
                what = f"a triangle names vertex {int(faces.max())} of {len(solid.mesh.vertices)}"
                problems.append(Problem(name, key, what, "export the mesh again"))
    if problems:
        raise InputError(problems)
