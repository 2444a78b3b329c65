"""The bodies of a scene as arrays: read once, placed for any snapshot, coloured to be told apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding, Scene, Snapshot
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.outputs.picture.glb_reader import Primitive, read_glb

Ints = NDArray[np.int32]

MOVERS = ("robot", "human", "tool", "workpiece")
"""Roles that a picture is about; the others are pale."""
SKIN = np.array([0.84, 0.71, 0.61])
"""A person, whatever the colour of the mesh: warm, unlike any machine."""
_BYSTANDER = np.array([0.86, 0.87, 0.88])
_SHADES = (1.0, 0.86)
"""Neighbouring links and bones alternate between these."""
_CREASE = np.cos(np.deg2rad(30))


@dataclass(frozen=True, eq=False)
class Clear:
    """A translucent body, such as a safety area."""

    node: int
    """Index in `Scene.nodes`."""
    vertices: Array
    """In the body's frame [m], shape (n, 3)."""
    faces: Ints
    edges: NDArray[np.int64]
    """Creases, as pairs of vertices, shape (k, 2)."""
    color: tuple[float, float, float]
    alpha: float


@dataclass(frozen=True, eq=False)
class Bodies:
    """Opaque triangles of all nodes in one set of arrays, and the translucent bodies by themselves."""

    vertices: Array
    """In the frame of its node [m], shape (n, 3)."""
    normals: Array
    node: NDArray[np.int64]
    """Index in `Scene.nodes` per vertex, shape (n,)."""
    faces: Ints
    ids: Ints
    """Row of ``colors`` per triangle."""
    colors: Array
    """sRGB, shape (k, 3)."""
    color_node: NDArray[np.int64]
    """Index in `Scene.nodes` per color, shape (k,)."""
    clear: tuple[Clear, ...]
    findings: tuple[Finding, ...]
    """Nodes whose mesh cannot be read."""

    def placed(self, snapshot: Snapshot) -> tuple[Array, Array]:
        """Vertices [m] and normals in the world."""
        position, rotation = poses(snapshot)
        turned = rotation[self.node]
        vertices = np.einsum("nij,nj->ni", turned, self.vertices) + position[self.node]
        return vertices, np.einsum("nij,nj->ni", turned, self.normals)


def poses(snapshot: Snapshot) -> tuple[Array, Array]:
    """Positions [m] (n, 3) and rotations (n, 3, 3) of the nodes."""
    each = np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7).astype(float)
    # A node that nobody placed has no orientation; it stays where it was drawn.
    wxyz = np.where(np.linalg.norm(each[:, 3:], axis=1, keepdims=True) > 0, each[:, 3:], [1.0, 0, 0, 0])
    return each[:, :3], rotation_from_wxyz(wxyz)


def read_bodies(scene: Scene, meshes: dict[str, bytes]) -> Bodies:
    """Read the mesh of every node; one that cannot be read becomes a finding."""
    solid: list[tuple[int, Primitive, Array]] = []
    clear: list[Clear] = []
    findings: list[Finding] = []
    read: dict[str, tuple[Primitive, ...]] = {}
    count: dict[str, int] = {}
    for i, node in enumerate(scene.nodes):
        data = meshes.get(node.mesh or "")
        if data is None or node.mesh is None:
            continue
        try:
            primitives = read.get(node.mesh) or read_glb(data, node.name)
        except InputError as error:
            text = f"its mesh cannot be shown in pictures: {error.problems[0].what}"
            findings.append(Finding(level="warning", subject=node.name, text=text))
            continue
        read[node.mesh] = primitives
        nth = count[node.owner] = count.get(node.owner, -1) + 1
        for p in primitives:
            if p.alpha < 1:
                clear.append(Clear(i, p.vertices, p.faces, creases(p.vertices, p.faces), p.color, p.alpha))
            else:
                solid.append((i, p, tone(node.role, np.array(p.color), nth)))
    starts = np.cumsum([0, *(len(p.vertices) for _, p, _ in solid)])
    sizes = [len(p.vertices) for _, p, _ in solid]
    return Bodies(
        vertices=np.concatenate([np.zeros((0, 3)), *(p.vertices for _, p, _ in solid)]),
        normals=np.concatenate([np.zeros((0, 3)), *(p.normals for _, p, _ in solid)]),
        node=np.repeat(np.array([i for i, _, _ in solid], np.int64), sizes),
        faces=np.concatenate(
            [np.zeros((0, 3)), *(p.faces + at for (_, p, _), at in zip(solid, starts, strict=False))]
        ).astype(np.int32),
        ids=np.repeat(np.arange(len(solid), dtype=np.int32), [len(p.faces) for _, p, _ in solid]),
        colors=np.array([color for _, _, color in solid]).reshape(-1, 3),
        color_node=np.array([i for i, _, _ in solid], np.int64),
        clear=tuple(clear),
        findings=tuple(findings),
    )


def tone(role: str, color: Array, nth: int) -> Array:
    """Colour of the ``nth`` body of its owner, sRGB, shape (3,)."""
    if role == "human":
        return np.asarray(SKIN * (1.0, 0.93)[nth % 2])
    if role == "robot":
        return np.asarray(color * _SHADES[nth % 2])
    return color if role in MOVERS else np.asarray(0.55 * color + 0.45 * _BYSTANDER)


def creases(vertices: Array, faces: Ints) -> NDArray[np.int64]:
    """Edges where a surface bends by more than 30° or ends, as pairs of vertices, shape (k, 2).

    Vertices at one place count as one, for shading doubles them along creases.
    """
    _, first, place = np.unique(np.round(vertices, 6), axis=0, return_index=True, return_inverse=True)
    corner = place.reshape(-1)[faces.astype(np.int64)]
    # A triangle without area bends nothing; poles of spheres are made of them.
    corner = corner[(corner != np.roll(corner, -1, axis=1)).all(axis=1)]
    at = vertices[first][corner]
    normal = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    sides = np.sort(np.stack([corner, np.roll(corner, -1, axis=1)], -1).reshape(-1, 2), axis=1)
    pairs, which, times = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    total = np.zeros((len(pairs), 3))
    np.add.at(total, which.reshape(-1), np.repeat(normal, 3, axis=0))
    # |a + b|² = 2 + 2 cos of the bend, for two unit normals.
    smooth = (times == 2) & ((total**2).sum(axis=1) > 2 + 2 * _CREASE)
    return np.asarray(first[pairs[~smooth]], np.int64).reshape(-1, 2)
