"""Contradictions at both sides of each threshold: two samples, or one motion, in closed form."""

from __future__ import annotations

import math
from itertools import accumulate

import numpy as np
import pytest
from made_samples import body, last, pose, said
from msgspec.structs import replace

from seerob.core.samples import JointSample
from seerob.devices.live import contradictions
from seerob.devices.live.contradictions import Contradictions, _Repeats, _Scale
from seerob.workstation.source import Target

SLIDER = Target(name="arm", joints=("a", "b"), units=("rad", "m"), velocity=(3.2, 1.0))
UNLIMITED = Target(name="arm", joints=("a", "b"), units=("rad", "m"), velocity=(20.0, None))
PERSON = ("a", "b", "c", "d")


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(
    ("target", "joint", "dt", "reach"),
    [
        (None, 0, 0.01, 30 * 0.01 + 0.005),  # 30 rad/s where nobody stated a limit, and noise of 5 mrad
        (UNLIMITED, 0, 0.01, 30 * 0.01 + 0.005),  # nor more where twice the limit is more
        (SLIDER, 0, 0.01, 6.4 * 0.01 + 0.005),  # twice the limit
        (UNLIMITED, 1, 0.01, 10 * 0.01 + 0.001),  # 10 m/s, 1 mm
        (SLIDER, 1, 0.01, 2.0 * 0.01 + 0.001),
        (SLIDER, 2, 0.01, 30 * 0.01 + 0.005),  # of a joint that the robot does not have
        (None, 0, 0.49, 30 * 0.49 + 0.005),  # before half a second of silence
    ],
)
def test_a_joint_goes_so_far_and_no_farther(target, joint, dt, reach, way):
    def found(far):
        q = [0.1, 0.1, 0.1]
        q[joint] -= way * far
        return last([said(0.0, (0.1, 0.1, 0.1)), said(dt, tuple(q))], target)

    assert not found(0.999 * reach)
    assert found(1.001 * reach).startswith(f"joint {joint + 1} went")


def test_exactly_so_far_is_no_farther():
    """Of times that a float holds exactly."""
    reach, far = 30 * 0.25 + 0.005, 10 * 0.25 + 0.001
    assert not last([said(0.0, (0.0,)), said(0.25, (reach,))])
    assert not last([pose(0.0), pose(0.25, (far, 0, 0))])
    assert not last([body(0.0, {"a": 0.0}), body(0.25, {"a": 10 * 0.25 + 0.2})])


@pytest.mark.parametrize(
    ("dt", "reach"),
    [
        (0.01, 30 * 0.06 + 0.005),  # it may have been 50 ms longer
        (-0.01, 30 * 0.04 + 0.005),
        (0.049, 30 * 0.099 + 0.005),
        (0.052, 30 * 0.052 + 0.005),  # what is farther apart did not come so close together
    ],
)
def test_where_no_device_sends_a_time_samples_may_come_closer_together(dt, reach):
    found = lambda far: last([said(0.0, (0.0,), None, False), said(dt, (far,), None, False)])  # noqa: E731
    assert not found(0.998 * reach)
    assert found(1.002 * reach)


def test_at_the_edge_of_what_may_come_closer_together():
    first, then = (JointSample(source="", seq=0, target="arm", t=t, q=(35 * t,)) for t in (0.0, 0.05))
    assert last([first, then])


@pytest.mark.parametrize("dt", [0.0, 0.5, 0.51, -0.01])
def test_what_was_before_a_silence_says_nothing_of_now(dt):
    assert not last([said(0.0, (0.0,), (0.0,)), said(dt, (20.0,), (9.0,))])
    # Nor do positions and velocities over it, or those of before.
    looking = Contradictions(None)
    for k in range(5):
        assert not looking.find(said(0.01 * k, (0.0,), (0.0,)))
    assert not looking.find(said(0.04 + dt, (0.0,), (0.1,)))
    assert not looking.find(said(0.04 + dt + 0.02, (0.002,), (0.1,)))


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("unit", "noise"), [("rad", 0.005), ("m", 0.001)])
@pytest.mark.parametrize(
    ("before", "now", "dt", "share"),
    [
        (0.0, 0.0, 0.1, 0.2 + 0.03 / 0.1),  # positions alone: a fifth of their way, and 30 ms of it
        (0.0, 0.0, 0.4, 0.2 + 0.03 / 0.4),
    ],
)
def test_positions_that_go_while_velocities_are_zero(before, now, dt, share, unit, noise, way):
    target = Target(name="arm", joints=("a",), units=(unit,), velocity=(None,))
    limit = noise / (1 - share)

    def found(far):
        return last([said(0.0, (0.5,), (before,)), said(dt, (0.5 + way * far,), (now,))], target)

    assert not found(0.995 * limit)
    assert "is zero while the joint moves" in found(1.005 * limit)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(
    ("before", "now", "dt"),
    [(0.0, 2.0, 0.1), (2.0, 0.0, 0.1), (2.0, 2.0, 0.2), (2.0, -2.0, 0.2), (2.0, 1.0, 0.2)],
)
def test_positions_that_stay_behind_their_velocities(before, now, dt, way):
    """Noise, a fifth of the way and 30 ms of the larger velocity."""
    said_way, length = 0.5 * dt * (before + now), 0.5 * dt * (abs(before) + abs(now))
    limit = 0.005 + 0.2 * length + 0.03 * max(abs(before), abs(now))

    def found(off):
        q = way * (said_way - off)
        return last([said(0.0, (0.0,), (way * before,)), said(dt, (q,), (way * now,))])

    assert not found(0.995 * limit)
    assert "the velocity of joint 1" in found(1.005 * limit)


def test_of_joints_that_the_robot_does_not_have_angles_are_compared():
    motion = [said(0.0, (0.0, 0.0), (0.0, 0.0)), said(0.1, (0.0, 0.0), (0.0, 1.5))]
    assert "the velocity of joint 2" in last(motion, Target(name="arm", joints=("a",), units=("rad",)))


@pytest.mark.parametrize("qd", [(), (0.1,), None])
def test_velocities_that_are_not_those_of_all_joints_are_not_compared(qd):
    looking = Contradictions(None)
    for k in range(100):
        assert not looking.find(said(0.01 * k, (0.0, 0.0), qd))
    for k in range(100, 103):  # and what comes after begins anew
        assert not looking.find(said(0.01 * k, (0.0, 0.0), (0.1, 0.1)))


def test_joints_that_become_more_begin_anew():
    looking = Contradictions(None)
    for k in range(10):
        n = 1 + k // 5
        assert not looking.find(said(0.01 * k, (0.0,) * n, (0.05,) * n))


def standing(speed, period, until=3.0):
    """Samples at which positions that stand, but for their last bits, while velocities run are found."""
    looking = Contradictions(None)
    motion = [said(k * period, (1e-12 * (k % 2),), (speed,)) for k in range(round(until / period))]
    return [k for k, sample in enumerate(motion) if looking.find(sample)]


def test_ways_are_compared_over_half_a_second_and_no_longer():
    """Over T it is found above 0.005 / (0.8 T - 0.03)."""
    assert standing(0.0137, 0.125)[0] == 4  # over exactly half a second
    assert not standing(0.0128, 0.125)
    assert not standing(0.0130, 0.0542)


def test_the_newest_is_compared_with_ten_instants_before():
    """From 0.494 to 0.5 s after each: of fifty samples that is four of each twenty-five."""
    found = standing(0.0137, 1 / 512)
    assert found[0] == 253
    assert len(found) == pytest.approx((3.0 - 0.494) * 512 * 4 / 26, abs=8)


def test_a_way_to_and_fro_counts_both_ways():
    """A fifth of 0.5 rad, although the joint is where it began."""
    speed = lambda t: 1.0 if t < 0.25 else -1.0  # noqa: E731
    for first in (1, -1):
        motion = [
            said(t, (first * (min(t, 0.5 - t) + 0.22 * t),), (first * speed(t),))
            for t in np.arange(0, 0.5, 1 / 128).tolist()
        ]
        assert not last(motion)


@pytest.mark.parametrize("way", [1, -1])
def test_what_was_right_for_long_hides_nothing(way):
    looking = Contradictions(None)
    for k in range(1000):
        assert not looking.find(said(0.01 * k, (way * 0.01 * k,), (way * 1.0,)))
    found = [bool(looking.find(said(10 + 0.01 * k, (way * 9.99,), (way * 1.0,)))) for k in range(12)]
    assert found.index(True) <= 7


@pytest.mark.parametrize(
    ("position", "angle", "told"),
    [
        ((0.1008, 0, 0), 0.0, False),  # 10 m/s and 1 mm
        ((0, -0.1012, 0), 0.0, True),
        ((0, 0, 0), 0.304, False),  # 30 rad/s and 5 mrad
        ((0, 0, 0), 0.306, True),
        ((0, 0, 0), -0.306, True),
    ],
)
def test_a_tool_goes_and_turns_so_far(position, angle, told):
    turned = (math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0)
    # A quaternion and its opposite are one orientation, and one may be longer than 1 by rounding.
    for sign in (1.0, -1.0):
        wxyz = tuple(sign * x for x in turned)
        assert bool(last([pose(0.0), pose(0.01, position, wxyz)])) is told
    longer = tuple(x * (1 + 1e-9) for x in turned)
    assert not last([pose(0.0, wxyz=longer), pose(0.01, wxyz=longer)])


@pytest.mark.parametrize(("far", "told"), [(0, False), (1, False), (2, True), (4, True)])
def test_a_person_is_elsewhere_when_half_the_points_are(far, told):
    before = dict.fromkeys(PERSON, 0.0)
    reach = 10 * 0.03 + 0.2
    for share, doubted in ((0.999, False), (1.001, told)):
        after = {name: -share * reach if k < far else 0.0 for k, name in enumerate(PERSON)}
        found = last([body(0.0, before), body(0.03, after)])
        assert bool(found) is doubted
        assert not found or found.startswith(f"{far} of 4 points")


def test_points_without_a_place_or_a_past_count_for_nothing():
    assert not last([body(0.0, {"a": 0.0}), body(0.03, {"b": 9.0})])
    assert not last([body(0.0, {"a": None}), body(0.03, {"a": 9.0})])
    assert not last([body(0.0, {"a": 0.0}), body(0.03, {"a": None})])
    assert not last([body(0.0, {"a": 0.0}), body(0.03, {"a": 0.0, "b": 9.0, "c": 9.0})])
    assert last([body(0.0, {"a": 0.0, "b": None}), body(0.03, {"a": 9.0, "b": 9.0, "c": 0.0})])


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(
    ("limits", "acceleration", "hurries"),
    [
        ((1.0, 1.0), 6.0, True),
        ((1.0,), 6.0, True),  # one for all joints
        ((6.0, 6.0), 6.0, False),
        ((5.0, 5.0), 6.0, False),  # a fifth more, which filters and rounding are
        ((4.0, 4.0), 6.0, True),
        ((), 6.0, False),  # nobody stated any
    ],
)
def test_a_joint_that_gets_faster_than_the_file_says_it_can(limits, acceleration, hurries, way):
    target = Target(name="arm", joints=("a",), units=("rad",), velocity=(3.2,), acceleration=limits)
    motion = [
        said(t, (way * acceleration * t * t / 2,), (way * acceleration * t,))
        for t in np.arange(0, 0.2, 0.008).tolist()
    ]
    found = last(motion, target)
    assert ("joint 1 gets faster with 6 rad/s², and acceleration_limits says" in found) == hurries
    assert not found or hurries


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(
    ("limits", "acceleration", "device", "hurries"),
    [
        ((3.0,), 6.0, True, True),
        ((6.0,), 6.0, True, False),
        ((), 6.0, True, False),
        ((1.0,), 12.0, False, True),
        ((5.0,), 6.0, False, False),  # by a jitter of arrivals
    ],
)
def test_a_joint_without_velocities_that_gets_faster_than_the_file_says_it_can(
    limits, acceleration, device, hurries, way
):
    target = Target(name="arm", joints=("a",), units=("rad",), velocity=(3.2,), acceleration=limits)
    looking, found = Contradictions(target), []
    for t in np.arange(0, 0.3, 0.008).tolist():
        # From rest at 50 ms on.
        q = way * acceleration * max(t - 0.05, 0.0) ** 2 / 2
        found.append(looking.find(said(t, (q,), device=device)))
    said_so = [why for why in found if why]
    assert bool(said_so) == hurries
    assert all("by its positions, and acceleration_limits says" in why for why in said_so)


@pytest.mark.parametrize("hertz", [20, 125, 500])
def test_a_joint_without_velocities_that_keeps_its_limits_says_nothing(hertz):
    """To and fro at its limit of 3 rad/s², stops three times as hard, and half a milliradian of noise."""
    target = Target(name="arm", joints=("a",), units=("rad",), velocity=(3.2,), acceleration=(3.0,))
    looking, noise, q = Contradictions(target), np.random.default_rng(7), 0.0
    for t in np.arange(0, 6.0, 1 / hertz).tolist():
        phase, way = t % 1.0, 1 if t % 2 < 1 else -1
        speed = 3.0 * min(phase, 0.4) if phase < 0.6 else max(1.2 - 9.0 * (phase - 0.6), 0.0)
        q += way * speed / hertz
        assert looking.find(said(t, (q + noise.uniform(-5e-4, 5e-4),))) == "", t


def test_a_joint_that_is_stopped_may_brake_harder_than_it_accelerates():
    target = Target(name="arm", joints=("a",), units=("rad",), velocity=(3.2,), acceleration=(1.0,))
    motion = [said(t, (2 * t - 6 * t * t / 2,), (2 - 6 * t,)) for t in np.arange(0, 0.3, 0.008).tolist()]
    assert not last(motion, target)


RAMP = 0.7
"""In which it gets as fast as it is [s]."""


def ramp(t):
    """Share of its speed, and the way to it as a share of that in a second."""
    x = min(t, RAMP)
    return math.sin(math.pi * x / RAMP / 2) ** 2, x / 2 - RAMP / (2 * math.pi) * math.sin(math.pi * x / RAMP)


def brought_to_rest(hertz, speed, braking, at, digits=16, seconds=2.0):
    """A joint that gets faster, goes at a speed, brakes from an instant on, and stands to the last bit."""
    for k in range(round(seconds * hertz)):
        t = k / hertz
        left = min(max(t - at, 0.0), speed / braking)
        q = speed * (ramp(t)[1] + max(0.0, min(t, at) - RAMP) + left) - braking * left**2 / 2
        yield t, round(q, digits), speed * ramp(t)[0] - braking * left


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("rates", [True, False])
@pytest.mark.parametrize(
    ("hertz", "speed"), [(20, 0.5), (20, 3.0), (125, 0.1), (125, 1.0), (500, 0.1), (500, 3.0)]
)
def test_a_device_that_hangs_on_its_last_sample_is_found(hertz, speed, rates, way):
    """Whether its velocities go on as they were, are zero from then on, or were never said."""
    for after in (1.0, 0.0) if rates else (None,):
        looking, found, last = Contradictions(None), [], 0.0
        for t, q, rate in brought_to_rest(hertz, speed, 1e9, 9.0):
            hangs = t > 1.0
            last = last if hangs else q
            rate = None if after is None else speed * after if hangs else rate
            found.append((t, looking.find(said(t, (way * last,), None if rate is None else (way * rate,)))))
        first = next(t for t, why in found if why)
        assert 1.0 < first <= 1.0 + 4 / hertz
        assert all(why for t, why in found if t >= first)


@pytest.mark.parametrize("digits", [16, 6, 4, 3])
@pytest.mark.parametrize("rates", [True, False])
@pytest.mark.parametrize("hertz", [20, 125, 500])
def test_a_joint_that_brakes_as_arms_do_may_stand_to_the_last_bit(hertz, rates, digits):
    """At whatever instant between two samples it begins to, in digits down to a milliradian."""
    chance = np.random.default_rng(3)
    for _ in range(40):
        speed, braking, at = (
            chance.uniform(0.02, 3.0),
            chance.uniform(2.0, 60.0),
            1.0 + chance.uniform(0, 0.1),
        )
        looking = Contradictions(None)
        for t, q, rate in brought_to_rest(hertz, speed, braking, at, digits):
            assert not looking.find(said(t, (q,), (rate,) if rates else None)), (t, speed, braking)


def test_a_robot_that_stands_may_do_so_to_the_last_bit():
    looking = Contradictions(None)
    for k in range(2000):
        # With the noise of velocities of an arm that stands.
        assert not looking.find(said(0.008 * k, (0.3, -1.2), (0.003 * (-1) ** k, 0.002)))


@pytest.mark.parametrize(("rate", "told"), [(0.0040, False), (0.0044, True), (-0.0044, True)])
def test_velocities_over_positions_that_stand_to_the_last_bit(rate, told):
    """2 mrad in half a second, and 30 ms."""
    looking = Contradictions(None)
    found = [looking.find(said(0.008 * k, (0.3,), (rate,))) for k in range(200)]
    assert any(found) is told


def swung(hertz, factor, lag=0.0, seconds=12.0, noise=0.0, low_pass=0.0):
    """A swing of half a hertz and one of one, with velocities as a device may have them."""
    chance, kept = np.random.default_rng(4), 0.0
    for t in np.arange(0, seconds, 1 / hertz).tolist():
        q = 0.4 * math.sin(3 * t) + 0.1 * math.sin(6 * t + 1)
        at = t - lag
        rate = 1.2 * math.cos(3 * at) + 0.6 * math.cos(6 * at + 1)
        kept += (rate - kept) * (1 - math.exp(-2 * math.pi * low_pass / hertz) if low_pass else 1.0)
        yield t, q + noise * chance.normal(), factor * kept + noise * chance.normal()


@pytest.mark.parametrize("hertz", [20, 125, 500])
@pytest.mark.parametrize("factor", [0.85, 0.9, 1.12, 0.5])
def test_velocities_that_are_a_tenth_off_are_found_on_a_long_way(hertz, factor):
    looking, way, last = Contradictions(None), 0.0, 0.0
    found = []
    for t, q, rate in swung(hertz, factor):
        way, last = way + abs(q - last), q
        found.append((way, looking.find(said(t, (q,), (rate,)))))
    first = next(way for way, why in found if why)
    assert first < 1.7
    assert "is off by a factor: positions move at" in found[-1][1]
    # A joint that stands is no reason to believe it again.
    assert "factor" in looking.find(said(t + 0.1, (q,), (0.0,)))


@pytest.mark.parametrize("hertz", [20, 125, 500])
@pytest.mark.parametrize(
    "how", [{}, {"lag": 0.02}, {"noise": 1e-3}, {"low_pass": 8.0}, {"low_pass": 8.0, "noise": 1e-3}]
)
def test_velocities_that_are_filtered_rounded_or_late_are_those_of_the_positions(hertz, how):
    looking = Contradictions(None)
    for t, q, rate in swung(hertz, 1.0, **how):
        assert not looking.find(said(t, (q,), (rate,))), t


def test_what_was_right_for_long_is_forgotten_on_a_long_way():
    looking, way, last = Contradictions(None), 0.0, 0.0
    for t, q, rate in swung(125, 1.0, seconds=60.0):
        assert not looking.find(said(t, (q,), (rate,)))
    found = []
    for t, q, rate in swung(125, 0.85, seconds=20.0):
        way, last = way + abs(q - last), q
        found.append((way, looking.find(said(60.0 + t, (q,), (rate,)))))
    assert next(way for way, why in found if "factor" in why) < 6.0


@pytest.mark.parametrize("seed", range(12))
def test_what_is_not_compared_anchor_by_anchor_is_where_nothing_is_found(monkeypatch, seed):
    """Motions with noise, lag, wrong scales, jumps, and joints that hang, creep or speed up: word by word."""
    chance = np.random.default_rng(seed)
    t = np.arange(300) / chance.choice([50, 125, 500])
    size, pace, phase = chance.uniform(0, 0.8, 2), chance.uniform(0.3, 6, 2), chance.uniform(0, 6, 2)
    lag, scale = chance.choice([0.0, 0.005, 0.02, 0.05]), chance.choice([1.0, 1.0, 0.95, 1.2, -1.0])
    q = size * np.sin(np.outer(t, pace) + phase) + chance.normal(0, chance.choice([0, 2e-5, 1e-3]), (300, 2))
    qd = scale * size * pace * np.cos(np.outer(t - lag, pace) + phase) + chance.normal(0, 5e-3, (300, 2))
    k = int(chance.integers(300))
    if seed % 3 == 0:
        q[k:] = q[k]
    elif seed % 3 == 1:
        q[k:] += chance.normal(0, 0.05, 2)
    else:
        begun = np.maximum(t - t[k // 2], 0.0)[:, None]
        q, qd = 0.02 * begun + [0.0, 4.0] * begun**2, [0.0, 8.0] * begun
    limited = Target(name="arm", units=("rad", "m"), velocity=(3.2, 1.0), acceleration=(5.0,))
    said_ = [said(a, tuple(b), tuple(c)) for a, b, c in zip(t.tolist(), q.tolist(), qd.tolist(), strict=True)]
    for target in (SLIDER, limited):
        looking = Contradictions(target)
        found = [looking.find(sample) for sample in said_]
        monkeypatch.setattr(contradictions, "CLOSE", 0.0)
        every = Contradictions(target)
        assert found == [every.find(sample) for sample in said_]
        monkeypatch.undo()


def limited(unit, limit=1.0):
    return Target(name="arm", joints=("a",), units=(unit,), velocity=(3.2,), acceleration=(limit,))


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("unit", "noise"), [("rad", 0.02), ("m", 0.005)])
@pytest.mark.parametrize("dt", [0.0501, 0.1])
def test_speeds_may_rise_by_a_fifth_more_than_the_limit_and_their_noise(unit, noise, way, dt):
    def found(gained):
        q = 0.5 * dt * (0.5 + 0.5 + gained)
        return last(
            [said(0.0, (0.0,), (way * 0.5,)), said(dt, (way * q,), (way * (0.5 + gained),))], limited(unit)
        )

    most = 1.2 * dt + noise
    assert found(most - 2e-4) == ""
    assert "gets faster with" in found(most + 2e-4)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("unit", "noise"), [("rad", 40 * 5e-4 + 0.02), ("m", 40 * 1e-4 + 0.005)])
@pytest.mark.parametrize(("device", "jitter"), [(True, 0.0), (False, 0.05)])
def test_positions_alone_may_gain_that_and_the_noise_of_both_ways(unit, noise, device, jitter, way):
    def found(gained):
        places = (0.0, 0.1 * 0.2, 0.1 * (0.4 + gained))
        return last([said(0.1 * k, (way * q,), None, device) for k, q in enumerate(places)], limited(unit))

    # Jitter of both ways, of 0.2 and of what it is now.
    most = (1.2 * 0.1 + noise + jitter * 10 * 0.4) / (1 - jitter * 10)
    assert found(most - 2e-4) == ""
    assert "by its positions" in found(most + 2e-4)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("unit", "hardest"), [("rad", 300.0), ("m", 100.0)])
def test_what_stands_to_the_last_bit_may_have_braked_so_hard_and_no_harder(unit, hardest, way):
    """From 0.3 rad/s, within twice the difference of the last two steps, which is the finest that it says."""

    def found(braking):
        finer = 0.3**2 / (4 * braking)
        places = (0.0, 0.003, 0.006 - finer, *[0.006 - finer] * 3)
        samples = [said(0.01 * k, (way * q,)) for k, q in enumerate(places)]
        return last(samples, Target(name="arm", joints=("a",), units=(unit,), velocity=(3.2,)))

    assert found(0.97 * hardest) == ""
    assert "stands to the last bit right after 0.3" in found(1.03 * hardest)


def held(steps, times, unit="rad", way=1, device=True):
    """What is found of a joint that goes steps within equal times and stands to the last bit since."""
    dt, hold = times
    places = [0.0, *accumulate(steps)]
    samples = [said(dt * k, (way * q,), None, device) for k, q in enumerate(places)]
    samples += [said(len(steps) * dt + t, (way * places[-1],), None, device) for t in hold]
    return last(samples, Target(name="arm", joints=("a",), units=(unit,), velocity=(3.2,)))


def test_a_joint_stands_when_it_says_one_place_for_two_and_a_half_intervals():
    for until, told in ((0.0245, False), (0.0255, True)):
        assert bool(held((0.003, 0.00293), (0.01, (0.01, 0.02, until)))) is told
    # And goes on doing so.
    assert held((0.003, 0.00293), (0.01, (0.01, 0.02, 0.03, 0.04, 0.05)))


def test_a_speed_is_told_by_four_steps_of_the_digits_within_an_interval():
    for steps, told in ((4.5, True), (4.01, True), (3.99, False)):
        finest = 0.003 / (steps + 1)
        assert bool(held((0.003, 0.003 - finest), (0.001, (0.001, 0.002, 0.003)))) is told


def test_digits_are_told_by_a_short_step_and_by_none_that_are_equal():
    for step, dt in ((0.003, 0.001), (0.9, 0.0301)):
        assert not held((step, step), (dt, (dt, 2 * dt, 3 * dt)))
    assert not held((1e-9, 0.003, 0.003), (1e-3, (1e-3, 2e-3, 3e-3)))
    assert held((2e-9, 0.003, 0.003), (1e-3, (1e-3, 2e-3, 3e-3)))
    for way in (1, -1):
        assert held((0.01, 0.001, 0.0045), (5e-4, (5e-4, 1e-3, 1.5e-3)), way=way)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("rates", [(0.9, 0.9, 0.0), (0.0, 0.0, 0.9)])
def test_a_joint_that_stands_may_have_moved_just_before_or_begin_to(rates, way):
    """4.5 mrad by its velocities, of which 30 ms of the larger one may be late."""
    places = (0.5, 0.5 + 0.01 * rates[0], 0.5 + 0.01 * rates[0])
    samples = [
        said(0.01 * k, (way * q,), (way * r,)) for k, (q, r) in enumerate(zip(places, rates, strict=True))
    ]
    assert not last(samples)


@pytest.mark.parametrize(("unit", "fastest"), [("rad", math.sqrt(600 * 1e-5)), ("m", math.sqrt(200 * 1e-6))])
def test_what_a_joint_may_move_without_being_seen_it_may_brake_within(unit, fastest):
    for share, told in ((0.98, False), (1.03, True)):
        step = share * fastest * 0.01
        assert bool(held((step, step - 1e-7), (0.01, (0.01, 0.02, 0.03)), unit)) is told


def steadily(rate, scale, seconds, unit="rad", hertz=16):
    """Ways by its velocities at which those of a joint that goes steadily are found to be off by a factor."""
    looking = Contradictions(Target(name="arm", joints=("a",), units=(unit,), velocity=(3.2,)))
    found = []
    for k in range(round(seconds * hertz)):
        t = k / hertz
        why = looking.find(said(t, (scale * rate * t,), (rate,)))
        assert not why or "is off by a factor" in why
        found += [t] if why else []
    return found


@pytest.mark.parametrize(
    ("scale", "told"), [(0.925, False), (0.916, True), (1.0, False), (1.083, False), (1.092, True)]
)
def test_velocities_may_be_off_by_eight_hundredths_over_a_long_way(scale, told):
    assert bool(steadily(1.0, scale, 5.0)) is told
    assert bool(steadily(-1.0, scale, 5.0)) is told


@pytest.mark.parametrize(("unit", "rate", "way"), [("rad", 0.8, 1.0), ("m", 0.25, 0.3)])
def test_a_long_way_is_a_radian_or_three_hundred_millimetres(unit, rate, way):
    first = steadily(rate, 0.9, 5.0, unit)[0] * rate * 0.9
    assert way <= first < way + rate / 16
    assert first < 1.06 * way


@pytest.mark.parametrize(("unit", "told_by"), [("rad", 0.01), ("m", 0.002)])
def test_ways_between_two_anchors_tell_of_a_factor_from_twice_the_noise_on(unit, told_by):
    """By whichever is longer, of positions or of velocities."""
    for share, told in ((0.98, False), (1.04, True)):
        assert bool(steadily(share * told_by * 16, 0.85, 40.0, unit)) is told
        assert bool(steadily(share * told_by * 16 / 1.15, 1.15, 40.0, unit)) is told
        assert bool(steadily(-share * told_by * 16, 0.85, 40.0, unit)) is told
        assert bool(steadily(-share * told_by * 16 / 1.15, 1.15, 40.0, unit)) is told


def test_where_arrivals_jitter_nobody_knows_how_fast_it_was_when_it_stood_still():
    assert held((0.003, 0.00293), (0.01, (0.01, 0.02, 0.03)))
    assert not held((0.003, 0.00293), (0.01, (0.01, 0.02, 0.03)), device=False)


@pytest.mark.parametrize(("until", "told"), [(0.045, False), (0.055, True)])
def test_a_joint_stands_after_two_and_a_half_of_the_longer_of_its_last_intervals(until, told):
    samples = [said(t, (q,)) for t, q in ((0.0, 0.0), (0.02, 0.012), (0.03, 0.02399))]
    samples += [said(0.03 + t, (0.02399,)) for t in (0.01, 0.02, 0.03, 0.04, until)]
    assert bool(last(samples)) is told


@pytest.mark.parametrize(("rate", "told"), [(0.0, False), (0.006, True), (-0.006, True)])
def test_what_stood_for_long_with_no_velocity_is_found_when_it_says_one(rate, told):
    looking = Contradictions(None)
    found = [bool(looking.find(said(0.01 * k, (0.3,), (rate * (k > 110),)))) for k in range(170)]
    assert not any(found[:111])
    assert any(found) is told


@pytest.mark.parametrize("unit", ["rad", "m"])
def test_of_a_factor_the_last_long_ways_tell_most(unit):
    """From four long ways on, what was counts half: sums of squares of ways, and of those velocities say."""
    way = contradictions.LONG_WAY[unit]

    def told(*rows):
        scale = _Scale(unit)
        for went, rate in rows:
            scale.add(went * way, rate * way)
        return scale.off()

    for first, squares in ((3.9, 3.9**2), (4.5, 4.5**2 / 2)):
        factor = math.sqrt((squares + 0.64) / (squares + 64))
        assert f"move at {factor:.3g} ×" in told((first, first), (0.8, 8.0))
    # 6 of a way are 3.8 of it after one more, which is not halved again.
    assert f"move at {math.sqrt(19.28 / 146):.3g} ×" in told((6, 6), (0.8, 8), (0.8, 8))


def test_at_exactly_eight_hundredths_and_a_long_way_a_factor_is_none_and_is_told():
    scale = _Scale("rad")
    scale.add(1.0, 2.0)
    assert "move at 0.5 ×" in scale.off()
    for bound in (1 - 0.08, 1 / (1 - 0.08)):
        way = next(
            x
            for x in (2 * bound, *(2 * bound + k * 4e-16 for k in range(-4, 5)))
            if math.sqrt(x**2 / 4) == bound
        )
        for beside, told in ((0.0, False), (1e-9 if bound > 1 else -1e-9, True)):
            scale = _Scale("rad")
            scale.add(way + beside, 2.0)
            assert bool(scale.off()) is told


@pytest.mark.parametrize("limits", [(0.5,), (9.0, 0.5)])
def test_of_two_joints_the_one_that_gets_faster_than_it_can_is_told(limits):
    target = Target(name="arm", joints=("a", "b"), units=("rad", "rad"), velocity=(3, 3), acceleration=limits)

    def found(gained):
        way = 0.5 * 0.0501 * (1.0 + gained)
        return last(
            [said(0.0, (0.0, 0.0), (0.5, 0.5)), said(0.0501, (0.02505, way), (0.5, 0.5 + gained))], target
        )

    most = 1.2 * 0.5 * 0.0501 + 0.02
    assert found(most - 2e-4) == ""
    assert "joint 2 gets faster with" in found(most + 2e-4)


def placed(places, dt=0.1, way=1, limit=1.0):
    """What is found of a joint that says positions alone, half a turn away from 0."""
    samples = [said(dt * k, (3.0 + way * q,)) for k, q in enumerate(places)]
    return last(
        samples, Target(name="arm", joints=("a",), units=("rad",), velocity=(9.0,), acceleration=(limit,))
    )


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(
    ("places", "told"),
    [
        ((0, 0, 0), False),
        ((0, 0, 0.4), True),
        ((0, 0, 0, 0, 0.4), True),
        ((0, -0.05, 0.35), False),  # it turned round
        ((0, 0.01, 0.02, 0.5, 0.45), False),
        ((0.08, 0, 0.02, 0.04, 0.5, 0.9), True),
    ],
)
def test_who_turned_round_may_have_braked_and_who_stood_gets_no_faster_than_it_can(places, told, way):
    assert bool(placed(places, way=way)) is told


@pytest.mark.parametrize(("more", "told"), [(0.075, False), (0.09, True)])
def test_positions_alone_are_compared_over_half_a_second_and_more(more, told):
    """A fifth more than 1 rad/s², and what noise makes of two spans of five instants: 0.0845 rad/s²."""
    assert bool(placed([0.5 * (1.2 + more) * (0.0625 * k) ** 2 for k in range(11)], 0.0625)) is told


def test_a_step_of_who_went_before_is_no_less_of_one():
    """10 mrad, half a second at one place, and 20 mrad while velocities are zero."""
    places = [(0.0, 0.0), (0.005, 0.16), (0.01, 0.0), *[(0.01, 0.0)] * 12, (0.03, 0.0)]
    samples = [said(0.0625 * k, (q,), (rate,)) for k, (q, rate) in enumerate(places)]
    assert not last(samples[:-1])
    assert "is zero while the joint moves" in last(samples)


def test_of_two_joints_that_hang_the_first_is_named():
    places = (0.0, 0.003, 0.00593, *[0.00593] * 3)
    found = last([said(0.01 * k, (q, q)) for k, q in enumerate(places)])
    assert found.startswith("joint 1 stands to the last bit")


def again(places, finest=1e-6):
    """At which of some places a robot is found to say its past again."""
    repeats = _Repeats()
    return [k for k, place in enumerate(places) if repeats.add((float(place),), finest)]


def test_ten_positions_one_after_another_are_those_of_before():
    past = [*range(20)]
    assert again(past * 2) == [*range(29, 40)]
    assert again(past * 2, 1.001e-6) == []  # digits so coarse repeat by themselves
    assert again([*past, *past[5:]]) == [*range(29, 35)]
    assert again([k for k in past * 2 for _ in range(2)])[0] == 58  # where it stands, it says nothing
    for other in (past[::-1], [*past[:9], 99, *past[9:18]], [*past[:9], *past[10:19]], past[::2]):
        assert again([*past, *other]) == []
    assert again([*past, 99, *past[1:]])[0] == 30
    assert again([*past, 99, *past[:5], *past])[0] == 40  # of two pasts, the last


def test_that_is_known_of_32768_places():
    assert again([*range(2**15), *range(10)]) == [2**15 + 9]
    assert again([*range(2**15 + 1), *range(20)]) == []


@pytest.mark.parametrize(
    ("live", "rates", "error", "told"),
    [
        (True, False, None, True),
        (True, True, None, False),  # as simulators repeat themselves
        (True, True, (1e-3, 1e-3), True),  # derived from the positions
        (False, False, None, False),
    ],
)
def test_of_a_robot_that_measures_no_velocities_a_loop_is_found(live, rates, error, told):
    looking, found = Contradictions(None, live=live), []
    for k in range(150):
        angle = 2 * math.pi * (k % 100) / 100
        q = (0.3 * math.sin(angle), 1e-7 * (k % 100))
        qd = (0.3 * math.cos(angle) * 2 * math.pi, 0.0) if rates else None
        sample = replace(said(0.01 * k, q, qd), qd_error=error)
        found.append(looking.find(sample))
    assert [k for k, why in enumerate(found) if why] == ([*range(109, 150)] if told else [])
    assert not told or "says its last 10 positions again" in found[109]


def test_two_samples_of_one_instant_from_a_device_without_a_clock_end_nothing():
    looked = Contradictions(None)
    for t, q in ((1.0, 0.1), (1.0, 0.2), (1.01, 0.3), (1.02, 0.3), (1.2, 0.3)):
        assert looked.find(JointSample(source="", seq=0, t=t, target="arm", q=(q,))) == ""
    looked = Contradictions(None)
    for t, q in ((1.0, 0.0), (1.0, 0.3), (1.0, 0.3)):
        looked.find(JointSample(source="", seq=0, t=t, target="arm", q=(q,), qd=(0.0,)))


@pytest.mark.parametrize(("q", "qd"), [(1e200, 0.0), (0.0, 1e200), (1e200, 1e200), (1e308, -1e308)])
def test_numbers_beyond_what_their_squares_hold_end_nothing_and_are_not_relied_on(q, qd):
    for live in (True, False):
        looked = Contradictions(None, live=live)
        found = [looked.find(said(0.1 * k, (k % 2 * q, 0.0), (qd, 0.0))) for k in range(20)]
        assert any(found)
