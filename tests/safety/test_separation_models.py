"""Speed and separation monitoring with every model of the stop: by hand, there and back, what is unknown."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import basis_in, heard, judged, state_at
from made_separation import (
    BOUND,
    BRAKING,
    HALF,
    KNOWN,
    SIMULATED,
    TABLE,
    K,
    V,
    part,
    separation,
    station,
    terms,
)
from seerob.core.errors import InputError
from seerob.twin.engine import Engine


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
    assert factor > 0
    then = separation(tmp_path / "then", stop, x=x, qd=(factor * (1 - 1e-8), 0.0))
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
        ("acceleration = 0, reaction = 0.1, stopping = 0.05", 0.0, 2.0 * 0.15),
        (
            "acceleration = 0, reaction = 0.1, stopping = 0.05",
            0.35,
            0.5,
        ),  # 0.65 m at 2 m/s, 0.59 m at 1.6 m/s
        (
            "acceleration = 0, reaction = 0.1, stopping = 0.16",
            0.0,
            0.5,
        ),  # 0.52 m at 2 m/s, 0.416 m at 1.6 m/s
        ("acceleration = 0, reaction = 0.1, stopping = 0.3", 0.0, 0.64),
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
    given = next(i for i in basis_in(tmp_path).inputs if i.name == "C")
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
    assert any("reaching over" in text for text in basis_in(tmp_path).not_modelled)


def test_the_floor_of_half_a_metre_is_from_memory(tmp_path):
    separation(tmp_path, BOUND)
    v_h = next(i for i in basis_in(tmp_path).inputs if i.name == "v_h")
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


# -- what cannot be ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stop", "match"),
    [
        ("acceleration = 0, reaction = 0.1", "needs stopping"),
        (
            'acceleration = 0, reaction = 0.1, model = "constant_deceleration"',
            "needs either stopping or deceleration",
        ),
        (f"{HALF}, deceleration = 2.0", "needs either stopping or deceleration"),
        ('acceleration = 0, reaction = 0.1, model = "table"', "needs table"),
        (f"{BOUND}, deceleration = 2.0", "does nothing"),
        (f'{BOUND}, table = "ur5_cb3"', "does nothing"),
        (f'{BOUND}, model = "simulated"', "does nothing"),
        (f'{BOUND}, direction = "toward"', "does nothing"),
        (f"{BOUND}, brakes = [1.0, 1.0]", "does nothing"),
        (
            'acceleration = 0, reaction = 0.1, model = "simulated", brakes = [1.0]',
            "1 torques for the 2 joints",
        ),
        ('acceleration = 0, reaction = 0.1, model = "simulated", brakes = [1.0, -1.0]', "> 0"),
        ('acceleration = 0, reaction = 0.1, model = "table", table = "ur5"', "ur5_cb3"),
        (
            'acceleration = 0, reaction = 0.1, model = "table", table = "ur5_cb3"',
            "has joint 2, arm has 2 joints",
        ),
        (f'{BOUND}, table_for = "arm"', "does nothing"),
        (f'{TABLE}, table_for = "other"', "other does not stop here"),
        ("acceleration = 0, reaction = 0.0, stopping = 0.3", "> 0"),
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
