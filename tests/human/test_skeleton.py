"""Signs, mirror, and forward kinematics against Pinocchio and MuJoCo."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from seerob.core.errors import UnknownName
from seerob.description.description import JointKind
from seerob.description.humans import manikin
from seerob.description.humans.skeleton import AXES, BONES, JOINTS, bone_poses, mirrored, resolve

PERSON = manikin.build(name="p", stature=1.75, mass=75, sex="male")
FORWARD, LEFT, UP = np.eye(3)
RIGHT, DOWN, BACK = -LEFT, -UP, -FORWARD


def posed(**angles: float):
    """Rotations and positions of the bones, by name, with some joints turned [deg]."""
    q = np.zeros(53)
    for name, value in angles.items():
        for place, sign in resolve(name):
            q[place] += sign * math.radians(value)
    rotations, positions = bone_poses(PERSON, q)
    return dict(zip(BONES, rotations, strict=True)), dict(zip(BONES, positions, strict=True))


def along(position, a: str, b: str):
    way = position[b] - position[a]
    return way / np.linalg.norm(way)


def test_zero_is_upright_facing_x_with_isb_axes():
    rotation, position = posed()
    for bone in BONES:
        assert rotation[bone] == pytest.approx(np.stack([FORWARD, UP, RIGHT], axis=1))
    assert position["pelvis"][:2] == pytest.approx([0, 0])
    assert position["right_hand"][1] < 0 < position["left_hand"][1]
    assert along(position, "left_upper_arm", "left_hand") == pytest.approx(DOWN)


# Distal end of a limb after 90° (or 20°) in the named sense; each line is one sign of the ISB table.
@pytest.mark.parametrize(
    ("joint", "axis", "limb", "way"),
    [
        ("right_hip_flexion", "+Z", ("right_thigh", "right_shank"), FORWARD),
        ("left_hip_flexion", "+Z", ("left_thigh", "left_shank"), FORWARD),
        ("right_knee_flexion", "-Z", ("right_shank", "right_foot"), BACK),
        ("right_shoulder_flexion", "+Z", ("right_upper_arm", "right_forearm"), FORWARD),
        ("left_elbow_flexion", "+Z", ("left_forearm", "left_hand"), FORWARD),
        ("right_hip_abduction", "-X", ("right_thigh", "right_shank"), RIGHT),
        ("left_hip_abduction", "+X", ("left_thigh", "left_shank"), LEFT),
        ("right_shoulder_abduction", "-X", ("right_upper_arm", "right_forearm"), RIGHT),
        ("left_shoulder_abduction", "+X", ("left_upper_arm", "left_forearm"), LEFT),
        ("lumbar_flexion", "-Z", ("lumbar", "thorax"), FORWARD),
        ("thorax_flexion", "-Z", ("thorax", "neck"), FORWARD),
        ("neck_flexion", "-Z", ("neck", "head"), FORWARD),
        ("lumbar_bend_right", "+X", ("lumbar", "thorax"), RIGHT),
        ("neck_bend_left", "-X", ("neck", "head"), LEFT),
        ("pelvis_tilt_forward", "-Z", ("pelvis", "lumbar"), FORWARD),
        ("pelvis_list_left", "-X", ("pelvis", "lumbar"), LEFT),
    ],
)
def test_signs_of_limbs(joint, axis, limb, way):
    _, position = posed(**{joint: 90})
    assert along(position, *limb) == pytest.approx(way, abs=1e-12)
    ((place, sign),) = resolve(joint)
    expected = {"X": (1, 0, 0), "Y": (0, 1, 0), "Z": (0, 0, 1)}[axis[1]]
    assert AXES[place].axis == expected
    assert sign == (1 if axis[0] == "+" else -1)


# A direction that is fixed in a bone after a turn of 90°; where limbs have no distal joint.
@pytest.mark.parametrize(
    ("joint", "axis", "bone", "before", "after"),
    [
        ("right_wrist_flexion", "+Z", "right_hand", DOWN, FORWARD),
        ("left_wrist_flexion", "+Z", "left_hand", DOWN, FORWARD),
        ("right_wrist_radial_deviation", "-X", "right_hand", DOWN, RIGHT),
        ("left_wrist_radial_deviation", "+X", "left_hand", DOWN, LEFT),
        ("right_elbow_pronation", "+Y", "right_hand", FORWARD, LEFT),
        ("left_elbow_pronation", "-Y", "left_hand", FORWARD, RIGHT),
        ("right_shoulder_internal_rotation", "+Y", "right_forearm", FORWARD, LEFT),
        ("left_shoulder_internal_rotation", "-Y", "left_forearm", FORWARD, RIGHT),
        ("right_hip_internal_rotation", "+Y", "right_foot", FORWARD, LEFT),
        ("left_hip_internal_rotation", "-Y", "left_foot", FORWARD, RIGHT),
        ("right_knee_internal_rotation", "+Y", "right_foot", FORWARD, LEFT),
        ("right_ankle_internal_rotation", "+Y", "right_foot", FORWARD, LEFT),
        ("right_ankle_dorsiflexion", "+Z", "right_foot", FORWARD, UP),
        ("left_ankle_plantarflexion", "-Z", "left_foot", FORWARD, DOWN),
        ("right_ankle_inversion", "+X", "right_foot", DOWN, LEFT),
        ("left_ankle_inversion", "-X", "left_foot", DOWN, RIGHT),
        ("right_toes_extension", "+Z", "right_toes", FORWARD, UP),
        ("head_flexion", "-Z", "head", UP, FORWARD),
        ("head_turn_left", "+Y", "head", FORWARD, LEFT),
        ("lumbar_turn_right", "-Y", "head", FORWARD, RIGHT),
        ("pelvis_turn_left", "+Y", "head", FORWARD, LEFT),
        ("right_clavicle_protraction", "+Y", "right_clavicle", RIGHT, FORWARD),
        ("left_clavicle_protraction", "-Y", "left_clavicle", LEFT, FORWARD),
        ("right_clavicle_elevation", "-X", "right_clavicle", RIGHT, UP),
        ("left_clavicle_elevation", "+X", "left_clavicle", LEFT, UP),
    ],
)
def test_signs_of_directions(joint, axis, bone, before, after):
    at_zero, _ = posed()
    turned, _ = posed(**{joint: 90})
    assert turned[bone] @ at_zero[bone].T @ before == pytest.approx(after, abs=1e-12)
    ((place, sign),) = resolve(joint)
    assert AXES[place].axis == {"X": (1, 0, 0), "Y": (0, 1, 0), "Z": (0, 0, 1)}[axis[1]]
    assert sign == (1 if axis[0] == "+" else -1)


def test_pelvis_translates_along_the_roots_axes():
    q = np.zeros(53)
    q[:3] = 0.1, 0.2, 0.3
    _, at_zero = bone_poses(PERSON, np.zeros(53))
    _, moved = bone_poses(PERSON, q)
    assert moved - at_zero == pytest.approx(np.tile([0.1, 0.2, 0.3], (21, 1)), abs=1e-14)


def test_both_and_opposite_names():
    assert resolve("both_hip_abduction") == (*resolve("right_hip_abduction"), *resolve("left_hip_abduction"))
    assert resolve("lumbar_flexion") == ((JOINTS.index("lumbar_extension"), -1.0),)
    with pytest.raises(UnknownName, match="right_knee_flexion"):
        resolve("right_knee_flex")


def test_mirror_of_random_postures():
    rng = np.random.default_rng(2)
    q = rng.normal(size=(50, 53))
    rotations, positions = bone_poses(PERSON, q)
    seen, there = bone_poses(PERSON, mirrored(q))
    flip = np.diag([1.0, -1.0, 1.0])  # the root's sagittal plane
    inner = np.diag([1.0, 1.0, -1.0])  # a bone's
    swap = {"right": "left", "left": "right"}
    for i, bone in enumerate(BONES):
        side = bone.split("_")[0]
        j = BONES.index(bone.replace(side, swap[side], 1)) if side in swap else i
        assert there[:, j] == pytest.approx(positions[:, i] @ flip, abs=1e-12)
        assert seen[:, j] == pytest.approx(flip @ rotations[:, i] @ inner, abs=1e-12)
    assert mirrored(mirrored(q)) == pytest.approx(q, abs=0)


def test_batch_is_one_by_one():
    q = np.random.default_rng(3).normal(size=(4, 5, 53))
    rotations, positions = bone_poses(PERSON, q)
    assert rotations.shape == (4, 5, 21, 3, 3)
    one, where = bone_poses(PERSON, q[2, 3])
    assert np.array_equal(rotations[2, 3], one)
    assert np.array_equal(positions[2, 3], where)


def test_shoulder_is_singular_neither_hanging_nor_forward_nor_sideways():
    at = {n: JOINTS.index(n) for n in JOINTS if n.startswith("right_shoulder")}
    flexion, turn, adduction = at.values()

    def freedom(q):
        upper = BONES.index("right_upper_arm")
        base, _ = bone_poses(PERSON, q)
        rows = []
        for place in (flexion, turn, adduction):
            step = q.copy()
            step[place] += 1e-6
            turned, _ = bone_poses(PERSON, step)
            rows.append(Rotation.from_matrix(turned[upper] @ base[upper].T).as_rotvec() / 1e-6)
        return abs(np.linalg.det(rows))

    for angle, place in ((0, flexion), (90, flexion), (-90, adduction), (170, flexion)):
        q = np.zeros(53)
        q[place] = math.radians(angle)
        assert freedom(q) == pytest.approx(1.0, abs=1e-5)
    q = np.zeros(53)
    q[turn] = math.pi / 2
    assert freedom(q) == pytest.approx(0.0, abs=1e-5)


def pinocchio_model():
    model = pin.Model()
    parents = {"root": (0, pin.SE3.Identity())}
    for link in PERSON.links[1:]:
        joint, placement = parents[link.parent]
        placement = placement * pin.SE3(link.parent_from_link)
        for j in link.joints:
            kind = (
                pin.JointModelPrismaticUnaligned
                if j.kind is JointKind.PRISMATIC
                else pin.JointModelRevoluteUnaligned
            )
            joint = model.addJoint(joint, kind(j.axis), placement, j.name)
            placement = pin.SE3.Identity()
        inertial = link.inertial
        model.appendBodyToJoint(
            joint, pin.Inertia(inertial.mass, inertial.com, inertial.inertia), pin.SE3.Identity()
        )
        parents[link.name] = (joint, pin.SE3.Identity())
    return model, {bone: parents[bone][0] for bone in BONES}


def test_forward_kinematics_equals_pinocchio():
    model, joints = pinocchio_model()
    data = model.createData()
    assert list(model.names)[1:] == list(JOINTS)
    for q in np.random.default_rng(4).normal(size=(20, 53)):
        pin.forwardKinematics(model, data, q)
        rotations, positions = bone_poses(PERSON, q)
        for i, bone in enumerate(BONES):
            assert data.oMi[joints[bone]].rotation == pytest.approx(rotations[i], abs=1e-12)
            assert data.oMi[joints[bone]].translation == pytest.approx(positions[i], abs=1e-12)


def test_mujoco_takes_it_and_agrees():
    spec = mujoco.MjSpec()
    bodies = {"root": spec.worldbody}
    for link in PERSON.links[1:]:
        m = link.parent_from_link
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, m[:3, :3].ravel())
        inertial = link.inertial
        i = inertial.inertia
        body = bodies[link.parent].add_body(
            name=link.name,
            pos=m[:3, 3],
            quat=quat,
            mass=inertial.mass,
            ipos=inertial.com,
            fullinertia=[i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]],
            explicitinertial=True,
        )
        for j in link.joints:
            slide = j.kind is JointKind.PRISMATIC
            kind = mujoco.mjtJoint.mjJNT_SLIDE if slide else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(name=j.name, type=kind, axis=j.axis, pos=j.anchor)
        bodies[link.name] = body
    model = spec.compile()
    data = mujoco.MjData(model)
    assert model.nq == 53
    assert model.body_subtreemass[0] == pytest.approx(75, rel=1e-12)
    q = np.random.default_rng(5).normal(size=53)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    rotations, positions = bone_poses(PERSON, q)
    assert data.xpos[1:] == pytest.approx(positions, abs=1e-12)
    assert data.xmat[1:].reshape(-1, 3, 3) == pytest.approx(rotations, abs=1e-12)
    # Same energy for the same motion as Pinocchio: masses and inertias went in as meant.
    other, _ = pinocchio_model()
    speed = np.random.default_rng(6).normal(size=53)
    data.qvel[:] = speed
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    mujoco.mj_forward(model, data)
    energy = pin.computeKineticEnergy(other, other.createData(), q, speed)
    assert data.energy[1] == pytest.approx(energy, rel=1e-9)
