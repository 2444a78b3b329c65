"""Speed and separation monitoring of a robot whose stop is simulated: by hand, and what is unknown."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import basis_in, results_at, state_at, two_r
from made_separation import ROTOR, SIMULATED, K, V, part, separation, station, terms
from seerob.core.verdict import Verdict
from seerob.criteria.stopping import models as stop_models
from seerob.criteria.stopping.simulated import StopSimulation
from seerob.session.station import load


def test_simulated_stop_of_one_joint_is_the_constant_deceleration(tmp_path):
    """The outer brake holds, so that I = 1 + 4: a = B / I; the corner travels its circle."""
    S = separation(tmp_path, SIMULATED)
    a = 40.0 / 5.0
    assert terms(S)[:3] == pytest.approx([1.6 * (0.1 + 1 / a), 0.1 * V, V / (2 * a)], abs=0.005)
    assert S.limit >= 1.6 * (0.1 + 1 / a) + 0.1 * V + V / (2 * a) + K - 1e-9


def test_rotors_lengthen_the_simulated_stop(tmp_path):
    """The base's rotor weighs as much as the arm's 5 kg·m²: twice the time and way."""
    one = separation(tmp_path / "one", SIMULATED)
    two = separation(tmp_path / "two", SIMULATED, arm="rotor_inertia = [5.0, 0.0]\n")
    assert terms(two)[2] == pytest.approx(2 * terms(one)[2], rel=0.03)
    assert terms(two)[0] - 0.16 == pytest.approx(2 * (terms(one)[0] - 0.16), rel=0.03)


def test_simulated_stop_is_never_more_than_the_bound_with_its_stopping_time(tmp_path):
    simulated = separation(tmp_path / "s", SIMULATED)
    T_s = terms(simulated)[0] / 1.6 - 0.1
    bound = separation(tmp_path / "b", f"acceleration = 0, reaction = 0.1, stopping = {T_s}")
    assert simulated.limit < bound.limit


@pytest.mark.parametrize(("q1", "nearer"), [(-np.pi / 2, True), (np.pi / 2, False)])
def test_toward_counts_what_comes_nearer_and_never_falls_below_standstill(tmp_path, q1, nearer):
    """A quarter turn away from the person, the arm swings toward or away."""
    q = (q1, 0.0)
    path = separation(tmp_path / "p", SIMULATED, q=q, x=8.0)
    toward = separation(tmp_path / "t", SIMULATED + ', direction = "toward"', q=q, x=8.0)
    assert terms(toward)[0] == pytest.approx(terms(path)[0])
    ways = [r_s[1] + r_s[2] for r_s in (terms(path), terms(toward))]
    assert 0 <= terms(toward)[1] <= terms(path)[1] + 1e-12
    assert terms(toward)[2] >= 0
    assert ways[1] <= ways[0] + 1e-12
    if nearer:
        end = separation(tmp_path / "e", SIMULATED, q=(q1 + 0.1 + 0.0625, 0.0), x=8.0, qd=(0.0, 0.0))
        assert path.value - end.value <= ways[1]
        assert ways[1] == pytest.approx(path.value - end.value, abs=0.02)
    else:
        assert ways[1] < 0.15 * ways[0]
        assert ways[1] >= 0


@pytest.mark.parametrize("instants", [2, 3, 16])
def test_toward_misses_nothing_between_the_instants_it_looks_at(tmp_path, monkeypatch, instants):
    """The arm swings past the person: as far at the end as at the start, nearer in between."""
    cell = station(tmp_path, SIMULATED, x=3.5)
    robot = cell.model.robot("arm")
    gap = cell.model.gap(cell.model.select("op"), robot.moving)
    state = state_at(cell, arm=((-0.6, 0.0), (2.5, 0.0)))
    stopped = StopSimulation(cell.model, robot, np.array([15.0, 9.0]), gap.b).stop(state, 0.1)
    assert stopped.q[-1, 0] > 0.3
    rotations, positions = state.rotations.copy(), state.positions.copy()
    seen = []
    for R, x in zip(stopped.rotations, stopped.positions, strict=True):
        rotations[list(gap.b)], positions[list(gap.b)] = R, x
        seen.append(gap.query.per_body(rotations, positions).distance.copy())
    loss = seen[0] - np.min(seen, axis=0)
    assert loss.max() > 0.1
    monkeypatch.setattr(stop_models, "INSTANTS", instants)
    found = stop_models.approach(stopped, state, gap)
    assert (found >= loss - 1e-9).all()
    assert (found <= stopped.ways.sum(axis=0) + 1e-9).all()


@pytest.mark.parametrize("instants", [2, 5, 10**6])
def test_toward_is_the_least_distance_looked_at_and_what_the_ways_between_leave_open(
    tmp_path, monkeypatch, instants
):
    """Between two instants a part comes nearer by no more than half of what its way leaves over."""
    cell = station(tmp_path, SIMULATED, x=3.5)
    robot = cell.model.robot("arm")
    gap = cell.model.gap(cell.model.select("op"), robot.moving)
    state = state_at(cell, arm=((-0.6, 0.0), (2.5, 0.0)))
    stopped = StopSimulation(cell.model, robot, np.array([15.0, 9.0]), gap.b).stop(state, 0.1)
    K = len(stopped.t)
    rows = np.unique(np.linspace(0, K - 1, min(K, instants)).round().astype(int))
    assert len(rows) == min(K, instants) > 1
    rotations, positions, seen = state.rotations.copy(), state.positions.copy(), []
    for row in rows:
        rotations[list(gap.b)], positions[list(gap.b)] = stopped.rotations[row], stopped.positions[row]
        seen.append(gap.query.per_body(rotations, positions).distance.copy())
    wanted = []
    for body, distances in enumerate(np.transpose(seen)):
        least = distances.min()
        for a, b, near, then in zip(rows, rows[1:], distances, distances[1:], strict=False):
            way = stopped.ways[a:b, body].sum()
            least = min(least, (near + then - way) / 2)
        wanted.append(max(distances[0] - least, 0.0))
    monkeypatch.setattr(stop_models, "INSTANTS", instants)
    assert stop_models.approach(stopped, state, gap) == pytest.approx(wanted, abs=1e-9)


def test_what_a_simulated_stop_says_of_itself(tmp_path):
    """Far away the present speeds hold, and faster ones are not searched for: a simulation takes long."""
    path = separation(tmp_path / "p", SIMULATED, x=9.0)
    assert "whole path" in basis_in(tmp_path / "p").formula
    share = part(path, "share of the present speed")
    assert (share.value, share.reason) == (1.0, "or more")
    separation(tmp_path / "t", SIMULATED + ', direction = "toward"', x=9.0)
    assert "loss of distance" in basis_in(tmp_path / "t").formula
    one = two_r().replace('effort="1000.0" ', "", 1)
    for folder, urdf, origin, said in (
        ("a", two_r(effort=50.0), "estimated", "0.8 of the torque limits"),
        ("b", one, "missing", "0.8 of the torque limits"),
    ):
        separation(
            tmp_path / folder, 'acceleration = 0, reaction = 0.1, model = "simulated"', urdf=urdf, x=9.0
        )
        (brakes,) = (i for i in basis_in(tmp_path / folder).inputs if i.name == "brake torques")
        assert (brakes.origin, said in brakes.source) == (origin, True)
        assert "not given" not in brakes.source


def test_simulated_stop_without_rotor_inertia_is_undecided_above_and_exceeded_below(tmp_path):
    far = separation(tmp_path / "far", SIMULATED, arm="", x=9.0)
    assert far.verdict == "undecided"
    assert "rotor inertia" in far.reason
    assert separation(tmp_path / "near", SIMULATED, arm="", x=2.5).verdict == "exceeded"


def test_simulated_stop_without_torque_limits_is_undecided(tmp_path):
    stop = 'acceleration = 0, reaction = 0.1, model = "simulated"'
    S = separation(tmp_path / "u", stop, urdf=two_r().replace('effort="1000.0" ', ""), x=9.0)
    assert S.verdict == "undecided"
    limited = separation(tmp_path / "l", stop, arm=ROTOR + "torque_limits = [50.0, 25.0]\n")
    same = separation(tmp_path / "s", SIMULATED)
    assert limited.limit == same.limit  # 0.8 of the limits


def test_permissible_speed_by_simulation_is_one_that_holds(tmp_path):
    S = separation(tmp_path / "now", SIMULATED, x=3.1)
    factor = part(S, "share of the present speed").value
    assert 0 < factor < 1
    then = separation(tmp_path / "then", SIMULATED, x=3.1, qd=(factor, 0.0))
    beyond = separation(tmp_path / "beyond", SIMULATED, x=3.1, qd=(factor + 1 / 64, 0.0))
    assert (then.verdict, beyond.verdict) == ("within", "exceeded")


MASSES_OFF = ROTOR + "mass_tolerance = 0.25\n"


def test_the_simulated_stop_is_that_of_masses_at_the_ends_of_their_tolerance(tmp_path):
    """The way while braking goes with the masses: T_s = I/B, and S_p is only known between the two."""
    heavy, light, plain = (
        separation(tmp_path / name, SIMULATED, urdf=two_r(masses=(m, m)))
        for name, m in (("heavy", 1.25), ("light", 0.75), ("plain", 1.0))
    )
    S = separation(tmp_path / "off", SIMULATED, arm=MASSES_OFF)
    assert S.limit == pytest.approx(light.limit, abs=1e-6)
    assert part(S, "S_p may be larger by").value == pytest.approx(heavy.limit - light.limit, abs=1e-6)
    assert light.limit < plain.limit < heavy.limit
    # Far enough for the masses as given, and not for those that may be.
    x = 6.0 - S.value + (plain.limit + heavy.limit) / 2
    assert separation(tmp_path / "at", SIMULATED, x=x).verdict is Verdict.WITHIN
    near = separation(tmp_path / "near", SIMULATED, arm=MASSES_OFF, x=x)
    assert near.verdict is Verdict.UNDECIDED
    assert "mass_tolerance of arm ± 25 %" in near.reason


def test_of_centres_and_moments_that_are_off_a_simulated_stop_is_bounded_by_its_energy(tmp_path):
    """No more than the bound, far from it; what is nearer is open, and so is what brakes may not hold."""
    plain = separation(tmp_path / "plain", SIMULATED)
    spread = two_r().replace('<mass value="1.0"', '<mass value="1.0" error="0.1" spread_error="0.2"')
    for name, off, said in (
        ("com", {"arm": ROTOR + "com_tolerance = 0.01\n"}, "com_tolerance of arm ± 10 mm"),
        ("spread", {"urdf": spread}, "masses of links of arm ± 10 %"),
    ):
        found = separation(tmp_path / name, SIMULATED, **off)
        more = part(found, "S_p may be larger by").value
        assert found.limit == plain.limit
        assert found.verdict is Verdict.WITHIN
        heavy = separation(tmp_path / f"{name} heavy", SIMULATED, urdf=two_r(masses=(1.2, 1.2)))
        assert more > heavy.limit - plain.limit > 0 or name == "com"
        x = 6.0 - found.value + plain.limit + more / 2
        near = separation(tmp_path / f"{name} near", SIMULATED, x=x, **off)
        assert near.verdict is Verdict.UNDECIDED
        assert f"if masses are off: {said}" in near.reason
        folder = tmp_path / f"{name} falling"
        station(folder, SIMULATED, **off)
        text = (
            (folder / "workstation.toml").read_text().replace("gravity = [0, 0, 0]", "gravity = [-90, 0, 0]")
        )
        (folder / "workstation.toml").write_text(text)
        slack = results_at(load(folder), arm=((0.0, 0.0), (0.01, 0.0)))["S"]
        assert slack.verdict is Verdict.UNDECIDED
        assert f"{said} not followed" in slack.reason


@pytest.mark.parametrize("direction", ["path", "toward"])
def test_whatever_a_tool_weighs_within_its_bounds_its_stop_is_no_longer_than_is_told(tmp_path, direction):
    """Centres and moments anywhere within what is told, at random postures and speeds, with gravity."""
    rng = np.random.default_rng(7)
    stop = SIMULATED.replace("[40.0, 20.0]", "[400.0, 200.0]") + f', direction = "{direction}"'
    tool = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = {{ box = [0.1, 0.2, 0.3] }}\nmass = {}\n'
    for k in range(8):
        q, qd = rng.uniform(-3, 3, 2), rng.uniform(-3, 3, 2)
        off = ROTOR + tool.format(2.0) + "mass_tolerance = 0.2\ncom_tolerance = 0.05\n"
        told = separation(tmp_path / f"a{k}", stop, q=q, qd=qd, arm=off, x=9.0)
        most = told.limit + part(told, "S_p may be larger by").value
        for i in range(3):
            way = rng.normal(size=3)
            com = (0.05 * way / np.linalg.norm(way)).tolist()
            inertia = (np.array([0.2**2 + 0.3**2, 0.1**2 + 0.3**2, 0.1**2 + 0.2**2]) * 2.4 / 12).tolist()
            real = tool.format(2.4) + f"com = {com}\ninertia = {[*inertia, 0, 0, 0]}\n"
            true = separation(tmp_path / f"b{k}{i}", stop, q=q, qd=qd, arm=ROTOR + real, x=9.0)
            assert true.limit <= most
