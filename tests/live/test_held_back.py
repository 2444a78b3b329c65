"""Which samples nobody looked at, and what of them lies beyond those that somebody did."""

from __future__ import annotations

import pytest

from seerob.core.samples import BodyPoint, BodySample, JointSample, PoseSample, SignalSample
from seerob.devices.live.held_back import HeldBack

BEHIND, PERIOD = 0.03, 0.01
PLACE, SPEED, TOGETHER, FASTER = 5e-3, 0.05, 0.02, 0.9
"""As they were chosen."""


def joints(q, qd=None):
    return JointSample(source="s", seq=0, t=0.0, target="arm", q=q, qd=qd)


def pose(*position, wxyz=(1.0, 0.0, 0.0, 0.0)):
    return PoseSample(source="s", seq=0, t=0.0, target="cart", position=position, wxyz=wxyz)


def turned(w, x):
    point = BodyPoint(name="imu", bone="right_hand", wxyz=(w, x, 0.0, 0.0))
    return BodySample(source="s", seq=0, t=0.0, target="op", points=(point,))


def body(**points):
    seen = tuple(BodyPoint(name=name, bone=name, position=at) for name, at in points.items())
    return BodySample(source="s", seq=0, t=0.0, target="op", points=seen)


def burst(*samples, late=0.1, apart=0.0, period=PERIOD):
    """What is found when the first comes in time, and all others together; the last of them so late [s]."""
    held = HeldBack(BEHIND)
    assert held.reason(samples[0], 0.0, BEHIND) == ""
    last = len(samples) - 1
    came = [(period * k, period * last + late + apart * (k - last)) for k in range(1, len(samples))]
    return [held.reason(each, t, at) for each, (t, at) in zip(samples[1:], came, strict=True)][-1]


REST, AWAY = joints((0.0, 1.0)), joints((0.2, 1.0))


def test_what_was_done_and_undone_among_those_that_come_together_was_not_judged():
    assert "held back" in burst(REST, AWAY, REST)
    assert "held back" in burst(REST, AWAY, AWAY, REST)
    assert "held back" in burst(REST, joints((0.1, 1.0)), AWAY, joints((0.15, 1.0)))
    assert burst(REST, AWAY, AWAY) == ""
    assert burst(REST, REST, AWAY) == ""


@pytest.mark.parametrize("off", [PLACE, -PLACE])
def test_what_lies_a_little_beyond_is_noise(off):
    assert burst(REST, joints((0.99 * off, 1.0)), REST) == ""
    assert "held back" in burst(REST, joints((1.01 * off, 1.0)), REST)
    between = joints((0.1, 1.0)), joints((0.2, 1.0)), joints((0.3, 1.0))
    assert burst(*between) == ""


@pytest.mark.parametrize("off", [SPEED, -SPEED])
def test_a_speed_that_is_over_when_they_come_was_not_judged(off):
    still = joints((0.0,), (0.0,))
    assert burst(still, joints((0.0,), (0.99 * off,)), still) == ""
    assert "held back" in burst(still, joints((0.0,), (1.01 * off,)), still)


def test_who_comes_in_time_or_alone_is_looked_at():
    assert burst(REST, AWAY, REST, late=BEHIND - 1.01 * PERIOD) == ""
    assert "held back" in burst(REST, AWAY, REST, late=BEHIND - 0.99 * PERIOD)
    long = 10 * TOGETHER
    assert burst(REST, AWAY, REST, apart=1.01 * TOGETHER, period=long) == ""
    assert "held back" in burst(REST, AWAY, REST, apart=0.99 * TOGETHER, period=long)


def test_who_comes_late_one_by_one_is_looked_at():
    assert burst(REST, AWAY, REST, apart=1.01 * FASTER * PERIOD) == ""
    assert "held back" in burst(REST, AWAY, REST, apart=0.99 * FASTER * PERIOD)


def test_each_bound_belongs_to_the_side_on_which_less_is_missed_of_those_that_came_in_time():
    def last(*came):
        held = HeldBack(BEHIND)
        return [held.reason(sample, t, host) for sample, t, host in ((REST, -3.0, -3.0), *came)][-1]

    assert "held back" in last((AWAY, -1.0, 0.0), (REST, -0.5, TOGETHER))
    step = 2.0**-6
    assert last((AWAY, -1.0, 0.0), (REST, step - 1.0, FASTER * step)) == ""
    assert last((AWAY, 0.0, BEHIND), (REST, 0.5, BEHIND)) == ""
    for edge in (PLACE, -PLACE):
        assert last((joints((edge, 1.0)), -1.0, 0.0), (joints((0.0, 1.0)), -0.5, 0.0)) == ""


def test_it_is_said_once():
    held = HeldBack(BEHIND)
    came = [REST, AWAY, REST, REST, REST]
    found = [held.reason(each, PERIOD * k, BEHIND if k == 0 else 1.0) for k, each in enumerate(came)]
    assert [bool(each) for each in found] == [False, False, True, False, False]


def test_of_very_many_it_is_known_whether_they_lie_between():
    assert burst(*[REST] * 3000, period=1e-5) == ""
    assert "held back" in burst(REST, *[AWAY] * 3000, REST, period=1e-5)


@pytest.mark.parametrize(
    ("rest", "away"),
    [
        (pose(0.0, 0.0, 1.0), pose(0.0, 0.0, 1.2)),
        (pose(0.0, 0.0, 1.0), pose(0.0, 0.0, 1.0, wxyz=(0.96, 0.28, 0.0, 0.0))),
        (turned(1.0, 0.0), turned(0.96, 0.28)),
        (body(hand=(0.0, 0.0, 1.0)), body(hand=(0.3, 0.0, 1.0))),
        (body(hand=(0.0, 0.0, 1.0)), body(foot=(0.0, 0.0, 1.0))),
        (joints((0.0, 1.0)), joints((0.0, 1.0, 2.0))),
        (joints((0.0, 1.0)), joints((float("nan"), 1.0))),
    ],
    ids=[
        "a pose",
        "a pose that turns",
        "a hand of which only that is seen that turns",
        "a hand",
        "a point that nobody else says",
        "a joint more",
        "no number",
    ],
)
def test_whatever_moves_is_looked_at(rest, away):
    assert "held back" in burst(rest, away, rest)
    assert burst(rest, rest, rest) == ""


def test_nothing_is_said_of_signals():
    on, off = (SignalSample(source="s", seq=0, t=0.0, values={"door": value}) for value in (True, False))
    assert burst(on, off, on) == ""


@pytest.mark.parametrize(
    ("seconds", "away", "found"), [(0.049, 1.0, False), (0.052, 1.0, True), (0.2, 0.004, False)]
)
def test_what_nobody_took_for_longer_than_a_few_ticks_was_judged_at_no_instant(seconds, away, found):
    """While the run is held up the newest one stands where the last that was taken did."""
    held, said = HeldBack(BEHIND), []
    n = round(seconds / 0.001)
    for k in range(n + 1):
        q = away if k == 2 else 0.0
        sample = JointSample(source="s", seq=k, target="arm", t=0.001 * k, q=(q,))
        said.append(held.reason(sample, 0.001 * k, 0.001 * k, waits=k > 1))
    assert any(said) is found
    assert sum(map(bool, said)) <= 1


def test_what_nobody_took_before_the_first_was_taken_is_not_looked_at():
    held = HeldBack(BEHIND)
    for k in range(400):
        sample = JointSample(source="s", seq=k, target="arm", t=0.001 * k, q=(float(k % 2),))
        assert not held.reason(sample, 0.001 * k, 0.001 * k, waits=k > 0)


def test_both_signs_of_a_quaternion_are_one_orientation():
    assert burst(turned(0.8, 0.6), turned(-0.8, -0.6), turned(0.8, 0.6)) == ""
