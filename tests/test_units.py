"""Units at the door."""

import math

import pytest

from seerob.core import units


def test_a_suffix_is_split_off_with_its_factor():
    assert units.split("rpy_deg") == ("rpy", "rad", math.pi / 180)
    assert units.split("limit_mm_s") == ("limit", "m/s", 1e-3)
    assert units.split("density_g_cm3") == ("density", "kg/m³", 1e3)


def test_every_reading_of_an_ambiguous_key_is_offered_longest_first():
    assert [stem for stem, _, _ in units.splits("x_deg_s")] == ["x"]
    assert [(stem, unit) for stem, unit, _ in units.splits("a_mm")] == [("a", "m")]
    assert list(units.splits("mm")) == list(units.splits("_mm")) == list(units.splits("radius")) == []


@pytest.mark.parametrize("suffix", units.SUFFIXES)
def test_every_suffix_is_found_and_only_as_a_whole_word(suffix):
    assert ("x", *units.SUFFIXES[suffix]) in units.splits(f"x_{suffix}")
    assert units.split(f"x{suffix}") is None


def test_factors_are_the_defined_ones():
    assert units.SUFFIXES["inch"][1] == units.LENGTHS["inch"] == 0.0254
    assert units.LENGTHS["ft"] == pytest.approx(12 * units.LENGTHS["inch"], rel=1e-15)
    for name in ("mm", "cm"):
        assert units.SUFFIXES[name] == ("m", units.LENGTHS[name])
    # 1 g/cm³ is 1e-3 kg in 1e-6 m³.
    assert units.SUFFIXES["g_cm3"][1] == pytest.approx(units.SUFFIXES["g"][1] / units.LENGTHS["cm"] ** 3)
