"""Radii of curvature of meshes whose true surface is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from seerob.core.shapes import Mesh, Solid, capsule
from seerob.criteria.contact.limits import RegionArrays
from seerob.criteria.contact.shape import (
    ContactShape,
    body_shape,
    force_at_pressure,
    mesh_shape,
    patch_area,
    round_shape,
    solid_shape,
)
from seerob.description.norms.body_limits import shipped

CAP = 1e-4


def mesh(made: trimesh.Trimesh) -> Mesh:
    return Mesh(np.array(made.vertices), np.array(made.faces, np.int32))


def filleted_bar(radius: float, steps: int, size: float = 0.1) -> Mesh:
    """A square bar whose long edges are rounded by arcs of ``steps`` chords."""
    angles = np.concatenate([q * math.pi / 2 + np.linspace(0, math.pi / 2, steps + 1) for q in range(4)])
    corner = np.repeat([[1, 1], [-1, 1], [-1, -1], [1, -1]], steps + 1, axis=0) * (size / 2 - radius)
    outline = corner + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    n = len(outline)
    rings = [np.column_stack([outline, np.full(n, z)]) for z in (0.0, 0.3)]
    ends = [[0, 0, 0.0], [0, 0, 0.3]]
    i, j = np.arange(n), (np.arange(n) + 1) % n
    faces = np.vstack([
        np.column_stack([i, j, n + j]), np.column_stack([i, n + j, n + i]),
        np.column_stack([np.full(n, 2 * n), j, i]), np.column_stack([np.full(n, 2 * n + 1), n + i, n + j]),
    ])  # fmt: skip
    return Mesh(np.vstack([*rings, ends]), faces.astype(np.int32))


@pytest.mark.parametrize("radius", [0.001, 0.003, 0.05])
@pytest.mark.parametrize("sections", [12, 32, 128])
def test_cylinder_has_its_radius_and_none_along_it(radius: float, sections: int) -> None:
    shape = mesh_shape(mesh(trimesh.creation.cylinder(radius=radius, height=0.2, sections=sections)))
    np.testing.assert_allclose(shape.radii[:, 0], radius, rtol=1e-9)
    assert np.isinf(shape.radii[:, 1]).all()
    assert f"{2 * sections} edges" in shape.unknown


@pytest.mark.parametrize("subdivisions", [2, 3, 4])
def test_sphere_has_its_radius_in_both_directions_and_never_more(subdivisions: int) -> None:
    shape = mesh_shape(mesh(trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.01)))
    assert not shape.unknown
    assert (shape.radii <= 0.01 * (1 + 1e-9)).all()
    assert (shape.radii >= 0.01 * 0.87).all()


def test_torus_has_both_radii() -> None:
    made = trimesh.creation.torus(major_radius=0.05, minor_radius=0.01, major_sections=96, minor_sections=48)
    shape = mesh_shape(mesh(made))
    assert not shape.unknown
    assert shape.sharpest == pytest.approx((0.01, 0.06), rel=0.01)


@pytest.mark.parametrize("steps", [3, 6, 12])
def test_rounded_edge_of_a_bar_is_found_beside_large_faces(steps: int) -> None:
    shape = mesh_shape(filleted_bar(0.004, steps))
    assert shape.radii[0, 0] == pytest.approx(0.004, rel=1e-6)
    assert (shape.radii[:, 0] >= 0.004 * (1 - 1e-6)).all()


@pytest.mark.parametrize("made", [trimesh.creation.box([0.1, 0.2, 0.3]), filleted_bar(0.004, 2)])
def test_a_turn_of_one_step_does_not_tell_its_radius(made: trimesh.Trimesh | Mesh) -> None:
    shape = mesh_shape(made if isinstance(made, Mesh) else mesh(made))
    assert "edge radius below mesh resolution" in shape.unknown
    assert shape.resolution > 0


def test_box_has_twelve_such_edges_and_a_flat_rest() -> None:
    shape = mesh_shape(mesh(trimesh.creation.box([0.1, 0.2, 0.3])))
    assert shape.unknown_at is not None
    assert len(shape.unknown_at) == 12
    assert len(shape.radii) == 0


def test_inward_edges_do_not_count() -> None:
    outer, inner = trimesh.creation.box([0.2] * 3), trimesh.creation.box([0.1] * 3)
    inner.invert()
    hollow = mesh_shape(mesh(trimesh.util.concatenate([outer, inner])))
    assert hollow.unknown_at is not None
    assert np.abs(hollow.unknown_at).max(axis=1).min() == pytest.approx(0.1)


def test_pointed_cone_is_unknown_though_all_its_sides_turn_gently() -> None:
    cone = trimesh.creation.cone(radius=0.05, height=0.05, sections=64)
    apex = np.array([0, 0, 0.05])
    shape = mesh_shape(mesh(cone))
    assert shape.unknown_at is not None
    assert np.linalg.norm(shape.unknown_at - apex, axis=1).min() < 1e-12


def test_open_mesh_is_unknown_at_its_border() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=0.05)
    sphere.update_faces(sphere.triangles_center[:, 2] < 0.03)
    shape = mesh_shape(mesh(sphere))
    assert "open edges" in shape.unknown


def test_a_mesh_turned_inside_out_is_not_taken_for_a_hollow() -> None:
    box = trimesh.creation.box([0.1] * 3)
    box.invert()
    assert mesh_shape(mesh(box)).unknown


def test_fine_tessellation_is_not_taken_for_a_plane() -> None:
    shape = mesh_shape(mesh(trimesh.creation.cylinder(radius=0.02, height=0.05, sections=1024)))
    assert shape.radii[0, 0] == pytest.approx(0.02, rel=1e-6)


@pytest.mark.parametrize("chord", [2e-7, 2e-6])
def test_rounding_as_small_as_noise_is_unknown_and_not_flat(chord: float) -> None:
    radius = chord / (2 * math.sin(math.pi / 4 / 6))
    shape = mesh_shape(filleted_bar(radius, 6))
    assert (shape.radii[:, 0] >= 1e-3).all()
    assert shape.unknown_at is not None
    assert np.isclose(shape.unknown_at[:, 2], 0.15).sum() >= 4


def test_radius_scales_and_does_not_depend_on_the_pose() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=0.01)
    moved = sphere.copy()
    moved.apply_transform(trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.6, 0.3])))
    moved.apply_translation([1, -2, 0.5])
    np.testing.assert_allclose(mesh_shape(mesh(moved)).radii, mesh_shape(mesh(sphere)).radii, rtol=1e-6)
    sphere.apply_scale(3)
    assert mesh_shape(mesh(sphere)).sharpest[0] == pytest.approx(3 * mesh_shape(mesh(moved)).sharpest[0])


def test_dilation_rounds_every_edge() -> None:
    shape = solid_shape(Solid(mesh=mesh(trimesh.creation.box([0.1] * 3)), radius=0.004))
    assert (shape.unknown, shape.sharpest) == ("", (0.004, 0.004))
    assert solid_shape(capsule(np.zeros(3), np.array([0, 0, 0.1]), 0.03)).sharpest == (0.03, 0.03)


def test_what_is_not_the_real_surface_is_unknown() -> None:
    ball = mesh(trimesh.creation.icosphere(subdivisions=3, radius=0.05))
    assert solid_shape(Solid(mesh=ball)).unknown == ""
    assert "envelope" in solid_shape(Solid(mesh=ball, note="envelope")).unknown
    assert "lie 2 mm" in solid_shape(Solid(mesh=ball, deviation=0.002)).unknown
    assert body_shape((Solid(mesh=ball), Solid(mesh=ball, note="envelope"))).unknown
    assert body_shape(()).unknown


def test_area_of_a_ball_is_its_contact_circle_until_it_is_buried() -> None:
    d = np.linspace(0, 0.02, 50)
    np.testing.assert_allclose(
        patch_area([0.004, 0.004], d, 1.0), math.pi * 0.004 * np.minimum(d, 0.004), rtol=1e-12
    )
    assert patch_area([0.004, 0.004], np.inf, 1.0) == pytest.approx(math.pi * 0.004**2)
    assert patch_area([0.002, np.inf], 0.01, CAP) == pytest.approx(0.002 * math.sqrt(math.pi * CAP))
    assert patch_area([np.inf, np.inf], 0.01, CAP) == pytest.approx(CAP)


def test_sharper_is_never_a_larger_area() -> None:
    R = np.geomspace(1e-4, 1, 200)
    areas = patch_area(np.column_stack([R, R * 2]), 0.004, CAP)
    assert (np.diff(areas) >= -1e-18).all()
    assert areas.max() <= CAP * (1 + 1e-12)


@pytest.mark.parametrize("p", [1.2e6, 3.8e6])
@pytest.mark.parametrize("k", [10e3, 75e3])
def test_pressure_is_within_its_limit_at_every_force_up_to_the_permitted_one_and_beyond_above(
    p: float, k: float
) -> None:
    R = np.geomspace(3e-4, 0.1, 25)
    radii = np.array([(a, b) for a in R for b in (*R, np.inf) if a <= b] + [(np.inf, np.inf)])
    F = force_at_pressure(radii, p, k, CAP)
    share = np.linspace(1e-6, 1, 400)[:, None] * F
    some = F > 0
    assert (share[:, some] <= p * patch_area(radii, share / k, CAP)[:, some] * (1 + 1e-9)).all()
    beyond = np.where(some, F * 1.001, 1e-3)
    assert (beyond > p * patch_area(radii, beyond / k, CAP)).all()
    assert 0 < some.sum() < len(F)


def test_ball_of_5_mm_presses_harder_than_the_hand_may_be_at_every_force() -> None:
    """p = k/(π R) = 4.77 MPa whatever the force, above 3.8 MPa; from 6.3 mm on it holds."""
    assert force_at_pressure([0.005, 0.005], 3.8e6, 75e3, CAP) == 0
    assert 75e3 / (math.pi * 0.005) == pytest.approx(4.77e6, rel=1e-3)
    R = 75e3 / (math.pi * 3.8e6)
    assert force_at_pressure([R * 0.999] * 2, 3.8e6, 75e3, CAP) == 0
    # Larger than the cap of 5.64 mm: the area ends at 1 cm².
    assert force_at_pressure([R * 1.001] * 2, 3.8e6, 75e3, CAP) == pytest.approx(380)


def test_force_of_many_patches_is_brute_force() -> None:
    arrays = RegionArrays.of(shipped())
    rng = np.random.default_rng(3)
    # The sharper one way, the flatter the other: none is the least everywhere.
    sharp = rng.uniform(3e-3, 6e-3, 500)
    radii = np.column_stack([sharp, 3e-4 / sharp**0.9 * rng.uniform(1, 2, 500)])
    radii[::7, 1] = np.inf
    radii = np.sort(radii, axis=1)
    found = arrays.pressure_force(ContactShape(np.zeros((500, 3)), radii), CAP)
    k = arrays.stiffness[arrays.owner]
    for row, p in enumerate(arrays.pressures()):
        F = np.linspace(0.05, 900, 18000)
        for a in range(0, len(k), 5):
            areas = np.min([patch_area(r, F / k[a], CAP) for r in radii[::10]], axis=0)
            holds = np.cumprod(p[a] * areas >= F)
            few = arrays.pressure_force(ContactShape(np.zeros((50, 3)), radii[::10]), CAP)
            assert few[row, a] == pytest.approx(0.05 * holds.sum(), abs=0.051)
            assert found[row, a] <= few[row, a]
    assert (found > 0).any()
    assert np.isnan(arrays.pressure_force(ContactShape(np.zeros((0, 3)), np.zeros((0, 2)), "?"), CAP)).all()
    np.testing.assert_allclose(arrays.pressure_force(round_shape(1.0), CAP), arrays.pressures() * CAP)
