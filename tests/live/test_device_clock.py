"""A device's time on the host's clock, and how regularly it is heard."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.devices.live import device_clock
from seerob.devices.live.device_clock import (
    AGAIN,
    DRIFT,
    HOLD,
    OTHERWISE,
    REORDERED,
    RESTART_HOLD,
    SETTLED,
    SLEW,
    STEP,
    ClockState,
    DeviceClock,
)
from seerob.devices.live.listening import Arrivals

PERIOD = 0.008


def heard(clock, packets):
    """Per packet (device, host): what the clock makes of it."""
    return [clock.hear(device, host, hash(device)) for device, host in packets]


@given(st.floats(-1e6, 1e6), st.lists(st.floats(0, 0.5), min_size=1, max_size=80))
def test_what_is_not_doubted_is_late_by_the_least_latency_and_intervals_never_collapse(offset, latencies):
    """Whatever the way does; a device at 125 Hz, each packet after the one before."""
    clock, least, arrived, before = DeviceClock(), math.inf, -math.inf, None
    for k, latency in enumerate(latencies):
        device = PERIOD * k
        arrived = max(arrived, device + offset + latency)
        least = min(least, arrived - device - offset)
        found = clock.hear(device, arrived)
        if found.t is None or found.invalid_reason:
            before = None
            continue
        assert -1e-6 <= found.t - (device + offset + least) <= SETTLED + STEP * (least == latency) + DRIFT
        if before is not None:
            assert found.t - before[1] >= (1 - SLEW * 1.001) * (device - before[0]) - SLEW * 0.5 - 1e-6
        before = device, found.t


@given(st.lists(st.floats(0, REORDERED), min_size=2, max_size=50))
def test_only_news_is_told(stamps):
    clock, newest = DeviceClock(), -math.inf
    for k, stamp in enumerate(stamps):
        found = clock.hear(stamp, 10 + stamp + 0.01 * k)
        assert (found.t is not None) == (stamp > newest)
        newest = max(newest, stamp)


@pytest.mark.parametrize("drift", [1e-4, -1e-4, 1e-3])
def test_a_clock_that_drifts_is_followed_without_a_doubt(drift):
    """Slower ones than any quartz are taken for a delay that grows; faster ones show themselves."""
    clock = DeviceClock()
    chance = np.random.default_rng(1)
    for k in range(12_000):
        taken = 0.01 * k
        instant = clock.hear(taken * (1 + drift) + 7, taken + 0.001 + chance.exponential(0.002))
        if k > 100:
            assert instant.invalid_reason == ""
            assert abs(instant.t - taken - 0.001) < 0.003
            assert clock.latency < 0.05


def test_jitter_of_delivery_makes_no_speed():
    """A packet that comes faster than all before shows a smaller latency; the motion goes on evenly."""
    clock, chance = DeviceClock(), np.random.default_rng(3)
    told = heard(clock, [(PERIOD * k, 3 + PERIOD * k + chance.exponential(0.006)) for k in range(4000)])
    sure = [(PERIOD * k, i.t) for k, i in enumerate(told) if i.t is not None and not i.invalid_reason]
    assert len(sure) > 3900
    speed = [(b[0] - a[0]) / (b[1] - a[1]) for a, b in itertools.pairwise(sure)]
    assert max(abs(v - 1) for v in speed) < 2 * SLEW + 0.01


@pytest.mark.parametrize("growth", [0.03, 0.003, 0.2])
def test_a_delay_that_grows_is_seen_as_one(growth):
    clock = DeviceClock()
    for k in range(2500):
        clock.hear(PERIOD * k, 5 + PERIOD * k * (1 + growth))
    assert clock.latency == pytest.approx((growth - DRIFT) * 2499 * PERIOD, rel=0.02)


@pytest.mark.parametrize("again", [False, True])
def test_a_delay_that_lasts_is_one_also_after_another_connection(again):
    clock = DeviceClock()
    heard(clock, [(PERIOD * k, 5 + PERIOD * k) for k in range(100)])
    if again:
        clock.reconnect()
    for k in range(400, 5000):
        instant = clock.hear(PERIOD * k, 7 + PERIOD * k)
        # What it says is two seconds old, and looks it.
        assert instant.t == pytest.approx(5 + PERIOD * k, abs=DRIFT * (PERIOD * k + 3))
        assert clock.latency == pytest.approx(2.0, abs=0.02)


def test_one_stamp_ahead_of_its_clock_is_no_news_and_a_doubt_that_lasts():
    clock = DeviceClock()
    heard(clock, [(PERIOD * k, 5 + PERIOD * k) for k in range(100)])
    wrong = clock.hear(PERIOD * 100 + 0.15, 5 + PERIOD * 100)
    assert wrong.t is None
    assert "0.15 s ahead" in wrong.invalid_reason
    after = heard(clock, [(PERIOD * k, 5 + PERIOD * k) for k in range(101, 300)])
    doubted = sum(bool(i.invalid_reason) for i in after)
    assert doubted == pytest.approx(HOLD / PERIOD, abs=2)
    assert not any(i.invalid_reason for i in after[doubted:])
    assert [i.t for i in after] == pytest.approx([5 + PERIOD * k for k in range(101, 300)], abs=1e-3)


def test_a_clock_that_is_set_ahead_or_a_host_that_slept_is_believed_at_the_second_word():
    clock = DeviceClock()
    heard(clock, [(PERIOD * k, 5 + PERIOD * k) for k in range(100)])
    told = heard(clock, [(3600 + PERIOD * k, 5 + PERIOD * k) for k in range(100, 300)])
    assert told[0].t is None
    assert [i.t for i in told[1:]] == pytest.approx([5 + PERIOD * k for k in range(101, 300)], abs=1e-3)
    assert all("ahead" in i.invalid_reason for i in told[: round(HOLD / PERIOD)])
    assert told[-1].invalid_reason == ""


def test_a_device_that_starts_again_is_believed_once_and_after_a_while():
    clock = DeviceClock()
    assert clock.hear(500.0, 10.0).t == 10.0
    assert clock.hear(500.0, 10.5).t is None
    first = clock.hear(0.5, 11.0)
    assert first.t == 11.0
    assert "started again" in first.invalid_reason
    assert clock.offset == 10.5
    assert clock.hear(0.5 + RESTART_HOLD - 0.1, 10.9 + RESTART_HOLD).invalid_reason
    assert not clock.hear(0.5 + RESTART_HOLD + 0.1, 11.1 + RESTART_HOLD).invalid_reason
    for device, host, doubt in (
        (-20.0, 15.0, "a loop?"),
        (-40.0, 14.9 + AGAIN, "a loop?"),
        (-60.0, 15.2 + 2 * AGAIN, "started again"),
    ):
        again = clock.hear(device, host)
        assert again.t == host
        assert doubt in again.invalid_reason
        assert clock.hear(device + 1.0, host + 1).invalid_reason
    assert all(clock.hear(t, 12 + AGAIN).t is None for t in (math.nan, math.inf, -math.inf, 1.1e12, -1e308))


@pytest.mark.parametrize("live", [False, True])
@pytest.mark.parametrize("again", [False, True])
def test_what_is_played_again_and_again_is_never_relied_on(live, again):
    """The last two seconds in a loop, with the live packets among them or not, connected anew or not."""
    clock, chance = DeviceClock(), np.random.default_rng(2)
    last = [(PERIOD * k, 5 + PERIOD * k) for k in range(1000)]
    assert not any(i.invalid_reason for i in heard(clock, last))
    now = 1000
    for _ in range(20):
        if again:
            clock.reconnect()
        for device, _ in last[-250:]:
            found = clock.hear(device, 5 + PERIOD * now, hash(device))
            assert found.t is None or found.invalid_reason, (now, found)
            if live and chance.random() < 0.5:
                found = clock.hear(PERIOD * now, 5 + PERIOD * now + 1e-4, hash(PERIOD * now))
                assert found.t is None or found.invalid_reason
            now += 1


@pytest.mark.parametrize("lost", [0.0, 0.02], ids=["whole", "some lost"])
@pytest.mark.parametrize("since", [0, 3000], ids=["of long ago", "of just now"])
def test_a_long_recording_that_is_played_after_a_silence_is_never_relied_on(monkeypatch, since, lost):
    """Half a minute of what was heard, of a device that has connected anew: more stamps than are kept."""
    monkeypatch.setattr(device_clock, "KEPT", 500)
    clock, chance = DeviceClock(), np.random.default_rng(4)
    count = 8000
    assert not any(
        i.invalid_reason for i in heard(clock, [(PERIOD * k, 5 + PERIOD * k) for k in range(count)])
    )
    clock.reconnect()
    for k in range(since, since + 4000):
        if chance.random() >= lost:
            host = 7 + PERIOD * (count + k - since)
            found = clock.hear(PERIOD * k, host, hash(PERIOD * k), forgeable=True)
            assert found.t is None or found.invalid_reason, k
    assert "is a recording played to it?" in found.invalid_reason


def test_a_device_that_starts_again_and_moves_is_relied_on_though_its_stamps_were_heard():
    clock = DeviceClock()
    for run in range(3):
        clock.reconnect()
        for k in range(2000):
            found = clock.hear(PERIOD * k, 5 + 1000 * run + PERIOD * k, hash((run, k)), forgeable=True)
            assert bool(found.invalid_reason) == (run > 0 and PERIOD * k <= RESTART_HOLD)


@pytest.mark.parametrize("forgeable", [False, True])
@pytest.mark.parametrize("late", [0.2, 1.0, 4.0])
def test_a_buffer_that_a_new_connection_is_served_from_is_as_late_as_it_is(late, forgeable):
    """It begins with what was heard before, and goes on with what is new, late for good."""
    clock = DeviceClock()
    for k in range(2000):
        clock.hear(50 + PERIOD * k, 55 + PERIOD * k, k, forgeable=forgeable)
    clock.reconnect()
    for k in range(2000 - round(late / PERIOD), 12_000):
        found = clock.hear(50 + PERIOD * k, 55 + late + PERIOD * k, k, forgeable=forgeable)
        assert found.t is None or found.invalid_reason or clock.latency > 0.9 * late, k
        if k > 2000 + (late + 2 * AGAIN) / PERIOD:
            assert not found.invalid_reason
    assert found.t == pytest.approx(55 + PERIOD * k, abs=0.03)
    assert clock.latency == pytest.approx(late, abs=0.03)


@pytest.mark.parametrize("late", [0.4, 4.0, 9.0])
def test_a_robot_that_stands_and_is_heard_out_of_a_buffer_is_as_late_as_it_is(late):
    """What it says is the same at all times: it may have moved since."""
    clock = DeviceClock()
    for k in range(2000):
        clock.hear(50 + PERIOD * k, 55 + PERIOD * k, 7)
    clock.reconnect()
    for k in range(2000 - round(late / PERIOD), 4000):
        found = clock.hear(50 + PERIOD * k, 55 + late + PERIOD * k, 7)
        assert found.t is None or found.invalid_reason or clock.latency > 0.9 * late, k


@pytest.mark.parametrize("on", [0.5, 4.0, 50.0])
@pytest.mark.parametrize(("by", "late"), [(9.5, True), (9.875, True), (10.125, False)])
def test_what_seems_late_by_less_than_ten_seconds_is_late_however_long_it_was_heard(on, by, late):
    """Nothing that comes later tells a buffer from a device that was switched on: both look late for good."""
    clock = DeviceClock()
    for k in range(int(8 * on) + 1):
        clock.hear(k / 8, 5 + k / 8, k)
    clock.reconnect()
    host = 5 + on + by - 0.375  # its stamps go back by 0.375 s
    first = clock.hear(on - 0.3125, host + 0.0625, -1)
    assert first.invalid_reason
    assert (first.t is None) is late
    for k in range(1, 640):
        found = clock.hear(on - 0.3125 + k / 8, host + 0.0625 + k / 8, -1 - k)
        if late:
            assert (found.t is None) is (k < 3)
            assert found.t is None or clock.latency == pytest.approx(by, abs=0.02)
        elif k / 8 > RESTART_HOLD:
            assert not found.invalid_reason
            assert clock.latency < 0.01


@pytest.mark.parametrize("same", [False, True])
@pytest.mark.parametrize("on", [2.0, 9.0, 30.0])
def test_who_was_switched_on_is_believed_once_it_says_otherwise_than_at_the_same_instants_before(on, same):
    """Or has been away so long that no buffer is; else it stays late."""
    clock, runs = DeviceClock(), []
    for run in range(2):
        clock.reconnect()
        host = 5 + run * (on + 0.5)
        content = [7 if same else (run, k) for k in range(int(on / PERIOD))]
        runs.append([clock.hear(PERIOD * k, host + PERIOD * k, hash(said)) for k, said in enumerate(content)])
    late = same and on + 0.5 < 10
    relied = [
        PERIOD * k for k, found in enumerate(runs[1]) if found.t is not None and not found.invalid_reason
    ]
    if late:
        assert not relied
    elif on > RESTART_HOLD:
        assert relied[0] == pytest.approx(RESTART_HOLD + 4 * PERIOD * (on + 0.5 < 10), abs=2 * PERIOD)
    # What comes next is as late as it seems for as long as it is heard.
    clock.hear(on + 100, host + on + 100, 9)
    assert clock.latency == pytest.approx((on + 0.5) * late, abs=0.03)


@pytest.mark.parametrize("garbled", [OTHERWISE - 1, OTHERWISE])
def test_a_few_samples_that_are_garbled_prove_no_other_clock(garbled):
    for between in (False, True):
        clock = DeviceClock()
        heard(clock, [(PERIOD * k, 5 + PERIOD * k) for k in range(1000)])
        clock.reconnect()
        for k in range(500, 500 + garbled + between):
            other = k - 500 != 2 or not between  # one of them is as it was
            clock.hear(PERIOD * k, 8 + PERIOD * k, hash(PERIOD * k) + other)
        assert (clock.offset == pytest.approx(8, abs=0.01)) is (garbled == OTHERWISE and not between)
    # The same instant again and again is one, whatever is said of it.
    clock.reconnect()
    for k in range(20):
        assert clock.hear(PERIOD * 200, 9.0 + 0.01 * k, -k).t is None


def test_between_samples_that_are_news_what_was_said_otherwise_proves_nothing():
    clock = DeviceClock()
    heard(clock, [(PERIOD * k, 5 + PERIOD * k) for k in range(1000)])
    for k in range(1000, 1100):
        assert clock.hear(PERIOD * (k - 500), 5 + PERIOD * k, -k).t is None
        assert clock.hear(PERIOD * k, 5 + PERIOD * k, k).t is not None
    assert clock.offset == pytest.approx(5.0, abs=1e-3)


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize(("leap", "far"), [(0.125, False), (0.25, False), (0.375, True)])
def test_who_started_again_is_followed_unless_it_leaps_on_to_where_it_was(leap, far, ahead):
    """Then one packet came very late over a new connection, and what followed it is as late as it is."""
    clock = DeviceClock()
    for k in range(21):
        clock.hear(100.0 + k, 105.0 + k, k)
    clock.reconnect()
    clock.hear(112.5, 128.0, 50)  # late by 10.5 s
    assert (clock.offset, clock.latency) == (15.5, 0.0)
    for k in range(70):
        clock.hear(113.5 + k, 129.0 + k, 60 + k)
    # A minute later it leaps, twice, by 6 s and more: it is late by 4.5 s.
    sooner = 6.0 * ahead
    assert (clock.hear(182.5 + leap / 2, 198.0 + leap / 2 - sooner, 51).t is None) is ahead
    clock.hear(182.5 + (leap if ahead else leap * 1.5), 198.0 + leap * (1.0 if ahead else 1.5) - sooner, 52)
    assert clock.latency == pytest.approx(4.5 if ahead and far else 0.0, abs=0.02)


@pytest.mark.parametrize(("caught_up", "late"), [(0.375, False), (0.625, True)])
def test_who_catches_up_within_a_minute_to_less_than_ten_seconds_was_a_buffer(caught_up, late):
    """Bit by bit, without a leap."""
    clock = DeviceClock()
    for k in range(21):
        clock.hear(100.0 + k, 105.0 + k, k)
    clock.reconnect()
    for k in range(50):
        sooner = min(caught_up, 0.015 * k)
        clock.hear(112.5 + k, 128.0 + k - sooner, 50 + k)
    assert clock.latency == pytest.approx(10.5 - caught_up if late else 0.0, abs=0.02)


@pytest.mark.parametrize(("seconds", "kept"), [(1.0, True), (2.5, True), (2.625, False)])
def test_the_clock_before_a_restart_is_that_before_all_that_followed_within_two_and_a_half_seconds(
    seconds, kept
):
    """Two packets came late and looked like restarts, and what follows them is 2 s late."""
    clock = DeviceClock()
    for k in range(31):
        clock.hear(100.0 + k, 105.0 + k, k)
    for k, wait in enumerate((0.0, seconds)):
        clock.reconnect()
        assert clock.hear(122.5 - 11 * k, 138.0 + wait, 50 + k).t is not None
    assert clock.offset == 26.5 + seconds
    clock.hear(135.0, 142.0, 60)
    clock.hear(135.5, 142.5, 61)
    # Later, it was followed, and what came ahead of it is all that is known.
    assert clock.latency == pytest.approx(2.0 if kept else 0.0, abs=3e-3)


@pytest.mark.parametrize("back", [1.0, 40.0])
def test_a_buffer_is_late_by_the_clock_of_just_before_it(back):
    """Of a second after another buffer, or of twenty after a clock was set back."""
    clock = DeviceClock()
    for k in range(101):
        clock.hear(100.0 + k, 105.0 + k, k)
    clock.reconnect()
    content, seconds = (99, 3) if back == 1.0 else (500, 20)
    for k in range(seconds + 1):
        clock.hear(200.0 - back + k, 205.5 + k, content + k)
    clock.reconnect()
    at, host = seconds - 1, 205.5 + seconds + 0.25
    told = [clock.hear(200.0 - back + at + k, host + k, content + at + k) for k in (0, 1, 2)]
    assert told[0].invalid_reason
    assert clock.latency == pytest.approx(1.25 + 1.5 * (back == 1.0), abs=0.01)


def test_a_packet_that_a_new_connection_overtook_is_no_news_of_its_clock():
    clock = DeviceClock()
    heard(clock, [(PERIOD * k, 5 + PERIOD * k) for k in range(100)])
    clock.reconnect()
    told = heard(clock, [(PERIOD * k, 7 + PERIOD * k) for k in range(98, 500)])
    assert [i.t is None for i in told[:3]] == [True, True, False]
    assert clock.latency == pytest.approx(2.0, abs=0.01)


def test_a_device_that_starts_again_and_stands_as_before_is_relied_on():
    """A simulator at home: the same stamps, and the same to the last bit."""
    clock = DeviceClock()
    for run in range(2):
        clock.reconnect()
        for k in range(2000):
            found = clock.hear(PERIOD * k, 5 + 100 * run + PERIOD * k, 7)
            assert bool(found.invalid_reason) == (run > 0 and PERIOD * k <= RESTART_HOLD)


def test_what_is_remembered_of_a_clock_is_bounded(monkeypatch):
    monkeypatch.setattr(device_clock, "KEPT", 300)
    monkeypatch.setattr(device_clock, "MARKED", 100)
    clock = DeviceClock()
    for k in range(1000):
        clock.hear(2.0 * k, 5 + 2.0 * k, k)
    assert (len(clock._said), len(clock._marks)) == (300, 100)


def test_a_backlog_keeps_its_own_instants():
    """A network that held everything back for 3 s: what then comes at once is old, and looks it."""
    clock = DeviceClock()
    for k in range(100):
        clock.hear(0.01 * k, 5 + 0.01 * k)
    for k in range(100, 400):
        assert clock.hear(0.01 * k, 9.0).t == pytest.approx(5 + 0.01 * k, abs=1e-3)


@pytest.mark.parametrize(
    ("off", "doubted", "rate"),
    [
        (0.0049, False, 0.01),
        (0.005, False, 0.01),  # up to 5 ms instants are relied on
        (0.0051, True, 0.1),
        (0.0199, True, 0.1),
        (0.02, True, 0.1),  # more than 20 ms is no network
    ],
)
def test_a_packet_that_came_faster_shifts_what_follows_by_a_share_of_the_devices_own_time(off, doubted, rate):
    """Shifted by a hundredth, or a tenth of it; exactly at the edges, too: the other offset is 0."""
    clock = DeviceClock()
    assert clock.hear(0.0, off) == (off, "")
    first = clock.hear(0.01, 0.01)
    assert clock.latency == 0.0
    assert bool(first.invalid_reason) is doubted
    assert first.t == pytest.approx(0.01 + off - 0.01 * rate, abs=1e-12)
    # Held back for a second, and then the next one that it took: no time in which it was shifted further.
    second = clock.hear(0.02, 1.02)
    assert 0.01 * (1 - rate) - 1e-12 <= second.t - first.t <= 0.0099 + 1e-12
    assert clock.latency == pytest.approx(1.0, abs=1e-3)
    # In the end it is where the offset is, and no farther: that has risen by as much as clocks drift.
    *_, last = heard(clock, [(t, t) for t in (6.0, 7.0, 8.0, 9.0)])
    assert last == (pytest.approx(9.0, abs=1e-9), "")


def test_a_doubt_of_a_clock_that_is_being_found_ends_with_it():
    clock = DeviceClock()
    clock.hear(0.0, 0.006)
    found = [clock.hear(0.001 * k, 0.001 * k) for k in range(1, 20)]
    assert [bool(each.invalid_reason) for each in found] == [k < 10 for k in range(19)]


@pytest.mark.parametrize("silence", [1.0, 50.0])
def test_an_offset_rises_by_two_parts_in_ten_thousand_and_no_more(silence):
    clock = DeviceClock()
    clock.hear(0.0, 5.0)
    late = clock.hear(silence, 7.0 + silence)
    assert clock.offset == pytest.approx(5.0 + 2e-4 * (2.0 + silence), abs=1e-12)
    assert late.t == pytest.approx(silence + clock.offset, abs=1e-12)
    early = DeviceClock()  # of a host that was switched on just now
    early.hear(0.0, 0.2)
    early.hear(0.5, 1.2)
    assert early.offset == pytest.approx(0.2 + 2e-4 * 1.0, abs=1e-12)
    # Nor does it fall with what arrives before what was heard already, as threads may tell it.
    before = clock.offset
    clock.hear(silence + 0.01, 6.5 + silence)
    assert clock.offset == before
    clock.hear(silence + 0.02, 7.0 + silence + 0.5)
    assert clock.offset == pytest.approx(before + 2e-4 * 0.5, abs=1e-12)


def test_stamps_ahead_by_more_than_twenty_milliseconds_step_the_clock_at_the_second():
    clock = DeviceClock()
    clock.hear(0.0, 0.03)
    assert clock.hear(1.0, 1.0 + 0.0099).t is None
    assert clock.offset == 0.03
    # The later of both words is believed, and nothing is relied on for half a second.
    told = clock.hear(1.1, 1.1 + 0.005)
    assert clock.offset == pytest.approx(0.0099)
    assert told.t == pytest.approx(1.1 + 0.0099)
    assert "0.025 s ahead" in told.invalid_reason
    assert clock.hear(1.6, 1.6049).invalid_reason
    assert clock.hear(1.61, 1.6149).invalid_reason == ""
    # A word that was taken back is not the first of two.
    clock = DeviceClock()
    clock.hear(0.0, 0.03)
    for k in range(1, 10):
        assert (clock.hear(float(k), k + 0.03 * (k % 2 == 0)).t is None) == (k % 2 == 1)


@pytest.mark.parametrize("again", [False, True])
@pytest.mark.parametrize(("back", "doubted"), [(0.249, False), (0.25, False), (0.251, True), (0.9, True)])
def test_what_lies_a_quarter_of_a_second_back_was_overtaken_on_the_way(back, doubted, again):
    clock = DeviceClock()
    clock.hear(1.0, 6.0, 1)
    if again:
        clock.reconnect()
    assert clock.hear(1.0, 6.05, 1) == (None, "")
    found = clock.hear(1.0 - back, 6.1, 2)
    assert (found.t, bool(found.invalid_reason)) == (None, doubted)
    what = f"by {back:.3g} s: a buffer on the way, or has it started again?"
    assert (what in found.invalid_reason) is doubted


@pytest.mark.parametrize(("forgeable", "said"), [(True, 7), (False, 7), (None, 7), (True, 8), (False, 8)])
@pytest.mark.parametrize("on", [0.0, 9.4, 9.6])
def test_who_moves_and_says_again_what_it_said_is_doubted_for_a_minute(on, forgeable, said):
    """Also a program that begins with the very stamps and values it had: it looks the same."""
    clock = DeviceClock()
    clock.hear(on - 10.0, -5.0, 6)
    clock.hear(on + 1.0, 6.0, 7)
    clock.reconnect()
    assert clock.hear(on + 0.5, 100.0, 9).t == 100.0
    found = clock.hear(on + 1.0, 100.5, said, **({} if forgeable is None else {"forgeable": forgeable}))
    recording = said == 7
    assert ("recording" in found.invalid_reason) is recording
    assert bool(clock.hear(on + 60.9, 160.4, 1).invalid_reason) is recording
    assert clock.hear(on + 61.1, 160.6, 2).invalid_reason == ""


def test_who_says_again_within_a_connection_what_it_said_is_no_restart():
    clock = DeviceClock()
    for k in range(10):
        clock.hear(1.0 * k, 5.0 + k, k)
    found = clock.hear(2.0, 14.5, 2)
    assert found.t is None
    assert "says again what it said 7 s before" in found.invalid_reason
    assert clock.hear(10.0, 15.0, 10).invalid_reason
    assert clock.hear(10.1, 15.1, 11).invalid_reason == ""
    # Another thing at that time is a restart.
    assert "started again" in clock.hear(2.0, 16.0, 99).invalid_reason


def test_a_device_that_starts_again_is_not_relied_on_for_two_and_a_half_seconds_and_then_not_for_a_minute():
    clock = DeviceClock()
    clock.hear(500.0, 10.0)
    clock.hear(0.0, 11.0)
    assert clock.hear(2.49, 13.49).invalid_reason
    assert clock.hear(2.5, 13.5).invalid_reason
    assert clock.hear(2.51, 13.51).invalid_reason == ""
    assert clock.hear(-10.0, 71.0, 1).invalid_reason.endswith(
        "it seems to have started again"
    )  # a minute after
    clock.hear(1.0, 82.0)
    assert clock.hear(-20.0, 130.9, 2).invalid_reason.endswith("a loop?")
    assert clock.hear(39.9, 190.8).invalid_reason.endswith("a loop?")
    assert clock.hear(40.1, 191.0).invalid_reason == ""


def test_instants_never_go_back_where_a_clock_steps_that_was_being_found():
    clock = DeviceClock()
    told = heard(clock, [(0.9, 5.9), (0.92, 5.905), (0.95, 5.91), (0.951, 5.911), (0.97, 5.93)])
    assert told[0] == (5.9, "")
    assert told[1].t == pytest.approx(5.918)  # shifted by a tenth of 20 ms, of the 15 ms that it is off
    assert told[2].t is None  # 25 ms ahead of that
    assert told[3].t == pytest.approx(5.918 + 1e-6, abs=1e-9)
    assert told[4].t == pytest.approx(5.93, abs=1e-5)
    assert all("ahead" in each.invalid_reason for each in told[2:])
    assert "ahead" in clock.hear(1.449, 6.41).invalid_reason
    assert clock.hear(1.455, 6.415).invalid_reason == ""


def test_two_samples_are_never_of_one_instant():
    clock = DeviceClock()
    told = heard(clock, [(0.9, 5.9), (0.92, 5.905), (0.954, 5.916)])
    assert 0.955 + ((again := told[1].t) - 0.955) == again
    assert clock.hear(0.955, again).t == pytest.approx(again + 1e-6, abs=1e-9)


def test_a_doubt_of_a_minute_is_not_cut_short_by_one_of_half_a_second():
    clock = DeviceClock()
    heard(clock, [(500.0, 10.0), (0.0, 11.0)])
    assert "a loop?" in clock.hear(-10.0, 12.0).invalid_reason
    assert "a loop?" in clock.hear(-8.85, 13.0).invalid_reason  # 150 ms ahead
    assert "a loop?" in clock.hear(1.0, 22.99).invalid_reason
    assert "a loop?" in clock.hear(49.9, 71.9).invalid_reason
    assert clock.hear(50.1, 72.1).invalid_reason == ""


def test_what_was_said_after_a_restart_is_remembered_for_hours_too(monkeypatch):
    monkeypatch.setattr(device_clock, "KEPT", 10)
    clock = DeviceClock()
    for run, said in enumerate((1, 2, 2)):
        clock.reconnect()
        for k in range(500):
            host = 5 + 1000 * run + 0.1 * k
            found = clock.hear(0.1 * k, host, hash((said, k)), forgeable=True)
    assert "is a recording played to it?" in found.invalid_reason


@pytest.mark.parametrize("device", [1e12, -1e12, 0.0])
def test_clocks_count_to_a_trillion_seconds(device):
    assert DeviceClock().hear(device, 5.0).t == pytest.approx(5.0, abs=1e-3)
    assert DeviceClock().hear(device * 1.01 or math.inf, 5.0).t is None


def test_what_another_listener_knew_of_a_clock_goes_on():
    """Two seconds late are two seconds late; the time since is that in which clocks drift."""
    clock = DeviceClock(ClockState(offset=5.0, device=100.0, host=105.0))
    assert clock.offset == 5.0
    late = clock.hear(110.0, 117.0)
    assert clock.latency == pytest.approx(2.0 - 12 * 2e-4, abs=1e-9)
    assert late.t == pytest.approx(115.0 + 12 * 2e-4, abs=1e-9)
    assert DeviceClock().offset is None
    assert DeviceClock().latency == 0.0
    # Whose clock lies far before that has started again; else it comes late.
    back = [DeviceClock(ClockState(5.0, 100.0, 105.0)).hear(t, 106.0) for t in (99.7, 90.0)]
    assert [found.t for found in back] == [None, 106.0]
    assert ["seems to have started again" in found.invalid_reason for found in back] == [False, True]


def test_of_the_stamps_of_hours_one_of_each_second_is_remembered(monkeypatch):
    """At random: between half and a whole second after the last, so no player knows which."""
    monkeypatch.setattr(device_clock, "KEPT", 10)
    clock, intervals = DeviceClock(), set()
    for k in range(20_000):
        clock.hear(0.01 * k, 5 + 0.01 * k, k)
    intervals = np.diff([*clock._marks])
    assert len(clock._said) == 10
    assert intervals.min() == pytest.approx(0.5, abs=0.02)
    assert intervals.max() == pytest.approx(1.0, abs=0.02)
    assert len({*intervals.round(3)}) > 20


@given(st.lists(st.floats(1e-4, 1.0), min_size=1, max_size=60))
def test_arrivals_have_the_mean_and_the_deviation_of_their_intervals(intervals):
    arrivals = Arrivals()
    for host in np.cumsum([0.0, *intervals]).tolist():
        arrivals.add(host, None)
    found = arrivals.statistics()
    assert found.count == len(intervals) + 1
    assert found.rate == pytest.approx(1 / np.mean(intervals))
    assert found.jitter == pytest.approx(np.std(intervals), abs=1e-6)
    assert found.longest_gap == pytest.approx(max(intervals))


def test_what_is_missing_is_told_by_the_device_and_a_loss_is_no_gap():
    arrivals = Arrivals(0.01)
    for k in (0, 1, 2, 5, 6):
        arrivals.add(0.01 * k, 0.01 * k)
    arrivals.repeat()
    arrivals.lose()
    arrivals.lose()
    arrivals.add(100.0, 0.0)
    found = arrivals.statistics()
    assert (found.missed, found.repeated, found.losses, found.count) == (2, 1, 1, 6)
    assert found.longest_gap == pytest.approx(0.03)


def test_nothing_heard_has_no_figures():
    assert Arrivals().statistics().rate is None
    assert str(Arrivals().statistics()) == "0 samples"
