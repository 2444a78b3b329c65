"""S_p of random robots on random motions is no less than its integrals, at ticks and all the way between."""

from __future__ import annotations

import numpy as np
import pytest
from s_p_oracle import DECELERATION, STEP, T_R, T_S, V_H, Chain, K, cubic, knots, required, required_by_joints

from made_cell import heard, made
from seerob.core.snapshot import Verdict
from seerob.session.run import Judge, engine_of, looks_ahead, pump, ticks
from seerob.twin.engine import Engine

KINDS = ("bang-bang", "turning", "bursts", "bulging", "smooth")
STOPS = {
    "bound": f"stopping = {T_S}",
    "half": f'model = "constant_deceleration", stopping = {T_S}',
    "by deceleration": f'model = "constant_deceleration", deceleration = {DECELERATION}',
}
SAFE = """
[[safety]]
kind = "separation"
name = "{name}"
between = ["arm", "op"]
stop = {{ reaction = {T_R}, {stop} }}
human_speed = {V_H}
intrusion = {K}
human_uncertainty = 0
robot_uncertainty = 0
"""
SOURCE = """[[sources]]
kind = "csv"
robot = "arm"
file = "arm.csv"
"""
CELL = """
[engine]
gravity = [0, 0, 0]
physics = false
tick = {tick}
timestep = 0.001
[[robots]]
name = "arm"
model = "arm.urdf"
{limits}[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
at = {{ position = [8, 0, 0] }}
"""


def csv(chain, t, q, qd):
    units = ["m" if slide else "rad" for slide in chain.slides]
    head = [f"j{k} [{unit}]" for k, unit in enumerate(units)]
    head += [f"qd_j{k} [{unit}/s]" for k, unit in enumerate(units)]
    rows = np.column_stack([t, q, qd])
    return "\n".join([",".join(["t [s]", *head]), *(",".join(f"{x:.15g}" for x in row) for row in rows)])


def room(folder, seed, kind, end=0.3):
    """By stop, how much more S_p of the product is than its integral until the next tick, of every tick."""
    rng = np.random.default_rng(seed)
    chain, tick = Chain(rng), float(rng.choice([0.01, 0.005, 0.002]))
    file = csv(chain, *knots(rng, kind, len(chain.slides), end))
    text = CELL.format(tick=tick, limits="") + SOURCE
    text += "".join(SAFE.format(name=n, stop=s, T_R=T_R, V_H=V_H, K=K) for n, s in STOPS.items())
    station = made(folder, text, {"arm.urdf": chain.urdf, "arm.csv": file})
    samples = list(station.sources[0][1].samples)
    t, q, qd = (np.array([getattr(s, key) for s in samples]) for key in ("t", "q", "qd"))
    dense = np.arange(0, end + STEP / 2, STEP)
    v = chain.speeds(*cubic(t, q, qd, np.minimum(dense, end)))
    truth = {name: required(v, name) for name in STOPS}
    engine, judge, found = engine_of(station.model), Judge(station.bound), {name: [] for name in STOPS}
    ahead = looks_ahead(station.model)
    per = round(tick / STEP)
    for k, (out, _) in enumerate(ticks(engine, judge, pump(station.sources, tick, ahead=ahead))):
        for result in out.results:
            way = truth[result.name][k * per : (k + 1) * per + 1]
            parts = [part for part in result.parts if part.verdict is not None]
            if len(way) > per and not result.reason.startswith("S_p may"):
                least = np.array([part.limit for part in parts])
                found[result.name].append((least - way.max(axis=0)).min())
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_s_p_of_a_recorded_motion_is_no_less_than_its_integral_until_the_next_tick(tmp_path, kind):
    for seed in range(3):
        for name, found in room(tmp_path / f"{seed}", seed, kind).items():
            assert len(found) >= 8
            assert min(found) >= -1e-9, (seed, name)


# -- joint tables, people who are seen, robots that are heard live --------------------------------


def by_joints(chain, rates, full):
    """A table of joints that brake with some rates [rad/s²], up to some speed [rad/s]."""
    shares = np.arange(0.1, 1.01, 0.1)

    def grid(values):
        return str([[[float(x)]] for x in values])

    entries = ", ".join(
        f"{{ joint = {j}, full_speed = {full}, speed = {shares.round(3).tolist()}, "
        f"way = {grid((shares * full) ** 2 / 2 / a)}, time = {grid(shares * full / a)} }}"
        for j, a in enumerate(rates.tolist())
    )
    head = 'robot = "arm", category = 1, source = "s", confidence = "1S", rated_payload = 9.0'
    assert not chain.slides.any()
    return f'model = "table", table = {{ {head}, joints = [{entries}] }}'


@pytest.mark.parametrize("seed", range(3))
def test_s_p_by_a_joint_table_is_no_less_than_what_its_joints_need(tmp_path, seed):
    """Nothing is within where the robot is, or will be while it reacts, faster than its table."""
    rng, end, tick = np.random.default_rng(seed), 0.2, 0.01
    chain = Chain(rng, turning=True)
    t, q, qd = knots(rng, str(rng.choice(KINDS)), len(chain.slides), end)
    qd, q = 0.5 * qd, 0.5 * q
    rates, full = rng.uniform(4, 40, len(chain.slides)), float(np.abs(qd).max() * rng.uniform(0.5, 1.3))
    stop = by_joints(chain, rates, full)
    text = (
        CELL.format(tick=tick, limits="") + SOURCE + SAFE.format(name="c", stop=stop, T_R=T_R, V_H=V_H, K=K)
    )
    station = made(tmp_path, text, {"arm.urdf": chain.urdf, "arm.csv": csv(chain, t, q, qd)})
    dense = np.minimum(np.arange(0, end + STEP / 2, STEP), end)
    samples = list(station.sources[0][1].samples)
    knot = [np.array([getattr(each, key) for each in samples]) for key in ("t", "q", "qd")]
    at, moving = cubic(*knot, dense)
    truth, per = required_by_joints(chain, dense, at, moving, rates), round(tick / STEP)
    ahead, compared = looks_ahead(station.model), 0
    feed = pump(station.sources, tick, ahead=ahead)
    for k, (out, _) in enumerate(ticks(engine_of(station.model), Judge(station.bound), feed)):
        (result,) = out.results
        # What begins to brake until the next tick counts.
        window = np.abs(moving[k * per : (k + 1) * per + round(T_R / STEP) + 1])
        way = truth[k * per : (k + 1) * per + 1]
        if len(way) <= per:
            break
        compared += 1
        if window.max() > full * (1 + 1e-6):
            assert result.verdict is not Verdict.WITHIN
            assert "the stopping table ends at 1; S_p is at least the figure shown" in result.reason
        elif "the stopping table ends" not in result.reason:
            least = np.array([part.limit for part in result.parts if part.verdict is not None])
            assert (least >= way.max(axis=0) - 1e-9).all()
    assert compared >= 8


def hurrying(rng, n, limits, end):
    """Instants at steps of `STEP`, positions and velocities of joints within acceleration limits."""
    t = np.arange(0, end + STEP / 2, STEP)
    change = rng.random((len(t), n)) < STEP / 0.03
    a = np.empty((len(t), n))
    now = limits * rng.choice([-1.0, 1.0], n)
    for k in range(len(t)):
        now = np.where(change[k], limits * rng.choice([-1.0, -0.3, 0.0, 1.0], n), now)
        a[k] = now
    qd = rng.normal(size=n) * 0.5 + np.vstack([np.zeros(n), np.cumsum(a[:-1] * STEP, axis=0)])
    q = rng.normal(size=n) + np.vstack([np.zeros(n), np.cumsum((qd[1:] + qd[:-1]) / 2 * STEP, axis=0)])
    return t, q, qd


@pytest.mark.parametrize("seed", range(4))
def test_s_p_of_a_robot_that_is_heard_live_is_no_less_than_its_integral(tmp_path, seed):
    """Of accelerations up to its limits, and of a person whom the twin sees run at up to 4 m/s."""
    rng, end, tick = np.random.default_rng(seed), 0.25, 0.01
    chain, runs = Chain(rng), float(rng.choice([0.0, 4.0, rng.uniform(0, 4)]))
    n = len(chain.slides)
    limits = rng.uniform(2, 25, n)
    _, q, qd = hurrying(rng, n, limits, end)
    text = CELL.format(tick=tick, limits=f"acceleration_limits = {limits.tolist()}\n")
    text += "".join(SAFE.format(name=name, stop=stop, T_R=T_R, V_H=V_H, K=K) for name, stop in STOPS.items())
    station = made(tmp_path, text, {"arm.urdf": chain.urdf})
    engine = Engine(station.model, driven={"arm": 0.2, "op": 0.2}, live=["arm", "op"])
    judge, op = Judge(station.bound), station.model.human("op")
    v, per, compared = chain.speeds(q, qd), round(tick / STEP), 0
    truth = {name: required(v, name, max(V_H, runs)) for name in STOPS}
    along = np.zeros(len(op.joints))
    along[1] = runs
    for k in range(round(end / tick)):
        now, i = k * tick, k * per
        engine.take([heard("arm", now, q[i], qd[i]), heard("op", now, op.home + along * now, along)])
        state = engine.tick() if k else engine.start()
        np.testing.assert_allclose(state.q(station.model.robot("arm")), q[i], atol=1e-9)
        for result in judge(state):
            way = truth[result.name][i : i + 1]
            if len(way) and not result.reason.startswith("S_p may"):
                least = np.array([part.limit for part in result.parts if part.verdict is not None])
                assert (least >= way.max(axis=0) - 1e-9).all(), (result.name, now)
                compared += 1
    assert compared >= 30
