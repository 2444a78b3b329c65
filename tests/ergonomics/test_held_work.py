"""Static and repeated work, found while it happens: made movements with known durations and counts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_postures import made_angles

from seerob.criteria.ergonomics.rula import Profile
from seerob.criteria.scoring.held_work import Hold, Moves, WorkDetection, WorkMonitor, activity, muscle_use

RATE = 20.0
SEEN = 4
"""Instants per second of whole bodies."""
REST = WorkDetection(from_rest=True)


def watched(watch, signals, duration, rate=SEEN):
    """What RULA and REBA are told at each instant: (t, arms, body, static, repeated)."""
    rows = []
    for k in range(round(duration * rate) + 1):
        t = k / rate
        watch.add(t, made_angles(**{name: signal(t) for name, signal in signals.items()}))
        arms, body = muscle_use(watch)
        static, repeated = activity(watch, walking=False)
        rows.append((t, arms, body, static, repeated))
    return rows


def known(span):
    assert np.array_equal(span.low, span.high)
    return np.asarray(span.low).tolist()


def moving(t):
    """Never held for long, and only ever one movement."""
    return 0.5 * t


@pytest.mark.parametrize(("held", "expected"), [(60.5, True), (59.0, False)])
def test_a_minute_is_static(held, expected):
    hold = Hold(np.radians(5), 60.0)
    longest = 0.0
    for k in range(int(100 * RATE)):
        t = k / RATE
        angle = 40.0 if 10 <= t < 10 + held else 80 * np.sin(t)
        hold.add(t, np.radians(angle))
        # The absence that ends it is noticed a moment late, and counts from its begin.
        if 10 <= t < 10 + held:
            longest = max(longest, t - hold.since)
    assert (longest >= 60) == expected


@pytest.mark.parametrize(("away", "expected"), [(0.9, True), (1.1, False)])
def test_a_short_absence_does_not_end_it(away, expected):
    hold = Hold(np.radians(5), 60.0)
    for k in range(int(61 * RATE)):
        t = k / RATE
        hold.add(t, np.radians(30.0 if 20 <= t < 20 + away else 0.0))
    assert (hold.since == 0.0) == expected
    assert expected or hold.since == pytest.approx(20 + away, abs=2 / RATE)


def test_the_band_is_as_wide_as_twice_the_tolerance_wherever_it_lies():
    """Brute force: the longest stretch up to now whose range fits into the band."""
    rng = np.random.default_rng(3)
    angles = np.cumsum(rng.normal(0, 0.01, 600))
    hold = Hold(0.05, 60.0, gap=0.0)
    for k, angle in enumerate(angles):
        hold.add(k / RATE, angle)
        since = next(j for j in range(k + 1) if np.ptp(angles[j : k + 1]) <= 0.1 + 1e-9)
        assert hold.since == pytest.approx(since / RATE)


def test_a_hold_remembers_no_more_than_its_window():
    hold = Hold(0.1, 5.0)
    for k in range(4000):
        hold.add(k / RATE, 1e-6 * k)
    assert hold.since == 0.0
    assert max(len(hold._t), len(hold._low), len(hold._high)) <= 5 * RATE + 2


@pytest.mark.parametrize("cycles", [3, 4, 5])
@pytest.mark.parametrize("amplitude", [6, 30])
def test_cycles_per_minute(cycles, amplitude):
    moves = Moves(np.radians(10))
    for k in range(int(180 * RATE)):
        t = k / RATE
        moves.add(t, np.radians(amplitude * np.sin(2 * np.pi * cycles * t / 60)))
        if t > 75:
            assert moves.count == cycles


@given(st.lists(st.integers(-30, 30), min_size=2, max_size=40))
def test_moving_to_the_left_is_moving_to_the_right(angles):
    one, other = Moves(np.radians(10)), Moves(np.radians(10))
    for t, angle in enumerate(np.radians(angles)):
        one.add(float(t), angle)
        other.add(float(t), -angle)
        assert one.count == other.count


def test_trembling_is_no_movement():
    moves = Moves(np.radians(10))
    rng = np.random.default_rng(0)
    for k in range(4000):
        moves.add(k / RATE, np.radians(rng.uniform(-4.9, 4.9)))
    assert moves.count == 0


def test_rula_four_per_minute_of_one_joint_is_muscle_use_of_that_side():
    for cycles, expected in ((4, [1, 0]), (3, [0, 0])):
        swing = {
            "elbow_flexion": lambda t, n=cycles: [80 + 20 * np.sin(2 * np.pi * n * t / 60), 80 + moving(t)],
            "neck_flexion": moving,
        }
        rows = watched(WorkMonitor(REST, hold=60, count=4), swing, 90)
        assert known(rows[-1][1]) == expected
        assert known(rows[-1][2]) == 0


def test_rula_needs_every_part_of_the_group_held_and_reba_one():
    rows = watched(WorkMonitor(REST, hold=60, count=4), {"wrist_flexion": moving, "neck_flexion": moving}, 61)
    _, arms, body, static, _ = rows[-1]
    assert known(arms) == [0, 0]
    assert known(body) == 0
    assert known(static) == 1
    rows = watched(WorkMonitor(REST, hold=60, count=4), {}, 61)
    assert [known(rows[-1][i]) for i in (1, 2, 3)] == [[1, 1], 1, 1]
    assert [known(rows[59 * SEEN][i]) for i in (1, 2, 3)] == [[0, 0], 0, 0]


def test_the_profiles_differ_in_how_long_is_static():
    assert (Profile.ORIGINAL_1993.static, Profile.WORKSHEET.static) == (60, 600)
    for profile, expected in ((Profile.ORIGINAL_1993, 1), (Profile.WORKSHEET, 0)):
        rows = watched(WorkMonitor(REST, hold=profile.static, count=4), {}, 70)
        assert known(rows[-1][2]) == expected


def test_what_was_before_the_run_is_not_known():
    watch = WorkMonitor(WorkDetection(), hold=60, count=4)
    rows = watched(watch, {}, 61)
    assert (int(rows[20][2].low), int(rows[20][2].high)) == (0, 1)
    assert known(rows[-1][2]) == 1
    # Who has moved since was not held before; how often, only a whole minute tells.
    rows = watched(WorkMonitor(WorkDetection(), hold=60, count=4), {"neck_flexion": moving}, 61)
    assert int(rows[20][2].high) == 1
    assert known(rows[-1][2]) == 0


def test_a_joint_that_is_not_measured_may_be_anything():
    watch = WorkMonitor(REST, hold=60, count=4)
    for k in range(70 * SEEN):
        watch.add(k / SEEN, made_angles(neck_flexion=np.nan))
    assert muscle_use(watch)[1] == (0, 1)
    assert known(muscle_use(watch)[0]) == [1, 1]


def test_a_silence_forgets_and_an_earlier_instant_begins_anew():
    watch = WorkMonitor(REST, hold=60, count=4)
    watched(watch, {}, 61)
    assert known(muscle_use(watch)[1]) == 1
    watch.add(64.0, made_angles())
    assert muscle_use(watch)[1] == (0, 1)
    again = watched(watch, {}, 61)
    fresh = watched(WorkMonitor(REST, hold=60, count=4), {}, 61)
    for one, other in zip(again, fresh, strict=True):
        assert [str(x) for x in one] == [str(x) for x in other]


def test_nothing_depends_on_what_comes_later():
    rng = np.random.default_rng(1)
    noise = np.cumsum(rng.normal(0, 2, 400))
    whole = watched(
        WorkMonitor(REST, hold=10, count=4), {"trunk_flexion": lambda t: noise[round(t * SEEN)]}, 80
    )
    part = watched(
        WorkMonitor(REST, hold=10, count=4), {"trunk_flexion": lambda t: noise[round(t * SEEN)]}, 40
    )
    assert [str(row) for row in whole[: len(part)]] == [str(row) for row in part]


@pytest.mark.parametrize("unseen", [(0.0, 50.0), (20.0, 50.0)])
def test_of_a_joint_that_nobody_saw_for_a_while_nothing_is_known_until_it_was_seen_for_a_minute(unseen):
    """Hidden from one instant to another it may have moved as often as it likes, or been held all along."""
    watch = WorkMonitor(REST, hold=60, count=4)
    found = {}
    for k in range(120 * SEEN):
        t = k / SEEN
        hidden = unseen[0] <= t < unseen[1]
        wrist = np.nan if hidden else 0.5 * t
        watch.add(t, made_angles(wrist_flexion=wrist, elbow_flexion=80 + 0.5 * t, neck_flexion=0.5 * t))
        found[t] = watch.part("wrist", 0)
    for t in (unseen[1], unseen[1] + 30, unseen[1] + 59):
        assert found[t].repeated == (0, 1), t
    assert found[unseen[1] + 61].repeated == (0, 0)
    assert found[unseen[1] + 11].static == (0, 1)
    assert found[unseen[1] + 61].static == (0, 0)


@pytest.mark.parametrize(
    ("rate", "known_to_be"), [(1.0, (0, 1)), (2.0, (0, 1)), (4.0, (0, 0)), (20.0, (0, 0))]
)
def test_who_looks_seldom_does_not_know_that_nothing_is_repeated(rate, known_to_be):
    """A wrist that goes to and fro once a second is always at one place to whoever looks once a second."""
    watch = WorkMonitor(REST, hold=60, count=4)
    for k in range(round(90 * rate) + 1):
        watch.add(k / rate, made_angles(wrist_flexion=0.0))
    assert watch.part("wrist", 0).repeated == known_to_be
    assert watch.part("neck", 0).repeated == known_to_be


def test_one_short_gap_hides_no_more_than_it_can():
    watch = WorkMonitor(REST, hold=60, count=4)
    for k in range(90 * SEEN):
        if not 200 < k < 204:
            watch.add(k / SEEN, made_angles())
    assert watch.part("wrist", 0).repeated == (0, 0)
