import numpy as np
import pytest
import trimesh

from seerob.core.errors import InputError
from seerob.core.shapes import Mesh
from seerob.description.shapes.decomposition import convex_parts


def mesh_of(body):
    return Mesh(np.array(body.vertices), np.array(body.faces, np.int32))


def l_shape():
    arm = trimesh.creation.box((0.1, 0.1, 0.3)).apply_translation([0.05, 0.05, 0.15])
    return mesh_of(trimesh.creation.box((0.3, 0.1, 0.1)).apply_translation([0.15, 0.05, 0.05]).union(arm))


def inside(parts, points):
    """Which points lie in any of the convex parts, within 1 mm."""
    found = np.zeros(len(points), bool)
    for part in parts:
        a, b, c = np.moveaxis(part.vertices[part.faces], 1, 0)
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        found |= np.einsum("pfk,fk->pf", points[:, None] - a, normal).max(axis=1) < 1e-3
    return found


@pytest.mark.parametrize("body", [trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere(3)])
def test_a_convex_mesh_is_its_own_only_part(body):
    found = convex_parts(mesh_of(body))
    assert (len(found), found.excess, found.missing) == (1, 0.0, 0.0)
    np.testing.assert_array_equal(found.parts[0].faces, body.faces)


def test_parts_are_convex_cover_the_mesh_and_leave_its_notch_free(tmp_path):
    mesh = l_shape()
    found = convex_parts(mesh, cache=tmp_path / "cache")
    for part in found:
        body = trimesh.Trimesh(part.vertices, part.faces, process=False)
        assert body.is_watertight
        assert body.volume == pytest.approx(body.convex_hull.volume, rel=1e-9)
    assert len(found) == 2
    assert found.excess < 0.01
    assert found.missing < 0.01
    assert inside(found, mesh.vertices).all()
    assert not inside(found, np.array([[0.2, 0.05, 0.2]])).any()
    again = convex_parts(mesh, cache=tmp_path / "cache")
    assert (again.excess, again.missing) == (found.excess, found.missing)
    for one, two in zip(found, again, strict=True):
        np.testing.assert_array_equal(one.vertices, two.vertices)
        np.testing.assert_array_equal(one.faces, two.faces)
    assert len(list((tmp_path / "cache").iterdir())) == 1


def test_a_broken_cache_is_made_again(tmp_path):
    found = convex_parts(l_shape(), cache=tmp_path)
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    for broken in (b"", b"nonsense", whole[: len(whole) // 2]):
        file.write_bytes(broken)
        assert len(convex_parts(l_shape(), cache=tmp_path)) == len(found)
        assert file.read_bytes() != broken


def test_the_excess_of_a_coarse_cut_is_what_sticks_out():
    """One part only: the hull, which fills the notch of 0.2 × 0.1 × 0.2 / 2 m³."""
    found = convex_parts(l_shape(), threshold=1.0)
    assert len(found) == 1
    assert found.excess == pytest.approx((0.2 * 0.2 / 2 * 0.1) / (0.5 * 0.01), rel=1e-3)
    assert found.missing == pytest.approx(0, abs=1e-3)


def test_flat_meshes_and_wrong_thresholds_are_refused():
    sheet = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]], np.int32))
    with pytest.raises(InputError, match="flat"):
        convex_parts(sheet)
    with pytest.raises(InputError, match="threshold"):
        convex_parts(l_shape(), threshold=0.0)
