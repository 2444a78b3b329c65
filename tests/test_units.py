"""Units at the door."""

import math
from typing import Annotated

import pytest

from seerob.core import quantities
from seerob.core.errors import Problem
from seerob.core.quantities import Table
from seerob.workstation.conversion import convert


def test_a_suffix_is_split_off_with_its_factor():
    assert quantities.split("rpy_deg") == ("rpy", "rad", math.pi / 180)
    assert quantities.split("limit_mm_s") == ("limit", "m/s", 1e-3)
    assert quantities.split("density_g_cm3") == ("density", "kg/m³", 1e3)


def test_every_reading_of_an_ambiguous_key_is_offered_longest_first():
    assert [stem for stem, _, _ in quantities.splits("x_deg_s")] == ["x"]
    assert [(stem, unit) for stem, unit, _ in quantities.splits("a_mm")] == [("a", "m")]
    assert (
        list(quantities.splits("mm"))
        == list(quantities.splits("_mm"))
        == list(quantities.splits("radius"))
        == []
    )


@pytest.mark.parametrize("suffix", quantities.SUFFIXES)
def test_every_suffix_is_found_and_only_as_a_whole_word(suffix):
    assert ("x", *quantities.SUFFIXES[suffix]) in quantities.splits(f"x_{suffix}")
    assert quantities.split(f"x{suffix}") is None


def test_factors_are_the_defined_ones():
    assert quantities.SUFFIXES["inch"][1] == quantities.LENGTHS["inch"] == 0.0254
    assert quantities.LENGTHS["ft"] == pytest.approx(12 * quantities.LENGTHS["inch"], rel=1e-15)
    for name in ("mm", "cm"):
        assert quantities.SUFFIXES[name] == ("m", quantities.LENGTHS[name])
    # 1 g/cm³ is 1e-3 kg in 1e-6 m³.
    assert quantities.SUFFIXES["g_cm3"][1] == pytest.approx(
        quantities.SUFFIXES["g"][1] / quantities.LENGTHS["cm"] ** 3
    )


def test_a_refusal_says_the_unit_the_bound_and_the_value_of_the_key_that_is_written():
    class Cut(Table, frozen=True, kw_only=True):
        angle: Annotated[float, quantities.unit("rad", gt=0, le=math.pi)] | None = None
        speed: Annotated[float, quantities.unit("rad/s", ge=0)] = 0.0
        at: quantities.Metres3 = (0.0, 0.0, 0.0)
        density: quantities.Density | None = None

    def refused(**table):
        problems: list[Problem] = []
        assert convert(table, Cut, file="f", key="cut", problems=problems) is None
        [problem] = problems
        return f"{problem.key}: {problem.what}; {problem.remedy}"

    assert refused(angle="") == "cut.angle: '' is wrong; expected a number [rad]"
    assert refused(angle_deg="") == "cut.angle_deg: '' is wrong; expected a number [deg]"
    assert refused(angle_deg=200) == "cut.angle_deg: 200 is wrong; expected a number <= 180 [deg]"
    assert refused(angle=4) == f"cut.angle: 4 is wrong; expected a number <= {math.pi} [rad]"
    assert refused(speed_deg_s=-90) == "cut.speed_deg_s: -90 is wrong; expected a number >= 0 [deg/s]"
    assert refused(at_mm=[0, "a", 1]) == "cut.at_mm[1]: 'a' is wrong; expected a number [mm]"
    assert refused(at_mm=[0, 2e7, 1]) == "cut.at_mm[1]: 20000000.0 is wrong; expected a number <= 1e+06 [mm]"
    assert refused(at_mm=[0, 0]) == "cut.at_mm: [0, 0] is wrong; expected a list [...] of length 3 [mm]"
    assert refused(at_mm=[0, 2e14, 1]).endswith(
        "200000000000000.0 is wrong; expected a finite number, not beyond 1e+12"
    )
    assert refused(density_g_cm3=2e5).endswith("200000.0 is wrong; expected a number <= 100 [g/cm³]")
