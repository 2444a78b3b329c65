import numpy as np
import pytest
import trimesh

from seerob.kernels.tree_file import tree_of


@pytest.fixture
def ring():
    mesh = trimesh.creation.annulus(0.2, 0.5, 0.3)
    return np.array(mesh.vertices), np.array(mesh.faces, np.int32)


def same(a, b):
    return a.closed == b.closed and all(
        (getattr(a, key) == getattr(b, key)).all() for key in ("nodes", "links", "triangles", "probes")
    )


def test_a_tree_read_back_is_the_tree_built(ring, tmp_path):
    built = tree_of(*ring)
    assert same(tree_of(*ring, cache=tmp_path / "trees"), built)
    (file,) = (tmp_path / "trees").iterdir()
    written = file.stat().st_mtime_ns
    assert same(tree_of(*ring, cache=tmp_path / "trees"), built)
    assert file.stat().st_mtime_ns == written


@pytest.mark.parametrize("damage", [b"", b"\0" * 64, "cut", "flip"])
def test_a_damaged_file_is_built_anew(ring, tmp_path, damage):
    built = tree_of(*ring, cache=tmp_path)
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    if damage == "cut":
        damage = whole[:-100]
    elif damage == "flip":
        damage = whole[:500] + bytes([whole[500] ^ 1]) + whole[501:]
    file.write_bytes(damage)
    assert same(tree_of(*ring, cache=tmp_path), built)
    assert file.read_bytes() == whole
    assert list(tmp_path.iterdir()) == [file]


def test_another_mesh_is_another_file(ring, tmp_path):
    tree_of(*ring, cache=tmp_path)
    tree_of(ring[0] + 1e-9, ring[1], cache=tmp_path)
    assert len(list(tmp_path.iterdir())) == 2


def test_a_folder_that_cannot_be_written_is_no_error(ring, tmp_path):
    (tmp_path / "file").write_text("")
    assert same(tree_of(*ring, cache=tmp_path / "file" / "trees"), tree_of(*ring))


def test_closed_is_watertight_whatever_the_vertices_are_shared_like(ring):
    vertices, faces = ring
    soup = vertices[faces].reshape(-1, 3), np.arange(3 * len(faces), dtype=np.int32).reshape(-1, 3)
    assert tree_of(vertices, faces).closed
    assert tree_of(*soup).closed
    assert len(tree_of(*soup).probes) == 1
    assert not tree_of(vertices, faces[1:]).closed
    flipped = faces.copy()
    flipped[0] = flipped[0, ::-1]
    assert not tree_of(vertices, flipped).closed
