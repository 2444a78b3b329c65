"""The bound on simulated stops between two ticks: no stop of random arms is longer, and it decides."""

from __future__ import annotations

import numpy as np
import pytest
from s_p_oracle import Chain

from made_cell import TWO_R, made, person, state_at, two_r
from seerob.core.snapshot import Verdict
from seerob.criteria.stopping.models import Stop, bind_stop
from seerob.twin.spans import Path, Points
from worst_between import worst_found

FLOOR = '[[parts]]\nname = "wall"\nshape = { box = [0.1, 1, 1] }\nat = { position = [9, 0, 0] }\n'


@pytest.mark.parametrize("seed", [*range(6), 7, 10, 12])
def test_no_simulated_stop_within_a_span_is_longer_than_its_bound(tmp_path, seed):
    rng = np.random.default_rng(seed)
    chain = Chain(rng, turning=seed < 6)
    assert chain.slides.any() == (seed >= 6)
    n = len(chain.slides)
    base = f"base = {{ rpy = [{rng.normal() * (seed % 2)}, 0, 0] }}\n"
    text = '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n' + base + "rotor_inertia = "
    cell = made(tmp_path, f"{text}{[0.02] * n}\n{FLOOR}", {"arm.urdf": chain.urdf})
    robot = cell.model.robot("arm")
    gap = cell.model.gap(cell.model.select("wall"), robot.moving)
    brakes = tuple((rng.uniform(200, 500, n) * (5 if chain.slides.any() else 1)).tolist())
    stop = bind_stop(
        Stop(acceleration=0.0, reaction=0.1, model="simulated", brakes=brakes), cell.model, robot, gap
    )
    points, T = Points(cell.model), 0.01
    at_most = stop.in_span(points)
    shares = []
    for _ in range(25):
        q = rng.normal(size=n) * np.where(chain.slides, 0.3, 2.0)
        qd = rng.normal(size=n) * 10 ** rng.uniform(-1.5, 0.5)
        path = Path(np.array([0, T]), np.array([q, q + T * qd]), np.array([qd, qd]))
        ids = np.array([body.mj for body in cell.model.bodies], np.int64)
        bound = at_most(points.span(path, 0.0, T, ids, cell.model.mj))
        met = stop.courses(state_at(cell, arm=(q + rng.uniform(0, T) * qd, qd)))(1.0)
        assert not met.unbounded_reason
        assert met.T_s <= bound.T_s
        assert (met.S_r <= bound.S_r + 1e-9).all()
        assert (met.S_s <= bound.S_s + 1e-9).all()
        shares.append(met.T_s / bound.T_s)
    assert max(shares) > 0.02  # it is of the stops' own size


ENGINE = "engine = { physics = false, gravity = [0, 0, 0] }\n"
SAFE = (
    '[[safety]]\nkind = "separation"\nname = "s"\nbetween = ["arm", "op"]\nintrusion = 0\n'
    'human_uncertainty = 0\nrobot_uncertainty = 0\nstop = { reaction = 0.05, model = "simulated", '
    "brakes = [60.0, 40.0]STATED }\n"
)


def swinging(folder, at, stated="", more=""):
    """An arm that swings from rest to rest."""
    t = np.arange(0, 0.4 + 1e-9, 0.004)
    q, qd = 0.2 * (1 - np.cos(5 * np.pi * t)), np.pi * np.sin(5 * np.pi * t)
    lines = ["t [s],j1 [rad],j2 [rad],qd_j1 [rad/s],qd_j2 [rad/s]"]
    lines += [f"{a:.4f},{b:.12g},{b:.12g},{c:.12g},{c:.12g}" for a, b, c in zip(t, q, qd, strict=True)]
    text = ENGINE + TWO_R + "rotor_inertia = [0.1, 0.1]\n" + person("op", at, 0, 0)
    text += '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n' + SAFE.replace("STATED", stated)
    return made(folder, text + more, {"arm.urdf": two_r(), "m.csv": "\n".join(lines) + "\n"})


CONFIRMED = '[[confirmed]]\nkey = "safety[0].stop.acceleration"\nof = "s"\nvalue = 0\nwhy = "monitored"\n'


@pytest.mark.parametrize(("stated", "more"), [("", ""), (", acceleration = 0", CONFIRMED)])
def test_separation_by_a_simulated_stop_is_decided_between_ticks(tmp_path, stated, more):
    far = swinging(tmp_path / "far", 9.0, stated, more)
    room = worst_found(far, looks=3)["s"]
    assert min(room) >= -1e-9
    assert np.isfinite(room).all()
    assert far.run().results["s"].verdict is Verdict.WITHIN
    # Nearer than the bound, though farther than any stop takes it: nobody knows of the time between.
    near = swinging(tmp_path / "near", 4.99, stated, more).run().results["s"]
    assert near.verdict is Verdict.UNDECIDED
    assert (near.values > near.limits).all()
    accepted = swinging(tmp_path / "accepted", 4.99, stated, 'between_samples = "accepted: slow"\n' + more)
    assert accepted.run().results["s"].verdict is Verdict.WITHIN
