"""The command: a mesh that a workstation can read as a safety area."""

import re

import numpy as np
import pytest

from made_cell import TWO_R, made, two_r
from seerob.app.commands import swept
from seerob.core.errors import InputError
from seerob.core.shapes import Mesh
from seerob.description.shapes.glb import write_mesh


def options(folder, *more):
    import argparse

    arguments = argparse.ArgumentParser()
    swept.add(arguments)
    return arguments.parse_args([str(folder), *more])


@pytest.mark.parametrize("ending", ["stl", "glb"])
def test_reach_is_written_and_read_as_an_area_in_the_same_place(tmp_path, ending):
    made(tmp_path, TWO_R, {"arm.urdf": two_r()})
    file = tmp_path / f"reach.{ending}"
    assert swept.run(options(tmp_path, "--reach", "--voxel", "0.05", "-o", str(file), "--of", "arm/l1")) == 0
    units = 'units = "m"\n' if ending == "stl" else ""
    area = f'[[areas]]\nname = "reach"\nmesh = "reach.{ending}"\n{units}'
    model = made(tmp_path, TWO_R + area, {"arm.urdf": two_r()}).model
    (body,) = [model.bodies[i] for i in model.select("reach")]
    (solid,) = body.solids
    low, high = solid.mesh.vertices.min(axis=0), solid.mesh.vertices.max(axis=0)
    assert (low < [-1, -1, -0.05]).all()
    assert (low > [-1.2, -1.2, -0.25]).all()
    assert (high > [1, 1, 0.05]).all()
    assert (high < [1.2, 1.2, 0.25]).all()


def test_it_prints_what_the_written_mesh_holds_and_how_much_too_large_the_reach_can_be(tmp_path, capsys):
    made(tmp_path, TWO_R, {"arm.urdf": two_r()})
    file, few = tmp_path / "reach.stl", ("--triangles", "200")
    assert swept.run(options(tmp_path, "--reach", "--voxel", "0.05", "-o", str(file), *few)) == 0
    told = " ".join(capsys.readouterr().out.split())
    held, voxels = (float(re.search(words + r" ([\d.]+) m³", told)[1]) for words in ("holds", "volume"))
    corners = np.fromfile(file, np.dtype("12f4, u2"), offset=84)["f0"].reshape(-1, 4, 3)[:, 1:].astype(float)
    assert held == pytest.approx(np.linalg.det(corners).sum() / 6, rel=1e-3)
    assert held > 1.2 * voxels
    assert 0 < float(re.search(r"at most (\d+) mm, all roundings", told)[1]) < 1000


def test_format_is_refused_before_anything_is_read(tmp_path):
    with pytest.raises(InputError, match=r"\.step cannot be written; end it in \.stl or \.glb"):
        swept.run(options(tmp_path / "nothing", "-o", "a.step"))


def test_nothing_is_half_written(tmp_path):
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]], np.int32))
    (tmp_path / "a.stl").mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        write_mesh(tmp_path / "a.stl", mesh)
    assert [p.name for p in tmp_path.iterdir()] == ["a.stl"]
