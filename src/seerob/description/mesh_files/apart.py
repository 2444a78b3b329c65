"""Mesh formats that a library reads, in the parsers' process: a file ends that one and no run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from seerob.core.files.parser_process import parsed
from seerob.core.snapshot import Finding
from seerob.description.mesh_files.source import MeshSource, RawFile, RawMesh

Reader = Callable[[MeshSource], RawFile]


def apart(read: Reader) -> Reader:
    """A reader that works in the parsers' process.

    Args:
        read: A function of a module, which that process calls by its name.
    """

    def read_apart(source: MeshSource) -> RawFile:
        given = source.path, source.data, source.max_bytes, source.max_faces
        meshes, meters, up, findings, files = parsed(_plain, read, *given, file=str(source.path))
        source.findings.extend(
            Finding(level=level, subject=subject, text=text) for level, subject, text in findings
        )
        source.files.update(files)
        return RawFile(tuple(_mesh(*mesh) for mesh in meshes), meters, up)

    return read_apart


def _plain(read: Reader, path: Path, data: bytes, max_bytes: int, max_faces: int) -> tuple[Any, ...]:
    source = MeshSource(path, data, max_bytes, max_faces)
    raw = read(source)
    meshes = [
        (m.name, np.asarray(m.vertices, "<f8").tobytes(), np.asarray(m.faces, "<i8").tobytes(), m.color)
        for m in raw.meshes
    ]
    findings = [(finding.level, finding.subject, finding.text) for finding in source.findings]
    return meshes, raw.meters, raw.up, findings, source.files


def _mesh(name: str, vertices: bytes, faces: bytes, color: Any) -> RawMesh:
    return RawMesh(
        name, np.frombuffer(vertices, "<f8").reshape(-1, 3), np.frombuffer(faces, "<i8").reshape(-1, 3), color
    )
