"""Phases of the task: run and cycle time, shared by every rule, unknown in between."""

import numpy as np
import pytest

from made_cell import judged, made, state_at
from seerob.core.errors import InputError
from seerob.core.snapshot import Origin, Verdict
from seerob.criteria.scoring.phases import turns
from seerob.session.run import bind
from seerob.workstation.tables.task_phase import Phase, check_order, phase_at

HUMANS = "".join(
    f'[[humans]]\nname = "{n}"\nstature = 1.75\nmass = 75\nsex = "male"\n' for n in ("op", "ann")
)
FIRST = """
[[phases]]
title = "pick"
start = 1
end = 3
load = 12
load_use = "intermittent"
coupling = "poor"
supported_arms = "none"
back_supported = false
legs = "one_leg"
muscle_arms = false
muscle_body = true
static = false
repeated = false
rapid = false
"""
SECOND = FIRST.replace("pick", "place").replace("start = 1\nend = 3", "start = 3\nend = 4").replace("12", "0")
SECOND = SECOND.replace('"one_leg"', '"standing"\nbalanced = true').replace(
    "muscle_body = true", "muscle_body = false"
)
RULES = "".join(
    f'[[ergonomics]]\nkind = "{k}"\nname = "{k}"\nhuman = "op"\n' for k in ("rula", "reba", "owas")
)


def phase(start, end=None, cycle=None):
    return Phase(start=start, end=end, cycle=cycle)


def found(stage, *instants):
    state = state_at(stage)
    results = {}
    for t in instants:
        state.t = t
        results[t] = {r.name: r for r in judged(stage.bound, state)}
    return results


def parts(result):
    return {part.name: part.value for part in result.parts}


@pytest.mark.parametrize(
    ("t", "expected"), [(0.5, -1), (1.0, 0), (1.999, 0), (2.0, -1), (3.0, 1), (9.0, 1), (11.0, 0), (13.5, 1)]
)
def test_a_cycle_repeats_and_gaps_are_unknown(t, expected):
    phases = (phase(1, 2, 10), phase(3, None, 10))
    unknown = phase(0)
    assert phase_at(phases, t, unknown) is (unknown if expected < 0 else phases[expected])


def test_without_a_cycle_the_last_phase_goes_on():
    phases = (phase(1, 2), phase(3))
    assert phase_at(phases, 1e6, phase(0)) is phases[1]


@pytest.mark.parametrize(
    ("phases", "message"),
    [
        (((1,), (1,)), "start after the one before"),
        (((1, 4), (3,)), "overlaps"),
        (((3, 2),), "not after its start"),
        (((1, 5, 4),), "beyond its cycle"),
        (((5, None, 4),), "beyond its cycle"),
        (((1, 2, 4), (3, 4, 5)), "different cycles"),
    ],
)
def test_phases_that_cannot_be(phases, message):
    with pytest.raises(ValueError, match=message):
        check_order([phase(*given) for given in phases])


def test_every_rule_reads_the_shared_phases(tmp_path):
    stage = made(tmp_path, HUMANS + FIRST + SECOND + RULES)
    at = found(stage, 0.5, 1.5, 3.5, 4.5)
    for t in (0.5, 4.5):
        assert {r.verdict for r in at[t].values()} == {Verdict.UNDECIDED}
    rula, reba, owas = (parts(at[1.5][k]) for k in ("rula", "reba", "owas"))
    assert (rula["force of the body"], rula["legs"], rula["muscle use of the body"]) == (2, 2, 1)
    assert (reba["load"], reba["coupling"], reba["legs"], reba["activity"]) == (2, 2, 2, 0)
    assert (owas["load"], owas["legs"]) == (2, 3)
    rula, reba, owas = (parts(at[3.5][k]) for k in ("rula", "reba", "owas"))
    assert (rula["force of the body"], rula["legs"], rula["muscle use of the body"]) == (0, 1, 0)
    assert (reba["load"], reba["legs"]) == (0, 1)
    assert (owas["load"], owas["legs"]) == (1, 2)


def test_the_basis_names_the_phase_and_its_time(tmp_path):
    stage = made(tmp_path, HUMANS + FIRST + SECOND + RULES)
    for bound in stage.bound:
        named = {i.name: i for i in bound.basis.inputs}
        load = named["entered load from 1 s to 3 s (pick)"]
        assert (load.value, load.origin) == (12, Origin.GIVEN)


def test_phases_are_of_one_person_or_of_all(tmp_path):
    others = FIRST.replace("[[phases]]", '[[phases]]\nhuman = "ann"')
    stage = made(tmp_path, HUMANS + others + SECOND + RULES)
    at = found(stage, 1.5, 3.5)
    assert {r.verdict for r in at[1.5].values()} == {Verdict.UNDECIDED}
    assert at[3.5]["rula"].value is not None
    with pytest.raises(InputError, match="no human named 'bob'"):
        bind(made(tmp_path, HUMANS + FIRST.replace("[[phases]]", '[[phases]]\nhuman = "bob"') + RULES).model)


def test_a_rule_with_phases_of_its_own_does_not_read_the_shared_ones(tmp_path):
    own = RULES + "phases = [{ load = 25, legs = 'sitting' }]\n"
    at = found(made(tmp_path, HUMANS + FIRST + own), 1.5)
    assert parts(at[1.5]["owas"])["load"] == 3
    assert parts(at[1.5]["reba"])["load"] == 2


def test_shared_phases_that_overlap_are_a_mistake(tmp_path):
    with pytest.raises(InputError, match=r"phases: of op: .* overlaps"):
        bind(made(tmp_path, HUMANS + FIRST + SECOND.replace("start = 3", "start = 2") + RULES).model)


LIFT = """
[[ergonomics]]
kind = "niosh"
name = "lift"
human = "op"
limit = 1
work = 3000
recovery = 3600
exclusions = []
[[ergonomics.lifts]]
phase = "pick"
control = false
per_minute = 0.2
origin = {{ horizontal = 0.25, vertical = 0.75, asymmetry = 0 }}
destination = {{ horizontal = 0.25, vertical = 0.75, asymmetry = 0 }}
{more}
"""


def test_a_lift_takes_load_and_grip_of_its_phase(tmp_path):
    """Everything else ideal: RWL = 23 kg · CM 0.9."""
    stage = made(tmp_path, HUMANS + FIRST + LIFT.format(more=""))
    lift = found(stage, 0.0)[0.0]["lift"]
    assert lift.value == pytest.approx(12 / (23 * 0.9))
    assert {i.name: i.source for i in stage.bound[0].basis.inputs}["load"] == "phase 'pick'"
    stage = made(tmp_path, HUMANS + FIRST + LIFT.format(more="load = 23\ncoupling = 'good'"))
    assert found(stage, 0.0)[0.0]["lift"].value == pytest.approx(1)


def test_a_lift_of_which_something_is_missing_is_undecided(tmp_path):
    phase = FIRST.replace('coupling = "poor"\n', "")
    lift = found(made(tmp_path, HUMANS + phase + LIFT.format(more="")), 0.0)[0.0]["lift"]
    assert (lift.value, lift.verdict) == (None, Verdict.UNDECIDED)
    assert lift.reason == "not entered: coupling of lift 1"
    with pytest.raises(InputError, match="no phase named 'pick'"):
        bind(made(tmp_path, HUMANS + LIFT.format(more="")).model)


def test_static_and_repeated_work_is_found_where_no_phase_enters_it(tmp_path):
    entered = (
        FIRST.replace("start = 1\nend = 3\n", "").replace("12", "0").replace("muscle_arms = false\n", "")
    )
    entered = entered.replace("muscle_body = true\n", "").replace("static = false\nrepeated = false\n", "")
    rules = "".join(
        f'[[ergonomics]]\nkind = "{k}"\nname = "{k}{f}"\nhuman = "op"\ndetect = {{ from_rest = {f} }}\n'
        for k in ("rula", "reba")
        for f in ("true", "false")
    )
    stage = made(tmp_path, HUMANS + entered + rules)
    at = found(stage, *np.arange(0, 61.0, 0.25))
    for t, expected in ((30.0, 0), (60.0, 1)):
        assert parts(at[t]["rulatrue"])["right muscle use of the arms"] == expected
        assert parts(at[t]["rulatrue"])["muscle use of the body"] == expected
        assert parts(at[t]["rebatrue"])["activity"] == expected
    assert at[30.0]["rulafalse"].verdict is Verdict.UNDECIDED
    assert at[60.0]["rulafalse"].value == at[60.0]["rulatrue"].value
    basis = {i.name: i for i in stage.bound[0].basis.inputs}
    assert (basis["static"].value, basis["repeated"].value) == (60, 4)
    assert basis["detection tolerance"].origin is Origin.CHOICE


def test_detection_needs_to_look_often_enough(tmp_path):
    rule = '[[ergonomics]]\nkind = "reba"\nhuman = "op"\nevery = 2\ndetect = {}\n'
    with pytest.raises(InputError, match="2 s is too seldom"):
        bind(made(tmp_path, HUMANS + rule).model)


STANDS = """
title = "stands"
[[keyframes]]
t = 0.0
posture = "standing"
[[keyframes]]
t = 1.0
posture = "standing"
"""
LIFTS = """
[[sources]]
kind = "keyframes"
human = "op"
file = "person.toml"
[[phases]]
title = "wait"
start = 0
load = 0
legs = "standing"
[[phases]]
title = "lift"
start = {0}
load = 60
legs = "both_knees_bent"
[[phases]]
title = "wait again"
start = {1}
load = 0
legs = "standing"
[[ergonomics]]
kind = "owas"
name = "owas"
human = "op"
action_category = 1
{2}
"""


@pytest.mark.parametrize(
    ("begin", "end", "more", "verdict"),
    [
        (0.405, 0.415, "", Verdict.EXCEEDED),
        # Wholly between two ticks, nobody asks in it.
        (0.403, 0.407, "", Verdict.UNDECIDED),
        (0.4001, 0.4099, "", Verdict.UNDECIDED),
        # One that is asked seldom is asked in each phase.
        (0.405, 0.415, 'every = 0.6\nbetween_samples = "accepted: stands"', Verdict.EXCEEDED),
        (0.403, 0.407, 'every = 0.6\nbetween_samples = "accepted: stands"', Verdict.UNDECIDED),
    ],
)
def test_a_phase_that_nobody_asked_in_is_not_within(tmp_path, begin, end, more, verdict):
    stage = made(tmp_path, HUMANS + LIFTS.format(begin, end, more), {"person.toml": STANDS.encode()})
    assert stage.run().results["owas"].verdict is verdict
    assert stage.batch()["owas"].verdict is verdict


PULSED = """
variables = "variables.toml"
[[sources]]
kind = "signals_csv"
name = "plc"
file = "signals.csv"
time = "t"
time_unit = "s"
"""


@pytest.mark.parametrize("every", ["", 'every = 0.3\nbetween_samples = "accepted: stands"\n'])
@pytest.mark.parametrize(
    ("begin", "end", "verdict"),
    [(0.403, 0.407, Verdict.UNDECIDED), (0.405, 0.415, Verdict.EXCEEDED), (2.0, 2.1, Verdict.WITHIN)],
)
def test_what_applies_between_two_ticks_only_is_not_within(tmp_path, every, begin, end, verdict):
    instants = sorted({0.0, 0.1, begin, end, *np.arange(0.0, 1.0, 0.05).round(2).tolist()})
    applies = [t < 0.1 or begin <= t < end for t in instants]
    rows = "".join(f"{t},{str(on).lower()}\n" for t, on in zip(instants, applies, strict=True) if t <= 1)
    text = PULSED + HUMANS + LIFTS.format(0.2, 0.9, 'active = "on"\n' + every)
    files = {
        "person.toml": STANDS.encode(),
        "variables.toml": '[[variables]]\nname = "on"\nsource = "plc"\naddress = "on"\ntype = "bool"\n',
        "signals.csv": "t,on\n" + rows,
    }
    assert made(tmp_path, text, files).run().results["owas"].verdict is verdict


@pytest.mark.parametrize(
    ("phases", "before", "now", "expected"),
    [
        ((phase(0), phase(1), phase(2)), 0.5, 1.5, [1]),
        ((phase(0), phase(1), phase(2)), 0.5, 2.0, [1, 2]),
        ((phase(0), phase(1), phase(2)), 1.0, 1.9, []),
        ((phase(0, 1), phase(1 + 1e-12)), 0.5, 1.5, [1]),
        ((phase(0, 1), phase(1.1)), 0.5, 1.5, [1, 1.1]),
        ((phase(1, 2, 10), phase(3, None, 10)), 9.9, 11.5, [10, 11]),
        ((phase(0, 5, 10), phase(5, 10, 10)), 29.0, 31.0, [30]),
        ((phase(0, 0.1, 10),), 29.0, 31.0, [30, 30.1]),
    ],
)
def test_when_what_is_entered_changes(phases, before, now, expected):
    assert turns(phases)(before, now) == pytest.approx(expected)
