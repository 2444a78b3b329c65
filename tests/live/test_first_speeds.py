"""How fast somebody is whose first positions were just heard, and nobody knows yet how noisy they are."""

from __future__ import annotations

from itertools import count

import numpy as np
import pytest

from made_cell import TWO_R, heard, made, two_r
from seerob.devices.live.differentiation import Differentiator
from seerob.session.run import Judge, bind
from seerob.twin.engine import Engine

PERIOD, SPEED, NOISE = 0.01, 0.5, 1e-3
VELOCITY = '[[safety]]\nkind = "velocity"\nname = "v"\nof = "arm"\nlimit = {}\n'
ENERGY = '[[safety]]\nkind = "kinetic_energy"\nname = "E"\nrobot = "arm"\nlimit = {}\n'


@pytest.fixture(scope="module")
def arms(tmp_path_factory):
    """An arm whose limits it exceeds just so at `SPEED`, and how to let it be heard anew."""
    folder = tmp_path_factory.mktemp("arm")

    def cell(name, v, e):
        text = "engine = { physics = false, gravity = [0, 0, 0] }\n"
        return made(
            folder / name, text + TWO_R + VELOCITY.format(v) + ENERGY.format(e), {"arm.urdf": two_r()}
        )

    def answers(station):
        engine, judge = Engine(station.model, driven={"arm": 0.1}, live={"arm"}), Judge(bind(station.model))
        engine.take([heard("arm", 0.0, (0.0, 0.3), (SPEED, 0.0))])
        return [result.value for result in judge(engine.start())]

    v, e = answers(cell("lax", 99.0, 999.0))
    return cell("just", v * (1 - 1e-9), e * (1 - 1e-9))


def positions(rng):
    """A noisy joint that turns evenly."""
    for k in count():
        q = np.array([SPEED * PERIOD * k, 0.3])
        yield k * PERIOD, tuple((q + rng.normal(0, NOISE, 2)).tolist())


def by_position(t, q, device, slope):
    return heard("arm", t, q)


def by_slope(t, q, device, slope):
    return heard("arm", t, q, slope.add(device, q), qd_error=slope.error())


@pytest.mark.parametrize("said", [by_position, by_slope])
@pytest.mark.parametrize("begins", ["heard for the first time", "heard again", "clock begun again"])
def test_what_exceeds_its_limit_is_hardly_ever_within_by_noise_from_the_first_sample_on(arms, said, begins):
    within = []
    for seed in range(60):
        engine, judge = Engine(arms.model, driven={"arm": 0.1}, live={"arm"}), Judge(bind(arms.model))
        slope, rng = Differentiator(0.05), np.random.default_rng(seed)
        few = seed % 6 if begins != "heard for the first time" else 0
        silent = few + (15 if begins == "heard again" else 0)
        for k, (t, q) in zip(range(silent + 20), positions(rng), strict=False):
            device = t - few * PERIOD if begins == "clock begun again" and k >= few else t + 9
            engine.take([] if few <= k < silent else [said(t, q, device, slope)])
            results = judge(engine.tick() if k else engine.start())
            within += [result.verdict == "within" for result in results if k not in range(few, silent)]
    assert np.mean(within) < 0.005
