"""Hours of run time with every sink and a page that looks on: memory does not grow.

``SEEROB_SOAK_HOURS`` scales the long form; its figures are printed with ``-rP``.
"""

import gc
import os
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed

import seerob as sr
from seerob.app.server.live import LiveView
from seerob.core.snapshot import Snapshot
from seerob.outputs.sinks.dossier import Dossier
from seerob.outputs.sinks.excel import Excel
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.recording import Recording
from server.frames import Visitor
from soak.cut_short import workstation

SPARE = 48 * 2**20
"""What allocators, the newest block of each column, and tables up to their bounds take of a run that is no
hour long [byte]."""
PER_HOUR = 2**20
"""Growth after the first hour, at most [byte/h]."""


def resident():
    """Memory of this process [byte]."""
    gc.collect()
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) * 1024
    raise AssertionError("no VmRSS")


class Watched(Iterator):
    """Ticks without samples, and the memory after each eighth, the last before files are written."""

    def __init__(self, ticks):
        self.done, self.total, self.memory = 0, ticks, []

    def __next__(self):
        if self.done > 0 and self.done * 8 // self.total > (self.done - 1) * 8 // self.total:
            self.memory.append(resident())
        if self.done == self.total:
            raise StopIteration
        self.done += 1
        return ()


class Onlooker(threading.Thread):
    """A page that looks on until the server is gone.

    Args:
        server: Of the page.
    """

    def __init__(self, server):
        super().__init__()
        self.page, self.seen = Visitor(server), 0

    def run(self):
        with self.page, suppress(ConnectionClosed):
            while True:
                self.seen += isinstance(self.page.read(60.0), Snapshot)


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
    sinks = [Recorder(lossless=True), Dossier(pictures=0), Excel()]
    scene = station.scene(with_sources=False)
    with LiveView(scene=scene, meshes=station.model.meshes, port=0) as view:
        looking = Onlooker(view.server)
        looking.start()
        summary = station.run(feed=feed, folder=tmp_path, sinks=sinks, writers=[view], scene=scene)
    looking.join(60.0)
    memory = ", ".join(f"{m / 2**20:.1f}" for m in feed.memory)
    size = (tmp_path / "run.mcap").stat().st_size / 2**20
    print(f"{hours:g} h: {memory} MiB after each eighth, file of {size:.1f} MiB, {looking.seen} frames shown")
    assert looking.seen > 10
    assert summary.ticks == feed.total
    first = max(1, round(8 / hours)) if hours > 1 else 1
    after = feed.memory[first - 1 :]
    assert max(after) - after[0] < (PER_HOUR * (hours - hours * first / 8) if hours >= 4 else SPARE)
    # The same log, not a copy of it.
    assert all(len(series) == feed.total for series in summary.results.values())
    recording = Recording.open(tmp_path / "run.mcap")
    assert recording.complete
    assert recording.findings == ()
    assert recording.end == pytest.approx((feed.total - 1) * station.workstation.engine.tick)
    assert recording.snapshot_at(recording.end / 2).seq == (feed.total - 1) // 2
