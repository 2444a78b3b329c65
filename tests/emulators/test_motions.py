"""What an emulated robot plays."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.app.emulation.motions import played, swing


def speeds_are_derivatives(motion, times):
    h = 1e-6
    for t in times:
        slope = (np.array(motion(t + h)[0]) - motion(t - h)[0]) / (2 * h)
        np.testing.assert_allclose(motion(t)[1], slope, atol=1e-6)


def test_a_swing_is_smooth_and_stays_about_home():
    home = (0.0, -1.2, 1.4)
    speeds_are_derivatives(swing(home), np.linspace(0, 20, 41))
    assert max(np.abs(np.array(swing(home)(t)[0]) - home).max() for t in np.linspace(0, 20, 400)) <= 0.25


T = np.linspace(0, 2, 21).tolist()


def wave(*, closed):
    omega = np.pi if closed else 1.0
    q = [(float(np.sin(omega * t)), float(np.cos(omega * t))) for t in T]
    qd = [(float(omega * np.cos(omega * t)), float(-omega * np.sin(omega * t))) for t in T]
    return played(T, q, qd), q, qd


@pytest.mark.parametrize("closed", [True, False])
def test_a_played_motion_goes_through_its_samples(closed):
    motion, q, qd = wave(closed=closed)
    for t, position, speed in list(zip(T, q, qd, strict=True))[:-1]:
        np.testing.assert_allclose(motion(t), (position, speed), atol=1e-12)
    speeds_are_derivatives(motion, np.linspace(0.03, 1.97, 30))


def test_ends_that_meet_are_played_round_and_round_and_others_stand_still():
    motion, q, _ = wave(closed=True)
    np.testing.assert_allclose(motion(20.7), motion(0.7), atol=1e-12)
    motion, q, _ = wave(closed=False)
    assert motion(50.0) == (q[-1], (0.0, 0.0))


def test_who_keeps_step_stands_at_the_end_until_the_next_round():
    """Where the round is longer than the motion: one that began again would jump when the round does."""
    _, q, qd = wave(closed=True)
    motion = played(T, q, qd, once=True)
    np.testing.assert_allclose(motion(0.7), played(T, q, qd)(0.7))
    assert motion(T[-1] + 0.3) == (q[-1], (0.0, 0.0))
