"""A line per live source: in summary, recording and console, of whom one hears and of whom not."""

from __future__ import annotations

import time

from free_ports import free_port
from made_cell import made
from seerob.app import cli
from seerob.app.emulation.motions import swing
from seerob.app.emulators.rtde import HOME, RtdeServer
from seerob.core.snapshot import Snapshot, SourceLine
from seerob.recording.recording import Recording

CELL = """
[[robots]]
name = "arm"
model = "library:ur10"
[[sources]]
kind = "rtde"
name = "ours"
robot = "arm"
host = "127.0.0.1"
frequency = 125
port = PORT
[[safety]]
kind = "velocity"
name = "speed"
at = "arm/tool0"
limit = 5.0
"""


def cell(folder, port):
    return made(folder, CELL.replace("PORT", str(port)))


def test_who_is_heard_and_who_was_lost_is_in_a_line(tmp_path):
    end = time.monotonic() + 60.0
    told: list[tuple[float, SourceLine]] = []

    class Sees:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            self.close()

        def close(self):
            pass

        def write(self, snapshot: Snapshot, samples):
            if "ours" in snapshot.sources:
                told.append((snapshot.t, snapshot.sources["ours"]))

    with RtdeServer(swing(HOME)) as server:
        station = cell(tmp_path, server.port)
        gone = []

        def stop():
            heard = [line.heard for _, line in told if line.received > 50]
            if heard and heard[-1] and not gone:
                server.stop()
                gone.append(len(told))
            return time.monotonic() > end or (bool(gone) and not all(heard))

        summary = station.run(live=True, stop=stop, writers=[Sees()])
    best = max((line for _, line in told if line.heard), key=lambda line: line.received)
    assert best.received > 50
    assert 0 < best.rate < 140
    assert best.latency >= 0
    assert best.bound == 0.2
    # Not at each tick: about a tenth of them say it.
    assert len(told) < 0.4 * summary.ticks
    last = summary.sources["ours"]
    assert not last.heard
    assert last.losses >= 1
    assert last.word.startswith("not heard: ")
    assert str(last).startswith("not heard; ")


def test_a_source_that_is_not_there_has_a_last_word(tmp_path, capsys):
    port = free_port()
    made(tmp_path, CELL.replace("PORT", str(port)))
    folder = tmp_path / "out"
    cli.main(["run", str(tmp_path), "--port", "0", "--seconds", "2.5", "-o", str(folder)])
    said = " ".join(capsys.readouterr().out.split())
    assert (
        "source ours: not heard; 0 received, 0 lost, lost 0 times; last word: not heard: Connection refused"
        in said
    )
    lines = [s.sources["ours"] for s in Recording.open(folder / "run.mcap").snapshots() if s.sources]
    assert lines[-1].word == "not heard: Connection refused"
