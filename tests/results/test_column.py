"""Columns give back what was appended, whether it went to a file, stayed, or was read meanwhile."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from seerob.core.snapshot import Result, Snapshot, Verdict
from seerob.outputs.sink import KeepsResults
from seerob.recording import series
from seerob.recording.result_log import ResultLog, log_of
from seerob.recording.series import BLOCK, Column, Spill


def ticks(count):
    for k in range(count):
        part = Result(name="p", value=-float(k), unit="m")
        said = Result(
            name="c",
            value=k / 3,
            unit="m/s",
            limit=1.0,
            verdict=Verdict.WITHIN,
            reason=f"{k % 3}",
            parts=(part,),
        )
        yield Snapshot(seq=k, t=0.01 * k, poses=b"", joints={}, tracking={}, results=(said,))


@pytest.mark.parametrize("count", [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 7])
def test_everything_comes_back(count):
    spill = Spill()
    numbers, both = Column("d", spill), Column("=dB", spill)
    for k in range(count):
        numbers.append(k / 7)
        both.append(k / 3, k % 256)
    assert len(numbers) == len(both) == count
    assert np.array_equal(np.frombuffer(numbers.tobytes()), np.arange(count) / 7)
    rows = np.frombuffer(both.tobytes(), [("number", "f8"), ("code", "u1")])
    assert np.array_equal(rows["number"], np.arange(count) / 3)
    assert np.array_equal(rows["code"], np.arange(count) % 256)


def test_a_disk_that_is_full_is_said_once_and_nothing_is_lost(monkeypatch, caplog):
    def full(**_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(series.tempfile, "TemporaryFile", full)
    numbers = Column("d", Spill())
    for k in range(3 * BLOCK):
        numbers.append(k)
    assert np.array_equal(np.frombuffer(numbers.tobytes()), np.arange(3 * BLOCK))
    assert [r.message for r in caplog.records] == [
        "results stay in memory, which grows: a temporary file cannot be written: No space left on device"
    ]


def test_whoever_reads_meanwhile_sees_a_beginning_of_it():
    numbers, wrong, over = Column("dd", Spill()), [], threading.Event()

    def read():
        while not over.is_set():
            least = len(numbers)
            found = np.frombuffer(numbers.tobytes()).reshape(-1, 2)
            if len(found) < least or not np.array_equal(found.T, [np.arange(len(found))] * 2):
                wrong.append(len(found))

    reader = threading.Thread(target=read)
    reader.start()
    for k in range(12 * BLOCK):
        numbers.append(k, k)
    over.set()
    reader.join()
    assert wrong == []


def test_results_of_hours_are_those_that_were_added():
    count = 2 * BLOCK + 100
    log = log_of(ticks(count))
    series = log["c"]
    assert np.array_equal(series.values, np.arange(count) / 3)
    assert np.array_equal(series.parts["p"].values, -np.arange(count, dtype=float))
    assert np.array_equal(series.t, 0.01 * np.arange(count))
    assert series.reasons == tuple(f"{k % 3}" for k in range(count))
    assert series.spread().maximum == (count - 1) / 3
    assert len(series.thinned(500)) <= 500


def test_writers_that_share_a_log_add_each_tick_once():
    log = ResultLog()
    told = [[log.add(tick) for _ in range(3)] for tick in ticks(5)]
    assert log.ticks == len(log["c"]) == 5
    assert all(len(set(each)) == 1 for each in told)


@pytest.mark.parametrize("kind", ["dossier", "excel"])
def test_reports_use_the_log_of_the_run(tmp_path, kind):
    from made_cell import TWO_R, made, two_r
    from seerob.outputs.sinks.dossier import Dossier
    from seerob.outputs.sinks.excel import Excel

    text = TWO_R + '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm"\n'
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    sink = {"dossier": Dossier(), "excel": Excel()}[kind]
    (writer,) = station.open_sinks([sink], tmp_path / "out", station.scene())
    assert isinstance(writer, KeepsResults)
    summary = station.run(writers=[writer])
    assert writer.log is summary.results
    assert writer.log.ticks == summary.ticks
