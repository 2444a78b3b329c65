"""Lengths and masses by hand stand; stature and body mass stay, exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.description.capture.observing import stature as vertex
from seerob.description.humans import manikin
from seerob.description.humans.anthropometry import BESIDE, CHAIN, LENGTHS, body
from seerob.description.humans.skeleton import BONES, bone_poses

PERSON = {"name": "p", "stature": 1.75, "mass": 75.0, "sex": "male"}


def distance(description, q, one, other):
    _, p = bone_poses(description, q)
    return float(np.linalg.norm(p[BONES.index(one)] - p[BONES.index(other)]))


@pytest.mark.parametrize("key", LENGTHS)
@pytest.mark.parametrize("factor", [0.9, 1.12])
def test_a_length_stands_and_the_chain_still_ends_at_the_stature(key, factor):
    usual = body(**PERSON)
    wanted = usual.length[key] * factor
    made = body(**PERSON, own_lengths={key: wanted})
    assert made.length[key] == pytest.approx(wanted, abs=1e-12)
    assert math.fsum(made.length[k] for k in CHAIN) == pytest.approx(1.75, abs=1e-12)
    description = manikin.build(**PERSON, own_lengths={key: wanted})
    assert vertex(description) == pytest.approx(1.75, abs=1e-12)
    assert math.fsum(link.inertial.mass for link in description.links[1:]) == pytest.approx(75.0, abs=1e-9)
    if key in BESIDE:
        others = {k: v for k, v in made.length.items() if k in LENGTHS and k != key}
        assert others == pytest.approx({k: usual.length[k] for k in others}, abs=1e-12)


def test_bones_are_as_long_as_they_are_told():
    given = {"upper_arm": 0.33, "forearm": 0.24, "thigh": 0.44, "shank": 0.4, "hip_centres": 0.2}
    description = manikin.build(**PERSON, own_lengths=given)
    q = np.zeros(53)
    assert distance(description, q, "right_upper_arm", "right_forearm") == pytest.approx(0.33)
    assert distance(description, q, "left_forearm", "left_hand") == pytest.approx(0.24)
    assert distance(description, q, "right_thigh", "right_shank") == pytest.approx(0.44)
    assert distance(description, q, "left_shank", "left_foot") == pytest.approx(0.4)
    assert distance(description, q, "right_thigh", "left_thigh") == pytest.approx(0.2)


def test_nothing_given_changes_nothing():
    usual, made = body(**PERSON), body(**PERSON, own_lengths={}, own_masses={})
    assert (usual.length, usual.share) == (made.length, made.share)


def test_masses_stand_for_one_side_or_both():
    made = body(**PERSON, own_masses={"thigh": 9.0, "left_hand": 0.6})
    assert made.bone_mass("right_thigh") == made.bone_mass("left_thigh") == pytest.approx(9.0)
    assert made.bone_mass("left_hand") == pytest.approx(0.6)
    assert math.fsum(map(made.bone_mass, BONES)) == pytest.approx(75.0, abs=1e-9)
    usual = body(**PERSON)
    ratio = {made.share[b] / usual.share[b] for b in BONES if "thigh" not in b and b != "left_hand"}
    assert max(ratio) == pytest.approx(min(ratio))


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"own_lengths": {"forarm": 0.25}}, "did you mean 'forearm'"),
        ({"own_lengths": {"forearm": 2.5}}, "not that of a person"),
        ({"own_lengths": {"forearm": math.nan}}, "not that of a person"),
        ({"own_lengths": {"thigh": 0.8, "shank": 0.8}}, "leave"),
        ({"own_masses": {"thighs": 9.0}}, "did you mean 'thigh'"),
        ({"own_masses": {"thigh": 90.0}}, "not that of a person"),
        ({"own_masses": {"thorax": 40.0, "pelvis": 30.0}}, "leave"),
    ],
)
def test_what_cannot_be_is_said(given, says):
    with pytest.raises(InputError, match=says):
        manikin.build(**PERSON, **given)
