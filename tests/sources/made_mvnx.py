"""Writes MVNX as MVN does, from our digital human; the joint angles by scipy, from the bones themselves."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from seerob.app.emulation.mvn_person import segments
from seerob.description.humans import manikin
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses
from seerob.protocols.tracking.mvn_pose import JOINTS as MVN_JOINTS
from seerob.protocols.tracking.mvn_pose import SEGMENTS

PERSON = manikin.build(name="op", stature=1.8, mass=80, sex="male")
BONE = dict(zip(("Pelvis", "L3", "T8", "Neck", "Head"), BONES[:5], strict=True)) | {
    f"{side}{theirs}": f"{side.lower()}_{ours}"
    for side in ("Right", "Left")
    for theirs, ours in (
        ("Shoulder", "clavicle"),
        ("UpperArm", "upper_arm"),
        ("ForeArm", "forearm"),
        ("Hand", "hand"),
        ("UpperLeg", "thigh"),
        ("LowerLeg", "shank"),
        ("Foot", "foot"),
        ("Toe", "toes"),
    )
}
BONE |= {"L5": "lumbar", "T12": "thorax"}


def moving(count, seed=0):
    """Postures of somebody who moves every joint, well within its range, shape (count, 53)."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 2 * np.pi, count)[:, None]
    joints = PERSON.joints()
    low = np.array([-0.5 if j.lower is None else j.lower for j in joints])
    high = np.array([0.5 if j.upper is None else j.upper for j in joints])
    middle, width = (low + high) / 2, 0.3 * (high - low)
    q = middle + width * np.sin(t + rng.uniform(0, 6, len(joints)))
    q[:, JOINTS.index("pelvis_z")] = 0.0
    return q


def angles(q):
    """Joint angles as Xsens gives them [deg], shape (n, 22, 3): ZXY of the ISB bones, clinical signs."""
    R, _ = bone_poses(PERSON, q)
    found = []
    for label, parent, child in MVN_JOINTS:
        a, b = (BONES.index(BONE[s]) for s in (parent, child))
        relative = np.swapaxes(R[:, a], 1, 2) @ R[:, b]
        z, x, y = Rotation.from_matrix(relative).as_euler("ZXY", degrees=True).T
        right, left = label.startswith("jRight"), label.startswith("jLeft")
        bends_back = "Knee" in label or not (right or left)
        found.append(np.stack([-x if right else x, -y if left else y, -z if bends_back else z], axis=1))
    return np.stack(found, axis=1)


def text(values):
    return " ".join(f"{x:.6f}" for x in np.ravel(values))


def quaternions(rotations):
    shape = rotations.shape[:-2]
    return Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(scalar_first=True).reshape(*shape, 4)


Q = moving(40)


def isb_in_tpose():
    """Our bones in the T-pose, in axes with x forward, y left and z up."""
    R, _ = bone_poses(PERSON, posture(PERSON, "t_pose"))
    upright = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    return np.stack([R[BONES.index(BONE[s])] for s in SEGMENTS]) @ upright.T


def made(
    path,
    q,
    *,
    rate=60,
    version=4,
    units=1.0,
    configuration="FullBody",
    sensors=None,
    special=True,
    turned=None,
    change=lambda frames: frames,
    extra="",
):
    """Writes a file.

    Args:
        turned: How each segment of the file is turned on the ideal one, (23, 3, 3).
        change: Last thing done to the list of frames, each as text.
    """
    positions, rotations = segments(PERSON, q)
    turned = np.broadcast_to(np.eye(3), (23, 3, 3)) if turned is None else turned
    theirs = rotations @ turned
    found = angles(q)
    rest, straight = segments(PERSON, posture(PERSON, "t_pose"))

    def frame(kind, p, w, number="", more=""):
        time = round(1000 * number / rate) if kind == "normal" else 0
        return (
            f'<frame time="{time}" index="{number}" tc="" ms="0" type="{kind}">'
            f"<orientation>{text(w)}</orientation><position>{text(units * p)}</position>{more}</frame>"
        )

    frames = []
    if special:
        frames = [
            frame("identity", rest, quaternions(straight)),
            frame("tpose", rest, quaternions(straight @ turned)),
            frame("tpose-isb", rest, quaternions(isb_in_tpose())),
        ]
    w = quaternions(theirs)
    for k in range(len(q)):
        more = f"<jointAngle>{text(found[k])}</jointAngle><centerOfMass>0 0 0</centerOfMass>"
        frames.append(frame("normal", positions[k], w[k], k, more))
    names = SEGMENTS if sensors is None else sensors
    head = "".join(
        f'<segment label="{s}" id="{k + 1}"><points><point label="p"><pos_b>0 0 0</pos_b></point>'
        "</points></segment>"
        for k, s in enumerate(SEGMENTS)
    )
    joints = "".join(
        f'<joint label="{j}"><connector1>{p}/{j}</connector1><connector2>{c}/{j}</connector2></joint>'
        for j, p, c in MVN_JOINTS
    )
    worn = "".join(f'<sensor label="{s}"/>' for s in names)
    space = ' xmlns="http://www.xsens.com/mvn/mvnx"' if version == 4 else ""
    path.write_text(
        f'<?xml version="1.0" encoding="UTF-8"?>\n{extra}'
        f'<mvnx{space} version="{version}"><mvn version="2024.0"/>'
        f'<subject label="Anna" frameRate="{rate}" segmentCount="23" configuration="{configuration}">'
        f"<segments>{head}</segments><sensors>{worn}</sensors>"
        f"<joints>{joints}</joints>"
        f"<frames segmentCount='23' sensorCount='17' jointCount='22'>{''.join(change(frames))}</frames>"
        "</subject></mvnx>",
        encoding="utf-8",
    )
    return path
