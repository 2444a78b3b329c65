"""Criteria over many instants in arrays say what the road says of each, to rounding."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as changed

from made_cell import TWO_R, UR10, heard, made, meant, person, two_r, wave
from motion_io import made_pictures
from seerob.core.errors import InputError, UnknownName
from seerob.core.samples import JointSample, Quality
from seerob.core.snapshot import Basis, Result, Verdict
from seerob.core.verdict import judge
from seerob.criteria.criterion import Criterion
from seerob.recording.answers import Answers
from seerob.recording.series import CODES, NO_VERDICT
from seerob.session import recorded_motion
from seerob.session.run import Judge
from seerob.session.station import Station
from seerob.twin.engine import Engine
from seerob.twin.spans import Ways
from seerob.twin.states import States
from seerob.workstation.source import Opened, Pump, Source

N = 70
T = 0.01 * np.arange(N)
MORE = """
[[humans]]
name = "worker"
stature = 1.75
mass = 75
sex = "male"
at = { position = [1.3, 0, -0.7] }
posture = "standing"
[[confirmed]]
key = "humans[0].feet"
of = "worker"
value = -0.7
why = "stands in a pit"
[[confirmed]]
key = "safety[9].human_speed"
of = "separation"
value = 0.2
why = "so that some instants are within"
[[parts]]
name = "wall"
shape = { box = [0.1, 2, 2] }
at = { position = [-1, 0, 1] }
[[safety]]
kind = "velocity"
name = "point"
at = "arm"
offset = [0.1, 0, 0]
limit = 1.3
[[safety]]
kind = "velocity"
name = "fastest"
of = "arm"
limit = 2.0
[[safety]]
kind = "kinetic_energy"
name = "energy"
robot = "arm"
limit = 14.0
[[safety]]
kind = "manipulability"
name = "manipulability"
at = "arm"
limit = 0.4
[[safety]]
kind = "effective_mass"
name = "mass along"
at = "arm"
limit = 1.0
[[safety]]
kind = "effective_mass"
name = "worst mass"
at = "arm"
along = "worst"
[[safety]]
kind = "effective_mass"
name = "mass toward"
at = "arm"
toward = "worker"
limit = 1.3
[[safety]]
kind = "force_polytope"
name = "force"
at = "arm"
limit = 600.0
[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["arm", "worker"]
limit = 0.3
[[safety]]
kind = "separation"
name = "separation"
between = ["arm", "worker"]
stop = { acceleration = 0, reaction = 0.1, stopping = 0.2 }
human_speed = 0.2
intrusion = 0.0
human_uncertainty = 0.0
robot_uncertainty = 0.0
[[safety]]
kind = "separation"
name = "open separation"
between = ["arm", "worker"]
stop = { acceleration = 0, reaction = 0.1, stopping = 0.2, model = "constant_deceleration" }
[[safety]]
kind = "separation_area"
name = "around"
separation = "separation"
of = ["worker", "wall"]
[[safety]]
kind = "separation_area"
name = "open around"
separation = "open separation"
of = "wall"
"""
SLOW = """
[[safety]]
kind = "separation"
name = "fixed"
between = ["arm", "worker"]
stop = { acceleration = 0, reaction = 0.1, stopping = 0.2 }
mode = "fixed"
[[safety]]
kind = "power_and_force"
name = "contact"
robot = "arm"
human = "worker"
every = 0.1
"""


TEXT = "engine = { physics = false }\n" + UR10 + MORE + SLOW


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return made(tmp_path_factory.mktemp("cell"), TEXT + meant(TEXT))


@pytest.fixture(scope="module")
def motion():
    q, qd = zip(*(wave(t) for t in T), strict=True)
    return {"arm": np.array(q)}, {"arm": np.array(qd)}


@pytest.fixture(scope="module")
def batch(cell, motion):
    return cell.batch(*motion, t=T, threads=2)


@pytest.fixture(scope="module")
def road(cell):
    engine, judge = Engine(cell.model, driven={"arm": 1.0}), Judge(cell.bound)
    engine.take([heard("arm", float(t), *wave(t)) for t in 0.01 * np.arange(N + 2)])
    return [judge(engine.tick() if k else engine.start()) for k in range(N)]


def test_values_limits_and_verdicts_are_those_of_the_road(batch, road):
    for i, (name, column) in enumerate(batch.items()):
        results = [row[i] for row in road]
        if name == "contact":
            continue
        value, limit = (
            np.array([np.nan if x is None else x for x in (getattr(r, key) for r in results)])
            for key in ("value", "limit")
        )
        np.testing.assert_allclose(column.value, value, rtol=1e-12, atol=1e-15, err_msg=name)
        np.testing.assert_allclose(column.answers.limit, limit, rtol=1e-12, err_msg=name)
        np.testing.assert_array_equal(column.answers.verdict, [CODES[r.verdict] for r in results], name)
        spans = [r.interval for r in results]
        if column.answers.interval is None:
            assert spans == [None] * N, name
        else:
            np.testing.assert_allclose(np.array(column.answers.interval).T, spans, rtol=1e-12, err_msg=name)


def test_the_motion_crosses_limits(batch):
    for name in ("point", "fastest", "energy", "manipulability", "mass along", "force", "distance", "around"):
        assert len(np.unique(batch[name].answers.verdict)) > 1, name


def test_only_what_remembers_is_asked_instant_by_instant(batch):
    assert {name for name, column in batch.items() if column.note} == {"fixed", "contact"}


WATCHED = """
[[areas]]
name = "zone"
shape = { box = [0.4, 0.4, 0.4] }
at = { position = [0.8, 0.2, 0.4] }
[[sensors]]
name = "mat"
response = 0.1
at = { position = [0.6, 0, 0.2] }
pressure_mat = { corners = [[0, 0], [0.4, 0], [0.4, 0.4], [0, 0.4]], height = 0.4 }
[[sensors]]
name = "curtain"
capability = 0.03
response = 0.02
light_curtain = { ends = [[0.8, -1, -0.2], [0.8, 1, -0.2]], height = 1.5 }
[[sensors]]
name = "scanner"
at = { position = [2, 0, 0.3], rpy_deg = [0, 0, 180] }
capability = 0.07
response = 0.08
[sensors.laser_scanner]
range = 5.5
angle_deg = 270
resolution_deg = 0.5
fields = [{ name = "field", corners = [[0, -1], [1.25, -1], [1.25, 1], [0, 1]] }]
[[parts]]
name = "far"
shape = { box = [0.1, 0.1, 0.1] }
at = { position = [9, 9, 9] }
[[safety]]
name = "it"
"""


@pytest.mark.parametrize(
    ("asked", "whom", "verdicts"),
    [
        ('kind = "safety_area"\narea = "zone"', "arm", {Verdict.WITHIN, Verdict.EXCEEDED}),
        ('kind = "pressure_mat"\nsensor = "mat"', "arm", {Verdict.WITHIN, Verdict.EXCEEDED}),
        ('kind = "light_curtain"\nsensor = "curtain"', "arm", {Verdict.WITHIN, Verdict.EXCEEDED}),
        # Where the arm interrupts beams, nobody knows who is behind it.
        ('kind = "light_curtain"\nsensor = "curtain"', "far", {Verdict.WITHIN, Verdict.UNDECIDED}),
        ('kind = "scanner_field"\nsensor = "scanner"', "arm", {Verdict.WITHIN, Verdict.EXCEEDED}),
    ],
)
def test_who_enters_is_said_of_many_instants_as_of_each(tmp_path, motion, monkeypatch, asked, whom, verdicts):
    """How deep somebody is inside is asked of each; who stays outside is judged in arrays."""
    own = made(tmp_path, f'engine = {{ physics = false }}\n{UR10}{WATCHED}{asked}\nof = "{whom}"\n')
    found = own.batch(*motion, t=T, threads=2)["it"]
    monkeypatch.setattr(type(own.bound[0].criterion), "one_by_one", lambda *_: "asked so")
    alone = own.batch(*motion, t=T)["it"]
    assert (found.note, alone.note) == ("", "asked instant by instant: asked so")
    assert set(found.answers.verdict.tolist()) == {CODES[verdict] for verdict in verdicts}
    np.testing.assert_array_equal(found.answers.verdict, alone.answers.verdict)
    np.testing.assert_allclose(found.value, alone.value, rtol=1e-12)
    ends = [one.answers.interval or (one.value, one.value) for one in (found, alone)]
    np.testing.assert_allclose(*ends, rtol=1e-12)
    idle = [
        np.zeros(N, bool) if one.answers.nothing is None else one.answers.nothing for one in (found, alone)
    ]
    np.testing.assert_array_equal(*idle)
    said = found.answers.verdict != CODES[Verdict.UNDECIDED]
    np.testing.assert_array_equal(found.reasons[said], alone.reasons[said])


def test_number_of_threads_changes_no_bit(cell, motion, batch, monkeypatch):
    monkeypatch.setattr("seerob.session.batch.STRETCH", 9)
    for threads in (1, 3):
        again = cell.batch(*motion, t=T, threads=threads)
        for name, column in batch.items():
            np.testing.assert_array_equal(again[name].value, column.value)
            np.testing.assert_array_equal(again[name].answers.verdict, column.answers.verdict)


def test_what_is_not_known_is_undecided(cell, motion):
    q, qd = motion[0]["arm"].copy(), motion[1]["arm"].copy()
    q[5, 2], qd[40, 0] = np.nan, np.inf
    found = cell.batch({"arm": q}, {"arm": qd})
    for column in found.values():
        assert (column.answers.verdict[[5, 40]] == CODES[Verdict.UNDECIDED]).all()
        assert np.isnan(column.value[[5, 40]]).all()
        assert "not finite" in column.reasons[5]
    assert np.flatnonzero(np.isnan(found["point"].value)).tolist() == [5, 40]
    worker = cell.model.human("worker").home
    alone = cell.batch({"worker": np.tile(worker, (3, 1))}, {"worker": np.zeros((3, len(worker)))})
    assert alone["energy"].verdict is Verdict.UNDECIDED
    assert "no motion is given" in alone["energy"].reasons[0]


def test_a_planar_arm_in_closed_form(tmp_path):
    text = TWO_R + '[[safety]]\nkind = "kinetic_energy"\nname = "energy"\nrobot = "arm"\n'
    text += '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm/tip"\n'
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    rng = np.random.default_rng(3)
    q, qd = rng.uniform(-3, 3, (2, 500, 2))
    found = station.batch({"arm": q}, {"arm": qd})
    c, turn = np.cos(q[:, 1]), qd.sum(axis=1)
    v2 = qd[:, 0] ** 2 + turn**2 + 2 * c * qd[:, 0] * turn
    np.testing.assert_allclose(found["speed"].value, np.sqrt(v2), atol=1e-9)
    np.testing.assert_allclose(found["energy"].value, 0.5 * (qd[:, 0] ** 2 + v2), rtol=1e-9)


@pytest.mark.parametrize(
    ("q", "qd", "t", "told"),
    [
        ({}, {}, None, "give positions"),
        ({"arm": np.zeros((4, 6))}, {}, None, "give both"),
        ({"arm": np.zeros((4, 5))}, {"arm": np.zeros((4, 6))}, None, "6 joints of 4 instants"),
        ({"arm": np.zeros((4, 6))}, {"arm": np.zeros((3, 6))}, None, "6 joints of 4 instants"),
        ({"arm": np.zeros((4, 6))}, {"arm": np.zeros((4, 6))}, [0, 1, 1, 2], "numbers that increase"),
        ({"arm": np.zeros((4, 6))}, {"arm": np.zeros((4, 6))}, [0, 1], "numbers that increase"),
    ],
)
def test_arrays_that_do_not_fit_are_told(cell, q, qd, t, told):
    with pytest.raises(InputError, match=told):
        cell.batch(q, qd, t=t)


def test_sources_are_followed_tick_by_tick_with_what_is_not_heard(tmp_path):
    text = "engine = { physics = false }\n" + TWO_R
    text += '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion.csv"\ntimeout = 0.2\n'
    text += (
        'mapping = { time = "t", joints = ["a", "b"], time_unit = "s", joint_unit = "rad" }\n'
        '[[safety]]\nkind = "velocity"\nname = "v"\nof = "arm"\nlimit = 2.5\n'
        '[[safety]]\nkind = "kinetic_energy"\nname = "E"\nrobot = "arm"\nlimit = 4\n'
    )
    # Nothing is heard from 1 s to 2 s.
    t = np.concatenate([np.arange(0, 1.001, 0.02), np.arange(2, 3.001, 0.02)])
    rows = [f"{s:.3f},{np.sin(2 * s)},{np.cos(3 * s)}" for s in t]
    station = made(tmp_path, text, {"arm.urdf": two_r(), "motion.csv": "\n".join(["t,a,b", *rows])})
    found, log = station.batch(), station.run().results
    assert len(found.t) == log.ticks
    for name, column in found.items():
        np.testing.assert_array_equal(column.answers.verdict, log[name].verdicts)
        np.testing.assert_allclose(column.value, log[name].values, rtol=1e-12)
        assert column.verdict is log[name].verdict
        assert sum("not heard for" in reason for reason in column.reasons) > 50


def lies(seed: int, name: str) -> list[JointSample]:
    """Samples with gaps, doubts, noise and lateness, as fast or slow as it comes, that may end in motion."""
    rng = np.random.default_rng(seed)
    period = rng.choice([0.0013, 0.01, 0.02, 0.03])
    t = np.arange(rng.choice([0.0, 0.004, 0.31]), 1.5, period)
    t = t + rng.choice([0, 1e-10, 0.3 * period]) * rng.uniform(-1, 1, len(t))
    t = np.abs(t[(t < rng.uniform(0.3, 1)) | (t > 0.95)])
    says = dict(enumerate(["bad", "", "worse"])) if rng.random() < 0.5 else {}
    found = []
    for k, instant in enumerate(t.tolist()):
        q, qd = (each[:2] for each in wave(instant))
        more = (
            {"qd_error": tuple(rng.uniform(0, 1, 2).tolist())} if seed % 3 == 0 and rng.random() < 0.7 else {}
        )
        late = rng.uniform(0, 0.3) if seed % 4 == 1 else 0.0
        reason = says.get(k % 17, "")
        quality = Quality.DEGRADED if seed % 5 == 2 and k % 23 == 0 else Quality.GOOD
        found.append(heard(name, instant, q, qd, late=late, reason=reason, quality=quality, **more))
    return found


@pytest.mark.parametrize("seed", range(8))
def test_a_file_is_followed_in_arrays_as_sample_by_sample(tmp_path, monkeypatch, seed):
    mimic = '<mimic joint="j1" multiplier="-0.7" offset="0.2"/>' if seed % 2 else ""
    text = "".join(
        f'[[robots]]\nname = "{name}"\nmodel = "{name}.urdf"\n' for name in ("one", "two", "rests")
    )
    text += "base = { position = [0, 9, 0] }\n" + ("q = [1]\n" if seed % 4 == 3 else "")
    text += "".join(
        f'[[sources]]\nkind = "csv"\nrobot = "{name}"\nfile = "x.csv"\n' for name in ("one", "two")
    )
    text += "[engine]\ntracking_limit = 10\n"
    files = {f"{name}.urdf": two_r() for name in ("one", "two")} | {"rests.urdf": two_r(mimic=mimic)}
    files["x.csv"] = "t,a,b\n0,0,0\n1,0,0\n"
    station = made(tmp_path, text, files)
    samples = {name: lies(10 * seed + k, name) for k, name in enumerate(("one", "two"))}
    end = max(each[-1].t for each in samples.values())
    pumps = [Pump(Opened(samples=each, duration=end)) for each in samples.values()]
    feed = [tuple(s for pump in pumps for s in pump.until(0.01 * k)) for k in range(round(100 * end) + 3)]
    together = recorded_motion.recorded(station.model, feed, end)
    assert isinstance(together.ways, Ways)
    monkeypatch.setattr(recorded_motion, "known_motion", lambda *_: None)
    one_by_one = recorded_motion.recorded(station.model, feed, end)
    assert not isinstance(one_by_one.ways, Ways)
    for key in ("t", "q", "v"):
        np.testing.assert_array_equal(getattr(together, key), getattr(one_by_one, key))
    for key in ("invalid_reasons", "speed_errors"):
        found, wanted = getattr(together, key), getattr(one_by_one, key)
        assert found.keys() == wanted.keys()
        for name, rows in wanted.items():
            np.testing.assert_array_equal(found[name], rows)
    for ours, theirs in zip(together.ways, one_by_one.ways, strict=True):
        for key in ("t", "q", "v"):
            np.testing.assert_array_equal(getattr(ours, key), getattr(theirs, key))
        assert ours.broken == theirs.broken


class Own(Criterion, frozen=True, kw_only=True):
    """Arrays of one's own that forget what they should look at."""

    of: str = "arm"
    limit: float = 2.0
    says: Callable[[States], object]

    def subjects(self):
        return (self.of,)

    def bind(self, model):
        return lambda state: Result(name=self.name, value=1.0, limit=self.limit, verdict=Verdict.WITHIN)

    def basis(self, model):
        return Basis(formula="1", source="own")

    def batch(self, model):
        return self.says


NOTHING = np.full(N, NO_VERDICT, np.uint8)


def within(value, limit=2.0, interval=None, n=N):
    rows = (np.broadcast_to(np.asarray(x, float), n).copy() for x in (value, limit))
    ends = None if interval is None else tuple(np.full(n, float(end)) for end in interval)
    return Answers(*rows, np.full(n, CODES[Verdict.WITHIN], np.uint8), ends)


CONTRADICTING = (
    (lambda states: within(np.nan), "own 0: it is within, and has no value"),
    (lambda states: within(-np.inf), "it is within, and has no value"),
    (lambda states: within(1, np.nan), "it is within, and has no limit"),
    (lambda states: within(3), "it is within, beyond its limit"),
    (lambda states: within(1, 2, (0.5, 2.5)), "it is within, beyond its limit"),
    (lambda states: within(1, 2, (np.nan, np.nan)), "it is within, beyond its limit"),
    (lambda states: replace(within(np.nan, np.nan), verdict=NOTHING), "it says nothing, neither"),
    (lambda states: replace(within(1), verdict=NOTHING), "it has a limit and no verdict"),
    (lambda states: replace(within(1), nothing=np.ones(N, bool)), "says that there is nothing to judge"),
    (lambda states: within(1, n=N - 1), f"of {N} instants, not"),
    (lambda states: replace(within(1), verdict=np.full(N, 7, np.uint8)), "its verdicts \\[7\\] are none"),
    (lambda states: np.ones(N), "returns ndarray, not seerob.api.Answers"),
    (lambda states: 1 / 0, "own 12 failed: ZeroDivisionError: division by zero"),
)


@pytest.fixture(scope="module")
def contradicting(cell, motion):
    """All of them in one batch."""
    own = [Own(name=f"own {k}", says=says) for k, (says, _) in enumerate(CONTRADICTING)]
    return cell.with_criteria(*own).batch(*motion, t=T, threads=1)


@pytest.mark.parametrize("k", range(len(CONTRADICTING)))
def test_arrays_of_ones_own_that_contradict_themselves_are_undecided(contradicting, k):
    found, told = contradicting[f"own {k}"], CONTRADICTING[k][1]
    assert found.verdict is Verdict.UNDECIDED
    assert set(found.answers.verdict.tolist()) == {CODES[Verdict.UNDECIDED]}
    assert all(re.search(told, reason) for reason in found.reasons)


def test_arrays_of_ones_own_say_where_there_is_nothing_to_judge(cell, motion):
    own = Own(name="own", says=lambda states: within(1).without_verdict(np.arange(N) > 3))
    found = cell.with_criteria(own).batch(*motion)["own"]
    assert found.answers.verdict.tolist() == [CODES[Verdict.WITHIN]] * 4 + [NO_VERDICT] * (N - 4)


@pytest.mark.parametrize("of", ["arm", "load", "arm/forearm_link"])
def test_arrays_of_ones_own_that_ask_nobody_are_undecided_where_what_they_name_is_not_known(cell, motion, of):
    q, qd = motion[0]["arm"].copy(), motion[1]["arm"]
    q[5, 2] = np.nan
    own = Own(name="own", of=of, says=lambda states: within(1))
    found = cell.with_criteria(own).batch({"arm": q}, {"arm": qd})["own"]
    assert np.flatnonzero(found.answers.verdict != CODES[Verdict.WITHIN]).tolist() == [5]
    assert "not finite" in found.reasons[5]


def test_where_bodies_are_is_said_of_those_that_are_asked_for(cell, motion):
    def says(states):
        _, positions = states.placed(arm)
        assert np.isfinite(positions[:, list(arm)]).all()
        assert np.isnan(positions).any()
        assert states.asked == {"arm"}
        return within(1)

    arm = cell.model.select("arm")
    own = Own(name="own", of="wall", says=says)
    assert cell.with_criteria(own).batch(*motion)["own"].verdict is Verdict.WITHIN


def test_names_that_do_not_exist_are_told(cell, batch):
    with pytest.raises(UnknownName, match="arm"):
        cell.batch({"arn": np.zeros((4, 6))}, {"arn": np.zeros((4, 6))})
    with pytest.raises(UnknownName, match="energy"):
        batch["enegry"]


def test_no_instants_are_no_answers(cell):
    found = cell.batch({"arm": np.zeros((0, 6))}, {"arm": np.zeros((0, 6))})
    assert all(len(column.value) == 0 and column.verdict is None for column in found.values())


@pytest.mark.parametrize(("height", "verdict"), [(1.0, Verdict.WITHIN), (2.5, Verdict.UNDECIDED)])
def test_a_person_whom_a_device_saw_above_the_floor_is_held_in_arrays_too(tmp_path, height, verdict):
    text = "[engine]\nphysics = false\n" + person("op") + TWO_R
    text += "q = [0, 0]\nbase = { position = [4, 0, 0] }\n"
    text += '[[sources]]\nkind = "kinect_recording"\nhuman = "op"\nfile = "p.json"\n'
    text += f"at = {{ position = [0, 0, {height}], rpy_deg = [0, 0, 0] }}\n"
    text += '[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["arm", "op"]\nlimit = 0.1\n'
    seen = made_pictures.offline_json(made_pictures.pictures(8))
    station = made(tmp_path, text, {"arm.urdf": two_r(), "p.json": seen})
    assert station.run().results["d"].verdict is verdict
    assert station.batch()["d"].verdict is verdict


class Rough(Source, frozen=True, kw_only=True):
    """Says where an arm is that stands, too coarsely for energies."""

    why: str = "told in whole degrees"

    def target(self):
        return "arm"

    def coarse(self, folder):
        return self.why

    def open(self, folder, target):
        samples = [heard("arm", t, (0, 0), (0, 0)) for t in (0.0, 0.05, 0.1)]
        return Opened(samples=samples, duration=0.1)


def test_what_is_heard_too_coarsely_for_energies_is_undecided_in_arrays_too(tmp_path):
    text = TWO_R + '[[safety]]\nkind = "kinetic_energy"\nname = "E"\nrobot = "arm"\nlimit = 1\n'
    cell = made(tmp_path, text, {"arm.urdf": two_r()}).workstation
    (energy,) = cell.safety
    for why, verdict in (("told in whole degrees", Verdict.UNDECIDED), ("", Verdict.WITHIN)):
        for more in ({}, {"between_samples": "accepted: it stands"}):
            criteria = (changed(energy, **more), Walked(name="walked", limit=9.0))
            station = Station(changed(cell, sources=(Rough(name="rough", why=why),), safety=criteria))
            run, many = station.run().results, station.batch()
            assert run["E"].verdict is verdict is many["E"].verdict
            assert run["walked"].verdict is verdict is many["walked"].verdict
            assert many["walked"].note.startswith("asked instant by instant")


class Walked(Criterion, frozen=True, kw_only=True):
    """A mass of an arm, asked of one instant."""

    limit: float
    between_samples: str = "accepted: it stands"

    def subjects(self):
        return ("arm",)

    def basis(self, model):
        return Basis(formula="M", source="ACME")

    def bind(self, model):
        def evaluate(state):
            value = float(state.mass_matrix(state.model.mechanisms["arm"])[1, 1])
            return Result(name=self.name, value=value, limit=self.limit, verdict=judge(value, self.limit))

        return evaluate


def test_what_nothing_could_exceed_is_not_within():
    for limit, at_most in ((np.inf, True), (-np.inf, False)):
        found = Answers.against(np.ones(3), limit, at_most=at_most).contradictions(at_most=at_most)
        assert set(found) == {"it is within, and nothing could exceed its limit"}
