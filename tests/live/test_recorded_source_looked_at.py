"""A recorded source, sample by sample: from where on it is in doubt, why, and for how long."""

from __future__ import annotations

import math
import re

import pytest
from made_samples import last, pose, said
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.core.samples import JointSample, Quality, SignalSample
from seerob.devices.live.contradictions import HOLD, LookedAt, looked_at
from seerob.workstation.source import Opened, Target


def looked(samples, target=None, name="mine"):
    """Each sample with why it is in doubt."""
    return [(sample.quality, sample.reason) for sample in LookedAt(samples, name, target)]


def doubts(samples, target=None):
    """Of each sample whether it is in doubt."""
    found = looked(samples, target)
    assert all((quality is Quality.DEGRADED) is bool(reason) for quality, reason in found)
    return [bool(reason) for _, reason in found]


def sample(t, q=0.0, device=None, target="arm", **more):
    return JointSample(source="", seq=0, target=target, t=t, t_device=device, q=(q,), **more)


def test_a_recorded_source_whose_time_goes_on_is_in_no_doubt():
    assert doubts([]) == []
    assert doubts([sample(0.1 * k, 0.01 * k) for k in range(9)]) == [False] * 9
    assert doubts([sample(0.1 * k, 0.01 * k, 50 + 0.1 * k) for k in range(9)]) == [False] * 9
    signals = [SignalSample(source="", seq=0, t=t, values={"a": 1.0}) for t in (0.0, 0.0, 0.1, 0.1, 0.2)]
    assert doubts(signals) == [False] * 5


@pytest.mark.parametrize("late", [0.0, 0.2, 0.3, math.inf])
def test_from_where_time_does_not_go_on_a_recorded_source_is_in_doubt_for_good(late):
    """The sample before it too, of the same target; those of another are not."""
    times = (0.0, 0.1, 0.2, 0.3, late, 0.4, 0.5, 9.0)
    found = looked([sample(t) for t in times])
    assert [bool(reason) for _, reason in found] == [False] * 3 + [True] * 4
    assert found[3] == (Quality.DEGRADED, f"mine: time goes from 0.300 to {late:.3f} s")
    other = [sample(0.25 + k, target="other") for k in range(2)]
    assert doubts([sample(0.2), sample(0.3), other[0], sample(late), sample(0.4), other[1]]) == [
        False, False, False, True, False,
    ]  # fmt: skip


@pytest.mark.parametrize("device", [50.3, 50.2, 50.0, math.inf, math.nan])
def test_a_recorded_source_whose_own_time_does_not_go_on_is_in_doubt_for_a_while(device):
    step = HOLD / 4
    at = [50.0, 50.1, 50.2, 50.3, device, *(50.4 + 0.1 * k for k in range(8))]
    samples = [sample(step * k, 0.0, d) for k, d in enumerate(at)]
    found = doubts(samples)
    assert found[:4] == [False] * 4
    assert found[4:9] == [True] * 5
    assert not any(found[10:])


def test_a_recorded_source_is_looked_at_by_its_own_time_and_may_stop_dead():
    """Its own time is the device's, where it has one; a motion that was planned brakes as it likes."""
    assert doubts([sample(0.0), sample(0.01, 0.5)]) == [False, True]
    assert doubts([sample(0.0, 0.0, 50.0), sample(0.1, 0.5, 50.01)]) == [False, True]
    places = (0.0, 0.003, 0.00593, *[0.00593] * 6)
    assert last([said(0.01 * k, (q,)) for k, q in enumerate(places)])
    assert not any(doubts([sample(0.01 * k, q) for k, q in enumerate(places)]))
    # What it contradicts later ends no doubt about its time.
    rows = ((0.0, 0.0), (0.1, 0.0), (0.05, 0.0), (0.2, 99.0), (0.3, 99.0), (99.0, 99.0))
    assert doubts([sample(t, q) for t, q in rows]) == [False, True, True, True, True]


def test_what_a_recorded_source_contradicts_holds_for_a_while_and_no_longer():
    step = HOLD / 4
    samples = [sample(step * k, 0.0 if k < 4 else 3.0 + 90 * HOLD) for k in range(14)]
    assert doubts(samples) == [False] * 4 + [True] * 5 + [False] * 5
    # One that keeps its own doubts keeps its words.
    samples[5] = replace(samples[5], reason="own")
    assert looked(samples)[5] == (Quality.DEGRADED, "own")
    samples[5] = replace(samples[5], quality=Quality.INVALID)
    assert looked(samples)[5][0] is Quality.INVALID


@pytest.mark.parametrize(
    ("q", "told"), [(-1.1, False), (-1.11, True), (1.6, False), (1.61, True), (0.0, False)]
)
def test_a_joint_of_a_recorded_source_lies_within_its_limits_and_a_tenth(q, told):
    target = Target(name="arm", joints=("a",), units=("rad",), lower=(-1.0,), upper=(1.5,))
    assert doubts([sample(0.0, q)], target) == [told]
    assert doubts([sample(0.0, q, target="other")], target) == [False]
    assert doubts([sample(0.0, q)]) == [False]
    assert doubts([pose(0.0, (q, 0, 0))], target) == [False]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (3, "it yields int"),
        (sample("0"), "t is '0'"),
        (sample(0.0, quality="good"), "quality 'good'"),
        (replace(sample(0.0), q=None), "q is None"),
        (replace(sample(0.0), q=[0.1]), "q is [0.1]"),
        (replace(sample(0.0), q=(0.1, "a")), "q is (0.1, 'a')"),
        (replace(sample(0.0), qd=[0.1]), "qd is [0.1]"),
        (replace(sample(0.0), tau=("a",)), "tau is ('a',)"),
    ],
)
def test_what_is_no_sample_ends_the_run_with_words(wrong, words):
    with pytest.raises(InputError, match=re.escape(words)):
        looked([wrong])


@pytest.mark.parametrize(
    ("before", "when"), [([], "before its first sample"), ([sample(0.5)], "after its sample of 0.500 s")]
)
def test_a_recorded_source_that_fails_says_when(before, when):
    def failing(error):
        yield from before
        raise error

    with pytest.raises(InputError, match=f"it fails {when}: ZeroDivisionError: own"):
        looked(failing(ZeroDivisionError("own")))
    with pytest.raises(OSError, match="disk"):
        looked(failing(OSError("disk")))


@pytest.mark.parametrize("duration", [0.0, 0.5, 9.0])
def test_what_a_source_opens_is_looked_at(duration):
    opened = looked_at(Opened(samples=[sample(0.0)], duration=duration), "mine", None)
    assert isinstance(opened.samples, LookedAt)
    for wrong in (-1e-9, math.inf, math.nan):
        with pytest.raises(InputError, match=f"the duration is {wrong} s"):
            looked_at(Opened(samples=[], duration=wrong), "mine", None)
    with pytest.raises(InputError, match="open returns list"):
        looked_at([sample(0.0)], "mine", None)
