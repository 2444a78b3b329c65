"""What stands in a URDF or MJCF file, brought: as large as its description says, and nothing of it lost."""

import tomllib

import numpy as np
import pytest
import trimesh

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.session.station import load

BOX = '<collision><geometry><box size="{0} {0} {0}"/></geometry></collision>'
MOTOR = """<link name="motor"><inertial><origin xyz="0 0 0"/><mass value="0.9"/>
<inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="s" type="fixed"><parent link="base"/><child link="motor"/></joint>"""
GONE = '<visual><geometry><mesh filename="gone.stl"/></geometry></visual>'


def shown(folder, radius):
    trimesh.creation.icosphere(subdivisions=2, radius=radius).export(folder / "ball.stl")
    return '<visual><geometry><mesh filename="ball.stl"/></geometry></visual>'


def imported(folder, text, name="g.urdf"):
    (folder / name).write_text(text)
    assert cli.main(["import", str(folder / name), str(folder / "cell")]) in (Exit.WITHIN, Exit.UNDECIDED)
    return tomllib.loads((folder / "cell/workstation.toml").read_text()), load(folder / "cell").model


def robot(inside, more=""):
    return f'<robot name="g"><link name="base">{inside}</link>{more}</robot>'


def bounds(body):
    vertices = np.vstack([solid.mesh.vertices for solid in body.solids])
    return vertices.min(axis=0), vertices.max(axis=0)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("g.urdf", robot('<collision><geometry><sphere radius="0.2"/></geometry></collision>')),
        (
            "g.xml",
            '<mujoco model="g"><worldbody><body name="b"><geom type="sphere" size="0.2"/></body></worldbody>'
            "</mujoco>",
        ),
    ],
)
def test_a_ball_is_no_smaller_than_it_is(tmp_path, name, text):
    _, model = imported(tmp_path, text, name)
    (solid,) = model.bodies[0].solids
    a, b, c = np.moveaxis(solid.mesh.vertices[solid.mesh.faces], 1, 0)
    normal = np.cross(b - a, c - a)
    distances = np.einsum("ij,ij->i", normal, a) / np.linalg.norm(normal, axis=1)
    assert distances.min() >= 0.2 - 1e-7
    assert distances.max() < 0.2041


def test_what_is_measured_is_not_replaced_by_what_is_shown(tmp_path):
    table, model = imported(tmp_path, robot(shown(tmp_path, 0.1) + BOX.format(0.3)))
    np.testing.assert_allclose(bounds(model.bodies[0]), [[-0.15] * 3, [0.15] * 3], atol=1e-6)
    assert "deviation_mm" not in table["parts"][0]


def test_what_is_shown_outside_of_it_is_its_deviation(tmp_path):
    _, model = imported(tmp_path, robot(shown(tmp_path, 0.15) + BOX.format(0.1)))
    # From the corners of the ball's mesh, some on the axes, to the box.
    assert model.bodies[0].deviation >= 0.0999


def test_one_surface_that_is_shown_and_measured_keeps_its_colors(tmp_path):
    mesh = shown(tmp_path, 0.1)
    painted = mesh.replace("</visual>", '<material name="m"><color rgba="1 0 0 1"/></material></visual>')
    same = painted + mesh.replace("visual", "collision")
    _, model = imported(tmp_path, robot(same))
    assert trimesh.load(tmp_path / "cell/cad/base.glb", force="mesh").visual.material.main_color[0] > 200
    assert model.bodies[0].deviation < 1e-6


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (robot(BOX.format(0.1), MOTOR), "has a mass of 0.9 kg but no shape"),
        (
            robot(BOX.format(0.1) + '<visual><geometry><mesh filename="gone.stl"/></geometry></visual>'),
            "unknown",
        ),
    ],
)
def test_what_no_distance_sees_is_left_out_and_told(tmp_path, text, says):
    table, model = imported(tmp_path, text)
    (row,) = table["left_out"]
    assert says in row["why"]
    assert any(finding.holds == ("*",) for finding in model.findings)
