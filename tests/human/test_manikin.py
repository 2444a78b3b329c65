"""The person's body: it closes at the stature, weighs the body mass, and is what the tables say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seerob.core.errors import InputError, UnknownName
from seerob.core.shapes import Solid
from seerob.core.snapshot import Origin
from seerob.description.description import Description, JointKind
from seerob.description.humans import anthropometry, manikin, skin
from seerob.description.humans.anthropometry import table
from seerob.description.humans.body_areas import Borders
from seerob.description.humans.skeleton import AXES, BONES, bone_poses

SEXES, LENGTHS = ("male", "female"), ("drillis", "deleva")
PEOPLE = st.tuples(st.floats(1.2, 2.3), st.floats(30, 250), st.sampled_from(SEXES), st.sampled_from(LENGTHS))


def person(stature=1.75, mass=75.0, sex="male", lengths="drillis", **more):
    return manikin.build(name="p", stature=stature, mass=mass, sex=sex, lengths=lengths, **more)


def corners(solid: Solid) -> np.ndarray:
    points = solid.points
    return points if len(points) == 2 else np.vstack([points, points[1] + points[2] - points[0]])


def lowest_and_highest(description: Description) -> tuple[float, float]:
    rotations, positions = bone_poses(description, np.zeros(53))
    heights = []
    for i, link in enumerate(description.links[1:]):
        for solid in link.solids:
            points = corners(solid)
            z = (points @ rotations[i].T + positions[i])[:, 2]
            heights += [z.min() - solid.radius, z.max() + solid.radius]
    return min(heights), max(heights)


def test_21_bones_47_joint_axes_and_6_of_the_waist():
    description = person()
    assert [link.name for link in description.links] == ["root", *BONES]
    assert len(BONES) == 21
    joints = description.joints()
    assert len(joints) == 53
    assert len({j.name for j in joints}) == 53
    assert [len(link.joints) for link in description.links[:2]] == [0, 6]
    assert sum(j.kind is JointKind.PRISMATIC for j in joints) == 3
    counts = [len(link.joints) for link in description.links[2:]]
    assert counts == [3, 3, 3, 2] + [2, 3, 2, 2] * 2 + [3, 2, 3, 1] * 2
    assert [j.name for j in joints] == [a.name for a in AXES]


@settings(max_examples=25, deadline=None)
@given(PEOPLE)
def test_chain_closes_at_the_stature_and_masses_at_the_body_mass(who):
    stature, mass, _, _ = who
    description = person(*who)
    assert math.fsum(k.inertial.mass for k in description.links[1:]) == pytest.approx(mass, rel=1e-12)
    low, high = lowest_and_highest(description)
    assert low == pytest.approx(0, abs=1e-12)
    assert high == pytest.approx(stature, abs=1e-12)


@settings(max_examples=25, deadline=None)
@given(PEOPLE)
def test_every_bone_is_a_body_that_can_exist(who):
    for link in person(*who).links[1:]:
        assert link.inertial.mass > 0
        assert link.inertial.origin is Origin.ESTIMATED
        smallest, middle, largest = np.linalg.eigvalsh(link.inertial.inertia)
        assert smallest > 0
        assert smallest + middle > largest, link.name
        (solid,) = link.solids
        wanted = link.inertial.mass / skin.density(link.name)
        assert skin.volume(solid) == pytest.approx(wanted, rel=1e-9)


def test_volume_of_a_dilated_rectangle_by_sampling():
    rng = np.random.default_rng(1)
    a, b, r = 0.3, 0.2, 0.1
    box = np.array([a + 2 * r, b + 2 * r, 2 * r])
    points = (rng.random((400_000, 3)) - 0.5) * box
    outside = np.maximum(np.abs(points) - [a / 2, b / 2, 0], 0)
    inside = (np.linalg.norm(outside, axis=1) <= r).mean() * box.prod()
    assert skin.dilated_volume(a, b, r) == pytest.approx(inside, rel=0.005)


@pytest.mark.parametrize("lengths", LENGTHS)
@pytest.mark.parametrize("sex", SEXES)
def test_left_is_the_mirror_image_of_right(sex, lengths):
    links = {k.name: k for k in person(sex=sex, lengths=lengths).links}
    flip = np.diag([1.0, 1.0, -1.0])
    for bone in (b for b in BONES if b.startswith("right_")):
        right, left = links[bone], links[bone.replace("right", "left")]
        assert left.parent_from_link[:3, 3] == pytest.approx(flip @ right.parent_from_link[:3, 3], abs=0)
        assert left.inertial.com == pytest.approx(flip @ right.inertial.com, abs=1e-15)
        assert left.inertial.inertia == pytest.approx(flip @ right.inertial.inertia @ flip, abs=1e-15)
        assert left.solids[0].radius == right.solids[0].radius
        mirrored = corners(right.solids[0]) @ flip
        assert np.abs(mirrored[:, None] - corners(left.solids[0])[None]).max(-1).min(1) == pytest.approx(
            0, abs=1e-15
        )


def whole(description: Description, bones: tuple[str, ...]) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre and inertia in world axes at zero of several bones together."""
    rotations, positions = bone_poses(description, np.zeros(53))
    parts = []
    for bone in bones:
        i, inertial = BONES.index(bone), description.link(bone).inertial
        centre = positions[i] + rotations[i] @ inertial.com
        parts.append((inertial.mass, centre, rotations[i] @ inertial.inertia @ rotations[i].T))
    mass = sum(m for m, _, _ in parts)
    com = sum(m * c for m, c, _ in parts) / mass
    inertia = sum(
        i + m * ((c - com) @ (c - com) * np.eye(3) - np.outer(c - com, c - com)) for m, c, i in parts
    )
    return mass, com, inertia


def test_the_reference_man_of_de_leva_comes_back():
    """1.741 m, 73 kg: lengths, centres and radii of gyration of Table 4, split bones taken together."""
    description = person(1.741, 73.0, "male", "deleva")
    rows = table("de_leva")["male"]
    rows = rows["segments"] | rows["alternatives"]
    _, positions = bone_poses(description, np.zeros(53))

    def distance(a, b):
        return np.linalg.norm(positions[BONES.index(a)] - positions[BONES.index(b)])

    assert distance("left_thigh", "left_shank") == pytest.approx(0.4222)
    assert distance("left_shank", "left_foot") == pytest.approx(0.4340)
    assert distance("left_upper_arm", "left_forearm") == pytest.approx(0.2817)
    assert distance("left_forearm", "left_hand") == pytest.approx(0.2689)
    assert distance("pelvis", "neck") == pytest.approx(0.6033)
    shoulder, hip = (positions[BONES.index(b)][2] for b in ("left_upper_arm", "pelvis"))
    assert shoulder - hip == pytest.approx(0.5155)
    for bones, key in (
        (("head", "neck"), "head_2"),
        (("left_foot", "left_toes"), "foot"),
        (("thorax", "left_clavicle", "right_clavicle"), "upper_trunk_2"),
        (("left_thigh",), "thigh"),
        (("left_hand",), "hand_2"),
    ):
        row = rows[key]
        mass, _, inertia = whole(description, bones)
        radii = np.sqrt(np.diag(inertia) / mass) / (row["length"] * 1e-3) * 100
        sagittal, transverse, longitudinal = row["radii"]
        about_world = [sagittal, transverse, longitudinal]
        if key == "foot":  # its long axis is the world's x
            about_world = [longitudinal, transverse, sagittal]
        assert radii == pytest.approx(about_world, rel=1e-9), key
    mass, com, _ = whole(description, ("head", "neck"))
    assert mass == pytest.approx(0.0694 * 73)
    assert com[2] == pytest.approx(1.741 - 0.5002 * 0.2429)
    mass, _, _ = whole(description, ("thorax", "left_clavicle", "right_clavicle"))
    assert mass == pytest.approx(0.1596 * 73)


def test_trunk_together_has_its_published_centre():
    """Trunk 2 (cervicale to mid hip) is another row of the same table: 51.38 % from the cervicale."""
    description = person(1.741, 73.0, "male", "deleva")
    trunk = ("pelvis", "lumbar", "thorax", "left_clavicle", "right_clavicle")
    mass, com, _ = whole(description, trunk)
    _, positions = bone_poses(description, np.zeros(53))
    cervicale = positions[BONES.index("neck")][2]
    assert mass == pytest.approx(0.4346 * 73)
    assert (cervicale - com[2]) / 0.6033 == pytest.approx(0.5138, abs=0.006)


@pytest.mark.parametrize(("sex", "total"), [("male", 100.00), ("female", 99.99)])
def test_check_sums_of_table_4(sex, total):
    rows = table("de_leva")[sex]["segments"]
    single = ("head", "upper_trunk", "middle_trunk", "lower_trunk")
    weights = {k: 1 if k in single else 2 for k in rows}
    assert sum(weights[k] * row["mass"] for k, row in rows.items()) == pytest.approx(total, abs=1e-9)


def test_trunk_pieces_are_the_trunk_of_table_4():
    for sex, trunk, length in (("male", 43.46, 603.3), ("female", 42.57, 614.8)):
        people = table("de_leva")[sex]
        rows = people["segments"]
        pieces = ("upper_trunk", "middle_trunk", "lower_trunk")
        assert sum(rows[k]["mass"] for k in pieces) == pytest.approx(trunk)
        high = people["alternatives"]["upper_trunk_2"]["length"]
        parts = high + rows["middle_trunk"]["length"] + rows["lower_trunk"]["length"]
        assert parts == pytest.approx(length) == pytest.approx(people["alternatives"]["trunk_2"]["length"])


MEAN_MAN = {  # men's mean table of the same study, transcribed by others: kg, kg cm2 about AP, ML, long axis
    "foot": (0.997, 44, 40, 10.3),
    "shank": (3.16, 385, 371, 64.6),
    "thigh": (10.36, 1997.8, 1999.4, 413.4),
    "hand": (0.447, 13.2, 8.76, 5.37),
    "forearm": (1.177, 64.7, 60.2, 12.6),
    "upper_arm": (1.98, 127.3, 114.4, 38.95),
    "head": (5.018, 272.1, 293.9, 202.4),
    "upper_trunk": (11.654, 1725.6, 705.2, 1454.5),
    "middle_trunk": (11.953, 1280.8, 819.1, 1203.1),
    "lower_trunk": (8.164, 656.8, 525.0, 592.4),
}


@pytest.mark.parametrize("segment", MEAN_MAN)
def test_regressions_give_the_mean_man(segment):
    mass, *moments = MEAN_MAN[segment]
    reference = {"mass": 73.0, "stature": 1.741}
    assert anthropometry.zatsiorsky_masses(**reference)[segment] == pytest.approx(mass, rel=0.02)
    found = np.array(anthropometry.zatsiorsky_moments(segment, **reference)) * 1e4
    assert found == pytest.approx(moments, rel=0.015)


def test_regressions_nearly_conserve_mass_and_the_manikin_exactly():
    masses = anthropometry.zatsiorsky_masses(mass=80.0, stature=1.8)
    single = ("head", "upper_trunk", "middle_trunk", "lower_trunk")
    assert sum(m * (1 if k in single else 2) for k, m in masses.items()) == pytest.approx(80, rel=0.005)
    description = person(1.8, 80.0, masses="zatsiorsky")
    assert math.fsum(k.inertial.mass for k in description.links[1:]) == pytest.approx(80, rel=1e-12)
    mass, _, inertia = whole(description, ("head", "neck"))
    scale = mass / masses["head"]
    sagittal, transverse, longitudinal = anthropometry.zatsiorsky_moments("head", mass=80.0, stature=1.8)
    assert np.diag(inertia) == pytest.approx(scale * np.array([sagittal, transverse, longitudinal]))
    assert "Zatsiorsky" in description.link("left_thigh").inertial.source


def test_drillis_heights():
    """Heights of the figure that several codes confirm: ankle .039, hip .530, shoulder .818."""
    description = person(1.0 / 0.5, 80.0)  # 2 m
    _, positions = bone_poses(description, np.zeros(53))
    for bone, height in (("left_foot", 0.039), ("pelvis", 0.530), ("left_upper_arm", 0.818)):
        assert positions[BONES.index(bone)][2] == pytest.approx(height * 2.0)


def test_female_de_leva_says_that_the_ankle_takes_what_is_left():
    texts = [f.text for f in person(1.735, 61.9, "female", "deleva").findings if "ankle" in f.text]
    assert any("76 mm" in t and "0.0436" in t for t in texts)


@pytest.mark.parametrize(
    ("sex", "stature", "mass", "torques"),
    [("male", 1.741, 73.0, (200.7, 203.2, 118.4)), ("female", 1.735, 61.9, (190.7, 167.5, 109.6))],
)
def test_torques_of_anderson(sex, stature, mass, torques):
    joints = {j.name: j for j in person(stature, mass, sex).joints()}
    names = ("right_hip_flexion", "right_knee_extension", "left_ankle_dorsiflexion")
    for name, torque in zip(names, torques, strict=True):
        assert joints[name].effort.value == pytest.approx(torque, abs=0.05)
        assert "Anderson" in joints[name].effort.source


def test_what_nobody_stated_is_not_there():
    for joint in person().joints():
        assert joint.velocity is None
        assert joint.armature is None
        unknown = joint.name.startswith("pelvis") or "clavicle" in joint.name or "toes" in joint.name
        assert (joint.effort is None) == unknown, joint.name


def test_limits_contain_zero_and_are_the_same_on_both_sides():
    joints = {j.name: j for j in person().joints()}
    for axis in AXES[6:]:
        joint = joints[axis.name]
        assert joint.lower <= 0 <= joint.upper
        if axis.name.startswith("right_"):
            twin = joints.get(axis.name.replace("right", "left"))
            if twin is None:
                twin = joints[axis.opposite.replace("right", "left")]
                assert (twin.lower, twin.upper) == (-joint.upper, -joint.lower)
            else:
                assert (twin.lower, twin.upper) == (joint.lower, joint.upper)
    assert joints["right_knee_extension"].lower == pytest.approx(-math.radians(135))
    assert joints["left_hip_abduction"].upper == pytest.approx(math.radians(45))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"stature": 0.5}, "1.2…2.3 m"),
        ({"stature": 3.0}, "1.2…2.3 m"),
        ({"mass": 20.0}, "30…250 kg"),
        ({"mass": 400.0}, "30…250 kg"),
        ({"stature": math.nan}, "1.2…2.3 m"),
        ({"mass": math.inf}, "30…250 kg"),
        ({"sex": "other"}, "male, female"),
        ({"lengths": "guess"}, "drillis, deleva"),
        ({"masses": "dempster"}, "deleva, zatsiorsky"),
        ({"masses": "zatsiorsky", "sex": "female"}, "masses = deleva"),
        ({"masses": "zatsiorsky", "mass": 30.0, "stature": 2.3}, "impossible segments for 30 kg"),
        ({"hand": "both"}, "right or left"),
    ],
)
def test_implausible_people_are_refused(options, said):
    with pytest.raises(InputError, match=said):
        person(**options)


def test_every_mistake_at_once():
    with pytest.raises(InputError) as caught:
        person(stature=0.5, mass=400.0, sex="x")
    assert [p.key for p in caught.value.problems] == ["stature", "mass", "sex"]


def test_unusual_build_is_a_warning():
    assert any(f.level == "warning" for f in person(1.5, 150.0).findings)
    assert not any(f.level == "warning" for f in person().findings)


def test_tip_is_the_dominant_hand():
    assert person(hand="left").tip == "left_hand"


def test_body_regions():
    body = anthropometry.body(name="p", stature=1.75, mass=75, sex="male")
    front, back = (0.1, 0.05, 0.0), (-0.1, 0.05, 0.0)

    def region(bone, point):
        return Borders(bone, body=body, hand="right").region(*point)

    assert region("thorax", front) == "Chest"
    assert region("thorax", back) == "Back and shoulders"
    assert region("left_clavicle", front) == "Chest"
    assert region("left_clavicle", back) == "Back and shoulders"
    assert region("left_forearm", back) == "Lower arms and wrist joints"
    assert region("right_foot", front) is None
    eye = body.length["head"] - 0.064 * 1.75
    assert region("head", (0.08, eye - 1e-6, 0)) == "Face"
    assert region("head", (0.08, eye + 1e-6, 0)) == "Skull and forehead"


def test_statures_are_in_order_and_unknown_ones_say_so():
    for population in table("statures"):
        for sex in SEXES:
            p5, p50, p95 = (anthropometry.stature(population, sex, p) for p in (5, 50, 95))
            assert 1.4 < p5 < p50 < p95 < 1.9
    with pytest.raises(UnknownName, match="p50"):
        anthropometry.stature("germany", "male", 51)
    with pytest.raises(UnknownName, match="germany"):
        anthropometry.stature("german", "male", 50)
