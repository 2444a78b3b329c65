"""Between devices that are offset a person never jumps, and what a device really sees is what counts."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import PERSON

from seerob.core.samples import BodyPoint, BodySample
from seerob.description.capture.following import Following
from seerob.description.capture.handover import AGAIN, FADE
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses

RATE = 30.0
OFFSET = np.array([0.06, -0.05, 0.04])
HAND = BONES.index("right_hand")
R0, P0 = bone_poses(PERSON, posture(PERSON, "standing"))


def sample(name, seq, weight, shift, *, blind=False, speed=0.3):
    """What a device says of a person who walks ahead."""
    t = seq / RATE
    points = tuple(
        BodyPoint(
            name=bone,
            bone=bone,
            position=None
            if blind and bone == "right_hand"
            else tuple((P0[i] + (speed * t, 0, 0) + shift).tolist()),
            position_weight=weight,
        )
        for i, bone in enumerate(BONES)
    )
    return BodySample(source=name, target="p", seq=seq, t=t, points=points)


def followed(blind, count=60):
    """Right hand beside the walk (n, 3) and postures; the good device is blind at times."""
    following = Following(PERSON, np.eye(4))
    found = []
    for k in range(count):
        following.hear(sample("good", k, 1.0, np.zeros(3), blind=k in blind))
        following.hear(sample("poor", k, 0.3, OFFSET))
        found += list(following.until((k - 0.5) / RATE))
    hands = np.array([bone_poses(PERSON, f.q)[1][HAND] - (0.3 * f.t, 0, 0) for f in found])
    return hands, found


def test_a_frame_that_one_device_loses_moves_nothing():
    hands, found = followed({30})
    still, _ = followed(set())
    assert np.linalg.norm(hands - still[: len(hands)], axis=1).max() < 0.02
    step = np.linalg.norm(np.diff(hands[10:], axis=0), axis=1)
    assert step.max() * RATE < 0.6  # beside the walk; the offset in one frame would be 2.6 m/s
    assert all(not f.reason for f in found)


def test_a_device_that_stays_away_is_left_smoothly_and_gets_the_bone_back_after_a_while():
    lost = range(20, 50)
    hands, found = followed(set(lost), count=110)
    step = np.linalg.norm(np.diff(hands[10:], axis=0), axis=1)
    assert step.max() * RATE < 0.9
    there = round((20 + RATE * 2 * FADE) + 3)
    assert hands[there] - hands[15] == pytest.approx(OFFSET, abs=0.03)
    back = round(50 + RATE * (AGAIN + 2 * FADE)) + 3
    assert np.linalg.norm(hands[back:] - hands[15], axis=1).max() < 0.01
    # Seen again for less than that, the good device does not have the hand yet.
    early = next(f for f in found if f.t > (50 + RATE * AGAIN * 0.6) / RATE)
    row = early.seen.names.index("right_hand")
    assert early.seen.position[row] - P0[HAND] - (0.3 * early.t, 0, 0) == pytest.approx(OFFSET, abs=1e-9)


def test_a_device_that_flickers_does_not_drag_the_hand_about():
    hands, _ = followed(set(range(20, 60, 2)))
    step = np.linalg.norm(np.diff(hands[10:], axis=0), axis=1)
    assert step.max() * RATE < 0.9
