"""Where limits and contact areas are from, and what becomes of them at the ends of their tolerances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, state_at, two_r
from seerob.core.tolerances import Tolerance
from seerob.criteria.contact.impact_mass import simplified_mass
from seerob.criteria.contact.limits import (
    ContactEnds,
    RegionArrays,
    contact_input,
    credited_input,
    robot_masses,
)
from seerob.criteria.contact.shape import ContactShape, round_shape
from seerob.description.norms.body_limits import shipped

BOX = ContactShape(np.zeros((0, 3)), np.zeros((0, 2)), "edges")


def told(found):
    return found.name, found.value, found.unit, found.origin


def test_an_area_of_its_own_is_the_files_and_the_cap_the_tables():
    assert told(credited_input(1e-4, 1e-4)) == ("largest contact area", 1e-4, "m²", "stated")
    assert told(credited_input(5e-5, 1e-4)) == ("largest contact area", 5e-5, "m²", "given")


def test_a_contact_is_the_files_or_the_meshs_or_missing():
    ball = round_shape(0.005)
    assert told(contact_input("a", ball, area=2e-5)) == ("contact area of a", 2e-5, "m²", "given")
    assert told(contact_input("a", BOX, radius=0.01)) == ("contact radius of a", 0.01, "m", "given")
    assert told(contact_input("a", BOX)) == ("contact radius of a", None, "", "missing")
    assert told(contact_input("a", ball)) == ("contact radius of a", 0.005, "m", "computed")
    flat = round_shape(np.inf)
    assert told(contact_input("a", flat)) == ("contact radius of a", "flat", "", "computed")


def test_a_multiplier_of_the_file_lowers_that_of_the_table_and_never_raises_it():
    own, lower, higher = (RegionArrays.of(shipped(), multiplier=m) for m in (None, 1.5, 3.0))
    assert (own.multiplier == 2.0).all()
    assert (lower.multiplier == 1.5).all()
    assert (higher.multiplier == own.multiplier).all()
    np.testing.assert_allclose(own.pressures()[0], 2 * own.pressures()[1])


def test_which_mass_counts():
    projected = np.array([1.0, 9.0, np.nan])
    assert robot_masses("simplified", 4.0, projected).tolist() == [4, 4, 4]
    assert robot_masses("larger", 4.0, projected).tolist() == [4, 9, 4]
    assert robot_masses("projected", 4.0, projected).tolist() == [1, 9, 4]


def test_permissible_speeds_at_the_ends(tmp_path):
    """Largest with light links, soft bodies and wide contacts; by one input at a time, too."""
    text = FLOATING + TWO_R + "mass_tolerance = 0.25\n"
    cell = made(tmp_path, text, {"arm.urdf": two_r(masses=(4, 4))})
    robot, arrays = cell.model.robot("arm"), RegionArrays.of(shipped())
    state, bodies = state_at(cell, arm=((0.0, 0.0), (0.1, 0.0))), robot.moving
    clamped = np.zeros((2, len(arrays.regions)), bool)
    clamped[:, ::2] = True

    def forces(limits):
        return limits.by_region(np.broadcast_to(limits.pressures() * 1e-4, (2, 2, len(limits.pressure))))

    ends = ContactEnds(cell.model, robot, arrays, forces, stiffness=0.2, area=0.1)
    assert ends.tolerances == (
        Tolerance("mass_tolerance of arm", 25.0, "%"),
        Tolerance("stiffness_tolerance", 20.0, "%"),
        Tolerance("area_tolerance", 10.0, "%"),
    )
    nominal = simplified_mass(cell.model, robot)
    assert nominal == pytest.approx(4.0)

    def speeds(mass=1.0, k=1.0, A=1.0):
        softer = replace(arrays, stiffness=arrays.stiffness * k)
        wider = replace(softer, pressure=softer.pressure * A)
        m_R = np.full(2, nominal * mass)
        return softer.speeds(m_R, forces(wider), clamped).permissible

    found = ends.at(state, bodies, "simplified", nominal, clamped, 1e-3)
    np.testing.assert_allclose(found.low, speeds(1.25, 1.2, 0.9), rtol=1e-9)
    np.testing.assert_allclose(found.high, speeds(0.75, 0.8, 1.1), rtol=1e-9)
    alone = [
        speeds(mass=0.75) - speeds(mass=1.25), speeds(k=0.8) - speeds(k=1.2), speeds(A=1.1) - speeds(A=0.9),
    ]  # fmt: skip
    np.testing.assert_allclose(found.widths, alone, atol=1e-12)
    soft = ContactEnds(cell.model, robot, arrays, forces, stiffness=0.2, area=0.0)
    assert [t.name for t in soft.tolerances] == ["mass_tolerance of arm", "stiffness_tolerance"]
    both = soft.at(state, bodies, "simplified", nominal, clamped, 1e-3)
    np.testing.assert_allclose(both.high, speeds(0.75, 0.8), rtol=1e-9)
