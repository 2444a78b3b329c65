"""Hours of run time with every sink: memory does not grow.

``SEEROB_SOAK_HOURS`` scales the long form.
"""

import gc
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import seerob as sr
from seerob.recording import Recording
from seerob.sinks.dossier import Dossier
from seerob.sinks.excel import Excel
from seerob.sinks.recorder import Recorder
from soak.cut_short import workstation

SPARE = 48 * 2**20
"""What allocators, the newest block of each column, and the recorder's index may take."""


def resident():
    """Memory of this process [byte]."""
    gc.collect()
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) * 1024
    raise AssertionError("no VmRSS")


class Watched(Iterator):
    """Ticks without samples, and the memory at the first tenth and at the end, before files are written."""

    def __init__(self, ticks):
        self.left, self.total, self.early, self.late = ticks, ticks, None, None

    def __next__(self):
        if self.left == 0:
            self.late = resident()
            raise StopIteration
        if self.early is None and self.left <= 0.9 * self.total:
            self.early = resident()
        self.left -= 1
        return ()


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="resident memory is read from /proc")
@pytest.mark.parametrize(
    "hours",
    [
        pytest.param(0.01, id="short"),
        pytest.param(float(os.environ.get("SEEROB_SOAK_HOURS", "8")), id="long", marks=pytest.mark.soak),
    ],
)
def test_memory_does_not_grow(tmp_path, hours):
    station = sr.load(workstation(tmp_path / "cell"))
    feed = Watched(round(hours * 3600 / station.workstation.engine.tick))
    summary = station.run(
        feed=feed, folder=tmp_path, sinks=[Recorder(lossless=True), Dossier(pictures=0), Excel()]
    )
    assert summary.ticks == feed.total
    assert feed.late - feed.early < SPARE
    # The same log, not a copy of it.
    assert all(len(series) == feed.total for series in summary.results.values())
    recording = Recording.open(tmp_path / "run.mcap")
    assert recording.complete
    assert recording.findings == ()
    assert recording.end == pytest.approx((feed.total - 1) * station.workstation.engine.tick)
    assert recording.snapshot_at(recording.end / 2).seq == (feed.total - 1) // 2
