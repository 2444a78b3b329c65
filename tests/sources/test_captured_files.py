"""Files of captured motion drive the person through the sources, with every option that decides how."""

import json
from math import inf

import numpy as np
import pytest

from seerob.app.emulators.kinect import CAMERA, animated
from seerob.core.samples import Quality
from seerob.core.transforms import wxyz_from_rotation
from seerob.description.humans import keyframes, manikin
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses
from seerob.devices.sources.body_csv import BodyCsv
from seerob.devices.sources.joint_angles import JointAngleFile
from seerob.devices.sources.kinect_recording import KinectRecording
from seerob.devices.sources.trc import Trc
from seerob.files.motion_capture import joint_angles as opensim
from seerob.files.motion_capture import storage, trc
from seerob.protocols.tracking.kinect import JOINTS as KINECT
from seerob.protocols.tracking.kinect import body_object
from seerob.workstation.source import Target
from seerob.workstation.workstation import Pose

PERSON = manikin.build(name="anna", stature=1.75, mass=75, sex="male")
OWN = PERSON.joints()
TARGET = Target(
    name="anna",
    joints=tuple(j.name for j in OWN),
    units=("rad",) * len(OWN),
    lower=tuple(-inf if j.lower is None else j.lower for j in OWN),
    upper=tuple(inf if j.upper is None else j.upper for j in OWN),
    velocity=(None,) * len(OWN),
    description=PERSON,
)
AT = Pose(position=tuple(CAMERA[:3, 3]), wxyz=tuple(wxyz_from_rotation(CAMERA[:3, :3])))


def walk():
    return keyframes.sample(keyframes.read("library:walk", PERSON), PERSON, 30.0)


def test_a_recorded_camera_at_its_place_sees_the_person_in_the_world(tmp_path):
    scene = animated("library:reach")
    frames = []
    for k in range(30):
        (body,) = scene(k / 30).bodies
        rows = body_object(body).joint_positions
        bodies = [{"body_id": 3, "joint_positions": rows}]
        frames.append({"timestamp_usec": k * 33_333, "frame_id": k, "num_bodies": 1, "bodies": bodies})
    (tmp_path / "r.json").write_text(json.dumps({"frames": frames}))
    opened = KinectRecording(human="anna", file="r.json", at=AT).open(tmp_path, TARGET)
    samples = list(opened.samples)
    assert len(samples) == 30
    points = {p.name: p for p in samples[0].points}
    seen = scene(0.0).bodies[0].positions @ CAMERA[:3, :3].T + CAMERA[:3, 3]
    for name in ("HEAD", "ELBOW_LEFT", "ANKLE_RIGHT"):
        np.testing.assert_allclose(points[name].position, seen[KINECT.index(name)], atol=2e-5)
    # Every finding says whom it is about.
    assert all(f.subject for f in opened.findings)


def test_markers_and_tables_say_where_the_joints_are(tmp_path):
    names = ("PELVIS", "HEAD", "ANKLE_LEFT", "ANKLE_RIGHT", "WRIST_LEFT", "ELBOW_LEFT", "KNEE_LEFT", "NECK")
    scene = animated("library:reach")
    t = np.arange(20) / 30
    rows = np.stack([scene(x).bodies[0].positions for x in t]) @ CAMERA[:3, :3].T + CAMERA[:3, 3]
    rows = rows[:, [KINECT.index(n) for n in names]]
    (tmp_path / "r.trc").write_text("".join(trc.written(names, t, rows)))
    head = ";".join(["time [s]", *(f"{n}_{a} [m]" for n in names for a in "xyz")])
    lines = [";".join([f"{x:.6f}", *map(str, row.ravel())]) for x, row in zip(t, rows, strict=True)]
    (tmp_path / "r.csv").write_text("\n".join([head, *lines]))
    for kind, file in ((Trc, "r.trc"), (BodyCsv, "r.csv")):
        opened = kind(human="anna", file=file, convention="azure_kinect").open(tmp_path, TARGET)
        (first, *_) = opened.samples
        points = {p.name: p.position for p in first.points}
        for k, name in enumerate(names):
            np.testing.assert_allclose(points[name], rows[0, k], atol=1e-5)


def test_a_walk_through_opensims_coordinates_is_the_same_walk(tmp_path):
    played = walk()
    rotations, positions = bone_poses(PERSON, played.q)
    values = opensim.from_joints(played.q, positions[:, 0])
    lengths = [opensim.is_length(name) for name in opensim.coordinates()]
    values = np.where(lengths, values, np.degrees(values))
    (tmp_path / "r.mot").write_text("".join(storage.written(opensim.coordinates(), played.t, values)))
    opened = JointAngleFile(human="anna", file="r.mot", floor=False).open(tmp_path, TARGET)
    q = np.array([sample.q for sample in opened.samples])
    found = bone_poses(PERSON, q)
    for bone in ("pelvis", "left_shank", "right_foot"):
        k = BONES.index(bone)
        np.testing.assert_allclose(found[0][:, k], rotations[:, k], atol=1e-5)
        way, wanted = (x[:, k] - x[0, k] for x in (found[1], positions))
        np.testing.assert_allclose(way, wanted, atol=1e-5)


@pytest.mark.parametrize(("floor", "heights"), [(True, [0.0, 0.0]), (False, [0.0, 0.3])])
def test_a_table_says_how_high_the_pelvis_is(tmp_path, floor, heights):
    rows = ["time [s],pelvis_z [m],right_elbow_flexion [deg]", "0,0,10", "1,0.3,10"]
    (tmp_path / "r.csv").write_text("\n".join(rows))
    opened = JointAngleFile(human="anna", file="r.csv", floor=floor).open(tmp_path, TARGET)
    z = JOINTS.index("pelvis_z")
    assert [sample.q[z] for sample in opened.samples] == pytest.approx(heights, abs=1e-6)


def test_what_is_beyond_a_limit_is_put_to_it_and_far_beyond_not_judged(tmp_path):
    rows = ["time [s],right_knee_flexion [deg]", "0,10", "0.1,20", "0.2,175", "0.2,5", "0.3,nan", "0.4,30"]
    (tmp_path / "r.csv").write_text("\n".join(rows))
    opened = JointAngleFile(human="anna", file="r.csv").open(tmp_path, TARGET)
    samples = list(opened.samples)
    knee = JOINTS.index("right_knee_extension")
    assert [s.t for s in samples] == pytest.approx([0, 0.1, 0.2, 0.4])
    assert samples[2].q[knee] == TARGET.lower[knee]
    assert [s.quality for s in samples] == [Quality.GOOD, Quality.GOOD, Quality.DEGRADED, Quality.GOOD]
    told = "\n".join(f.text for f in opened.findings)
    assert "beyond the limit" in told
    assert "2 rows left out" in told
