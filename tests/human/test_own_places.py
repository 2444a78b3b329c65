"""A joint that a device places as it likes is moved to where it belongs, and that is told."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import PERSON, play, source, walking, workstation

from seerob.description.capture.calibration import calibrate
from seerob.description.capture.captured import Captured, CaptureFrame, Layout, Seen
from seerob.description.capture.mapping import conventions, places
from seerob.description.capture.observing import bind, without_unplaced
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.session.station import Station

NAMES = ("RightCollar", "LeftCollar")
LAYOUT_BONES = [b for b in BONES if "toes" not in b]
THEIRS = {
    "pelvis": "Hips", "lumbar": "Chest", "thorax": "Chest2", "neck": "Neck", "head": "Head",
    **{
        f"{side.lower()}_{bone}": f"{side}{name}"
        for side in ("Right", "Left")
        for bone, name in (
            ("clavicle", "Collar"), ("upper_arm", "Shoulder"), ("forearm", "Elbow"), ("hand", "Wrist"),
            ("thigh", "Hip"), ("shank", "Knee"), ("foot", "Ankle"),
        )
    },
}  # fmt: skip
LAYOUT = Layout(Seen.JOINTS, tuple(THEIRS[b] for b in LAYOUT_BONES), "biovision")
SHIFT = {"right_clavicle": (-0.02, 0.03, 0.08), "left_clavicle": (-0.02, 0.03, -0.08)}


def shifted(R, p):
    """Joint centres of a device whose clavicles begin 9 cm from ours, towards the shoulders."""
    out = p.copy()
    for bone, at in SHIFT.items():
        i = BONES.index(bone)
        out[i] += R[i] @ at
    return out[[BONES.index(b) for b in LAYOUT_BONES]]


def frames(seconds=1.0):
    t, q = walking(seconds)
    R, p = bone_poses(PERSON, q)
    return [CaptureFrame(t=s, positions=shifted(R[k], p[k])) for k, s in enumerate(t)]


def test_a_recording_shows_where_the_device_has_its_clavicles():
    recording = Captured(LAYOUT, frames(), 60.0, 60)
    (_, opened), *_ = Station(workstation(source(recording))).sources
    (text,) = (f.text for f in opened.findings if "places as it likes" in f.text)
    assert all(name in text for name in NAMES)
    told = play(source(recording))
    away = [bones[b][0] for *_, bones, _, _ in told[10:] for b in SHIFT if b in bones]
    assert np.median(away) < 0.015


def bound():
    convention = conventions()["biovision"]
    return bind(LAYOUT, places(LAYOUT, convention, {}, file="x"), PERSON, convention=convention)


def test_a_calibration_shows_it_too_and_without_either_it_does_not_count():
    R, p = bone_poses(PERSON, posture(PERSON, "standing"))
    observer = bound()
    window = [CaptureFrame(t=0.0, positions=shifted(R, p))]
    found = calibrate(window, observer, PERSON, "npose", seen=Seen.JOINTS, subject="p")
    assert set(found.places) == set(NAMES)
    for name, bone in zip(NAMES, ("right_clavicle", "left_clavicle"), strict=True):
        assert found.places[name] == pytest.approx(SHIFT[bone], abs=0.02)
    kept, dropped = without_unplaced(observer)
    assert set(dropped) == set(NAMES)
    assert not {row.bone for row in kept.rows} & set(SHIFT)
    assert {row.name for row in observer.rows} - {row.name for row in kept.rows} == set(NAMES)
