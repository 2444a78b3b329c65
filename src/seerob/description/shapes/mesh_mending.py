"""Open meshes closed, with a bound on what a missing surface can change that lies near the rims of its holes.

Mass properties use what is mended, and distances where an opening is, or may be, closed in reality
(`seerob.description.shapes.openings`).

Which side of a surface is out, where a file contradicts itself: no triangle is added, moved or left out.

What is inside of a mesh goes by the winding number. Triangles that disagree with their neighbours, a body
inside out that overlaps others, and a surface that is there twice, once for each side, all make it 0 where
there is an inside, and whoever is in there would be far from the surface and outside.

Surfaces that a file splits into open pieces, by colour or by name, and that enclose a volume together.

None of the pieces has an inside, and whoever is in there would be far from all of them and outside.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes import Mesh, Solid
from seerob.core.transforms import Array
from seerob.description.shapes.detail import physics_mesh
from seerob.description.shapes.hull import hull_volume
from seerob.description.shapes.mesh_bodies import (
    bodies,
    components,
    edge_balance,
    is_closed,
    joined,
    joined_unmerged,
    outward,
    tidied,
)
from seerob.description.shapes.moments import signed_volume

MOST_BODIES = 300
"""Of one mesh, whose sides are compared: the time grows with the square."""


def sided(mesh: Mesh) -> tuple[Mesh, str]:
    """Turn the triangles of a surface so that closed bodies have an inside.

    Args:
        mesh: Tidied.

    Returns:
        The mesh, and what was turned in words; the same mesh and nothing where nothing is.
    """
    said = []
    # Of a closed surface that is there twice four triangles or more meet at every edge.
    if (edge_balance(mesh.faces)[2] >= 4).all():
        single = one_sided(mesh)
        agreed = oriented(single)[0]
        if 2 * len(single.faces) == len(mesh.faces) and is_closed(agreed):
            mesh = agreed
            said.append("every triangle is there twice, once for each side: taken once")
    unbalanced = _contradictions(mesh)
    if unbalanced:
        agreed, turned = oriented(mesh)
        if _contradictions(agreed) < unbalanced:
            mesh = agreed
            said.append(f"{turned} triangles turned over, so that neighbours agree which side is out")
    if is_closed(mesh):
        parts = bodies(mesh)
        inward = [signed_volume(part) < 0 for part in parts]
        mixed = any(inward) and not all(inward)
        if mixed and len(parts) > MOST_BODIES:
            said.append(
                f"{sum(inward)} of {len(parts)} bodies are inside out: too many to tell cavities from"
            )
        elif mixed:
            turned_parts, count = outward(parts)
            if count:
                mesh = joined_unmerged(turned_parts)
                said.append(f"{count} of {len(parts)} bodies were inside out: turned")
    return mesh, ", ".join(said)


def _contradictions(mesh: Mesh) -> int:
    """Edges between two triangles that take different sides for out."""
    _, balance, uses = edge_balance(mesh.faces)
    return int(np.count_nonzero((uses == 2) & (balance != 0)))


SEAM = 1e-6
"""How far apart corners of two pieces may be that are the same one, rounded differently [m]."""


def enclosing(meshes: Sequence[Mesh]) -> Mesh | None:
    """All of them as one closed mesh, corners on its seams moved by no more than rounding.

    Returns:
        None where they leave a hole.
    """
    whole = joined(meshes)[0]
    for _ in range(2):
        around = sided(whole)[0]
        if is_closed(around):
            return around
        whole = _sewn(whole)
    return None


def with_insides(solids: Sequence[Solid]) -> tuple[Solid, ...]:
    """The solids of one body, those that are open and close together as one."""
    split = [s for s in solids if s.mesh is not None and s.radius == 0 and not is_closed(s.mesh)]
    around = enclosing([s.mesh for s in split if s.mesh is not None]) if len(split) > 1 else None
    if around is None:
        return tuple(solids)
    rest = [s for s in solids if all(s is not piece for piece in split)]
    notes = dict.fromkeys(piece.note for piece in split if piece.note)
    deviation = max(piece.deviation for piece in split)
    whole = Solid(mesh=physics_mesh(around), name=split[0].name, note=", ".join(notes), deviation=deviation)
    return *rest, whole


def _sewn(mesh: Mesh) -> Mesh:
    """Corners on open edges that are within `SEAM` of each other merged."""
    edges, _, uses = edge_balance(mesh.faces)
    seam = np.unique(edges[uses == 1])
    if len(seam) < 2:
        return mesh
    corners = mesh.vertices[seam]
    _, label = components(len(seam), near_pairs(corners, SEAM))
    _, first = np.unique(label, return_index=True)
    vertices = mesh.vertices.copy()
    vertices[seam] = corners[first[label]]
    return tidied(Mesh(vertices, mesh.faces, mesh.color))[0]


MAX_HOLES = 500
"""More holes than this are a heap of triangles, not a surface that something is missing from."""


class Mended(NamedTuple):
    """A closed mesh made from an open one."""

    mesh: Mesh
    steps: tuple[str, ...]
    """What was done, in words."""
    slack: float
    """Volume of the convex hulls of the loops that were spanned, as much larger as was asked [m³]: how much a
    missing surface that stays within them can add or take away. Both it and what spans the hole close the
    rest, so that what lies between them is in the hull, whatever the rest is."""
    filled: float
    """Area of what was added over the area of the whole, 0…1."""
    within: Array
    """Corners of what contains those hulls [m], shape (n, 3)."""
    moved: float
    """How far corners were moved to weld them, at most [m]."""
    rims: tuple[Array, ...] = ()
    """Corners of each hole that was spanned [m], shape (n, 3)."""


def mended(mesh: Mesh, depth: float) -> Mended:
    """Weld, orient and span holes until every edge is balanced.

    Args:
        mesh: With holes.
        depth: How far the missing surface may lie beyond the convex hull of each hole's rim [m].
    """
    steps: list[str] = []
    nowhere, moved = np.zeros((0, 3)), 0.0
    if not is_closed(mesh):
        welded, moved = _welded(mesh)
        if len(welded.vertices) < len(mesh.vertices):
            steps.append(f"{len(mesh.vertices) - len(welded.vertices)} near vertices welded")
            mesh = welded
    if not is_closed(mesh):
        agreed, turned = oriented(mesh)
        if turned:
            steps.append(f"{turned} triangles turned over")
            mesh = agreed
    if is_closed(mesh):
        return Mended(mesh, tuple(steps), 0.0, 0.0, nowhere, moved)
    loops = _open_loops(mesh)
    if len(loops) > MAX_HOLES:
        return Mended(mesh, (*steps, f"{len(loops)} holes"), np.inf, 1.0, nowhere, moved)
    before = _area(mesh)
    # A cube about each corner holds the ball about it.
    cube = depth * np.array(list(product((-1.0, 1.0), repeat=3))) if depth else np.zeros((1, 3))
    rims = tuple(mesh.vertices[loop] for loop in loops)
    around = [(rim[:, None] + cube).reshape(-1, 3) for rim in rims]
    slack = sum(map(hull_volume, around))
    mesh = _spanned(mesh, loops)
    steps.append(f"{len(loops)} holes spanned")
    filled = 1 - before / _area(mesh)
    return Mended(mesh, tuple(steps), slack, filled, np.concatenate(around), moved, rims)


CROWD = 64
"""Points in a cube with which each point around it is compared, lest a heap is compared with itself."""


def near_pairs(points: Array, distance: float) -> NDArray[np.int64]:
    """Pairs of points (n, 3) that are within a distance of each other.

    Returns:
        Rows of ``points``, shape (k, 2): every pair within the distance, where no more than `CROWD` points
        lie in a cube of that size; of a crowd, pairs with its first.
    """
    low = points.min(axis=0, initial=np.inf)
    # Cells no smaller than what the numbers below can count.
    cell = max(distance, float((points.max(axis=0, initial=-np.inf) - low).max(initial=0.0)) / 2**20, 1e-300)
    x, y, z = np.floor((points - low) / cell).astype(np.int64).T + 1
    key = (x << 42) + (y << 21) + z
    order = np.argsort(key, kind="stable")
    sorted_keys = key[order]
    found = [np.zeros((0, 2), np.int64)]
    for i, j, k in product((-1, 0, 1), repeat=3):
        step = (i << 42) + (j << 21) + k
        if step < 0:
            continue
        first = np.searchsorted(sorted_keys, key + step, side="left")
        count = np.searchsorted(sorted_keys, key + step, side="right") - first
        count = np.minimum(count, CROWD)
        here = np.repeat(np.arange(len(points)), count)
        place = np.arange(len(here)) - np.repeat(np.cumsum(count) - count, count)
        there = order[np.repeat(first, count) + place]
        near = np.linalg.norm(points[here] - points[there], axis=1) <= distance
        near &= (here < there) | (step > 0)
        found.append(np.column_stack([here[near], there[near]]))
    return np.concatenate(found)


def one_sided(mesh: Mesh) -> Mesh:
    """The mesh with one of each pair of triangles that are back to back: the one written first."""
    _, first = np.unique(np.sort(mesh.faces, axis=1), axis=0, return_index=True)
    return tidied(Mesh(mesh.vertices, mesh.faces[np.sort(first)], mesh.color))[0]


def _area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _welded(mesh: Mesh) -> tuple[Mesh, float]:
    """Vertices on open edges merged when closer than 1e-5 of the size; how far they were moved at most [m].

    Writers round and split.
    """
    edges, balance, _ = edge_balance(mesh.faces)
    rim = np.unique(edges[balance != 0])
    tolerance = 1e-5 * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    _, label = components(len(rim), near_pairs(mesh.vertices[rim], tolerance))
    _, first = np.unique(label, return_index=True)
    target = np.arange(len(mesh.vertices))
    target[rim] = rim[first[label]]
    moved = float(np.linalg.norm(mesh.vertices[target] - mesh.vertices, axis=1).max(initial=0.0))
    return tidied(Mesh(mesh.vertices, target[mesh.faces].astype(np.int32), mesh.color))[0], moved


def oriented(mesh: Mesh) -> tuple[Mesh, int]:
    """Neighbours turned to agree, spreading from the first triangle of each body."""
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
    regions, region = components(len(mesh.faces), pairs[~disagree])
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
