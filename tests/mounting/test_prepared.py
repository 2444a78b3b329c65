"""Mesh files made ready once for each content: what is kept is what would be made, never out of date."""

import shutil

import numpy as np
import pytest
import trimesh

from seerob.description import prepared as module
from seerob.description.cad import reading, step
from seerob.description.prepared import prepared
from seerob.description.shapes.glb import glb_y_up
from seerob.description.shapes.shapes import box_mesh


@pytest.fixture(autouse=True)
def fresh():
    module._kept.clear()
    module._held[0] = 0


def same(a, b):
    assert [m.name for m in a.meshes] == [m.name for m in b.meshes]
    for one, other in zip(a.meshes, b.meshes, strict=True):
        assert one.closed == other.closed
        pairs = [(one.mesh, other.mesh), (one.exact, other.exact)]
        pairs += [*zip(one.drawn, other.drawn, strict=True), *zip(one.shown, other.shown, strict=True)]
        for x, y in pairs:
            assert np.array_equal(x.vertices, y.vertices)
            assert np.array_equal(x.faces, y.faces)
            assert x.color == y.color
        assert one.exact.deviation == other.exact.deviation
    assert a.findings == b.findings
    assert a.files == b.files


def test_equal_content_is_read_once_and_another_content_anew(tmp_path):
    file = tmp_path / "a.glb"
    red, blue = (1.0, 0, 0, 1), (0, 0, 1.0, 1)
    file.write_bytes(
        glb_y_up(box_mesh([0, 0, 0], [1, 1, 1], color=red), box_mesh([2, 0, 0], [3, 1, 1], color=blue))
    )
    first = prepared(file)
    assert prepared(file) is first
    (tmp_path / "b").mkdir()
    shutil.copy(file, tmp_path / "b/a.glb")
    assert prepared(tmp_path / "b/a.glb") is first
    file.write_bytes(glb_y_up(box_mesh([0, 0, 0], [1, 1, 2])))
    assert prepared(file).meshes[0].mesh.vertices.max() == 2


def test_what_was_kept_from_the_last_start_is_what_would_be_made(tmp_path):
    file, cache = tmp_path / "a.stl", tmp_path / "cache"
    trimesh.creation.icosphere(3).export(file)
    made = prepared(file, units="mm", up="z", cache=cache)
    (kept,) = cache.iterdir()
    module._kept.clear()
    same(prepared(file, units="mm", up="z", cache=cache), made)
    # Read in another unit it is another thing.
    module._kept.clear()
    assert prepared(file, units="m", up="z", cache=cache).meshes[0].mesh.vertices.max() > 0.5
    for damaged in (b"", b"PK", kept.read_bytes()[:-300]):
        module._kept.clear()
        kept.write_bytes(damaged)
        same(prepared(file, units="mm", up="z", cache=cache), made)


def test_a_file_that_names_others_is_looked_at_each_time(tmp_path):
    file = tmp_path / "a.obj"
    file.write_text("mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for red in (1.0, 0.5):
        (tmp_path / "a.mtl").write_text(f"newmtl m\nKd {red} 0 0\n")
        found = prepared(file, units="m", up="z", cache=tmp_path / "cache")
        assert found.meshes[0].drawn[0].color[0] == pytest.approx(red)


URDF = """<robot name="g"><link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry>
</collision></link></robot>"""


@pytest.mark.parametrize("what", ["opencascade", "usd-core", "mujoco", "tolerance"])
def test_another_version_of_what_reads_it_is_another_entry(tmp_path, monkeypatch, what):
    """A mesh file, which it does not read, stays the same one."""
    (tmp_path / "g.urdf").write_text(URDF)
    trimesh.creation.icosphere(1).export(tmp_path / "a.stl")
    before = prepared(tmp_path / "g.urdf"), prepared(tmp_path / "a.stl", units="m")
    assert prepared(tmp_path / "g.urdf") is before[0]
    if what == "tolerance":
        monkeypatch.setattr(step, "TOLERANCE", 1e-3)
    else:
        asked = step.PACKAGES if what == "opencascade" else (what,)
        real = reading.edition
        monkeypatch.setattr(reading, "edition", lambda *names: "0.1" if names == asked else real(*names))
    assert prepared(tmp_path / "g.urdf") is not before[0]
    assert prepared(tmp_path / "a.stl", units="m") is before[1]
