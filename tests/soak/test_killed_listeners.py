"""The process in which a source listens, killed again and again: always heard again, nothing left behind."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading

import pytest

from live_story import open_files, wait_for
from scripted_sources import Scripted
from seerob.core.samples import JointSample, SignalSample
from seerob.devices.live.receivers import Receivers
from soak.test_live_sources import KILLS, SPARE, load

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


class Lines(logging.Filter):
    """Counts what is said of ends and returns, and hands nothing on."""

    def __init__(self):
        super().__init__()
        self.ends = self.returns = 0

    def filter(self, record):
        """Called by the log."""
        self.ends += "has ended (SIGKILL) and is started again" in record.getMessage()
        self.returns += "heard again" in record.getMessage()
        return False


def kill_and_hear(monkeypatch, kills):
    """What was in use after a fifth of the kills, and at the end."""
    monkeypatch.setattr("seerob.devices.live.source_process.FIRST_PAUSE", 0.002)
    monkeypatch.setattr("seerob.devices.live.source_process.LONGEST_PAUSE", 0.02)
    lines, before = Lines(), load()
    logs = [logging.getLogger(f"seerob.devices.live.{name}") for name in ("source_process", "listening")]
    for log in logs:
        log.addFilter(lines)
    settled = None
    try:
        with Receivers([(Scripted(), None)]) as listening:
            for k in range(kills):
                found = {}
                wait_for(
                    lambda found=found: (
                        found.update({type(s): s for s in listening.take()}) or len(found) == 2
                    )
                )
                assert isinstance(found[JointSample].q, tuple)
                if k == max(1, kills // 5):
                    settled = load()
                os.kill(int(found[SignalSample].values["process"]), signal.SIGKILL)
                wait_for(lambda k=k: lines.ends == k + 1)
            wait_for(lambda: lines.returns >= kills - 1)
            end = load()
    finally:
        for log in logs:
            log.removeFilter(lines)
    wait_for(lambda: threading.active_count() <= before[1] and open_files() <= before[0])
    settled = settled or end
    print(
        f"listening process: {kills} kills, {lines.returns} returns said; files {settled[0]} to {end[0]}, "
        f"threads {settled[1]} to {end[1]}, memory {settled[2] / 2**20:.1f} to {end[2] / 2**20:.1f} MiB"
    )
    return settled, end


def test_a_few_times(monkeypatch):
    kill_and_hear(monkeypatch, 3)


@pytest.mark.soak
def test_a_thousand_times(monkeypatch):
    settled, end = kill_and_hear(monkeypatch, KILLS)
    assert end[0] <= settled[0] + 2
    assert end[1] <= settled[1]
    assert end[2] <= settled[2] + SPARE
