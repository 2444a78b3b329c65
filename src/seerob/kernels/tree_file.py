"""Trees of meshes on disk, by the content of the mesh: a later start reads what an earlier one built."""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.files.whole_file import whole_file
from seerob.kernels.tree import build_tree, component_of
from seerob.kernels.wide import widen

VERSION = b"seerob tree 3"
"""Changes whenever `build_tree`, `widen` or the layout does."""


@dataclass(frozen=True, eq=False)
class Tree:
    """What distance queries need of one mesh, in its own frame."""

    nodes: NDArray[np.float64]
    """Nodes of the bounding boxes as `seerob.kernels.tree.build_tree` lays them out, shape (k, 20)."""
    links: NDArray[np.int32]
    triangles: NDArray[np.float64]
    boxes: NDArray[np.float32]
    """Boxes of the wide tree as `seerob.kernels.wide.widen` lays them out, shape (w, 120)."""
    kids: NDArray[np.int32]
    probes: NDArray[np.float64]
    """A vertex of each connected piece [m], shape (p, 3)."""
    closed: bool
    """Whether every edge is passed as often in one direction as in the other."""


def tree_of(vertices: NDArray[np.float64], faces: NDArray[np.int32], *, cache: Path | None = None) -> Tree:
    """The tree of a mesh: read from ``cache`` when it is there and intact, else built and written.

    Args:
        vertices: [m], shape (n, 3), finite.
        faces: Vertex indices in range, shape (m, 3), m > 0.
        cache: Folder of trees; made when missing. A folder that cannot be written is not an error.
    """
    if cache is None:
        return _build(vertices, faces)
    content = hashlib.sha256(VERSION)
    for array in (np.asarray(vertices.shape), vertices, faces):
        content.update(np.ascontiguousarray(array).tobytes())
    path = cache / f"{content.hexdigest()}.tree"
    tree = _read(path)
    if tree is None:
        tree = _build(vertices, faces)
        _write(path, tree)
    return tree


def _build(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> Tree:
    # Vertices at the same place are one: STL files repeat each per triangle. Adding 0 drops the sign of -0.
    order = np.lexsort((vertices + 0.0).T)
    ranked = vertices[order]
    new = np.ones(len(ranked), bool)
    new[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    one = np.empty(len(order), np.int64)
    one[order] = np.cumsum(new) - 1
    welded = one[faces]
    at = ranked[new]
    root = component_of(welded, len(at))
    probes = at[np.unique(root[welded[:, 0]])]
    a = welded.ravel()
    b = np.roll(welded, -1, axis=1).ravel()
    edge, sign = np.where(a < b, a * len(at) + b, b * len(at) + a), np.sign(b - a)
    by_edge = np.argsort(edge, kind="stable")
    first = np.flatnonzero(np.diff(edge[by_edge], prepend=-1))
    closed = bool((np.add.reduceat(sign[by_edge], first) == 0).all())
    nodes, links, triangles = build_tree(vertices, faces)
    return Tree(nodes, links, triangles, *widen(nodes, links, triangles), probes, closed)


def _read(path: Path) -> Tree | None:
    """The tree in a file; None when there is none or it is not what was written."""
    try:
        blob = path.read_bytes()
        if blob[:32] != hashlib.sha256(blob[32:]).digest():
            return None
        with np.load(io.BytesIO(blob[32:]), allow_pickle=False) as stored:
            part: dict[str, Any] = {name: stored[name] for name in stored.files}
        return Tree(**(part | {"closed": bool(part["closed"])}))
    except (OSError, ValueError, KeyError, TypeError, EOFError):
        return None


def _write(path: Path, tree: Tree) -> None:
    payload = io.BytesIO()
    np.savez(
        payload,
        nodes=tree.nodes,
        links=tree.links,
        triangles=tree.triangles,
        boxes=tree.boxes,
        kids=tree.kids,
        probes=tree.probes,
        closed=np.array(tree.closed),
    )
    blob = payload.getvalue()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as hidden:
            hidden.write_bytes(hashlib.sha256(blob).digest() + blob)
    except OSError:
        return
