"""PLY, ASCII or binary, read by trimesh and checked against its own header; no unit, no axes."""

from __future__ import annotations

import io
import logging
import re
import warnings
from typing import Any

import numpy as np

from seerob.description.mesh_files import MeshSource, RawFile, RawMesh


def read(source: MeshSource) -> RawFile:
    """The one mesh of a PLY file, in the most frequent of its colours."""
    import trimesh

    head, end, _ = source.data[:65536].partition(b"end_header")
    if not source.data.startswith(b"ply") or not end:
        source.fail("is not a PLY file: no header from 'ply' to 'end_header'", "export it again")
    elements = re.findall(rb"(?m)^element\s+(\w+)\s+(\d+)\s*$", head)
    for name, number in elements:
        # Every row has at least one byte, or two characters.
        if len(number) > 18 or int(number) > len(source.data):
            what = f"announces {number.decode()[:40]} {name.decode()} rows in {len(source.data)} bytes"
            source.fail(f"{what}: truncated or hostile", "export it again")
    counts = {name.decode(): int(number) for name, number in elements}
    if counts.get("face", 0) > source.max_faces:
        source.fail(f"has {counts['face']} faces, more than {source.max_faces}", "raise max_faces")
    if not counts.get("face"):
        source.fail("holds no faces, only points", "export a surface")
    log = logging.getLogger("trimesh")
    disabled, log.disabled = log.disabled, True
    try:
        with source.parsing("PLY file"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh = trimesh.load_mesh(
                io.BytesIO(source.data),
                file_type="ply",
                process=False,
                skip_materials=True,
                fix_texture=False,
            )
            vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
            color = None
            visual: Any = mesh.visual
            if visual is not None and visual.defined and visual.kind in {"vertex", "face"}:
                r, g, b, a = (float(c) / 255 for c in visual.main_color)
                color = (r, g, b, a)
    finally:
        log.disabled = disabled
    if len(vertices) != counts.get("vertex") or len(faces) < counts["face"]:
        source.fail(f"announces {counts} but {len(vertices)} vertices and {len(faces)} triangles were read")
    return RawFile((RawMesh("", vertices, faces, color),))
