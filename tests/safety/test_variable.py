"""A variable of a machine as a criterion, and criteria that a variable switches off."""

from __future__ import annotations

import pytest

from made_cell import FLOATING, TWO_R, made, state_at, two_r
from seerob.core.errors import InputError
from seerob.core.samples import SignalSample
from seerob.criteria.judging import Judge

PLC = 'variables = "v.toml"\n{}[[sources]]\nkind = "mqtt"\nname = "plc"\nhost = "127.0.0.1"\nport = 1\n'
DICTIONARY = "".join(
    f'[[variables]]\nname = "{name}"\nsource = "plc"\naddress = "{name}"\n{more}\n'
    for name, more in (
        ("speed", 'unit = "mm/s"'),
        ("door", 'type = "bool"'),
        ("recipe", 'type = "text"'),
    )
)
SPEED = 'variable = "speed"\nunit = "m/s"\n'


def asked(folder, options, kind="variable", **told):
    """What the criterion says when the machine has just told these values, in SI."""
    criterion = f'[[safety]]\nkind = "{kind}"\nname = "it"\n{options}'
    files = {"v.toml": DICTIONARY, "arm.urdf": two_r()}
    station = made(folder, PLC.format(FLOATING) + TWO_R + criterion, files)
    state = state_at(station, arm=((0.0, 0.0), (1.0, 0.0)))
    if told:
        state.signals.take(SignalSample(source="plc", seq=0, t=0.0, values=told))
    (result,) = Judge(station.bound)(state)
    return result


@pytest.mark.parametrize(
    ("limit", "value", "verdict"),
    [
        ("limit = 0.5\n", 0.5 - 2e-9, "within"),
        ("limit = 0.5\n", 0.5, "exceeded"),
        ("limit = -0.5\n", -0.5 - 2e-9, "within"),
        ("limit = -0.5\n", 0.0, "exceeded"),
        ("", 9.0, None),
    ],
)
def test_a_number_against_its_limit(tmp_path, limit, value, verdict):
    found = asked(tmp_path, SPEED + limit, speed=float(value))
    assert (found.value, found.unit, found.verdict, found.reason) == (value, "m/s", verdict, "")
    assert found.limit == (float(limit.split("=")[1]) if limit else None)
    assert found.at_most


@pytest.mark.parametrize(
    ("options", "told", "verdict", "reason"),
    [
        ('variable = "door"\nexpected = true\n', {"door": True}, "within", "door is true"),
        ('variable = "door"\nexpected = true\n', {"door": False}, "exceeded", "door is false, not true"),
        ('variable = "door"\nexpected = false\n', {"door": False}, "within", "door is false"),
        ('variable = "door"\n', {"door": True}, None, "door is true"),
        ('variable = "recipe"\nexpected = "A"\n', {"recipe": "A"}, "within", "recipe is A"),
        ('variable = "recipe"\nexpected = "A"\n', {"recipe": "B"}, "exceeded", "recipe is B, not A"),
        ('variable = "recipe"\nexpected = "A"\n', {"door": True}, "undecided", "recipe: not heard"),
        ('variable = "door"\nexpected = true\n', {}, "undecided", "door: nothing heard yet"),
    ],
)
def test_what_a_variable_must_be(tmp_path, options, told, verdict, reason):
    found = asked(tmp_path, options, **told)
    assert (found.verdict, found.reason) == (verdict, reason)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ('variable = "speed"\nunit = "mm/s"\n', 'write unit = "m/s"'),
        ('variable = "speed"\n', 'write unit = "m/s"'),
        ('variable = "door"\nlimit = 1\n', "is no number"),
        (SPEED + "expected = true\n", "speed is a number"),
        (SPEED + 'expected = "1"\n', "speed is a number"),
        ('variable = "door"\nexpected = "true"\n', "door is a bool"),
        ('variable = "recipe"\nexpected = true\n', "recipe is a text"),
        (SPEED + "limit = 1\nexpected = true\n", "both given"),
    ],
)
def test_options_that_do_not_fit_the_variable_are_refused(tmp_path, options, message):
    with pytest.raises(InputError, match=message):
        asked(tmp_path, options, speed=1.0)


@pytest.mark.parametrize(
    ("told", "verdict", "value"),
    [({"door": True}, "exceeded", 2.5), ({"door": False}, None, None), ({}, "undecided", None)],
)
def test_a_criterion_is_asked_while_its_variable_is_true(tmp_path, told, verdict, value):
    """Point masses of 1 kg at 1 m and 2 m, turning at 1 rad/s."""
    found = asked(tmp_path, 'robot = "arm"\nlimit = 2\nactive = "door"\n', "kinetic_energy", **told)
    assert (found.verdict, found.value) == (verdict, pytest.approx(value))
    assert (found.limit, found.unit, found.at_most) == (2, "J", True)
    assert ("not asked" in found.reason) == (told == {"door": False})


def test_what_is_not_asked_keeps_the_side_that_its_limit_bounds(tmp_path):
    found = asked(tmp_path, 'at = "arm"\nlimit = 2\nactive = "door"\n', "manipulability", door=False)
    assert (found.limit, found.at_most, found.verdict) == (2, False, None)
