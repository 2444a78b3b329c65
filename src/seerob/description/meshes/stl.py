"""STL, binary or ASCII; it knows neither unit nor axes nor colours."""

from __future__ import annotations

import re

import numpy as np

from seerob.description.mesh_files import MeshSource, RawFile, RawMesh

_RECORD = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84


def read(source: MeshSource) -> RawFile:
    """Triangles of an STL file; ASCII files may hold several named solids."""
    data = source.data
    # A binary file may start with "solid" too; its length betrays it.
    count = int.from_bytes(data[80:84], "little") if len(data) >= _HEADER else 0
    if len(data) >= _HEADER and len(data) >= _HEADER + count * _RECORD.itemsize and not _is_ascii(data):
        return RawFile((_binary(source, count),))
    if _is_ascii(data):
        return RawFile(_ascii(source))
    if len(data) < _HEADER:
        source.fail(f"is truncated: {len(data)} bytes, a binary STL has at least {_HEADER}")
    expected = _HEADER + count * _RECORD.itemsize
    source.fail(
        f"is truncated or not an STL: its header announces {count} triangles, {expected} bytes, "
        f"but it has {len(data)} bytes",
        "export it again",
    )


def _is_ascii(data: bytes) -> bool:
    head = data[:4096]
    return head.lstrip()[:5].lower() == b"solid" and b"\0" not in head


def _binary(source: MeshSource, count: int) -> RawMesh:
    if count > source.max_faces:
        source.fail(f"has {count} triangles, more than {source.max_faces}", "simplify it or raise max_faces")
    extra = len(source.data) - _HEADER - count * _RECORD.itemsize
    if extra:
        source.note(f"{extra} bytes after the last triangle were ignored", level="warning")
    records = np.frombuffer(source.data, _RECORD, count, _HEADER)
    with np.errstate(invalid="ignore"):  # a signalling NaN, which is refused later
        vertices = records["vertices"].reshape(-1, 3).astype(float)
    return RawMesh("", vertices, np.arange(3 * count).reshape(-1, 3))


def _ascii(source: MeshSource) -> tuple[RawMesh, ...]:
    text = source.text(source.data)
    meshes: list[RawMesh] = []
    blocks = re.split(r"(?im)^[ \t]*solid\b", text)[1:]
    for number, block in enumerate(blocks):
        name, _, body = block.partition("\n")
        if not re.search(r"(?im)^[ \t]*endsolid\b", body):
            source.fail("is truncated: a solid does not end with 'endsolid'", "export it again")
        words = re.findall(r"(?i)\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", body)
        facets = len(re.findall(r"(?im)^[ \t]*facet\b", body))
        if len(words) != 3 * facets:
            source.fail(f"solid {number}: {facets} facets but {len(words)} vertices", "export it again")
        try:
            vertices = np.array(words, float).reshape(-1, 3)
        except ValueError as error:
            source.fail(f"solid {number}: a coordinate is not a number ({error})")
        meshes.append(RawMesh(name.strip(), vertices, np.arange(len(vertices)).reshape(-1, 3)))
    return tuple(meshes)
