"""A table of limits of one region: units, and both sides of each bound that a figure must keep."""

from __future__ import annotations

import pytest

from seerob.core.errors import InputError
from seerob.description.norms.body_limits import parse, read

HEAD = """title = "Own"
edition = "ISO/TS 15066:2016"
[units]
force = "N"
pressure = "N/cm2"
stiffness = "N/mm"
mass = "kg"
[sources]
X = "Somebody 2020"
[clauses]
contact = "A.3.2"
force = "Table A.2"
"""
AREA = '{ number = 1, name = "Muscle", pressure = PRESSURE, seen_from = "front" }'
REGION = """[[regions]]
name = "Neck"
permitted = [true, "2S", "X"]
force = [150, "2S", "X"]
stiffness = [50, "2S", "X"]
mass = [1.2, "2S", "X"]
energy = [0.8, "2S", "X"]
multiplier = [2, "2S", "X"]
areas = [AREA]
""".replace("AREA", AREA).replace("PRESSURE", '[140, "2S", "X"]')
TABLE = HEAD + REGION
NECK = {"force": 150, "stiffness": 50, "mass": 1.2, "energy": 0.8, "multiplier": 2, "pressure": 140}


def neck(text=TABLE):
    return parse(text.encode(), file="own.toml").regions["Neck"]


def mistakes(text):
    with pytest.raises(InputError) as caught:
        parse(text.encode(), file="own.toml")
    return [(problem.key, problem.what) for problem in caught.value.problems]


def of(quantity, value):
    return TABLE.replace(f'{quantity} = [{NECK[quantity]}, "2S"', f'{quantity} = [{value}, "2S"')


@pytest.mark.parametrize(
    ("quantity", "low", "high", "factor"),
    [
        ("force", 50, 250, 1),
        ("stiffness", 5, 200, 1e3),
        ("mass", 0.3, 100, 1),
        ("energy", 0.05, 5, 1),
        ("pressure", 60, 300, 1e4),
        ("multiplier", 1, 2, 1),
    ],
)
def test_figures_at_the_ends_of_what_is_usual_are_taken_and_beyond_them_asked_about(
    quantity, low, high, factor
):
    for value in (low, high):
        found = getattr(neck(of(quantity, value)), quantity)
        assert found.value == pytest.approx(value * factor, rel=1e-12)
    for value in (low * 0.999, high * 1.001):
        ((key, what),) = mistakes(of(quantity, value))
        assert quantity in key
        assert f"{value:g}" in what
        answered = of(quantity, value).replace("[units]", 'reviewed_by = "A. Engineer"\n[units]')
        if quantity == "multiplier":
            assert len(mistakes(answered)) == 1
        else:
            assert getattr(neck(answered), quantity).value == pytest.approx(value * factor)


@pytest.mark.parametrize("value", ["0.0", "-1.0", "inf", "nan"])
@pytest.mark.parametrize("quantity", NECK)
def test_what_is_no_limit_is_refused_whoever_answers_for_it(quantity, value):
    text = of(quantity, value).replace("[units]", 'reviewed_by = "A. Engineer"\n[units]')
    assert mistakes(text)


@pytest.mark.parametrize(
    ("quantity", "unit", "value", "si"),
    [
        ("pressure", "Pa", 1.4e6, 1.4e6),
        ("pressure", "kPa", 1400.0, 1.4e6),
        ("pressure", "MPa", 1.4, 1.4e6),
        ("stiffness", "N/m", 5e4, 5e4),
    ],
)
def test_units_are_converted(quantity, unit, value, si):
    old = {"pressure": "N/cm2", "stiffness": "N/mm"}[quantity]
    text = of(quantity, value).replace(f'{quantity} = "{old}"', f'{quantity} = "{unit}"')
    assert getattr(neck(text), quantity).value == pytest.approx(si)


def test_a_figure_says_who_says_so():
    found = neck()
    assert found.force.source == "ISO/TS 15066:2016 Table A.2, Somebody 2020 (2S)"
    assert found.permission_source == "ISO/TS 15066:2016 A.3.2, Somebody 2020 (2S)"
    assert found.mass.source == "ISO/TS 15066:2016, Somebody 2020 (2S)"
    for sources, what in (("", "no source"), ("X Y", "source 'Y' is not in [sources]")):
        text = TABLE.replace('mass = [1.2, "2S", "X"]', f'mass = [1.2, "2S", "{sources}"]')
        assert mistakes(text) == [("regions[0] (Neck).mass", what)]


def test_nothing_is_taken_over_in_part():
    assert mistakes(HEAD.replace("[units]", "regions = []\n[units]")) == [("regions", "no body region")]
    no_area = TABLE.replace(REGION[REGION.index("areas") :], "areas = []\n")
    assert mistakes(no_area) == [("regions[0] (Neck).areas", "no body area")]
    ((key, _),) = mistakes(TABLE.replace('name = "Neck"', "name = 5"))
    assert key == "regions[0]"
    assert set(parse(TABLE.encode(), file="own.toml").regions) == {"Neck"}


def test_areas_are_told_apart_by_number_and_side():
    two = AREA.replace("PRESSURE", '[200, "2S", "X"]').replace('"Muscle"', '"Muscle", side = "dominant"')
    text = TABLE.replace("areas = [", f"areas = [{two}, ")
    assert mistakes(text) == [("regions[0] (Neck).areas", "number 1 is given twice")]
    found = neck(text.replace("number = 1", "number = 2", 1))
    assert [area.name for area in found.areas] == ["Muscle, dominant", "Muscle"]
    assert found.pressure.value == 140e4


def test_where_contact_is_not_permitted_there_is_no_transient_limit():
    text = TABLE.replace("permitted = [true", "permitted = [false")
    assert [what for _, what in mistakes(text)] == ["a transient limit where contact is not permitted"]
    found = neck(text.replace('multiplier = [2, "2S", "X"]\n', ""))
    assert (found.permitted, found.multiplier) == (False, None)


def test_an_energy_may_be_missing_and_a_file_may_have_a_mebibyte(tmp_path):
    path = tmp_path / "own.toml"
    text = TABLE.replace('energy = [0.8, "2S", "X"]\n', "")
    path.write_text(text.ljust(1 << 20, "\n"))
    assert read(path).regions["Neck"].energy is None
    path.write_text(text.ljust((1 << 20) + 1, "\n"))
    with pytest.raises(InputError, match="larger than 1 MiB"):
        read(path)
