"""What is kept of what was heard, and which of it counts at an instant: samples on and beside it."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from seerob.core.samples import REPEATED
from seerob.description.humans.skeleton import BONES
from seerob.twin.validity.hearing import (
    SLACK,
    BonesHeard,
    Heard,
    Hearing,
    Places,
    no_position_reason,
    unobserved_reason,
)


def heard(*instants: float, timeout: float = 0.5) -> Hearing:
    hearing = Hearing(given=False, driven=True, timeout=timeout)
    hearing.heard += [Heard(t, torques=np.array([t])) for t in instants]
    return hearing


def said(**fields: list[Any]) -> list[BonesHeard]:
    """Of 0, 1, 2 and 3 s, with one value of each field at each."""
    return [BonesHeard(float(t), **{name: values[t] for name, values in fields.items()}) for t in range(4)]


@pytest.mark.parametrize(
    ("t", "kept"),
    [
        (-1.0, [0, 1, 2]),
        (0.99, [0, 1, 2]),
        (1.0, [1, 2]),  # of the instant itself nothing older is needed
        (1.5, [1, 2]),
        (2.0, [2]),
        (9.0, [2]),
    ],
)
def test_what_is_older_than_the_last_sample_is_forgotten(t: float, kept: list[float]) -> None:
    hearing = heard(0.0, 1.0, 2.0)
    hearing.bones_heard += [BonesHeard(float(k)) for k in range(3)]
    hearing.forget(t)
    assert [said.t for said in hearing.heard] == kept
    assert [said.t for said in hearing.bones_heard] == kept


def test_a_sample_counts_from_its_instant_on_and_to_the_end_of_the_time_out() -> None:
    hearing = heard(SLACK, timeout=0.5)
    assert hearing.invalid_reason(0.0) == ""
    assert hearing.invalid_reason(-1e-6) == "nothing heard yet"
    hearing = heard(0.0, timeout=0.5)
    last = 0.5 + SLACK
    assert hearing.invalid_reason(last) == ""
    assert "not heard for" in hearing.invalid_reason(np.nextafter(last, 1))


def test_what_is_said_of_bones_counts_between_the_samples_beside_an_instant() -> None:
    hearing = heard(0.0)
    first, last = ("first", ("head",)), ("last", ("pelvis",))
    hearing.bones_heard = said(parts=[(first,), (), (), (last,)])
    expected = {-1.0: (first,), 0.0: (first,), 0.5: (first,), 1.0 - SLACK: (), 1.5: (), 2.5: (last,)}
    for t, doubted in expected.items():
        assert hearing.invalid_parts(t) == doubted, t
    hearing.bones_heard = said(unaimed=[{"head": 0.9}, {"head": 0.1, "left_hand": 0.3}, {"head": 0.2}, {}])
    for t, unaimed in {
        0.5: {"head": 0.9, "left_hand": 0.3},
        1.0 - SLACK: {"head": 0.2, "left_hand": 0.3},
        1.5: {"head": 0.2, "left_hand": 0.3},
        2.5: {"head": 0.2},
        9.0: {},
    }.items():
        assert hearing.unaimed(t) == unaimed, t
    everything = frozenset(BONES)
    blind, armless = everything - {"head"}, everything - {"right_hand"}
    hearing.bones_heard = said(observed=[blind, everything, everything, armless])
    for t, unobserved in {0.5: ("head",), 1.0 - SLACK: (), 1.5: (), 2.5: ("right_hand",)}.items():
        assert hearing.unobserved(t) == unobserved, t


def test_angles_that_nothing_tells_count_between_the_samples_beside_an_instant() -> None:
    hearing = heard(0.0)
    wrist, neck = ("wrist_flexion", 1), ("neck_twist", 0)
    hearing.bones_heard = said(undetermined=[frozenset({wrist}), frozenset(), frozenset(), frozenset({neck})])
    assert hearing.undetermined_angles(0.5) == {wrist}
    assert hearing.undetermined_angles(1.0 - SLACK) == hearing.undetermined_angles(1.5) == frozenset()
    assert hearing.undetermined_angles(2.5) == hearing.undetermined_angles(9.0) == {neck}


def test_a_joint_beyond_which_nothing_is_seen_tells_nothing_of_its_bone() -> None:
    hearing = heard(0.0)
    armless = frozenset(BONES) - {"right_hand"}
    elbow = frozenset({"right_forearm"})
    hearing.bones_heard = said(observed=[armless] * 4, bare=[elbow, frozenset(), frozenset(), elbow])
    found = {t: "right_forearm" in hearing.unobserved(t) for t in (0.5, 1.0 - SLACK, 1.5, 2.5)}
    assert found == {0.5: True, 1.0 - SLACK: False, 1.5: False, 2.5: True}


def doubted(*samples: tuple[float, str], timeout: float = 9.0) -> Hearing:
    """Heard at some instants, each with why that may not be relied on."""
    hearing = Hearing(given=False, driven=True, timeout=timeout)
    hearing.heard += [Heard(t, reason) for t, reason in samples]
    return hearing


def test_what_may_be_older_counts_as_age_and_the_last_reason_is_told_with_it() -> None:
    hearing = doubted((0.0, "first"), (0.125, "last"), timeout=0.5)
    hearing.older = 0.25
    assert hearing.invalid_reason(0.37) == "last"
    assert hearing.invalid_reason(0.38) == "not heard for 0.51 s (time-out 0.5 s): last"


def test_a_silence_longer_than_the_time_out_is_one_from_its_begin_on() -> None:
    longest = 0.5 + SLACK
    assert heard(0.0, longest).invalid_reason(0.25) == ""
    silent = heard(0.0, float(np.nextafter(longest, 1)))
    assert silent.invalid_reason(SLACK) == ""
    for t in (float(np.nextafter(SLACK, 1)), 0.25):
        assert silent.invalid_reason(t) == "not heard for 0.50 s from 0.000 s on (time-out 0.5 s)"


def test_what_ends_in_motion_is_in_doubt_once_nothing_follows_and_its_grace_is_over() -> None:
    hearing = heard(0.0)
    hearing.leaves_at, hearing.grace = 0.0101, 0.1
    assert hearing.invalid_reason(0.1 + SLACK) == ""
    assert "ends in motion, with 0.0101 rad/s or m/s" in hearing.invalid_reason(np.nextafter(0.1 + SLACK, 1))
    hearing.leaves_at = 0.01
    assert hearing.invalid_reason(0.4) == ""
    followed = heard(0.0, 0.45)
    followed.leaves_at = 1.0
    assert followed.invalid_reason(0.4) == ""


def test_who_falls_behind_takes_back_all_that_lies_ahead_and_nothing_after_it() -> None:
    again = 1.0 + REPEATED / 2
    assert doubted((0.0, ""), (1.0, ""), (again, "late")).invalid_reason(0.5) == "late"
    assert doubted((0.0, ""), (1.0, ""), (again, "late"), (2.0, "")).invalid_reason(0.5) == "late"
    assert doubted((0.0, ""), (1.0, ""), (again, ""), (2.0, "late")).invalid_reason(0.5) == ""
    assert doubted((0.0, ""), (1.0, ""), (2.0, "late")).invalid_reason(0.5) == ""
    assert doubted((0.0, ""), (1.0, ""), (2.0, "late")).invalid_reason(1.5) == "late"
    assert doubted((0.0, "late"), (1.0, ""), (2.0, "")).invalid_reason(1.5) == ""
    assert doubted((-1.0, ""), (0.0, ""), (REPEATED, "late")).invalid_reason(-0.5) == ""


@pytest.mark.parametrize(("last", "kept"), [(1.0, ["late"] * 2), (0.0, ["", "late"])])
def test_what_is_said_again_with_a_doubt_takes_back_what_was_said(last: float, kept: list[str]) -> None:
    hearing = doubted((last, ""))
    hearing.take(Heard(last + (REPEATED if last == 0.0 else REPEATED / 2), "late"))
    assert [each.reason for each in hearing.heard] == kept
    hearing.take(Heard(hearing.heard[-1].t, "again"))
    assert [each.reason for each in hearing.heard] == ["late" if kept[0] else "again", "late", "again"]
    hearing.take(Heard(hearing.heard[-1].t))
    assert [each.reason for each in hearing.heard][1:] == ["late", "again", ""]


def test_what_is_heard_ahead_is_known_to_the_end_of_the_span_and_not_beside_it() -> None:
    def why(samples: list[tuple[float, str]], t: float, until: float, leaves: float = 0.0) -> str:
        hearing = doubted(*samples, timeout=0.5)
        hearing.leaves_at = leaves
        return hearing.invalid_ahead_reason(t, until)

    assert why([(-0.4, ""), (SLACK, "late"), (0.4, "")], 0.0, 0.3) == ""
    assert why([(-0.4, ""), (float(np.nextafter(SLACK, 1)), "late")], 0.0, 0.3) == "late"
    assert why([(-SLACK, ""), (0.4, "late")], -0.2, 0.0) == ""
    assert why([(-2 * SLACK, ""), (0.4, "late")], -0.2, 0.0) == "late"
    assert why([(0.0, ""), (0.5 + SLACK, "")], 0.1, 0.2) == ""
    assert why([(1.0, ""), (1.4, "")], 1.1, 1.2) == ""
    assert why([(0.0, ""), (0.51, "")], 0.1, 0.2) == "nothing is heard from 0.000 s to 0.510 s"
    assert why([(0.0, "")], -0.1, SLACK, leaves=1.0) == ""
    assert why([(0.0, "")], -0.1, 0.1, leaves=0.01) == ""
    for leaves in (0.0101, 1.0):
        assert why([(0.0, "")], -0.1, 2 * SLACK, leaves).startswith("its motion ends at 0.000 s")
    assert why([], 0.0, 1.0, leaves=1.0) != ""


def test_speeds_are_off_by_the_worse_of_both_samples_and_by_what_the_twin_is_unlike_them() -> None:
    hearing = Hearing(given=False, driven=True)
    assert hearing.speed_error(0.5) is None
    hearing.unlike = np.array([4.0, 1.0])
    assert hearing.speed_error(0.5) is hearing.unlike
    hearing.heard = [
        Heard(0.0, speed_error=np.array([9.0, 9.0])),
        Heard(1.0, speed_error=np.array([1.0, 2.0])),
        Heard(2.0, speed_error=np.array([2.0, 1.0])),
        Heard(3.0),
    ]
    for t, expected in ((1.5, [6.0, 3.0]), (2.5, [6.0, 2.0]), (0.5, [13.0, 10.0]), (9.0, [4.0, 1.0])):
        assert np.array_equal(hearing.speed_error(t), expected), t
    hearing.unlike = None
    assert np.array_equal(hearing.speed_error(1.5), [2.0, 2.0])
    assert hearing.speed_error(9.0) is None


def test_a_copy_is_equal_and_changes_nothing_that_is_known() -> None:
    for moved in (False, True):
        hearing = heard(0.0)
        if moved:
            hearing.captured, hearing.captured_v = np.zeros(2), np.ones(2)
        copy = hearing.copied()
        assert (copy.captured is None) is (copy.captured_v is None) is (not moved)
        if copy.captured is not None and copy.captured_v is not None:
            assert [copy.captured.tolist(), copy.captured_v.tolist()] == [[0.0, 0.0], [1.0, 1.0]]
            copy.captured[:] = copy.captured_v[:] = 5.0
            assert [hearing.captured.tolist(), hearing.captured_v.tolist()] == [[0.0, 0.0], [1.0, 1.0]]


def test_where_bones_are_left_open_is_the_most_of_both_samples() -> None:
    hearing, head, hand = heard(0.0), frozenset({"head"}), frozenset({"left_hand"})
    none = frozenset[str]()
    hearing.bones_heard = said(
        places=[Places(head, none, {"head": 0.2}), Places(hand, hand, {"head": 0.1, "left_hand": 0.3})]
        + [Places(none, none, {"head": 0.5})] * 2
    )
    assert [hearing.unplaced(t) for t in (0.5, 1.5, 2.5)] == [("head", "left_hand"), ("left_hand",), ()]
    assert hearing.displaced(0.5) == hearing.displaced(1.5) == no_position_reason(("left_hand",))
    assert hearing.displaced(2.5) == ""
    assert hearing.slack(0.5) == {"head": 0.2, "left_hand": 0.3}
    assert hearing.slack(1.5) == {"head": 0.5, "left_hand": 0.3}


def test_as_many_bones_are_named_as_one_reads() -> None:
    six, seven = BONES[:6], BONES[:7]
    assert (unobserved_reason("op", ()), no_position_reason(())) == ("", "")
    assert unobserved_reason("op", six) == "op: no device sees " + ", ".join(six)
    assert unobserved_reason("op", BONES[:8]).endswith(", ".join(six) + " and 2 more")
    assert no_position_reason(six[:1]) == f"no device says where {six[0]} is, only how bones are turned"
    assert no_position_reason(six) == f"no device says where {', '.join(six)} are, only how bones are turned"
    assert f"{six[-1]} and 1 more are" in no_position_reason(seven)
    assert no_position_reason(BONES).startswith("no device says where the person is, only")


@pytest.mark.parametrize("seed", range(40))
def test_any_stream_is_in_doubt_where_one_of_its_samples_or_silences_is(seed: int) -> None:
    """What is said of whole streams is what each of their samples says, looked at one by one."""
    rng = np.random.default_rng(seed)
    steps = rng.choice([REPEATED / 2, 0.01, 0.1, 0.3], size=12, p=[0.1, 0.6, 0.2, 0.1])
    times = np.cumsum(steps).tolist()
    spoiled = rng.random(len(times)) < rng.choice([0.0, 0.2])
    hearing = Hearing(given=False, driven=True, timeout=0.2, leaves_at=1.0)
    hearing.heard = [Heard(t, f"bad at {t}" * bool(bad)) for t, bad in zip(times, spoiled, strict=True)]
    told = hearing.heard
    instants = [
        *times,
        *(a + share * (b - a) for a, b in pairwise([0.0, *times, 9.0]) for share in (0.3, 0.5)),
    ]
    for t in instants:
        past = [h for h in told if h.t <= t + SLACK]
        assert hearing.around(t) == [*past[-1:], *told[len(past) : len(past) + 1]]
        repeated = [k for k in range(1, len(told)) if told[k].t - told[k - 1].t < REPEATED]
        last = max([len(past), *(k for k in repeated if k > len(past))])
        reasons = [h.reason for h in told[max(len(past) - 1, 0) : last + 1] if h.reason]
        found = hearing.invalid_reason(t)
        if past and not ("not heard" in found or "ends in motion" in found):
            assert found == next(iter(reasons), "")
        for until in (t + 0.05, t + 1.0):
            pairs = [(a, b) for a, b in pairwise(told) if t + SLACK < b.t and a.t < until - SLACK]
            doubts = [b.reason or "nothing is heard" for a, b in pairs if b.reason or b.t - a.t > 0.2 + SLACK]
            ends = ["its motion ends"] if told[-1].t < until - SLACK else []
            assert hearing.invalid_ahead_reason(t, until).startswith(next(iter([*doubts, *ends]), ""))
            assert bool(hearing.invalid_ahead_reason(t, until)) == bool(doubts or ends)
