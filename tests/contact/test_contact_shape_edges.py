"""Where one rule of the contact radius ends and the next begins: two strips folded along an edge, and kin."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import trimesh

from seerob.core.shapes import Mesh, Solid
from seerob.criteria.contact.shape import (
    ContactShape,
    body_shape,
    force_at_pressure,
    mesh_shape,
    round_shape,
    solid_shape,
)


def mesh(made: trimesh.Trimesh) -> Mesh:
    return Mesh(np.array(made.vertices), np.array(made.faces, np.int32))


def folded(reach: float, turn: float) -> ContactShape:
    """Two strips 1 m long whose middles are ``reach`` from the edge along which they turn."""
    w = 2 * reach
    v = [[0, 0, 0], [1, 0, 0], [1, w, 0], [0, w, 0]]
    v += [[0, -w * math.cos(turn), -w * math.sin(turn)], [1, -w * math.cos(turn), -w * math.sin(turn)]]
    return mesh_shape(Mesh(np.array(v, float), np.array([[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 1]])))


def sharp(shape: ContactShape) -> int:
    """How many edges turn too far, or are too small, to tell their radius; those of the border left out."""
    found = re.search(r"(\d+) edges turn", shape.unknown)
    return int(found[1]) if found else 0


@pytest.mark.parametrize(
    ("reach", "turn", "patches", "edges"),
    [
        (2e-4, 0.95e-3, 0, 0),  # nearly coplanar: one facet
        (2e-4, 1.05e-3, 2, 0),  # a fold, whatever its radius
        (1.2e-3, 0.95e-3, 2, 0),  # and where a corner is more than 1 µm off the other's plane
        (1e-2, math.radians(29.9), 2, 0),
        (1e-2, math.radians(30.1), 0, 1),
        (1e-2, math.radians(32.5), 0, 1),
        (5.2e-6, 0.3, 2, 0),
        (4.8e-6, 0.3, 0, 1),  # as small as noise
        (4.5e-6, 2 * math.asin(4.5e-6 / 1.05e-3), 2, 0),  # so flat that noise does not matter
        (4.5e-6, 2 * math.asin(4.5e-6 / 0.95e-3), 0, 1),
    ],
)
def test_a_fold_is_flat_known_or_sharp(reach: float, turn: float, patches: int, edges: int) -> None:
    shape = folded(reach, turn)
    assert (len(shape.radii), sharp(shape)) == (patches, edges)
    assert shape.radii[:, 0] == pytest.approx(reach / math.sin(turn / 2), rel=1e-6)
    assert shape.resolution == pytest.approx(2 * reach if edges else 0.0)
    assert (" mm)" in shape.unknown) == bool(edges)


def test_triangles_without_area_change_nothing() -> None:
    box = mesh(trimesh.creation.icosphere(subdivisions=1, radius=0.01))
    faces = np.vstack([box.faces, [[0, 0, 1], [2, 5, 5]]]).astype(np.int32)
    assert mesh_shape(Mesh(box.vertices, faces)).radii.tolist() == mesh_shape(box).radii.tolist()
    nothing = mesh_shape(Mesh(box.vertices, np.array([[0, 0, 1]], np.int32)))
    assert (nothing.points.shape, nothing.radii.shape) == ((0, 3), (0, 2))
    assert nothing.unknown == "the mesh has no surface"


def test_a_sheet_with_two_sides_has_sharp_edges_all_around() -> None:
    """By itself it encloses nothing; beside a body its border turns by half a circle."""
    sheet = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]], float) + 2
    sides = np.array([[0, 1, 2], [2, 1, 0]])
    box = trimesh.creation.box([1, 1, 1])
    both = Mesh(np.vstack([box.vertices, sheet]), np.vstack([box.faces, sides + 8]).astype(np.int32))
    assert sharp(mesh_shape(both)) == 12 + 3
    assert sharp(mesh_shape(Mesh(sheet, sides.astype(np.int32)))) == 3


def test_a_dilation_adds_to_every_radius() -> None:
    ball = mesh(trimesh.creation.icosphere(subdivisions=2, radius=0.01))
    assert mesh_shape(ball, dilation=0.002).radii == pytest.approx(mesh_shape(ball).radii + 0.002)


def test_a_surface_that_may_lie_elsewhere_hides_edges_above_a_millimetre() -> None:
    ball = mesh(trimesh.creation.icosphere(subdivisions=2, radius=0.01))
    assert [bool(solid_shape(Solid(mesh=ball, deviation=d)).unknown) for d in (0.99e-3, 1e-3, 1.05e-3)] == [
        False,
        False,
        True,
    ]


def test_a_round_shape_is_one_patch() -> None:
    shape = round_shape(0.003)
    assert shape.points.tolist() == [[0, 0, 0]]
    assert shape.radii.tolist() == [[0.003, 0.003]]
    assert shape.sharpest == (0.003, 0.003)
    assert not shape.unknown


def test_a_pressure_that_is_just_reached_at_the_first_touch_holds() -> None:
    R, p = 0.004, 2e6
    k = math.pi * p * math.sqrt(R) * math.sqrt(R)
    assert force_at_pressure([R, R], p, k, 1e-4) > 0
    assert force_at_pressure([R, R], p, math.nextafter(k, 1e9), 1e-4) == 0


def test_patches_that_count_alike_are_in_order_of_what_counts() -> None:
    """The sharpest that is told is that of the least area up to 1 cm², not of the least radius."""
    bodies = [(0.02, 0.02), (0.004, math.inf), (0.00486, 0.00486)]
    shapes = tuple(
        Solid(points=np.zeros((2, 3)), radius=r) if r == s else Solid(mesh=cylinder(r)) for r, s in bodies
    )
    assert body_shape(shapes).sharpest == pytest.approx((0.004, math.inf))


def cylinder(radius: float) -> Mesh:
    """Without its ends, which are sharp."""
    made = mesh(trimesh.creation.cylinder(radius=radius, height=0.2, sections=64))
    inner = np.abs(made.vertices[made.faces][:, :, :2]).max(axis=(1, 2)) > 0
    return Mesh(made.vertices, made.faces[inner])
