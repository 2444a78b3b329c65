"""Results as DataFrames, Arrow tables and plots, and what other processes get of them."""

import json
import pickle
import shutil

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import seerob as sr
from seerob.core.extras import MissingPackage
from seerob.core.snapshot import CriterionInfo, Snapshot
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.series import BLOCK, CODES, Column, Spill

CELL = """
title = "cell"
[[robots]]
name = "arm"
model = "library:ur5e"
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
at = { position = [1.5, 0, 0] }
[[sources]]
kind = "csv"
robot = "arm"
file = "motion.csv"
[[safety]]
kind = "velocity"
name = "$tcp$ speed"
at = "arm"
limit = 0.5
[[safety]]
kind = "velocity"
name = "forearm"
at = "arm/forearm_link"
[[safety]]
kind = "minimum_distance"
name = "gap"
between = ["arm", "op"]
limit = 0.1
every = 0.05
[[ergonomics]]
kind = "rula"
name = "posture"
human = "op"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("frames")
    (folder / "workstation.toml").write_text(CELL)
    t = np.arange(0, 0.41, 0.02)
    q = np.stack([0.5 * t**2 * 8, *[np.full_like(t, a) for a in (-1.2, 1.4, -1.5, -1.5, 0.0)]], 1)
    head = ",".join(["time [s]", *(f"J{k} [rad]" for k in range(1, 7))])
    np.savetxt(folder / "motion.csv", np.column_stack([t, q]), delimiter=",", header=head, comments="")
    return folder


@pytest.fixture(scope="module")
def station(folder):
    return sr.load(folder)


@pytest.fixture(scope="module")
def run(station, folder):
    return station.run(folder=folder / "out", sinks=[Recorder()])


@pytest.fixture(scope="module")
def recording(run, folder):
    return sr.Recording.open(folder / "out/run.mcap")


def test_a_wide_frame_is_the_series_beside_each_other(run):
    frame = run.results.to_pandas()
    assert frame.index.name == "t"
    for name, series in run.results.items():
        own = frame.xs(name, axis=1, level="criterion").loc[series.t]
        assert np.array_equal(own["value"], series.values, equal_nan=True)
        assert np.array_equal(own["limit"], series.limits, equal_nan=True)
        assert frame.attrs["criteria"][name]["unit"] == series.unit
        said = [None if code == 255 else code for code in series.verdicts]
        words = {"within": 0, "exceeded": 1, "undecided": 2, "no verdict": None}
        assert [words[word] for word in own["verdict"]] == said
        asked = np.isin(frame.index, series.t)
        assert frame["verdict"][name][~asked].isna().all()
    assert 0 < len(run.results["gap"]) < len(frame)
    assert frame.attrs["criteria"]["$tcp$ speed"]["limit"] == 0.5
    assert frame["value"]["$tcp$ speed"].max() == run.results["$tcp$ speed"].max()


def test_the_worst_of_verdicts_is_their_largest(run):
    frame = run.results.to_pandas("long")
    worst = frame[frame.criterion == "$tcp$ speed"].verdict.max()
    assert worst == run.results["$tcp$ speed"].verdict == "exceeded"


def test_what_a_run_comes_to_is_not_what_its_instants_come_to(run):
    """All instants are within, and the run, which broke off, is not."""
    log = pickle.loads(pickle.dumps(run.results))
    log.break_off("the controller went silent")
    series, frame = log["gap"], log.to_pandas("criteria")
    assert (series.verdicts == CODES[sr.Verdict.WITHIN]).all()
    assert frame.verdict["gap"] == "undecided"
    assert frame.why["gap"] == "the controller went silent"
    assert frame.verdict["$tcp$ speed"] == "exceeded"
    assert log.to_pandas().attrs["criteria"]["gap"]["verdict"] == "undecided"
    table = log.to_arrow()
    assert json.loads(table.schema.metadata[b"seerob"])["criteria"]["gap"]["verdict"] == "undecided"
    assert frame.worst_value["$tcp$ speed"] == log["$tcp$ speed"].worst().value
    assert frame.share_exceeded["$tcp$ speed"] == log["$tcp$ speed"].times().exceeded


@pytest.mark.parametrize("form", ["wide", "long", "criteria", "parts", "rows", "aspects"])
def test_a_recording_says_what_its_run_said(run, recording, form):
    frame = recording.to_pandas(form)
    assert len(frame)
    if form in ("rows", "aspects"):
        with pytest.raises(sr.UnknownName, match="form"):
            run.results.to_pandas(form)
    else:
        pd.testing.assert_frame_equal(frame, run.results.to_pandas(form))


def test_parts_and_rows_are_tables_of_their_own(recording):
    parts = recording.to_pandas("parts")
    series = recording.results["posture"].parts
    assert set(parts[parts.criterion == "posture"].part) == set(series)
    some = next(iter(series))
    assert np.array_equal(parts[parts.part == some].value, series[some].values, equal_nan=True)
    rows = [row for s in recording.snapshots() for r in s.results for row in r.rows]
    frame = recording.to_pandas("rows")
    assert list(frame.place) == [row.name for row in rows]
    aspects = recording.to_pandas("aspects")
    assert len(aspects) == sum(len(row.aspects) for row in rows)


def test_of_a_recording_to_which_something_was_joined_nothing_is_within(recording, tmp_path):
    joined = tmp_path / "joined.mcap"
    joined.write_bytes(recording.path.read_bytes() + b"and more")
    frame = sr.Recording.open(joined).to_pandas("criteria")
    assert recording.to_pandas("criteria").verdict["gap"] == "within"
    assert frame.verdict["gap"] == "undecided"
    assert "8 bytes lie behind its end" in frame.why["gap"]
    assert frame.verdict["$tcp$ speed"] == "exceeded"


def test_a_batch_has_its_instants_as_a_frame(station):
    q = {"arm": np.linspace([0, -1.2, 1.4, -1.5, -1.5, 0], [0.5, -1.2, 1.4, -1.5, -1.5, 0], 9)}
    batch = station.batch(q, {"arm": np.full((9, 6), 0.1)})
    frame = batch.to_pandas()
    assert np.array_equal(frame["value"]["gap"], batch["gap"].value)
    assert list(batch.to_pandas("criteria").verdict) == [c.verdict or "no verdict" for c in batch.values()]
    with pytest.raises(sr.UnknownName, match="form"):
        batch.to_pandas("parts")


def test_arrow_holds_the_figures_through_parquet(run, tmp_path):
    pq.write_table(run.results.to_arrow(), tmp_path / "run.parquet")
    table = pq.read_table(tmp_path / "run.parquet")
    series = run.results["gap"]
    field = table.schema.field("gap")
    assert json.loads(field.metadata[b"unit"]) == "m"
    asked = [row for row in table["gap"].to_pylist() if row["verdict"] is not None]
    assert [row["value"] for row in asked] == series.values.tolist()
    assert all(row["value"] is None for row in table["gap"].to_pylist() if row["verdict"] is None)
    told = json.loads(table.schema.metadata[b"seerob"])
    assert told["criteria"]["gap"]["verdict"] == "within"
    long = run.results.to_arrow("long")
    assert long.num_rows == len(run.results.to_pandas("long"))


def test_a_criterion_called_as_the_time_is_refused_in_a_wide_arrow_table(folder, tmp_path):
    shutil.copy(folder / "motion.csv", tmp_path)
    (tmp_path / "workstation.toml").write_text(CELL.replace('"forearm"', '"t"'))
    results = sr.load(tmp_path).run().results
    assert ("value", "t") in results.to_pandas()
    with pytest.raises(sr.InputError, match="rename the criterion"):
        results.to_arrow()
    assert results.to_arrow("long").num_rows


def test_of_two_things_said_of_one_instant_the_worse_is_kept():
    result = sr.Result(name="a", value=1.0, limit=2.0, verdict=sr.Verdict.WITHIN)
    worse = sr.Result(name="a", value=3.0, limit=2.0, verdict=sr.Verdict.EXCEEDED)
    for order in ((result, worse), (worse, result)):
        log = sr.ResultLog()
        for seq, each in enumerate(order):
            log.add(Snapshot(seq=seq, t=0.0, poses=b"", results=(each,)))
        frame = log.to_pandas()
        assert list(frame["verdict"]["a"]) == ["exceeded"]
        assert list(frame["value"]["a"]) == [3.0]


def test_a_plot_has_an_axis_for_each_criterion(run, station):
    figure = run.plot()
    assert [axes.get_title(loc="left").split(":")[0] for axes in figure.axes] == list(run.results)
    line, limit = figure.axes[0].lines[:2]
    assert np.array_equal(line.get_ydata(), run.results["$tcp$ speed"].values, equal_nan=True)
    assert set(limit.get_ydata()) == {0.5}
    assert "EXCEEDED" in figure.axes[0].get_title(loc="left")
    assert len(figure.axes[0].patches) == len(run.results["$tcp$ speed"].intervals())
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert len(run.plot("gap").axes) == len(station.batch().plot("gap").axes) == 1
    with pytest.raises(sr.UnknownName, match="gap"):
        run.plot("gaps")


@pytest.mark.parametrize("package", ["pandas", "pyarrow", "matplotlib"])
def test_without_the_package_its_extra_is_named(run, monkeypatch, package):
    monkeypatch.setitem(__import__("sys").modules, package, None)
    asked = {"pandas": run.results.to_pandas, "pyarrow": run.results.to_arrow, "matplotlib": run.plot}
    with pytest.raises(MissingPackage, match=r"seerob\[data\]"):
        asked[package]()


# -- other processes ------------------------------------------------------------------------------


def same(one, other):
    pd.testing.assert_frame_equal(one.to_pandas("long"), other.to_pandas("long"))
    pd.testing.assert_frame_equal(one.to_pandas("criteria"), other.to_pandas("criteria"))


def test_runs_batches_and_recordings_are_read_back(station, run, recording):
    same(pickle.loads(pickle.dumps(run)).results, run.results)
    batch = station.batch()
    same(pickle.loads(pickle.dumps(batch)), batch)
    same(pickle.loads(pickle.dumps(recording)).results, recording.results)
    assert repr(pickle.loads(pickle.dumps(run))) == repr(run)


def test_a_log_goes_on_where_it_is_read_back(run):
    log = pickle.loads(pickle.dumps(run.results))
    before = len(log["$tcp$ speed"])
    log.add(Snapshot(seq=before, t=9.0, poses=b"", results=(sr.Result(name="$tcp$ speed", value=1.0),)))
    assert len(log["$tcp$ speed"]) == before + 1 == len(run.results["$tcp$ speed"]) + 1


def test_a_recording_that_changed_meanwhile_is_refused(recording, tmp_path):
    copy = tmp_path / "run.mcap"
    shutil.copy(recording.path, copy)
    kept = pickle.dumps(sr.Recording.open(copy))
    copy.write_bytes(copy.read_bytes()[:-100])
    with pytest.raises(sr.InputError, match="changed since"):
        pickle.loads(kept)


@pytest.mark.parametrize("rows", [0, 3, BLOCK, 2 * BLOCK + 5])
def test_a_column_of_any_length_is_read_back_and_grows(rows):
    spill = Spill()
    column, other = Column("=d", spill), Column("=d", spill)
    for k in range(rows):
        column.append(k)
        other.append(-k)
    back, again = pickle.loads(pickle.dumps((column, other)))
    back.append(7.0)
    again.append(8.0)
    assert np.frombuffer(back.tobytes()).tolist() == [*map(float, range(rows)), 7.0]
    assert np.frombuffer(again.tobytes()).tolist() == [*(-float(k) for k in range(rows)), 8.0]


@pytest.mark.parametrize("form", ["wide", "long", "criteria", "parts"])
def test_a_criterion_that_was_never_heard_is_undecided_in_every_table(form):
    log = sr.ResultLog([CriterionInfo(name="a", kind="k", group="safety", title="t")])
    frame = log.to_pandas(form)
    assert frame.attrs["criteria"]["a"]["verdict"] == "undecided"
    assert log.to_arrow(form).num_rows == len(frame) == (form == "criteria")
    assert sr.ResultLog().to_pandas(form).attrs["verdict"] == "no verdict"
