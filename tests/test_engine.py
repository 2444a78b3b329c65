"""The twin in motion: tracking, energy, torque limits, jumps, silence."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from made_cell import AMPLITUDE, FLOATING, Q0, TWO_R, UR10, heard, hinge_limits, made, recorded, two_r, wave
from seerob.session.run import pump
from seerob.twin.engine import Engine
from seerob.twin.partial_model import partial_model
from seerob.workstation.source import Source

PERSON = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\n'


def quintic(t, T=2.0):
    """From rest to rest with a peak of 2 rad/s."""
    s, D = min(t / T, 1.0), AMPLITUDE * 2 * T / 1.875
    return Q0 + D * (10 * s**3 - 15 * s**4 + 6 * s**5), D * (30 * s**2 - 60 * s**3 + 30 * s**4) / T


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


def test_rotors_and_dampers_do_not_hold_the_twin_back(tmp_path):
    damped = two_r().replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><dynamics damping="8"/>')
    station = made(tmp_path, FLOATING + TWO_R + "rotor_inertia = [2.0, 3.0]\n", {"arm.urdf": damped})
    assert (station.model.mj.dof_damping == 8).all()

    def motion(t):
        return np.array([np.sin(2 * t), 0.5 * np.cos(3 * t)]), np.array(
            [2 * np.cos(2 * t), -1.5 * np.sin(3 * t)]
        )

    errors, speeds = tracking(station, "arm", motion, recorded("arm", motion, 100, 1.0))
    assert errors.max() < 3e-7
    assert speeds.max() < 1e-4


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


@pytest.mark.parametrize("name", ["ur10", "iiwa14", "ur5e"])
def test_the_integrator_of_a_run_changes_free_energy_in_proportion_to_its_step(tmp_path, name):
    """Unlike that of free motion, which nothing pulls: stiff gains want one that damps implicitly."""
    drift = []
    for step in (0.002, 0.001):
        text = f"engine = {{ gravity = [0, 0, 0], timestep = {step} }}\n"
        station = made(tmp_path / str(step), f'{text}[[robots]]\nname = "arm"\nmodel = "library:{name}"\n')
        robot, n = station.model.robot("arm"), len(station.model.robot("arm").joints)
        rng = np.random.default_rng(3)
        engine = Engine(station.model, controllers=False)
        engine._mj.opt.integrator = station.model.mj.opt.integrator
        engine.take([heard("arm", 0.0, rng.uniform(-1, 1, n), rng.uniform(-1, 1, n))])
        states = (engine.tick() if k else engine.start() for k in range(201))
        energies = [0.5 * s.qd(robot) @ s.mass_matrix(robot) @ s.qd(robot) for s in states]
        drift.append(np.ptp(energies) / energies[0])
    assert drift[0] < 0.009
    assert drift[0] / drift[1] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(("velocities", "within"), [(True, 2e-5), (False, 5e-4)])
def test_the_energy_of_a_run_is_that_of_the_motion_it_follows(ur10, velocities, within):
    """Pulled as in every run, with 100 Hz samples; the truth is that of a twin put on the motion."""
    robot, mj = ur10.model.robot("arm"), ur10.model.mj
    data, M = mujoco.MjData(mj), np.zeros((mj.nv, mj.nv))
    off, largest = 0.0, 0.0
    for state in followed(ur10, "arm", recorded("arm", wave, 100, 1.5, velocities=velocities)):
        data.qpos[robot.q_address], qd = wave(state.t)
        mujoco.mj_kinematics(mj, data)
        mujoco.mj_comPos(mj, data)
        mujoco.mj_makeM(mj, data)
        mujoco.mj_fullM(mj, data, M)
        truth = 0.5 * qd @ M @ qd
        found = 0.5 * state.qd(robot) @ state.mass_matrix(robot) @ state.qd(robot)
        off, largest = max(off, abs(found - truth)), max(largest, truth)
    assert largest > 10
    assert off < within * largest


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


@pytest.mark.parametrize("torque", [np.inf, 30.0])
def test_a_step_of_joints_alone_is_a_step_of_mujoco_bit_for_bit(ur10, torque):
    ways = []
    for simple in (True, False):
        engine = Engine(ur10.model, driven={"arm": 0.2})
        assert engine._simple
        engine._simple = simple
        engine._mj.actuator_forcerange[:] = np.clip(engine._mj.actuator_forcerange, -torque, torque)
        for k, samples in enumerate(pump([(Source(), recorded("arm", wave, 100, 0.2))], 0.01)):
            engine.take(samples)
            state = engine.tick() if k else engine.start()
            data = engine._data
            now = data.qpos, data.qvel, data.actuator_force, data.qfrc_smooth
            ways.append((simple, k, state.poses(), *(each.tobytes() for each in now)))
    half = len(ways) // 2
    assert [way[1:] for way in ways[:half]] == [way[1:] for way in ways[half:]]


def test_what_mujoco_works_out_for_compiled_loops_is_what_it_works_out_for_python(ur10):
    engine = Engine(ur10.model, driven={"arm": 0.2})
    for k, samples in enumerate(pump([(Source(), recorded("arm", wave, 100, 0.2))], 0.01)):
        engine.take(samples)
        state = engine.tick() if k else engine.start()
    asked, wanted = state.data, engine._wanted
    mj, data, torques = engine._mj, mujoco.MjData(engine._mj), np.zeros(engine._mj.nv)
    for of in (asked, wanted):
        data.qpos[:], data.qvel[:], data.qacc[:] = of.qpos, of.qvel, of.qacc
        mujoco.mj_kinematics(mj, data)
        mujoco.mj_comPos(mj, data)
        mujoco.mj_comVel(mj, data)
        for name in ("xpos", "xmat", "xquat", "cdof", "cvel", "subtree_com"):
            assert getattr(of, name).tobytes() == getattr(data, name).tobytes()
    mujoco.mj_passive(mj, data)
    mujoco.mj_rne(mj, data, 1, torques)
    assert wanted.qfrc_passive.tobytes() == data.qfrc_passive.tobytes()
    assert engine._torques.tobytes() == torques.tobytes()
    assert np.abs(torques).min() > 0
    assert state.positions.tobytes() == asked.xpos[[body.mj for body in ur10.model.bodies]].tobytes()


@pytest.mark.parametrize("name", ["arm", "op"])
def test_trees_by_themselves_are_where_they_are_in_the_cell_bit_for_bit(tmp_path, name):
    model = made(tmp_path, UR10 + PERSON).model
    mj, robot = model.mj, model.mechanism(name)
    found = partial_model(mj, np.unique(mj.body_rootid[list(robot.mj_bodies)]))
    whole, alone = mujoco.MjData(mj), mujoco.MjData(found.mj)
    whole.qpos[:], whole.qvel[:] = np.random.default_rng(3).uniform(-2, 2, (2, mj.nv))
    alone.qpos[:], alone.qvel[:] = whole.qpos[found.q], whole.qvel[found.v]
    for model, data in ((mj, whole), (found.mj, alone)):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
    own = found.bodies[1:]
    assert {*robot.mj_bodies.tolist()} <= {*own.tolist()}
    assert len(found.v) == len(robot.v_address) < mj.nv
    for array in ("xpos", "xmat", "xquat", "cvel", "subtree_com"):
        assert getattr(alone, array)[1:].tobytes() == getattr(whole, array)[own].tobytes()


@pytest.mark.parametrize("speed", [1e4, np.nan])
def test_what_the_physics_loses_is_put_back_and_moves_nobody_else(tmp_path, speed):
    station = made(tmp_path, FLOATING + TWO_R + PERSON, {"arm.urdf": two_r()})
    arm, person = station.model.mechanism("arm"), station.model.mechanism("op")
    ways = []
    for at in (None, 7):
        engine = Engine(station.model, driven={"arm": 0.2, "op": 0.2})
        engine.take([heard("arm", 0.0, [0.1, 0.2]), heard("op", 0.0, person.home + 0.01)])
        engine.take([heard("arm", 0.15, [0.2, 0.1]), heard("op", 0.15, person.home)])
        engine.start()
        for k in range(12):
            if k == at:
                engine._data.qvel[arm.v_address] = speed
            state = engine.tick()
            assert state.path.broken == (("arm",) if k == at else ())
            if k == (at or 7):
                assert state.hearings["arm"].reset_at == (-np.inf if at is None else 0.002 + k * 0.01)
                ways.append(state.path.copied())
        ways.append(state.data.qpos[person.q_address].tobytes())
        assert state.hearings["arm"].error < 1e-3
    before, _, after, _ = ways
    assert ways[1] == ways[3]
    rows, places = person.v_address, person.q_address
    assert before.v[:, rows].tobytes() == after.v[:, rows].tobytes()
    assert before.q[:, places].tobytes() == after.q[:, places].tobytes()


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


@pytest.mark.parametrize("whole", [float, int])
def test_after_a_silence_it_moves_as_fast_as_is_heard_from_the_instant_of_the_sample_on(tmp_path, whole):
    """Also where that is the instant of a tick; whole numbers are as good as any."""
    station = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()})
    arm = station.model.robot("arm")
    engine, speeds = Engine(station.model, driven={"arm": 0.05}), {}
    for k in range(30):
        if not 3 < k < 20:
            sample = heard("arm", k * 0.01, [k * 0.01, 0.0], [1.0, 0.0])
            engine.take([replace(sample, q=(whole(k > 19), whole(0)), qd=(whole(1), whole(0)))])
        state = engine.tick() if k else engine.start()
        speeds[k] = state.qd(arm)[0] if state.invalid_reason("arm") == "" else None
    assert speeds[15] is None
    assert speeds[20] == pytest.approx(1.0, abs=1e-9)
