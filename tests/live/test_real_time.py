"""Run time beside the clock: what a machine that falls behind may say of what it hears."""

from __future__ import annotations

import time

import pytest
from msgspec.structs import replace

from seerob.errors import InputError
from seerob.live.real_time import Clock, hear, require_recorded
from seerob.samples import JointSample, SignalSample
from seerob.source import Source
from seerob.sources.rtde import Rtde
from seerob.workstation import Workstation


def joint(t):
    return JointSample(source="", seq=0, target="arm", q=(0.0,), t=t)


def signal(t):
    return SignalSample(source="plc", seq=0, values={"speed": 0.25}, t=t)


class Said:
    """Stands where `Listening` does, with what a test says."""

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


def test_several_pictures_of_one_instant_are_all_heard():
    """Of a machine; a robot is in one place."""
    start = time.monotonic()
    for said, heard in ((signal, 3), (joint, 1)):
        feed = hear(iter(lambda: (), None), Said([said(t=start)], [said(t=start)] * 2), Clock())
        assert len([*next(feed), *next(feed)]) == heard


def test_a_live_source_is_refused_where_time_is_not_real():
    with pytest.raises(InputError, match=r"sources\[1\].*real time only.*seerob run"):
        require_recorded(Workstation(folder="", sources=(Source(), Rtde(robot="arm", host="127.0.0.1"))))
    require_recorded(Workstation(folder="", sources=(Source(),)))
