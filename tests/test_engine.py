"""The twin in motion: tracking, energy, torque limits, jumps, silence."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from made_cell import FLOATING, TWO_R, heard, hinge_limits, made, results_at, two_r

from seerob.engine import Engine
from seerob.errors import InputError, Undecided, UnknownName
from seerob.run import bind, pump, ticks, Judge
from seerob.samples import PoseSample, Quality, SignalSample
from seerob.source import Opened, Source

UR10 = """
[[robots]]
name = "arm"
model = "library:ur10"
[[tools]]
name = "load"
on = "arm/tool0"
shape = { box = [0.1, 0.1, 0.1] }
mass = 3
tcp = { position = [0, 0, 0.1] }
"""
PERSON = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'
Q0, AMPLITUDE = np.array([0, -1.2, 1.4, -1.5, -1.5, 0]), np.array([1, 0.5, -0.6, 0.8, -0.7, 1.0])


def wave(t):
    """Peak 2 rad/s, in full motion from the first sample on."""
    return Q0 + AMPLITUDE * np.sin(2 * t), 2 * AMPLITUDE * np.cos(2 * t)


def quintic(t, T=2.0):
    """From rest to rest with a peak of 2 rad/s."""
    s, D = min(t / T, 1.0), AMPLITUDE * 2 * T / 1.875
    return Q0 + D * (10 * s**3 - 15 * s**4 + 6 * s**5), D * (30 * s**2 - 60 * s**3 + 30 * s**4) / T


def recorded(name, motion, rate, duration, *, velocities=True):
    samples = []
    for t in np.arange(0, duration + 1e-9, 1 / rate).tolist():
        q, qd = motion(t)
        samples.append(heard(name, t, q, qd if velocities else None))
    return Opened(samples=tuple(samples), duration=samples[-1].t)


def followed(station, name, opened):
    """The states of a run as the product does it."""
    engine = Engine(station.model, driven={name: 0.2})
    for k, samples in enumerate(pump([(Source(), opened)], station.workstation.engine.tick)):
        engine.take(samples)
        yield engine.tick() if k else engine.start()


def tracking(station, name, motion, opened):
    """Errors of the tool [m] and of joint speeds [rad/s] against the exact motion at the state's time."""
    mechanism = station.model.mechanism(name)
    exact = mujoco.MjData(station.model.mj)
    errors, speeds = [], []
    for state in followed(station, name, opened):
        q, qd = motion(state.t)
        exact.qpos[mechanism.q_address] = mechanism.coupling @ q + mechanism.offset
        mujoco.mj_kinematics(station.model.mj, exact)
        tip = mechanism.tip
        where = exact.xpos[tip.mj] + exact.xmat[tip.mj].reshape(3, 3) @ tip.body_from_frame[:3, 3]
        errors.append(np.linalg.norm(state.pose(tip)[1] - where))
        speeds.append(np.abs(state.qd(mechanism) - qd).max())
    return np.array(errors), np.array(speeds)


@pytest.fixture(scope="module", params=[0.001, 0.002])
def ur10(request, tmp_path_factory):
    text = f"engine = {{ timestep = {request.param} }}\n{UR10}"
    return made(tmp_path_factory.mktemp("ur10"), text)


@pytest.mark.parametrize(
    ("rate", "velocities", "rms"),
    [
        (100, True, 1e-6),
        (50, True, 1e-6),
        (500, True, 1e-6),
        (100, False, 1e-5),
        (500, False, 1e-5),
        (50, False, 1e-5),
    ],
)
@pytest.mark.parametrize("motion", [wave, quintic])
def test_tool_follows_a_2_rad_per_s_motion(ur10, motion, rate, velocities, rms):
    errors, speeds = tracking(ur10, "arm", motion, recorded("arm", motion, rate, 1.5, velocities=velocities))
    assert np.sqrt((errors**2).mean()) < rms
    assert speeds.max() < (1e-4 if velocities else 0.03)


def test_a_tick_late_would_fail_that_test(ur10):
    """One sample of misalignment costs millimetres: the bound above sees a thousandth of it."""
    late = recorded("arm", lambda t: wave(t - 0.001), 100, 1.0)
    errors, _ = tracking(ur10, "arm", wave, late)
    assert np.sqrt((errors**2).mean()) > 5e-4


def test_person_follows_60_hz_keyframes(tmp_path):
    station = made(tmp_path, PERSON)
    person = station.model.human("op")
    n = len(person.joints)
    assert n == 53
    rng = np.random.default_rng(0)
    low, high = hinge_limits(station, "op")
    amplitude, f, phase = 0.2 * np.minimum(high - low, 1), rng.uniform(1, 4, n), rng.uniform(0, 6, n)

    def motion(t):
        return person.home + amplitude * np.sin(f * t + phase), amplitude * f * np.cos(f * t + phase)

    error = [
        np.abs(state.joint_positions(person) - motion(state.t)[0])
        for state in followed(station, "op", recorded("op", motion, 60, 2.0))
    ]
    assert np.sqrt(np.square(error).mean()) < np.radians(0.009)


@pytest.mark.parametrize("name", ["ur10", "iiwa14", "ur5e"])
def test_kinetic_energy_is_conserved_in_free_motion(tmp_path, name):
    station = made(tmp_path, f'{FLOATING}[[robots]]\nname = "arm"\nmodel = "library:{name}"\n')
    robot = station.model.robot("arm")
    rng = np.random.default_rng(3)
    n = len(robot.joints)
    engine = Engine(station.model, controllers=False)
    engine.take([heard("arm", 0.0, rng.uniform(-1, 1, n), rng.uniform(-1, 1, n))])
    energies = []
    for k in range(101):
        state = engine.tick() if k else engine.start()
        M, qd = state.mass_matrix(robot), state.qd(robot)
        energies.append(0.5 * qd @ M @ qd)
    assert np.ptp(energies) < 1e-6 * energies[0]
    assert np.abs(qd).max() > 0.1


def test_free_fall_gains_the_energy_it_loses_in_height(tmp_path):
    turned = TWO_R + "base = { rpy_deg = [90, 0, 0] }\n"
    station = made(tmp_path, turned, {"arm.urdf": two_r()})
    robot = station.model.robot("arm")
    engine = Engine(station.model, controllers=False)
    engine.take([heard("arm", 0.0, (0.0, 0.0), (0.0, 0.0))])
    engine.start()
    for _ in range(40):
        state = engine.tick()
    qd = state.qd(robot)
    heights = [state.pose(station.model.frame(f))[1][2] for f in ("arm/l2", "arm/tip")]
    assert 0.5 * qd @ state.mass_matrix(robot) @ qd == pytest.approx(-9.81 * sum(heights), rel=1e-6)


def test_gravity_torque_of_tool_and_payload_is_what_the_twin_pays(tmp_path):
    """At rest with the arm out: τ1 = g (1·1 + 1·2 + 4·2), τ2 = g (1·1 + 4·1)."""
    turned = TWO_R + "base = { rpy_deg = [90, 0, 0] }\nq = [0, 0]\n"
    tool = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = { sphere = 0.01 }\nmass = 3\n'
    payload = '[[workpieces]]\nname = "part"\non = "grip"\nshape = { sphere = 0.01 }\nmass = 1\n'
    for name, text, extra in (("without", "", 0.0), ("tool", tool, 3.0), ("both", tool + payload, 4.0)):
        station = made(tmp_path / name, turned + text, {"arm.urdf": two_r()})
        engine = Engine(station.model)
        for _ in range(30):
            engine.tick()
        torque = engine._data.actuator_force[station.model.robot("arm").v_address]
        np.testing.assert_allclose(torque, 9.81 * np.array([3 + 2 * extra, 1 + extra]), rtol=1e-4)
        M = engine.state.mass_matrix(station.model.robot("arm"))
        np.testing.assert_allclose(
            M, np.array([[5, 2], [2, 1]]) + extra * np.array([[4, 2], [2, 1]]), rtol=1e-3
        )


ENERGY = '[[safety]]\nkind = "kinetic_energy"\nname = "energy"\nrobot = "arm"\nlimit = 1e9\n'


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
        "engine = { gravity = [0, 0, 0], tracking_limit = 10 }\n" + TWO_R + ENERGY,
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
    engine.take([heard("arm", 0.0, (0.1, 0.2))])
    engine.start()
    for _ in range(60):
        state = engine.tick()
        verdict = judge(state)[0].verdict
        assert verdict == ("undecided" if state.t > timeout + 1e-9 else "within"), state.t
    engine.take([heard("arm", state.t, (0.1, 0.2))])
    assert judge(engine.tick())[0].verdict == "within"


def test_a_feed_without_a_source_goes_stale_too(arm):
    engine = Engine(arm.model)
    engine.take([heard("arm", 0.0, (0.1, 0.2))])
    for _ in range(22):
        state = engine.tick()
    assert "not heard for" in state.doubt("arm")


def test_gap_in_a_recording_is_undecided_though_its_end_is_known(arm):
    samples = [s for s in recorded("arm", still, 100, 2.0).samples if not 0.5 < s.t < 1.4999]
    for t, verdict, reason, _ in judged_run(arm, "arm", Opened(samples=tuple(samples), duration=2.0)):
        silent = 0.7 + 1e-6 < t < 1.5 - 1e-6
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
    given = made(tmp_path, FLOATING + TWO_R + "q = [0.3, 0.4]\n" + ENERGY, {"arm.urdf": two_r()})
    result = results_without_source(given)[0]
    assert (result.verdict, result.value) == ("within", pytest.approx(0.0, abs=1e-12))


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
    assert "not finite" in state.doubt("arm")
    np.testing.assert_allclose(state.joint_positions(arm.model.robot("arm")), [0.1, 0.2], atol=1e-9)
    engine.take([heard("arm", 0.02, (0.1, 0.2), (0.0, bad))])
    assert "not finite" in engine.tick().doubt("arm")


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
    assert not state.doubt("arm")
    np.testing.assert_allclose(state.joint_positions(arm.model.robot("arm")), [0.1, 0.2], atol=1e-6)


def test_signals_are_kept_by_source(arm):
    engine = Engine(arm.model)
    engine.take([SignalSample(source="plc", seq=0, t=0.0, values={"lamp": True})])
    assert engine.signals == {"plc": {"lamp": True}}


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
        doubted += bool(state.doubt("op"))
        assert np.isfinite(state.positions).all()
        assert np.abs(state.joint_positions(person)).max() < max(size) + 50
    assert doubted >= 4
    for k in range(90, 180):
        engine.take([heard("op", 0.01 * k + 0.01, q)])
        state = engine.tick()
    assert not state.doubt("op")
    np.testing.assert_allclose(state.joint_positions(person), q, atol=0.01)


def test_jump_of_a_robot_is_undecided_while_it_happens_and_decided_after(arm):
    samples = tuple(heard("arm", 0.02 * k, (0.0 if k < 25 else 3.0, 0.2)) for k in range(51))
    for t, verdict, reason, value in judged_run(arm, "arm", Opened(samples=samples, duration=1.0)):
        jumping = 0.479 < t < 0.519
        assert verdict == ("undecided" if jumping else "within"), (t, reason)
        assert jumping or value < 1e-6
        assert ("jump" in reason) == jumping


def test_bodies_do_not_collide_unless_asked(tmp_path):
    """A folded arm inside a table, pulled through itself: no contact, no error."""
    text = 'q = [0, 3.1]\n[[parts]]\nname = "table"\nshape = { box = [3, 3, 1] }\n'
    station = made(tmp_path, TWO_R + text, {"arm.urdf": two_r()})
    engine = Engine(station.model)
    for _ in range(20):
        state = engine.tick()
        assert engine._data.ncon == 0
    assert state.hearings["arm"].error < 1e-5


def test_two_runs_are_equal_bit_for_bit(ur10):
    opened = recorded("arm", wave, 100, 0.5)

    def once():
        return [
            (s.poses(), s.data.qpos.tobytes(), s.data.qvel.tobytes()) for s in followed(ur10, "arm", opened)
        ]

    assert once() == once()


def test_what_is_asked_of_a_state_does_not_change_the_motion(ur10):
    """Mass matrices, Jacobians and distances are views: with and without them, the same bits."""
    opened, robot = recorded("arm", wave, 100, 0.3), ur10.model.robot("arm")
    plain = [s.data.qpos.tobytes() for s in followed(ur10, "arm", opened)]
    asked = []
    for state in followed(ur10, "arm", opened):
        state.mass_matrix(robot), state.jacobian(robot.tip, robot)
        for body in range(len(ur10.model.bodies)):
            state.fastest_point(body)
        asked.append(state.data.qpos.tobytes())
    assert plain == asked


# -- task space ---------------------------------------------------------------------------------


def pose_of(state, frame):
    rotation, position = state.pose(frame)
    wxyz = np.zeros(4)
    mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(rotation).ravel())
    return tuple(position.tolist()), tuple(wxyz.tolist())


@pytest.mark.parametrize(("target", "frame"), [("arm", "arm"), ("arm/tool0", "arm/tool0"), ("load", "load")])
def test_poses_drive_the_robot_exactly(ur10, target, frame):
    """Poses of a joint motion, made here, played back: the frame is where they say."""
    model = ur10.model
    made_by = Engine(model, controllers=False)
    frames = model.frame(frame)
    poses = []
    for k in range(31):
        made_by._put(model.robot("arm"), wave(0.01 * k)[0], np.zeros(6))
        made_by._show(0.0)
        rotation = made_by._shown.xmat[frames.mj].reshape(3, 3) @ frames.body_from_frame[:3, :3]
        position = (
            made_by._shown.xpos[frames.mj]
            + made_by._shown.xmat[frames.mj].reshape(3, 3) @ frames.body_from_frame[:3, 3]
        )
        wxyz = np.zeros(4)
        mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(rotation).ravel())
        poses.append((tuple(position.tolist()), tuple(wxyz.tolist())))
    engine = Engine(model)
    engine.take([heard("arm", -0.01, wave(-0.01)[0])])
    for k, (position, wxyz) in enumerate(poses):
        engine.take([PoseSample(source="p", seq=k, t=0.01 * k, target=target, position=position, wxyz=wxyz)])
        state = engine.tick() if k else engine.start()
    assert not state.doubt("arm")
    assert np.linalg.norm(state.pose(frames)[1] - poses[-1][0]) < 2e-5
    reached = engine._references["arm"].newest
    made_by._put(model.robot("arm"), reached, np.zeros(6))
    made_by._show(0.0)
    body = made_by._shown.xmat[frames.mj].reshape(3, 3)
    at = made_by._shown.xpos[frames.mj] + body @ frames.body_from_frame[:3, 3]
    assert np.linalg.norm(at - poses[-1][0]) < 1e-6


def test_pose_out_of_reach_is_undecided(ur10):
    engine = Engine(ur10.model)
    engine.take(
        [PoseSample(source="p", seq=0, t=0.0, target="arm", position=(9.0, 0.0, 0.0), wxyz=(1.0, 0, 0, 0))]
    )
    state = engine.start()
    assert "cannot reach" in state.doubt("arm")
    with pytest.raises(Undecided, match="cannot reach"):
        state.q(ur10.model.robot("arm"))


def test_criteria_at_a_state_are_those_of_a_run(arm):
    """`results_at` of the other tests is the same road."""
    assert results_at(arm, arm=((0.0, 1.0), (1.0, -2.0)))["energy"].verdict == "within"
