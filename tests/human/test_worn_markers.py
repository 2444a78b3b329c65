"""Markers worn where anatomy has them: what turns with what, and labels that were exchanged."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import PERSON, source

from seerob.description.capture.captured import Captured, CaptureFrame, Layout, Seen
from seerob.description.capture.fit_check import registered
from seerob.description.capture.fitting import Fitter, pulls
from seerob.description.humans.angles import angles
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.devices.capture.options import observer

LANDMARKS = {
    # The epicondyles do not turn with the forearm; the styloids turn with it and do not bend with the hand.
    "ASI": ("pelvis", (0.045, 0.05, 0.07)),
    "PSI": ("pelvis", (-0.065, 0.055, 0.025)),
    "SHO": ("{side}_clavicle", (0.0, 0.03, 0.1)),
    "ELB": ("{side}_upper_arm", (0.0, -0.186, 0.03)),
    "WRA": ("{side}_forearm", (0.0, -0.146, 0.022)),
    "WRB": ("{side}_forearm", (0.0, -0.146, -0.02)),
    "FIN": ("{side}_hand", (-0.01, -0.05, 0.0)),
    "KNE": ("{side}_thigh", (0.0, -0.245, 0.035)),
    "ANK": ("{side}_foot", (0.0, 0.0, 0.022)),
    "TOE": ("{side}_toes", (0.01, 0.015, 0.0)),
}
"""Marker without side → bone that it moves with, and where on the right one, as a share of the stature."""
MIDDLE = {"C7": (-0.045, 0.145, 0.0), "T10": (-0.07, 0.02, 0.0), "CLAV": (0.045, 0.11, 0.0)}
"""On the thorax."""
NAMES = (*MIDDLE, *(f"{s}{name}" for name in LANDMARKS for s in "RL"))
STATURE = 1.75


def markers(q):
    """Where the markers of postures are, shape (n, markers, 3)."""
    R, p = bone_poses(PERSON, q)
    where = [("thorax", at) for at in MIDDLE.values()]
    for bone, (x, y, z) in LANDMARKS.values():
        where += [(bone.format(side=side), (x, y, k * z)) for side, k in (("right", 1), ("left", -1))]
    places = [(BONES.index(bone), STATURE * np.array(at)) for bone, at in where]
    return np.stack([p[:, i] + R[:, i] @ at for i, at in places], axis=1)


def recording(positions, names=NAMES):
    frames = [CaptureFrame(t=k / 10, positions=each) for k, each in enumerate(positions)]
    return Captured(Layout(Seen.MARKERS, names, "markers"), frames, 10.0, len(frames))


def seen_by(recorded):
    return observer(source(recorded), recorded.layout, PERSON, file="made")[0]


def work(pronation, deviation, flexion):
    return posture(
        PERSON,
        {
            "both_elbow_flexion_deg": 70,
            "both_shoulder_flexion_deg": 30,
            "both_elbow_pronation_deg": pronation,
            "both_wrist_ulnar_deviation_deg": deviation,
            "both_wrist_flexion_deg": flexion,
        },
    )


@pytest.mark.parametrize(("pronation", "deviation", "flexion"), [(10, 25, 20), (90, -15, -25), (160, 20, 30)])
def test_elbow_forearm_and_wrist_are_read_apart(pronation, deviation, flexion):
    q = work(pronation, deviation, flexion)[None]
    recorded = recording(markers(q))
    fitter, before = Fitter(PERSON), None
    for _ in range(8):
        seen = pulls(seen_by(recorded).points(recorded.frames[0]), np.eye(4))
        before, _ = fitter.fit(seen, before, since=1.0)
    found, expected = angles(*fitter.bones(before)), angles(*(x[0] for x in bone_poses(PERSON, q)))
    for name in (
        "elbow_flexion",
        "forearm_rotation",
        "wrist_flexion",
        "wrist_deviation",
        "shoulder_rotation",
    ):
        off = np.degrees(getattr(found, name) - getattr(expected, name))
        assert np.abs(off).max() < 3, (name, off)


def told(positions):
    recorded = recording(positions)
    _, findings = registered(recorded, seen_by(recorded), PERSON, np.eye(4), "operator")
    return [f.text for f in findings if f.level == "warning"]


@pytest.mark.parametrize("pair", [("RKNE", "LKNE"), ("RASI", "LASI"), ("RELB", "LELB")])
def test_labels_that_were_exchanged_are_told(pair):
    positions = markers(np.array([work(90 + k, k, -k) for k in range(-10, 10)]))
    assert told(positions) == []
    i, j = map(NAMES.index, pair)
    positions[:, [i, j]] = positions[:, [j, i]]
    (text,) = told(positions)
    assert "exchanged labels" in text
    assert all(name in text for name in pair)
