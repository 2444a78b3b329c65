"""Every body area of Table A.2 is somewhere on the skin, in its region, and on the mirrored side too."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.description.humans import anthropometry
from seerob.description.humans.body_areas import AREAS, Borders, area_in, words
from seerob.description.humans.skeleton import BONES
from seerob.description.humans.skin import edges, skin
from seerob.description.norms.body_limits import shipped

MIRROR = np.array([1.0, 1.0, -1.0])


def surface(solid, count=400):
    """Points on a capsule or dilated rectangle, spread at random; (count, 3)."""
    random = np.random.default_rng(0)
    first, second = edges(solid)
    inside = (
        solid.points[0] + random.uniform(size=(count, 1)) * first + random.uniform(size=(count, 1)) * second
    )
    out = random.standard_normal((count, 3))
    return inside + solid.radius * out / np.linalg.norm(out, axis=1, keepdims=True)


def on_skin(body):
    return [(bone, p) for bone, solids in skin(body).items() for solid in solids for p in surface(solid)]


@pytest.mark.parametrize("sex", ["male", "female"])
@pytest.mark.parametrize("hand", ["right", "left"])
def test_all_29_areas_are_on_the_skin_and_in_their_region(sex, hand):
    body = anthropometry.body(name="p", stature=1.7, mass=70, sex=sex)
    region_of = {area.number: region.name for region in shipped().regions.values() for area in region.areas}
    found = set()
    for bone, point in on_skin(body):
        borders = Borders(bone, body=body, hand=hand)
        number = borders.area(*point)
        if number:
            assert borders.region(*point) == region_of[number], (bone, point, number)
            found.add(number)
    assert found == set(region_of) == set(range(1, 30))


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_shoulder_girdle_is_divided_by_its_own_line_and_across_its_middle(side):
    body = anthropometry.body(name="p", stature=1.7, mass=70, sex="female")
    along, borders = body.offset[f"{side}_upper_arm"], Borders(f"{side}_clavicle", body=body, hand="right")
    halfway, cross = along / 2, np.cross(along, [0.0, 1.0, 0.0])
    for far in (-0.1, 0.1):
        beyond = halfway + 0.01 * far * along + cross
        assert borders.outer_shoulder(*beyond.tolist()) is (far > 0)
        across = (
            np.array([1.0, 0.0, 0.0]) - along[0] / (along @ along) * along
        )  # perpendicular to it, forward
        for point in (0.2 * along + far * across, 0.9 * along + far * across):
            assert borders.in_front(*point.tolist()) is (far > 0)


def test_names_are_those_of_the_table():
    for region in shipped().regions.values():
        for area in region.areas:
            assert AREAS[area.number - 1].name.partition(",")[0] == area.name.partition(",")[0].lower()


def test_a_mirrored_point_of_a_left_handed_person_is_in_the_same_area():
    body = anthropometry.body(name="p", stature=1.7, mass=70, sex="male")
    for bone, point in on_skin(body):
        other = bone.replace("right_", "x_").replace("left_", "right_").replace("x_", "left_")
        one = Borders(bone, body=body, hand="right").area(*point)
        two = Borders(other, body=body, hand="left").area(*(point * MIRROR))
        assert one == two
    assert {b for b in BONES if "foot" in b or "toes" in b} <= {
        bone for bone, p in on_skin(body) if not Borders(bone, body=body, hand="right").area(*p)
    }


def test_front_and_back_are_told_apart():
    body = anthropometry.body(name="p", stature=1.7, mass=70, sex="male")

    def at(bone, x, y, z=0.0):
        number = Borders(bone, body=body, hand="right").area(x, y, z)
        return AREAS[number - 1].name if number else None

    assert at("thorax", 0.1, 0.1) == "sternum"
    assert at("thorax", 0.1, 0.1, 0.08) == "pectoral muscle"
    assert at("thorax", -0.1, 0.1) is None
    assert at("right_hand", 0.02, -0.05, -0.02) == "palm, dominant"
    assert at("left_hand", 0.02, -0.05, 0.02) == "palm, non-dominant"
    assert at("left_hand", 0.02, -0.05, -0.02) == "thenar eminence"
    assert at("right_hand", -0.02, -0.17) == "forefinger end joint, dominant"
    assert at("right_thigh", -0.1, -0.1) is None


def test_words_carry_the_area_and_give_it_back():
    said = words("op/right_hand", "Hands and fingers", front=True, dominant=True, area="palm, dominant")
    assert said == "op/right_hand (Hands and fingers, front, palm, dominant side)"
    assert area_in(f"arm/tool0 ↔ {said}", "op") == (
        "right_hand",
        "Hands and fingers, front, palm, dominant side",
    )
