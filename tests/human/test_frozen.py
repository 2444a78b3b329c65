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


@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3])
def test_a_body_that_walks_and_stands_in_one_step_is_a_picture_that_hangs(noise):
    """Without any noise, as made motions have none, and with noise that somebody adds to what hangs."""
    random, begin = np.random.default_rng(2), 50
    frames = frozen(frames_of(*walking(1.5), turned=False), slice(None), begin)
    for frame in frames[begin:] if noise else ():
        frame.positions[:] += noise * random.normal(size=frame.positions.shape)
    told = doubts(frames)
    assert told[0][0] < begin / RATE + 0.12
    assert len(told) > 100 * (1.48 - begin / RATE - 0.12)


def test_who_slows_down_as_a_person_does_stands():
    """From 1 m/s in 0.3 s, and somebody who is moved elsewhere in one step and stands there."""
    t = np.arange(60) / RATE
    slow = np.clip((0.8 - t) / 0.3, 0, 1)
    for way in (np.cumsum(slow * slow * (3 - 2 * slow)) / RATE, np.where(t < 0.5, 0.0, 0.5)):
        watch = Frozen()
        for k, x in enumerate(way):
            points = [BodyPoint(name=b, bone=b, position=(x, 0.1 * i, 1.0)) for i, b in enumerate(BONES)]
            assert all(point.position for point in watch(tuple(points), t[k]))


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
        (found,) = watch((point,), k / RATE)
    assert (found.position is None, found.wxyz is None) == (not turned, turned)


@pytest.mark.parametrize("together", [1, 5, 64])
@pytest.mark.parametrize("live", [False, True])
def test_what_is_frozen_is_the_same_however_many_samples_are_counted_in_one_go(together, live, monkeypatch):
    def found():
        random, watch, out = np.random.default_rng(3), Frozen(live=live), []
        place = random.normal(size=(6, 3))
        for k in range(400):
            moves = random.random((6, 1)) > 0.3 * (k % 90 > 70)
            place = place + moves * np.round(1e-3 * random.normal(size=(6, 3)), 4)
            points = [
                BodyPoint(name=b, bone=b, position=tuple(p.tolist()) if random.random() > 0.02 else None)
                for b, p in zip(BONES, place, strict=False)
            ]
            watch(tuple(points), k / RATE)
            out.append(sorted(watch.bones))
        return out

    usual = found()
    monkeypatch.setattr("seerob.description.capture.frozen.TOGETHER", together)
    assert found() == usual
    assert any(usual)
    assert not all(usual)
