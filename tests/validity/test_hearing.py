"""What is not heard, or cannot be followed, is UNDECIDED: torque limits, silence, gaps, doubts, jumps."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, made, recorded, two_r
from seerob.core.errors import InputError, UnknownName
from seerob.core.samples import Quality
from seerob.devices.live.device_clock import AFTER
from seerob.session.run import Judge, bind, pump, ticks
from seerob.twin.engine import Engine
from seerob.twin.validity.hearing import Heard, Hearing
from seerob.workstation.source import Opened, Source

PERSON = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
ENERGY = '[[safety]]\nkind = "kinetic_energy"\nname = "energy"\nrobot = "arm"\nlimit = 240.0\n'


def judged_run(station, name, opened, *, timeout=0.2):
    """Time, verdict and reason of the first criterion at each tick."""
    engine = Engine(station.model, driven={name: timeout})
    feed = pump([(Source(), opened)], station.workstation.engine.tick)
    for snapshot, _ in ticks(engine, Judge(bind(station.model)), feed):
        result = snapshot.results[0]
        yield snapshot.t, result.verdict, result.reason, result.value


def test_torque_limit_makes_the_twin_lag_and_verdicts_undecided(tmp_path):
    def fast(t):
        return np.array([1.5 * np.sin(3 * t), 0.0]), np.array([4.5 * np.cos(3 * t), 0.0])

    opened = recorded("arm", fast, 100, 1.0)
    strong = made(tmp_path / "strong", FLOATING + TWO_R + ENERGY, {"arm.urdf": two_r(effort=1000)})
    assert {v for _, v, _, _ in judged_run(strong, "arm", opened)} == {"within"}
    weak = made(tmp_path / "weak", FLOATING + TWO_R + ENERGY, {"arm.urdf": two_r(effort=5)})
    said = list(judged_run(weak, "arm", opened))
    reasons = [reason for t, verdict, reason, _ in said if verdict == "undecided"]
    assert len(reasons) > 50
    assert all("twin is off by" in r for r in reasons)
    assert any("torque limit" in r for r in reasons)
    assert all(value is None for _, verdict, _, value in said if verdict == "undecided")
    wide = made(
        tmp_path / "wide",
        "engine = { gravity = [0, 0, 0], tracking_limit = 10 }\n"
        '[[confirmed]]\nkey = "engine.tracking_limit"\nvalue = 10.0\nwhy = "its lag is what is asked"\n'
        + TWO_R
        + ENERGY,
        {"arm.urdf": two_r(effort=5)},
    )
    assert {v for _, v, _, _ in judged_run(wide, "arm", opened)} == {"within"}


def test_torque_is_never_beyond_its_limit(tmp_path):
    station = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r(effort=5)})
    engine = Engine(station.model)
    largest = 0.0
    for k in range(60):
        engine.take([heard("arm", k * 0.01, (np.sin(k), 0.2))])
        engine.tick()
        largest = max(largest, np.abs(engine._data.actuator_force).max())
    assert largest == pytest.approx(5.0)


def still(_):
    return np.array([0.1, 0.2]), np.zeros(2)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    text = FLOATING + TWO_R + ENERGY
    return made(tmp_path_factory.mktemp("arm"), text, {"arm.urdf": two_r()})


@pytest.mark.parametrize("timeout", [0.2, 0.05])
def test_silence_is_undecided_after_the_time_out_and_not_before(arm, timeout):
    engine = Engine(arm.model, driven={"arm": timeout})
    judge = Judge(bind(arm.model))
    engine.take([heard("arm", 0.0, (0.1, 0.2), (0, 0))])
    engine.start()
    for _ in range(60):
        state = engine.tick()
        verdict = judge(state)[0].verdict
        assert verdict == ("undecided" if state.t > timeout + 1e-9 else "within"), state.t
    engine.take([heard("arm", state.t, (0.1, 0.2), (0, 0))])
    assert judge(engine.tick())[0].verdict == "within"


def test_how_fast_a_robot_is_that_was_heard_once_nobody_knows(arm):
    """At the first sample, and at the first one after a silence; a second position tells, or a speed."""
    engine, judge = Engine(arm.model, driven={"arm": 0.05}), Judge(bind(arm.model))
    engine.take([heard("arm", 0.0, (0.1, 0.2))])
    first = judge(engine.start())[0]
    assert (first.verdict, "arm: no source says how it moves" in first.reason) == ("undecided", True)
    for k in range(1, 30):
        engine.take([heard("arm", k * 0.01, (0.1, 0.2))] if k < 5 or k > 15 else [])
        verdict = judge(engine.tick())[0].verdict
        assert verdict == ("undecided" if 9 < k <= 16 else "within"), k


def test_a_feed_without_a_source_goes_stale_too(arm):
    engine = Engine(arm.model)
    engine.take([heard("arm", 0.0, (0.1, 0.2))])
    for _ in range(22):
        state = engine.tick()
    assert "not heard for" in state.invalid_reason("arm")


def test_gap_in_a_recording_is_undecided_though_its_end_is_known(arm):
    samples = [s for s in recorded("arm", still, 100, 2.0).samples if not 0.5 < s.t < 1.4999]
    for t, verdict, reason, _ in judged_run(arm, "arm", Opened(samples=tuple(samples), duration=2.0)):
        silent = 0.5 + 1e-6 < t < 1.5 - 1e-6
        assert verdict == ("undecided" if silent else "within"), (t, reason)
        assert ("not heard for" in reason) == silent


def test_never_heard_is_undecided(arm):
    engine = Engine(arm.model, driven={"arm": 0.2})
    judge = Judge(bind(arm.model))
    for k in range(30):
        result = judge(engine.tick() if k else engine.start())[0]
        assert (result.verdict, result.reason, result.value) == ("undecided", "arm: nothing heard yet", None)


def test_no_source_and_no_position_is_undecided_and_a_given_one_is_not(arm, tmp_path):
    assert results_without_source(arm)[0].verdict == "undecided"
    post = '[[parts]]\nname = "post"\nshape = { sphere = 0.1 }\nat = { position = [9, 0, 0] }\n'
    far = '[[safety]]\nkind = "minimum_distance"\nname = "far"\nbetween = ["arm", "post"]\nlimit = 1\n'
    text = FLOATING + TWO_R + "q = [0.3, 0.4]\n" + post + ENERGY + far
    energy, distance = results_without_source(made(tmp_path, text, {"arm.urdf": two_r()}))
    assert distance.verdict == "within"
    # A place is no speed: nobody says that it stands.
    assert (energy.verdict, energy.value) == ("undecided", pytest.approx(0.0, abs=1e-12))


def results_without_source(station):
    return Judge(bind(station.model))(Engine(station.model).start())


@pytest.mark.parametrize("quality", [Quality.DEGRADED, Quality.INVALID])
def test_bad_quality_is_undecided_on_both_sides_of_the_sample(arm, quality):
    def one_bad(k):
        return quality if k == 50 else Quality.GOOD

    samples = tuple(heard("arm", 0.01 * k, (0.1, 0.2), (0.0, 0.0), quality=one_bad(k)) for k in range(101))
    for t, verdict, reason, _ in judged_run(arm, "arm", Opened(samples=samples, duration=1.0)):
        near = 0.485 < t < 0.505
        assert verdict == ("undecided" if near else "within"), (t, reason)
        assert (quality.value in reason) == near


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_move_nothing_and_are_undecided(arm, bad):
    engine = Engine(arm.model)
    engine.take([heard("arm", 0.0, (0.1, 0.2))])
    engine.start()
    engine.take([heard("arm", 0.01, (bad, 0.2))])
    state = engine.tick()
    assert "not finite" in state.invalid_reason("arm")
    np.testing.assert_allclose(state.joint_positions(arm.model.robot("arm")), [0.1, 0.2], atol=1e-9)
    engine.take([heard("arm", 0.02, (0.1, 0.2), (0.0, bad))])
    assert "not finite" in engine.tick().invalid_reason("arm")


def test_sample_with_another_number_of_joints_is_refused(arm):
    engine = Engine(arm.model)
    with pytest.raises(InputError, match="3 joint values; arm has 2 joints"):
        engine.take([heard("arm", 0.0, (1, 2, 3))])
    with pytest.raises(InputError, match="1 speeds"):
        engine.take([heard("arm", 0.0, (1, 2), (3,))])
    with pytest.raises(UnknownName, match="amr"):
        engine.take([heard("amr", 0.0, (1, 2))])


def test_old_samples_do_not_turn_back_time(arm):
    engine = Engine(arm.model)
    engine.take([heard("arm", 0.5, (0.1, 0.2)), heard("arm", 0.1, (3.0, 3.0), quality=Quality.INVALID)])
    for _ in range(60):
        state = engine.tick()
    assert not state.invalid_reason("arm")
    np.testing.assert_allclose(state.joint_positions(arm.model.robot("arm")), [0.1, 0.2], atol=1e-6)


@pytest.mark.parametrize("size", [(4.0, 3.0), (0.05, 0.29), (0.03, 0.15), (100.0, 100.0)])
def test_jumps_of_a_whole_person_do_not_explode(tmp_path, size):
    """Every joint at once, back and forth; what is shown stays finite and settles."""
    station = made(tmp_path, PERSON)
    person = station.model.human("op")
    step = np.array([size[0] if unit == "m" else size[1] for unit in person.units])
    engine = Engine(station.model)
    doubted = 0
    for k in range(90):
        q = person.home + (step if (k // 20) % 2 else 0)
        engine.take([heard("op", 0.01 * k + 0.01, q)])
        state = engine.tick()
        doubted += bool(state.invalid_reason("op"))
        assert np.isfinite(state.positions).all()
        assert np.abs(state.joint_positions(person)).max() < max(size) + 50
    assert doubted >= 4
    for k in range(90, 180):
        engine.take([heard("op", 0.01 * k + 0.01, q)])
        state = engine.tick()
    assert not state.invalid_reason("op")
    np.testing.assert_allclose(state.joint_positions(person), q, atol=0.01)


def test_jump_of_a_robot_is_undecided_while_it_happens_and_decided_after(arm):
    samples = tuple(heard("arm", 0.02 * k, (0.0 if k < 25 else 3.0, 0.2)) for k in range(51))
    for t, verdict, reason, value in judged_run(arm, "arm", Opened(samples=samples, duration=1.0)):
        jumping = 0.479 < t < 0.519
        assert verdict == ("undecided" if jumping else "within"), (t, reason)
        assert jumping or value < 1e-6
        assert ("jump" in reason) == jumping


def test_a_doubt_about_what_was_said_before_counts_where_that_lies_ahead_too():
    """After a pause of the run the newest sample is repeated as late, and may lie ahead of the tick."""
    good = [Heard(0.99), Heard(1.005)]
    assert not Hearing(given=False, driven=True, heard=good).invalid_reason(1.0)
    repeated = Hearing(given=False, driven=True, heard=[*good, Heard(1.005 + AFTER, "run time fell behind")])
    assert repeated.invalid_reason(1.0) == repeated.invalid_reason(1.005) == "run time fell behind"
    later = Hearing(given=False, driven=True, heard=[*good, Heard(1.013, "robot off")])
    assert not later.invalid_reason(1.0)
    behind = [*good, Heard(1.013), Heard(1.013 + AFTER, "run time fell behind")]
    hearing = Hearing(given=False, driven=True, heard=behind)
    assert {hearing.invalid_reason(t) for t in (1.0, 1.005, 1.01)} == {"run time fell behind"}
