"""A calibration pose gives back how sensors are mounted, and names those that are put on wrongly."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import PERSON

from seerob.core.errors import InputError
from seerob.core.transforms import (
    rotation_from_axis_angle,
    rotation_from_rpy,
    rotation_from_wxyz,
    wxyz_from_rotation,
)
from seerob.description.capture.calibration import POSTURES, CalibrationPose, calibrate
from seerob.description.capture.captured import CaptureFrame, Layout, Seen
from seerob.description.capture.mapping import choose, places
from seerob.description.capture.observing import bind, with_mounts
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses

WORN = ("waist", "chest", "head", "left_hand", "right_hand", "left_foot", "right_foot")
BONE = {"waist": "pelvis", "chest": "thorax"}
RANDOM = np.random.default_rng(0)
MOUNT = {name: rotation_from_axis_angle(RANDOM.normal(size=3), RANDOM.uniform(0, 3)) for name in WORN}
AT = {name: RANDOM.uniform(-0.05, 0.05, 3) for name in WORN}


def worn(q, heading=0.0, shift=(0.0, 0.0, 0.0), noise=0.0, names=WORN, mount=MOUNT, at=AT):
    """A frame of trackers on a person who stands somewhere: bone from tracker is ``mount`` and ``at``."""
    R, p = bone_poses(PERSON, q)
    turn = rotation_from_rpy([0, 0, heading])
    positions, orientations = [], []
    for name in names:
        i = BONES.index(BONE.get(name, name))
        positions.append(turn @ (p[i] + R[i] @ at[name]) + shift + noise * RANDOM.normal(size=3))
        orientations.append(wxyz_from_rotation(turn @ R[i] @ mount[name]))
    return CaptureFrame(t=0.0, positions=np.array(positions), orientations=np.array(orientations))


def trackers(names=WORN, seen=Seen.TRACKERS, convention="trackers"):
    layout = Layout(seen, names, convention)
    chosen, _ = choose(layout, "p")
    return layout, bind(layout, places(layout, chosen, {}, file="x"), PERSON, convention=chosen)


@pytest.mark.parametrize("pose", [CalibrationPose.NPOSE, CalibrationPose.TPOSE])
@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5, np.pi])
def test_mounting_and_heading_come_back(pose, heading):
    layout, observer = trackers()
    frame = worn(
        posture(PERSON, POSTURES[pose]), heading, (2.0, -1.0, 0.1), at=dict.fromkeys(WORN, np.zeros(3))
    )
    found = calibrate([frame] * 5, observer, PERSON, pose, seen=layout.seen, subject="p")
    assert found.heading == pytest.approx(heading, abs=1e-9) or abs(found.heading) == pytest.approx(np.pi)
    for k, row in enumerate(observer.rows):
        mount, at = found.mounts[row.index]
        assert mount == pytest.approx(MOUNT[WORN[k]].T, abs=1e-9)
        assert at == pytest.approx(np.zeros(3), abs=1e-9)


def test_what_is_calibrated_tells_where_bones_are_in_any_other_posture():
    layout, observer = trackers()
    pose = CalibrationPose.NPOSE
    frames = [worn(posture(PERSON, POSTURES[pose]), 0.8, noise=1e-3) for _ in range(60)]
    found = calibrate(frames, observer, PERSON, pose, seen=layout.seen, subject="p")
    mounted = with_mounts(observer, found.mounts)
    q = posture(PERSON, "squatting")
    R, p = bone_poses(PERSON, q)
    for point in mounted.points(worn(q)):
        i = BONES.index(point.bone)
        # Where the person stands and faces is only known from the nominal places of all trackers together.
        assert rotation_from_wxyz(point.wxyz) == pytest.approx(R[i], abs=0.05)
        assert np.subtract(point.position, R[i] @ point.at) == pytest.approx(p[i], abs=0.06)
    assert all(r.moved < 0.005 for r in found.residuals)
    assert any("median" in f.text for f in found.findings)


@pytest.mark.parametrize(
    ("angle", "says"), [(90, "a quarter turn"), (-90, "a quarter turn"), (180, "half a turn")]
)
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_wrong_mounting_is_named_with_its_axis(angle, says, axis):
    layout, observer = trackers(BONES, Seen.SEGMENTS, "seerob")
    mount = {bone: np.eye(3) for bone in BONES}
    unit = np.eye(3)["xyz".index(axis)]
    mount["left_shank"] = rotation_from_axis_angle(unit, np.radians(angle))
    q = posture(PERSON, POSTURES[CalibrationPose.NPOSE])
    frame = worn(q, 0.4, names=BONES, mount=mount, at={bone: np.zeros(3) for bone in BONES})
    found = calibrate([frame], observer, PERSON, CalibrationPose.NPOSE, seen=layout.seen, subject="p")
    warned = [f.text for f in found.findings if f.level == "warning"]
    assert len(warned) == 1
    assert f"left_shank on left_shank is mounted {says} ({abs(angle)}°) about its {axis} axis" in warned[0]
    wrong = next(r for r in found.residuals if r.name == "left_shank")
    assert wrong.turn == pytest.approx(np.radians(abs(angle)))


def test_who_moves_or_wears_a_sensor_elsewhere_is_told():
    layout, observer = trackers()
    q = posture(PERSON, POSTURES[CalibrationPose.NPOSE])
    frames = []
    for k in range(20):
        frame = worn(q)
        frame.positions[WORN.index("right_hand")] += (0.01 * k, 0, 0)
        frame.positions[WORN.index("chest")] += (0, 0, 0.4)
        frames.append(frame)
    found = calibrate(frames, observer, PERSON, CalibrationPose.NPOSE, seen=layout.seen, subject="p")
    warned = " ".join(f.text for f in found.findings if f.level == "warning")
    assert "right_hand moved" in warned
    assert "chest is 0." in warned


def test_one_tracker_does_not_tell_the_heading_and_says_so():
    layout, observer = trackers(("waist",))
    frame = worn(posture(PERSON, POSTURES[CalibrationPose.NPOSE]), 1.0, names=("waist",))
    found = calibrate([frame], observer, PERSON, CalibrationPose.NPOSE, seen=layout.seen, subject="p")
    assert found.findings[0].level == "assumed"
    assert "heading" in found.findings[0].text


def test_an_empty_or_blind_window_is_an_input_error():
    layout, observer = trackers()
    blind = CaptureFrame(t=0.0, positions=np.full((len(WORN), 3), np.nan))
    for frames in ([], [blind]):
        with pytest.raises(InputError, match="window"):
            calibrate(frames, observer, PERSON, CalibrationPose.NPOSE, seen=layout.seen, subject="p")
