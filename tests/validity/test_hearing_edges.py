"""What is kept of what was heard, and which of it counts at an instant: samples on and beside it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from seerob.description.humans.skeleton import BONES
from seerob.twin.validity.hearing import SLACK, BonesHeard, Heard, Hearing


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
