"""Labels that exchange their places are told, people who move are not."""

from pathlib import Path

import numpy as np
import pytest
from made_capture import PERSON, captured, frames_of, source, walking

from seerob.description.capture.captured import Exchanges
from seerob.description.humans.skeleton import BONES
from seerob.workstation.source import Target

NAMES = ("a", "b", "c")


def watched(*frames, step=1 / 60):
    found = Exchanges()
    for k, frame in enumerate(frames):
        found.add(k * step, np.array(frame, float).reshape(-1, 3))
    return found


def line(*x):
    return [[value, 0.0, 0.0] for value in x]


def test_two_points_that_change_places_are_told_with_their_instants():
    there, back = line(0.0, 0.24, 1.0), line(0.245, 0.003, 1.0)
    found = watched(there, back, back, there)
    assert found.found == {(0, 1): pytest.approx([1 / 60, 3 / 60])}
    assert "a and b (2 times, first at 0.02 s)" in found.text(NAMES)
    assert "a and b (at 0.02 s)" in watched(there, back).text(NAMES)


@pytest.mark.parametrize(
    "frames",
    [
        (line(0.0, 0.24, 1.0), line(0.24, 0.24, 1.0)),  # one goes where the other stays
        (line(0.0, 0.24, 1.0), line(0.1, 0.34, 1.1)),  # all go together
        (line(0.0, 0.04, 1.0), line(0.04, 0.0, 1.0)),  # neighbours
        (line(0.0, 0.24, 1.0), line(np.nan, np.nan, np.nan), line(0.24, 0.0, 1.0)),
        (line(0.0, 0.24, 1.0), line(0.24, 0.0)),
    ],
)
def test_what_may_be_motion_is_not_told(frames):
    assert watched(*frames).text(NAMES) == ""


def test_after_a_gap_both_may_have_moved():
    assert watched(line(0.0, 0.24, 1.0), line(0.24, 0.0, 1.0), step=0.5).text(NAMES) == ""


def test_a_recording_says_it_when_it_is_opened():
    frames = frames_of(*walking(0.3))
    i, j = BONES.index("right_thigh"), BONES.index("left_thigh")
    target = Target(
        name="operator",
        joints=tuple(j.name for j in PERSON.joints()),
        units=("rad",) * 53,
        lower=(-9.0,) * 53,
        upper=(9.0,) * 53,
        velocity=(None,) * 53,
        description=PERSON,
    )

    def told():
        (*texts,) = (f.text for f in source(captured(frames)).open(Path(), target).findings)
        return [text for text in texts if "exchange their places" in text]

    assert told() == []
    for frame in frames[9:]:
        frame.positions[[i, j]] = frame.positions[[j, i]]
    (text,) = told()
    assert "right_thigh and left_thigh (at 0.15 s)" in text
