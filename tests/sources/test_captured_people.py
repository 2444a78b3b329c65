"""From a file to pulls on bones: every bone of the person who was written is where and how it was."""

from __future__ import annotations

import numpy as np
import pytest
from made_mvnx import PERSON, Q, made
from test_bvh import FRAMES, expected
from test_bvh import made as made_bvh

from seerob.core.transforms import rotation_from_wxyz
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.devices.sources.bvh import Bvh
from seerob.devices.sources.mvnx import Mvnx
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
