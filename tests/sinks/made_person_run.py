"""A small made-up run with a person whom two devices see: bones, joints, errors, scores and distances."""

import math

import numpy as np

from seerob.core.samples import BodyPoint, BodySample, Quality
from seerob.core.snapshot import (
    Aspect,
    CriterionInfo,
    JointInfo,
    MechanismInfo,
    Node,
    Result,
    Row,
    Scene,
    Snapshot,
    Verdict,
)
from seerob.core.transforms import wxyz_from_rotation
from seerob.description.humans import manikin
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses

PERSON = manikin.build(name="op", stature=1.75, mass=75, sex="male")
PERIOD = 0.01
KNEE = JOINTS.index("right_knee_extension")


def scene():
    robot = Node(name="arm/l1", role="robot", owner="arm")
    bones = (Node(name=f"op/{bone}", role="human", owner="op") for bone in BONES)
    return Scene(
        title="A person",
        edition="ISO/TS 15066:2016",
        version="0",
        workstation_hash="0" * 64,
        period=PERIOD,
        nodes=(robot, *bones),
        mechanisms=(
            MechanismInfo(name="arm", role="robot", joints=(JointInfo(name="j1", unit="rad"),)),
            MechanismInfo(
                name="op",
                role="human",
                joints=tuple(JointInfo(name=j, unit="m" if j in _PLACE else "rad") for j in JOINTS),
            ),
        ),
        criteria=(
            CriterionInfo(name="RULA", kind="rula", group="ergonomics", title="", subjects=("op",)),
            CriterionInfo(
                name="distance",
                kind="minimum_distance",
                group="safety",
                title="",
                subjects=("arm", "op"),
                unit="m",
                at_most=False,
                limit=0.5,
            ),
        ),
    )


_PLACE = ("pelvis_x", "pelvis_y", "pelvis_z")


def joints(k):
    q = np.zeros(len(JOINTS))
    q[KNEE] = -0.01 * k
    q[JOINTS.index("pelvis_z")] = 0.02
    return q


def error(k, bone):
    """How far a bone is off at a tick [m]."""
    return 1e-3 * (1 + (k + BONES.index(bone)) % 10)


def distance(k):
    """Least at tick 50."""
    return 0.4 + 0.01 * abs(k - 50)


def score(k):
    """Highest at tick 20."""
    return 7.0 if k == 20 else 3.0


def snapshot(k):
    R, p = bone_poses(PERSON, joints(k))
    poses = np.zeros((1 + len(BONES), 7), "<f4")
    poses[0, 3] = 1
    poses[1:, :3] = p
    poses[1:, 3:] = [wxyz_from_rotation(each) for each in R]
    near = distance(k)
    return Snapshot(
        seq=k,
        t=k * PERIOD,
        poses=poses.tobytes(),
        joints={"arm": (0.1 * k,), "op": tuple(joints(k).tolist())},
        tracking={"arm": 1e-4, "op": 2e-3},
        bones={"op": {b: (error(k, b), None) for b in ("head", "right_hand")}} if k >= 5 else {},
        results=(
            Result(
                name="RULA",
                value=score(k),
                parts=(Result(name="right", value=score(k)),),
                rows=(
                    Row(
                        name="upper arm",
                        side="right",
                        value=2.0,
                        scale=(1, 6),
                        aspects=(Aspect(name="flexion", value=0.3, unit="rad"),),
                    ),
                ),
            ),
            Result(
                name="distance",
                value=near,
                unit="m",
                limit=0.5,
                at_most=False,
                verdict=Verdict.WITHIN if near >= 0.5 else Verdict.EXCEEDED,
                reason="arm/l1 ↔ op/right_hand (Hands and fingers, front, dominant side)",
            ),
        ),
    )


def samples(k):
    """A camera at 1/5 of the ticks; from tick 50 on it sees the head too."""
    if k % 5:
        return ()
    names = ("right_hand", "head") if k >= 50 else ("right_hand",)
    points = tuple(
        BodyPoint(name=n.upper(), bone=n, position=(0.1, -k / 3, 1.0), confidence=0.5) for n in names
    )
    lost = BodyPoint(name="LOST", bone="left_hand")
    return (
        BodySample(
            source="camera op",
            seq=k,
            t=k * PERIOD,
            t_device=1e6 / 7 + k,
            target="op",
            points=(*points, lost),
            quality=Quality.DEGRADED if math.isclose(k, 10) else Quality.GOOD,
        ),
    )
