"""What one device says, looked at sample by sample where it is heard: no newer one hides what was wrong."""

from __future__ import annotations

import asyncio
import math
import time

import numpy as np
import pytest

from live_story import listening, wait_for
from seerob.app.emulation.motions import swing
from seerob.app.emulators.rtde import RtdeServer
from seerob.core.samples import BodyPoint, BodySample, JointSample, PoseSample, Quality
from seerob.devices.live.contradictions import SPAN, Contradictions
from seerob.devices.live.device_clock import HOLD
from seerob.devices.live.listening import LiveSource
from seerob.devices.sources.rtde import Rtde
from seerob.workstation.source import Target

HOME = (0.0, -1.2, 1.4, -1.5, -1.5, 0.0)
ARM = Target(name="arm", joints=tuple("abcdef"), units=("rad",) * 6, velocity=(3.2,) * 6)


def said(t, q, qd=None, device=True):
    return JointSample(source="", seq=0, target="arm", t=t, t_device=t if device else None, q=q, qd=qd)


def found(samples, target=ARM):
    looking = Contradictions(target)
    return [looking.find(sample) for sample in samples]


def sine(t, speed, hertz=0.5):
    a = speed / (2 * math.pi * hertz)
    return a * math.sin(2 * math.pi * hertz * t), speed * math.cos(2 * math.pi * hertz * t)


@pytest.mark.parametrize("rate", [10, 50, 125, 500])
@pytest.mark.parametrize("speed", [0.0, 0.05, 1.0, 3.0])
@pytest.mark.parametrize("lag", [0.0, 0.02])
def test_what_a_controller_measures_is_no_contradiction(rate, speed, lag):
    """Noise of encoders and of velocities, a filter that delays these, and any rate."""
    chance = np.random.default_rng(4)
    motion = [
        said(
            k / rate,
            (sine(k / rate, speed)[0] + chance.normal(0, 2e-5),),
            (sine(k / rate - lag, speed)[1] + chance.normal(0, 5e-3),),
        )
        for k in range(4 * rate)
    ]
    assert not any(found(motion))


@pytest.mark.parametrize(
    ("q", "qd", "speed"),
    [
        (q, qd, speed)
        for speed in (0.03, 0.3, 1.5)
        for q, qd in ((0, 1), (1, 0), (1, -1), (1, 0.5), (math.radians(1), 1))
        if abs(q - qd) * speed > 0.02  # what differs by less may be noise
    ],
)
def test_positions_and_velocities_that_are_no_one_motion_are_found_before_much_has_happened(q, qd, speed):
    """Each standing while the other runs, another sign, another unit: what is not found yet is small."""
    hidden, looking = 0.0, Contradictions(ARM)
    for k in range(500):
        t = 0.008 * k
        if looking.find(said(t, (q * speed * t,), (qd * speed,))):
            break
        hidden = abs(q - qd) * speed * t
    assert k < 499
    assert hidden < 0.01 + 0.3 * speed * 0.2
    assert t < SPAN


def test_a_joint_that_stands_at_once_is_found_also_while_another_one_is_in_doubt():
    motion = []
    for k in range(200):
        t = 0.01 * k
        moved = 0.5 * min(t, 1.0) + 1e-5 * math.sin(700 * min(t, 1.0))
        doubtful = 0.3 if 0.9 < t < 1.1 else 0.0
        motion.append(said(t, (0.2, moved), (doubtful, 0.5 * (t < 1.0))))
    why = found(motion)
    assert "joint 1" in why[105]
    assert all("joint 2 stands" in each for each in why[160:])


def test_a_step_farther_than_anybody_goes_is_found_also_without_velocities_and_time():
    for device in (True, False):
        motion = [said(0.01 * k, (0.1 if k != 5 else 0.9,), device=device) for k in range(10)]
        wrong = [k for k, why in enumerate(found(motion)) if why]
        assert wrong == [5, 6]
    burst = [said(0.05 * (k // 5) + 1e-4 * (k % 5), (0.01 * k,), device=False) for k in range(50)]
    assert not any(found(burst))


def test_a_tool_and_a_person_that_are_elsewhere_at_once():
    poses = [
        PoseSample(
            source="", seq=0, target="cart", t=0.01 * k, position=(float(k == 3), 0, 0), wxyz=(1, 0, 0, 0)
        )
        for k in range(6)
    ]
    assert [k for k, why in enumerate(found(poses)) if why] == [3, 4]
    people = [
        BodySample(
            source="",
            seq=0,
            target="operator",
            t=0.03 * k,
            points=tuple(
                BodyPoint(name=str(j), bone="hip", position=(0.1 * j + 2 * (k % 2 and k > 3), 0, 0))
                for j in range(5)
            ),
        )
        for k in range(8)
    ]
    assert [k for k, why in enumerate(found(people)) if why] == [5, 6, 7]


@pytest.mark.parametrize("frozen", ["q", "qd"])
def test_a_controller_whose_positions_stand_while_its_velocities_run_or_the_other_way_round(frozen):
    """Over a real socket; the doubt stays as long as it is so, and is told in words."""
    honest = swing(HOME)

    def motion(t):
        q, qd = honest(t)
        return (HOME, qd) if frozen == "q" else (q, (0.0,) * 6)

    with (
        RtdeServer(motion) as server,
        listening(Rtde(robot="arm", host=server.host, port=server.port), ARM) as heard,
    ):
        joints = lambda: [s for s in list(heard) if isinstance(s, JointSample)]  # noqa: E731
        wait_for(lambda: len(joints()) > 150)
        samples = joints()
    # Of a busy machine the clock may be found first.
    first = next(k for k, s in enumerate(samples) if "velocity" in s.reason)
    assert samples[first].quality is Quality.DEGRADED
    word = "is not zero while the joint stands still" if frozen == "q" else "is zero while the joint moves"
    assert word in samples[first].reason
    assert all(s.reason for s in samples[first:])
    then, now = (honest(samples[k].t_device)[0] for k in (0, first))
    assert max(abs(a - b) for a, b in zip(then, now, strict=True)) < 0.05


class Two(LiveSource, frozen=True, kw_only=True):
    """Two senders of one robot at one port: the second one's packets follow upon the first one's."""

    def target(self):
        return "arm"

    def period(self):
        return 0.008

    async def listen(self, target):
        begun = time.monotonic()
        for k in range(100):
            t = time.monotonic()
            other = 30 <= k < 40
            if other:
                yield JointSample(source="", seq=0, target="arm", t=t, t_device=t - begun - 1e-3, q=(1.0,))
            yield JointSample(source="", seq=0, target="arm", t=t, t_device=t - begun, q=(0.0,))
            await asyncio.sleep(0.004)
        await asyncio.sleep(60)


def test_of_two_senders_the_newer_one_does_not_hide_the_other():
    """A run that takes one sample per tick takes one of the same sender every time."""
    with listening(Two(name="two"), Target(name="arm", joints=("a",), units=("rad",))) as heard:
        wait_for(lambda: len(heard) >= 110)
    newest = [s for s in heard if s.q == (0.0,)]
    doubted = [s for s in newest if s.reason]
    assert "went 1 rad" in doubted[0].reason
    assert doubted[-1].t - doubted[0].t == pytest.approx(HOLD + 0.04, abs=0.45)
    assert not any(s.reason for s in newest[:30])
