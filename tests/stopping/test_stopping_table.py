"""Makers' stopping tables: what is shipped, corners, between, outside, and what a table may not be."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.core.errors import Undecided, UnknownName
from seerob.criteria.stopping.table import (
    MOST,
    JointStop,
    StoppingTable,
    interpolate,
    joint_stop,
    shipped,
    table,
)

THIRDS = (0.33, 0.66, 1.0)
rng = np.random.default_rng(0)
GROWING = np.cumsum(np.cumsum(np.cumsum(rng.uniform(0.01, 0.1, (3, 3, 3)), 0), 1), 2)
share = st.floats(0.33, 1.0)


def nested(values):
    return tuple(tuple(map(tuple, plane)) for plane in values.tolist())


FULL = JointStop(
    joint=0, full_speed=3.0, speed=THIRDS, payload=THIRDS, extension=THIRDS, way=nested(GROWING),
    time=nested(2 * GROWING),
)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "joint", "way", "time"),
    [
        ("ur5_cb3", 0, 0.31, 0.244),
        ("ur5_cb3", 1, 0.70, 0.530),
        ("ur5_cb3", 2, 0.22, 0.164),
        ("ur3_cb3", 0, 0.18, 0.159),
        ("ur3_cb3", 1, 0.20, 0.154),
        ("ur3_cb3", 2, 0.15, 0.092),
        ("kuka_kr20_r3100", 0, np.radians(30.47), 0.380),
        ("kuka_kr20_r3100", 1, np.radians(29.14), 0.420),
        ("kuka_kr20_r3100", 2, np.radians(16.79), 0.200),
    ],
)
def test_published_figures(name, joint, way, time):
    entry = next(j for j in table(name).joints if j.joint == joint)
    assert joint_stop(entry, 1.0, 1.0, 1.0) == pytest.approx((way, time), abs=2e-5)
    assert joint_stop(entry, -0.2, 0.1, 0.5) == joint_stop(entry, 1.0, 1.0, 1.0)
    if entry.full_speed is not None:
        # Published: less than the full speed all along, but not always less than half of it.
        assert 0.35 < way / (entry.full_speed * time) < 0.52


def test_tool_speed_table():
    tool = table("ur10_cb3").tool
    times = [interpolate([tool.speed], tool.time, [v]) for v in (0.2, 1.0, 1.5, 2.0, 2.5, 3.0)]
    assert times == pytest.approx([0.45, 0.45, 0.5, 0.55, 0.6, 0.65])
    with pytest.raises(Undecided, match="beyond the table"):
        interpolate([tool.speed], tool.time, [3.01])


def test_every_shipped_table_says_where_it_comes_from():
    assert shipped() == ("kuka_kr20_r3100", "ur10_cb3", "ur3_cb3", "ur5_cb3")
    for name in shipped():
        assert table(name).source
        assert table(name).confidence in {"1S", "2S"}


@pytest.mark.parametrize("name", ["ur5e", "../iso_ts_15066_2016", "", "ur5_cb3.toml"])
def test_unknown_table(name):
    with pytest.raises(UnknownName):
        table(name)


@given(at=st.tuples(share, share, share))
def test_between_nodes_it_is_the_multilinear_interpolation(at):
    from scipy.interpolate import RegularGridInterpolator

    wanted = RegularGridInterpolator((THIRDS,) * 3, GROWING)([at])[0]
    assert interpolate([THIRDS] * 3, GROWING, at) == pytest.approx(wanted, rel=1e-9)


@given(at=st.tuples(*[st.floats(0.01, 1.0)] * 3), k=st.integers(0, 2), more=st.floats(0, 0.5))
def test_it_never_falls_and_below_the_table_its_first_figures_hold(at, k, more):
    shuffled = rng.permutation(GROWING.ravel()).reshape(3, 3, 3)
    further = tuple(min(x + more, 1.0) if i == k else x for i, x in enumerate(at))
    for values in (GROWING, shuffled):
        assert interpolate([THIRDS] * 3, values, further) >= interpolate([THIRDS] * 3, values, at) - 1e-12
        clipped = tuple(max(x, 0.33) for x in at)
        assert interpolate([THIRDS] * 3, values, at) == interpolate([THIRDS] * 3, values, clipped)


def test_where_figures_fall_the_worse_corner_holds():
    assert interpolate([THIRDS], [0.5, 0.3, 0.4], [1.0]) == 0.5


@pytest.mark.parametrize("at", [(1.01, 1, 1), (1, 1.01, 1), (1, 1, 1.01), (np.nan, 1, 1), (np.inf, 1, 1)])
def test_beyond_the_table_is_undecided(at):
    with pytest.raises(Undecided):
        joint_stop(FULL, *at)


def test_a_joint_that_stands_needs_nothing():
    assert joint_stop(FULL, 0.0, 1.0, 1.0) == (0.0, 0.0)


ENTRY = {"joint": 0, "way": [[[0.3]]], "time": [[[0.2]]]}
TWO = {"joint": 0, "speed": [0.5, 1.0], "way": [[[0.3]], [[0.4]]], "time": [[[0.2]], [[0.3]]]}
LONG = {"joint": 0, "extension": [0.5, 1.0], "way": [[[0.3, 0.4]]], "time": [[[0.2, 0.3]]]}
HEAD = {"robot": "r", "category": 0, "source": "s", "confidence": "1S"}


@pytest.mark.parametrize(
    ("data", "match"),
    [
        ({**HEAD}, "either joints or tool"),
        ({**HEAD, "joints": [ENTRY, ENTRY]}, "twice"),
        ({**HEAD, "joints": [{**ENTRY, "speed": [1.0, 0.5]}]}, "ascend"),
        ({**HEAD, "joints": [{**ENTRY, "speed": [0.5, float("inf")]}]}, "ascend"),
        ({**HEAD, "joints": [{**ENTRY, "speed": [0.5, 0.5]}]}, "ascend"),
        ({**HEAD, "joints": [{**ENTRY, "speed": [0.3, 0.9, 0.6]}]}, "ascend"),
        ({**HEAD, "joints": [{**ENTRY, "speed": [0.5, 1.0]}]}, "nodes are needed"),
        ({**HEAD, "joints": [{**TWO, "time": [[[0.1]], [[float("inf")]]]}]}, "finite"),
        ({**HEAD, "joints": [{**TWO, "way": [[[0.1]], [[0.1, 0.2]]]}]}, "nodes are needed"),
        ({**HEAD, "joints": [{**ENTRY, "way": [[[-0.3]]]}]}, ">= 0"),
        ({**HEAD, "joints": [{**ENTRY, "way": [[[float("nan")]]]}]}, "finite|>= 0"),
        ({**HEAD, "joints": [{**ENTRY, "time": [[[float("inf")]]]}]}, "finite"),
        ({**HEAD, "joints": [{**ENTRY, "extension": [0.5, 1], "way": [[[0, 1]]], "time": [[[0, 1]]]}]},
         "reach is needed"),
        ({**HEAD, "tool": {"speed": [1.0, 2.0], "time": [0.1]}}, "as many times"),
        ({**HEAD, "category": 3, "joints": [ENTRY]}, "<= 2"),
        ({**HEAD, "joints": [{**ENTRY, "ways": 1}]}, "unknown field"),
    ],
)  # fmt: skip
def test_what_a_table_may_not_be(data, match):
    with pytest.raises(msgspec.ValidationError, match=match):
        msgspec.convert(data, StoppingTable)


@pytest.mark.parametrize(
    "data",
    [
        {"joints": [ENTRY]},
        {"joints": [ENTRY, {**TWO, "joint": 1}]},
        {"joints": [LONG], "reach": 1.3},
        {"tool": {"speed": [1.0, 2.0], "time": [0.1, 0.2]}},
    ],
)
def test_what_a_table_may_be(data):
    assert msgspec.convert({**HEAD, **data}, StoppingTable).robot == "r"


def test_a_table_has_up_to_a_hundred_nodes_along_an_axis():
    for nodes in (MOST, MOST + 1):
        speed = [k / nodes for k in range(1, nodes + 1)]
        data = {**HEAD, "tool": {"speed": speed, "time": speed}}
        if nodes == MOST:
            assert msgspec.convert(data, StoppingTable).tool is not None
        else:
            with pytest.raises(msgspec.ValidationError, match="length <= 100"):
                msgspec.convert(data, StoppingTable)
