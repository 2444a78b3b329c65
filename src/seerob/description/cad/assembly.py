"""An assembly as a CAD file has it, whatever its format: shapes, and where instances of them are."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from seerob.core.shapes import Mesh
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.cad.names import full_name, told_apart
from seerob.description.description import Description, Inertial
from seerob.description.mesh_files import Color
from seerob.description.shapes.moments import Moments

RIGID = 1e-6
"""A transform is rigid where the rotation nearest to it moves no corner by more than this [m]."""
ASKED = "as asked: "
"""Begin of why a part is left out that the user does not want."""
LARGEST = 1e30
"""No number of a shape or a transform is larger before both are put together; nothing overflows then."""
NOTHING = (
    "nothing but triangles without area",
    "an assembly of nothing",
    "has no surface: points or curves only",
    "a mesh without faces",
    "a joint",
    "closes a loop of joints",
)
"""Begins of why something became no part that nobody could touch."""
SINGLE = 6e-8
"""Rounding of a coordinate to four bytes, as a share of it."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A plane, cylinder or cone that a boundary representation has for a face, in its shape's frame [m]."""

    kind: str
    """``plane`` or ``round``."""
    point: Array
    """Of the plane, or of the axis, shape (3,)."""
    axis: Array
    """Normal of a plane away from matter, or axis, unit, shape (3,)."""
    round: tuple[float, ...] = ()
    """Radius at the point, slope of the radius, 1 for a shaft and 0 for a hole, both ends along the axis from
    the point, angle covered [m, rad]."""
    corners: Array = field(default_factory=lambda: np.empty((0, 3)))
    """Of a plane face, shape (n, 3)."""


@dataclass(frozen=True, eq=False)
class Shape:
    """The surface of one product, which may be there several times."""

    name: str
    """Of the product, as the file has it."""
    pieces: tuple[Mesh, ...]
    """Its surface by colour, in its own frame [m]."""
    deviation: float = 0.0
    """How far the real surface may lie outside the triangles [m]."""
    solids: int = 0
    """Closed bodies that the file says it has; 0 when it says nothing of that."""
    material: str = ""
    """Name of its material, as the file has it."""
    surfaces: tuple[Surface, ...] = ()
    """Plane and round faces, where the file is a boundary representation."""
    solid: Moments | None = None
    """Of its solids as the file has them, where they agree with the triangles; None where nobody knows them
    better than the triangles do."""
    density: float | None = None
    """Of its material, as the file states it [kg/m³]."""


@dataclass(frozen=True, eq=False)
class Instance:
    """One part: a shape at a place."""

    path: tuple[str, ...]
    """Names that lead to it, as the file has them."""
    shape: int
    """Which of the assembly's shapes."""
    world_from_shape: Array
    """Shape (4, 4) [m], z up."""
    color: Color | None = None
    """Of this instance, instead of its shape's."""
    inertial: Inertial | None = None
    """Mass properties that the file states, in the shape's frame; None where it states none."""


@dataclass(frozen=True, eq=False)
class Moving:
    """Links and joints that the file has: a robot, or any other mechanism."""

    description: Description
    """Its meshes in the links' frames [m]."""
    world_from_base: Array
    """Shape (4, 4) [m], z up."""
    q: tuple[float, ...] = ()
    """Where the file shows it, one for each of its joints that can be commanded [rad or m]."""


@dataclass(frozen=True, eq=False)
class Assembly:
    """What a CAD file holds."""

    format: str
    """``STEP AP214``, ``COLLADA``."""
    unit: str
    """Unit of lengths of the file, as it says or as it was told."""
    shapes: tuple[Shape, ...]
    instances: tuple[Instance, ...]
    findings: tuple[Finding, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()
    """Full names of what became no part, and why."""
    files: dict[str, bytes] = field(default_factory=dict)
    """Every file that was read, by its path from the folder of the first."""
    mechanisms: tuple[Moving, ...] = ()

    def names(self) -> list[str]:
        """Full name of each instance, unique and as names may be here."""
        return told_apart(full_name(instance.path) for instance in self.instances)


def link_row(name: str, parent: int) -> dict[str, Any]:
    """A link where its parent is, with nothing on it: what a reader of mechanisms fills in.

    Args:
        name: Of the link, as the file has it.
        parent: Number of its parent's row, -1 for the base.
    """
    return {
        "name": name,
        "parent": parent,
        "matrix": np.eye(4).tolist(),
        "anchor": [0.0, 0.0, 0.0],
        "joints": [],
        "inertial": None,
        "pieces": [],
        "collision": [],
    }


def baked(assembly: Assembly) -> Assembly:
    """Places that are rigid: a scale or a mirror of an instance goes into a shape of its own."""
    shapes = list(assembly.shapes)
    reach = [max(float(np.abs(m.vertices).max()) for m in shape.pieces) * 3**0.5 for shape in shapes]
    made: dict[tuple[int, bytes], int] = {}
    instances = []
    for instance in assembly.instances:
        linear = instance.world_from_shape[:3, :3]
        rotation = nearest_rotation(linear)
        if np.linalg.norm(linear - rotation, 2) * reach[instance.shape] <= RIGID:
            turned = instance.world_from_shape.copy()
            turned[:3, :3] = rotation
            instances.append(replace(instance, world_from_shape=turned))
            continue
        key = instance.shape, linear.round(12).tobytes()
        if key not in made:
            made[key] = len(shapes)
            shapes.append(_stretched(assembly.shapes[instance.shape], linear))
        moved = np.eye(4)
        moved[:3, 3] = instance.world_from_shape[:3, 3]
        instances.append(replace(instance, shape=made[key], world_from_shape=moved))
    return _pruned(assembly, shapes, instances)


def _pruned(assembly: Assembly, shapes: Sequence[Shape], instances: Sequence[Instance]) -> Assembly:
    """The assembly with these instances, and the shapes that they have."""
    used = sorted({instance.shape for instance in instances})
    number = {shape: k for k, shape in enumerate(used)}
    return replace(
        assembly,
        shapes=tuple(shapes[shape] for shape in used),
        instances=tuple(replace(instance, shape=number[instance.shape]) for instance in instances),
    )


def without(assembly: Assembly, patterns: Sequence[str], smaller: float | None) -> Assembly:
    """The assembly without parts that the user does not want; each is listed as left out.

    Args:
        assembly: With rigid places.
        patterns: Full names, with wildcards.
        smaller: Parts that are smaller than this in every direction go, too [m].

    Raises:
        ValueError: A pattern that is nobody's name, or nothing is left.
    """
    kept, left_out = [], list(assembly.left_out)
    used: set[str] = set()
    for name, instance in zip(assembly.names(), assembly.instances, strict=True):
        found = [pattern for pattern in patterns if fnmatchcase(name, pattern)]
        used.update(found)
        vertices = np.vstack([mesh.vertices for mesh in assembly.shapes[instance.shape].pieces])
        extent = float(np.ptp(vertices, axis=0).max())
        if found:
            left_out.append((name, f"{ASKED}--without {found[0]}; {extent * 1e3:.4g} mm"))
        elif smaller is not None and extent < smaller:
            left_out.append((name, f"{ASKED}--smaller {smaller * 1e3:g}; {extent * 1e3:.4g} mm"))
        else:
            kept.append(instance)
    if unused := [pattern for pattern in patterns if pattern not in used]:
        raise ValueError(f"no part is called {unused[0]!r}")
    if not kept and not assembly.mechanisms:
        raise ValueError("no part would be left")
    return replace(_pruned(assembly, assembly.shapes, kept), left_out=tuple(left_out))


def without_numbers(assembly: Assembly, numbers: Collection[int], why: str) -> Assembly:
    """The assembly without instances, by their numbers; each is listed as left out, as asked."""
    left_out = [(name, f"{ASKED}{why}") for k, name in enumerate(assembly.names()) if k in numbers]
    kept = [instance for k, instance in enumerate(assembly.instances) if k not in numbers]
    pruned = _pruned(assembly, assembly.shapes, kept)
    return replace(pruned, left_out=(*assembly.left_out, *left_out))


def nearest_rotation(linear: Array) -> Array:
    """The rotation that is nearest to a matrix (3, 3)."""
    u, _, v = np.linalg.svd(linear)
    u[:, 2] *= np.linalg.det(u @ v)
    return np.asarray(u @ v)


def _stretched(shape: Shape, linear: Array) -> Shape:
    mirrored = np.linalg.det(linear) < 0
    pieces = tuple(
        Mesh(m.vertices @ linear.T, m.faces[:, ::-1] if mirrored else m.faces, m.color) for m in shape.pieces
    )
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    return replace(
        shape,
        pieces=pieces,
        deviation=shape.deviation * float(np.linalg.norm(linear, 2)),
        solid=None if shape.solid is None else shape.solid.moved(matrix),
    )
