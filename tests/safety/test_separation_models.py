"""Speed and separation monitoring with every model of the stop: by hand, there and back, what is unknown."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, UR10, heard, judged, made, results_at, state_at, two_r
from seerob.engine import Engine
from seerob.errors import InputError
from seerob.stopping import models as stop_models
from seerob.stopping.simulated import StopSimulation

PERSON = (
    '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\nat = {{ position = [{x}, 0, -1] }}\n'
)
KNOWN = "intrusion = 0.2\nhuman_uncertainty = 0.1\nrobot_uncertainty = 0.05\n"
K = 0.35
BOUND = "reaction = 0.1, stopping = 0.3"
HALF = f'{BOUND}, model = "constant_deceleration"'
BRAKING = 'reaction = 0.1, deceleration = 2.0, model = "constant_deceleration"'
SIMULATED = 'reaction = 0.1, model = "simulated", brakes = [40.0, 20.0]'
ROTOR = "rotor_inertia = [0.0, 0.0]\n"
JOINT = "{{ joint = {j}, full_speed = 3.0, way = [[[{way}]]], time = [[[{time}]]] }}"
HEAD = 'robot = "arm", category = 0, source = "s", confidence = "1S"'
TABLE = (
    f'reaction = 0.1, model = "table", table = {{ {HEAD}, rated_payload = 5.0, joints = ['
    + JOINT.format(j=0, way=0.4, time=0.3)
    + ", "
    + JOINT.format(j=1, way=0.2, time=0.1)
    + "] }"
)


def station(folder, stop, options=KNOWN, *, x=6.0, arm=ROTOR, more="", urdf=None):
    text = FLOATING + TWO_R + arm + more + PERSON.format(x=x)
    text += f'[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\nstop = {{ {stop} }}\n'
    return made(folder, text + options, {"arm.urdf": urdf or two_r()})


def separation(folder, stop, options=KNOWN, *, q=(0.0, 0.0), qd=(1.0, 0.0), **more):
    return results_at(station(folder, stop, options, **more), arm=(q, qd))["S"]


def part(result, name):
    return next(p for p in result.parts if p.name == name)


def terms(result):
    return [part(result, name).value for name in ("S_h", "S_r", "S_s", "C", "Z_d", "Z_r")]


V = np.hypot(2, 0.05)
"""Speed of the arm's fastest corner at 1 rad/s."""


@pytest.mark.parametrize(
    ("stop", "T_s", "S_s"), [(BOUND, 0.3, V * 0.3), (HALF, 0.3, V * 0.15), (BRAKING, V / 2, V**2 / 4)]
)
def test_terms_of_the_fastest_part(tmp_path, stop, T_s, S_s):
    S = separation(tmp_path, stop)
    assert S.reason.startswith("arm/l2")
    assert terms(S) == pytest.approx([1.6 * (0.1 + T_s), V * 0.1, S_s, 0.2, 0.1, 0.05])
    assert S.limit == pytest.approx(sum(terms(S)))


def test_parts_that_stop_with_the_fastest_take_as_long(tmp_path):
    S = separation(tmp_path, BRAKING)
    slow, T_s = np.hypot(1, 0.05), V / 2
    assert part(S, "arm/l1").limit == pytest.approx(1.6 * (0.1 + T_s) + slow * 0.1 + slow * T_s / 2 + K)


@pytest.mark.parametrize("stop", [BOUND, HALF, BRAKING, TABLE])
@pytest.mark.parametrize("x", [3.3, 4.2, 5.0])
def test_largest_permissible_speed_makes_the_distance_the_separation_distance(tmp_path, stop, x):
    if (stop, x) == (TABLE, 5.0):
        x = 4.0  # So that the table's own end does not decide.
    S = separation(tmp_path / "now", stop, x=x)
    factor = part(S, "share of the present speed").value
    speed = part(S, "largest permissible speed").value
    assert speed == pytest.approx(factor * V)
    if factor == 0:
        still = separation(tmp_path / "still", stop, x=x, qd=(1e-5, 0))
        assert still.verdict == "exceeded"
        return
    then = separation(tmp_path / "then", stop, x=x, qd=(factor * (1 - 1e-9), 0.0))
    assert then.verdict == "within"
    assert then.value - then.limit == pytest.approx(0, abs=2e-3 if stop == TABLE else 1e-6)
    assert (factor >= 1) == (S.verdict == "within")


def test_closed_form_of_the_permissible_speed(tmp_path):
    """√(b² + 2a(d − K − v_h T_r)) − b for the fastest part."""
    S = separation(tmp_path, BRAKING, x=4.5)
    b = 2.0 * 0.1 + 1.6
    wanted = np.sqrt(b**2 + 4 * (S.value - K - 0.16)) - b
    assert part(S, "largest permissible speed").value == pytest.approx(wanted)


@pytest.mark.parametrize("stop", [BOUND, BRAKING])
def test_robot_at_rest_has_a_permissible_speed_but_no_share(tmp_path, stop):
    S = separation(tmp_path, stop, qd=(0.0, 0.0), x=5.0)
    assert part(S, "share of the present speed").value is None
    T_s = 0.3 if stop == BOUND else 0.0
    assert terms(S)[0] == pytest.approx(1.6 * (0.1 + T_s))
    b = 2.0 * 0.1 + 1.6
    wanted = (S.value - K - 0.64) / 0.4 if stop == BOUND else np.sqrt(b**2 + 4 * (S.value - K - 0.16)) - b
    assert part(S, "largest permissible speed").value == pytest.approx(wanted)


# -- approach speed and intrusion ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("stop", "K", "S_p"),
    [
        ("reaction = 0.1, stopping = 0.05", 0.0, 2.0 * 0.15),
        ("reaction = 0.1, stopping = 0.05", 0.35, 0.5),  # 0.65 m at 2 m/s, 0.59 m at 1.6 m/s
        ("reaction = 0.1, stopping = 0.16", 0.0, 0.5),  # 0.52 m at 2 m/s, 0.416 m at 1.6 m/s
        ("reaction = 0.1, stopping = 0.3", 0.0, 0.64),
    ],
)
def test_approach_speed_is_switched_at_half_a_metre(tmp_path, stop, K, S_p):
    options = f"intrusion = {K}\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n"
    S = separation(tmp_path, stop, options, qd=(0.0, 0.0))
    wanted = max(S_p, 1.6 * 0.15 + K) if K else S_p
    assert S.limit == pytest.approx(wanted)
    assert S.limit == pytest.approx(sum(terms(S)))


def test_given_speed_of_the_person_is_taken_as_it_is(tmp_path):
    S = separation(tmp_path, BOUND, KNOWN + "human_speed = 0.5\n")
    assert S.limit == pytest.approx((V + 0.5) * 0.4 + K)


@pytest.mark.parametrize(
    ("detection", "C"),
    [
        ('edition = "2010", capability = 0.07, height = 0.3, reach_under = 0', 1.08),
        ('edition = "2024", capability = 0.07, height = 0.3, supplement = 0.1, reach_under = 0', 1.3),
        ('edition = "2010", approach = "orthogonal", capability = 0.03, reach_over = 0', 0.128),
        ('edition = "2010", approach = "orthogonal", capability = 0.03, reach_over = 0.9', 0.9),
        ('edition = "2010", capability = 0.05, height = 0.1', 1.16),
        ('edition = "2010", reach_under = 0', 1.2),
    ],
)
def test_intrusion_by_iso_13855(tmp_path, detection, C):
    S = separation(tmp_path, BOUND, KNOWN.replace("intrusion = 0.2", f"detection = {{ {detection} }}"))
    assert part(S, "C").value == pytest.approx(C)
    assert S.limit == pytest.approx((V + 1.6) * 0.4 + C + 0.15)
    given = next(i for i in S.basis.inputs if i.name == "C")
    assert "ISO 13855" in given.source
    assert given.origin == "stated"


@pytest.mark.parametrize(
    "detection",
    [
        "capability = 0.07, height = 0.3, reach_under = 0",
        'approach = "orthogonal", capability = 0.08, edition = "2010", reach_over = 0',
        'approach = "orthogonal", capability = 0.03, edition = "2010"',
        'capability = 0.07, height = 0.3, edition = "2010"',
        'capability = 0.07, edition = "2010", reach_under = 0',
    ],
)
def test_intrusion_that_is_not_settled_is_undecided(tmp_path, detection):
    options = KNOWN.replace("intrusion = 0.2", f"detection = {{ {detection} }}")
    S = separation(tmp_path / "far", BOUND, options, x=9.0)
    assert S.verdict == "undecided"
    assert separation(tmp_path / "near", BOUND, options, x=3.0).verdict == "exceeded"


def test_what_the_field_does_not_cover_is_named(tmp_path):
    across = KNOWN.replace("intrusion = 0.2", 'detection = { approach = "orthogonal", edition = "2010" }')
    S = separation(tmp_path, BOUND, across, x=9.0)
    assert "detection.reach_over (reaching over the field" in S.reason
    assert any("reaching over" in text for text in S.basis.not_modelled)


def test_the_floor_of_half_a_metre_is_from_memory(tmp_path):
    v_h = next(i for i in separation(tmp_path, BOUND).basis.inputs if i.name == "v_h")
    assert "not below 0.5 m is from memory (M)" in v_h.source


def test_marker_never_shows_an_exceeded_distance_as_equal(tmp_path):
    S = separation(tmp_path / "a", BOUND, qd=(0.0, 0.0))
    K_more = S.value - S.limit + 1e-6
    near = separation(tmp_path / "b", BOUND, KNOWN.replace("0.2", repr(0.2 + K_more)), qd=(0.0, 0.0))
    assert near.verdict == "exceeded"
    value, _, limit = near.markers[0].label.replace(" m", "").partition(", S_p ")
    assert float(value) < float(limit)


# -- fixed -------------------------------------------------------------------------------------


def test_fixed_mode_keeps_the_largest_of_a_run_and_starts_anew_with_the_next(tmp_path):
    cell = station(tmp_path, BOUND, KNOWN + 'mode = "fixed"\n')

    def limits(*speeds):
        engine = Engine(cell.model, controllers=False)
        found = []
        for k, speed in enumerate(speeds):
            t = 0.01 * k
            engine.take([heard("arm", t, (0.0, 0.0), (speed, 0.0))])
            state = engine.start() if k == 0 else engine.tick()
            state.data.qpos[:2], state.data.qvel[:2] = 0.0, (speed, 0.0)
            state.refresh(t)
            found.append(judged(cell.bound, state)[0].limit)
        return found

    bound = [(s * V + 1.6) * 0.4 + K for s in (0.5, 1.0, 0.2)]
    assert limits(0.5, 1.0, 0.2) == pytest.approx([bound[0], bound[1], bound[1]])
    assert limits(0.2) == pytest.approx([bound[2]])


# -- tables ------------------------------------------------------------------------------------


def test_table_by_hand_with_levers(tmp_path):
    """Only the base turns: 0.1 rad while reacting and the table's 0.4 rad, but at most 1 rad/s · 0.3 s."""
    S = separation(tmp_path, TABLE)
    S_s = 0.4 * V - 0.1 * V
    assert terms(S)[:3] == pytest.approx([1.6 * 0.4, 0.1 * V, S_s])
    assert any("the lesser of its first way and speed times time" in t for t in S.basis.not_modelled)


def test_table_at_full_speed(tmp_path):
    """At 3 rad/s the tabulated 0.4 rad is less than 3 · 0.3."""
    S = separation(tmp_path, TABLE, qd=(3.0, 0.0), x=9.0)
    assert terms(S)[:3] == pytest.approx([1.6 * 0.4, 0.3 * V, 0.4 * V])


def test_table_bounds_both_joints_and_the_longer_time_counts(tmp_path):
    S = separation(tmp_path, TABLE, qd=(1.0, -2.0), x=9.0)
    outer = (0.2 + 0.2) * np.hypot(1, 0.05)
    total = outer + 0.4 * (V + outer)
    assert terms(S)[0] == pytest.approx(1.6 * 0.4)
    assert terms(S)[1] + terms(S)[2] == pytest.approx(total)


def test_table_is_undecided_above_its_speed_or_payload_and_without_a_mass(tmp_path):
    fast = separation(tmp_path / "v", TABLE, qd=(3.1, 0.0), x=20.0)
    assert fast.verdict == "undecided"
    assert "speed is 1.03" in fast.reason
    tool = '[[tools]]\nname = "t"\non = "arm/tip"\nshape = { box = [0.1, 0.1, 0.1] }\n'
    heavy = separation(tmp_path / "m", TABLE, more=tool + "mass = 5.1\n", x=20.0)
    assert "payload is 1.02" in heavy.reason
    unknown = separation(tmp_path / "u", TABLE, more=tool, x=20.0)
    assert unknown.verdict == "undecided"
    assert "mass" in unknown.reason
    light = separation(tmp_path / "l", TABLE, more=tool + "mass = 4.9\n", x=20.0)
    assert light.verdict == "within"


def test_joint_without_a_table_needs_a_stopping_time(tmp_path):
    one = TABLE.replace(", " + JOINT.format(j=1, way=0.2, time=0.1), "")
    unknown = separation(tmp_path / "u", one, qd=(1.0, 1.0), x=20.0)
    assert unknown.verdict == "undecided"
    assert "j2" in unknown.reason
    given = separation(tmp_path / "g", one + ", stopping = 0.5", qd=(0.0, 1.0), x=20.0)
    arm = np.hypot(1, 0.05)
    assert terms(given)[:3] == pytest.approx([1.6 * 0.6, 0.1 * arm, 0.5 * arm])


UR10_TABLE = 'reaction = 0.1, model = "table", table = "ur10_cb3"'


def test_table_by_tool_speed_is_undecided_above_its_payload_and_without_a_mass(tmp_path):
    tool = '[[tools]]\nname = "t"\non = "arm/tip"\nshape = { box = [0.1, 0.1, 0.1] }\n'
    stop = UR10_TABLE + ', table_for = "arm"'
    heavy = separation(tmp_path / "h", stop, more=tool + "mass = 15\n", x=20.0)
    assert (heavy.verdict, "payload is 1.5" in heavy.reason) == ("undecided", True)
    unknown = separation(tmp_path / "u", stop, more=tool, x=20.0)
    assert (unknown.verdict, "mass" in unknown.reason) == ("undecided", True)
    light = separation(tmp_path / "l", stop, more=tool + "mass = 9.9\n", x=20.0)
    assert light.verdict == "within"
    inputs = {i.name: i.value for i in light.basis.inputs}
    assert inputs["payload of arm"] == pytest.approx(9.9)
    assert inputs["rated payload of the stopping table"] == 10.0


@pytest.mark.parametrize("stop", [UR10_TABLE, TABLE.replace('robot = "arm"', 'robot = "another"')])
def test_table_of_another_robot_keeps_nothing_within_unless_the_file_says_so(tmp_path, stop):
    far = separation(tmp_path / "far", stop, x=20.0)
    assert (far.verdict, "stop.table_for" in far.reason) == ("undecided", True)
    assert separation(tmp_path / "near", stop, x=3.0).verdict == "exceeded"
    said = separation(tmp_path / "said", stop + ', table_for = "arm"', x=20.0)
    assert said.verdict == "within"
    assert any((i.name, i.origin) == ("stopping table is of", "given") for i in said.basis.inputs)


def test_table_of_the_librarys_robot_is_known_to_be_its_own(tmp_path):
    q = ([0.0, -1.2, 1.4, -1.5, -1.5, 0.0], [0.3, 0, 0, 0, 0, 0])
    for model, verdict in (("ur10", "within"), ("ur10e", "undecided")):
        text = UR10.replace("library:ur10", f"library:{model}") + PERSON.format(x=15.0)
        text += f'[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\n{KNOWN}'
        cell = made(tmp_path / model, text + f"stop = {{ {UR10_TABLE} }}\n")
        assert results_at(cell, arm=q)["S"].verdict == verdict


def test_table_without_a_payload_gives_its_printed_figures_once_the_file_says_which(tmp_path):
    """First axis of the shipped KUKA table: 30.47° in 0.38 s at full speed, here that of the UR10's base."""
    full = np.radians(120)
    q = ([0.0, -1.2, 1.4, -1.5, -1.5, 0.0], [full, 0, 0, 0, 0, 0])
    found = {}
    for key in ("", ", rated_payload = 20.0"):
        stop = f'reaction = 0.1, model = "table", table = "kuka_kr20_r3100", table_for = "arm"{key}'
        text = UR10 + PERSON.format(x=15.0)
        text += f'[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\n{KNOWN}'
        found[key] = results_at(made(tmp_path / str(len(key)), text + f"stop = {{ {stop} }}\n"), arm=q)["S"]
    assert found[""].verdict == "undecided"
    assert "give stop.rated_payload" in found[""].reason
    S = found[", rated_payload = 20.0"]
    S_h, S_r, S_s = terms(S)[:3]
    assert S_h == pytest.approx(1.6 * (0.1 + 0.38))
    # Its lever is bounded by the corners of the link's box, its speed found at its vertices.
    assert S_s >= S_r * np.radians(30.47) / (full * 0.1) - 1e-4
    assert S_s == pytest.approx(S_r * np.radians(30.47) / (full * 0.1), rel=0.1)
    assert any((i.value, i.origin) == (20.0, "given") for i in S.basis.inputs if "rated payload" in i.name)


def test_payload_of_a_table_that_says_its_own_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"5 kg.*leave it out"):
        separation(tmp_path, TABLE + ", rated_payload = 6.0")


def test_table_by_tool_speed(tmp_path):
    S = separation(tmp_path, UR10_TABLE, x=9.0)
    T_s = 0.55 + 0.1 * (V - 2)
    assert terms(S)[:3] == pytest.approx([1.6 * (0.1 + T_s), 0.1 * V, T_s * V])


# -- simulated ---------------------------------------------------------------------------------


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
    bound = separation(tmp_path / "b", f"reaction = 0.1, stopping = {T_s}")
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
    for part, distances in enumerate(np.transpose(seen)):
        least = distances.min()
        for a, b, near, then in zip(rows, rows[1:], distances, distances[1:], strict=False):
            way = stopped.ways[a:b, part].sum()
            least = min(least, (near + then - way) / 2)
        wanted.append(max(distances[0] - least, 0.0))
    monkeypatch.setattr(stop_models, "INSTANTS", instants)
    assert stop_models.approach(stopped, state, gap) == pytest.approx(wanted, abs=1e-9)


def test_what_a_simulated_stop_says_of_itself(tmp_path):
    """Far away the present speeds hold, and faster ones are not searched for: a simulation takes long."""
    path = separation(tmp_path / "p", SIMULATED, x=9.0)
    assert "whole path" in path.basis.formula
    share = part(path, "share of the present speed")
    assert (share.value, share.reason) == (1.0, "or more")
    toward = separation(tmp_path / "t", SIMULATED + ', direction = "toward"', x=9.0)
    assert "loss of distance" in toward.basis.formula
    one = two_r().replace('effort="1000.0" ', "", 1)
    for folder, urdf, origin, said in (
        ("a", two_r(effort=50.0), "estimated", "0.8 of the torque limits"),
        ("b", one, "missing", "0.8 of the torque limits"),
    ):
        S = separation(tmp_path / folder, 'reaction = 0.1, model = "simulated"', urdf=urdf, x=9.0)
        (brakes,) = (i for i in S.basis.inputs if i.name == "brake torques")
        assert (brakes.origin, said in brakes.source) == (origin, True)
        assert "not given" not in brakes.source


def test_simulated_stop_without_rotor_inertia_is_undecided_above_and_exceeded_below(tmp_path):
    far = separation(tmp_path / "far", SIMULATED, arm="", x=9.0)
    assert far.verdict == "undecided"
    assert "rotor inertia" in far.reason
    assert separation(tmp_path / "near", SIMULATED, arm="", x=2.5).verdict == "exceeded"


def test_simulated_stop_without_torque_limits_is_undecided(tmp_path):
    stop = 'reaction = 0.1, model = "simulated"'
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


# -- what cannot be ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stop", "match"),
    [
        ("reaction = 0.1", "needs stopping"),
        ('reaction = 0.1, model = "constant_deceleration"', "needs either stopping or deceleration"),
        (f"{HALF}, deceleration = 2.0", "needs either stopping or deceleration"),
        ('reaction = 0.1, model = "table"', "needs table"),
        (f"{BOUND}, deceleration = 2.0", "does nothing"),
        (f'{BOUND}, table = "ur5_cb3"', "does nothing"),
        (f'{BOUND}, model = "simulated"', "does nothing"),
        (f'{BOUND}, direction = "toward"', "does nothing"),
        (f"{BOUND}, brakes = [1.0, 1.0]", "does nothing"),
        ('reaction = 0.1, model = "simulated", brakes = [1.0]', "1 torques for the 2 joints"),
        ('reaction = 0.1, model = "simulated", brakes = [1.0, -1.0]', "> 0"),
        ('reaction = 0.1, model = "table", table = "ur5"', "ur5_cb3"),
        ('reaction = 0.1, model = "table", table = "ur5_cb3"', "has joint 2, arm has 2 joints"),
        (f'{BOUND}, table_for = "arm"', "does nothing"),
        (f'{TABLE}, table_for = "other"', "other does not stop here"),
        ("reaction = 0.0, stopping = 0.3", "> 0"),
    ],
)
def test_options_that_cannot_be(tmp_path, stop, match):
    with pytest.raises(InputError, match=match):
        _ = station(tmp_path, stop).bound


def test_either_intrusion_or_detection(tmp_path):
    with pytest.raises(InputError, match="either intrusion or detection"):
        station(tmp_path, BOUND, KNOWN + "detection = { }\n")


def test_each_tick_leaves_the_state_as_it_was(tmp_path):
    cell = station(tmp_path, SIMULATED + ', direction = "toward"', x=3.5)
    state = state_at(cell, arm=((0.2, 0.3), (1.0, -1.0)))
    assert judged(cell.bound, state) == judged(cell.bound, state)
