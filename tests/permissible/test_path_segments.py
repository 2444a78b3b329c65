"""The map by segment, drawn and read back; a plan that is asked again between the stations of its map."""

from __future__ import annotations

import csv
import io
import math
from itertools import pairwise

import numpy as np
import pytest
from msgspec.structs import replace
from test_permissible_speed import KEPT_OUT, KNOWN, LIMITS, PFL, SOURCE, cell, turn

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.app import cli
from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_folder
from seerob.core.samples import PoseSample, Quality
from seerob.core.verdict import Verdict
from seerob.criteria.safety.path_speed import passed
from seerob.files.trajectories.path_map import Place, path_markers, read_map
from seerob.session.permissible.evaluation import Wish
from seerob.session.permissible.path import solved
from seerob.session.permissible.speed_map import segments
from seerob.session.permissible.tables import SEGMENT_HEAD, csv_bytes, map_head, map_rows, segment_rows

TIP = '[[safety]]\nkind = "velocity"\nname = "V"\nat = "arm"\nlimit = 0.5\n'


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mapped")
    station = cell(folder, KNOWN, PFL + KEPT_OUT)
    return folder, station, station.permissible_speed(wish=Wish(spacing=0.05))


def test_segments_follow_each_other_and_carry_the_least(mapped):
    _, _, found = mapped
    (stations,) = found.map.stations
    cut = segments(found.map, length=0.4)
    # The tool point goes 0.8 rad on a circle of 2 m: chords, so a little less.
    assert sum(one.way for one in cut) == pytest.approx(1.6, rel=1e-3)
    assert len(cut) == 4
    assert [one.number for one in cut] == [1, 2, 3, 4]
    assert cut[0].start == stations.t[0]
    assert cut[-1].end == stations.t[-1]
    assert all(a.end == b.start for a, b in pairwise(cut))
    # The tool point has a lever of 2 m.
    assert min(one.tool_speed for one in cut) == pytest.approx(2 * stations.permissible.min(), rel=1e-9)
    assert max(one.given for one in cut) == pytest.approx(2 * stations.given.max(), rel=1e-9)
    rows = list(csv.DictReader(io.StringIO(csv_bytes(SEGMENT_HEAD, segment_rows(cut)).decode())))
    governing = [one.governing for one in cut]
    assert [row["governed by"] for row in rows] == [c.governs for c in governing]
    assert all(row["source of that limit"] for row in rows if row["criterion"] == "F")
    with pytest.raises(InputError, match="larger length"):
        segments(found.map, length=1e-9)


def test_the_plan_is_asked_again_every_millisecond(mapped):
    _, station, found = mapped
    assert found.verified.kept
    assert found.verified.period == 1e-3
    assert found.verified.asked == pytest.approx(found.rescaled.duration * 1000, rel=0.1)
    assert 0.9 < found.verified.use <= 1
    # The road says the same at 1 kHz, with the twin put on the plan.
    text = (station.model.folder / "workstation.toml").read_text()
    fast = text.replace(
        FLOATING, "engine = { gravity = [0, 0, 0], tick = 0.001, timestep = 0.001, physics = false }\n"
    )
    (station.model.folder / "plan.csv").write_bytes(_plan(found))
    again = made(station.model.folder, fast.replace("motion.csv", "plan.csv"))
    summary = again.run()
    assert summary.ticks == pytest.approx(found.rescaled.duration * 1000, abs=2)
    assert {series.verdict for series in summary.results.values()} == {Verdict.WITHIN}


def _plan(found):
    from seerob.session.permissible.tables import trajectory_head, trajectory_rows

    plan = found.rescaled.trajectory(0.002)
    return csv_bytes(trajectory_head(plan, found.map.limits.units), trajectory_rows(plan))


def test_too_few_stations_are_noticed_and_added(tmp_path):
    """Five stations do not show how near the arm comes between two of them: the look between them does."""
    station = cell(tmp_path, KNOWN, x=3.05)
    found = station.permissible_speed(wish=Wish(spacing=10.0, margin=0.0, verify=0.02))
    assert len(found.map.stations[0].s) > 5
    assert found.verified.use <= 1 + 1e-6


def test_a_run_is_watched_against_the_map(mapped, tmp_path):
    _, _, found = mapped
    data = csv_bytes(map_head(found.map), map_rows(found.map))
    watch = '[[safety]]\nkind = "path_speed"\nname = "P"\nrobot = "arm"\nmap = "map.csv"\n'
    watch += 'between_samples = "accepted: the speed is asked at every tick"\n'
    text = FLOATING.replace("}", ", physics = false }") + TWO_R + LIMITS + SOURCE + watch
    files = {"arm.urdf": two_r(), "map.csv": data, "motion.csv": turn()}
    results = made(tmp_path, text, files).run().results["P"]
    # The worst share is that of the map itself.
    (stations,) = found.map.stations
    assert results.verdict is Verdict.EXCEEDED
    assert results.max() == pytest.approx(np.max(stations.given / stations.permissible), rel=0.03)
    plan = made(tmp_path / "plan", text, {**files, "motion.csv": _plan(found)})
    assert plan.run().results["P"].verdict is Verdict.WITHIN
    assert "map.csv" in plan.files
    # Elsewhere the map says nothing.
    rows = [line.split(",") for line in turn().splitlines()]
    bent = "\n".join(",".join([*row[:2], row[2].replace("0", "0.5"), *row[3:]]) for row in rows)
    elsewhere = made(tmp_path / "bent", text, {**files, "motion.csv": bent})
    worst = elsewhere.run().results["P"].worst()
    assert worst.verdict is Verdict.UNDECIDED
    assert "off the path" in worst.reason


def test_the_map_is_drawn_in_the_colours_of_what_is_permitted():
    def at(x, permitted, given):
        return Place((float(x), 0.0, 0.0), permitted, given)

    lines = path_markers([[at(0, 1, 0.5), at(1, 1, 0.5), at(2, 0.2, 0.5), at(3, math.nan, 0.5), at(4, 0, 0)]])
    assert [line.verdict for line in lines] == [Verdict.EXCEEDED, Verdict.UNDECIDED, Verdict.WITHIN]
    assert [p[0] for p in lines[0].points] == [2.0, 3.0]
    assert lines[0].label == "0.20 m/s permitted, 0.50 given"
    assert [bool(line.label) for line in lines] == [True, True, False]


def test_on_the_way_back_the_way_back_counts():
    start, way = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[1.0, 0.0], [-1.0, 0.0]])
    q = np.array([0.5, 0.01])
    for qd, leg in (([1.0, 0.0], 0), ([-1.0, 0.0], 1)):
        here = passed(q, np.array(qd), (start, way))
        assert here.legs.tolist() == [leg]
        assert here.distance == pytest.approx(0.01)
    assert passed(q, np.zeros(2), (start, way)).legs.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda s: s.replace("J2 [rad]", "J2 [m]"), "not of this robot: J2"),
        (lambda s: s.replace("tool x [m]", "x"), "columns missing: tool x"),
        (lambda s: "\n".join(s.splitlines()[:2]), "1 places"),
        (lambda s: s.replace("\n1,", "\nnan,", 1), "cannot be"),
        (lambda s: s.replace("\n1,", "\n1e9,", 1), "cannot be"),
        (lambda s: "", "columns missing"),
    ],
)
def test_a_map_that_cannot_be_is_refused(mapped, wrong, message):
    _, _, found = mapped
    text = csv_bytes(map_head(found.map), map_rows(found.map)).decode()
    with pytest.raises(InputError, match=message):
        read_map(wrong(text).encode(), name="map.csv", units=("rad", "rad"))


def test_a_map_is_read_back_as_it_was_written(mapped):
    _, _, found = mapped
    (stations,) = found.map.stations
    data = csv_bytes(map_head(found.map), map_rows(found.map))
    read = read_map(data, name="map.csv", units=("rad", "rad"))
    np.testing.assert_array_equal(read.q, stations.q)
    np.testing.assert_array_equal(read.permissible, stations.permissible)
    np.testing.assert_array_equal(read.tool, stations.tool)
    assert any("free" in words for words in read.words)


def test_poses_of_the_tool_are_solved_into_the_joints_they_came_from(tmp_path):
    model = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()}).model
    t = np.linspace(0, 1, 21)
    q = np.stack([0.3 * t, 0.2 + 0.5 * t], 1)
    total = q.sum(axis=1)
    x, y = np.cos(q[:, 0]) + np.cos(total), np.sin(q[:, 0]) + np.sin(total)
    poses = [
        PoseSample(
            source="p",
            target="arm/tip",
            seq=k,
            t=t[k],
            position=(x[k], y[k], 0.0),
            wxyz=(np.cos(total[k] / 2), 0.0, 0.0, np.sin(total[k] / 2)),
        )
        for k in range(len(t))
    ]
    robot = model.robot("arm")
    np.testing.assert_allclose([s.q for s in solved(model, robot, poses)], q, atol=1e-6)
    far = PoseSample(source="p", target="arm/tip", seq=0, t=0.0, position=(5.0, 0, 0), wxyz=(1.0, 0, 0, 0))
    with pytest.raises(InputError, match="out of reach"):
        solved(model, robot, [far])
    # What its source does not vouch for may lie anywhere; how good it is goes on.
    doubtful = replace(far, quality=Quality.DEGRADED)
    found = solved(model, robot, [poses[0], doubtful, replace(poses[1], seq=9)])
    assert [(s.quality, s.t, s.seq, s.target) for s in found] == [
        (Quality.GOOD, 0.0, 0, "arm"),
        (Quality.DEGRADED, 0.0, 0, "arm"),
        (Quality.GOOD, 0.05, 9, "arm"),
    ]
    for lost in ({"position": (np.nan, 0, 0)}, {"wxyz": (1.0, 0, np.inf, 0)}):
        with pytest.raises(InputError, match="a pose that is not finite"):
            solved(model, robot, [replace(poses[0], **lost)])


@pytest.mark.parametrize("raised", [KeyboardInterrupt, InputError([])])
def test_a_folder_is_there_whole_or_not_at_all(tmp_path, raised):
    folder = tmp_path / "runs" / "first"

    def half():
        with whole_folder(folder) as working:
            (working / "half.csv").write_text("x")
            raise raised

    with pytest.raises((KeyboardInterrupt, InputError)):
        half()
    assert list(tmp_path.iterdir()) == []
    with whole_folder(folder) as working:
        (working / "whole.csv").write_text("x")
        assert not folder.exists()
    assert [path.name for path in folder.iterdir()] == ["whole.csv"]
    assert [path.name for path in folder.parent.iterdir()] == ["first"]


def test_assess_and_report_take_it_up_when_asked(tmp_path, capsys):
    cell(tmp_path / "cell", TIP)
    out, again = tmp_path / "out", tmp_path / "again"
    recorder = '[[sinks]]\nkind = "recorder"\n[[sinks]]\nkind = "dossier"\npictures = 0\n'
    file = tmp_path / "cell" / "workstation.toml"
    file.write_text(file.read_text() + recorder)
    cli.main(["assess", str(tmp_path / "cell"), "--permissible", "-o", str(out)])
    told = capsys.readouterr().out
    assert "Cycle time 1.000 s as given" in told
    assert "Permissible speed along the path" in (out / "report.html").read_text(encoding="utf-8")
    (recording,) = out.glob("*.mcap")
    cli.main(["report", str(recording), "--permissible", "-o", str(again)])
    assert "Permissible speed along the path" in (again / "report.html").read_text(encoding="utf-8")
    # The same motion, whether from its file or from the recording.
    assert [s for s in told.splitlines() if "Cycle time" in s] == [
        s for s in capsys.readouterr().out.splitlines() if "Cycle time" in s
    ]
