"""BVH skeletons whose joints are not ours: how they are turned is told by their pose of rest."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pybvh
import pytest
from scipy.spatial.transform import Rotation

from seerob.description.capture.fitting import Fitter, pulls
from seerob.description.capture.following import Following
from seerob.description.humans import manikin
from seerob.description.humans.angles import Angles, angles
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.devices.sources.bvh import Bvh, read
from seerob.workstation.conversion import convert
from seerob.workstation.source import Opened, Target

PERSON = manikin.build(name="op", stature=1.7, mass=70, sex="female")
WORLD = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""File, which looks along z with y up, from our world."""

AS_IT_IS = np.eye(3)
# As in files of the CMU library: hips in front of the root, shoulders behind it, joints of the spine in one
# place, legs spread by 20°. Offsets [cm], y up, looking along z. Joint → parent, offset, bone of ours.
LEG = np.array([np.sin(np.radians(20)), -np.cos(np.radians(20)), 0.0])


def _sides(rows):
    """Rows of both sides."""
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        for name, parent, offset, bone in rows:
            parent = parent.format(side)
            yield (
                f"{side}{name}",
                (parent, np.array(offset) * (sign, 1, 1), bone and f"{side.lower()}_{bone}"),
            )


SKELETON = {
    "Hips": (None, np.zeros(3), "pelvis"),
    "LowerBack": ("Hips", np.zeros(3), None),
    "Spine": ("LowerBack", np.array([0.0, 11.0, -2.0]), "lumbar"),
    "Spine1": ("Spine", np.array([0.0, 11.0, -1.0]), "thorax"),
    "Neck": ("Spine1", np.zeros(3), "neck"),
    "Neck1": ("Neck", np.array([0.0, 10.0, 1.0]), None),
    "Head": ("Neck1", np.array([0.0, 10.0, -2.0]), "head"),
    **dict(
        _sides(
            [
                ("Shoulder", "Spine1", (0, 0, 0), "clavicle"),
                ("Arm", "{}Shoulder", (20, 4, -3), "upper_arm"),
                ("ForeArm", "{}Arm", (27, 0, 0), "forearm"),
                ("Hand", "{}ForeArm", (22, 0, 0), "hand"),
                ("HandThumb1", "{}Hand", (4, 0, 4), None),
                ("UpLeg", "Hips", (11, -9, 6), "thigh"),
                ("Leg", "{}UpLeg", 38 * LEG, "shank"),
                ("Foot", "{}Leg", 43 * LEG, "foot"),
                ("ToeBase", "{}Foot", (0, -4, 12), "toes"),
            ]
        )
    ),
}
ENDS = {"Head": (0, 10, 0), "LeftToeBase": (0, 0, 6), "RightToeBase": (0, 0, 6)}


def _swing(one, other):
    axis = np.cross(one, other)
    size = np.linalg.norm(axis)
    angle = np.arctan2(size, one @ other)
    return Rotation.from_rotvec(axis / size * angle if size > 1e-9 else np.zeros(3))


CROUCHED = Rotation.from_euler("x", -50, degrees=True)


def at_rest(squat):
    """File from bone in the pose of rest: trunk upright, arms as in our T-pose, legs along their joints."""
    T, _ = bone_poses(PERSON, posture(PERSON, "t_pose"))
    found = {}
    for bone in BONES:
        found[bone] = Rotation.from_matrix(WORLD @ T[BONES.index(bone)])
        side, _, part = bone.partition("_")
        if part in ("thigh", "shank"):
            way = LEG * ((1.0 if side == "left" else -1.0), 1, 1)
            found[bone] = _swing(found[bone].apply([0, -1, 0]), way) * found[bone]
        if part == "thigh" and squat:
            found[bone] = CROUCHED * found[bone]
    return found


def written(path, postures, *, thumbs=True, turn=AS_IT_IS, squat=False):
    """The file of a person in postures of ours.

    Args:
        thumbs: Whether the skeleton has any.
        turn: What the skeleton in rest is turned by, so that its axes are not those of the motion.
        squat: Whether nobody stands in the pose of rest.
    """
    names = [n for n in SKELETON if thumbs or "Thumb" not in n]
    R, _ = bone_poses(PERSON, np.stack(postures))
    rest = at_rest(squat)
    turn = Rotation.from_matrix(turn)
    lines = ["HIERARCHY"]

    def joint(name, depth):
        parent, offset, _ = SKELETON[name]
        if squat and name.endswith("Leg") and not name.endswith("UpLeg"):
            offset = CROUCHED.apply(offset)
        lines.extend([f"{'JOINT' if parent else 'ROOT'} {name}", "{"])
        lines.append("OFFSET " + " ".join(f"{x:.6f}" for x in turn.apply(offset)))
        lines.append(
            ("CHANNELS 3" if parent else "CHANNELS 6 Xposition Yposition Zposition")
            + " Zrotation Yrotation Xrotation"
        )
        children = [n for n in names if SKELETON[n][0] == name]
        for child in children:
            joint(child, depth + 1)
        if not children:
            end = turn.apply(ENDS.get(name, (5, 0, 0)))
            lines.extend(["End Site", "{", "OFFSET " + " ".join(f"{x:.6f}" for x in end), "}"])
        lines.append("}")
        return order.append(name)

    order: list[str] = []

    def depth_first(name):
        yield name
        for child in (n for n in names if SKELETON[n][0] == name):
            yield from depth_first(child)

    joint("Hips", 0)
    lines += ["MOTION", f"Frames: {len(R)}", "Frame Time: 0.0333333"]
    for rotations in R:
        world = {}
        row = ["10.0", "95.0", "-20.0"]
        for name in depth_first("Hips"):
            parent, _, bone = SKELETON[name]
            if bone is None:
                world[name] = world[parent]
            else:
                now = Rotation.from_matrix(WORLD @ rotations[BONES.index(bone)])
                world[name] = now * rest[bone].inv() * turn.inv()
            local = world[name] if parent is None else world[parent].inv() * world[name]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # that of a quarter turn several angles are the same turn
                row += [f"{x:.6f}" for x in local.as_euler("ZYX", degrees=True)]
        lines.append(" ".join(row))
    path.write_text("\n".join(lines) + "\n")
    return path


POSTURES = [
    posture(PERSON, "t_pose"),
    posture(PERSON, "standing"),
    posture(PERSON, {"lumbar_flexion_deg": 30.0, "thorax_flexion_deg": 15.0, "neck_flexion_deg": 10.0}),
    posture(PERSON, {"right_shoulder_flexion_deg": 60.0, "right_elbow_flexion_deg": 80.0}),
]


def followed(path: Path, **options) -> tuple[list[Angles], Opened]:
    source = Bvh(human="op", file=path.name, unit="cm", **options)
    opened = source.open(path.parent, Target(description=PERSON))
    fitter = Fitter(PERSON)
    found = []
    for sample in opened.samples:
        q, _ = fitter.fit(pulls([p for p in sample.points if p.position or p.wxyz], np.eye(4)), None)
        found.append(angles(*fitter.bones(q)))
    return found, opened


ASKED = [
    *("trunk_flexion", "trunk_side_bend", "neck_flexion", "neck_side_bend", "neck_twist", "trunk_twist"),
    *("shoulder_elevation", "elbow_flexion", "knee_flexion"),
]


@pytest.mark.parametrize(
    "turn", [AS_IT_IS, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 1, 0], [1, 0, 0], [0, 0, -1]]]
)
def test_postures_are_those_of_the_person_wherever_the_skeleton_has_its_joints(tmp_path, turn):
    path = written(tmp_path / "x.bvh", POSTURES, turn=np.array(turn, float))
    found, opened = followed(path)
    for ours, q in zip(found, POSTURES, strict=True):
        truth = angles(*bone_poses(PERSON, q))
        for name in ASKED:
            off = np.degrees(np.abs(getattr(ours, name) - getattr(truth, name))).max()
            assert off < 3.0, (name, getattr(ours, name), getattr(truth, name))
    upright = np.degrees([found[0].trunk_flexion, found[1].trunk_flexion])
    assert np.abs(upright).max() < 1.0
    assert any("segments are turned against the pose of rest" in f.text for f in opened.findings)


def test_only_a_thumb_tells_how_the_palm_is_turned(tmp_path):
    path = written(tmp_path / "x.bvh", POSTURES)
    assert pybvh.read_bvh_file(str(path)).frame_count == len(POSTURES)  # a foreign reader takes it
    _, opened = followed(path)
    assert all(p.rolled for p in next(iter(opened.samples)).points)
    _, opened = followed(written(tmp_path / "y.bvh", POSTURES, thumbs=False))
    unrolled = {p.bone for p in next(iter(opened.samples)).points if not p.rolled}
    assert unrolled == {f"{side}_{bone}" for side in ("right", "left") for bone in ("forearm", "hand")}
    assert any("no thumb shows how palms are turned" in f.text for f in opened.findings)


def test_nobody_stands_in_the_pose_of_rest(tmp_path):
    _, opened = followed(written(tmp_path / "x.bvh", POSTURES, squat=True))
    (said,) = (f for f in opened.findings if "pose of rest" in f.text)
    assert said.level == "warning"
    assert "thigh does not hang" in said.text
    sample = next(iter(opened.samples))
    assert all(p.wxyz is None for p in sample.points)
    assert _untold(sample) == {
        "trunk_flexion",
        "neck_flexion",
        "shoulder_flexion",
        "shoulder_elevation",
    }
    assert any("flexion of trunk, neck and upper arms is not assessed" in f.text for f in opened.findings)


def test_where_nobody_stands_an_accuracy_or_calibration_lets_judge(tmp_path):
    path = written(tmp_path / "x.bvh", [POSTURES[0]] * 40, squat=True)
    for options in (
        {"accuracy": 0.4},
        {"calibration": {"pose": "tpose", "start": 0.0, "duration": 0.5}},
    ):
        source = convert(
            {"human": "op", "file": path.name, "unit": "cm"} | options, Bvh, file="", key="", problems=[]
        )
        sample = next(iter(source.open(path.parent, Target(description=PERSON)).samples))
        assert sample.upright
        assert "trunk_flexion" not in _untold(sample)


def _untold(sample):
    """Angles of somebody followed that are not told because joints of the trunk may be anywhere."""
    following = Following(PERSON, np.eye(4))
    following.hear(sample)
    (found,) = list(following.until(sample.t))[-1:]
    leaning = {"trunk_flexion", "neck_flexion", "shoulder_flexion", "shoulder_elevation"}
    return {name for name, _ in found.undetermined} & leaning


def test_joints_that_shift_tell_nothing_by_how_they_turn(tmp_path):
    path = written(tmp_path / "x.bvh", POSTURES)
    assert read(path).rest is not None
    text = path.read_text().replace(
        "CHANNELS 3 Zrotation Yrotation Xrotation",
        "CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation",
        1,
    )
    head, _, rows = text.partition("Frame Time: 0.0333333\n")
    moved = [" ".join([*w[:6], "9.0", "3.0", "0.0", *w[6:]]) for w in map(str.split, rows.splitlines())]
    path.write_text(f"{head}Frame Time: 0.0333333\n" + "\n".join(moved) + "\n")
    assert read(path).rest is None
