"""STEP (AP203, AP214, AP242) and IGES through OpenCASCADE: products, usages, colours, materials, triangles.

It runs in the parsers' process: damaged files crash it, which takes that process along and no other. What
comes back is compared here with what it said of areas, volumes and points of the surfaces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from seerob.core.errors import InputError
from seerob.core.extras import edition, need
from seerob.core.files.parser_process import parsed_one_by_one
from seerob.core.printable import printable
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.cad import kept
from seerob.description.cad.assembly import LARGEST, SINGLE, Assembly, Instance, Shape, Surface
from seerob.description.cad.opencascade import plain
from seerob.description.mesh_files import MeshSource
from seerob.description.shapes import mass_bounds, mass_properties
from seerob.description.shapes.mesh_bodies import is_closed, joined
from seerob.description.shapes.moments import Moments, of_closed_mesh, signed_volume
from seerob.kernels.signed_distance import farthest_outside
from seerob.kernels.tree import build_tree

TOLERANCE = 1e-4
"""How far triangles may be from the surface unless the caller says otherwise [m]."""
PACKAGES = ("cadquery-ocp-novtk", "cadquery-ocp")
"""Distributions that bring OpenCASCADE."""
SECONDS, MEMORY = 900.0, 4 << 30
"""Computing time [s] and memory [byte] that reading may take."""
VALIDATION = 1e-3
"""Share by which area, volume and centroid may differ from what the file states without a warning."""
INTEGRATED = 5e-5
"""Share by which volumes and moments of two integrations may differ for the finer one to be taken."""
AREA, VOLUME = 0.02, 0.02
"""Shares of area and volume by which triangles may be off without a warning."""


BETWEEN = 1.02
"""How much farther a surface may be from triangles between points that are an eighth of an edge apart: a
parabola is 1/64 higher."""
ROUGH = 1.1
"""How much farther it may be there where triangles are farther than was asked, as at the poles of a ball,
whose parameters tell less; of a ball of 75 mm at 1 mm, 10⁵ points lie 3.6 % farther than those that are
looked at."""


def read(
    source: MeshSource,
    *,
    iges: bool = False,
    tolerance: float = TOLERANCE,
    cache: Path | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Assembly:
    """The assembly of a STEP or IGES file.

    Args:
        source: The file.
        iges: Whether it is IGES.
        tolerance: Largest distance of triangles from the surface [m].
        cache: Folder that keeps what was read, by content.
        progress: Told how far it is.

    Raises:
        InputError: It cannot be read, holds no surface, or crashes OpenCASCADE.
        MissingPackage: OpenCASCADE is not installed.
    """
    opencascade = edition(*PACKAGES)
    if cache is None or opencascade is None:
        return _asked(source, iges, tolerance, progress)[0]
    key = kept.key(source, (iges, tolerance, opencascade))
    found = kept.read(cache, key, source)
    if found is None:
        found, whole = _asked(source, iges, tolerance, progress)
        # What is missing today may be there tomorrow.
        if whole:
            kept.write(cache, key, found)
    return found


def _asked(
    source: MeshSource, iges: bool, tolerance: float, progress: Callable[[str], None]
) -> tuple[Assembly, bool]:
    """What OpenCASCADE says of a file, and whether every file was there that it names."""
    need("OCP")
    name = source.path.name
    answers = parsed_one_by_one(
        plain,
        *(source.path, source.data, source.max_bytes, source.max_faces, iges, tolerance),
        file=str(source.path),
        remedy="export it again, perhaps as another edition of STEP, or as glTF",
        memory=MEMORY,
        seconds=SECONDS,
        ahead=1,
    )
    findings: list[Finding] = []
    shapes: list[Shape] = []
    products = done = 0
    for answer in answers:
        if "products" in answer:
            products = answer["products"]
        elif "shape" in answer:
            done += 1
            progress(f"cutting {name} into triangles: {done} of {products} products")
            if answer["shape"] is not None:
                shapes.append(_shape(source, answer["shape"], tolerance, findings))
        else:
            told = answer
    source.files.update(told["files"])
    said = [Finding(level=level, subject=subject, text=text) for level, subject, text in told["findings"]]
    instances = tuple(
        Instance(tuple(path), shape, np.array(matrix, float), color)
        for path, shape, matrix, color in told["instances"]
    )
    left_out = tuple((name, why) for name, why in told["left_out"])
    files = dict(source.files)
    assembly = Assembly(
        told["format"], told["unit"], tuple(shapes), instances, (*said, *findings), left_out, files
    )
    return assembly, not told["missing"]


def _shape(source: MeshSource, row: dict[str, Any], tolerance: float, findings: list[Finding]) -> Shape:
    pieces = tuple(
        Mesh(np.frombuffer(v, "<f8").reshape(-1, 3), np.frombuffer(f, "<i4").reshape(-1, 3), color)
        for v, f, color in row["pieces"]
    )
    name = row["name"]
    points = np.frombuffer(row["points"], "<f8").reshape(-1, 3)
    size = max(float(np.abs(corners).max(initial=0.0)) for corners in (points, *(p.vertices for p in pieces)))
    if not size <= LARGEST:
        source.fail(f"{printable(name)[:200]} reaches {size:.3g} m", "check its unit")
    whole, _ = joined(pieces)
    # Distances go by what lies outside, masses by both sides.
    far, either = (d * (BETWEEN if d <= tolerance else ROUGH) for d in _farthest(whole, points))
    rounding = SINGLE * float(np.abs(whole.vertices).max(initial=0.0))
    deviation = (0.0 if row["flat"] else max(tolerance, far, either)) + rounding

    def note(level: str, text: str) -> None:
        findings.append(Finding(level=level, subject=name, text=text))

    if far > 1.5 * tolerance:
        text = f"its surface lies up to {far * 1e3:.3g} mm outside its triangles, which counts as uncertainty"
        note("warning", text)
    if row["lost"]:
        note("warning", f"{row['lost']} of {row['faces']} faces could not be cut into triangles")
    a, b, c = np.moveaxis(whole.vertices[whole.faces], 1, 0)
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    if row["area"] > 0 and abs(area / row["area"] - 1) > AREA:
        note("warning", f"its triangles have {100 * (area / row['area'] - 1):+.1f} % of the surface's area")
    if row["solids"] and not is_closed(whole):
        note("warning", "a solid of the file has triangles that do not close")
    elif row["solids"] and row["volume"] > 0:
        share = signed_volume(whole) / row["volume"] - 1
        if abs(share) > VOLUME:
            note("warning", f"its triangles enclose {100 * share:+.1f} % of the solid's volume")
    elif not row["solids"] and is_closed(whole):
        note("note", "is made of surfaces, not of a solid; they close")
    solid, text = _solid(row, whole, deviation)
    if text:
        note("warning", text)
    if row["dense"]:
        material = printable(row["material"])[:200]
        if row["density"] is None:
            text = (
                f"the file states a density of {material} that is not understood, and not taken: "
                "give --density NAME=DENSITY"
            )
        else:
            text = f"the file states a density of {material}: {row['density']:g} kg/m³"
        if all(finding.text != text for finding in findings):
            note("note", text)
    for text in _contradicted(row):
        note("warning", text)
    surfaces = tuple(
        Surface(kind, np.array(at), np.array(axis), tuple(figures), np.array(corners, float).reshape(-1, 3))
        for kind, at, axis, figures, corners in row["surfaces"]
    )
    return Shape(name, pieces, deviation, row["solids"], row["material"], surfaces, solid, row["density"])


def _solid(row: dict[str, Any], whole: Mesh, deviation: float) -> tuple[Moments | None, str]:
    """Moments of the solids themselves where their triangles agree with them, else what does not agree."""
    if not (row["solids"] and row["volume"] > 0 and row["off"] <= INTEGRATED and is_closed(whole)):
        return None, ""
    if not signed_volume(whole) > 0:
        return None, ""
    triangles = of_closed_mesh(whole)
    if row["solids"] > 1:
        try:
            once = mass_properties.from_shape([whole], density=1.0)[0]
        except InputError:
            return None, ""
        if abs(once.mass / triangles.volume - 1) > INTEGRATED:  # some overlap, or are in others
            return None, ""
    solid = Moments(row["volume"], np.array(row["center"]), np.array(row["inertia"]))
    off = mass_bounds.off_by(whole, deviation, triangles).volume + INTEGRATED
    share = solid.volume / triangles.volume - 1
    if abs(share) > off:
        return None, (
            f"its solids have {100 * share:+.2g} % of the volume in their triangles, where {100 * off:.2g} % "
            "would do: overlapping or inside out? A mass by density goes by the triangles"
        )
    return solid, ""


def _contradicted(row: dict[str, Any]) -> Iterator[str]:
    """What the file states of a shape and its surface does not have: something was lost, or never there."""
    stated = row["stated"]
    for key, what, unit in (("volume", "a volume", "m³"), ("area", "an area", "m²")):
        has = row[key]
        if stated.get(key, 0.0) > 0 and has > 0 and abs(has / stated[key] - 1) > VALIDATION:
            share = 100 * (has / stated[key] - 1)
            yield f"the file states {what} of {stated[key]:.6g} {unit}; its surface has {share:+.2g} %"
    if "center" in stated and row["center"] is not None and row["volume"] > 0:
        off = float(np.linalg.norm(np.subtract(stated["center"], row["center"])))
        if off > VALIDATION * row["volume"] ** (1 / 3):
            yield f"the file states a centroid that is {off * 1e3:.3g} mm from that of its surface"


def _farthest(whole: Mesh, points: Array) -> tuple[float, float]:
    """How far the farthest of points on the surface lies outside of the triangles, and on either side [m]."""
    if not len(points) or not len(whole.faces):
        return 0.0, 0.0
    vertices, faces = np.ascontiguousarray(whole.vertices), np.ascontiguousarray(whole.faces, np.int32)
    tree, points = build_tree(vertices, faces), np.ascontiguousarray(points)
    far, either = (float(farthest_outside(*tree, closed, points)) for closed in (is_closed(whole), False))
    return far, either
