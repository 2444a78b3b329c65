"""Machines beside, under and on a robot: what is not known of them never makes a verdict green."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, judged, made, two_r
from seerob.core.snapshot import Verdict
from seerob.session.permissible.between_samples import motions_of, wanted_bounds
from seerob.twin.engine import Engine

PERSON = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\nat = { position = [7, 0, 0] }\n'
GATE = """
[[machines]]
name = "gate"
shape = { box = [1, 0.1, 1] }
at = { position = [1.5, 0.15, 0] }
slide = { along = [0, 1, 0], position = "gate/position", lower = 0, upper = 5 }
"""
AXIS = """
[[machines]]
name = "axis"
shape = { box = [0.3, 0.3, 0.3] }
mass = 500
slide = { along = [1, 0, 0], lower = -1, upper = 1 }
[[confirmed]]
key = "machines[0].bulk_density"
of = "axis"
value = 500000
why = "the half tonne hangs below, where it touches nothing"
"""
DICTIONARY = '[[variables]]\nname = "gate/position"\nsource = "plc"\naddress = "x"\nunit = "m"\n'
PLC = """
[[sources]]
kind = "signals_csv"
name = "plc"
file = "s.csv"
time = "t"
time_unit = "s"
timeout = 0.1
"""
ARM = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n'
PFL = """
[[safety]]
kind = "power_and_force"
name = "F"
robot = "arm"
contact_area = { arm = 1e-4 }
excluded = ["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]
between_samples = "accepted: contact is asked at ticks"
"""
DISTANCE = '[[safety]]\nkind = "minimum_distance"\nbetween = ["arm", "gate"]\n'
SEPARATION = """
[[safety]]
kind = "separation"
name = "S"
between = ["arm", "op"]
human_speed = 1.6
intrusion = 0.1
human_uncertainty = 0.05
robot_uncertainty = 0.02
"""


def gated(folder, told):
    """An arm that creeps past a gate of which something is heard up to an instant [s]."""
    rows = "\n".join(["t,x", *(f"{0.05 * k:.2f},4.0" for k in range(11) if 0.05 * k <= told)])
    motion = "\n".join(["t [s],J1 [rad],J2 [rad]", *(f"{0.1 * k:.1f},{0.002 * k},0" for k in range(6))])
    text = 'variables = "v.toml"\n' + FLOATING + TWO_R + GATE + PLC + ARM + DISTANCE + PFL
    return made(
        folder, text, {"v.toml": DICTIONARY, "s.csv": rows, "m.csv": motion, "arm.urdf": two_r()}
    )  # fmt: skip


@pytest.mark.parametrize(("told", "verdict"), [(0.5, Verdict.WITHIN), (0.2, Verdict.UNDECIDED)])
def test_nothing_is_free_beside_a_machine_of_which_nobody_knows_where_it_is(tmp_path, told, verdict):
    assert gated(tmp_path, told).run().results["F"].verdict is verdict


def test_no_bound_holds_between_samples_against_a_machine_that_follows_variables(tmp_path):
    """At home the gate is 5 cm beside the arm, as heard 4 m: neither is a bound of what it does between."""
    station = gated(tmp_path, 0.5)
    bounds = wanted_bounds(station.model, motions_of(station.sources), most=5)
    assert [bound.what for bound in bounds] == ["speed of arm"]


def carried(folder):
    # A machine that follows a variable carries the arm.
    text = 'variables = "v.toml"\n' + FLOATING + TWO_R + 'on = "gate"\n' + GATE + PLC + ARM
    rows = "t [s],J1 [rad],J2 [rad]\n0,0,0\n1,0.1,0\n"
    return made(
        folder, text, {"v.toml": DICTIONARY, "s.csv": "t,x\n0,0\n1,4\n", "m.csv": rows, "arm.urdf": two_r()}
    )


def test_no_bound_on_the_speed_of_what_such_a_machine_carries(tmp_path):
    station = carried(tmp_path)
    assert wanted_bounds(station.model, motions_of(station.sources), most=5) == []


def state_of(station, **motion):
    """The twin with everybody in uniform motion from zero."""
    engine = Engine(station.model, driven=dict.fromkeys(motion, 1.0))
    engine.take(
        [heard(name, t, np.multiply(t, v), v) for t in (0.0, 0.01) for name, v in motion.items()]
    )  # fmt: skip
    state = engine.start()
    state.engine = engine
    return state


@pytest.mark.parametrize(
    ("axis", "joint", "verdict"),
    [(0.0, 0.01, "within"), (0.01, 0.01, "undecided"), (0.05, 0.01, "exceeded"), (0.01, 5.0, "exceeded")],
)
def test_half_a_tonne_that_carries_the_arm_counts_while_it_moves(tmp_path, axis, joint, verdict):
    station = made(tmp_path, FLOATING + AXIS + TWO_R + 'on = "axis"\n' + PFL, {"arm.urdf": two_r()})
    (found,) = judged(station.bound, state_of(station, arm=[joint, 0.0], axis=[axis]))
    assert found.verdict == verdict
    if verdict == "undecided":
        assert "axis moves and carries arm" in found.reason


@pytest.mark.parametrize(
    "stop",
    [
        'model = "simulated", brakes = [100, 100]',
        'model = "table", table_for = "arm", stopping = 0.1, table = { robot = "x", category = 0, '
        'source = "test", confidence = "M", rated_payload = 9, joints = [{ joint = 0, full_speed = 3, '
        "speed = [1.0], payload = [1.0], extension = [1.0], way = [[[0.1]]], time = [[[0.1]]] }] }",
    ],
)
def test_a_machine_on_the_arm_that_moves_has_a_way_to_stop_of_its_own(tmp_path, stop):
    """Two metres a second toward the person: neither the arm's brakes nor its table stop that."""
    slide = AXIS.replace("mass = 500", 'mass = 2\non = "arm/tip"')
    text = (
        FLOATING
        + TWO_R
        + slide
        + PERSON
        + SEPARATION
        + f"stop = {{ acceleration = 0, reaction = 0.1, {stop} }}\n"
    )
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    (rests,) = judged(station.bound, state_of(station, arm=[0, 0], axis=[0.0]))
    assert rests.limit == pytest.approx(1.6 * 0.1 + 0.17, abs=1e-9)
    (moves,) = judged(station.bound, state_of(station, arm=[0, 0], axis=[2.0]))
    assert (moves.verdict, moves.value) == (Verdict.UNDECIDED, pytest.approx(rests.value, abs=0.05))
    assert "axis moves on arm" in moves.reason
    # What it gets while it reacts is known, and sure.
    assert moves.limit == pytest.approx((1.6 + 2.0) * 0.1 + 0.17, abs=1e-9)
