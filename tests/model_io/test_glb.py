import hashlib
import io
import json
import struct

import numpy as np
import pytest
import trimesh

from seerob.core.shapes import Mesh, Solid, capsule, dilated_rectangle
from seerob.description.shapes.glb import glb_bytes, mesh_hash, shaded, shown, solid_mesh
from seerob.description.shapes.moments import of_closed_mesh, of_solid


def mesh_of(body, color=(0.5, 0.25, 1.0, 1.0)):
    return Mesh(np.array(body.vertices), np.array(body.faces, np.int32), color)


def tree_of(glb):
    magic, version, length = struct.unpack_from("<4sII", glb)
    assert (magic, version, length) == (b"glTF", 2, len(glb))
    assert length % 4 == 0
    size, kind = struct.unpack_from("<I4s", glb, 12)
    assert kind == b"JSON"
    return json.loads(glb[20 : 20 + size])


def test_another_reader_finds_the_same_shapes_in_the_same_axes():
    bodies = [
        trimesh.creation.box((0.3, 0.2, 0.1)).apply_translation([1, 2, 3]),
        trimesh.creation.torus(0.3, 0.1),
        trimesh.creation.icosphere(6, 0.2),  # more vertices than 16 bits can number
    ]
    scene = trimesh.load_scene(io.BytesIO(glb_bytes([mesh_of(b) for b in bodies])), file_type="glb")
    found = list(scene.geometry.values())
    assert len(found) == 3
    for body, copy in zip(bodies, found, strict=True):
        copy.merge_vertices(merge_norm=True, merge_tex=True)
        assert copy.is_watertight
        np.testing.assert_allclose(copy.bounds, body.bounds, atol=1e-6)
        assert copy.volume == pytest.approx(body.volume, rel=1e-5)


def test_equal_meshes_give_equal_bytes_and_the_hash_names_them():
    body = trimesh.creation.torus(0.3, 0.1)
    one, two = glb_bytes([mesh_of(body)]), glb_bytes([mesh_of(body)])
    assert one == two
    assert mesh_hash(one) == hashlib.sha256(one).hexdigest()
    assert mesh_hash(glb_bytes([mesh_of(body, (0, 0, 0, 1))])) != mesh_hash(one)


def test_what_is_kept_is_the_file_of_bodies_that_are_equal_and_of_no_other():
    corners = np.eye(3)
    flat = Mesh(corners, np.array([[0, 1, 2]], np.int32))
    solids = [
        Solid(mesh=flat),
        Solid(mesh=Mesh(2 * corners, flat.faces)),
        Solid(mesh=Mesh(corners, np.array([[0, 2, 1]], np.int32))),
        Solid(mesh=Mesh(corners, flat.faces, (1.0, 0.0, 0.0, 1.0))),
        Solid(mesh=flat, radius=0.1),
        Solid(points=corners, radius=0.1),
        Solid(points=corners, radius=0.2),
        capsule(corners[0], corners[1], 0.1),
    ]
    for solid in [*solids, *solids]:
        told = shown([solid], [])
        assert told.content == glb_bytes([solid_mesh(solid)])
        assert told.digest == mesh_hash(told.content)
        assert told.triangles == len(solid_mesh(solid).faces)
        assert shown([solid], [flat]).content == glb_bytes([flat])


def test_the_file_states_what_a_viewer_needs():
    tree = tree_of(glb_bytes([mesh_of(trimesh.creation.box((1, 2, 3)), (0.5, 0, 1, 0.4))]))
    (material,) = tree["materials"]
    assert material["doubleSided"]
    assert material["alphaMode"] == "BLEND"
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([0.214041, 0, 1, 0.4])
    (primitive,) = tree["meshes"][0]["primitives"]
    position = tree["accessors"][primitive["attributes"]["POSITION"]]
    assert (position["min"], position["max"]) == ([-0.5, -1, -1.5], [0.5, 1, 1.5])
    assert position["count"] == 24  # a cube's corners are sharp: three normals each
    assert all(v["byteOffset"] % 4 == 0 for v in tree["bufferViews"])


def test_nothing_to_show_is_a_valid_file():
    tree = tree_of(glb_bytes([]))
    assert "meshes" not in tree
    assert tree["scenes"] == [{}]
    assert tree_of(glb_bytes([Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))])) == tree


def test_normals_are_smooth_on_a_ball_and_sharp_on_a_cylinders_rim():
    vertices, normals, faces = shaded(mesh_of(trimesh.creation.icosphere(4)))
    assert len(vertices) == len(trimesh.creation.icosphere(4).vertices)
    assert np.abs(normals - vertices).max() < 0.003
    cylinder = mesh_of(trimesh.creation.cylinder(1, 2, sections=64))
    vertices, normals, faces = shaded(cylinder)
    rim = np.abs(np.hypot(*vertices[:, :2].T) - 1) < 1e-9
    assert rim.sum() == 4 * 64
    across = np.abs(normals[rim][:, 2])
    assert ((across < 1e-9) | (across > 1 - 1e-9)).all()
    np.testing.assert_array_equal(vertices[faces], cylinder.vertices[cylinder.faces])


CORNER, U, V = np.array([0.1, 0.2, 0.3]), np.array([0.3, 0.1, 0.0]), np.array([-0.05, 0.15, 0.2])


@pytest.mark.parametrize(
    "solid",
    [
        capsule(CORNER, CORNER + U, 0.05),
        capsule(CORNER, CORNER, 0.05),
        dilated_rectangle(CORNER, U, V, 0.05),
        dilated_rectangle(CORNER, V, U, 0.01),
    ],
)
def test_a_tessellated_solid_is_closed_outward_and_its_corners_lie_on_the_true_surface(solid):
    mesh = solid_mesh(solid, color=(1, 0, 0, 1))
    body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert body.is_watertight
    assert body.is_winding_consistent
    p = solid.points
    edges = [q - p[0] for q in p[1:]]
    nearest = p[0] + sum(
        np.clip((mesh.vertices - p[0]) @ e / max(e @ e, 1e-30), 0, 1)[:, None] * e for e in edges
    )
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices - nearest, axis=1), solid.radius, atol=1e-12)
    assert 0.95 < of_closed_mesh(mesh).volume / of_solid(solid).volume < 1
    assert len(mesh.faces) < 500


def test_a_mesh_solid_is_shown_as_it_is_or_moved_out_by_its_envelope():
    ball = mesh_of(trimesh.creation.icosphere(3, 0.2))
    assert solid_mesh(Solid(mesh=ball)).vertices is ball.vertices
    grown = solid_mesh(Solid(mesh=ball, radius=0.1))
    np.testing.assert_allclose(np.linalg.norm(grown.vertices, axis=1), 0.3, atol=1e-3)
    flat = solid_mesh(dilated_rectangle(CORNER, U, V, 0.0))
    assert 2 <= len(flat.faces) <= 8
