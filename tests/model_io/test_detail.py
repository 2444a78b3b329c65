import numpy as np
import pytest
import trimesh
from surface_distance import hausdorff

from seerob.core.shapes import Mesh
from seerob.description.shapes.detail import display_mesh, physics_mesh


def mesh_of(body):
    return Mesh(np.array(body.vertices), np.array(body.faces, np.int32), (0.1, 0.2, 0.3, 1.0))


def soup(mesh):
    """The same triangles, each with vertices of its own, as an STL has them."""
    return Mesh(
        mesh.vertices[mesh.faces].reshape(-1, 3),
        np.arange(3 * len(mesh.faces), dtype=np.int32).reshape(-1, 3),
    )


def subdivided(body, times):
    for _ in range(times):
        body = body.subdivide()
    return body


def shrunk(body, factor):
    """Scaled without trimesh's own merging of what it takes for equal."""
    return Mesh(np.array(body.vertices) * factor, np.array(body.faces, np.int32))


def volume(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def slotted():
    return trimesh.creation.box((0.3, 0.2, 0.1)).difference(trimesh.creation.box((0.1, 0.1, 1.0)))


@pytest.mark.parametrize(
    ("body", "at_most"),
    [
        (subdivided(trimesh.creation.box((0.3, 0.2, 0.1)), 4), 12),
        (subdivided(slotted(), 3), 32),
        # Finer than the tolerance on purpose: many small moves must not add up.
        (shrunk(trimesh.creation.icosphere(5), 0.0005), 12_000),
        (trimesh.creation.cylinder(0.01, 0.2, sections=2000), 2000),
        (shrunk(trimesh.creation.torus(2, 1, 80, 80), 0.0003), 12_500),
        (trimesh.creation.box((1, 1, 1)), 12),
    ],
)
def test_the_mesh_for_distances_is_the_same_surface_within_two_micrometres(body, at_most):
    mesh = body if isinstance(body, Mesh) else mesh_of(body)
    light = physics_mesh(soup(mesh))
    assert len(light.faces) <= at_most
    assert hausdorff(mesh, light, 300) <= light.deviation + 1e-12
    assert light.deviation <= 2e-6
    assert volume(light) == pytest.approx(volume(mesh), rel=3e-3)


def test_an_open_body_stays_as_it_is_and_a_closed_one_beside_it_is_simplified():
    plate = Mesh(
        np.array([[5, 0, 0], [6, 0, 0], [6, 1, 0], [5, 1, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    )
    box = mesh_of(subdivided(trimesh.creation.box((1, 1, 1)), 3))
    both = Mesh(np.vstack([plate.vertices, box.vertices]), np.vstack([plate.faces, box.faces + 4]))
    light = physics_mesh(both)
    assert len(light.faces) == 14
    assert hausdorff(both, light, 300) <= 2e-6
    alone = physics_mesh(plate)
    assert (len(alone.faces), alone.deviation, alone.method) == (2, 0.0, "as it is")


def test_triangles_back_to_back_stay():
    fin = Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2], [2, 1, 0], [1, 2, 0]], np.int32)
    )
    light = physics_mesh(fin)
    assert light.method == "cleaned"
    np.testing.assert_array_equal(light.faces, [[0, 1, 2], [2, 1, 0]])


def test_an_inverted_mesh_keeps_its_sense():
    body = subdivided(trimesh.creation.box((1, 1, 1)), 2)
    body.invert()
    light = physics_mesh(mesh_of(body))
    assert len(light.faces) == 12
    assert volume(light) == pytest.approx(-1)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("limit", [200, 3000])
def test_the_mesh_for_the_screen_keeps_its_promises(closed, limit):
    body = trimesh.creation.torus(0.3, 0.1, 60, 60)
    if not closed:
        body.update_faces(np.arange(len(body.faces)) > 50)
    light = display_mesh(mesh_of(body), max_triangles=limit)
    assert len(light.faces) <= limit
    assert light.color == (0.1, 0.2, 0.3, 1.0)
    assert 0 < hausdorff(mesh_of(body), light, 300) <= light.deviation < (0.2 if limit == 200 else 0.05)


def test_what_vanishes_from_the_screen_is_part_of_the_stated_deviation():
    """A wire much thinner than a cell, and a speck far away."""
    body = trimesh.creation.icosphere(5, 0.3)
    wire = trimesh.creation.box((0.8, 1e-5, 1e-5)).apply_translation([0.8, 0.0123, 0.0123])
    speck = trimesh.creation.box((1e-5, 1e-5, 1e-5)).apply_translation([-2.0, 0.0123, 0.0123])
    everything = mesh_of(trimesh.util.concatenate([body, wire, speck]))
    opened = Mesh(everything.vertices, everything.faces[1:])
    light = display_mesh(opened, max_triangles=1000)
    assert light.method == "clustered"
    assert hausdorff(opened, light, 300) <= light.deviation


def test_small_meshes_are_shown_as_they_are():
    light = display_mesh(mesh_of(trimesh.creation.box((1, 1, 1))))
    assert (len(light.faces), light.deviation) == (12, 0.0)


def test_nothing_stays_nothing():
    nothing = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))
    assert len(physics_mesh(nothing).faces) == len(display_mesh(nothing).faces) == 0
