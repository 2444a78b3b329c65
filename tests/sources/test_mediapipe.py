"""MediaPipe's landmarks, from files and live: angles come back from a body of other shares and metres.

``data/mediapipe_astronaut.json`` is what mediapipe 0.10.21 (solutions, model_complexity 1) found in NASA's
portrait of Eileen Collins (public domain; scikit-image's ``data.astronaut``), with hips below the picture.
"""

import json
import socket
import threading
from pathlib import Path

import numpy as np
import pytest

from free_ports import free_port
from human.made_capture import PERSON
from seerob.core.errors import InputError
from seerob.core.samples import Quality
from seerob.core.transforms import rotation_from_rpy, transform
from seerob.description.capture import mapping, observing
from seerob.description.capture.captured import CaptureFrame
from seerob.description.capture.fitting import Fitter, pulls
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import AXES, BONES, bone_poses
from seerob.devices.sources.mediapipe import Mediapipe, remarks
from seerob.devices.sources.mediapipe_recording import MediapipeRecording
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.kinect import BODY_FROM_OPTICAL
from seerob.protocols.tracking.mediapipe import (
    LANDMARKS,
    LAYOUT,
    Result,
    camera_points,
    decode,
    decode_message,
)
from seerob.workstation.workstation import Pose
from sources.listening import heard
from sources.test_captured_files import TARGET

ASTRONAUT = (Path(__file__).parent / "data" / "mediapipe_astronaut.json").read_bytes()
AT = {
    "shoulder": "upper_arm", "elbow": "forearm", "wrist": "hand", "hip": "thigh", "knee": "shank",
    "ankle": "foot", "foot_index": "toes",
}  # fmt: skip
AHEAD = Pose(position=(0.0, 0.0, 0.95), rpy=(0.0, 0.0, np.pi))


BENT = {
    "pelvis_tilt_back": -0.5, "right_hip_flexion": 0.6, "left_hip_flexion": 0.3, "right_knee_extension": -0.4,
    "right_elbow_flexion": 1.5, "left_elbow_flexion": 0.9, "right_shoulder_flexion": 1.0,
    "head_extension": -0.3,
}  # fmt: skip


def landmarks(q, *, scale=1.0, legs=1.0):
    """A person who looks into the camera, as MediaPipe would say it: rows of x, y, z, visibility."""
    R, p = bone_poses(PERSON, q)
    place = {bone: p[k] for k, bone in enumerate(BONES)}
    head = R[BONES.index("head")]
    rows = np.zeros((33, 3))
    for k, name in enumerate(LANDMARKS):
        side, _, part = name.partition("_")
        if part in AT:
            rows[k] = place[f"{side}_{AT[part]}"]
        elif name == "nose":
            rows[k] = place["head"] + head @ [0.105, 0.035, 0.0]
        elif part == "ear":
            rows[k] = place["head"] + head @ [-0.00875, 0.04375, 0.0735 if side == "right" else -0.0735]
        elif part in ("index", "pinky", "thumb"):
            rows[k] = place[f"{side}_hand"] + R[BONES.index(f"{side}_hand")] @ [0.0, -0.08, 0.0]
    middle = (place["left_thigh"] + place["right_thigh"]) / 2
    rows = (rows - middle) * scale
    for side in ("left", "right"):
        hip = rows[LANDMARKS.index(f"{side}_hip")].copy()
        for part in ("knee", "ankle", "heel", "foot_index"):
            k = LANDMARKS.index(f"{side}_{part}")
            rows[k] = hip + legs * (rows[k] - hip)
    # Forward is to the camera: x forward of the camera is minus ours, y likewise.
    camera = rows @ np.diag([-1.0, -1.0, 1.0])
    return np.column_stack([camera @ BODY_FROM_OPTICAL, np.ones(33)])


def said(values, t=0.0, key="pose_world_landmarks", *, many=True):
    marks = [dict(zip(("x", "y", "z", "visibility"), row, strict=True)) for row in values.tolist()]
    return {"timestamp_ms": 1e3 * t, key: [marks] if many else marks}


def bent():
    q = posture(PERSON, "standing").copy()
    for axis, value in BENT.items():
        q[[a.name for a in AXES].index(axis)] = value
    return q


@pytest.mark.parametrize(("scale", "legs"), [(1.0, 1.0), (0.85, 1.12), (1.1, 0.9)])
def test_angles_come_back_from_a_body_of_other_shares(scale, legs):
    q = bent()
    convention, _ = mapping.choose(LAYOUT, "anna", convention="", known=None)
    places = mapping.places(LAYOUT, convention, {}, file="f")
    world = transform(rotation_from_rpy(AHEAD.rpy), AHEAD.position)
    bound = observing.bind(LAYOUT, places, PERSON, convention=convention, world_from_capture=world)
    positions, orientations, confidence = camera_points(landmarks(q, scale=scale, legs=legs)[None])
    frame = CaptureFrame(
        t=0.0, positions=positions[0], orientations=orientations[0], confidence=confidence[0]
    )
    fitter = Fitter(PERSON)
    found, _ = fitter.fit(pulls(bound.points(frame), np.eye(4)), None)
    (was, at), (is_, there) = fitter.bones(q), fitter.bones(found)
    for first, last in [("thigh", "shank"), ("shank", "foot"), ("upper_arm", "forearm"), ("forearm", "hand")]:
        for side in ("left", "right"):
            a, b = (BONES.index(f"{side}_{bone}") for bone in (first, last))
            ways = [p[b] - p[a] for p in (at, there)]
            cosine = ways[0] @ ways[1] / np.linalg.norm(ways[0]) / np.linalg.norm(ways[1])
            assert np.degrees(np.arccos(min(cosine, 1.0))) < 4.0, (side, first)
    for bone in ("thorax", "head"):
        k = BONES.index(bone)
        turn = np.degrees(np.arccos(np.clip((np.trace(was[k].T @ is_[k]) - 1) / 2, -1, 1)))
        assert turn < 4.0, bone


@pytest.mark.parametrize(
    ("key", "many"), [("pose_world_landmarks", True), ("worldLandmarks", True), ("poseWorldLandmarks", False)]
)
def test_each_spelling_is_read(key, many):
    values = landmarks(bent())
    result = decode(json.dumps(said(values, 1.5, key, many=many)))
    np.testing.assert_allclose(result.people[0], values)
    assert result.t == pytest.approx(1.5)
    wrapped = {"timestampMs": 1500, key: {"landmark": said(values, 0, key)[key][0]}}
    np.testing.assert_allclose(decode(json.dumps(wrapped)).people[0], values)
    assert decode(json.dumps({key: []})).people == ()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"pose_landmarks": []}', "landmarks in the picture are no lengths"),
        ("{}", "no pose_world_landmarks"),
        ('{"worldLandmarks": [[{"x": 1}]]}', "1 landmarks, 33 are expected"),
        ('{"worldLandmarks": 3}', "no result"),
        ("[" * 9000, "no result"),
    ],
)
def test_what_is_no_result_says_why(text, why):
    with pytest.raises(ProtocolError, match=why):
        decode(text)


def test_a_real_portrait_shows_the_head_and_no_trunk():
    result = decode(ASTRONAUT)
    positions, orientations, confidence = camera_points(result.people[0][None])
    seen = dict(zip(LAYOUT.names, confidence[0], strict=True))
    assert seen["left_shoulder"] == seen["nose"] == seen["head"] == 1.0
    assert seen["left_hip"] == seen["pelvis"] == seen["thorax"] == seen["left_knee"] == 0.0
    at = dict(zip(LAYOUT.names, positions[0], strict=True))
    # She faces the camera, which looks along x: her left is at its right, her nose is nearer than her ears.
    assert at["left_shoulder"][1] < at["right_shoulder"][1]
    assert at["nose"][0] < at["left_ear"][0]
    assert at["nose"][2] > at["left_shoulder"][2] > at["left_hip"][2]
    assert np.isfinite(orientations[0, LAYOUT.names.index("head")]).all()


def test_a_landmark_without_a_visibility_is_not_seen():
    values = landmarks(bent())
    values[LANDMARKS.index("left_knee"), 3] = np.nan
    _, _, confidence = camera_points(values[None])
    assert np.flatnonzero(confidence[0] == 0).tolist() == [LANDMARKS.index("left_knee")]
    assert any("no visibility" in text for _, text in remarks([Result(t=0.0, people=(values,))]))


def played(tmp_path, name, text, **more):
    (tmp_path / name).write_text(text)
    return MediapipeRecording(human="anna", file=name, **{"at": AHEAD} | more).open(tmp_path, TARGET)


def test_files_of_all_layouts_say_the_same_and_no_place(tmp_path):
    rows = [landmarks(bent()) + 1e-4 * k for k in range(6)]
    results = [said(values, k / 30) for k, values in enumerate(rows)]
    table = ["timestamp_ms,landmark,x,y,z,visibility"]
    table += [
        f"{1e3 * k / 30!r},{name},{','.join(map(repr, row))}"
        for k, values in enumerate(rows)
        for name, row in zip(LANDMARKS, values.tolist(), strict=True)
    ]
    files = {
        "lines.jsonl": "\n".join(map(json.dumps, results)),
        "list.json": json.dumps(results, indent=1),
        "frames.json": json.dumps({"frames": results}),
        "table.csv": "\n".join(table),
    }
    samples = {name: list(played(tmp_path, name, text).samples) for name, text in files.items()}
    first = samples["lines.jsonl"]
    assert len(first) == 6
    assert not first[0].placed
    for own in samples.values():
        for a, b in zip(first, own, strict=True):
            assert a.t == pytest.approx(b.t)
            for p, r in zip(a.points, b.points, strict=True):
                assert (p.name, p.position is None) == (r.name, r.position is None)
                if p.position is not None:
                    np.testing.assert_allclose(p.position, r.position, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda r: r.pop("timestamp_ms"), "frequency"),
        (
            lambda r: r.update(pose_world_landmarks=said(landmarks(bent()) + 0.5)["pose_world_landmarks"]),
            "hips",
        ),
    ],
)
def test_files_without_time_or_lengths_are_refused(tmp_path, change, why):
    results = [said(landmarks(bent()), k / 30) for k in range(4)]
    for result in results:
        change(result)
    text = "\n".join(map(json.dumps, results))
    with pytest.raises(InputError, match=why):
        played(tmp_path, "r.jsonl", text)
    if why == "frequency":
        assert played(tmp_path, "r.jsonl", text, frequency=10.0).duration == pytest.approx(0.3)


def test_of_several_nobody_is_seen(tmp_path):
    one = said(landmarks(bent()))["pose_world_landmarks"]
    results = [{"timestamp_ms": 33 * k, "pose_world_landmarks": one * (2 if k == 3 else 1)} for k in range(6)]
    opened = played(tmp_path, "r.jsonl", "\n".join(map(json.dumps, results)))
    assert any("several persons in 1 pictures" in f.text for f in opened.findings)
    assert [round(sample.t, 3) for sample in opened.samples] == [0.0, 0.033, 0.066, 0.132, 0.165]


def test_live_results_move_the_person_without_a_place_and_a_wrong_one_says_why():
    port = free_port()
    source = Mediapipe(human="anna", name="phone", port=port, at=AHEAD, timeout=1.0)
    values = landmarks(bent())
    over = []

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            for k in range(3000):
                if over:
                    return
                result = said(values + 1e-5 * (k % 5), k / 30)
                link.sendto(json.dumps(result).encode(), ("127.0.0.1", port))
                wait.wait(1 / 30)

    wait, thread = threading.Event(), threading.Thread(target=send)
    thread.start()
    try:
        samples = heard(source, lambda s: len(s) >= 3)
    finally:
        over.append(True)
        thread.join()
    sample = samples[-1]
    assert sample.quality is Quality.GOOD
    assert not sample.placed
    names = {p.name for p in sample.points if p.position is not None}
    assert {"left_wrist", "right_ankle"} <= names
    with pytest.raises(ProtocolError, match="no timestamp_ms"):
        decode_message(json.dumps({"worldLandmarks": []}))
    with pytest.raises(InputError, match="how the camera is turned"):
        Mediapipe(human="anna", port=port).open(Path(), TARGET)
    two = Result(t=0.0, people=(values, values))
    assert any("several persons" in text for _, text in remarks([two]))
