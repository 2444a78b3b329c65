"""Meshes whose creases, facets and points are counted by hand: what is convex, flat, bent and pointed."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import trimesh

from seerob.core.shapes import Mesh, Solid, prism_mesh
from seerob.core.transforms import Array
from seerob.criteria.contact.shape import ContactShape, body_shape, mesh_shape, solid_shape


def mesh(made: trimesh.Trimesh) -> Mesh:
    return Mesh(np.array(made.vertices), np.array(made.faces, np.int32))


def sharp(shape: ContactShape) -> int:
    found = re.search(r"(\d+) edges turn", shape.unknown)
    return int(found[1]) if found else 0


def places(shape: ContactShape) -> set[tuple[float, ...]]:
    assert shape.unknown_at is not None
    return {tuple(np.round(x, 9) + 0.0) for x in shape.unknown_at}


BALL = mesh(trimesh.creation.icosphere(subdivisions=2, radius=0.01))
BOX = trimesh.creation.box([0.1, 0.2, 0.3])
PRISM = prism_mesh([(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)], 0.0, 1.0, (1, 1, 1, 1))
ELL = trimesh.Trimesh(PRISM.vertices, PRISM.faces, process=True)


def test_edges_of_a_box_are_where_they_are_and_its_least_face_is_the_resolution() -> None:
    shape = mesh_shape(mesh(BOX))
    h = np.array([0.05, 0.1, 0.15])
    signs = [s for s in np.ndindex(3, 3, 3) if sum(i == 1 for i in s) == 1]
    assert places(shape) == {tuple(np.round((np.array(s) - 1) * h, 9) + 0.0) for s in signs}
    assert shape.resolution == pytest.approx(0.1)
    assert (shape.points.shape, shape.radii.shape) == ((0, 3), (0, 2))
    assert "pointed" not in shape.unknown


def test_a_smooth_ball_is_known_also_beside_corners_that_no_triangle_uses() -> None:
    shape = mesh_shape(Mesh(np.vstack([BALL.vertices, [[9.0, 9, 9]]]), BALL.faces))
    assert (shape.unknown, shape.resolution) == ("", 0.0)
    assert shape.unknown_at is not None
    assert len(shape.unknown_at) == 0


def test_one_triangle_is_three_points_and_three_open_edges() -> None:
    shape = mesh_shape(Mesh(np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]), np.array([[0, 1, 2]], np.int32)))
    assert shape.unknown == "edge radius below mesh resolution: 3 pointed corners, 3 open edges"
    assert places(shape) == {(0, 0, 0), (2, 0, 0), (0, 2, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)}


def test_inward_edges_count_only_where_nobody_knows_which_side_is_out() -> None:
    ell = mesh(ELL)
    assert sharp(mesh_shape(ell)) == 17
    # Its two sides in the same face, and the inward edge.
    flat = [i for i, n in enumerate(ELL.face_normals) if abs(n[2]) < 0.5]
    turned = ell.faces.copy()
    turned[flat[0]] = turned[flat[0], ::-1]
    assert sharp(mesh_shape(Mesh(ell.vertices, turned))) == 17 + 1 + 1
    without_lid = ell.faces[ELL.face_normals[:, 2] < 0.5]
    opened = mesh_shape(Mesh(ell.vertices, without_lid))
    assert sharp(opened) == 12
    assert "6 open edges" in opened.unknown
    both = trimesh.util.concatenate([ELL, ELL.copy().apply_translation([9, 0, 0])])
    faces = np.array(both.faces)
    faces[len(ELL.faces) :] = faces[len(ELL.faces) :, ::-1]
    # One of them inside out: together they enclose nothing.
    assert sharp(mesh_shape(Mesh(np.array(both.vertices), faces.astype(np.int32)))) == 2 * 18


def arc(strips: int, width: float, turn: float, *, flap: bool = False, over: bool = False) -> Mesh:
    """Strips 1 m long, each turned against the one before; the flap stands up from the first."""
    angles = np.arange(strips) * turn
    profile = np.vstack([[0, 0], np.cumsum(width * np.column_stack([np.cos(angles), -np.sin(angles)]), 0)])
    if flap:
        profile = np.vstack([profile, [0, 0.1]])
    v = np.vstack([np.column_stack([np.full(len(profile), x), profile]) for x in (0.0, 1.0)])
    n = len(profile)
    first = [[0, 1, n + 1], [0, n + 1, n]]
    rest = [t for k in range(1, strips) for t in ([k, k + 1, n + k + 1], [k, n + k + 1, n + k])]
    faces = [*first, *rest]
    if flap:
        # In an order in which labels of bent triangles could be those of other facets.
        faces = [*rest[:1], *first[::-1], *rest[1:], [0, n, 2 * n - 1], [0, 2 * n - 1, n - 1]]
    found = np.array(faces, np.int32)
    return Mesh(v, found[:, ::-1] if over else found)


@pytest.mark.parametrize("over", [False, True])
def test_strips_that_are_each_nearly_coplanar_are_a_plane_only_while_all_of_them_are(over: bool) -> None:
    """The end of the arc is s (s + w) t / 2w from the plane of its first strip, s as long as the rest."""
    turn, width = 0.9e-3, 1e-3
    for strips, flat in ((3, True), (4, False), (5, False)):
        s = (strips - 1) * width
        off = s * (s + width) * turn / (2 * width)
        assert (off < 4e-6) == flat, off
        shape = mesh_shape(arc(strips, width, turn, over=over))
        assert (len(shape.radii) == 0) == flat, strips
        assert shape.radii[:, 0] == pytest.approx(width / 2 / math.sin(turn / 2), rel=0.4)
    # 4.5 and 3.9 µm.
    for scale, flat in ((4.5, False), (3.9, True)):
        w = scale * 1e-6 / (6 * turn)
        assert (len(mesh_shape(arc(4, w, turn, over=over)).radii) == 0) == flat, scale


def test_an_edge_beside_a_bent_surface_is_one() -> None:
    assert sharp(mesh_shape(arc(5, 1e-3, 0.9e-3, flap=True))) == 1


@pytest.mark.parametrize(
    ("angle", "turned", "across"), [(43.5, 0, False), (46.5, 0, True), (20, 80, False), (20, -100, False)]
)
def test_a_second_fold_counts_as_across_above_45_degrees(angle: float, turned: float, across: bool) -> None:
    """A triangle with two of its sides folded down by 20°, whichever way it lies."""
    a, b = math.radians(angle), math.radians(turned)
    corners = np.array([[0, 0, 0], [1, 0, 0], [math.cos(a), math.sin(a), 0]])
    v, faces = list(corners), [[0, 1, 2]]
    for i, j in ((0, 1), (2, 0)):
        along = corners[j] - corners[i]
        out = np.cross(along, [0, 0, 1]) / np.linalg.norm(along)
        v.append((corners[i] + corners[j]) / 2 + 0.5 * (out * math.cos(0.35) - [0, 0, math.sin(0.35)]))
        faces.append([j, i, len(v) - 1])
    turn = np.array([[math.cos(b), math.sin(b), 0], [-math.sin(b), math.cos(b), 0], [0, 0, 1]])
    shape = mesh_shape(Mesh(np.array(v) @ turn, np.array(faces, np.int32)))
    assert np.isfinite(shape.radii[:, 0]).all()
    assert np.isfinite(shape.radii[:, 1]).any() == across


def cone(slope: float, *, split: bool = False, dent: float = 0.0) -> tuple[Mesh, Array]:
    """A closed cone of 64 sides and its apex; one side split in its plane; corners of its base lowered."""
    n = 64
    angles = np.arange(n) * 2 * math.pi / n
    base = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(n)])
    base[:4, 2] -= dent * np.array([0, 1, 0, 1])
    apex = np.array([0, 0, math.tan(math.radians(slope))])
    v = [*base, apex, [0, 0, -1.0]]
    ring = list(range(n))
    if split:
        v.append((base[0] + base[1]) / 2)
        ring.insert(1, len(v) - 1)
    faces = [f for i, j in zip(ring, [*ring[1:], 0], strict=True) for f in ([i, j, n], [j, i, n + 1])]
    return Mesh(np.array(v), np.array(faces, np.int32)), apex


@pytest.mark.parametrize(
    ("slope", "split", "dent", "pointed"),
    [
        (14.7, False, 0.0, False),
        (15.3, False, 0.0, True),
        (15.3, True, 0.0, True),  # an edge in the plane of a side is no dent
        (15.3, False, 0.01, False),
    ],
)
def test_a_cone_is_pointed_above_15_degrees_unless_it_is_dented(
    slope: float, split: bool, dent: float, pointed: bool
) -> None:
    made, apex = cone(slope, split=split, dent=dent)
    assert (tuple(np.round(apex, 9)) in places(mesh_shape(made))) == pointed


def deepest(dent: float) -> float:
    """Largest inward turn of a dented cone [rad], by another library."""
    made = cone(15.3, dent=dent)[0]
    found = trimesh.Trimesh(made.vertices, made.faces, process=False)
    return float(found.face_adjacency_angles[~found.face_adjacency_convex].max(initial=0.0))


@pytest.mark.parametrize(("turn", "pointed"), [(0.95e-3, True), (1.05e-3, False)])
def test_a_dent_is_one_from_a_milliradian_on(turn: float, pointed: bool) -> None:
    low, high = 0.0, 0.01
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (low, middle) if deepest(middle) > turn else (middle, high)
    assert deepest(high) == pytest.approx(turn, rel=1e-3)
    made, apex = cone(15.3, dent=high)
    assert (tuple(np.round(apex, 9)) in places(mesh_shape(made))) == pointed


def test_a_body_is_all_of_its_solids() -> None:
    box, small = (Solid(mesh=mesh(trimesh.creation.box(size))) for size in ([0.1] * 3, [0.03] * 3))
    ball = Solid(mesh=BALL)
    alone = body_shape((ball,))
    assert len(alone.points) == len(alone.radii) == len(mesh_shape(BALL).radii)
    assert alone.resolution == 0.0
    both = body_shape((box, ball, small))
    assert both.resolution == pytest.approx(0.03)
    assert both.unknown_at is not None
    assert len(both.unknown_at) == 24
    assert body_shape((ball,)).unknown_at is not None
    assert body_shape(()).unknown == "it has no shape"


def test_a_shape_without_thickness_has_no_radius() -> None:
    for radius, words in ((0.0, "without thickness"), (0.001, "")):
        shape = solid_shape(Solid(points=np.array([[0.0, 0, 0], [0, 0, 1]]), radius=radius))
        assert words in shape.unknown
        assert bool(shape.unknown) == bool(words)


def test_a_point_beside_a_sharp_edge_is_not_counted_twice() -> None:
    both = trimesh.util.concatenate([BOX, trimesh.Trimesh(*_cone_far())])
    unknown = mesh_shape(mesh(both)).unknown
    assert "edges turn" in unknown
    assert "pointed" not in unknown


def _cone_far() -> tuple[Array, Array]:
    made, _ = cone(20.0)
    return made.vertices + np.array([9.0, 0, 0]), made.faces
