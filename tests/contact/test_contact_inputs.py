"""Where limits and contact areas are from, and what becomes of them at the ends of their tolerances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, state_at, two_r
from seerob.core.tolerances import Spread, Tolerance
from seerob.core.verdict import Verdict
from seerob.criteria.contact.impact_mass import simplified_mass
from seerob.criteria.contact.limits import (
    ContactEnds,
    Judged,
    RegionArrays,
    Speeds,
    area_verdict,
    contact_input,
    credited_input,
    permissible_while_pushed,
    pushed,
    relative,
    robot_masses,
)
from seerob.criteria.contact.shape import ContactShape, round_shape
from seerob.description.norms.body_limits import shipped

BALL = round_shape(0.003)
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
    assert robot_masses("projected", 0.0, projected).tolist() == [1, 9, 0]
    with pytest.raises(ValueError, match=r"simplified is -0\.1 kg"):
        robot_masses("larger", -0.1, projected)


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


def test_a_surface_hits_with_both_speeds_or_as_fast_as_both_sides_close():
    v_r, v_h = np.array([1.0, 2.0]), np.array([0.5, 0.0, 4.0])
    assert relative(v_r, v_h, None).tolist() == [[1.5, 1, 5], [2.5, 2, 6]]
    closing = np.array([[1.4, 1.6, 9.0], [np.inf, 1.0, 0.0]])
    assert relative(v_r, v_h, closing).tolist() == [[1.5, 1.6, 9], [np.inf, 2, 6]]


def test_what_a_region_does_not_settle_is_open_for_its_areas():
    ends = Spread(np.zeros(1), np.ones(1), np.zeros((0, 1)))
    for verdict in Verdict:
        assert area_verdict(verdict, None, None) is verdict
        for region in (*Verdict, None):
            settled = verdict is region
            assert area_verdict(verdict, region, ends) is (verdict if settled else Verdict.UNDECIDED)
            assert area_verdict(verdict, region, None) is verdict


def test_a_flat_contact_spreads_its_force_over_the_largest_area_that_is_credited():
    arrays = RegionArrays.of(shipped())
    flat = arrays.pressure_force(round_shape(np.inf), 5e-5)
    np.testing.assert_allclose(flat, 5e-5 * arrays.pressures())
    # Of several round patches the one that presses most counts, whichever comes first.
    sharp = arrays.pressure_force(BALL, 1e-4)
    for radii in ([0.003, 0.02], [0.02, 0.003], [0.02, 0.003, 0.005]):
        several = replace(BALL, radii=np.array([[r, r] for r in radii]))
        np.testing.assert_allclose(arrays.pressure_force(several, 1e-4), sharp)
    assert (sharp < arrays.pressure_force(round_shape(0.02), 1e-4)).all()
    # A rounder one may press more than one whose least radius is smaller: the least force of all counts.
    patches = np.array([[0.003, 0.1], [0.004, 0.004]])
    each, both = (
        [arrays.pressure_force(replace(BALL, radii=radii), 1e-4) for radii in parts]
        for parts in ((patches[:1], patches[1:]), (patches, patches[::-1]))
    )
    assert (each[1] < each[0]).all()
    for found in both:
        np.testing.assert_allclose(found, each[1])


def test_limits_of_energy_are_those_of_the_table():
    arrays = RegionArrays.of(shipped())
    for region, energy in zip(arrays.regions, arrays.energy, strict=True):
        assert np.isnan(energy) if region.energy is None else energy == region.energy.value
    assert not np.isnan(arrays.energy).all()


def test_with_a_drive_behind_it_a_blow_and_its_push_come_to_the_force():
    """Energy: what moves and what the drive adds on the way in are what the spring takes up."""
    random = np.random.default_rng(3)
    v, mu, k = random.uniform(0.1, 2, 50), random.uniform(0.5, 20, 50), random.uniform(1e4, 1.5e5, 50)
    force = v * np.sqrt(mu * k)
    for share in (0.0, 0.1, 0.4):
        F = share * force.min()
        found = permissible_while_pushed(v, mu, k, F)
        deep = force / k
        np.testing.assert_allclose(0.5 * mu * found**2 + F * deep, 0.5 * k * deep**2)
    # Half of the force that is reached by a blow, pushed on from rest, reaches it too.
    assert permissible_while_pushed(v[:1], mu[:1], k[:1], 0.51 * force[0]) == 0.0
    assert permissible_while_pushed(v[:1], mu[:1], k[:1], 0.5 * force[0]) == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(ValueError, match="F is -1 N"):
        permissible_while_pushed(v, mu, k, -1.0)
    with pytest.raises(ValueError, match="v is -1 m/s"):
        permissible_while_pushed(-np.ones(1), mu[:1], k[:1], 0.0)


@pytest.mark.parametrize("tolerant", [False, True])
def test_a_drive_lowers_what_is_within_and_alone_exceeds_where_nobody_can_recoil(tolerant):
    v, mu, k, force = (
        np.array([[1.0, 1.0]]),
        np.array([[2.0, 2.0]]),
        np.full(2, 2e4),
        np.array([150.0, 100.0]),
    )
    speeds = Speeds(v, np.zeros((1, 2), np.int64), v, v, v, mu)
    ends = Spread(0.9 * v, 1.1 * v, np.ones((3, 1, 2))) if tolerant else None
    low, high = (0.9 * v, 1.1 * v) if tolerant else (v, v)
    clamped = np.array([[True, True]])
    none = np.zeros(2, np.int64)
    judged = Judged(v[0, :1], clamped[0, :1], v[0], clamped, v[0, :1], speeds, clamped, none, none, ends)
    np.testing.assert_array_equal(judged.least, low)
    np.testing.assert_array_equal(judged.v, [[2.0, 2.0]])
    nobody = pushed(speeds, ends, k, force, clamped, None)
    np.testing.assert_array_equal(nobody.low, 0 * v)
    np.testing.assert_array_equal(nobody.high, high)
    for drive, exceeds in ((20.0, [False, False]), (100.0, [False, False]), (101.0, [False, True])):
        for held in (clamped, ~clamped, np.array([[False, True]])):
            found = pushed(speeds, ends, k, force, held, drive)
            alone = np.where(held & np.array([exceeds]), 0.0, high)
            np.testing.assert_allclose(found.high, alone)
            slower = permissible_while_pushed(low, mu, k, drive)
            np.testing.assert_allclose(found.low, np.minimum(slower, alone))
            assert (found.low < low).all()
            assert found.widths.shape == ((3, 1, 2) if tolerant else (0, 1, 2))
    here = pushed(speeds, ends, k, force, clamped, 101.0, where=np.array([[True, False]]))
    assert (here.low[0, 1], here.high[0, 1]) == (low[0, 1], high[0, 1])
    assert here.low[0, 0] < low[0, 0]
