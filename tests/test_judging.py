"""Asking criteria: at their periods, and an answer lasts only as long as all that it rests on is heard."""

from __future__ import annotations

import math

import pytest

from made_cell import FLOATING, TWO_R, made, state_at, two_r
from seerob.judging import Judge

TWO_ARMS = FLOATING + TWO_R + TWO_R.replace('"arm"', '"other"')
ENERGY = '[[safety]]\nkind = "kinetic_energy"\nname = "E"\nrobot = "arm"\nlimit = 4\n'
BETWEEN = '[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["arm", "other"]\n'
MOVING = ((0.0, 0.0), (1.0, 0.0))


@pytest.fixture
def asked(tmp_path):
    """A criterion of two arms that stand apart, and the twin."""

    def make(criterion):
        station = made(
            tmp_path, TWO_ARMS.replace('"other"', '"other"\nbase = { position = [9, 0, 0] }') + criterion,
            {"arm.urdf": two_r()},
        )  # fmt: skip
        state = state_at(station, arm=MOVING, other=MOVING)
        return Judge(station.bound), state

    return make


@pytest.mark.parametrize("silent", ["arm", "other"])
def test_an_answer_lasts_no_longer_than_each_that_it_rests_on_is_heard(asked, silent):
    judge, state = asked(BETWEEN + "limit = 1\nevery = 10\n")
    (first,) = judge(state)
    assert first.verdict == "within"
    assert judge(state)[0] is first
    state.refresh(0.1)
    assert judge(state)[0] is first
    state.hearings[silent].given = False
    state.refresh(0.2)
    (second,) = judge(state)
    assert second.verdict == "undecided"
    assert silent in second.reason
    assert second.t == 0.2


def test_a_criterion_with_a_period_is_asked_when_it_is_due_and_not_before(asked):
    judge, state = asked(ENERGY + "every = 0.3\n")
    told = []
    for k in range(10):
        state.refresh(k * 0.1)
        told.append(judge(state)[0].t)
    # 3 · 0.1 is 0.30000000000000004, and 9 · 0.1 less than 3 · 0.3: the same instants all the same.
    assert told == pytest.approx([0, 0, 0, 0.3, 0.3, 0.3, 0.6, 0.6, 0.6, 0.9], abs=1e-12)


def test_a_criterion_without_a_period_is_asked_at_every_tick(asked):
    judge, state = asked(ENERGY)
    values = []
    for speed in (1.0, 2.0):
        state.data.qvel[:2] = speed, 0.0
        state.refresh(0.0)
        (result,) = judge(state)
        assert result.t is None
        values.append(result.value)
    # Point masses of 1 kg at 1 m and 2 m.
    assert values == pytest.approx([2.5, 10.0])
    assert result.verdict == "exceeded"


@pytest.mark.parametrize("kind", ["kinetic_energy", "minimum_distance"])
def test_what_is_undecided_keeps_its_limit_and_the_side_that_it_bounds(asked, kind):
    judge, state = asked(ENERGY if kind == "kinetic_energy" else BETWEEN + "limit = 1\n")
    state.hearings["arm"].given = False
    (result,) = judge(state)
    assert (result.verdict, result.value) == ("undecided", None)
    assert (result.limit, result.at_most) == ((4, True) if kind == "kinetic_energy" else (1, False))
    assert math.isfinite(result.limit)


def test_a_criterion_with_a_period_is_asked_at_once_when_it_is_switched(tmp_path):
    """Muted for two tenths of a second and then too fast: not only when the muted answer is due."""
    plc = '[[sources]]\nkind = "signals_csv"\nname = "plc"\nfile = "s.csv"\ntime = "t"\ntime_unit = "s"\n'
    arm = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n'
    door = '[[variables]]\nname = "door"\nsource = "plc"\naddress = "x"\ntype = "bool"\n'
    text = 'variables = "v.toml"\n' + FLOATING + TWO_R + plc + arm + ENERGY + 'every = 10\nactive = "door"\n'
    files = {
        "v.toml": door,
        "s.csv": "t,x\n" + "".join(f"{0.1 * k:.1f},{int(k >= 2)}\n" for k in range(5)),
        "m.csv": "t [s],J1 [rad],J2 [rad]\n" + "".join(f"{0.1 * k:.1f},{0.2 * k:.1f},0\n" for k in range(5)),
        "arm.urdf": two_r(),
    }
    found = made(tmp_path, text, files).run().results["E"]
    # ½ (1 kg + 1 kg · 2²) 2² m²/s²
    assert (found.verdict, found.max()) == ("exceeded", pytest.approx(10.0, rel=1e-3))


def test_an_answer_of_later_says_nothing_when_time_is_set_back(asked):
    judge, state = asked(ENERGY + "every = 10\n")
    state.refresh(5.0)
    judge(state)
    state.refresh(1.0)
    assert judge(state)[0].t == 1.0
