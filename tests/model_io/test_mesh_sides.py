"""Files that contradict themselves about which side is out: whoever is inside is inside all the same."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from made_cell import made, results_at
from seerob.core.shapes import Mesh
from seerob.description.shapes.mesh_bodies import winding_number
from seerob.description.shapes.mesh_mending import sided

PERSON = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
BOX = trimesh.creation.box([6, 6, 6])


def moved(mesh, by):
    other = mesh.copy()
    other.apply_translation(by)
    return other


def turned(mesh, rows=slice(None)):
    faces = np.array(mesh.faces)
    faces[rows] = faces[rows, ::-1]
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def both(*meshes):
    return trimesh.util.concatenate(meshes)


SHELL = both(BOX, turned(trimesh.creation.box([5, 5, 5])))
KNOT = both(turned(BOX), moved(BOX, [0.5, 0, 0]))


@pytest.mark.parametrize(
    ("mesh", "inside", "said"),
    [
        (BOX, [0, 0, 0], ""),
        (turned(BOX), [0, 0, 0], ""),
        (turned(BOX, slice(4)), [0, 0, 0], "4 triangles turned over"),
        (turned(BOX, [0, 3, 5, 7, 8, 9, 11]), [0, 0, 0], "5 triangles turned over"),
        (trimesh.Trimesh(BOX.vertices, [*BOX.faces, *BOX.faces[:, ::-1]], process=False), [0, 0, 0], "twice"),
        (KNOT, [0, 0, 0], "1 of 2 bodies were inside out"),
        (SHELL, [2.75, 0, 0], ""),
    ],
)
def test_what_is_inside_is_inside(mesh, inside, said):
    given = Mesh(np.array(mesh.vertices, float), np.array(mesh.faces, np.int32))
    found, told = sided(given)
    assert abs(winding_number(found, np.array(inside, float))) > 0.9
    assert abs(winding_number(found, np.array([9.0, 0, 0]))) < 0.1
    assert said in told
    assert bool(told) == bool(said)
    if not said:
        assert found is given


def test_a_cavity_and_a_sheet_with_two_sides_stay_what_they_are():
    hollow = Mesh(np.array(SHELL.vertices, float), np.array(SHELL.faces, np.int32))
    assert abs(winding_number(sided(hollow)[0], np.zeros(3))) < 0.1
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    fin = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]], np.int32))
    assert sided(fin) == (fin, "")


def split(faces_of):
    """A box of 6 m as an OBJ file with an object for each list of triangles."""
    lines = ["v {:g} {:g} {:g}".format(*v) for v in BOX.vertices]
    for k, rows in enumerate(faces_of):
        lines += [f"o g{k}", *("f {} {} {}".format(*(BOX.faces[i] + 1)) for i in rows)]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("pieces", [[range(12)], [range(4), range(4, 12)], [[i] for i in range(12)]])
@pytest.mark.parametrize("table", ["parts", "areas"])
def test_who_is_in_a_machine_that_is_split_by_colour_is_not_outside(tmp_path, pieces, table):
    """The person stands more than a metre away from every wall of it."""
    asked = {
        "parts": 'kind = "minimum_distance"\nbetween = ["op", "m"]\nlimit = 0.1\n',
        "areas": 'kind = "safety_area"\narea = "m"\nof = "op"\n',
    }[table]
    text = f'{PERSON}[[{table}]]\nname = "m"\nmesh = "m.obj"\nunits = "m"\n[[safety]]\nname = "S"\n{asked}'
    found = results_at(made(tmp_path, text, {"m.obj": split(pieces)}))["S"]
    assert found.verdict == "exceeded"
    assert found.value <= -1


FIXED = '<link name="base"/><joint name="j" type="revolute"><parent link="base"/><child link="l"/>\
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
HALVES = [range(4), range(4, 12)]


@pytest.mark.parametrize("description", ["one file", "two files", "rounded otherwise", "mjcf"])
def test_who_is_in_a_link_that_is_split_is_not_outside(tmp_path, description):
    """Also where corners of the pieces are rounded differently; and no link is called open then."""
    files = {"m.obj": split(HALVES)}
    if description != "one file":
        files = {f"m{k}.obj": split([rows]) for k, rows in enumerate(HALVES)}
    if description == "rounded otherwise":
        faces = files["m1.obj"].splitlines()[len(BOX.vertices) :]
        corners = ["v {:.7f} {:.7f} {:.7f}".format(*(v * (1 + 1e-7))) for v in BOX.vertices]
        files["m1.obj"] = "\n".join([*corners, *faces])
    if description == "mjcf":
        meshes = "".join(f'<mesh name="g{k}" file="m{k}.obj"/>' for k in range(2))
        geoms = "".join(f'<geom type="mesh" mesh="g{k}"/>' for k in range(2))
        files["arm.xml"] = f"""<mujoco><asset>{meshes}</asset><worldbody><body name="base"><body name="l">
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="j" axis="0 0 1" range="-1 1"/>{geoms}
        </body></body></worldbody></mujoco>"""
    else:
        shown = "".join(
            f'<collision><geometry><mesh filename="{name}"/></geometry></collision>' for name in files
        )
        files["arm.urdf"] = f'<robot name="r">{FIXED}<link name="l">{shown}</link></robot>'
    model = "arm.xml" if description == "mjcf" else "arm.urdf"
    text = f'{PERSON}[[robots]]\nname = "arm"\nmodel = "{model}"\nq = [0]\n'
    text += '[[safety]]\nname = "S"\nkind = "minimum_distance"\nbetween = ["op", "arm"]\nlimit = 0.1\n'
    station = made(tmp_path, text, files)
    found = results_at(station)["S"]
    assert found.verdict == "exceeded"
    assert found.value <= -1
    assert not [f.text for f in station.model.findings if "is open" in f.text]
