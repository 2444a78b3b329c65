"""S_p of random robots on random motions is no less than its integrals, at ticks and all the way between."""

from __future__ import annotations

import numpy as np
import pytest
from s_p_oracle import DECELERATION, STEP, T_R, T_S, V_H, Chain, K, cubic, knots, required

from made_cell import made
from seerob.session.run import Judge, engine_of, looks_ahead, pump, ticks

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
CELL = """
[engine]
gravity = [0, 0, 0]
physics = false
tick = {tick}
timestep = 0.001
[[robots]]
name = "arm"
model = "arm.urdf"
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
at = {{ position = [8, 0, 0] }}
[[sources]]
kind = "csv"
robot = "arm"
file = "arm.csv"
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
    text = CELL.format(tick=tick)
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
