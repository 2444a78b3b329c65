"""What typings/mujoco says is what the installed MuJoCo has: fields, enumerations, functions."""

import ast
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco.introspect.functions import FUNCTIONS

from seerob.twin.mujoco_addresses import POSES

STUB = Path(__file__).parents[1] / "typings/mujoco/__init__.pyi"
CLASSES = {c.name: c for c in ast.parse(STUB.read_text()).body if isinstance(c, ast.ClassDef)}
MODEL = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"
)
HAVE = {"MjModel": MODEL, "MjData": mujoco.MjData(MODEL), "MjOption": MODEL.opt, "MjStatistic": MODEL.stat}
FIELDS = [
    (name, field.target.id, ast.unparse(field.annotation))
    for name in HAVE
    for field in CLASSES[name].body
    if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
]


@pytest.mark.parametrize(("owner", "name", "said"), FIELDS, ids=lambda x: x)
def test_a_field_has_the_type_that_is_said(owner, name, said):
    value = getattr(HAVE[owner], name)
    if element := re.fullmatch(r"NDArray\[np\.(\w+)\]", said):
        assert value.dtype == getattr(np, element[1])
    elif said != "Any":
        assert type(value).__name__ == said


@pytest.mark.parametrize("name", [*POSES, "mj_passive"])
def test_what_is_called_by_its_address_takes_a_model_and_its_data(name):
    assert str(FUNCTIONS[name]) == f"void {name}(const mjModel * m, mjData * d)"


def test_torques_of_a_motion_take_what_they_are_given_by_their_address():
    said = str(FUNCTIONS["mj_rne"])
    assert said == "void mj_rne(const mjModel * m, mjData * d, int flg_acc, mjtNum * result)"
    assert mujoco.MJTNUM_BYTES == 8


@pytest.mark.parametrize("name", ["MjSpec", "MjsBody", "MjsGeom", "MjsJoint"])
def test_what_a_specification_is_made_from_has_the_names_that_are_said(name):
    said = [getattr(f, "name", None) or f.target.id for f in CLASSES[name].body]
    assert [n for n in said if not n.startswith("__") and not hasattr(getattr(mujoco, name), n)] == []


@pytest.mark.parametrize("name", [name for name in CLASSES if name.startswith("mjt")])
def test_an_enumeration_has_the_values_that_are_said(name):
    said = {a.targets[0].id: a.value.value for a in CLASSES[name].body}
    assert said == {k: int(v) for k, v in getattr(mujoco, name).__members__.items()}


@pytest.mark.parametrize(
    "said",
    [f for f in ast.parse(STUB.read_text()).body if isinstance(f, ast.FunctionDef)],
    ids=lambda f: f.name,
)
def test_a_function_takes_the_arguments_that_are_said(said):
    signature = getattr(mujoco, said.name).__doc__.split("\n")[0]
    while "[" in signature:
        signature = re.sub(r"\[[^\[\]]*\]", "", signature)
    assert [a.arg for a in said.args.args] == re.findall(r"[(,] ?(\w+):", signature)
