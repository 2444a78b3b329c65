"""What a robot does while it reacts: known ahead, bounded by an acceleration, or left open."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from made_cell import UR10, heard, made, person, state_at, two_r
from made_separation import KNOWN, TABLE, K, V, part, separation, station, terms
from seerob.core.verdict import Verdict
from seerob.criteria.judging import Judge
from seerob.criteria.safety.separation import MORE
from seerob.criteria.stopping.onset import Levers, accelerated, by_joints, held
from seerob.criteria.stopping.terms import braking, course
from seerob.session.run import looks_ahead
from seerob.twin.engine import Engine
from seerob.workstation.source import Opened, Pump

T_R, T_S, V_H = 0.1, 0.3, 1.6
OPEN = f"reaction = {T_R}, stopping = {T_S}"
GIVEN = f"{OPEN}, acceleration = "
HALF = ', model = "constant_deceleration"'
WALKS = KNOWN + f"human_speed = {V_H}\n"


def recorded(cell, motion, until, *, live=()):
    """What separation says at each tick of a motion (q, qd) of the first joint."""
    engine, judge = Engine(cell.model, driven={"arm": 0.2}, live=live), Judge(cell.bound)
    times = np.arange(0, until + 1e-9, 0.01).tolist()
    samples = tuple(heard("arm", t, (motion(t)[0], 0.0), (motion(t)[1], 0.0)) for t in times)
    pump, ahead = Pump(Opened(samples=samples, duration=until)), looks_ahead(cell.model).get("arm", 0.0)
    found = []
    for k in range(len(times)):
        engine.take(list(pump.until(k * 0.01 + (0.0 if live else ahead))))
        found.append(judge(engine.tick() if k else engine.start())[0])
    return found


def test_with_no_acceleration_it_is_the_formula_of_constant_speed():
    v, qd = np.array([0.3, 1.2]), np.array([0.5, -1.0])
    for onset in (held(v, T_R, qd), accelerated(v, T_R, 0.0, qd)):
        found, wanted = braking(onset, T_S), course(v, T_R, T_S)
        for key in ("v_r", "S_r", "S_s", "T_s"):
            np.testing.assert_array_equal(getattr(found, key), getattr(wanted, key))


@pytest.mark.parametrize("v", [0.0, 1.0])
@pytest.mark.parametrize(("more", "share"), [("", 1.0), (HALF, 0.5)])
def test_a_given_acceleration_counts_while_it_reacts(tmp_path, v, more, share):
    """v + a T_r when it begins to brake; on the way there v T_r + a T_r² / 2."""
    a = 6.0
    S = separation(tmp_path, f"{GIVEN}{a}{more}", WALKS, qd=(v, 0.0))
    wanted = [
        V_H * (T_R + T_S),
        V * v * T_R + a * T_R**2 / 2,
        share * (V * v + a * T_R) * T_S,
        0.2,
        0.1,
        0.05,
    ]
    assert terms(S) == pytest.approx(wanted)
    assert sum(wanted) == pytest.approx(S.limit)


def test_a_recorded_motion_counts_with_what_it_does_next(tmp_path):
    """6 rad/s² at 2 m: after 0.1 s it is 1.2 m/s faster than now."""
    cell = station(tmp_path, OPEN, WALKS, x=9.0)
    found = recorded(cell, lambda t: (3 * t * t, 6 * t), 0.5)
    now = found[20]
    v, later = 6 * 0.2 * V, 6 * 0.3 * V
    S_h, S_r, S_s = terms(now)[:3]
    assert S_h == pytest.approx(V_H * (T_R + T_S))
    # Between two ticks the faster counts, and it may react until the next.
    tick = 6 * V * 0.01
    assert (v + later) / 2 * T_R < S_r <= ((v + later) / 2 + 1.6 * tick) * T_R
    assert later * T_S < S_s <= (later + 1.1 * tick) * T_S
    assert now.verdict is Verdict.WITHIN
    # Past its end nobody knows, and what is known is not enough for more than exceeded.
    assert {result.verdict for result in found[-9:]} == {Verdict.UNDECIDED}
    assert "its motion ends" in found[-1].reason
    assert (part(found[-1], MORE).value, MORE in {p.name for p in now.parts}) == (None, False)
    close = station(tmp_path / "close", OPEN, WALKS, x=3.0)
    assert {r.verdict for r in recorded(close, lambda t: (3 * t * t, 6 * t), 0.5)[-9:]} == {Verdict.EXCEEDED}


def test_a_recorded_motion_that_gets_slower_counts_with_its_present_speed(tmp_path):
    slower = lambda t: (2 * t - 2 * t * t, 2 - 4 * t)  # noqa: E731
    found = recorded(station(tmp_path / "a", OPEN, WALKS), slower, 0.5)
    plain = recorded(station(tmp_path / "b", GIVEN + "0", WALKS), slower, 0.5)
    for with_future, without in zip(found, plain, strict=True):
        # What it does between two instants is bounded, not known.
        assert without.limit * (1 - 1e-6) <= with_future.limit <= without.limit + 1e-3
        assert with_future.verdict is without.verdict


def test_of_a_live_robot_the_limits_of_its_joints_count_and_else_its_speed_limits_leave_it_open(tmp_path):
    still = lambda t: (0.0, 0.0)  # noqa: E731
    limited = "rotor_inertia = [0.0, 0.0]\nacceleration_limits = [3.0, 3.0]\n"
    (found, *_) = recorded(station(tmp_path / "a", OPEN, WALKS, arm=limited), still, 0.02, live=["arm"])
    gain = 3 * 0.1 * (V + np.hypot(1, 0.05))
    assert (V_H + 0.9 * gain) * T_S < found.limit - V_H * T_R - K < (V_H + 1.6 * gain) * T_S + gain * T_R
    slow = two_r().replace('velocity="10"', 'velocity="0.5"')
    (unsure, *_) = recorded(station(tmp_path / "b", OPEN, WALKS, x=3.4, urdf=slow), still, 0.02, live=["arm"])
    assert unsure.limit == pytest.approx(V_H * (T_R + T_S) + K)
    assert unsure.verdict is Verdict.UNDECIDED
    assert "give stop.acceleration" in unsure.reason
    assert part(unsure, MORE).value == pytest.approx(unsure.value - unsure.interval[0], rel=0.5)
    (far, *_) = recorded(station(tmp_path / "c", OPEN, WALKS, x=9.0, urdf=slow), still, 0.02, live=["arm"])
    (near, *_) = recorded(station(tmp_path / "d", OPEN, WALKS, x=2.5, urdf=slow), still, 0.02, live=["arm"])
    assert (far.verdict, near.verdict) == (Verdict.WITHIN, Verdict.EXCEEDED)
    silent = two_r().replace(' velocity="10"', "")
    (open_, *_) = recorded(
        station(tmp_path / "e", OPEN, WALKS, urdf=silent, x=40.0), still, 0.02, live=["arm"]
    )
    assert open_.verdict is Verdict.UNDECIDED
    assert "speed limit of j1, j2" in open_.reason


@pytest.mark.parametrize(("x", "verdict"), [(2.5, "exceeded"), (30.0, "undecided")])
def test_beyond_its_table_a_robot_needs_no_less_than_at_its_end(tmp_path, x, verdict):
    S = separation(tmp_path, TABLE, WALKS, x=x, qd=(9.0, 0.0))
    end = separation(tmp_path / "end", TABLE, WALKS, x=x, qd=(3.0, 0.0))
    assert S.verdict == verdict
    assert S.limit > end.limit
    if verdict == "undecided":
        assert "j1: speed is 3 of the full figure, the stopping table ends at 1" in S.reason
        assert part(S, "largest permissible speed").value is None


def test_no_motion_within_the_bounds_of_the_joints_is_faster_than_the_bound(tmp_path):
    """An arm of six joints that accelerate at random, up to their limits."""
    cell = made(tmp_path, "engine = { gravity = [0, 0, 0] }\n" + UR10 + person("op", 9, 0, 0))
    model, robot = cell.model, cell.model.robot("arm")
    gap = model.gap(model.select("op"), robot.moving)
    rng, levers, steps = np.random.default_rng(5), Levers(model, robot, gap), 10
    tightest = np.inf
    for _ in range(12):
        q, qd, qdd = rng.uniform(-2, 2, 6), rng.uniform(-1.5, 1.5, 6), rng.uniform(0.0, 12, 6)
        largest = np.full(6, rng.choice([2.0, np.inf]))
        state = state_at(cell, arm=(q, qd))
        chains, v0 = levers.at(state), state.fastest_points(gap.b)[0].copy()
        onset = by_joints(v0, T_R, qd, qdd, largest, robot.coupling, chains)
        path = np.zeros(len(gap.b))
        before = v0
        for _step in range(steps):
            dt = T_R / steps
            a = qdd * rng.choice([-1.0, 1.0], 6)
            faster = np.clip(qd + a * dt, -np.maximum(largest, np.abs(qd)), np.maximum(largest, np.abs(qd)))
            q, qd = q + dt * (qd + faster) / 2, faster
            now = state_at(cell, arm=(q, qd)).fastest_points(gap.b)[0]
            path += dt * (before + now) / 2
            before = now
            assert (now <= onset.v_s + 1e-9).all()
        assert (path <= onset.S_r + 1e-6).all()
        tightest = min(tightest, float((onset.v_s / np.maximum(now, 0.05)).min()))
    assert tightest < 3


@pytest.mark.parametrize(("limit", "holds"), [(2.0, True), (0.97, True), (0.9, False), (0.3, False)])
def test_a_speed_limit_that_the_robot_is_beyond_bounds_nothing(tmp_path, limit, holds):
    cell = made(tmp_path, "engine = { gravity = [0, 0, 0] }\n" + UR10 + person("op", 9, 0, 0))
    robot = cell.model.robot("arm")
    gap = cell.model.gap(cell.model.select("op"), robot.moving)
    qd, qdd = np.array([1.0, 0, 0, 0, 0, 0]), np.full(6, 4.0)
    state = state_at(cell, arm=(np.zeros(6), qd))
    v, chains = state.fastest_points(gap.b)[0], Levers(cell.model, robot, gap).at(state)
    largest = np.full(6, np.inf)
    endless = by_joints(v, T_R, qd, qdd, largest, robot.coupling, chains)
    largest[0] = limit
    found = by_joints(v, T_R, qd, qdd, largest, robot.coupling, chains)
    assert found.speeds[0] == pytest.approx(min(1 + 4 * T_R, max(limit, 1.0)) if holds else 1 + 4 * T_R)
    if not holds:
        np.testing.assert_array_equal(found.S_r, endless.S_r)


def test_no_motion_within_its_speed_limits_is_faster_than_all_of_them_at_once(tmp_path):
    """However quickly it gets there: each joint takes any speed at any step."""
    cell = made(tmp_path, "engine = { gravity = [0, 0, 0] }\n" + UR10 + person("op", 9, 0, 0))
    model, robot = cell.model, cell.model.robot("arm")
    gap = model.gap(model.select("op"), robot.moving)
    rng, levers, steps, largest = np.random.default_rng(6), Levers(model, robot, gap), 10, np.full(6, 2.0)
    for _ in range(12):
        q, qd = rng.uniform(-2, 2, 6), rng.uniform(-2, 2, 6)
        state = state_at(cell, arm=(q, qd))
        chains, v0 = levers.at(state), state.fastest_points(gap.b)[0].copy()
        onset = by_joints(v0, T_R, qd, None, largest, robot.coupling, chains)
        path = np.zeros(len(gap.b))
        for _step in range(steps):
            qd = largest * rng.choice([-1.0, 1.0], 6)
            now = state_at(cell, arm=(q, qd)).fastest_points(gap.b)[0]
            q = q + T_R / steps * qd
            path += T_R / steps * now
            assert (now <= onset.v_s + 1e-9).all()
        assert (path <= onset.S_r + 1e-6).all()
        quick = by_joints(v0, T_R, qd, np.full(6, 1e6), largest, robot.coupling, levers.at(state))
        np.testing.assert_allclose(onset.v_s, quick.v_s)


def test_S_p_never_falls_with_what_makes_it_worse(tmp_path):
    figures = []
    for k, stop in enumerate(
        (
            "reaction = 0.1, stopping = 0.3, acceleration = 0",
            "reaction = 0.1, stopping = 0.3, acceleration = 0.5",
            "reaction = 0.15, stopping = 0.3, acceleration = 0.5",
            "reaction = 0.15, stopping = 0.31, acceleration = 0.5",
            "reaction = 0.15, stopping = 0.31, acceleration = 4",
        )
    ):
        figures.append(separation(tmp_path / str(k), stop, WALKS).limit)
    assert figures == sorted(figures)
    assert len(set(figures)) == len(figures)


def strongest(folder, kg):
    """What torque limits allow at rest, by MuJoCo [rad/s²], (postures, 6), and the speed limits [rad/s]."""
    cell = made(folder, UR10.replace("library:ur10", "library:ur10e").replace("mass = 3", f"mass = {kg}"))
    mj, robot, rng = cell.model.mj, cell.model.robot("arm"), np.random.default_rng(0)
    tau, largest = (np.array([x.value for x in of]) for of in (robot.effort_limits, robot.velocity_limits))
    data, M, found = mujoco.MjData(mj), np.zeros((mj.nv, mj.nv)), []
    for _ in range(60):
        data.qpos[robot.q_address] = rng.uniform(-np.pi, np.pi, 6)
        mujoco.mj_forward(mj, data)
        mujoco.mj_fullM(mj, data, M)
        inverse = np.linalg.inv(M[np.ix_(robot.v_address, robot.v_address)])
        found.append(np.abs(inverse) @ tau - np.abs(inverse @ data.qfrc_bias[robot.v_address]))
    return np.array(found), largest


def test_torques_and_masses_say_no_more_than_speed_limits_at_once(tmp_path):
    """Why nothing bounds S_p by them: no bound is less than what an arm can do, and that is anything.

    With 12.5 kg, its rated payload, each joint of a UR10e can be at its speed limit within some 10 ms; and a
    payload that nobody knows may make others faster, through the coupling of M.
    """
    (light, largest), (loaded, _) = (strongest(tmp_path / f"{kg}", kg) for kg in (0.001, 12.5))
    assert (np.median(largest / loaded, axis=0) < 0.015).all()
    assert (np.median(largest / light, axis=0) < 0.012).all()
    assert (loaded / light).max() > 1.3
