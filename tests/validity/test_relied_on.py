"""Of whom the twin may be relied on, at each threshold: off, put back, elsewhere than captured, unseen."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, person, state_at, two_r
from seerob.core.errors import NotAsked, Undecided
from seerob.description.humans.skeleton import BONES
from seerob.twin.signals import Signals
from seerob.twin.validity.hearing import BonesHeard
from seerob.twin.validity.validity import Validity

UNSEEN = person("guessed", -9, 0, 0) + "unseen_uncertainty = 0.1\n"


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    text = FLOATING + TWO_R + person("op", 3, 0, 0) + UNSEEN
    return made(tmp_path_factory.mktemp("cell"), text, {"arm.urdf": two_r()})


@pytest.fixture
def state(cell):
    found = state_at(cell, arm=((0.0, 0.0), (0.0, 0.0)))
    found.refresh(1.0)
    for hearing in found.hearings.values():
        hearing.heard.clear()
        hearing.given, hearing.driven = True, False
    found.heard()
    return found


def bodies_of(state, *names):
    return tuple(i for name in names for i in state.model.select(name))


def relied_on(state, bodies, **how):
    """Whether bodies may be; asked anew."""
    state.heard()
    try:
        state.require_bodies(bodies, **how)
    except Undecided:
        return False
    return True


@pytest.mark.parametrize("name", ["arm", "op"])
def test_who_is_off_by_more_than_its_limit_or_was_put_back_within_two_ticks_is_in_doubt(state, name):
    engine, hearing = state.model.workstation.engine, state.hearings[name]
    limit = engine.human_tracking_limit if name == "op" else engine.tracking_limit

    def why():
        state.heard()
        return state.invalid_place_reason(name)

    assert why() == ""
    hearing.error = limit
    assert why() == ""
    hearing.error = float(np.nextafter(limit, 1))
    assert "the twin is off by" in why()
    assert "torque limit" not in why()
    hearing.saturated = True
    assert why().endswith("(a torque limit is reached)")
    hearing.error, last = 0.0, 1.0 - 2 * engine.tick
    hearing.reset_at = last
    assert why() == ""
    hearing.reset_at = float(np.nextafter(last, 1))
    assert why() == f"{name}: the twin had to be put back to what was heard"


def test_a_twin_is_elsewhere_by_what_is_known_only_where_the_person_was_captured(state):
    engine, hearing = state.model.workstation.engine, state.hearings["op"]
    limit, last = engine.human_tracking_limit, 1.0 - 2 * engine.tick
    bodies = bodies_of(state, "op")

    def strays():
        """Whether it is; who asks for that is given the person, and nobody else is."""
        state.heard()
        why = state.stray("op")
        wrong = state.invalid_place_reason("op")
        assert why in ("", wrong)
        assert state.strays(bodies) == state.strays(bodies_of(state, "arm", "op", "guessed")) == why
        for strayed in (False, True):
            state.heard()
            known = not wrong or (strayed and why != "")
            assert relied_on(state, bodies, strayed=strayed) is known
            if known:
                assert state.hearing("op", strayed=strayed) is hearing
            else:
                with pytest.raises(Undecided, match="op: "):
                    state.hearing("op", strayed=strayed)
        if wrong:
            assert not relied_on(state, bodies)
            with pytest.raises(Undecided):
                state.hearing("op")
        return why != ""

    hearing.captured = np.zeros(3)
    assert not strays()  # it follows
    hearing.error = limit
    assert not strays()
    hearing.error = 2 * limit
    assert strays()
    hearing.reset_at = last
    assert strays()
    for since in (float(np.nextafter(last, 1)), 1.0):
        hearing.reset_at = since
        assert not strays()
    hearing.reset_at, hearing.given = -np.inf, False
    assert not strays()  # nobody knows where the person is
    hearing.given, hearing.captured = True, None
    assert not strays()
    state.heard()
    assert state.strays(bodies_of(state, "arm", "guessed")) == ""


def test_bones_that_nobody_sees_will_do_only_where_the_file_accepts_them_and_nothing_else_is_in_doubt(state):
    seen = frozenset(BONES) - {"right_hand"}
    for name in ("op", "guessed"):
        hand, head = bodies_of(state, f"{name}/right_hand"), bodies_of(state, f"{name}/head")
        hearing = state.hearings[name]
        hearing.bones_heard[:] = [BonesHeard(0.0, observed=frozenset(BONES))]
        assert relied_on(state, hand)
        hearing.bones_heard[:] = [BonesHeard(0.0, observed=seen)]
        assert relied_on(state, head)
        assert not relied_on(state, hand)
        assert relied_on(state, hand, allow_estimated=True) is (name == "guessed")
        state.heard()
        assert state.input_reason(name) == ""
        both, every = bodies_of(state, name, "arm"), bodies_of(state, "op", "guessed", "arm")
        assert state.invalid_bodies(both) == state.invalid_bodies(every) == hand
        hearing.bones_heard[:] = [BonesHeard(0.0, (("smeared", ("right_hand",)),), seen)]
        assert not relied_on(state, hand, allow_estimated=True)
        assert state.input_reason(name) == f"{name}: smeared"
        hearing.given = False
        state.heard()
        assert state.invalid_bodies(both) == ()  # nothing of the person may be relied on: not bone by bone
        hearing.given = True
        hearing.bones_heard.clear()
    state.heard()
    assert state.invalid_bodies(bodies_of(state, "op", "guessed", "arm")) == ()


def test_a_doubt_that_names_no_bone_is_one_of_the_whole_person(state):
    hearing = state.hearings["op"]
    hearing.bones_heard[:] = [BonesHeard(0.0, (("out of step", ()),), frozenset(BONES))]
    state.heard()
    with pytest.raises(Undecided, match="op: out of step"):
        state.require("op")
    state.require("arm", "guessed")
    # Nor is a bone relied on that is in doubt without a word.
    hearing.bones_heard[:] = [BonesHeard(0.0, (("", ("head",)),), frozenset(BONES))]
    assert not relied_on(state, bodies_of(state, "op/head"))
    assert relied_on(state, bodies_of(state, "op/right_hand"))


def test_a_body_that_moved_to_where_nobody_knows_is_in_doubt_whoever_it_belonged_to(state):
    head, hand = bodies_of(state, "op/head"), bodies_of(state, "op/right_hand")
    assert relied_on(state, head + hand)
    state.attachments.unknown[head[0]] = "taken by nobody"
    assert not relied_on(state, head + hand)
    assert relied_on(state, hand)
    with pytest.raises(Undecided, match="taken by nobody"):
        state.require_bodies(head)


def test_what_would_not_say_whether_it_may_be_relied_on_is_closed_while_a_criterion_is_asked(state):
    with state.asking(), pytest.raises(NotAsked, match="hearings does not say"):
        print(state.hearings)
    assert set(state.hearings) == {"arm", "op", "guessed"}
    assert isinstance(Validity(state.model, {}).signals, Signals)


def test_how_fast_a_robot_is_its_own_source_tells_or_that_of_what_carries_it_each_heard_more_than_once(
    tmp_path,
):
    axis = (
        '[[machines]]\nname = "axis"\nshape = { box = [0.2, 0.2, 0.1] }\nmass = 5\n'
        "slide = { along = [1, 0, 0], lower = -1, upper = 1 }\n"
    )
    carried = TWO_R.replace('"arm"\n', '"arm"\nq = [0, 0]\non = "axis"\n', 1)
    state = state_at(made(tmp_path, FLOATING + axis + carried, {"arm.urdf": two_r()}))
    own, carrier = state.hearings["arm"], state.hearings["axis"]

    def moved(own_source, carriers, *once):
        own.driven, carrier.driven = own_source, carriers
        for hearing in (own, carrier):
            hearing.heard.clear()
            hearing.once = hearing in once
        state.heard()
        return state.moved("arm")

    assert [moved(*each) for each in ((0, 0), (0, 1), (1, 0), (1, 1))] == [False, True, True, True]
    assert not moved(1, 1, own)
    assert not moved(1, 1, carrier)
    assert moved(0, 0) is False
    assert state.moved("axis")
