"""Bounds between samples where one look is exact: carts that start from rest at a constant acceleration."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, made
from seerob.core.errors import InputError, Undecided
from seerob.session.permissible.between_samples import ROUNDING, BetweenSamples, wanted_bounds
from seerob.session.permissible.path import GivenMotion

BOX = '<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision>'
CART = (
    '<robot name="cart"><link name="base"/>'
    f'<link name="cart">{BOX}</link><link name="head">{BOX}</link>'
    '<joint name="j1" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>'
    '<limit lower="-9" upper="9" effort="1" velocity="9"/></joint>'
    '<joint name="j2" type="prismatic"><parent link="cart"/><child link="head"/><origin xyz="0.3 0 0"/>'
    '<axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="1" velocity="9"/></joint></robot>'
)
ROBOT = '[[robots]]\nname = "{}"\nmodel = "cart.urdf"\nbase = {{ position = [{}, 0, 0], rpy = [0, 0, {}] }}\n'
FACING = FLOATING + ROBOT.format("a", 0, 0) + ROBOT.format("b", 5, np.pi)
WALL = '[[parts]]\nname = "wall"\nshape = { box = [0.2, 2, 2] }\nat = { position = [-3, 0, 0] }\n'
T = 0.8
ONE_LOOK = 99.0


def starting(name, *accelerations, begin=0.0, end=T, good=True):
    """From rest at an instant, with constant accelerations of both joints [m/s²]."""
    a, t = np.array(accelerations), np.array([begin, end])
    q = np.stack([np.zeros(2), a * (end - begin) ** 2 / 2])
    qd = np.stack([np.zeros(2), a * (end - begin)])
    return GivenMotion(name, t, q, qd, np.array([True, good]))


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return made(tmp_path_factory.mktemp("carts"), FACING + WALL, {"cart.urdf": CART}).model


@pytest.mark.parametrize(
    ("a", "b"), [((0.3, 0.5), (0.7, 0.2)), ((0.0, 0.4), (0.6, 0.0)), ((0.5, 0), (0.1, 0.9))]
)
@pytest.mark.parametrize("sets", [("a", "b"), ("b", "a")])
def test_one_look_bounds_who_speeds_up_by_where_they_are_in_the_end(model, a, b, sets):
    """Heads 0.2 m long, 0.3 m before their carts, face each other over 5 m."""
    between = BetweenSamples(model, {"a": starting("a", *a), "b": starting("b", *b)})
    found = between.distance(*sets, tolerance=ONE_LOOK)
    nearest = 5 - 2 * 0.3 - 0.2 - (sum(a) + sum(b)) * T**2 / 2
    assert found.asked == 1
    # Whichever of a set is nearest next comes no faster than its fastest: here that is the head.
    assert found.value == pytest.approx(nearest - ROUNDING, abs=1e-9)
    assert found.found == pytest.approx(4.2 - (sum(a) + sum(b)) * T**2 / 8, abs=1e-9)
    assert (found.at, found.start, found.end, found.unit, found.at_most) == (T / 2, 0.0, T, "m", False)
    assert found.value < nearest


@pytest.mark.parametrize("a", [(0.3, 0.5), (0.5, 0.0), (0.0, -0.4)])
def test_one_look_bounds_a_speed_by_that_in_the_end(model, a):
    found = BetweenSamples(model, {"a": starting("a", *a)}).speed("a", tolerance=ONE_LOOK)
    fastest = max(abs(a[0]), abs(a[0] + a[1])) * T
    assert found.value == pytest.approx(fastest + ROUNDING, abs=1e-9)
    assert found.value > fastest
    assert (found.asked, found.found, found.unit, found.at_most) == (
        1,
        pytest.approx(fastest / 2),
        "m/s",
        True,
    )
    assert found.note == ""


@pytest.mark.parametrize("tolerance", [0.11, 0.03, 0.001])
def test_spans_are_halved_until_the_bound_is_within_the_tolerance(model, tolerance):
    """The last of n halvings is looked at v T / 2 ** (n + 1) before the end."""
    steady = GivenMotion(
        "a", np.array([0.0, T]), np.array([[0, 0], [0, 0.5 * T]]), np.array([[0, 0.5]] * 2), np.ones(2, bool)
    )
    between = BetweenSamples(model, {"a": steady, "b": starting("b", 0, 0)})
    halvings = int(np.ceil(np.log2(0.5 * T / 2 / tolerance)))
    found = between.distance("a", "b", tolerance=tolerance)
    assert found.asked == 1 + 2 * halvings
    assert found.value == pytest.approx(4.2 - 0.5 * T - ROUNDING, abs=1e-9)
    assert found.at == pytest.approx(T * (1 - 0.5 ** (halvings + 1)))
    assert found.found == pytest.approx(4.2 - 0.5 * found.at, abs=1e-9)
    told = []
    BetweenSamples(model, {"a": steady, "b": starting("b", 0, 0)}, progress=told.append).distance("a", "b")
    assert told == list(range(1, len(told) + 1))


def test_only_the_time_counts_that_all_motions_have(model):
    late = starting("b", 0.7, 0.2, begin=0.3, end=1.5)
    between = BetweenSamples(model, {"a": starting("a", 0.3, 0.5), "b": late})
    found = between.distance("a", "b")
    assert (found.start, found.end) == (0.3, T)
    nearest = 4.2 - 0.8 * T**2 / 2 - 0.9 * (T - 0.3) ** 2 / 2
    assert nearest - 1.1e-3 <= found.value < nearest
    for begin in (T, 2.0):
        with pytest.raises(InputError, match="no time in common"):
            BetweenSamples(model, {"a": starting("a", 1, 1), "b": starting("b", 1, 1, begin=begin, end=3.0)})


def test_what_a_source_does_not_vouch_for_counts_and_is_said(model):
    motions = {"a": starting("a", 0.3, 0.5, good=False), "b": starting("b", 0.7, 0.2)}
    found = BetweenSamples(model, motions).distance("a", "b", tolerance=ONE_LOOK)
    assert found.note == "samples that the source does not vouch for count too (a)"
    assert found.sentence().endswith(found.note)


def test_of_who_overlaps_there_is_no_bound_and_of_who_nearly_does_there_is(model):
    for way, holds in ((4.19, True), (4.21, False)):
        sweep = starting("a", 0.0, 2 * way / T**2)
        found = BetweenSamples(model, {"a": sweep, "b": starting("b", 0, 0)}).distance(
            "a", "b", tolerance=5e-3
        )
        assert np.isfinite(found.value) == holds
        assert (found.value if holds else -found.value) > 0
        assert found.figures()["bound"] == (pytest.approx(0.01, abs=6e-3) if holds else None)


@pytest.mark.parametrize("part", ["a", "a/cart", "a/head"])
def test_whose_place_nobody_gave_has_no_bound_and_whose_place_the_file_gives_has(tmp_path, part):
    text = FLOATING + ROBOT.format("a", 0, 0) + "{q}" + ROBOT.format("b", 5, 0) + WALL
    bare = made(tmp_path / "bare", text.replace("{q}", ""), {"cart.urdf": CART}).model
    given = made(tmp_path / "given", text.replace("{q}", "q = [0.1, 0.0]\n"), {"cart.urdf": CART}).model
    moves = {"b": starting("b", 0.3, 0.5)}
    for ask in (
        lambda of: of.speed(part),
        lambda of: of.distance(part, "b"),
        lambda of: of.distance("wall", part),
    ):
        with pytest.raises(Undecided, match=r"a: no source drives it and the file gives no position \(q\)"):
            ask(BetweenSamples(bare, moves))
        ask(BetweenSamples(given, moves))
    assert BetweenSamples(given, moves).speed("a").value == pytest.approx(ROUNDING, abs=1e-9)


def test_who_follows_variables_has_no_bound(tmp_path):
    variable = '[[variables]]\nname = "x"\nsource = "plc"\naddress = "x"\ntype = "number"\nunit = "m"\n'
    source = '[[sources]]\nkind = "signals_csv"\nname = "plc"\nfile = "s.csv"\ntime = "t"\ntime_unit = "s"\n'
    lift = (
        '[[machines]]\nname = "lift"\nshape = { box = [0.1, 0.1, 0.1] }\nat = { position = [0, 5, 0] }\n'
        'mass = 1\nslide = { along = [0, 0, 1], position = "x", lower = 0, upper = 1 }\n'
    )
    text = 'variables = "v.toml"\n' + FLOATING + ROBOT.format("a", 0, 0) + source + lift
    files = {"cart.urdf": CART, "v.toml": variable, "s.csv": "t,x\n0,0\n1,0.5\n"}
    between = BetweenSamples(made(tmp_path, text, files).model, {"a": starting("a", 0.3, 0.5)})
    for ask in (lambda: between.speed("lift"), lambda: between.distance("a", "lift")):
        with pytest.raises(Undecided, match="lift follows variables"):
            ask()
    assert between.speed("a").found > 0


def test_bounds_are_of_pairs_that_are_asked_about_and_of_robots_that_move(tmp_path):
    pair = '[[safety]]\nkind = "minimum_distance"\nname = "{}"\nbetween = ["{}", "{}"]\n'
    asked = pair.format("1", "a", "wall") + pair.format("2", "a", "wall") + pair.format("3", "b", "wall")
    asked += '[[safety]]\nkind = "velocity"\nname = "4"\nof = "a"\n'
    text = FLOATING + ROBOT.format("a", 0, 0) + ROBOT.format("b", 5, 0) + "q = [0, 0]\n" + WALL + asked
    model = made(tmp_path, text, {"cart.urdf": CART}).model
    motions = {"a": starting("a", 0.3, 0.5)}
    told = [bound.what for bound in wanted_bounds(model, motions, most=9)]
    assert told == ["distance a ↔ wall", "distance b ↔ wall", "speed of a"]
    assert [bound.what for bound in wanted_bounds(model, motions, most=1)] == [told[0], told[2]]
    assert wanted_bounds(model, motions, most=0) == wanted_bounds(model, {}, most=9) == []
    assert wanted_bounds(model, None, most=9) == []
    both = motions | {"b": starting("b", 0.1, 0.1)}
    assert [bound.what for bound in wanted_bounds(model, both, most=9)] == [*told, "speed of b"]
