"""The filter is a Butterworth filter of the second order, takes away noise, and says its delay."""

from __future__ import annotations

import numpy as np
import pytest
from made_capture import captured, frames_of, play, source, walking

from seerob.core.samples import BodyPoint
from seerob.description.capture.smoothing import PAUSE, Smoother, group_delay

CUT = 4.0


def point(position=(0.0, 0.0, 0.0), wxyz=None):
    return BodyPoint(name="wrist", bone="right_hand", position=position, wxyz=wxyz)


def filtered(values, times):
    smooth = Smoother()
    return np.array(
        [smooth((point((v, 0.0, 0.0)),), t, CUT)[0].position[0] for v, t in zip(values, times, strict=True)]
    )


@pytest.mark.parametrize("frequency", [0.5, 2.0, CUT, 8.0])
def test_its_gain_is_that_of_the_textbook(frequency):
    t = np.arange(0, 6, 1 / 500)
    out = filtered(0.02 * np.sin(2 * np.pi * frequency * t), t)
    late = out[len(t) // 2 :]
    assert np.abs(late).max() / 0.02 == pytest.approx(1 / np.sqrt(1 + (frequency / CUT) ** 4), rel=0.01)


def test_steady_motion_comes_later_by_what_it_says_and_lost_frames_do_no_harm():
    t = np.delete(np.arange(0, 2, 1 / 60), [50, 51, 52, 80, 81])
    out = filtered(0.5 * t, t)
    assert out[60:] == pytest.approx(0.5 * (t[60:] - group_delay(CUT)), abs=1e-9)


def test_what_leaps_stays_as_it_came_and_spoils_nothing():
    t = np.arange(0, 1, 1 / 60)
    values = np.zeros(len(t))
    values[30] = 4.0
    assert filtered(values, t).tolist() == values.tolist()


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300, -1e7])
def test_what_is_no_place_is_left_as_it_is(value):
    smooth = Smoother()
    for k in range(3):
        hostile = point((value, 0.0, 0.0), (value, 0.0, 0.0, 0.0))
        (out,) = smooth((hostile,), k / 60, CUT)
        assert repr(out) == repr(hostile)


def test_who_comes_back_after_a_pause_begins_anew():
    t = np.array([0.0, 0.02, 0.04 + PAUSE, 0.06 + PAUSE])
    assert filtered([1.0, 1.0, 2.0, 2.0], t).tolist() == [1.0, 1.0, 2.0, 2.0]


def test_a_turn_stays_a_turn_whichever_sign_its_quaternion_has():
    smooth, sign = Smoother(), 1.0
    for k in range(60):
        half, sign = 0.5 * k / 60, -sign
        wxyz = (sign * np.cos(half), 0.0, 0.0, sign * np.sin(half))
        (out,) = smooth((point(None, wxyz),), k / 60, CUT)
        assert sum(v * v for v in out.wxyz) == pytest.approx(1.0)
    angle = 2 * np.arctan(out.wxyz[3] / out.wxyz[0])
    assert angle == pytest.approx(59 / 60 - group_delay(CUT), abs=2e-3)


def test_noise_of_a_centimetre_no_longer_makes_a_person_undecided():
    t, q = walking(0.8)

    def told(**options):
        noise, frames = np.random.default_rng(0), frames_of(t, q, turned=False)
        for frame in frames:
            frame.positions[:] += noise.normal(0, 0.01, frame.positions.shape)
        return np.mean(
            [doubt != "" for at, doubt, *_ in play(source(captured(frames), **options)) if at > 0.1]
        )

    assert told() > 0.5
    assert told(smoothing=6.0) < 0.05


def test_the_samples_stay_raw_and_count_the_delay_as_latency():
    from made_capture import workstation

    from seerob.session.station import Station

    frames = frames_of(*walking(0.5))
    plain, smooth = (
        list(Station(workstation(source(captured(frames), latency=0.01, **more))).sources[0][1].samples)
        for more in ({}, {"smoothing": CUT})
    )
    by_device = {s.t_device: s for s in plain}
    assert len(smooth) > 20
    for sample in smooth:
        assert sample.points == by_device[sample.t_device].points
        assert sample.latency == pytest.approx(0.01 + group_delay(CUT))
        assert sample.t == pytest.approx(by_device[sample.t_device].t - group_delay(CUT))
