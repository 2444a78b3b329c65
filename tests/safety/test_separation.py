"""Protective separation distance: published vectors, monotony, what is missing, what recedes."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, basis_in, made, results_at, two_r
from seerob.core.errors import InputError
from seerob.criteria.safety.separation import separation_bound

PERSON = """[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
at = {{ position = [{x}, 0, -1] }}
"""
FULL = "intrusion = 0.2\nhuman_uncertainty = 0.1\nrobot_uncertainty = 0.05\n"


@pytest.mark.parametrize(("v_r", "S_p"), [(1.0, 1.39), (0.0, 0.99), (-5.0, 0.99)])
def test_published_values(v_r, S_p):
    """1.24 m with half the stopping path, 1.39 m as the upper bound; a receding part counts as at rest."""
    assert separation_bound(np.array(v_r), 1.6, 0.1, 0.3, 0.35) == pytest.approx(S_p, abs=1e-12)


def test_grows_with_every_input():
    rng = np.random.default_rng(0)
    for _ in range(200):
        x = rng.uniform(0.01, 2, 5)
        base = separation_bound(*x)
        for i in range(5):
            more = x.copy()
            more[i] += 0.01
            assert separation_bound(*more) > base


def test_sensitivities():
    x, h = np.array([1.0, 1.6, 0.1, 0.3, 0.35]), 1e-6
    slope = [(separation_bound(*(x + h * e)) - separation_bound(*(x - h * e))) / (2 * h) for e in np.eye(5)]
    assert slope == pytest.approx([0.4, 0.4, 2.6, 2.6, 1.0], abs=1e-6)


def test_v_r_zero_keeps_the_whole_way_of_the_person():
    assert separation_bound(np.array(0.0), 1.6, 0.1, 0.3, 0.0) == pytest.approx(1.6 * 0.4)


def separation(folder, *, x=6.0, options=FULL, qd=(1.0, 0.0), between='["arm", "op"]', urdf=None):
    text = (
        FLOATING
        + TWO_R
        + PERSON.format(x=x)
        + f'[[safety]]\nkind = "separation"\nname = "S"\nbetween = {between}\n'
        + f"stop = {{ acceleration = 0, reaction = 0.1, stopping = 0.3 }}\n{options}"
        + '[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["arm", "op"]\n'
        + '[[safety]]\nkind = "velocity"\nname = "v"\nof = "arm"\n'
    )
    station = made(folder, text, {"arm.urdf": urdf or two_r()})
    results = results_at(station, arm=((0.0, 0.0), qd))
    return results["S"], results["d"], results["v"]


@pytest.mark.parametrize("between", ['["arm", "op"]', '["op", "arm"]'])
def test_limit_is_the_bound_at_the_speed_of_the_fastest_point_and_the_value_the_distance(tmp_path, between):
    S, d, v = separation(tmp_path, between=between)
    assert S.value == d.value
    assert v.value == pytest.approx(np.hypot(2, 0.05))
    assert S.limit == pytest.approx((v.value + 1.6) * 0.4 + 0.35)
    assert S.verdict == "within"
    bodies = [part for part in S.parts if part.limit is not None]
    assert [part.name for part in bodies] == ["arm/l1", "arm/l2"]
    for part, speed in zip(bodies, (np.hypot(1, 0.05), np.hypot(2, 0.05)), strict=True):
        assert part.limit == pytest.approx((speed + 1.6) * 0.4 + 0.35)


def test_verdict_turns_where_the_distance_falls_below(tmp_path):
    S, d, _ = separation(tmp_path / "far")
    slack = d.value - S.limit
    near, _, _ = separation(tmp_path / "near", x=6.0 - slack - 1e-6)
    beyond, _, _ = separation(tmp_path / "beyond", x=6.0 - slack + 1e-6)
    assert (near.verdict, beyond.verdict) == ("exceeded", "within")


@pytest.mark.parametrize("direction", [1, -1])
def test_speed_counts_in_every_direction(tmp_path, direction):
    S, _, _ = separation(tmp_path, qd=(direction, 0.0))
    assert S.limit == pytest.approx((np.hypot(2, 0.05) + 1.6) * 0.4 + 0.35)


@pytest.mark.parametrize("missing", ["intrusion", "human_uncertainty", "robot_uncertainty"])
def test_an_input_that_is_not_given_is_undecided_above_and_exceeded_below(tmp_path, missing):
    options = "\n".join(line for line in FULL.splitlines() if not line.startswith(missing)) + "\n"
    far, _, _ = separation(tmp_path / "far", options=options)
    assert far.verdict == "undecided"
    assert missing in far.reason
    assert any(i.origin == "missing" for i in basis_in(tmp_path / "far").inputs)
    near, _, _ = separation(tmp_path / "near", options=options, x=3.0)
    assert near.verdict == "exceeded"
    given = {"intrusion": 0.2, "human_uncertainty": 0.1, "robot_uncertainty": 0.05}[missing]
    assert far.limit == pytest.approx((np.hypot(2, 0.05) + 1.6) * 0.4 + 0.35 - given)


def test_person_inside_the_robot_is_exceeded(tmp_path):
    S, d, _ = separation(tmp_path, x=1.5)
    assert d.value <= 0
    assert S.verdict == "exceeded"


def test_it_takes_one_robot_and_one_human(tmp_path):
    with pytest.raises(InputError, match="not a robot or machine and a human"):
        separation(tmp_path, between='["arm", "arm"]')


def test_unheard_person_is_undecided_even_close_by(tmp_path):
    from made_cell import heard
    from seerob.session.run import Judge, bind
    from seerob.twin.engine import Engine

    separation(tmp_path, x=3.0)
    from seerob.session.station import load

    station = load(tmp_path)
    engine = Engine(station.model, driven={"op": 0.2, "arm": 0.2})
    engine.take([heard("arm", 0.0, (0, 0))])
    result = Judge(bind(station.model))(engine.start())[0]
    assert (result.verdict, result.value, result.reason) == ("undecided", None, "op: nothing heard yet")


def test_what_the_surface_may_stick_out_is_added(tmp_path):
    """A display mesh 20 mm larger than the collision box on every side: nearer, and faster."""
    visual = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1.04 0.14 0.14"/></geometry></visual>'
    S, _, v = separation(
        tmp_path, urdf=two_r().replace("</collision></link>", f"</collision>{visual}</link>")
    )
    out = next(i.value for i in basis_in(tmp_path).inputs if i.name == "surfaces may be nearer by")
    assert 0.02 - 1e-9 <= out <= 0.02 * np.sqrt(3) + 1e-9
    assert v.value == pytest.approx(np.hypot(2, 0.05) + out)
    assert S.limit == pytest.approx((v.value + 1.6) * 0.4 + 0.35 + out)
