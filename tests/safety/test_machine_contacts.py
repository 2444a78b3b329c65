"""Power and force limiting of what is no robot: carts, doors, axes, and the arm that they carry about."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, judged, made, results_at, state_at, two_r
from seerob.core.errors import InputError
from seerob.core.verdict import Verdict
from seerob.criteria.contact.limits import permissible_while_pushed

CART = """
[[machines]]
name = "cart"
shape = { box = [1, 0.6, 0.3] }
at = { position = [0, 0, 5] }
mass = 100
slide = { along = [1, 0, 0], lower = -1, upper = 1 }
"""
DOOR = CART.replace("cart", "door").replace("[1, 0.6, 0.3]", "[1, 0.02, 2]").replace("100", "30").replace(
    "slide = { along = [1, 0, 0], lower = -1, upper = 1 }", "turn = { about = [0, 1, 0] }"
)  # fmt: skip
CONTACT = """
[[safety]]
kind = "power_and_force"
name = "F"
robot = "cart"
contact_area = { "*" = 1e-4 }
excluded = ["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]
"""
ARM = f'{TWO_R}on = "cart"\nbase = {{ position = [0, 0, 0.5] }}\n'
ARM_TOO = CONTACT.replace('"F"', '"A"').replace('"cart"', '"arm"')
K, F_S, M_H = 40e3, 160.0, 2.0
"""Of lower arms and wrists: stiffness [N/m], quasi-static force [N], mass [kg]."""


def free(m_R):
    """Transient force limit against a lower arm that can give way [m/s]."""
    return 2 * F_S / np.sqrt(K / (1 / M_H + 1 / m_R))


def lower_arm(result):
    return next(part for part in result.parts if part.name == "Lower arms and wrist joints")


def results(folder, text, **motion):
    cell = made(folder, FLOATING + text, {"arm.urdf": two_r()})
    return {r.name: r for r in judged(cell.bound, state_at(cell, **motion))}


def test_a_cart_hits_with_all_of_its_mass(tmp_path):
    found = results(tmp_path, CART + CONTACT + "drive_force = 0\n", cart=([0.0], [0.1]))["F"]
    assert found.verdict is Verdict.WITHIN
    assert lower_arm(found).limit == pytest.approx(free(100.0), rel=1e-9)
    masses = {part.name: part.value for part in found.parts if part.unit == "kg"}
    assert masses == pytest.approx({"whole mass": 100.0, "m_u along the motion, heaviest part": 100.0})


@pytest.mark.parametrize(
    ("given", "v", "verdict", "why"),
    [
        ("", 0.01, Verdict.UNDECIDED, "drive_force"),
        ("", 3.0, Verdict.EXCEEDED, ""),
        ("drive_force = 20\n", 0.1, Verdict.WITHIN, ""),
        ("drive_force = 130\n", 0.1, Verdict.UNDECIDED, "keeps pushing with 130 N (cart moves)"),
    ],
)
def test_what_its_drive_does_after_the_blow_is_known_or_it_is_not_within(tmp_path, given, v, verdict, why):
    found = results(tmp_path, CART + CONTACT + given, cart=([0.0], [v]))["F"]
    assert found.verdict is verdict
    assert why in found.reason
    if not given:
        rows = [*found.rows, *(area for part in found.parts for area in part.parts)]
        assert Verdict.WITHIN not in {row.verdict for row in rows}


@pytest.mark.parametrize("v", [0.02, 9e-4, 1e-5, -1e-5])
@pytest.mark.parametrize(
    ("drive", "verdict"), [("", Verdict.UNDECIDED), ("drive_force = 5000\n", Verdict.EXCEEDED)]
)
def test_a_drive_presses_as_hard_however_slowly_it_moves(tmp_path, v, drive, verdict):
    """A cart that closes a gap of 30 mm at a wall."""
    wall = '[[parts]]\nname = "wall"\nshape = { box = [0.2, 4, 4] }\n'
    wall += "at = { position = [0.63, 0, 5] }\n"
    found = results(tmp_path, CART + wall + CONTACT + drive, cart=([0.0], [v]))["F"]
    assert found.verdict is verdict
    assert results(tmp_path / "0", CART + wall + CONTACT + drive, cart=([0.0], [0.0]))["F"].verdict is None


@pytest.mark.parametrize("v", [0.1, 5e-4])
def test_a_carrier_presses_with_the_arm_that_it_carries_however_slowly_it_moves(tmp_path, v):
    text = CART + ARM + ARM_TOO
    found = results(tmp_path, text, cart=([0.0], [v]), arm=([0.3, 0.5], [0.0, 0.0]))["A"]
    assert found.verdict is Verdict.UNDECIDED
    assert "(cart moves and carries arm)" in found.reason


def test_a_mass_that_nobody_gave_is_undecided(tmp_path):
    text = CART.replace("mass = 100\n", "") + CONTACT + "drive_force = 0\n"
    found = results(tmp_path, text, cart=([0.0], [0.1]))["F"]
    assert found.verdict is Verdict.UNDECIDED
    assert "the mass of cart" in found.reason


def test_a_cart_that_carries_an_arm_carries_its_mass_and_the_arm_hits_with_all_of_it(tmp_path):
    text = CART + ARM + CONTACT + "drive_force = 0\n" + ARM_TOO
    found = results(tmp_path, text + "drive_force = 0\n", cart=([0.0], [0.1]), arm=([0.3, 0.5], [0.0, 0.0]))
    for name in ("F", "A"):
        assert found[name].verdict is Verdict.WITHIN
        assert lower_arm(found[name]).limit == pytest.approx(free(102.0), rel=1e-9)
    # The arm by itself is one of ISO/TS 15066: M/2 + m_L, at least the mass that its joints show.
    still = results(tmp_path, text, cart=([0.0], [0.0]), arm=([0.3, 0.5], [0.0, 0.1]))
    assert still["A"].verdict is Verdict.WITHIN
    assert lower_arm(still["A"]).limit == pytest.approx(free(1.0), rel=1e-9)
    silent = results(tmp_path, text, cart=([0.0], [0.1]), arm=([0.3, 0.5], [0.0, 0.0]))["A"]
    assert silent.verdict is Verdict.UNDECIDED
    assert "(cart moves and carries arm)" in silent.reason


def test_a_door_yields_at_its_edge_where_the_file_chooses_that(tmp_path):
    text = DOOR + CONTACT.replace('"cart"', '"door"') + "drive_force = 0\n"
    whole = results(tmp_path, text, door=([0.0], [0.3]))["F"]
    edge = results(tmp_path, text + 'mass = "projected"\n', door=([0.0], [0.3]))["F"]
    inertia, reach = 30 * (1.0**2 + 2.0**2) / 12, 0.5**2 + 1.0**2
    assert lower_arm(whole).limit == pytest.approx(free(30.0), rel=1e-9)
    assert lower_arm(edge).limit == pytest.approx(free(inertia / reach), rel=1e-3)


def test_at_the_permissible_speed_blow_and_drive_reach_the_limit_together():
    m, F, drive = 30.0, 160.0, np.array([0.0, 30.0, 79.0, 80.0, 200.0])
    v = np.array([float(permissible_while_pushed(np.array(F / np.sqrt(K * m)), m, K, d)) for d in drive])
    np.testing.assert_allclose((drive + np.sqrt(drive**2 + K * m * v**2))[:4], F, rtol=1e-9)
    assert v[3:].tolist() == [0, 0]


def test_a_robot_that_nothing_carries_takes_no_drive_force(tmp_path):
    text = TWO_R + ARM_TOO + "drive_force = 10\n"
    with pytest.raises(InputError, match="drive_force"):
        _ = made(tmp_path, FLOATING + text, {"arm.urdf": two_r()}).bound


@pytest.mark.parametrize(
    ("drive", "verdict"),
    [
        ("", Verdict.UNDECIDED),
        ("drive_force = 50\n", Verdict.WITHIN),
        ("drive_force = 400\n", Verdict.EXCEEDED),
    ],
)
@pytest.mark.parametrize("v", [0.02, 4e-4])
def test_fingers_that_close_press_as_hard_as_their_gripper(tmp_path, drive, verdict, v):
    """140 N is what a hand may be pressed with; the fingers alone, 0.15 kg at 20 mm/s, press with 2 N."""
    excluded = '["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]'
    text = (
        'engine = { physics = false }\n[[robots]]\nname = "arm"\nmodel = "library:ur10"\n'
        "base = { position = [0, 0, 1] }\n"
        '[[machines]]\nname = "hand"\non = "arm/tool0"\nshape = { box = [0.02, 0.02, 0.08] }\nmass = 0.15\n'
        "at = { position = [0, 0, 0.05] }\ngrip = { upper = 0.1 }\n"
        '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\nmass = "simplified"\n'
        'contact_area = { arm = 1e-4, "hand/left" = 1e-4, "hand/right" = 1e-4 }\n'
        f"excluded = {excluded}\n{drive}"
    )
    station = made(tmp_path, text)
    arm = (np.radians([0, -90, 90, -90, -90, 0]), np.zeros(6))
    for speed in (-v, 0.0):
        found = results_at(station, arm=arm, hand=([0.05], [speed]))["pfl"]
        assert found.verdict is (verdict if speed else None), found.reason
        assert not speed or "hand" in found.reason
