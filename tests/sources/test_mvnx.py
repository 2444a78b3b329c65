"""MVNX files that MVN could have written: angles, calibration, losses, and files that are broken."""

from __future__ import annotations

import random
import re

import numpy as np
import pytest
from made_mvnx import PERSON, Q, angles, made, moving, segments
from scipy.spatial.transform import Rotation

from seerob.core.errors import InputError
from seerob.description.capture.captured import Seen
from seerob.devices.capture.xsens import ISB_TPOSE, anatomical, differences, joint_angles, turns
from seerob.devices.sources import mvnx
from seerob.devices.sources import mvnx as _mvnx_stream
from seerob.devices.sources.mvnx import lengths, read
from seerob.protocols.tracking.mvn_pose import JOINTS, SEGMENTS

CLEAR = np.abs(angles(Q)[..., 0]) < 85
"""Away from the singular pose, where two of three angles are anything, shape (40, 22)."""


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return made(tmp_path_factory.mktemp("mvnx") / "anna.mvnx", Q)


def told(captured):
    return "\n".join(f"{f.level}: {f.text}" for f in captured.findings)


def orientations(captured):
    return np.stack([frame.orientations for frame in captured.frames])


def apart(a, b):
    """Angle between two rotations of each row [rad]."""
    return 2 * np.arccos(np.clip(np.abs(np.einsum("...i,...i->...", a, b)), 0, 1))


# -- angles --------------------------------------------------------------------------------------


def test_joint_angles_are_recovered_from_the_segments_to_a_tenth_of_a_degree(file):
    found = np.degrees(joint_angles(anatomical(orientations(read(file)))))
    off = (found - angles(Q) + 180) % 360 - 180
    assert CLEAR.mean() > 0.9
    assert np.abs(off[CLEAR]).max() < 0.1
    assert np.abs(off[CLEAR]).max() < 1e-3  # the rounding of the file, no more


def test_in_every_pose_the_turns_are_recovered(file):
    off = differences(anatomical(orientations(read(file))), np.radians(angles(Q)))
    assert np.degrees(off.max()) < 0.1


def test_turns_are_those_of_scipy():
    """A spine's are Z, X, Y with the flexion's sign turned round."""
    a = np.random.default_rng(1).uniform(-1.4, 1.4, (22, 3))
    expected = Rotation.from_euler("ZXY", np.stack([-a[:6, 2], a[:6, 0], a[:6, 1]], axis=1)).as_matrix()
    np.testing.assert_allclose(turns(a)[:6], expected, atol=1e-12)


def test_the_clinical_signs():
    """Bending the right knee, raising the right arm aside and bending the trunk forward are positive."""
    names = [label for label, _, _ in JOINTS]
    for joint, label, axis in (
        ("right_knee_flexion_deg", "jRightKnee", 2),
        ("left_knee_flexion_deg", "jLeftKnee", 2),
        ("right_hip_flexion_deg", "jRightHip", 2),
        ("right_hip_abduction_deg", "jRightHip", 0),
        ("left_hip_abduction_deg", "jLeftHip", 0),
        ("right_shoulder_abduction_deg", "jRightShoulder", 0),
        ("left_shoulder_internal_rotation_deg", "jLeftShoulder", 1),
        ("lumbar_flexion_deg", "jL5S1", 2),
        ("lumbar_bend_right_deg", "jL5S1", 0),
        ("left_elbow_flexion_deg", "jLeftElbow", 2),
        ("right_ankle_dorsiflexion_deg", "jRightAnkle", 2),
    ):
        from seerob.description.humans.posture import posture

        q = posture(PERSON, {joint: 10.0})
        _, rotations = segments(PERSON, q)
        wxyz = Rotation.from_matrix(rotations).as_quat(scalar_first=True)
        found = np.degrees(joint_angles(anatomical(wxyz)))
        expected = np.zeros((22, 3))
        expected[names.index(label), axis] = 10.0
        np.testing.assert_allclose(found, expected, atol=1e-9, err_msg=joint)


def test_segments_that_are_turned_in_the_t_pose_are_turned_back(tmp_path):
    turned = Rotation.from_euler("xyz", np.random.default_rng(2).uniform(-0.3, 0.3, (23, 3))).as_matrix()
    straight = read(made(tmp_path / "a.mvnx", Q))
    captured = read(made(tmp_path / "b.mvnx", Q, turned=turned))
    assert np.degrees(apart(orientations(captured), orientations(straight)).max()) < 0.1
    assert "as its tpose and tpose-isb say" in told(captured)
    assert "differ from those of its segments by at most 0.00°" in told(captured)
    (tpose,) = captured.calibration
    assert np.degrees(apart(tpose.orientations, np.tile([1.0, 0, 0, 0], (23, 1))).max()) < 0.1


ANATOMICAL = Rotation.from_quat(ISB_TPOSE, scalar_first=True).as_matrix()


def without_angles(frames):
    return [f.replace("jointAngle", "other") for f in frames]


@pytest.mark.parametrize("change", [lambda f: f, lambda f: [*f[:2], *f[3:]], lambda f: f[3:], without_angles])
def test_segments_that_are_anatomical_frames_are_known_by_joint_angles_or_arms(tmp_path, change):
    """As MVN 4.2.4 writes them in MVNX 3."""

    def theirs(frames):
        return change([frames[1].replace('"tpose"', '"tpose-isb"'), *frames[1:]])

    straight = read(made(tmp_path / "a.mvnx", Q))
    path = made(tmp_path / "b.mvnx", Q, version=3, turned=ANATOMICAL, change=theirs)
    captured = read(path)
    assert np.degrees(apart(orientations(captured), orientations(straight)).max()) < 0.1
    text = told(captured)
    assert (
        "segments have the axes of the anatomical frames" in text or "as its tpose and tpose-isb say" in text
    )
    for pose in captured.calibration:
        assert np.degrees(apart(pose.orientations, np.tile([1.0, 0, 0, 0], (23, 1))).max()) < 0.1


def test_joint_angles_count_more_than_the_frames_of_the_t_pose(tmp_path):
    def wrong(frames):
        return [frames[0].replace("identity", "tpose-isb"), *frames[1:2], *frames[3:]]

    straight = read(made(tmp_path / "a.mvnx", Q))
    captured = read(made(tmp_path / "b.mvnx", Q, change=wrong))
    assert np.degrees(apart(orientations(captured), orientations(straight)).max()) < 0.1


def test_segments_with_axes_of_no_known_file_are_refused(tmp_path):
    turned = np.broadcast_to(Rotation.from_euler("z", 90, degrees=True).as_matrix(), (23, 3, 3))
    with pytest.raises(InputError, match=r"jointAngle: its joint angles are .* whatever their axes"):
        read(made(tmp_path / "a.mvnx", Q, turned=ANATOMICAL @ turned, special=False))
    with pytest.raises(InputError, match=r"orientation: the arms' segments point .* beside the arms"):
        read(made(tmp_path / "b.mvnx", Q, turned=turned, special=False, change=without_angles))


def test_a_segment_that_is_there_twice_is_refused(tmp_path):
    path = made(tmp_path / "a.mvnx", Q[:2])
    doubled = path.read_text(encoding="utf-8").replace('label="L5"', 'label="L3"', 1)
    path.write_text(doubled, encoding="utf-8")
    with pytest.raises(InputError, match="segments: twice: L3"):
        read(path)


def test_joint_angles_that_are_not_those_of_the_segments_are_told(tmp_path, monkeypatch):
    def changed(frames):
        return [f.replace("<jointAngle>", "<jointAngle>90 0 0 ") for f in frames]

    def swapped(frames):
        normal = [f for f in frames if 'type="normal"' in f]
        tails = [f[f.index("<jointAngle>") :] for f in normal]
        moved = [f[: f.index("<jointAngle>")] + tails[k - 20] for k, f in enumerate(normal)]
        return frames[:3] + moved

    def touched(frames):
        return [*frames[:9], re.sub("<jointAngle>[^ ]+", "<jointAngle>80", frames[9]), *frames[10:]]

    with pytest.raises(InputError, match=r"jointAngle: its joint angles are .* from those of its segments"):
        read(made(tmp_path / "a.mvnx", Q, change=swapped))
    captured = read(made(tmp_path / "c.mvnx", Q, change=touched), human="op")
    assert "warning: its joint angles differ" in told(captured)
    assert [f.holds for f in captured.findings if f.level == "warning"] == [("op",)]
    # Nor is it missed between those of many frames that say how segments are turned, or where few are kept.
    many = made(tmp_path / "d.mvnx", moving(500), change=touched)
    assert [f.holds for f in read(many, human="op").findings if f.level == "warning"] == [("op",)]
    monkeypatch.setattr(mvnx, "KEPT", 10)
    assert [f.holds for f in read(many, human="op").findings if f.level == "warning"] == [("op",)]
    # Another count of numbers is no comparison.
    assert "joint angles" not in told(read(made(tmp_path / "b.mvnx", Q, change=changed)))


# -- what is in a file ---------------------------------------------------------------------------


@pytest.mark.parametrize("version", [3, 4])
def test_a_file_comes_back(tmp_path, version):
    captured = read(made(tmp_path / "x.mvnx", Q, version=version))
    positions, rotations = segments(PERSON, Q)
    assert captured.layout.names == SEGMENTS
    assert (captured.layout.seen, captured.layout.convention) == (Seen.SEGMENTS, "xsens")
    assert (captured.count, captured.rate) == (len(Q), 60)
    frames = list(captured.frames)
    assert [f.t for f in frames] == pytest.approx(np.arange(len(Q)) / 60, abs=1e-12)
    np.testing.assert_allclose([f.positions for f in frames], positions, atol=1e-6)
    expected = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(scalar_first=True).reshape(-1, 23, 4)
    assert apart(orientations(captured), expected).max() < 1e-5
    assert [f.t for f in captured.frames] == [f.t for f in frames]  # again from the start
    assert [f.pose for f in captured.calibration] == ["tpose"]


def test_a_long_file_is_read_again_and_says_the_same(tmp_path, monkeypatch):
    turned = Rotation.from_euler("xyz", np.full((23, 3), 0.2)).as_matrix()
    path = made(tmp_path / "x.mvnx", Q, units=100.0, turned=turned)
    kept = list(read(path).frames)
    monkeypatch.setattr(mvnx, "KEPT", 10)
    for a, b in zip(kept, read(path).frames, strict=True):
        np.testing.assert_array_equal(a.positions, b.positions)
        np.testing.assert_array_equal(a.orientations, b.orientations)
        assert a.t == b.t


def test_centimetres_are_noticed(tmp_path):
    captured = read(made(tmp_path / "x.mvnx", Q, units=100.0))
    positions, _ = segments(PERSON, Q)
    np.testing.assert_allclose(next(iter(captured.frames)).positions, positions[0], atol=1e-6)
    assert "positions are in cm" in told(captured)
    with pytest.raises(InputError, match="as long as a person's"):
        read(made(tmp_path / "y.mvnx", Q, units=7.0))


def test_a_pose_is_what_it_looks_like_not_what_it_is_called(tmp_path):
    def renamed(frames):
        return [f.replace('type="tpose"', 'type="npose"').replace("identity", "other") for f in frames]

    captured = read(made(tmp_path / "x.mvnx", Q, change=renamed))
    assert [f.pose for f in captured.calibration] == ["tpose"]
    assert "its frame npose shows the arms to the sides" in told(captured)


@pytest.mark.parametrize(
    ("options", "lost"),
    [
        ({"sensors": [s for s in SEGMENTS[:15] if s != "LeftHand"]}, {*SEGMENTS[15:], "LeftHand"}),
        ({"sensors": [], "configuration": "UpperBodyNoHands"}, set(SEGMENTS[15:])),
        ({"sensors": [], "configuration": "LowerBody"}, set(SEGMENTS[1:15])),
        ({"sensors": [], "configuration": "FullBody"}, set()),
    ],
)
def test_segments_without_a_sensor_are_not_measured(tmp_path, options, lost):
    captured = read(made(tmp_path / "x.mvnx", Q[:3], **options))
    frame = next(iter(captured.frames))
    known = np.ones(23) if frame.confidence is None else frame.confidence
    assert {s for s, c in zip(SEGMENTS, known, strict=True) if c == 0} == lost
    assert ("not measured" in told(captured)) == bool(lost)


def test_frames_that_are_missing_broken_or_backward(tmp_path):
    def holes(frames):
        bad = frames[10].replace("<position>", "<position>1 ")
        nan = frames[12].replace("<position>0", "<position>nan", 1)
        return [*frames[:10], bad, frames[11], nan, *frames[16:20], frames[17], *frames[20:]]

    captured = read(made(tmp_path / "x.mvnx", Q, change=holes))
    frames = list(captured.frames)
    assert len(frames) == captured.count == len(Q) - 4
    assert (np.diff([f.t for f in frames]) > 0).all()
    for text in ("1 frames without position", "1 frames that are not after", "4 of 40 frames are missing"):
        assert text in told(captured)


# -- files that are wrong ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("subject", "person", "no <subject>"),
        ('frameRate="60"', 'frameRate="0"', "frameRate is 0"),
        ('frameRate="60"', "", "no frameRate"),
        ('label="RightHand"', 'label="Paw"', "no segment RightHand"),
        ('type="normal"', 'type="other"', "no frame of motion"),
        ("<orientation>", "<orientation>1 ", "40 frames of motion, none"),
        ("</subject>", "", "not XML"),
    ],
)
def test_what_is_wrong_is_said_with_the_name_of_the_file(file, tmp_path, old, new, complaint):
    path = tmp_path / "wrong.mvnx"
    path.write_text(file.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=complaint) as caught:
        read(path, file="cell/wrong.mvnx")
    assert str(caught.value).startswith("cell/wrong.mvnx")


def test_no_file_and_a_folder(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / "none.mvnx")
    with pytest.raises(InputError, match="cannot be read"):
        read(tmp_path)


BOMB = '<!DOCTYPE m [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'


def test_hostile_xml_is_refused(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="DTD"):
        read(made(tmp_path / "a.mvnx", Q[:1], extra=BOMB))
    deep = tmp_path / "deep.mvnx"
    deep.write_text("<a>" * 10_000, encoding="utf-8")
    with pytest.raises(InputError, match="nested"):
        read(deep)
    monkeypatch.setattr(_mvnx_stream, "LONGEST", 500)
    with pytest.raises(InputError, match="more than 500 characters"):
        read(made(tmp_path / "b.mvnx", Q[:1]))
    monkeypatch.setattr(_mvnx_stream, "SILENCE", 1 << 17)
    endless = tmp_path / "endless.mvnx"
    endless.write_text("<mvnx a='" + "x" * (1 << 19), encoding="utf-8")
    with pytest.raises(InputError, match="without the end"):
        read(endless)


def test_damaged_files_are_refused_or_read(tmp_path):
    good = made(tmp_path / "good.mvnx", Q[:2]).read_bytes()
    rng = random.Random(0)
    path = tmp_path / "bad.mvnx"
    refused = 0
    for _ in range(60):
        bad = bytearray(good)
        for _ in range(rng.randint(1, 5)):
            bad[rng.randrange(len(bad))] = rng.randrange(256)
        path.write_bytes(bad[: rng.randint(1, len(bad))] if rng.random() < 0.3 else bad)
        try:
            for frame in read(path).frames:
                assert not np.isinf(frame.positions).any()
        except InputError:
            refused += 1
    assert refused > 10


def test_lengths_are_from_the_origin_of_a_segment_to_the_next_joint():
    points = {
        ("RightUpperArm", "jRightElbow"): "0 -0.28 0",
        ("T8", "jT1C7"): "0.03 0 0.04",
        ("T8", "jRightT4Shoulder"): "0 -0.1 0.2",
        ("Head", "pTopOfHead"): "0 0 0.18",
        ("LeftHand", "pLeftTopOfHand"): "nonsense",
    }
    found = lengths(_mvnx_stream.Head(points=points))
    assert found == {"RightUpperArm": 0.28, "T8": pytest.approx(0.05), "Head": 0.18}
