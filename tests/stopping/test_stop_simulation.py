"""Simulated stops against closed forms, the energy balance, and a general-purpose integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from made_cell import FLOATING, TWO_R, made, state_at, two_r
from seerob.core.errors import Undecided
from seerob.criteria.stopping.simulated import STEP, StopSimulation
from seerob.kernels.braking import braked

M, L, G = 2.0, 0.8, 9.81
INERTIA = M * L**2
ONE = (
    f'<robot name="one"><link name="base"/><link name="l1"><inertial>'
    f'<origin xyz="{L} 0 0"/><mass value="{M}"/>'
    '<inertia ixx="4e-3" iyy="1e-11" izz="4e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
    '<collision><origin xyz="0.4 0 0"/><geometry><box size="0.8 0.1 0.1"/></geometry></collision></link>'
    '<joint name="j1" type="continuous"><parent link="base"/><child link="l1"/><axis xyz="0 -1 0"/>'
    '<limit effort="100" velocity="10"/></joint></robot>'
)
"""A mass on a rod, a needle along the axis: a point in its plane; the angle is the rod's elevation."""


def stop(folder, urdf, q, qd, brakes, *, gravity=True, reaction=0.1, scale=1.0):
    engine = "" if gravity else FLOATING
    station = made(folder, engine + TWO_R, {"arm.urdf": urdf})
    robot = station.model.robot("arm")
    simulation = StopSimulation(station.model, robot, np.array(brakes, float), robot.moving)
    state = state_at(station, arm=(q, qd))
    return simulation.stop(state, reaction, scale), state, simulation


@pytest.mark.parametrize("omega", [3.0, -1.0])
def test_constant_brake_torque_without_gravity(tmp_path, omega):
    B = 12.0
    stopped, _, _ = stop(tmp_path, ONE, [0.3], [omega], [B], gravity=False)
    a = B / INERTIA
    assert stopped.T_s == pytest.approx(abs(omega) / a, abs=1.01 * STEP)
    assert stopped.T_s >= abs(omega) / a - 1e-12
    turned = np.sign(omega) * (abs(omega) * 0.1 + omega**2 / (2 * a))
    assert stopped.q[-1, 0] - 0.3 == pytest.approx(turned, abs=a * STEP**2)


@pytest.mark.parametrize(("q0", "omega"), [(0.2, -2.0), (0.2, 2.0), (-1.0, 1.5), (2.5, 2.0)])
def test_constant_brake_torque_with_gravity(tmp_path, q0, omega):
    """Energy decides where it stands: ½ I ω² = B |Δq| + m g L (sin q1 − sin q0)."""
    B = 30.0
    stopped, _, _ = stop(tmp_path, ONE, [q0], [omega], [B])
    start = stopped.q[stopped.braking, 0]
    assert start == pytest.approx(q0 + 0.1 * omega)

    def left(angle):
        end = start + np.sign(omega) * angle
        return INERTIA * omega**2 / 2 - B * angle - M * G * L * (np.sin(end) - np.sin(start))

    assert abs(stopped.q[-1, 0] - start) == pytest.approx(brentq(left, 0, 3), abs=2e-4)


def test_gravity_lengthens_a_stop_downward(tmp_path):
    ends = [
        abs(stop(tmp_path / str(i), ONE, [0.0], [w], [30.0], reaction=1e-9)[0].q[-1, 0])
        for i, w in enumerate((-2.0, 2.0))
    ]
    assert ends[0] > 2 * ends[1]


def test_brakes_that_are_too_weak_are_undecided(tmp_path):
    with pytest.raises(Undecided, match="do not bring it to a stand"):
        stop(tmp_path, ONE, [0.0], [-0.1], [M * G * L * 0.02])


def test_standing_arm_stays_exactly_when_its_brake_can_hold_it_and_sinks_otherwise(tmp_path):
    """A brake 2 % too weak lets it sink to where B |q| = m g L sin |q|."""
    held, _, _ = stop(tmp_path / "held", ONE, [0.0], [0.0], [M * G * L * 1.02])
    assert held.T_s == 0
    assert (held.q == 0).all()
    sinks, _, _ = stop(tmp_path / "sinks", ONE, [0.0], [0.0], [M * G * L * 0.98])
    assert sinks.q[-1, 0] == pytest.approx(-brentq(lambda x: np.sin(x) / x - 0.98, 0.1, 1), abs=2e-3)


def test_energy_balance_of_two_joints(tmp_path):
    """What the brakes take up is the kinetic energy: no gravity, coupled joints, one sticks first."""
    q, qd, B = [0.0, 1.2], np.array([1.4, -2.0]), np.array([9.0, 2.0])
    stopped, state, _ = stop(tmp_path, two_r(), q, qd, B, gravity=False, reaction=1e-9)
    robot = state.model.robot("arm")
    energy = qd @ state.mass_matrix(robot) @ qd / 2
    turned = np.abs(np.diff(stopped.q, axis=0)).sum(axis=0)
    assert B @ turned == pytest.approx(energy, rel=5e-3)
    assert (stopped.qd[-1] == 0).all()


def test_trajectory_equals_a_general_integrator_until_the_first_joint_stands(tmp_path):
    q0, qd0, B = np.array([0.3, 0.9]), np.array([1.5, 1.0]), np.array([6.0, 1.0])
    stopped, _, _ = stop(tmp_path, two_r(), q0, qd0, B, gravity=False, reaction=1e-9)

    def motion(t, y):
        c, s = np.cos(y[1]), np.sin(y[1])
        mass = np.array([[3 + 2 * c, 1 + c], [1 + c, 1.0]])
        bias = np.array([-s * (2 * y[2] * y[3] + y[3] ** 2), s * y[2] ** 2])
        return [*y[2:], *np.linalg.solve(mass, -bias - B * np.sign(qd0))]

    same = np.sign(stopped.qd) == np.sign(qd0)
    k = int(np.argmin(same.all(axis=1))) - 2
    assert k > 30
    answer = solve_ivp(motion, (0, stopped.t[k]), [*q0, *qd0], rtol=1e-10, atol=1e-12).y[:, -1]
    assert stopped.q[k] == pytest.approx(answer[:2], abs=2e-5)
    assert stopped.qd[k] == pytest.approx(answer[2:], abs=2e-4)


def test_ways_bound_the_path_of_every_corner_and_never_exceed_full_speed_for_the_stopping_time(tmp_path):
    stopped, state, _ = stop(tmp_path, two_r(), [0.0, 0.5], [1.0, 0.5], [8.0, 3.0], gravity=False)
    found = stopped.course()
    robot = state.model.robot("arm")
    for k, index in enumerate(robot.moving):
        corners = state.model.bodies[index].corners
        world = np.einsum("tij,cj->tci", stopped.rotations[:, k], corners) + stopped.positions[:, k, None]
        path = np.linalg.norm(np.diff(world, axis=0), axis=2).sum(axis=0).max()
        assert path <= found.S_r[k] + found.S_s[k]
        assert found.S_r[k] + found.S_s[k] <= path * 1.03
        assert found.v_r[k] == pytest.approx(state.fastest_point(index)[0])
    v = stopped.speeds[stopped.braking]
    assert (found.S_s <= v * found.T_s * (1 + 1e-12)).all()
    assert (found.S_s >= v * found.T_s * 0.3).all()


PROUD = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1.04 0.14 0.14"/></geometry></visual>'


@pytest.mark.parametrize("shape", ['box size="1 0.1 0.1"', 'sphere radius="0.2"', "proud"])
def test_speeds_are_those_of_the_state_in_any_pose(tmp_path, shape):
    rng = np.random.default_rng(1)
    urdf = two_r().replace('box size="1 0.1 0.1"', shape)
    if shape == "proud":
        urdf = two_r().replace("</collision></link>", f"</collision>{PROUD}</link>")
    for i in range(5):
        q, qd = rng.uniform(-2, 2, 2), rng.uniform(-2, 2, 2)
        stopped, state, _ = stop(tmp_path / str(i), urdf, q, qd, [50.0, 50.0])
        wanted = [state.fastest_point(b)[0] for b in state.model.robot("arm").moving]
        assert stopped.speeds[0] == pytest.approx(wanted, rel=1e-9)


def test_it_leaves_the_twin_alone_and_repeats_itself(tmp_path):
    first, state, simulation = stop(tmp_path, two_r(), [0.1, 0.2], [1.0, -1.0], [9.0, 4.0])
    before = state.data.qpos.copy(), state.data.qvel.copy(), state.data.xpos.copy()
    again = simulation.stop(state, 0.1)
    after = state.data.qpos, state.data.qvel, state.data.xpos
    assert all((x == y).all() for x, y in zip(before, after, strict=True))
    assert (again.q == first.q).all()


def test_faster_takes_longer(tmp_path):
    ends = [stop(tmp_path / str(s), ONE, [0.0], [2.0], [30.0], scale=s)[0].T_s for s in (0.25, 0.5, 1.0)]
    assert ends[0] < ends[1] < ends[2]


def test_unknown_mass_is_undecided(tmp_path):
    bare = ONE.replace(ONE[ONE.index("<inertial>") : ONE.index("</inertial>") + 11], "")
    with pytest.raises(Undecided, match="mass"):
        stop(tmp_path, bare, [0.0], [1.0], [30.0])


def test_braked_minimises_what_it_says():
    """Against the optimality condition: τ = (M (v⁺ − v) + h b) / h within ±B, at the bound where it slips."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        n = int(rng.integers(1, 8))
        A = rng.normal(size=(n, n))
        mass = A @ A.T + 0.05 * np.eye(n)
        b, v, B = rng.normal(size=n) * 5, rng.normal(size=n), rng.uniform(0.1, 20, n)
        after = np.empty(n)
        assert braked(mass, b, v, B, 0.01, after)
        torque = (mass @ (after - v)) / 0.01 + b
        slips = after != 0
        assert torque[slips] == pytest.approx(-(B * np.sign(after))[slips], abs=1e-5)
        assert (np.abs(torque) <= B + 1e-5).all()


@pytest.mark.parametrize(("reaction", "steps"), [(0.004, 1), (0.1, 10), (0.105, 11)])
def test_while_reacting_it_goes_on_as_it_moves_in_steps_of_ten_milliseconds(tmp_path, reaction, steps):
    q, qd = np.array([0.3, 0.2]), np.array([1.0, -2.0])
    stopped, _, _ = stop(tmp_path, two_r(), q, qd, [50.0, 50.0], reaction=reaction, scale=0.5)
    assert stopped.braking == steps
    t = stopped.t[: steps + 1]
    np.testing.assert_allclose(t, np.linspace(0, reaction, steps + 1), rtol=1e-12)
    np.testing.assert_allclose(stopped.q[: steps + 1], q + 0.5 * t[:, None] * qd, rtol=1e-12)
    np.testing.assert_allclose(stopped.qd[: steps + 1], np.tile(0.5 * qd, (steps + 1, 1)))
    elbow = np.column_stack([np.cos(stopped.q[:, 0]), np.sin(stopped.q[:, 0]), 0 * stopped.t])
    np.testing.assert_allclose(stopped.positions[:, 1], elbow, atol=1e-12)


def test_what_follows_a_joint_follows_it_while_it_stops(tmp_path):
    """The elbow turns twice as far the other way, from 0.3 rad on."""
    urdf = two_r(mimic='<mimic joint="j1" multiplier="-2" offset="0.3"/>')
    stopped, _, _ = stop(tmp_path, urdf, [0.2], [1.0], [30.0], gravity=False)
    angle = np.arctan2(stopped.rotations[:, 1, 1, 0], stopped.rotations[:, 1, 0, 0])
    np.testing.assert_allclose(angle, 0.3 - stopped.q[:, 0], atol=1e-12)


@pytest.mark.parametrize(("seconds", "ends"), [(4.98, True), (5.02, False)])
def test_a_stop_of_more_than_five_seconds_is_none(tmp_path, seconds, ends):
    """Of the brakes: what is lost while reacting is not counted."""
    brakes = [3.0 * INERTIA / seconds]
    if ends:
        stopped, _, _ = stop(tmp_path, ONE, [0.0], [3.0], brakes, gravity=False)
        assert stopped.T_s == pytest.approx(seconds, abs=1.01 * STEP)
        return
    with pytest.raises(Undecided, match="to a stand within 5 s"):
        stop(tmp_path, ONE, [0.0], [3.0], brakes, gravity=False)


def test_it_does_not_stand_while_one_joint_sinks(tmp_path):
    """In a vertical plane: the shoulder is held, the elbow's brake has half of what it needs."""
    upright = two_r().replace('axis xyz="0 0 1"', 'axis xyz="0 -1 0"')
    stopped, _, _ = stop(tmp_path, upright, [0.0, 0.0], [0.0, 0.0], [100.0, G / 2])
    assert (stopped.q[:, 0] == 0).all()
    assert stopped.q[-1, 1] == pytest.approx(-brentq(lambda x: np.sin(x) / x - 0.5, 1, 3), abs=5e-3)
    assert (stopped.qd[-1] == 0).all()


def test_the_error_falls_with_the_square_of_the_step(tmp_path, monkeypatch):
    """Where it stands, against a sixteenth of the step."""
    ends = []
    for k, step in enumerate((4e-3, 2e-3, 2.5e-4)):
        monkeypatch.setattr("seerob.criteria.stopping.simulated.STEP", step)
        stopped, _, _ = stop(tmp_path / str(k), ONE, [0.8], [-2.0], [25.0], reaction=1e-9)
        at = round(0.2 / step) + 1
        assert stopped.qd[at] < 0
        assert stopped.t[at] == pytest.approx(0.2 + 1e-9)
        ends.append(np.append(stopped.q[at], stopped.qd[at]))
    coarse, fine = (np.abs(end - ends[-1]).max() for end in ends[:2])
    assert coarse / fine == pytest.approx(4, rel=0.1)
    assert fine < 1e-5
