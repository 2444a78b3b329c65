"""Numbers that no robot can mean, from a controller that is heard live: undecided, with what is wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest

from made_cell import UR10, made
from seerob.core.samples import JointSample
from seerob.twin.engine import Engine

NAN, INF = math.nan, math.inf


@pytest.fixture(scope="module")
def ur10(tmp_path_factory):
    return made(tmp_path_factory.mktemp("ur10"), UR10)


def lived(station, said, *, live=True):
    """The reason for doubt while ``said`` replaces what is said of joint 2, and long after it."""
    engine = Engine(station.model, driven={"arm": 0.2}, live={"arm"} if live else ())
    doubts = []
    for k in range(40):
        values = {name: [0.1 * k * 0.01] * 6 for name in ("q", "qd", "tau")}
        if k in (10, 11):
            for name, value in said.items():
                values[name][1] = value
        numbers = {name: tuple(row) for name, row in values.items()}
        engine.take([JointSample(source="s", target="arm", seq=k, t=k * 0.01, **numbers)])
        state = engine.start() if k == 0 else engine.tick()
        doubts.append(state.invalid_reason("arm"))
        assert np.abs(engine._data.qpos).max() < 100
    return doubts[11], doubts[-1]


@pytest.mark.parametrize("value", [NAN, INF, -INF, 1e7, -1e308])
@pytest.mark.parametrize("name", ["q", "qd"])
def test_what_is_not_finite_or_beyond_all_bounds(ur10, name, value):
    during, after = lived(ur10, {name: value})
    assert "values that are not finite, or beyond" in during
    assert after == ""


@pytest.mark.parametrize(("q", "limit"), [(6.39, 6.283), (-9.0, -6.283), (90.0, 6.283)])
def test_a_joint_where_it_cannot_be_asks_for_unit_and_robot(ur10, q, limit):
    during, after = lived(ur10, {"q": q})
    assert f"shoulder_lift_joint is said to be at {q:.4g} rad, its limit is {limit} rad" in during
    assert after == ""


def test_a_joint_a_little_beyond_its_limit_is_where_it_says(ur10):
    """Some controllers let a joint go 363° where the model says 360°."""
    during, _ = lived(ur10, {"q": 6.335})
    assert "limit" not in during


def test_of_a_file_the_limits_were_looked_at_when_it_was_read(ur10):
    during, _ = lived(ur10, {"q": 9.0}, live=False)
    assert "its limit" not in during


@pytest.mark.parametrize("tau", [NAN, INF, 1e9])
def test_a_torque_that_cannot_be_is_none(ur10, tau):
    assert lived(ur10, {"tau": tau}) == ("", "")
