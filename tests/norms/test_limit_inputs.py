"""A table of limits as inputs: every figure with its unit, and which ones the workstation file replaces."""

from __future__ import annotations

from dataclasses import replace

import pytest

from seerob.description.norms.body_limits import FORBIDDEN, shipped
from seerob.description.norms.crushing_gaps import crushing_gaps, gap_inputs
from seerob.description.norms.limit_inputs import excluded_input, limit_inputs, table_input

NAME = "Hands and fingers: transient multiplier"


def named(inputs):
    return {entry.name: entry for entry in inputs}


def test_figures_carry_their_units_and_values():
    hand = shipped().regions["Hands and fingers"]
    found = named(limit_inputs(shipped(), own=False))
    units = {"F_s": "N", "transient multiplier": "", "k": "N/m", "m_H": "kg", "transient energy": "J"}
    for name, unit in units.items():
        assert found[f"Hands and fingers: {name}"].unit == unit
    for area in hand.areas:
        entry = found[f"Hands and fingers: p_s {area.name}"]
        assert (entry.value, entry.unit) == (area.pressure.value, "Pa")
    assert (found["Hands and fingers: F_s"].value, found[NAME].value) == (140, 2)


@pytest.mark.parametrize(("multiplier", "origin"), [(1.5, "given"), (2.0, "stated"), (None, "stated")])
def test_a_lower_multiplier_replaces_that_of_the_table_and_nothing_else(multiplier, origin):
    plain, found = (named(limit_inputs(shipped(), own=False, multiplier=m)) for m in (None, multiplier))
    assert (found[NAME].value, found[NAME].origin) == (multiplier or 2.0, origin)
    assert ("instead of 2: ISO/TS 15066:2016" in found[NAME].source) == (origin == "given")
    assert {name for name in plain if plain[name] != found[name]} == (
        {f"{region}: transient multiplier" for region in shipped().regions if region not in FORBIDDEN}
        if origin == "given"
        else set()
    )


def test_figures_of_an_own_file_are_given_and_recollections_are_estimates():
    assert {entry.origin for entry in limit_inputs(shipped(), own=True)} == {"given"}
    weak = {e.origin for e in limit_inputs(shipped(), own=False) if e.source.endswith("(M)")}
    assert weak == {"estimated"}


def test_a_table_of_another_edition_or_with_unusual_figures_says_so():
    same, none = table_input(shipped(), shipped().edition)
    assert (same.value, same.origin, none) == ("iso_ts_15066_2016.toml", "stated", ())
    assert same.source == f"ISO/TS 15066:2016; {shipped().title}"
    other, undecided_reasons = table_input(shipped(), "ISO 10218-2:2025")
    assert other.source == f"{same.source}; used for ISO 10218-2:2025"
    assert [doubt.split(":2025:")[0] for doubt in undecided_reasons] == ["ISO 10218-2"]
    own, _ = table_input(replace(shipped(), reviewed_by="A. Engineer"), shipped().edition)
    assert own.source == f"{same.source}; figures outside the usual ranges: A. Engineer"


def test_a_region_that_is_kept_from_contact_is_given():
    assert excluded_input("Face").origin == "given"
    assert excluded_input("Face").name == "Face: kept from contact"


def test_gaps_are_those_of_the_file_in_metres_or_those_that_are_given():
    gaps, source = crushing_gaps()
    assert gaps["Chest"] == pytest.approx(0.5)
    assert gaps["Lower legs"] == pytest.approx(0.18)
    table, own, chest, face = gap_inputs({"Face": 0.2}, ("Chest", "Face"))
    assert (chest.value, face.value, chest.origin, chest.unit) == (0.18, 0.1, "estimated", "m")
    assert (table.value, table.unit, table.origin, table.source) == (0.5, "m", "estimated", source)
    assert (own.value, own.unit, own.origin) == (0.2, "m", "given")
