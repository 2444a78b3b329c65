"""Units at the door."""

import math

import pytest

from seerob.core import quantities


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
