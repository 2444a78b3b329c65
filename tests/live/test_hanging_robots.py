"""A robot whose controller hangs on its last sample under new stamps, over each real wire."""

from __future__ import annotations

import time

import pytest

from live_story import listening, wait_for
from seerob.app.emulation.motions import swing
from seerob.core.samples import JointSample
from soak import device_kinds

LATE = 0.25
"""What a busy machine may add [s]."""


class Hangs:
    """A motion that stands from when it is told to, with its velocities as they were or zero.

    Args:
        motion: As the emulator plays it.
        rates: Whether velocities go on.
    """

    def __init__(self, motion, rates):
        self.motion, self.rates, self.hangs, self.last = motion, rates, False, None

    def __call__(self, t):
        if self.hangs and self.last is not None:
            q, qd = self.last
            return q, qd if self.rates else (0.0,) * len(qd)
        self.last = self.motion(t)
        return self.last


@pytest.mark.parametrize(
    ("kind", "rates"),
    [
        ("rtde", True),
        ("rtde", False),
        ("fri", False),
        ("egm", False),
        ("drfl", True),
        ("dobot", True),
        ("modbus_robot", True),
        ("rosbridge", True),
    ],
)
def test_a_controller_that_hangs_on_its_last_sample_is_not_relied_on(kind, rates, monkeypatch):
    """From 0.2 rad/s; where a controller sends no time of its own, by its velocities alone."""
    motions = []

    def played(home):
        motions.append(Hangs(swing(home), rates))
        return motions[-1]

    monkeypatch.setattr(device_kinds, "swing", played)
    found = getattr(device_kinds, kind)(monkeypatch)
    source = found.source
    try:
        with listening(source, found.target) as heard:
            joints = lambda: [s for s in list(heard) if isinstance(s, JointSample)]  # noqa: E731
            wait_for(lambda: len(joints()) > 60)
            motions[0].hangs, begun = True, time.monotonic()
            told = lambda: [s for s in joints() if s.t > begun + source.timeout + LATE]  # noqa: E731
            # A busy machine asks a PLC less often.
            wait_for(lambda: len(told()) > 5 and any("stands" in s.reason for s in told()))
    finally:
        found.server.stop()
    assert all(s.reason for s in told())
