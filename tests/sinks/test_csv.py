"""The CSV files hold what was heard and what came out, and are there whole or not at all."""

import csv
import errno
import io
import os
import tracemalloc

import made_person_run as run
import made_run
import numpy as np
import pytest
from msgspec.structs import replace

from seerob.core.errors import InputError
from seerob.description.humans.skeleton import BONES, JOINTS
from seerob.devices.sources.joint_angles import JointAngleFile
from seerob.outputs.sinks import opensim
from seerob.outputs.sinks.csv import CsvFiles
from seerob.outputs.sinks.opensim import OpenSim
from seerob.workstation.source import Target

N = 100


def write(folder, made=run, n=N, **options):
    with CsvFiles(**options).open(made.scene(), {}, {}, folder) as writer:
        for k in range(n):
            writer.write(made.snapshot(k), made.samples(k))
    return folder / options.get("file", "csv")


def rows(path, **options):
    with path.open(newline="", encoding="utf-8") as file:
        head, *data = csv.reader(file, **options)
    assert all(len(row) == len(head) for row in data)
    return [dict(zip(head, row, strict=True)) for row in data]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return write(tmp_path_factory.mktemp("csv"))


def test_there_is_a_file_for_everything_that_was_heard_and_came_out(files):
    assert sorted(path.name for path in files.iterdir()) == [
        "about.csv",
        "bones_op.csv",
        "joints_arm.csv",
        "joints_op.csv",
        "results_RULA.csv",
        "results_distance.csv",
        "samples_camera_op.csv",
        "tracking_errors_op.csv",
        "tracking_errors_over_the_run.csv",
    ]
    assert [p.name for p in files.parent.iterdir()] == ["csv"]


def test_samples_are_as_they_came_in_and_late_columns_are_blank_before(files):
    data = rows(files / "samples_camera_op.csv")
    heard = [sample for k in range(N) for sample in run.samples(k)]
    assert [float(r["device clock [s]"]) for r in data] == [s.t_device for s in heard]
    assert [float(r["RIGHT_HAND y [m]"]) for r in data] == [s.points[0].position[1] for s in heard]
    assert [r["quality"] for r in data] == [s.quality.value for s in heard]
    assert [r["HEAD y [m]"] != "" for r in data] == [len(s.points) == 3 for s in heard]
    assert not [name for name in data[0] if name.startswith("LOST")]


def test_bones_are_the_poses_of_the_snapshots(files):
    data = rows(files / "bones_op.csv")
    poses = [np.frombuffer(run.snapshot(k).poses, "<f4").reshape(-1, 7) for k in range(N)]
    for j, bone in enumerate(BONES):
        for i, what in enumerate(("x [m]", "y [m]", "z [m]", "qw [1]", "qx [1]", "qy [1]", "qz [1]")):
            read = np.array([r[f"{bone} {what}"] for r in data], "<f4")
            assert (read == [pose[1 + j, i] for pose in poses]).all()


def test_errors_and_results_are_there_with_their_units(files):
    data = rows(files / "tracking_errors_op.csv")
    assert [float(r["head position [m]"]) for r in data] == [run.error(k, "head") for k in range(5, N)]
    assert {r["head angle [rad]"] for r in data} == {""}
    data = rows(files / "results_distance.csv")
    assert [float(r["value [m]"]) for r in data] == [run.distance(k) for k in range(N)]
    assert data[0]["reason"] == "arm/l1 ↔ op/right_hand (Hands and fingers, front, dominant side)"
    score = rows(files / "results_RULA.csv")[20]
    assert (score["value"], score["right: value"], score["right upper arm"]) == ("7.0", "7.0", "2.0")
    assert score["right upper arm, flexion [rad]"] == "0.3"
    whole = {(r["bone"], r["what"]): r for r in rows(files / "tracking_errors_over_the_run.csv")}
    assert float(whole["head", "position"]["largest"]) == pytest.approx(0.01)


def test_joints_can_be_played_again(files):
    target = Target(
        name="op",
        joints=JOINTS,
        units=("rad",) * len(JOINTS),
        lower=(-9.0,) * len(JOINTS),
        upper=(9.0,) * len(JOINTS),
        velocity=(None,) * len(JOINTS),
        description=run.PERSON,
    )
    # As it was written, with tracking errors and what is measured beside the joints.
    played = JointAngleFile(human="op", file="joints_op.csv", floor=False).open(files, target)
    assert any("tracking errors" in f.text and f.level == "assumed" for f in played.findings)
    knees = [sample.q[run.KNEE] for sample in played.samples]
    assert knees == pytest.approx([run.joints(k)[run.KNEE] for k in range(N)])


def test_every_thins_all_but_the_samples(tmp_path):
    folder = write(tmp_path, every=0.05)
    assert [r["t [s]"] for r in rows(folder / "joints_arm.csv")] == [repr(k * 0.01) for k in range(0, N, 5)]
    assert len(rows(folder / "samples_camera_op.csv")) == N // 5


def test_other_marks(tmp_path):
    folder = write(tmp_path, separator="semicolon", decimal="comma")
    data = rows(folder / "results_distance.csv", delimiter=";")
    assert data[0]["value [m]"] == "0,9"


def test_memory_does_not_grow_with_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(opensim, "TOGETHER", 16)  # what is imported at the first time is not counted then
    writers = [sink.open(run.scene(), {}, {}, tmp_path) for sink in (CsvFiles(), OpenSim())]
    ticks = [(run.snapshot(k), run.samples(k)) for k in range(20)]
    held = []
    tracemalloc.start()
    try:
        for k in range(300):
            snapshot, samples = ticks[k % 20]
            for writer in writers:
                writer.write(replace(snapshot, t=k * run.PERIOD), samples)
            if k in (100, 299):
                held.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
        for writer in writers:
            writer.close()
    # Two hundred ticks are more than 1 MB of text; postures that wait to be converted come and go.
    assert (tmp_path / "csv/bones_op.csv").stat().st_size > 250_000
    assert held[1] - held[0] < 350_000


def test_text_of_files_stays_text(tmp_path):
    folder = write(tmp_path, made=made_run)
    for path in folder.iterdir():
        for row in rows(path):
            for cell in (*row, *row.values()):
                assert not cell.startswith(("=", "@")), path


class Full(io.StringIO):
    """A file on a disk without room."""

    def write(self, text):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def interrupted(folder):
    with CsvFiles().open(run.scene(), {}, {}, folder) as writer:
        writer.write(run.snapshot(0), run.samples(0))
        raise KeyboardInterrupt


def test_an_impatient_user_and_a_full_disk_leave_nothing(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        interrupted(tmp_path)
    assert not list(tmp_path.iterdir())
    writer = CsvFiles().open(run.scene(), {}, {}, tmp_path)
    writer.write(run.snapshot(0), ())
    for table in writer.tables.values():
        table._file.close()
        table._file = Full()
    for k in range(1, 60):
        writer.write(run.snapshot(k), ())
    with pytest.raises(InputError, match="cannot be written: No space left"):
        writer.close()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"file": "../x"}, "not the name of a folder"),
        ({"every": float("nan")}, "csv.every"),
        ({"decimal": "comma"}, "both a comma"),
    ],
)
def test_what_cannot_be_is_refused_before_the_run(tmp_path, options, what):
    with pytest.raises(InputError, match=what):
        CsvFiles(**options).open(run.scene(), {}, {}, tmp_path)


def test_a_folder_that_is_there_is_not_touched(tmp_path):
    (tmp_path / "csv").mkdir()
    with pytest.raises(InputError, match="exists already"):
        CsvFiles().open(run.scene(), {}, {}, tmp_path)


def test_what_no_device_sees_is_told_tick_by_tick(files):
    """A device sees head and right hand from the sixth tick on."""
    bones, joints = rows(files / "bones_op.csv"), rows(files / "joints_op.csv")
    assert {row[f"{bone} measured"] for row in bones[:5] for bone in BONES} == {""}
    for row in bones[5:]:
        assert {bone for bone in BONES if row[f"{bone} measured"] == "1"} == {"head", "right_hand"}
        assert row["left_hand measured"] == "0"
    # A joint's angle lies between two bones, and of none both are seen.
    assert {row[f"{joint} measured"] for row in joints[:5] for joint in JOINTS} == {""}
    assert {row[f"{joint} measured"] for row in joints[5:] for joint in JOINTS} == {"0"}
