"""From a file to pulls on bones: every bone of the person who was written is where and how it was."""

from __future__ import annotations

import numpy as np
import pytest
from made_mvnx import PERSON, Q, made
from test_bvh import FRAMES, expected
from test_bvh import made as made_bvh

from kept_run import Kept
from seerob.core.snapshot import Origin, Verdict
from seerob.core.transforms import rotation_from_wxyz
from seerob.criteria.scoring.measured import ANGLES_OF
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.devices.capture.options import AZURE_KINECT, XSENS
from seerob.devices.sources.bvh import Bvh
from seerob.devices.sources.mvnx import Mvnx
from seerob.devices.sources.vrpn import Vrpn
from seerob.session.station import load
from seerob.workstation.source import Target

TARGET = Target(name="op", joints=(), units=(), lower=(), upper=(), velocity=(), description=PERSON)
BLENDED = {"lumbar", "thorax"}
"""Bones that several of Xsens' segments share, whose origins are not all ours."""


def test_an_mvnx_file_turns_every_bone_as_it_was(tmp_path):
    made(tmp_path / "x.mvnx", Q)
    opened = Mvnx(human="op", file="x.mvnx").open(tmp_path, TARGET)
    rotations, positions = bone_poses(PERSON, Q)
    turned = set()
    for k, sample in enumerate(opened.samples):
        for point in sample.points:
            row = BONES.index(point.bone)
            if point.wxyz is not None:
                turned.add(point.bone)
                off = rotation_from_wxyz(point.wxyz).T @ rotations[k, row]
                assert np.degrees(np.arccos(np.clip((np.trace(off) - 1) / 2, -1, 1))) < 0.1
            if point.position is not None and point.bone not in BLENDED:
                assert np.linalg.norm(np.array(point.position) - positions[k, row]) < 1e-3
    assert k == len(Q) - 1
    assert turned == set(BONES)


def test_a_bvh_file_puts_every_joint_where_it_was(tmp_path):
    made_bvh(tmp_path / "x.bvh")
    opened = Bvh(human="op", file="x.bvh").open(tmp_path, TARGET)
    points, _ = expected("ZXY")
    samples = list(opened.samples)
    assert len(samples) == FRAMES
    for k, sample in enumerate(samples):
        seen = {p.name: p.position for p in sample.points if p.position is not None}
        assert {"Hips", "LeftForeArm", "RightLeg"} <= set(seen)
        for name, position in seen.items():
            assert position == pytest.approx(points[name][k], abs=1e-6)


def test_another_person_than_the_one_in_the_file(tmp_path):
    from seerob.core.errors import InputError

    made(tmp_path / "x.mvnx", Q)
    with pytest.raises(InputError, match="it has 'Anna'"):
        Mvnx(human="op", file="x.mvnx", subject="Bob").open(tmp_path, TARGET)


CELL = """
engine = { physics = false }

[[humans]]
name = "op"
stature = 1.8
mass = 80
sex = "male"

[[sources]]
kind = "mvnx"
human = "op"
file = "x.mvnx"
SOURCE
[[ergonomics]]
kind = "rula"
human = "op"
action_level = 1
RULE
[[ergonomics.phases]]
load = 0
muscle_arms = false
muscle_body = false
supported_arms = "none"
back_supported = true
legs = "balanced"
"""


def scored(folder, *, source="", rule=""):
    """RULA of somebody who sits upright with the forearms level, as MVN recorded it."""
    q = posture(PERSON, {"both_elbow_flexion_deg": 80.0, "both_elbow_pronation_deg": 90.0})
    made(folder / "x.mvnx", np.stack([q] * 40))
    text = CELL.replace("SOURCE", source).replace("RULE", rule)
    (folder / "workstation.toml").write_text(text, encoding="utf-8")
    kept = Kept()
    station = load(folder)
    station.run(writers=[kept])
    (result,) = kept.snapshots[-1].results
    (basis,) = (c.basis for c in station.scene().criteria)
    return result, {i.name: i for i in basis.inputs if "accuracy" in i.name}, station


def test_what_is_known_of_a_device_makes_intervals_of_scores(tmp_path):
    """Of MVN 9° and 15° are: an upright neck may be bent back, and the score lies across the limit."""
    result, inputs, _ = scored(tmp_path)
    assert result.verdict is Verdict.UNDECIDED
    low, high = result.interval
    assert low <= 2 < high
    assert inputs["accuracy of the shoulder, mvnx op"].value == 15
    assert inputs["accuracy of the angles, mvnx op"].value == 9
    assert "Mavor et al. 2020" in inputs["accuracy of the angles, mvnx op"].source


@pytest.mark.parametrize("where", ["source", "rule"])
def test_who_knows_better_says_so_of_the_device_or_in_the_rule(tmp_path, where):
    result, inputs, _ = scored(tmp_path, **{where: "accuracy = 0.01"})
    assert (result.verdict, result.value) == (Verdict.WITHIN, 1)
    (told,) = inputs.values()
    assert (told.value, told.origin) == (pytest.approx(0.573, abs=1e-3), Origin.GIVEN)


@pytest.mark.parametrize("where", ["source", "rule"])
def test_nobody_knows_angles_to_the_last_digit(tmp_path, where):
    """Written of the device, 0 took the place of the 9° and 15° that were found of it."""
    result, _, station = scored(tmp_path, **{where: "accuracy = 0"})
    assert result.verdict is Verdict.UNDECIDED
    assert any("accuracy = 0 rad: less than 0.001 rad" in f.text for f in station.model.findings if f.holds)


def test_what_nobody_knows_of_a_device_is_said(tmp_path):
    made_bvh(tmp_path / "x.bvh")
    unknown = "angles of a posture may be off that x.bvh captures nobody says"
    for options, said in (({}, True), ({"accuracy": 0.1}, False)):
        source = Bvh(human="op", file="x.bvh", **options)
        assert (source.posture_error() is None) == said
        assert any(unknown in f.text for f in source.open(tmp_path, TARGET).findings) == said


def test_what_nobody_knows_of_a_live_device_is_said(tmp_path):
    unknown = "angles of a posture may be off that vr captures nobody says"
    for options, said in (({}, True), ({"accuracy": 0.1}, False)):
        source = Vrpn(human="op", name="vr", host="127.0.0.1", mapping={"Head": "head"}, **options)
        assert any(unknown in f.text for f in source.open(tmp_path, TARGET).findings) == said


def test_errors_of_devices_are_of_joints_that_there_are():
    for known in (XSENS, AZURE_KINECT):
        assert known.joints.keys() <= ANGLES_OF.keys()
