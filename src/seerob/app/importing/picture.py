"""What was imported, to be looked at: a picture of the assembly from the front, to the right and above."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seerob.core.shapes import Mesh
from seerob.core.transforms import Array
from seerob.description.cad.assembly import Assembly
from seerob.description.description import base_from_links
from seerob.description.shapes.glb import shaded
from seerob.outputs.picture.canvas import Canvas, look_along
from seerob.outputs.picture.lettering import png
from seerob.outputs.picture.picture import PREFERRED

FILE = "import.png"
SIZE = 960, 640
"""Width and height [px]."""
MOST = 3_000_000
"""Triangles beyond which the last parts are not drawn."""


def picture(assembly: Assembly) -> bytes:
    """A PNG of everything that became a part or a mechanism, in its colours.

    Args:
        assembly: With rigid places.
    """
    drawn: list[tuple[Array, Array, NDArray[Any], tuple[float, float, float]]] = []
    count = 0
    known: dict[int, tuple[Array, Array, NDArray[Any]]] = {}

    def add(meshes: tuple[Mesh, ...], world: Array, color: tuple[float, ...] | None) -> None:
        nonlocal count
        for mesh in meshes:
            count += len(mesh.faces)
            if count > MOST or not len(mesh.faces):
                continue
            if id(mesh) not in known:
                known[id(mesh)] = shaded(mesh)
            vertices, normals, faces = known[id(mesh)]
            R, t = world[:3, :3], world[:3, 3]
            r, g, b = (color or mesh.color)[:3]
            drawn.append((vertices @ R.T + t, normals @ R.T, faces, (r, g, b)))

    for instance in assembly.instances:
        add(assembly.shapes[instance.shape].pieces, instance.world_from_shape, instance.color)
    for moving in assembly.mechanisms:
        joints = [joint.name for joint in moving.description.joints()]
        q = dict(zip(joints, moving.q, strict=False))
        poses = base_from_links(moving.description, q)
        for link in moving.description.links:
            add(link.visual, moving.world_from_base @ poses[link.name], None)
    ends = np.cumsum([0, *(len(vertices) for vertices, _, _, _ in drawn)])
    vertices = np.vstack([v for v, _, _, _ in drawn])
    normals = np.vstack([n for _, n, _, _ in drawn])
    faces = np.vstack([f + end for (_, _, f, _), end in zip(drawn, ends, strict=False)]).astype(np.int32)
    ids = np.repeat(np.arange(len(drawn), dtype=np.int32), [len(f) for _, _, f, _ in drawn])
    focus = vertices[:: max(1, len(vertices) // 5000)]
    canvas = Canvas(look_along(*PREFERRED, focus, SIZE))
    canvas.shadow(vertices, faces, float(vertices[:, 2].min()))
    canvas.bodies(vertices, normals, faces, ids, np.array([color for _, _, _, color in drawn]))
    return png(canvas.pixels())
