"""A posture of round angles has one score, wherever its person stands and faces, and in a mirror."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_postures import PERSON, UNSUPPORTED, posed, random_q

from seerob.criteria.ergonomics import eaws_posture, owas, reba, rula
from seerob.criteria.scoring.measured import ArmPolicy
from seerob.criteria.scoring.spans import ROUNDING, Thresholds, exactly, fallen, published, reached
from seerob.criteria.scoring.zones import ZoneMonitor, ZoneRow, zones_of
from seerob.description.humans.angles import angles
from seerob.description.humans.skeleton import JOINTS, bone_poses, mirrored

YAWS = 12
TURN = JOINTS.index("pelvis_turn_left")
ZONES = {name: zones_of(published(name), name).rows for name in ("iso_11226", "en_1005_4")}


def round_postures(count, step, seed):
    """Joint values that are multiples of a step [deg] within the limits, of every other one upright."""
    q = np.radians(np.round(np.degrees(random_q(count, seed=seed)) / step) * step)
    q[::2, [JOINTS.index("pelvis_list_right"), JOINTS.index("pelvis_tilt_back")]] = 0.0
    q[:, TURN] = 0.0
    return q


def everywhere(q, seed=0):
    """The same postures seen from everywhere: shape (yaws, n, 53); of the first nothing is changed."""
    random = np.random.default_rng(seed)
    found = np.repeat(q[None], YAWS, axis=0)
    turn = random.uniform(-np.pi, np.pi, (YAWS, 1))
    turn[0], turn[1], turn[2], turn[3] = 0.0, np.pi / 2, -np.pi, np.pi / 4
    found[..., TURN] += turn
    found[1:, :, :2] += random.uniform(-5, 5, (YAWS - 1, len(q), 2))
    return found


def scores(found, policy=ArmPolicy.PROJECTION):
    """Least and greatest scores of all components of all methods, each of shape (…)."""
    t = Thresholds()
    of = {
        "rula": rula.posture_components(
            found, thresholds=t, supported=UNSUPPORTED, back_supported=False, legs=None, policy=policy
        ),
        "reba": reba.posture_components(
            found, thresholds=t, supported=UNSUPPORTED, legs=exactly(1), sitting=False, policy=policy
        ),
    }
    flat = {
        f"{m} {k} {end}": x for m, c in of.items() for k, s in c.items() for end, x in s._asdict().items()
    }
    limits = owas.OwasThresholds()
    flat |= {"owas back": owas.back_codes(found, limits), "owas arms": owas.arm_codes(found)}
    return flat | {"owas legs": owas.leg_codes(found, limits)}


@pytest.mark.parametrize("policy", list(ArmPolicy))
@pytest.mark.parametrize("step", [5.0, 15.0, 30.0])
def test_no_score_changes_with_the_way_a_person_faces_or_with_the_place(step, policy):
    q = everywhere(round_postures(150, step, seed=int(step)))
    for name, found in scores(angles(*bone_poses(PERSON, q)), policy).items():
        assert np.array_equal(found, np.broadcast_to(found[0], found.shape)), name


def test_no_score_changes_in_a_mirror_but_its_side():
    q = round_postures(300, 15.0, seed=9)
    one, other = (scores(angles(*bone_poses(PERSON, x))) for x in (q, mirrored(q)))
    for name, found in one.items():
        sided = found.shape[1:] == (2,)
        assert np.array_equal(found[:, ::-1] if sided else found, other[name]), name


def test_no_line_and_no_zone_changes_with_the_way_a_person_faces():
    q = everywhere(round_postures(12, 15.0, seed=4))
    found = angles(*bone_poses(PERSON, q))
    for k in range(q.shape[1]):
        said = set()
        for yaw in range(YAWS):
            own = found[yaw, k]
            lines = eaws_posture.possible_lines(
                own, legs="posture", supported=False, thresholds=eaws_posture.EawsThresholds()
            )
            zones = [
                tuple(ZoneMonitor(rows, from_rest=True).add(0.0, own, 0.0, {}).items())
                for rows in ZONES.values()
            ]
            said.add((tuple(lines.tolist()), *zones))
        assert len(said) == 1, k


def test_an_arm_that_points_straight_aside_points_nowhere_seen_from_the_side():
    """Just below and just above it the arm scores 1 and 4, abduction apart."""
    found = rula.posture_components(
        posed(both_shoulder_abduction=90),
        thresholds=Thresholds(), supported=UNSUPPORTED, back_supported=False, legs=None,
    )  # fmt: skip
    assert found["upper arm"].low.tolist() == found["upper arm"].high.tolist() == [5, 5]


@pytest.mark.parametrize("rotation", [-2.0, -0.1, 0.0, 0.5, 3.0])
def test_an_arm_that_points_straight_up_is_turned_whatever_the_last_bit_says(rotation):
    up = {"shoulder_elevation": np.full(2, np.pi), "shoulder_rotation": np.full(2, rotation)}
    found = reba.posture_components(
        replace(posed(both_shoulder_flexion=170), **up),
        thresholds=Thresholds(), supported=UNSUPPORTED, legs=exactly(1), sitting=False,
    )  # fmt: skip
    assert found["upper arm"].low.tolist() == [5, 5]


@pytest.mark.parametrize("edge", [-1.2, 0.3, np.pi / 2])
def test_an_edge_is_reached_from_either_side_within_rounding_and_nought_is_neutral(edge):
    near = edge + np.array([-2, -0.5, 0, 0.5, 2]) * ROUNDING
    assert reached(near, edge).tolist() == [False, True, True, True, True]
    assert fallen(near, edge).tolist() == [True, True, True, True, False]
    nought = np.array([-2, -0.5, 0, 0.5, 2]) * ROUNDING
    assert reached(nought, 0.0).tolist() == [False, False, False, False, True]
    assert fallen(nought, 0.0).tolist() == [True, False, False, False, False]


def test_where_two_zones_meet_the_higher_score_counts():
    rows = (
        ZoneRow(angle="trunk_flexion", low=0.0, high=np.radians(20), score=0),
        ZoneRow(angle="trunk_flexion", low=np.radians(20), score=1),
        ZoneRow(angle="trunk_flexion", high=0.0, score=2),
    )
    for degrees, score in ((-1, 2), (-1e-8, 0), (0, 0), (19.9, 0), (20 - 1e-8, 1), (20, 1), (21, 1)):
        own = replace(posed(), trunk_flexion=np.radians(degrees))
        found = ZoneMonitor(rows, from_rest=True).add(0.0, own, 0.0, {})
        assert found == {("trunk_flexion", 0): (score, score)}, degrees


def test_who_lies_on_a_side_has_no_heading_and_no_trunk_to_score():
    R, p = bone_poses(PERSON, np.zeros(len(JOINTS)))
    lying = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    found = angles(lying @ R, p @ lying.T)
    assert np.isnan(found.trunk_flexion)
    assert np.isnan(found.trunk_side_bend)
    assert np.isfinite(found.trunk_twist)
