"""The matrix of open, inverted, duplicated … meshes that libraries are silent about."""

import numpy as np
import pytest
import trimesh

from seerob.core.errors import InputError
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Origin
from seerob.description.shapes.mass_properties import from_shape

DENSITY = 2700.0
CYLINDER = trimesh.creation.cylinder(0.05, 0.4, sections=64)
BOX = trimesh.creation.box((1, 1, 1))
SMALL = trimesh.creation.box((0.5, 0.5, 0.5))


def mesh_of(body):
    return Mesh(np.array(body.vertices), np.array(body.faces, np.int32))


def inverted(body):
    body = body.copy()
    body.invert()
    return body


def without(body, faces):
    return Mesh(np.array(body.vertices), np.delete(body.faces, faces, axis=0).astype(np.int32))


def texts(findings):
    return " | ".join(f.text for f in findings)


def test_a_closed_mesh_is_exact_and_silent():
    inertial, findings = from_shape([mesh_of(CYLINDER)], density=DENSITY)
    assert inertial.mass == pytest.approx(DENSITY * CYLINDER.volume, rel=1e-12)
    np.testing.assert_allclose(inertial.inertia, DENSITY * CYLINDER.moment_inertia, atol=1e-9)
    assert (inertial.origin, inertial.error, findings) == (Origin.ESTIMATED, 0.0, ())


def test_a_given_mass_scales_the_inertia_and_stays_given():
    inertial, findings = from_shape([mesh_of(CYLINDER)], mass=3.0)
    np.testing.assert_allclose(inertial.inertia, 3 / CYLINDER.volume * CYLINDER.moment_inertia, atol=1e-9)
    assert (inertial.mass, inertial.origin, inertial.error, findings) == (3.0, Origin.GIVEN, 0.0, ())


def test_an_inverted_mesh_is_turned_and_told():
    inertial, findings = from_shape([mesh_of(inverted(CYLINDER))], density=DENSITY, subject="rod")
    assert inertial.mass == pytest.approx(DENSITY * CYLINDER.volume, rel=1e-12)
    assert "inside out" in texts(findings)
    assert {f.subject for f in findings} == {"rod"}


@pytest.mark.parametrize("seed", range(8))
def test_an_open_mesh_is_mended_and_the_truth_lies_within_the_stated_error(seed):
    first = 30 * seed
    opened = without(CYLINDER, np.arange(first, first + 10))
    truth = DENSITY * CYLINDER.volume
    inertial, findings = from_shape([opened], density=DENSITY)
    assert abs(inertial.mass - truth) <= inertial.error * inertial.mass + 1e-9
    assert inertial.error < 0.05
    assert "holes spanned" in texts(findings)


def test_scattered_missing_triangles_cost_nothing():
    rng = np.random.default_rng(1)
    opened = without(CYLINDER, rng.choice(len(CYLINDER.faces), 10, replace=False))
    inertial, _ = from_shape([opened], density=DENSITY)
    assert inertial.mass == pytest.approx(DENSITY * CYLINDER.volume, rel=1e-9)


@pytest.mark.parametrize(("shift", "said"), [(0.0, "repeated"), (1e-7, "count once")])
def test_a_body_that_is_there_twice_weighs_once(shift, said):
    twice = [mesh_of(CYLINDER), mesh_of(CYLINDER.copy().apply_translation([shift, 0, 0]))]
    inertial, findings = from_shape(twice, density=DENSITY)
    assert inertial.mass == pytest.approx(DENSITY * CYLINDER.volume, rel=1e-4)
    assert said in texts(findings)


def test_overlapping_bodies_count_their_common_volume_once():
    shifted = BOX.copy().apply_translation([0.5, 0.5, 0.5])
    inertial, findings = from_shape([mesh_of(BOX), mesh_of(shifted)], density=1)
    assert inertial.mass == pytest.approx(2 - 0.125)
    assert "overlap" in texts(findings)


def test_bodies_apart_add_up():
    far = SMALL.copy().apply_translation([3, 0, 0])
    inertial, findings = from_shape([mesh_of(BOX), mesh_of(far)], density=1)
    both = trimesh.util.concatenate([BOX, far])
    assert inertial.mass == pytest.approx(1.125)
    np.testing.assert_allclose(inertial.com, both.center_mass)
    np.testing.assert_allclose(inertial.inertia, both.moment_inertia, atol=1e-12)
    assert findings == ()


@pytest.mark.parametrize(
    ("outer", "inner", "mass"),
    [
        (BOX, inverted(SMALL), 0.875),  # a cavity
        (inverted(BOX), SMALL, 0.875),  # a cavity, all of it inside out
        (BOX, SMALL, 1.0),  # a body in a body
    ],
)
def test_a_body_inside_another_is_a_cavity_when_its_normals_say_so(outer, inner, mass):
    inertial, _ = from_shape([mesh_of(inner), mesh_of(outer)], density=1)
    assert inertial.mass == pytest.approx(mass)


def test_mixed_winding_and_double_sided_triangles():
    odd = np.where(np.arange(12)[:, None] % 3 == 0, BOX.faces[:, ::-1], BOX.faces).astype(np.int32)
    inertial, findings = from_shape([Mesh(np.array(BOX.vertices), odd)], density=1)
    assert inertial.mass == pytest.approx(1)
    assert "4 triangles turned over" in texts(findings)
    double = np.vstack([BOX.faces, BOX.faces[:, ::-1]]).astype(np.int32)
    inertial, findings = from_shape([Mesh(np.array(BOX.vertices), double)], density=1)
    assert inertial.mass == pytest.approx(1)
    assert "double-sided" in texts(findings)


def test_a_body_split_by_colour_closes_again():
    halves = [without(CYLINDER, np.arange(128)), without(CYLINDER, np.arange(128, 256))]
    inertial, findings = from_shape(halves, density=DENSITY)
    assert inertial.mass == pytest.approx(DENSITY * CYLINDER.volume, rel=1e-12)
    assert findings == ()


@pytest.mark.parametrize("noise", [1e-9, 1e-5])
def test_loose_triangles_are_welded_or_flooded_and_the_error_covers_the_truth(noise):
    rng = np.random.default_rng(0)
    ball = trimesh.creation.icosphere(4, 0.1)
    loose = ball.vertices[ball.faces].reshape(-1, 3) + rng.normal(0, noise, (3 * len(ball.faces), 3))
    inertial, findings = from_shape(
        [Mesh(loose, np.arange(len(loose), dtype=np.int32).reshape(-1, 3))], density=1000
    )
    truth = 1000 * ball.volume
    assert abs(inertial.mass - truth) <= max(inertial.error, 1e-6) * inertial.mass
    assert inertial.error < 0.1
    assert ("welded" if noise < 1e-6 else "voxels") in texts(findings)
    np.testing.assert_allclose(inertial.inertia, truth * 0.4 * 0.01 * np.eye(3), rtol=0.02, atol=1e-5)


def test_what_is_mostly_missing_is_refused_unless_the_mass_is_known():
    trough = without(BOX, np.arange(6))
    with pytest.raises(InputError, match="the mesh is open") as caught:
        from_shape([trough], density=1000, subject="trough")
    assert "give the mass" in caught.value.problems[0].remedy
    inertial, findings = from_shape([trough], mass=2.0, subject="trough")
    assert inertial.mass == 2.0
    assert (np.linalg.eigvalsh(inertial.inertia) > 0).all()
    assert [f.level for f in findings] == ["warning"]
    assert "convex hull" in texts(findings)


def test_flat_empty_and_contradictory_input_is_refused():
    sheet = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]], np.int32))
    box = mesh_of(BOX)
    cases = [
        ([sheet], {"density": 1.0}, "flat"),
        ([sheet], {"mass": 1.0}, "flat"),
        ([], {"density": 1.0}, "no mesh"),
        ([box], {}, "neither mass nor density"),
        ([box], {"mass": 1.0, "density": 1.0}, "both mass and density"),
        ([box], {"density": -1.0}, "not a positive number"),
        ([box], {"mass": float("nan")}, "not a positive number"),
        ([box], {"mass": 0.0}, "not a positive number"),
    ]
    for meshes, options, what in cases:
        with pytest.raises(InputError, match=what):
            from_shape(meshes, **options)


@pytest.mark.parametrize("seed", range(5))
def test_whatever_is_missing_the_result_is_physical_or_refused(seed):
    rng = np.random.default_rng(seed)
    body = trimesh.creation.torus(0.3, 0.1, 24, 16)
    kept = rng.random(len(body.faces)) > rng.uniform(0, 0.9)
    try:
        inertial, _ = from_shape(
            [Mesh(np.array(body.vertices), body.faces[kept].astype(np.int32))], density=1000
        )
    except InputError:
        return
    a, b, c = np.linalg.eigvalsh(inertial.inertia)
    assert a > 0
    assert a + b >= c * (1 - 1e-9)
    assert 0 < inertial.mass <= 1000 * body.convex_hull.volume
    assert inertial.error <= 0.5
