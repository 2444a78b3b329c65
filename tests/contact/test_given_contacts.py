"""How parts touch by word of the file: what is said of a part counts before what is said of its robot."""

from __future__ import annotations

import pytest

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.criteria.contact.shape import given_contacts

GRIP = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = { sphere = 0.02 }\nmass = 1\n'
PFL = '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\nmass = "simplified"\n'


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return made(tmp_path_factory.mktemp("given"), FLOATING + TWO_R + GRIP, {"arm.urdf": two_r()}).model


@pytest.mark.parametrize(
    ("radii", "areas", "wanted"),
    [
        ({"arm": 9}, {}, ({"arm/l1": 9, "arm/l2": 9}, {})),
        ({"grip": 1, "arm": 9}, {}, ({"arm/l1": 9, "arm/l2": 9, "grip": 1}, {})),
        ({"arm": 9, "grip": 1}, {}, ({"arm/l1": 9, "arm/l2": 9, "grip": 1}, {})),
        ({}, {"grip": 9, "arm": 1}, ({}, {"arm/l1": 1, "arm/l2": 1, "grip": 9})),
        ({"grip": 1}, {"arm": 9}, ({"grip": 1}, {"arm/l1": 9, "arm/l2": 9})),
        ({"arm": 9}, {"grip": 1}, ({"arm/l1": 9, "arm/l2": 9}, {"grip": 1})),
        ({"grip": 1}, {"grip": 9}, ({}, {"grip": 9})),
        ({"arm/l*": 3, "arm/l1": 9, "*/l1": 4, "arm": 1}, {}, ({"arm/l1": 4, "arm/l2": 3}, {})),
        ({"*": 2}, {"arm": 1}, ({"grip": 2}, {"arm/l1": 1, "arm/l2": 1})),
    ],
)
def test_the_narrowest_name_counts_in_whatever_order(model, radii, areas, wanted):
    names = {body.index: body.name for body in model.bodies}
    *found, by = given_contacts(model, model.robot("arm"), radii, areas)
    assert tuple({names[i]: value for i, value in each.items()} for each in found) == wanted
    assert {*by} == {*found[0], *found[1]}


@pytest.mark.parametrize(("more", "known"), [("", False), (", grip = 1e-4", True)])
def test_the_area_of_an_arm_says_nothing_of_its_tool(tmp_path, more, known):
    """A box whose edges nobody knows, at the end of an arm with a known area: only its own decides it."""
    box = GRIP.replace("sphere = 0.02", "box = [0.1, 0.1, 0.1]")
    text = f"{FLOATING}{TWO_R}{box}{PFL}contact_area = {{ arm = 1e-4{more} }}\n"
    text += 'excluded = ["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]\n'
    cell = made(tmp_path, text, {"arm.urdf": two_r()})
    result = results_at(cell, arm=((0.0, 0.0), (0.05, 0.0)))["pfl"]
    assert result.verdict == ("within" if known else "undecided")
    sources = {
        i.name: i.source for i in cell.bound[0].basis.inputs if "grip" in i.name and "contact" in i.name
    }
    assert ("workstation file, of grip" in sources.values()) is known


@pytest.mark.parametrize("said", ['"arm/l2" = 2e-6, arm = 1e-4', 'arm = 1e-4, "arm/l2" = 2e-6'])
def test_a_sharp_part_of_a_blunt_robot_stays_sharp(tmp_path, said):
    def limit(folder, text):
        station = made(tmp_path / folder, FLOATING + TWO_R + PFL + text, {"arm.urdf": two_r()})
        result = results_at(station, arm=((0.0, 0.0), (0.2, 0.0)))["pfl"]
        return next(part.limit for part in result.parts if part.name == "Chest")

    assert limit("both", f"contact_area = {{ {said} }}") == limit("sharp", "contact_area = { arm = 2e-6 }")
