"""Open meshes closed, with a bound on what the missing surface can change.

Only mass properties use this: distances never see a triangle that the file does not have.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes.geometry import Mesh
from seerob.core.transforms import Array
from seerob.description.shapes.mesh_bodies import edge_balance, is_closed
from seerob.description.shapes.tidy import tidied

MAX_HOLES = 500
"""More holes than this are a heap of triangles, not a surface that something is missing from."""


class Mended(NamedTuple):
    """A closed mesh made from an open one."""

    mesh: Mesh
    steps: tuple[str, ...]
    """What was done, in words."""
    slack: float
    """Volume of the convex hulls of the loops that were spanned [m³]: how much a missing surface that
    stays within the hull of its border can add or take away."""
    filled: float
    """Area of what was added over the area of the whole, 0…1."""


def mended(mesh: Mesh) -> Mended:
    """Weld, orient and span holes until every edge is balanced."""
    steps: list[str] = []
    if not is_closed(mesh):
        welded = _welded(mesh)
        if len(welded.vertices) < len(mesh.vertices):
            steps.append(f"{len(mesh.vertices) - len(welded.vertices)} near vertices welded")
            mesh = welded
    if not is_closed(mesh):
        agreed, turned = oriented(mesh)
        if turned:
            steps.append(f"{turned} triangles turned over")
            mesh = agreed
    if is_closed(mesh):
        return Mended(mesh, tuple(steps), 0.0, 0.0)
    loops = _open_loops(mesh)
    if len(loops) > MAX_HOLES:
        return Mended(mesh, (*steps, f"{len(loops)} holes"), np.inf, 1.0)
    before = _area(mesh)
    slack = sum(_hull_volume(mesh.vertices[loop]) for loop in loops)
    mesh = _spanned(mesh, loops)
    steps.append(f"{len(loops)} holes spanned")
    return Mended(mesh, tuple(steps), slack, 1 - before / _area(mesh))


def one_sided(mesh: Mesh) -> Mesh:
    """The mesh with one of each pair of triangles that are back to back: the one written first."""
    _, first = np.unique(np.sort(mesh.faces, axis=1), axis=0, return_index=True)
    return tidied(Mesh(mesh.vertices, mesh.faces[np.sort(first)], mesh.color))[0]


def _area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _welded(mesh: Mesh) -> Mesh:
    """Vertices on open edges merged when closer than 1e-5 of the size: writers round and split."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    edges, balance, _ = edge_balance(mesh.faces)
    rim = np.unique(edges[balance != 0])
    tolerance = 1e-5 * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    pairs = cKDTree(mesh.vertices[rim]).query_pairs(tolerance, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(rim), len(rim)))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    target = np.arange(len(mesh.vertices))
    target[rim] = rim[first[label]]
    return tidied(Mesh(mesh.vertices, target[mesh.faces].astype(np.int32), mesh.color))[0]


def oriented(mesh: Mesh) -> tuple[Mesh, int]:
    """Neighbours turned to agree, spreading from the first triangle of each body."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    key = edges[:, 0] * len(mesh.vertices) + edges[:, 1]
    _, inverse, uses = np.unique(key, return_inverse=True, return_counts=True)
    upward = (mesh.faces < mesh.faces[:, [1, 2, 0]]).ravel()
    order = np.argsort(inverse.ravel(), kind="stable")
    plain = uses[inverse.ravel()[order]] == 2
    pairs = order[plain].reshape(-1, 2)
    disagree = upward[pairs[:, 0]] == upward[pairs[:, 1]]
    pairs //= 3
    # Most triangles agree already: what agrees is turned together. Regions are numbered by first triangle.
    a, b = pairs[~disagree].T
    graph = coo_matrix((np.ones(len(a), bool), (a, b)), shape=(len(mesh.faces), len(mesh.faces)))
    regions, region = connected_components(graph, directed=False)
    turned = _turned(regions, np.bincount(region), region[pairs[disagree]])[region]
    faces = np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces)
    return Mesh(mesh.vertices, faces, mesh.color), int(turned.sum())


def _turned(regions: int, sizes: NDArray[np.int64], against: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Which regions are turned, so that those of each pair that are against each other agree."""
    neighbours: list[list[int]] = [[] for _ in range(regions)]
    for a, b in against.tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    flip: NDArray[np.int64] = np.full(regions, -1)
    for seed in range(regions):
        if flip[seed] >= 0:
            continue
        flip[seed] = 0
        body, queue = [seed], deque([seed])
        while queue:
            here = queue.popleft()
            for other in neighbours[here]:
                if flip[other] < 0:
                    flip[other] = 1 - flip[here]
                    body.append(other)
                    queue.append(other)
        # The seed may have been the odd one out: turn as few as possible.
        if 2 * int(sizes[body] @ flip[body]) > int(sizes[body].sum()):
            flip[body] = 1 - flip[body]
    return np.asarray(flip == 1)


def _open_loops(mesh: Mesh) -> list[NDArray[np.int64]]:
    """Closed walks along the edges that lack a neighbour, in the sense that a patch would need."""
    edges, balance, _ = edge_balance(mesh.faces)
    onward: dict[int, list[int]] = {}
    for (low, high), b in zip(edges.tolist(), balance.tolist(), strict=True):
        start, end = (high, low) if b > 0 else (low, high)
        onward.setdefault(start, []).extend([end] * abs(b))
    loops = []
    # At every vertex as many open edges arrive as leave (each face brings one of both), so that a
    # walk only ends where it began.
    for start in list(onward):
        while onward[start]:
            loop = [start]
            seen = {start: 0}
            while True:
                following = onward[loop[-1]].pop()
                if following in seen:
                    cut = seen[following]
                    loops.append(np.array(loop[cut:]))
                    for vertex in loop[cut + 1 :]:
                        del seen[vertex]
                    del loop[cut + 1 :]
                    if cut == 0 and not onward[start]:
                        break
                    if not onward[loop[-1]]:
                        break
                else:
                    seen[following] = len(loop)
                    loop.append(following)
    return loops


def _spanned(mesh: Mesh, loops: list[NDArray[np.int64]]) -> Mesh:
    """A fan from each loop's centre; over a flat loop its moments are exact, convex or not."""
    vertices, faces = [mesh.vertices], [mesh.faces.astype(np.int64)]
    for number, loop in enumerate(loops):
        tip = np.full(len(loop), len(mesh.vertices) + number)
        vertices.append(mesh.vertices[loop].mean(axis=0)[None])
        faces.append(np.column_stack([loop, np.roll(loop, -1), tip]))
    return Mesh(np.vstack(vertices), np.vstack(faces).astype(np.int32), mesh.color)


def _hull_volume(points: Array) -> float:
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(points).volume)
    except QhullError:
        return 0.0
