"""What a hand of the twin holds is a load of the person's posture, beside the one that is entered."""

import numpy as np
import pytest
import trimesh

from machines.test_loose import BLANK, LEFT, PERSON, RIGHT, TABLE, Cell
from seerob.core.snapshot import Verdict
from seerob.criteria.ergonomics.owas import load_codes
from seerob.criteria.ergonomics.reba import load
from seerob.criteria.ergonomics.rula import LoadUse, Profile, force
from seerob.criteria.judging import Judge
from seerob.criteria.scoring.handled import NOTHING, Handled, bind_handled, load_range
from seerob.session.run import bind

RULES = """
[[ergonomics]]
kind = "rula"
human = "operator"
name = "rula"
action_level = 4
[[ergonomics]]
kind = "reba"
human = "operator"
name = "reba"
[[ergonomics]]
kind = "owas"
human = "operator"
name = "owas"
[[phases]]
{load}
load_use = "static"
coupling = "good"
legs = "posture"
supported_arms = "none"
back_supported = false
muscle_arms = false
muscle_body = false
static = false
repeated = false
rapid = false
"""


def scores(folder, mass, entered, *, holds=True):
    """Rule → figure, its ends, and verdict, of a person who holds a mass [kg] or nothing."""
    text = PERSON + TABLE + BLANK.replace("mass = 0.8", f"mass = {mass}")
    cell = Cell(folder, text + RULES.format(load=entered)).go(5)
    if holds:
        cell.grab(RIGHT, "blank")
    cell.go(3)
    assert bool(cell.state.held) is holds
    found = {each.name: each for each in Judge(bind(cell.model))(cell.state)}
    return {name: (each.value, each.interval, each.verdict) for name, each in found.items()}


def test_the_larger_of_both_counts_and_nothing_is_relieved(tmp_path):
    """Of a mass that is held the scores are those of the same mass entered, with empty hands."""
    light = scores(tmp_path, 0.8, "load = 0", holds=False)
    held = scores(tmp_path, 12, "load = 0")
    entered = scores(tmp_path, 0.8, "load = 12\nhand = 'right'", holds=False)
    assert all(value is not None for value, *_ in (*light.values(), *held.values()))
    assert held == entered != light
    more = scores(tmp_path, 0.8, "load = 12\nhand = 'right'")
    assert more == entered


def test_what_was_scored_with_empty_hands_is_not_looked_up_for_full_ones(tmp_path):
    text = PERSON + TABLE + BLANK.replace("mass = 0.8", "mass = 12") + RULES.format(load="load = 0")
    cell = Cell(tmp_path, text).go(5)
    kept = Judge(bind(cell.model))
    empty = [(each.name, each.value) for each in kept(cell.state)]
    cell.grab(RIGHT, "blank")
    cell.go(3)
    full = [(each.name, each.value) for each in kept(cell.state)]
    assert full == [(each.name, each.value) for each in Judge(bind(cell.model))(cell.state)]
    assert full != empty


def test_where_nobody_entered_a_load_the_rest_stays_unknown(tmp_path):
    """A part in the hand does not say that nothing is pushed meanwhile."""
    empty, held = scores(tmp_path, 7, "", holds=False), scores(tmp_path, 7, "")
    for rule in ("rula", "reba", "owas"):
        (low, high), (least, most) = empty[rule][1], held[rule][1]
        assert low <= least <= most == high
    assert held["rula"][0] is None
    assert held["rula"][2] is Verdict.UNDECIDED
    assert held["rula"][1][0] > empty["rula"][1][0]


@pytest.mark.parametrize("entered", [None, 3.0])
def test_a_mass_that_nobody_knows_is_anything(entered):
    unknown = Handled(None, frozenset({"right"}))
    assert load_range(entered, unknown) == (entered or 0.0, np.inf)
    assert load_range(entered, NOTHING) == (entered or 0.0, np.inf if entered is None else entered)


def test_from_the_least_on_scores_are_those_of_the_tables():
    span = force(None, LoadUse.STATIC, Profile.ORIGINAL_1993, 5.0)
    assert (span.low, span.high) == (2, 3)
    span = load(None, False, 7.0)
    assert (span.low, span.high) == (1, 2)
    assert load_codes(None, 12.0).tolist() == [False, True, True]


@pytest.mark.parametrize(
    ("weight", "mass", "hands"),
    [("mass = 0.8", 0.8, {"left"}), ("density = 1000", 0.36, {"left"}), ("", None, set())],
)
def test_what_is_mounted_on_a_hand_is_held_all_the_time(tmp_path, weight, mass, hands):
    worn = BLANK.replace('name = "blank"', 'name = "drill"\non = "operator/left_hand"')
    worn = worn.replace("[[workpieces]]", "[[tools]]").replace("mass = 0.8", weight)
    cell = Cell(tmp_path, PERSON + worn)
    found = bind_handled(cell.model, "operator")(cell.state)
    assert found == Handled(None if mass is None else pytest.approx(mass), frozenset(hands))


def test_what_may_weigh_more_counts_with_what_it_weighs_at_most(tmp_path):
    """By density a tool follows its triangles, which are a millimetre off: it is no lighter for that."""
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "drill.stl")
    worn = '[[tools]]\nname = "drill"\non = "operator/left_hand"\nmesh = "drill.stl"\nunits = "m"\n'
    cell = Cell(tmp_path, PERSON + worn + "density = 1000\ndeviation_mm = 1\n")
    found = bind_handled(cell.model, "operator")(cell.state)
    # A box of 102 mm with rounded edges.
    assert 1.0603 < found.mass < 0.102**3 * 1000
    assert found.hands == {"left"}
    # A tolerance makes it heavier still, and so it does what is given, mounted or taken.
    heavier = Cell(tmp_path, PERSON + worn + "density = 1000\ndeviation_mm = 1\ndensity_tolerance = 0.1\n")
    assert bind_handled(heavier.model, "operator")(heavier.state).mass == pytest.approx(1.1 * found.mass)
    blank = BLANK.replace("mass = 0.8", "mass = 0.8\nmass_tolerance = 0.25")
    cell = Cell(tmp_path, PERSON + TABLE + blank).go(3).grab(RIGHT, "blank").go(3)
    assert bind_handled(cell.model, "operator")(cell.state).mass == pytest.approx(1.0)


def test_two_hands_at_one_piece_carry_it_once_and_two_pieces_both(tmp_path):
    text = PERSON + TABLE + BLANK + BLANK.replace('"blank"', '"other"').replace("-0.25,", "0.25,")
    cell = Cell(tmp_path, text).go(3).grab(RIGHT, "blank").grab(LEFT, "blank").go(3)
    handled = bind_handled(cell.model, "operator")
    assert handled(cell.state) == Handled(0.8, frozenset({"left", "right"}))
    cell.grab(LEFT, "other").go(3)
    assert handled(cell.state) == Handled(pytest.approx(1.6), frozenset({"left", "right"}))
    cell.grab(LEFT).grab(RIGHT).go(3)
    assert handled(cell.state) == NOTHING
