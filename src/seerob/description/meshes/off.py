"""OFF, the Object File Format (ASCII); it knows neither unit nor axes."""

from __future__ import annotations

import numpy as np

from seerob.description.mesh_files import MeshSource, RawFile, RawMesh, triangles


def read(source: MeshSource) -> RawFile:
    """The one mesh of an OFF or COFF file; colours are not used."""
    text = source.text(source.data)
    lines = [words for line in text.splitlines() if (words := line.partition("#")[0].split())]
    if not lines or lines[0][0].upper() not in {"OFF", "COFF"}:
        source.fail("is not an OFF file: it does not begin with OFF", "export it as ASCII OFF")
    first = lines[0][1:] or (lines[1] if len(lines) > 1 else [])
    rows = lines[1:] if lines[0][1:] else lines[2:]
    try:
        points, faces = int(first[0]), int(first[1])
        if min(points, faces) < 0 or len(rows) < points + faces:
            source.fail(
                f"is truncated: {points} vertices and {faces} faces announced, {len(rows)} lines follow"
            )
        if faces > source.max_faces:
            source.fail(f"has {faces} faces, more than {source.max_faces}", "simplify it or raise max_faces")
        vertices = np.array([row[:3] for row in rows[:points]], float).reshape(points, 3)
        polygons = [[int(w) for w in row[1 : 1 + int(row[0])]] for row in rows[points : points + faces]]
        sizes = [int(row[0]) for row in rows[points : points + faces]]
    except (ValueError, IndexError) as error:
        source.fail(f"a line is not what OFF has there ({error})", "export it again")
    for size, polygon in zip(sizes, polygons, strict=True):
        if size < 3 or len(polygon) != size or min(polygon) < 0 or max(polygon) >= points:
            source.fail(f"a face is {polygon} with {points} vertices", "export it again")
    return RawFile((RawMesh("", vertices, triangles(vertices, polygons)),))
