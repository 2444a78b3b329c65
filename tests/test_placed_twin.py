"""Without physics the twin is where the samples say, and says of it what the pulled one says."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import AMPLITUDE, Q0, UR10, heard, made
from seerob.session.run import Judge
from seerob.session.scene import scene_of
from seerob.twin.engine import Engine

MORE = """
[[parts]]
name = "wall"
shape = { box = [0.1, 2, 2] }
at = { position = [1.2, 0, 1] }
[[safety]]
kind = "velocity"
of = "arm"
[[safety]]
kind = "kinetic_energy"
robot = "arm"
[[safety]]
kind = "effective_mass"
at = "arm"
[[safety]]
kind = "manipulability"
at = "arm"
[[safety]]
kind = "minimum_distance"
between = ["arm", "wall"]
"""


def motion(t):
    """Analytic: position and velocity."""
    return Q0 + 0.3 * AMPLITUDE * np.sin(2 * t), 0.6 * AMPLITUDE * np.cos(2 * t)


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    found = {}
    for physics in ("true", "false"):
        folder = tmp_path_factory.mktemp(physics)
        found[physics] = made(folder, f"engine = {{ physics = {physics} }}\n" + UR10 + MORE)
    return found


def run(station, ticks=60):
    engine = Engine(station.model, driven={"arm": 1.0})
    judge = Judge(station.bound)
    engine.take([heard("arm", 0.01 * k, *motion(0.01 * k)) for k in range(ticks + 2)])
    engine.start()
    for _ in range(ticks):
        state = engine.tick()
        yield state, judge(state)


def test_it_is_where_the_samples_say(cells):
    robot = cells["false"].model.robot("arm")
    for state, _ in run(cells["false"]):
        q, qd = motion(state.t)
        np.testing.assert_allclose(state.q(robot), q, atol=1e-13)
        np.testing.assert_allclose(state.qd(robot), qd, atol=1e-12)


def test_a_pulled_twin_says_the_same(cells):
    """The pull is off by less than 0.1 mm, and 1 mm/s."""
    pairs = list(zip(run(cells["true"]), run(cells["false"]), strict=True))
    for (_, pulled), (_, placed) in pairs[20:]:
        for one, other in zip(pulled, placed, strict=True):
            assert other.value == pytest.approx(one.value, rel=5e-3, abs=2e-4), one.name
            assert other.verdict == one.verdict


def test_the_results_of_one_state_do_not_depend_on_how_it_was_reached(cells):
    """Bit for bit: a pulled twin that is put into the placed one's state says the same."""
    pulled = Engine(cells["true"].model, driven={"arm": 1.0}, controllers=False)
    judge = Judge(cells["true"].bound)
    robot = cells["true"].model.robot("arm")
    for state, placed in run(cells["false"], ticks=5):
        pulled.state.data.qpos[robot.q_address] = state.q(robot)
        pulled.state.data.qvel[robot.v_address] = state.qd(robot)
        pulled.state.refresh(state.t)
        again = judge(pulled.state)
        assert [(r.value, r.markers) for r in again] == [(r.value, r.markers) for r in placed]


def test_a_run_without_physics_says_so(cells):
    def notes(station):
        return [
            f.text for f in scene_of(station.model, station.bound, files={}).findings if f.subject == "engine"
        ]

    assert notes(cells["true"]) == []
    assert len(notes(cells["false"])) == 1
