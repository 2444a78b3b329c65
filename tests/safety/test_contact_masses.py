"""Masses that power and force limiting rests on: those that move, and those that nobody gave."""

from __future__ import annotations

from pathlib import Path

import pytest

from made_cell import FLOATING, TWO_R, UR10, judged, made, results_at, state_at, two_r
from seerob.core.snapshot import Verdict


def test_mass_of_the_basis_is_without_the_fixed_base(tmp_path: Path) -> None:
    text = UR10 + '[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "arm"\n'
    station = made(tmp_path, text)
    inputs = {i.name: i.value for i in station.bound[0].basis.inputs}
    M = inputs["M, moving links of arm"]
    assert pytest.approx(28.435, abs=0.01) == M  # published sum of the six links
    q = ([0, -1.2, 1.4, -1.5, -1.5, 0], [0.1, 0, 0, 0, 0, 0])
    assert {p.name: p.value for p in results_at(station, arm=q)["pfl"].parts}["M/2 + m_L"] == pytest.approx(
        M / 2 + 3
    )


@pytest.mark.parametrize("kind", ['power_and_force"\nrobot = "arm', 'effective_mass"\nat = "arm'])
def test_what_is_mounted_counts_in_full_whatever_it_is_called(tmp_path: Path, kind: str) -> None:
    """A tool and a workpiece named below the robot are no links of it."""
    named = UR10.replace('name = "load"', 'name = "arm/load"')
    named += '[[workpieces]]\nname = "arm/load/plate"\non = "arm/load"\nshape = { sphere = 0.1 }\nmass = 2\n'
    station = made(tmp_path, f'{named}[[safety]]\nkind = "{kind}"\n')
    result = results_at(station, arm=([0, -1.2, 1.4, -1.5, -1.5, 0], [0.1, 0, 0, 0, 0, 0])).popitem()[1]
    found = next(p.value for p in result.parts if p.name == "M/2 + m_L")
    assert found == pytest.approx(28.435 / 2 + 3 + 2, abs=0.005)


def test_unknown_mass_is_undecided(tmp_path: Path) -> None:
    urdf = two_r()
    start = urdf.index("<inertial>", urdf.index('name="l2"'))
    bare = urdf[:start] + urdf[urdf.index("</inertial>", start) + len("</inertial>") :]
    text = f'{FLOATING}{TWO_R}[[safety]]\nkind = "power_and_force"\nrobot = "arm"\n'
    station = made(tmp_path, text, {"arm.urdf": bare})
    result = judged(station.bound, state_at(station, arm=([0.0, 0.0], [0.1, 0])))[0]
    assert result.verdict is Verdict.UNDECIDED
    assert "arm/l2" in result.reason
