"""A tracker that says one value again and again is not heard, unless it never had any noise."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import RATE, captured, frames_of, play, source, walking

from seerob.core.samples import BodyPoint
from seerob.description.capture.frozen import Frozen
from seerob.description.humans.skeleton import BONES

HAND, FOOT = BONES.index("right_hand"), BONES.index("left_foot")


def noisy(seconds=1.5, size=2e-4, seed=0):
    random = np.random.default_rng(seed)
    frames = frames_of(*walking(seconds), turned=False)
    for frame in frames:
        frame.positions[:] += random.normal(size=frame.positions.shape) * size
    return frames


def frozen(frames, rows, begin):
    for frame in frames[begin:]:
        frame.positions[rows] = frames[begin].positions[rows]
    return frames


def doubts(frames):
    return [(t, doubt) for t, doubt, *_ in play(source(captured(frames)), engine={"physics": False}) if doubt]


def test_a_tracker_that_freezes_while_others_move_is_lost():
    told = doubts(frozen(noisy(), [HAND], 50))
    assert told[0][0] == pytest.approx(50 / RATE + 0.2, abs=0.03)
    assert all("right_hand" in doubt for _, doubt in told)
    assert any("frozen" in doubt for _, doubt in told)


def test_frames_that_are_sent_again_with_new_stamps_are_silence():
    told = doubts(frozen(noisy(), slice(None), 50))
    assert 50 / RATE - 0.02 < told[0][0] < 50 / RATE + 0.22
    assert len(told) > 100 * (1.5 - 50 / RATE - 0.25)


def test_made_motions_and_rounded_ones_may_stand_still():
    assert doubts(frozen(frames_of(*walking(1.2), turned=False), [FOOT], 70)) == []
    rounded = noisy(1.2)
    for frame in rounded:
        frame.positions[:] = frame.positions.round(3)
    still = [frame.positions[FOOT].copy() for frame in rounded]
    assert len({tuple(place) for place in still}) < len(still)
    assert doubts(rounded) == []


@pytest.mark.parametrize("turned", [False, True])
def test_places_and_directions_freeze_apart(turned):
    random = np.random.default_rng(1)
    watch = Frozen()
    for k in range(80):
        place = tuple(1e-4 * random.normal(size=3)) if (not turned and k < 50) or turned else (1.0, 2.0, 3.0)
        axis = 1e-4 * random.normal(size=3) if (turned and k < 50) or not turned else (0.1, 0.2, 0.3)
        point = BodyPoint(name="a", bone="head", position=place, wxyz=(1.0, *axis))
        (found,) = watch((point,))
    assert (found.position is None, found.wxyz is None) == (not turned, turned)
