"""Formulae of ISO/TS 15066:2016 A.3 against published and derived vectors, and an integrated impact."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.criteria.contact import collision as c
from seerob.description.norms.body_limits import shipped

MASSES = np.array([1.0, 2, 5, 10, 15, 20])
# mm/s, transient limits, least pressure on 1 cm².
TABLE = {
    "Back and shoulders": ([2273, 1627, 1065, 794, 680, 615], [1732, 1239, 811, 605, 518, 468]),
    "Chest": ([1793, 1283, 840, 626, 536, 485], [1537, 1100, 720, 537, 460, 416]),
    "Lower arms and wrist joints": (
        [1960, 1600, 1339, 1239, 1204, 1187], [2205, 1800, 1506, 1394, 1355, 1335],
    ),
    "Hands and fingers": ([1670, 1505, 1397, 1359, 1346, 1340], [2266, 2042, 1896, 1844, 1827, 1818]),
}  # fmt: skip
# region: printed, (2F)²/2k, F²/2k [J]
ENERGIES = {
    "Skull and forehead": (0.23, 0.2253, 0.0563),
    "Face": (0.11, 0.1127, 0.0282),
    "Neck": (0.84, 0.9000, 0.2250),
    "Back and shoulders": (2.5, 2.5200, 0.6300),
    "Chest": (1.6, 1.5680, 0.3920),
    "Abdomen": (2.4, 2.4200, 0.6050),
    "Pelvis": (2.6, 2.5920, 0.6480),
    "Upper arms and elbow joints": (1.5, 1.5000, 0.3750),
    "Lower arms and wrist joints": (1.3, 1.2800, 0.3200),
    "Hands and fingers": (0.49, 0.5227, 0.1307),
    "Thighs and knees": (1.9, 1.9360, 0.4840),
    "Lower legs": (0.52, 0.5633, 0.1408),
}


@pytest.mark.parametrize("name", TABLE)
def test_speed_table_to_the_printed_digits(name: str) -> None:
    region = shipped().regions[name]
    mu = c.reduced_mass(region.mass.value, MASSES)
    v_F = c.speed_at_force(2 * region.force.value, mu, region.stiffness.value)
    v_P = c.speed_at_pressure(2 * region.pressure.value, 1e-4, mu, region.stiffness.value)
    assert np.round(v_F * 1e3).tolist() == TABLE[name][0]
    assert np.round(v_P * 1e3).tolist() == TABLE[name][1]


@pytest.mark.parametrize("name", ENERGIES)
def test_energy_table_to_the_printed_digits(name: str) -> None:
    region = shipped().regions[name]
    printed, transient, static = ENERGIES[name]
    k, F = region.stiffness.value, region.force.value
    assert region.energy is not None
    assert region.energy.value == printed
    assert round(float(c.spring_energy(2 * F, k)), 4) == transient
    assert round(float(c.spring_energy(F, k)), 4) == static
    limit = float(c.energy_limit(2 * F, k, region.energy.value))
    assert limit == pytest.approx(min(printed, transient), abs=5e-5)


def test_crustcrawler_face_reference() -> None:
    m_R = c.robot_mass(0.49884, 0.0)
    mu = c.reduced_mass(4.4, m_R)
    v = c.speed_at_pressure(110e4, 0.22e-4, mu, 75e3)
    assert (round(float(m_R), 5), round(float(mu), 6), round(float(v), 5)) == (0.24942, 0.236040, 0.18188)


def test_kuka_hand() -> None:
    m_R = c.robot_mass(14.4, 1.441)
    mu = c.reduced_mass(0.6, m_R)
    assert (round(float(m_R), 3), round(float(mu), 6)) == (8.641, 0.561043)
    speeds = [c.speed_at_force(140, mu, 75e3), c.speed_at_force(280, mu, 75e3), c.speed_at_energy(0.49, mu)]
    assert [round(float(v), 6) for v in speeds] == [0.682495, 1.364989, 1.321645]


def test_franka_hand() -> None:
    mu = c.reduced_mass(0.6, c.robot_mass(17.8, 0.0))
    assert round(float(mu), 3) == 0.562
    assert round(float(c.speed_at_force(140, mu, 75e3)), 6) == 0.681850


def test_clamped_hand_is_the_robot_alone() -> None:
    m_R = c.robot_mass(29.104, 0.0)
    mu = c.reduced_mass(np.inf, m_R)
    assert mu == m_R == 14.552
    v = float(c.speed_at_force(140, mu, 75e3))
    assert round(v, 3) == 0.134
    assert v < 0.2 * float(c.speed_at_force(140, c.reduced_mass(0.6, m_R), 75e3))


def test_force_pressure_and_energy_say_the_same_of_one_impact() -> None:
    rng = np.random.default_rng(1)
    F, k, m_H, m_R = rng.uniform(50, 400, 200), *rng.uniform(1, 50, (3, 200))
    k = k * 1e3
    mu = c.reduced_mass(m_H, m_R)
    v = c.speed_at_force(F, mu, k)
    np.testing.assert_allclose(v * np.sqrt(mu * k), F, rtol=1e-12)
    np.testing.assert_allclose(0.5 * mu * v**2, c.spring_energy(F, k), rtol=1e-12)
    np.testing.assert_allclose(c.speed_at_energy(c.spring_energy(F, k), mu), v, rtol=1e-12)
    np.testing.assert_allclose(c.speed_at_pressure(F / 1e-4, 1e-4, mu, k), v, rtol=1e-12)


def test_the_force_of_a_speed_is_that_of_two_masses_and_a_spring_integrated() -> None:
    m_H, m_R, k, v = 0.6, 8.641, 75e3, 1.0
    x, dx, dt, most = np.zeros(2), np.array([v, 0.0]), 1e-6, 0.0
    while x[0] >= x[1]:
        F = k * (x[0] - x[1])
        most = max(most, F)
        dx = dx + dt * np.array([-F / m_R, F / m_H])
        x = x + dt * dx
    assert float(c.speed_at_force(most, c.reduced_mass(m_H, m_R), k)) == pytest.approx(v, rel=1e-5)


def test_least_speed_governs_and_an_equal_energy_is_called_force() -> None:
    v, which = c.permissible_speed([1, 2, 3, 1, 2], [2, 1, 3, 1.5, np.nan], [3, 3, 1, 1, 1.5])
    assert v.tolist() == [1, 1, 1, 1, 1.5]
    assert which.tolist() == [0, 1, 2, 0, 2]


def test_an_energy_that_is_the_forces_own_is_called_force_within_rounding() -> None:
    assert c.permissible_speed(1.0, 2.0, 1.0 - 1e-14)[1] == c.Governing.FORCE
    assert c.permissible_speed(1.0, 2.0, 1.0 - 1e-9)[1] == c.Governing.ENERGY
    # At the last one that is rounding the force's own figure is said.
    least, which = c.permissible_speed(1.0, 2.0, 1.0 - 1e-12)
    assert (float(least), which) == (1.0, c.Governing.FORCE)


def test_a_force_that_cannot_be_is_refused_in_newtons() -> None:
    with pytest.raises(ValueError, match="F is -1 N"):
        c.spring_energy(-1.0, 75e3)


def test_heavier_robots_and_stiffer_bodies_are_never_permitted_more() -> None:
    mu = c.reduced_mass(0.6, np.linspace(0.1, 100, 500))
    assert (np.diff(c.speed_at_force(280, mu, 75e3)) < 0).all()
    assert (np.diff(c.speed_at_pressure(380e4, 1e-4, 0.5, np.linspace(1e3, 1e5, 500))) < 0).all()


def test_mass_along_of_the_planar_arm() -> None:
    J_v = np.array([[[-1.0, -1], [1, 0], [0, 0]]] * 3)
    u = np.array([[1.0, 0, 0], [0, 1, 0], [np.sqrt(0.5), np.sqrt(0.5), 0]])
    masses = c.mass_of_rows(np.einsum("bij,bi->bj", J_v, u), np.array([[3.0, 1], [1, 1]]))
    np.testing.assert_allclose(masses, [1, 2, 4 / 3], rtol=1e-12)
