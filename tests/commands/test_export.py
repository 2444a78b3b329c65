"""``seerob export``: other programs read the cell as it is, and importing it gives the same cell again."""

import shutil
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import trimesh

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.session.station import load

ROOT = Path(__file__).parents[2]
ADDED = """
[[machines]]
name = "door"
shape = { box = [0.05, 1.0, 2.0] }
at = { position = [-1.6, 0.5, 1.0], rpy_deg = [0, 90, 30] }
mass = 31.5
slide = { along = [0, -1, 0], lower = 0.0, upper = 1.0 }

[[tools]]
name = "gripper"
model = "library:robotiq_2f_85"
on = "ur5e/tool0"
tcp = { position = [0, 0, 0.13] }
"""


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    folder = tmp_path_factory.mktemp("export") / "cell"
    shutil.copytree(ROOT / "workstations/imported_line", folder)
    file = folder / "workstation.toml"
    text = file.read_text().replace(
        'model = "library:ur5e"', 'model = "library:ur5e"\nq = [0.1, -1.2, 1, -1.6, 1.5, 0.3]'
    )
    file.write_text(text + ADDED)
    model = load(folder).model
    data = mujoco.MjData(model.mj)
    for mechanism in model.mechanisms.values():
        data.qpos[mechanism.q_address] = mechanism.coupling @ mechanism.home + mechanism.offset
    mujoco.mj_kinematics(model.mj, data)
    return folder, model, data


def places(model, data):
    """Pose of each body that is exported, by name."""
    return {
        body.name: (data.xpos[body.mj].copy(), data.xmat[body.mj].reshape(3, 3).copy())
        for body in model.bodies
        if body.role not in ("human", "area")
    }


def exported(folder, kind, tmp_path):
    assert cli.main(["export", str(folder), "--to", kind, "-o", str(tmp_path / "out")]) == Exit.WITHIN
    return next(p for p in (tmp_path / "out").iterdir() if p.is_file())


@pytest.mark.parametrize("kind", ["mjcf", "urdf", "usd", "glb"])
def test_import_of_what_was_exported_is_the_same_cell(cell, tmp_path, kind):
    folder, model, data = cell
    if kind == "usd":
        pytest.importorskip("pxr")
    file = exported(folder, kind, tmp_path)
    assert cli.main(["import", str(file), str(tmp_path / "again")]) == Exit.WITHIN
    again = load(tmp_path / "again").model
    there = mujoco.MjData(again.mj)
    q = {
        f"{m.name}/{j.name}": v
        for m in model.mechanisms.values()
        for j, v in zip(m.joints, m.home, strict=True)
    }
    for mechanism in again.mechanisms.values():
        home = [q.get(f"{mechanism.name}/{joint.name}", 0.0) for joint in mechanism.joints]
        if kind == "usd":  # the scene shows it
            assert mechanism.home == pytest.approx(home, abs=1e-6)
            home = mechanism.home
        there.qpos[mechanism.q_address] = mechanism.coupling @ home + mechanism.offset
    mujoco.mj_kinematics(again.mj, there)
    found, wanted = places(again, there), places(model, data)
    if kind != "glb":  # what a robot carries is a link of it in the other formats
        wanted["ur5e/gripper"] = wanted.pop("gripper")
    assert set(found) == set(wanted)
    for name, (position, rotation) in wanted.items():
        assert found[name][0] == pytest.approx(position, abs=1e-9), name
        assert found[name][1] == pytest.approx(rotation, abs=1e-9), name
    if kind == "glb":
        return
    assert set(again.mechanisms) == {"ur5e", "door"}
    masses = {name: link.mass.value for name, link in _masses(model).items()}
    assert masses
    masses["ur5e/gripper"] = masses.pop("gripper")
    for name, mass in masses.items():
        assert _masses(again)[name].mass.value == pytest.approx(mass, rel=1e-6), name
    robot, twin = model.mechanisms["ur5e"], again.mechanisms["ur5e"]
    assert twin.lower == pytest.approx(robot.lower, abs=1e-6)
    assert twin.upper == pytest.approx(robot.upper, abs=1e-6)


def _masses(model):
    return {b.name: b for b in model.bodies if b.mass is not None and b.role in ("robot", "tool", "machine")}


@pytest.mark.parametrize("kind", ["mjcf", "urdf"])
def test_mujoco_itself_reads_places_and_masses(cell, tmp_path, kind):
    folder, model, data = cell
    theirs = mujoco.MjModel.from_xml_path(str(exported(folder, kind, tmp_path)))
    there = mujoco.MjData(theirs)
    for mechanism in model.mechanisms.values():
        if mechanism.role != "human":
            for joint, q in zip(mechanism.joints, mechanism.home, strict=True):
                there.joint(f"{mechanism.name}/{joint.name}").qpos[0] = q
    if kind == "mjcf":
        assert theirs.key("home").qpos == pytest.approx(there.qpos)
    mujoco.mj_kinematics(theirs, there)
    for name, (position, rotation) in places(model, data).items():
        assert there.body(name).xpos == pytest.approx(position, abs=1e-9), name
        assert there.body(name).xmat.reshape(3, 3) == pytest.approx(rotation, abs=1e-9), name
    for name, body in _masses(model).items():
        assert theirs.body(name).mass[0] == pytest.approx(body.mass.value)
    assert theirs.body("line/post").mass[0] == pytest.approx(np.pi * 0.04**2 * 0.9 * 7850, rel=0.02)
    low, high = theirs.joint("ur5e/elbow_joint").range
    elbow = next(j for j in model.mechanisms["ur5e"].joints if j.name == "elbow_joint")
    assert (low, high) == pytest.approx((elbow.lower, elbow.upper))


def test_pinocchio_reads_places_and_masses_of_the_urdf(cell, tmp_path):
    folder, model, data = cell
    theirs = pin.buildModelFromUrdf(str(exported(folder, "urdf", tmp_path)))
    q = pin.neutral(theirs)
    for mechanism in model.mechanisms.values():
        for joint, home in zip(mechanism.joints, mechanism.home, strict=True):
            if mechanism.role == "human":
                continue
            number = theirs.getJointId(f"{mechanism.name}/{joint.name}")
            at = theirs.joints[number].idx_q
            q[at : at + theirs.joints[number].nq] = home
    there = theirs.createData()
    pin.framesForwardKinematics(theirs, there, q)
    for name, (position, rotation) in places(model, data).items():
        pose = there.oMf[theirs.getFrameId(name)]
        assert pose.translation == pytest.approx(position, abs=1e-9), name
        assert pose.rotation == pytest.approx(rotation, abs=1e-9), name
    moving = [b for b in _masses(model).values() if theirs.frames[theirs.getFrameId(b.name)].parentJoint]
    assert pin.computeTotalMass(theirs) == pytest.approx(sum(b.mass.value for b in moving))
    assert len(moving) == 8  # six links, the gripper and the door


def test_openusd_and_trimesh_find_what_is_there_where_it_is(cell, tmp_path):
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdPhysics

    folder, model, data = cell
    stage = Usd.Stage.Open(str(exported(folder, "usd", tmp_path)))
    cache = UsdGeom.XformCache()
    found = {}
    for prim in stage.Traverse():
        if prim.HasAPI(UsdPhysics.RigidBodyAPI) or str(Usd.ModelAPI(prim).GetKind()) == "component":
            names, above = [], prim
            while above.GetPath() != stage.GetDefaultPrim().GetPath():
                names.append(above.GetDisplayName())
                above = above.GetParent()
            found["/".join(names[::-1])] = np.array(cache.GetLocalToWorldTransform(prim)).T
    for name, (position, rotation) in places(model, data).items():
        assert found[name][:3, 3] == pytest.approx(position, abs=1e-9), name
        assert found[name][:3, :3] == pytest.approx(rotation, abs=1e-9), name
    roots = [p for p in stage.Traverse() if p.HasAPI(UsdPhysics.ArticulationRootAPI)]
    assert [p.GetParent().GetName() for p in roots] == ["ur5e"]
    scene = trimesh.load(exported(folder, "glb", tmp_path / "b"))
    y_up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    low, high = scene.bounds
    drawn = [scene.graph.get(name)[0] for name in scene.graph.nodes_geometry]
    assert len(drawn) >= len(places(model, data))
    assert low[1] == pytest.approx(0, abs=1e-6)
    assert any(np.allclose(t[:3, 3], y_up @ data.body("line/post").xpos, atol=1e-9) for t in drawn)
    assert high[1] > 1


def test_what_is_there_is_not_overwritten(cell, tmp_path, capsys):
    folder, _, _ = cell
    (tmp_path / "out").mkdir()
    assert cli.main(["export", str(folder), "--to", "glb", "-o", str(tmp_path / "out")]) == Exit.ERROR
    assert "exists already" in capsys.readouterr().err
