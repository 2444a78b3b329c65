"""The variable dictionary: every mistake at once, values in SI, and nothing that cannot be."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.core.errors import InputError
from seerob.workstation.variables import UNITS, BadValue, Kind, Variable, read, unit


def variable(**more):
    return Variable(**({"name": "v", "source": "plc", "address": 1, "unit": "1"} | more))


def said(path):
    with pytest.raises(InputError) as caught:
        read(path)
    return str(caught.value)


def test_a_dictionary_is_read(tmp_path):
    file = tmp_path / "variables.toml"
    file.write_text(
        '[[variables]]\nname = "belt/speed"\nsource = "plc"\nunit = "m/min"\n'
        'address = { browse = ["a", "b"] }\n'
        '[[variables]]\nname = "belt/state"\nsource = "plc"\naddress = 4\ntype = "choice"\n'
        'choices = { 0 = "idle", 1 = "running" }\ntimeout_ms = 200\n'
    )
    speed, state = read(file)
    assert (speed.si_unit, speed.value(30)) == ("m/s", 0.5)
    assert (state.timeout, state.value(1)) == (0.2, "running")


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"type": Kind.BOOL, "scale": 2.0}, "a bool has no scale, offset or range"),
        ({"type": Kind.TEXT, "offset": 1.0}, "a text has no scale, offset or range"),
        ({"type": Kind.CHOICE, "choices": {"0": "a"}, "range": (0.0, 1.0)}, "a choice has no scale"),
        ({"type": Kind.TEXT, "inverted": True}, "inverted belongs to a bool"),
        ({"unit": "1", "inverted": True}, "scale = -1 turns the sign"),
        *(
            ({"type": Kind.CHOICE, "choices": {n: "a"}}, "whole numbers")
            for n in ("01", "-0", "\u0663", "1.0", "")
        ),
    ],
)
def test_what_would_change_nothing_is_a_mistake(more, why):
    with pytest.raises(ValueError, match=why):
        Variable(name="v", source="plc", address=1, **more)


def test_every_mistake_is_named_at_once(tmp_path):
    file = tmp_path / "variables.toml"
    head = '[[variables]]\nname = "{}"\nsource = "plc"\naddress = 1\n'
    file.write_text(
        "colour = 1\n"
        + head.format("a")  # a number without a unit
        + (head.format("b") + 'unit = "mms"\n')
        + (head.format("c") + 'unit = "mm"\nrange = [5, 1]\n')
        + (head.format("d") + 'type = "choice"\n')
        + (head.format("e") + 'type = "choice"\nchoices = { one = "x" }\n')
        + (head.format("f") + 'type = "bool"\nunit = "mm"\n')
        + (head.format("g") + 'unit = "mm"\nscale = 0\n')
        + 2 * (head.format("h") + 'unit = "mm"\n')
        + '[[variables]]\nname = "i"\nadress = 1\n'
    )
    text = said(file)
    for part in (
        "colour: unknown key",
        "a: unit is missing",
        "did you mean 'mm/s'",
        "c: range = [5.0, 1.0] is no interval",
        "d: type = ",
        "e: the keys of choices are whole numbers",
        "f: a bool has no unit",
        "g: scale = 0.0",
        "h): is there 2 times",
        "adress: unknown key; did you mean 'address'",
        "source: missing",
    ):
        assert part in text


@given(st.sampled_from(sorted(UNITS)), st.floats(-1e6, 1e6), st.floats(0.001, 1e3), st.floats(-1e3, 1e3))
def test_numbers_arrive_in_si(spelling, raw, scale, offset):
    known = unit(spelling)
    expected = (raw * scale + offset) * known.factor + known.offset
    assert variable(unit=spelling, scale=scale, offset=offset).value(raw) == pytest.approx(
        expected, rel=1e-12
    )


@pytest.mark.parametrize(("spelling", "si", "one"), [("deg", "rad", math.pi / 180), ("degC", "K", 274.15)])
def test_units_by_their_definition(spelling, si, one):
    assert variable(unit=spelling).si_unit == si
    assert variable(unit=spelling).value(1) == pytest.approx(one)


@pytest.mark.parametrize(
    ("made", "raw"),
    [
        (variable(), math.nan),
        (variable(), math.inf),
        (variable(), 10**400),
        (variable(), "1"),
        (variable(), True),
        (variable(), None),
        (variable(range=(0, 1)), 1.0000001),
        (variable(unit=None, type=Kind.BOOL), 2),
        (variable(unit=None, type=Kind.BOOL), "true"),
        (variable(unit=None, type=Kind.TEXT), 5),
        (variable(unit=None, type=Kind.TEXT), "x" * 2000),
        (variable(unit=None, type=Kind.CHOICE, choices={"0": "idle"}), 1),
        (variable(unit=None, type=Kind.CHOICE, choices={"0": "idle"}), math.inf),
    ],
)
def test_what_cannot_be_is_refused(made, raw):
    with pytest.raises(BadValue, match="v: "):
        made.value(raw)
