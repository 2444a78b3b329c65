"""Run time beside the clock: what a machine that falls behind may say of what it hears."""

from __future__ import annotations

import time
from itertools import pairwise

import pytest
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.core.samples import GrabSample, JointSample, Mailbox, Quality, SignalSample
from seerob.devices.live.receivers import Clock, hear, require_recorded
from seerob.devices.sources.rtde import Rtde
from seerob.workstation.source import Source
from seerob.workstation.workstation import Workstation


def joint(t):
    return JointSample(source="", seq=0, target="arm", q=(0.0,), t=t)


def signal(t):
    return SignalSample(source="plc", seq=0, values={"speed": 0.25}, t=t)


class Said:
    """Stands where `Receivers` does, with what a test says."""

    delay = 0.02

    def __init__(self, *ticks):
        self.ticks = list(ticks)

    def first(self):
        return self.take()

    def take(self):
        return tuple(self.ticks.pop(0)) if self.ticks else ()


@pytest.mark.parametrize("said", [joint, signal])
def test_a_clock_that_slips_makes_the_next_sample_doubtful_and_none_go_back(said):
    """Run time stood still while the robot, or a belt, went on: nobody may take that for speed."""
    clock = Clock()
    start = time.monotonic()
    ticks = [[said(t=start + 0.01 * k)] for k in range(6)]
    feed = hear(iter(lambda: (), None), Said(*ticks), clock)
    heard = [*next(feed), *next(feed)]
    clock.start += 0.025
    clock.slipped += 0.025
    heard += [s for _ in range(4) for s in next(feed)]
    # What was heard last is older than run time shows; the next one came about too fast.
    assert [s.quality for s in heard] == ["good"] * 3 + ["late"] * 2
    assert [s.t for s in heard] == pytest.approx([0, 0.01, 0.02, 0.02, 0.025], abs=2e-6)
    assert replace(heard[3], t=heard[2].t, quality=heard[2].quality) == heard[2]
    assert heard[3].t > heard[2].t


@pytest.mark.parametrize("said", [joint, signal])
def test_after_a_slip_nothing_is_sure_until_the_twin_has_settled(said):
    """On its way to where the robot went it is faster than any robot, and once in the right place."""
    clock = Clock()
    start = time.monotonic()
    ticks = [[said(t=start + 0.12 * k)] for k in range(12)]
    feed = hear(iter(lambda: (), None), Said(*ticks), clock)
    before = next(feed)
    clock.slipped += 0.3
    after = [s for _ in range(10) for s in next(feed)]
    assert [s.quality for s in before] == ["good"] * 2
    assert [s.quality for s in after] == ["late"] * 4 + ["good"] * 6
    assert after[4].t - before[-1].t == pytest.approx(0.6)


def test_what_is_doubted_already_is_late_too_where_the_clock_slipped():
    """Whoever draws it must know that its speed is false."""
    clock = Clock()
    start = time.monotonic()
    doubted = replace(joint(start), quality=Quality.DEGRADED, reason="its clock leads")
    ticks = [[replace(doubted, t=start + 0.01 * k)] for k in range(4)]
    feed = hear(iter(lambda: (), None), Said(*ticks), clock)
    heard = [*next(feed), *next(feed)]
    clock.slipped += 0.3
    heard += next(feed)
    assert [s.quality for s in heard] == ["degraded"] * 3 + ["late"]
    assert {s.reason for s in heard} == {"its clock leads"}


@pytest.mark.parametrize("when", ["asleep", "while it computes", "after it has waited"])
def test_a_pause_of_the_run_itself_is_a_slip_before_anything_is_made_of_it(monkeypatch, when):
    """Held still for half a second by the system, wherever: no sample may lie half a second ahead as sure."""
    now = [100.0]
    pauses = {"asleep": 0.0, "after it has waited": 0.0}

    def sleep(seconds):
        now[0] += seconds + pauses.pop("asleep", 0.0)

    monkeypatch.setattr("seerob.devices.live.receivers.time.monotonic", lambda: now[0])
    monkeypatch.setattr("seerob.devices.live.receivers.time.sleep", sleep)

    class Real(Said):
        def take(self):
            now[0] += pauses.pop("after it has waited", 0.0)
            return (joint(now[0] - 0.001),)

    clock = Clock()
    feed = hear(iter(lambda: (), None), Real(), clock)
    heard = []
    for k in range(100):
        if k == 50:
            if when == "while it computes":
                now[0] += 0.5
            else:
                pauses[when] = 0.5
        heard.append((0.01 * k, next(feed)))
        clock.wait(0.01 * (k + 1))
    for t, samples in heard:
        for sample in samples:
            assert sample.t <= t + Said.delay + 0.01 or sample.quality == "late"
    assert clock.slipped == pytest.approx(0.5, abs=0.02)
    late = [t for t, samples in heard if any(s.quality == "late" for s in samples)]
    assert late[0] == pytest.approx(0.5, abs=0.011)
    assert len(late) > 45


def test_a_computer_that_was_suspended_has_slipped(monkeypatch):
    """Its monotonic clock stood still; the robot's did not."""
    clock, slept = Clock(), [0.0]
    monkeypatch.setattr("seerob.devices.live.receivers._asleep", lambda: clock._asleep + slept[0])
    clock.look()
    assert clock.slipped == 0.0
    slept[0] = 3600.0
    clock.look()
    assert clock.slipped == 3600.0


def test_several_pictures_of_one_instant_are_all_heard():
    """Of a machine; a robot is in one place."""
    start = time.monotonic()
    for said, heard in ((signal, 3), (joint, 1)):
        feed = hear(iter(lambda: (), None), Said([said(t=start)], [said(t=start)] * 2), Clock())
        assert len([*next(feed), *next(feed)]) == heard


def test_what_a_hand_took_and_let_go_while_the_run_was_held_up_is_heard_once_each_and_in_order():
    """A release that is lost leaves the piece in the hand for good; a grab told twice is no grab."""

    def grab(seq, t, piece=""):
        return GrabSample(source="room", seq=seq, target="anna/right_hand", piece=piece, t=t)

    clock, box = Clock(), Mailbox()
    start = time.monotonic()
    feed = hear(iter(lambda: (), None), box, clock)
    box.first, box.delay = box.take, 0.0
    box.post(grab(0, start, "nut"))
    heard = [*next(feed)]
    # Set back by half a second, in which two things were done.
    clock.start += 0.5
    clock.slipped += 0.5
    for each in (grab(1, start + 0.1), grab(2, start + 0.2, "bolt"), grab(3, start + 0.2)):
        box.post(each)
    heard += [s for _ in range(3) for s in next(feed)]
    assert [(s.seq, s.piece) for s in heard] == [(0, "nut"), (1, ""), (2, "bolt"), (3, "")]
    assert all(a.t < b.t < a.t + 0.01 for a, b in pairwise(heard))


def test_a_live_source_is_refused_where_time_is_not_real():
    with pytest.raises(InputError, match=r"sources\[1\].*real time only.*seerob run"):
        require_recorded(Workstation(folder="", sources=(Source(), Rtde(robot="arm", host="127.0.0.1"))))
    require_recorded(Workstation(folder="", sources=(Source(),)))
