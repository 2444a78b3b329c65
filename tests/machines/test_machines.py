"""Machines follow what their variables say, are judged like robots, and are doubted when those are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from made_cell import person
from seerob import load
from seerob.core.errors import InputError, Undecided
from seerob.core.samples import SignalSample
from seerob.session.opening import signal_timeouts
from seerob.twin.engine import Engine
from seerob.twin.machines.following import carried, follow, nearest_turn
from seerob.workstation.tables.machines import AtEnd, Belt, Slide, Turn, Vehicle

PERSON = f"""
variables = "variables.toml"
{person("op", 2, 0, 0)}[[sources]]
kind = "signals_csv"
name = "plc"
file = "signals.csv"
time = "t"
time_unit = "s"
timeout = 0.5
"""
GATE = """
[[machines]]
name = "gate"
shape = { box = [0.2, 1.0, 1.0] }
at = { position = [0, 0, 1] }
slide = { along = [1, 0, 0], position = "gate/position", lower = 0, upper = 1.5 }
[[safety]]
kind = "minimum_distance"
name = "gap"
between = ["gate", "op"]
limit = 0.1
[[safety]]
kind = "velocity"
name = "speed"
at = "gate"
limit = 1.0
"""
POSITION = """
[[variables]]
name = "gate/position"
source = "plc"
address = "x"
unit = "mm"
range = [0, 1500]
"""


def made(folder, station, dictionary, rows):
    (folder / "workstation.toml").write_text(station)
    (folder / "variables.toml").write_text(dictionary)
    (folder / "signals.csv").write_text(rows)
    return load(folder)


def table(header, rows):
    return "\n".join([header, *(",".join(str(cell) for cell in row) for row in rows)])


def test_a_gate_moves_as_told_and_its_speed_is_judged(tmp_path):
    rows = table("t,x", [(0.1 * k, 50.0 * k) for k in range(21)])
    station = made(tmp_path, PERSON + GATE, POSITION, rows)
    summary = station.run()
    speed = summary.results["speed"]
    assert speed.max() == pytest.approx(0.5, rel=1e-3)
    assert speed.verdict == "within"
    gap = summary.results["gap"]
    still = load(tmp_path)
    engine = Engine(still.model)
    start = engine.start()
    ask = still.model.gap(still.model.select("op"), still.model.select("gate"))
    before = start.closest(ask).distance
    assert gap.min() == pytest.approx(before - 1.0, abs=5e-3)


def test_what_depends_on_a_doubted_machine_is_undecided(tmp_path):
    rows = table("t,x", [(0.1 * k, 100.0 if k < 5 else 9000.0) for k in range(11)])
    station = made(tmp_path, PERSON + GATE, POSITION, rows)
    worst = station.run().results["gap"]
    assert worst.verdict == "undecided"
    assert "is not in [0.0, 1500.0]" in worst.worst().reason


def test_silence_of_its_source_shows_within_the_time_out(tmp_path):
    station = made(tmp_path, PERSON + GATE, POSITION, table("t,x", [(0, 0), (1, 0)]))
    sources, machines = signal_timeouts(station.model)
    assert (sources, machines) == ({"gate/position": 0.5}, {"gate": 0.5})
    engine = Engine(station.model, driven=machines, signals=sources)
    engine.take([SignalSample(source="plc", seq=0, t=0.0, values={"gate/position": 0.25})])
    state = engine.start()
    assert state.signal("gate/position") == 0.25
    doubts = []
    for _ in range(60):
        state = engine.tick()
        doubts.append(bool(state.invalid_reason("gate")))
    assert doubts.index(True) == 50
    with pytest.raises(Undecided, match="plc not heard"):
        state.signal("gate/position")
    engine.take([SignalSample(source="plc", seq=1, t=0.62, values={"gate/position": 0.75})])
    for _ in range(4):
        state = engine.tick()
    assert not state.invalid_reason("gate")
    assert state.q(station.model.mechanism("gate")) == pytest.approx([0.75], abs=1e-6)


def test_a_belt_carries_its_part_around_and_stops_it():
    assert [carried(way, 2.0, AtEnd.LOOP) for way in (0.5, 2.5, -0.5)] == [0.5, 0.5, 1.5]
    assert [carried(way, 2.0, AtEnd.STOP) for way in (0.5, 2.5, -0.5)] == [0.5, 2.0, 0.0]


def test_a_summed_speed_is_the_way_and_is_lost_in_a_silence():
    at = follow(Belt(length=2.0, speed="v", placed="p", at_end=AtEnd.LOOP, start=0.11))
    places = [at(0.1 * k, {"v": 0.25, "p": False}) for k in range(80)]
    np.testing.assert_allclose(
        [p.q[0] for p in places], [(0.11 + 0.025 * k) % 2.0 for k in range(80)], atol=1e-9
    )
    assert [k for k, p in enumerate(places) if p.anew] == [76]
    lost = at(9.5, {"v": 0.25, "p": False})
    assert "not known since" in lost.invalid_reason
    again = at(9.6, {"v": 0.25, "p": True})
    assert (again.q[0], again.invalid_reason, again.anew) == (0.11, "", True)


def test_a_counted_belt_is_known_again_after_a_silence():
    at = follow(Belt(length=2.0, position="x", at_end=AtEnd.LOOP, start=0.11))
    at(0.0, {"x": 0.0})
    later = at(100.0, {"x": 3.0})
    assert later.q[0] == pytest.approx(1.11)
    assert not later.invalid_reason
    stops = follow(Belt(length=2.0, position="x"))
    assert [stops(t, {"x": x}).q[0] for t, x in enumerate((0.0, 1.0, 5.0, 4.5))] == [0.0, 1.0, 2.0, 1.5]


def test_a_counter_that_begins_again_makes_no_speed():
    at = follow(Belt(length=5.0, position="x", speed="v"))
    told = [at(0.1 * k, {"x": x, "v": 0.25}) for k, x in enumerate((1.0, 1.025, 3.0, 3.025))]
    assert [place.anew for place in told] == [False, False, True, False]
    assert [float(place.qd[0]) for place in told] == [0.25] * 4
    assert ["leapt by 1.95 m" in place.invalid_reason for place in told] == [False, False, True, True]
    assert not at(0.8, {"x": 3.15, "v": 0.25}).invalid_reason
    # Without a speed beside it nobody knows better than the counter.
    alone = follow(Belt(length=5.0, position="x"))
    assert not any(alone(0.1 * k, {"x": x}).anew for k, x in enumerate((1.0, 3.0)))


def test_a_count_of_one_round_that_begins_again_is_no_leap():
    at = follow(Belt(length=2.0, position="x", speed="v", at_end=AtEnd.LOOP))
    places = [at(0.1 * k, {"x": 0.025 * k % 2.0, "v": 0.25}) for k in range(200)]
    assert not any(place.invalid_reason for place in places)
    np.testing.assert_allclose([p.q[0] for p in places], [0.025 * k % 2.0 for k in range(200)], atol=1e-9)


def test_a_machine_that_teleports_is_not_relied_on_for_a_while(tmp_path):
    """Each sample alone can be; it went 1 m in 10 ms, and nobody knows which of both was wrong."""
    station = made(tmp_path, PERSON + GATE, POSITION, table("t,x", [(0, 0), (1, 0)]))
    engine = Engine(station.model, driven={"gate": 0.5}, live={"gate"}, signals={"plc": 0.5})
    undecided = []
    for k in range(120):
        x = 1.0 if k == 30 else 0.0
        engine.take([SignalSample(source="plc", seq=k, t=0.01 * k, values={"gate/position": x})])
        state = engine.tick() if k else engine.start()
        undecided += [k] * ("jump" in state.invalid_reason("gate"))
    # There and back are two leaps.
    assert undecided == list(range(30, undecided[-1] + 1))
    assert undecided[-1] in (80, 81)


def test_with_its_speed_an_uneven_network_does_not_make_a_belt_jerk():
    """Pictures that arrive up to 40 ms late, each as it was when it was sent."""
    random = np.random.default_rng(1)
    arrival = np.arange(100) * 0.1 + random.uniform(0, 0.04, 100)
    at = follow(Belt(length=100.0, position="x", speed="v"))
    q = np.array([at(t, {"x": 0.025 * k, "v": 0.25}).q[0] for k, t in enumerate(arrival)])
    speeds = np.diff(q) / np.diff(arrival)
    raw = 0.025 / np.diff(arrival)
    assert np.abs(raw - 0.25).max() > 0.08
    assert np.abs(speeds - 0.25).max() < 0.04
    assert np.abs(q - 0.25 * arrival).max() < 0.25 * 0.04 + 1e-9


def test_between_its_ends_a_door_is_nowhere_sure():
    at = follow(Turn(open="o", lower=0.0, upper=1.5, travel=1.0))
    first = at(0.0, {"o": False})
    assert (first.q[0], first.invalid_reason) == (0.0, "")
    on_its_way = at(0.5, {"o": True})
    assert on_its_way.q[0] == pytest.approx(0.75)
    assert "nobody says where" in on_its_way.invalid_reason
    there = at(1.2, {"o": True})
    assert (there.q[0], there.invalid_reason) == (1.5, "")


def test_angles_go_on_the_short_way():
    assert nearest_turn(0.1, 6.2) == pytest.approx(0.1 + math.tau)
    assert nearest_turn(-3.1, 3.1) == pytest.approx(math.tau - 3.1)
    at = follow(Vehicle(x="x", y="y", heading="h"))
    angles = [at(t, {"x": 1.0, "y": 2.0, "h": h}).q[2] for t, h in enumerate((3.0, 3.1, -3.1, -3.0))]
    assert np.abs(np.diff(angles)).max() < 0.2


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Slide(along=(0, 0, 0)),
        lambda: Slide(open="o", lower=0.0, upper=1.0),
        lambda: Slide(position="x", open="o", lower=0.0, upper=1.0, travel=1.0),
        lambda: Slide(position="x", travel=1.0),
        lambda: Turn(lower=1.0, upper=0.0),
        lambda: Belt(length=1.0, start=2.0),
        lambda: Belt(length=1.0, placed="p"),
        lambda: Vehicle(x="x"),
    ],
)
def test_motions_that_cannot_be_are_refused(wrong):
    with pytest.raises(ValueError, match=r"\w"):
        wrong()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('unit = "mm"', 'unit = "deg"'), "is in rad, in m is needed"),
        (("range = [0, 1500]", "write = true"), "is written, not read"),
        (("gate/position", "gate/place"), "no variable 'gate/position'"),
    ],
)
def test_a_variable_must_fit_the_machine(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        made(tmp_path, PERSON + GATE, POSITION.replace(*change), "t,x\n0,0")


def test_a_machine_may_have_a_motion_of_its_own_instead(tmp_path):
    station = (
        PERSON
        + GATE.replace(', position = "gate/position"', "")
        + (
            '[[sources]]\nkind = "csv"\nrobot = "gate"\nfile = "gate.csv"\n'
            '[sources.mapping]\ntime = "t"\ntime_unit = "s"\njoints = ["x"]\njoint_unit = "m"\n'
        )
    )
    (tmp_path / "gate.csv").write_text(table("t,x", [(0.1 * k, 0.05 * k) for k in range(11)]))
    loaded = made(tmp_path, station, "", "t,x\n0,0")
    assert loaded.run().results["speed"].max() == pytest.approx(0.5, rel=1e-2)


def test_a_live_machine_stands_where_it_was_said_to_be_however_late_it_hears_the_next(tmp_path):
    station = made(tmp_path, PERSON + GATE, POSITION, table("t,x", [(0, 0), (1, 0)]))
    engine = Engine(station.model, driven={"gate": 5.0}, live={"gate"}, signals={"plc": 5.0})
    for seq, (t, x) in enumerate([(0.0, 0.2), (0.25, 0.2), (0.5, 0.4)]):
        engine.take([SignalSample(source="plc", seq=seq, t=t, values={"gate/position": x})])
    engine.start()
    (gate,) = station.model.mechanisms["gate"].q_address
    way = [engine.tick().data.qpos[gate] for _ in range(300)]
    assert max(way) < 0.41
    assert way[100:] == pytest.approx([0.4] * 200, abs=1e-6)


def test_after_a_hiccup_a_machine_is_not_as_fast_as_the_twin_that_catches_up(tmp_path):
    """It goes on at 0.25 m/s while its PLC is not heard for 0.3 s, and comes late by 40 ms now and then."""
    station = made(tmp_path, PERSON + GATE, POSITION, table("t,x", [(0, 0), (1, 0)]))
    engine = Engine(station.model, driven={"gate": 0.5}, live={"gate"}, signals={"plc": 0.5})
    told, seq, speeds, reasons = [0.05 * k for k in range(60) if not 1.0 <= 0.05 * k < 1.3], 0, [], []
    gate = station.model.mechanism("gate")
    for k in range(250):
        now, samples = 0.01 * k, []
        while told and told[0] - 0.02 + 0.04 * (seq % 10 == 7) <= now:
            t = told.pop(0)
            samples.append(SignalSample(source="plc", seq=seq, t=t, values={"gate/position": 0.25 * t}))
            seq += 1
        engine.take(samples)
        state = engine.tick() if k else engine.start()
        if reason := state.invalid_reason("gate"):
            reasons.append(reason)
        else:
            speeds.append(abs(float(state.qd(gate)[0])))
    assert max(speeds) < 0.25 + 0.15
    assert len(speeds) > 200
    assert any("nobody says that it stopped" in reason for reason in reasons)
    assert any("put back" in reason for reason in reasons)
