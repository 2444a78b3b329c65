"""How parts touch by word of the file: what is said of a part counts before what is said of its robot."""

from __future__ import annotations

import pytest

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.contact.given import given_contacts

GRIP = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = { sphere = 0.02 }\nmass = 1\n'
PFL = '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\nmass = "simplified"\n'


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return made(tmp_path_factory.mktemp("given"), FLOATING + TWO_R + GRIP, {"arm.urdf": two_r()}).model


@pytest.mark.parametrize(
    ("radii", "areas", "wanted"),
    [
        ({"grip": 1, "arm": 9}, {}, ({"arm/l1": 9, "arm/l2": 9, "grip": 1}, {})),
        ({"arm": 9, "grip": 1}, {}, ({"arm/l1": 9, "arm/l2": 9, "grip": 1}, {})),
        ({}, {"grip": 9, "arm": 1}, ({}, {"arm/l1": 1, "arm/l2": 1, "grip": 9})),
        ({"grip": 1}, {"arm": 9}, ({"grip": 1}, {"arm/l1": 9, "arm/l2": 9})),
        ({"arm": 9}, {"grip": 1}, ({"arm/l1": 9, "arm/l2": 9}, {"grip": 1})),
        ({"grip": 1}, {"grip": 9}, ({}, {"grip": 9})),
        ({"arm/l*": 3, "arm/l1": 9, "*/l1": 4, "arm": 1}, {}, ({"arm/l1": 4, "arm/l2": 3, "grip": 1}, {})),
    ],
)
def test_the_narrowest_name_counts_in_whatever_order(model, radii, areas, wanted):
    names = {body.index: body.name for body in model.bodies}
    found = given_contacts(model, model.robot("arm"), radii, areas)
    assert tuple({names[i]: value for i, value in each.items()} for each in found) == wanted


@pytest.mark.parametrize("said", ['"arm/l2" = 2e-6, arm = 1e-4', 'arm = 1e-4, "arm/l2" = 2e-6'])
def test_a_sharp_part_of_a_blunt_robot_stays_sharp(tmp_path, said):
    def limit(folder, text):
        station = made(tmp_path / folder, FLOATING + TWO_R + PFL + text, {"arm.urdf": two_r()})
        result = results_at(station, arm=((0.0, 0.0), (0.2, 0.0)))["pfl"]
        return next(part.limit for part in result.parts if part.name == "Chest")

    assert limit("both", f"contact_area = {{ {said} }}") == limit("sharp", "contact_area = { arm = 2e-6 }")
