"""Intervals of the permissible speed of a contact: exact ends, the verdict between them, and what decides."""

from __future__ import annotations

import pytest

from made_cell import FLOATING, TWO_R, made, results_at, two_r


def criterion(kind, options):
    return f'[[safety]]\nkind = "{kind}"\nname = "it"\n{options}\n'


def contact(folder, options="", *, robot="", speed=1.0, links=(4.0, 4.0)):
    text = FLOATING + TWO_R + robot
    text += criterion(
        "power_and_force",
        f'robot = "arm"\nexcluded = [{EXCLUDED}]\ncontact_area = {{ arm = 1e-4 }}\nfloor = false\n{options}',
    )
    station = made(folder, text, {"arm.urdf": two_r(masses=links)})
    return results_at(station, arm=((0.0, 0.0), (speed, 0.0)))["it"]


EXCLUDED = '"Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"'


def region(result, name="Chest"):
    return next(part for part in result.parts if part.name == name)


def test_permissible_speed_lies_between_those_of_the_ends(tmp_path):
    """Free chest: pressure governs, v = p A / √(μ k), so masses, k and A count; at the high end energy."""
    off = contact(
        tmp_path / "off",
        "stiffness_tolerance = 0.2\narea_tolerance = 0.1",
        robot="mass_tolerance = 0.25\n",
        speed=0.1,
    )
    chest = region(off)
    # With M/2 = 4 kg ± 1 kg the arm along its motion is lighter, so that M/2 counts.
    mass = {m.name: m.value for m in off.parts}["M/2 + m_L"]
    assert mass == pytest.approx(4.0)

    def speed(m, k, A):
        from seerob.criteria.contact import collision

        mu = collision.reduced_mass(40.0, m)
        by_force = collision.speed_at_force(280.0, mu, k * 25e3)
        by_energy = collision.speed_at_energy(collision.energy_limit(280.0, k * 25e3, 1.6), mu)
        return float(min(collision.speed_at_pressure(2 * 120e4, A * 1e-4, mu, k * 25e3), by_force, by_energy))

    m_u = {m.name: m.value for m in off.parts}["m_u along the motion, heaviest part"]
    heavier = max(4.0, m_u)
    assert chest.limit == pytest.approx(speed(heavier, 1.0, 1.0))
    low, high = speed(heavier * 1.25, 1.2, 0.9), speed(heavier * 0.75, 0.8, 1.1)
    assert chest.interval == pytest.approx(
        (chest.value - (high - chest.limit), chest.value + chest.limit - low)
    )


@pytest.mark.parametrize(
    ("options", "robot", "decides"),
    [
        ("", "mass_tolerance = 0.25\n", "mass_tolerance of arm ± 25 %"),
        ("stiffness_tolerance = 0.3", "", "stiffness_tolerance ± 30 %"),
        ("area_tolerance = 0.3\nstiffness_tolerance = 0.1", "", "area_tolerance ± 30 %"),
    ],
)
def test_verdict_of_contact_is_open_between_the_ends(tmp_path, options, robot, decides):
    slow = region(contact(tmp_path / "slow", options, robot=robot, speed=0.05))
    per_speed = slow.value / 0.05
    below, above = slow.interval
    least, largest = slow.limit - (above - slow.value), slow.limit + (slow.value - below)
    for k, (v, verdict) in enumerate(
        [
            (least * 0.999, "within"),
            (least * 1.001, "undecided"),
            (largest * 0.999, "undecided"),
            (largest * 1.001, "exceeded"),
        ]
    ):
        found = region(contact(tmp_path / str(k), options, robot=robot, speed=v / per_speed))
        assert found.verdict == verdict
        assert (f"decided by {decides}" in found.reason) == (verdict == "undecided")
        if verdict == "undecided":
            assert all(area.verdict == "undecided" for area in found.parts)
        if verdict == "within":
            assert all(area.verdict == "within" for area in found.parts)


def test_without_tolerances_nothing_changes(tmp_path):
    plain = contact(tmp_path / "a", speed=0.1)
    zero = contact(tmp_path / "b", "stiffness_tolerance = 0.0\narea_tolerance = 0.0", speed=0.1)
    assert plain.interval is None
    assert [(p.value, p.limit, p.verdict) for p in plain.parts] == [
        (p.value, p.limit, p.verdict) for p in zero.parts
    ]
