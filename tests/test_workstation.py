"""The workstations that ship: plausible motions, nothing undecided, small files; and the file's own types."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import seerob as sr
from seerob.recording.format import content_hash
from seerob.workstation.workstation import (
    PLUGINS,
    TABLES,
    Engine,
    Pose,
    Shape,
    Workstation,
    locate,
)

LIVE = {
    "ur10_rtde",
    "plc_cell",
    "motor_station",
    "assembly_line",
    "empty_room",
    "three_robots",
    "giant_niryo",
    "niryo_picking",
    "two_places",
}
"""Run in real time only; see test_live_workstation.py and test_plc_cell.py."""
EVERY = sorted(
    path.parent for path in (Path(__file__).parents[1] / "workstations").glob("*/workstation.toml")
)
RECORDED = {"captured_operator"}
"""Of a recorded person, who is lost for a moment; see test_captured_operator.py."""
FOLDERS = [folder for folder in EVERY if folder.name not in LIVE | RECORDED]
CLEARANCES = {
    "ur10_assembly": ("gripper", "table"),
    "iiwa_bench": ("fingers", "bench"),
    "two_robots": ("ur10", "ur5e"),
    "guarded_cell": ("ur5e", "rack"),
    "imported_line": ("ur5e", "line/*"),
}
"""Two names of each that must never meet."""


def test_every_workstation_is_looked_at():
    assert {folder.name for folder in EVERY} == set(CLEARANCES) | LIVE | RECORDED


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_workstation_that_ships_runs_decided_within_limits_and_without_a_crash(folder):
    from seerob.criteria.safety.minimum_distance import MinimumDistance

    station = sr.load(folder).with_criteria(MinimumDistance(name="clear", between=CLEARANCES[folder.name]))
    run = station.run()
    assert run.results["clear"].min() > 0
    assert run.duration == pytest.approx(station.duration, abs=0.01)
    assert [name for name, series in run.results.items() if series.verdict == sr.Verdict.UNDECIDED] == []
    # Nothing was beyond a limit of position or speed: sources warn of that.
    beyond = [f.text for f in run.scene.findings if f.level == "warning" and "beyond" in f.text]
    assert beyond == []


@pytest.mark.parametrize("folder", EVERY, ids=lambda folder: folder.name)
def test_what_ships_is_small(folder):
    files = [f for f in folder.rglob("*") if f.is_file() and folder / "runs" not in f.parents]
    assert [str(f) for f in files if f.stat().st_size > 200_000] == []


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_loop_goes_on_without_a_gap(folder):
    """Of what loops, the ends are the same place and the pause is told: live, nothing turns undecided."""
    station = sr.load(folder)
    assert all(source.loop for source in station.workstation.sources)
    from seerob.workstation.source import Pump

    for source, opened in station.sources:
        pump = Pump(opened, loop=True, pause=source.loop_pause)
        heard = list(pump.until(2.5 * (opened.duration + source.loop_pause)))
        assert {sample.quality for sample in heard} == {"good"}
        assert np.diff([sample.t for sample in heard]).max() < source.timeout


def test_the_type_of_the_file_names_every_table_once():
    fields = set(Workstation.__struct_fields__)
    assert set(TABLES) | set(PLUGINS) <= fields
    assert fields - set(TABLES) - set(PLUGINS) == {
        "title",
        "edition",
        "description",
        "variables",
        "zones",
        "allow_writing",
        "engine",
        "report",
        "folder",
        "outside",
        "files",
    }
    assert all(kind.__struct_config__.frozen for kind in TABLES.values())


@given(st.dictionaries(st.text(max_size=4), st.binary(max_size=4), max_size=4), st.randoms())
def test_the_hash_of_files_forgets_their_order_and_nothing_else(files, chance):
    shuffled = list(files.items())
    chance.shuffle(shuffled)
    assert content_hash(dict(shuffled)) == content_hash(files)
    for name in files:
        assert content_hash({**files, name: files[name] + b"x"}) != content_hash(files)
        assert content_hash({k: v for k, v in files.items() if k != name}) != content_hash(files)


def test_the_border_between_a_name_and_a_content_counts():
    assert content_hash({"a": b"bc"}) != content_hash({"ab": b"c"})
    assert content_hash({"a": b"", "b": b""}) != content_hash({"a": b"b"})


@given(st.integers(1, 10))
def test_a_tick_is_a_whole_number_of_steps(steps):
    assert Engine(timestep=0.001, tick=steps * 0.001).tick == pytest.approx(steps * 0.001)
    with pytest.raises(ValueError, match="whole number"):
        Engine(timestep=0.001, tick=(steps + 0.5) * 0.001)


def test_a_pose_and_a_shape_say_one_thing():
    with pytest.raises(ValueError, match="keep one"):
        Pose(rpy=(0, 0, 1), wxyz=(1, 0, 0, 0))
    with pytest.raises(ValueError, match="unit quaternion"):
        Pose(wxyz=(0, 0, 0, 0))
    for sizes in ({}, {"sphere": 1.0, "box": (1.0, 1.0, 1.0)}, {"sphere": -1.0}, {"cylinder": (1.0, 0.0)}):
        with pytest.raises(ValueError, match=r"exactly one|larger than 0"):
            Shape(**sizes)


def test_a_path_and_its_folder_are_the_same_file(tmp_path):
    file = tmp_path / "workstation.toml"
    file.write_text("")
    assert locate(tmp_path) == locate(file) == locate(str(file)) == file
    assert msgspec.structs.replace(sr.read(file), files={}) == Workstation(folder=str(tmp_path))
