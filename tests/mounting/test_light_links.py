"""Links that physics allows and MuJoCo refuses: points, needles and specks; none weighs less for it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import seerob as sr
from made_cell import results_at
from seerob.core.errors import InputError

ARM = """<robot name="a"><link name="base">{base}</link>
<link name="l">{moving}<collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision></link>
<link name="f">{fixed}</link>
<joint name="j" type="continuous"><parent link="base"/><child link="l"/><axis xyz="0 0 1"/></joint>
<joint name="k" type="fixed"><parent link="l"/><child link="f"/></joint></robot>"""
STATION = '[[robots]]\nname = "r"\nmodel = "{}"\n[[safety]]\nkind = "kinetic_energy"\nrobot = "r"\n'
BODY = """<mujoco><worldbody><body name="base"><geom type="sphere" size="0.1"/><body name="l">
<joint name="j"/><inertial pos="0 0 0" mass="1" diaginertia="{}"/></body></body></worldbody></mujoco>"""


def inertial(mass, moments, x=0.2):
    a, b, c = moments
    return (
        f'<inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="{a}" iyy="{b}" izz="{c}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


GOOD = inertial(1, (0.01, 0.01, 0.01), 0)


def loaded(folder, text, name="a.urdf"):
    (folder / name).write_text(text)
    (folder / "workstation.toml").write_text(STATION.format(name))
    return sr.load(folder)


@pytest.mark.parametrize("mass", [1e-20, 1e-9, 2.0])
@pytest.mark.parametrize(
    "moments",
    [(0, 0, 0), (1e-18,) * 3, (5e-324,) * 3, (1e-14, 2e-14, 2.5e-14), (3e-15,) * 3, (1e-6, 1e-6, 0)],
)
@pytest.mark.parametrize("where", ["fixed", "base"])
def test_a_link_that_hardly_turns_is_taken_with_its_whole_mass(tmp_path, mass, moments, where):
    links = {"base": "", "moving": GOOD, "fixed": ""} | {where: inertial(mass, moments)}
    station = loaded(tmp_path, ARM.format(**links))
    mj = station.model.mj
    assert mj.body(f"r/{'f' if where == 'fixed' else 'base'}").mass[0] == mass
    data, torque = mujoco.MjData(mj), np.zeros(1)
    mujoco.mj_forward(mj, data)
    mujoco.mj_mulM(mj, data, torque, np.ones(1))
    exact = 0.01 + (mass * 0.2**2 + moments[2] if where == "fixed" else 0)
    assert exact <= torque[0] * (1 + 1e-12) <= exact * (1 + 2e-12) + 4e-6 * max(moments) + 3e-15


@pytest.mark.parametrize("moments", [(0, 0, 0), (1e-18,) * 3])
def test_of_a_link_with_a_shape_that_hardly_turns_mass_and_inertia_are_unknown(tmp_path, moments):
    station = loaded(tmp_path, ARM.format(base="", moving=inertial(1, moments, 0), fixed=""))
    assert any(
        "mass 1 kg with an inertia of" in f.text and "r/l" in f.subject for f in station.model.findings
    )
    (result,) = results_at(station, r=([0.0], [1.0])).values()
    assert result.verdict is sr.Verdict.UNDECIDED


@pytest.mark.parametrize("moments", ["0 0 0", "1e-18 1e-18 1e-18", "1e-2 1e-2 3e-2"])
def test_what_mujoco_refuses_in_its_own_format_is_told_with_file_body_and_remedy(tmp_path, moments):
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, BODY.format(moments), "a.xml")
    (problem,) = caught.value.problems
    assert problem.file == "a.xml"
    assert "element 'l'" in problem.key
    assert "greater than 0" in problem.remedy
