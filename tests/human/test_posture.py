"""Postures stand on the floor, in balance, within the limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, Delaunay

from seerob.core.errors import InputError, UnknownName
from seerob.description.humans import manikin
from seerob.description.humans.posture import HEIGHT, lowest_sole, names, on_floor, posture, sole_corners
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses

PERSON = manikin.build(name="p", stature=1.75, mass=75, sex="male")
LIMITS = np.array(
    [[-3 if j.lower is None else j.lower, 3 if j.upper is None else j.upper] for j in PERSON.joints()]
)


def sole_surface(q):
    """Lowest point of the soles by points all over their surface: a second way to the same number."""
    rotations, positions = bone_poses(PERSON, q)
    lowest = math.inf
    theta, phi = np.meshgrid(np.linspace(0, np.pi, 181), np.linspace(0, 2 * np.pi, 181))
    ball = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    for i, bone in enumerate(BONES):
        if bone.endswith(("foot", "toes")):
            (solid,) = PERSON.link(bone).solids
            p = solid.points
            for corner in (*p, p[1] + p[2] - p[0]):
                z = (corner + solid.radius * ball.reshape(-1, 3)) @ rotations[i].T + positions[i]
                lowest = min(lowest, z[:, 2].min())
    return lowest


@pytest.mark.parametrize("name", names())
def test_named_postures_stand_on_the_floor_within_their_limits(name):
    q = posture(PERSON, name)
    assert q.shape == (53,)
    assert lowest_sole(PERSON, q) == pytest.approx(0, abs=1e-12)
    assert (q >= LIMITS[:, 0]).all()
    assert (q <= LIMITS[:, 1]).all()


@pytest.mark.parametrize("name", [n for n in names() if n != "sitting"])
def test_standing_postures_are_in_balance(name):
    q = posture(PERSON, name)
    rotations, positions = bone_poses(PERSON, q)
    masses = [k.inertial.mass for k in PERSON.links[1:]]
    centres = [p + r @ k.inertial.com for k, r, p in zip(PERSON.links[1:], rotations, positions, strict=True)]
    com = np.average(centres, axis=0, weights=masses)
    touching, _, _ = sole_corners(PERSON, rotations, positions)
    base = touching[touching[:, 2] < 0.02][:, :2]
    assert Delaunay(base[ConvexHull(base).vertices]).find_simplex(com[:2]) >= 0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_lowest_sole_of_random_postures(seed):
    rng = np.random.default_rng(seed)
    q = rng.uniform(LIMITS[:, 0], LIMITS[:, 1])
    # Points on a grid of 1° miss the lowest one by less than r (1 - cos 1°).
    assert lowest_sole(PERSON, q) == pytest.approx(sole_surface(q), abs=0.05 * (1 - math.cos(0.02)))
    assert lowest_sole(PERSON, on_floor(PERSON, q)) == pytest.approx(0, abs=1e-12)


def test_degrees_radians_opposites_and_both():
    one = posture(PERSON, {"both_knee_flexion_deg": 90.0, "lumbar_flexion": 0.1})
    two = posture(
        PERSON,
        {"right_knee_extension": -math.pi / 2, "left_knee_flexion": math.pi / 2, "lumbar_extension": -0.1},
    )
    assert one == pytest.approx(two, abs=1e-15)


def test_joints_on_top_replace_the_postures_own():
    q = posture(PERSON, "work_at_bench", joints={"right_elbow_flexion_deg": 10})
    plain = posture(PERSON, "work_at_bench")
    changed = np.flatnonzero(q != plain)
    assert [JOINTS[i] for i in changed] == ["right_elbow_flexion"]
    assert q[changed[0]] == pytest.approx(math.radians(10))


def test_position_and_heading():
    q = posture(PERSON, "reach_forward", position=(1.0, 2.0), heading=math.pi / 2)
    plain = posture(PERSON, "reach_forward")
    _, positions = bone_poses(PERSON, plain)
    _, moved = bone_poses(PERSON, q)
    turned = positions @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + [1, 2, 0]
    assert moved == pytest.approx(turned, abs=1e-12)


def test_bent_knees_lower_the_pelvis_by_what_the_legs_lose():
    """Thighs level, shanks upright, feet flat: the hips sink by the length of the thighs."""
    q = posture(PERSON, "sitting")
    thigh = -PERSON.link("left_shank").parent_from_link[1, 3]
    assert q[HEIGHT] == pytest.approx(-thigh, abs=1e-12)


def test_not_on_the_floor_when_not_wanted():
    assert posture(PERSON, "sitting", floor=False)[HEIGHT] == 0
    assert posture(PERSON, {"pelvis_z": 0.3}, floor=False)[HEIGHT] == 0.3


def test_unknown_names():
    with pytest.raises(UnknownName, match="reach_forward"):
        posture(PERSON, "reach_foward")
    with pytest.raises(UnknownName, match="right_elbow_flexion"):
        posture(PERSON, {"right_elbow_flexon": 1.0})


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ({"right_knee_flexion_deg": 150}, r"right_knee_flexion_deg: 150.0° is beyond its limit; give 0…135°"),
        ({"right_knee_flexion_deg": -1}, "give 0…135°"),
        ({"left_shoulder_internal_rotation": 2.0}, "114.6° is beyond its limit; give -90…70°"),
        ({"neck_flexion": math.nan}, "not a number to use"),
        ({"neck_flexion": "much"}, "not a number to use"),
        ({"neck_flexion": True}, "not a number to use"),
        ({"neck_flexion": 10**400}, "not a number to use"),
        ({"pelvis_x_deg": 1.0}, "in rad, pelvis_x is in m"),
        ({"neck_flexion_mm": 1.0}, "in m, neck_flexion is in rad"),
        ({"neck_flexion": 0.1, "neck_extension": 0.1}, "already given by 'neck_flexion'"),
    ],
)
def test_wrong_values_say_what_would_be_right(wanted, said):
    with pytest.raises(InputError, match=said):
        posture(PERSON, wanted)


def test_every_wrong_value_is_named():
    with pytest.raises(InputError) as caught:
        posture(PERSON, {"both_knee_flexion_deg": 170, "neck_flexion_deg": 90})
    assert [p.key for p in caught.value.problems] == ["both_knee_flexion_deg", "neck_flexion_deg"]


def test_the_limit_itself_is_within():
    for joint in PERSON.joints()[6:]:
        for value in (joint.lower, joint.upper):
            q = posture(PERSON, {f"{joint.name}_deg": math.degrees(value)})
            assert joint.lower <= q[JOINTS.index(joint.name)] <= joint.upper
