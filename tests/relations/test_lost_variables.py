"""Losing what a machine says of itself never relieves, nor what moves by it, nor what is muted by it.

A cart that follows variables stands, runs toward somebody and back within a moment, at random; its samples
are lost at random. What is exceeded where all are heard is not within of the rest.
"""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from made_cell import made, person
from seerob.core.samples import JointSample, SignalSample
from seerob.session.run import Judge, bind, engine_of
from seerob.session.station import Station
from seerob.twin.engine import Engine

EVERY = 0.05
"""Between two questions to the device [s]."""
TICK = 0.01
SECONDS = 3.0
VARIABLES = "".join(
    f'[[variables]]\nname = "{name}"\nsource = "plc"\naddress = {{ table = "{table}", at = {k} }}\n{kind}\n'
    for k, (name, table, kind) in enumerate(
        (
            ("x", "holding", 'unit = "m"'),
            ("y", "holding", 'unit = "m"'),
            ("heading", "holding", 'unit = "rad"'),
            ("force", "holding", 'unit = "N"'),
            ("near", "coil", 'type = "bool"'),
        )
    )
)
CELL = (
    'variables = "variables.toml"\n[engine]\nphysics = false\ntick = 0.01\n'
    + person("op", 3.0, 0, 0)
    + """
[[sources]]
kind = "modbus"
name = "plc"
host = "127.0.0.1"
every = 0.05
delay = 0
[[machines]]
name = "agv"
shape = { box = [1.0, 0.6, 0.3] }
at = { position = [0, 0, 0.2] }
mass = 100
vehicle = { x = "x", y = "y", heading = "heading" }
[[parts]]
name = "post"
shape = { box = [0.1, 0.1, 2] }
at = { position = [2, 0, 1] }
[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["agv", "post"]
limit = 1.0
[[safety]]
kind = "velocity"
name = "speed"
at = "agv/body"
limit = 1.0
[[safety]]
kind = "variable"
name = "force"
variable = "force"
unit = "N"
limit = 100
[[safety]]
kind = "minimum_distance"
name = "muted"
between = ["agv", "post"]
limit = 1.9
active = "near"
"""
)
NAMES = ("distance", "speed", "force", "muted")


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    return made(tmp_path_factory.mktemp("lost"), CELL, {"variables.toml": VARIABLES})


def picture(t, at):
    """What the cart says at an instant [s] of a bump from ``at`` on, 0.1 to 0.3 s long."""
    begins, lasts, far = at
    s = min(max((t - begins) / lasts, 0.0), 1.0)
    bump = far * 16 * s**2 * (1 - s) ** 2
    return {"x": bump, "y": 0.0, "heading": 0.0, "force": 300 * bump, "near": bump > 0.2}


def verdicts(station, samples):
    """Of each criterion, once speeds are known."""
    model = station.model
    engine, judge, box = engine_of(model), Judge(bind(model)), list(samples)
    found = {name: set() for name in NAMES}
    for k in range(round(SECONDS / TICK)):
        t = k * TICK
        while box and box[0].t <= t + 1e-9:
            engine.take([box.pop(0)])
        results = judge(engine.tick() if k else engine.start())
        for result in results if k * TICK > 0.2 else ():
            found[result.name].add(None if result.muted or result.nothing else result.verdict)
    return found


def said(t, at, **more):
    return SignalSample(source="plc", seq=0, t=t, values=picture(t, at), **more)


@pytest.mark.parametrize("seed", range(12))
def test_losing_samples_of_a_cart_or_a_variable_never_relieves(station, seed):
    chance = np.random.default_rng([seed, 11])
    at = chance.uniform(1.2, 1.6), chance.uniform(0.1, 0.3), chance.choice([0.1, 0.4, 0.8])
    every = [said(k * EVERY, at) for k in range(round(SECONDS / EVERY))]
    lost = np.flatnonzero(chance.random(len(every)) < chance.uniform(0.1, 0.5))
    # A stall of less than the time-out about the moment, too.
    if chance.random() < 0.7:
        stall = range(int(at[0] / EVERY), int((at[0] + at[1]) / EVERY) + 2)
        lost = np.union1d(lost, [*stall])
    lost = [k for k in lost if 0 < k < len(every) - 1]
    truth = verdicts(station, every)
    rest = verdicts(station, [s for k, s in enumerate(every) if k not in lost])
    for name in NAMES:
        assert None not in truth[name] or name == "muted"
        if "exceeded" in truth[name]:
            assert rest[name] & {"exceeded", "undecided"}, (name, at, lost)


def only(verdicts, *names):
    return {name: sorted(str(v) for v in verdicts[name]) for name in names}


STANDS = (1.5, 0.2, 0.0)


def test_a_cart_that_stood_on_both_sides_of_lost_samples_may_have_been_anywhere(station):
    every = [said(k * EVERY, STANDS) for k in range(round(SECONDS / EVERY))]
    assert only(verdicts(station, every), *NAMES) == {
        "distance": ["within"],
        "speed": ["within"],
        "force": ["within"],
        "muted": ["None"],
    }
    lost = [s for s in every if not 1.5 < s.t < 1.7]
    assert only(verdicts(station, lost), *NAMES) == {
        "distance": ["undecided", "within"],
        "speed": ["undecided", "within"],
        "force": ["undecided", "within"],
        "muted": ["None", "undecided"],
    }


def test_one_sample_that_is_lost_counts_and_what_is_a_little_late_does_not(station):
    every = [said(k * EVERY, STANDS) for k in range(round(SECONDS / EVERY))]
    one = verdicts(station, [s for k, s in enumerate(every) if k != 30])
    assert "undecided" in one["distance"]
    late = [replace(s, t=s.t + 0.03) if k == 30 else s for k, s in enumerate(every)]
    assert verdicts(station, late)["distance"] == {"within"}


def test_a_variable_is_as_old_as_the_answer_that_told_it(station):
    """A device that answers late leaves as much open as one whose answers are lost."""
    every = [said(k * EVERY, STANDS) for k in range(round(SECONDS / EVERY))]
    old = [replace(s, ages=dict.fromkeys(s.values, s.t - 1.5)) if 1.5 < s.t < 1.7 else s for s in every]
    assert "undecided" in verdicts(station, old)["force"]
    assert "undecided" in verdicts(station, old)["distance"]


@pytest.mark.parametrize("lost", [False, True])
def test_between_two_answers_a_server_that_speaks_of_changes_says_the_same_again(station, lost):
    """It is asked every 0.1 s; pictures in between are as old as the last answer."""
    every = []
    for k in range(round(SECONDS / 0.02)):
        asked = 0.1 * (k // 5)
        if lost and 1.45 < asked < 1.65:
            asked = 1.4
        ages = dict.fromkeys(picture(0.0, STANDS), 0.02 * k - asked)
        every.append(replace(said(0.02 * k, STANDS), ages=ages))
    assert ("undecided" in verdicts(station, every)["force"]) == lost


def test_a_criterion_that_applied_on_both_sides_was_asked_meanwhile(station):
    """Whether it applied in between is of no account: it was judged all the time."""
    near = {"x": 0.0, "y": 0.0, "heading": 0.0, "force": 0.0, "near": True}
    every = [replace(said(k * EVERY, STANDS), values=near) for k in range(round(SECONDS / EVERY))]
    limits = station.workstation.safety
    fixed = replace(limits[3], between=("op", "post"), limit=0.5)
    cell = Station(replace(station.workstation, safety=(*limits[:3], fixed)))
    found = verdicts(cell, [s for s in every if not 1.5 < s.t < 1.7])
    assert found["muted"] == {"within"}


@pytest.mark.parametrize("lost", [True, False])
def test_a_cart_with_a_source_of_its_own_may_have_been_anywhere(tmp_path, lost):
    text = CELL.replace('{ x = "x", y = "y", heading = "heading" }', "{}")
    station = made(tmp_path, text, {"variables.toml": VARIABLES})
    engine, judge = Engine(station.model, driven={"agv": 0.5}, live={"agv"}), Judge(bind(station.model))
    found = set()
    for k in range(300):
        t = k * TICK
        if not (lost and 1.5 < t < 1.7):
            q = (0.0, 0.0, 0.0)
            engine.take([JointSample(source="test", seq=0, t=t, target="agv", q=q, qd=q)])
        results = judge(engine.tick() if k else engine.start())
        found |= {result.verdict for result in results if result.name == "distance"}
    assert found == ({"within", "undecided"} if lost else {"within"})
