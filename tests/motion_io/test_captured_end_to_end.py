"""A recording in; a twin in physics that follows it, scores, and every export out: by one command each."""

import csv
import json

import made_pictures
import openpyxl
import pytest
from made_recordings import bvh, c3d, reaching
from mcap.reader import make_reader

from seerob.app.cli import main
from seerob.description.humans.skeleton import JOINTS
from seerob.recording.recording import Recording

COUNT = 24


@pytest.fixture(scope="module")
def moved():
    """Rotations and positions of the bones: somebody reaches."""
    return reaching(COUNT)


def bag(folder, moved):
    """A depth camera that loses the person for a sixth of a second."""
    given = made_pictures.pictures(count=COUNT, lost=range(10, 15))
    return "kinect_recording", made_pictures.bag(folder / "r.bag", given)


@pytest.mark.parametrize("record", [bag, bvh, c3d])
def test_a_recording_becomes_a_twin_scores_and_tables(tmp_path, capsys, moved, record):
    kind, path = record(tmp_path, moved)
    folder = tmp_path / "made"
    size = ["--mass", "75", "--sex", "male"]
    if kind != "c3d":  # markers all over the body tell it well enough
        size += ["--stature", "1.75"]
    code = main(["capture", kind, str(path), *size, "-o", str(folder)])
    told = capsys.readouterr().out
    assert code == 2, told  # what nobody entered leaves the scores undecided
    assert "bones        operator: position" in told
    assert ("stature 1.7" in told) == (kind == "c3d")
    (run,) = (folder / "runs").iterdir()

    with (run / "csv/tracking_errors_over_the_run.csv").open(newline="") as file:
        errors = {(r["bone"], r["what"]): r for r in csv.DictReader(file)}
    assert float(errors["all", "position"]["median"]) < 0.03
    book = openpyxl.load_workbook(run / "results.xlsx", read_only=True)
    sheets = set(book.sheetnames)
    book.close()
    assert {"joints operator", "bones operator", "errors operator", "Bone errors", "Time shares"} <= sheets

    recording = Recording.open(run / "run.mcap")
    snapshots = list(recording.snapshots())
    assert set(snapshots[-1].bones["operator"]) == {
        b for b, what in errors if b != "all" and what == "position"
    }
    rula = [r.value for s in snapshots for r in s.results if r.name == "rula operator"]
    with (run / "csv/results_rula_operator.csv").open(newline="") as file:
        shown = [r["value"] for r in csv.DictReader(file)]
    assert shown == ["" if value is None else repr(value) for value in rula]
    with (run / "csv/joints_operator.csv").open(newline="") as file:
        knees = [float(r["right_knee_extension [rad]"]) for r in csv.DictReader(file)]
    assert knees == [s.joints["operator"][JOINTS.index("right_knee_extension")] for s in snapshots]

    coordinates = (run / "opensim/operator_coordinates.mot").read_text(encoding="utf-8").split("\n")
    assert f"nRows={len(snapshots)}" in coordinates
    assert len(list((run / "opensim").glob("*.trc"))) == 2
    # By nothing but the library of the format: what scripts and viewers see.
    with (run / "run.mcap").open("rb") as file:
        people = [json.loads(m.data) for _, _, m in make_reader(file).iter_messages(topics=["/people"])]
    last = people[-1]["people"]["operator"]
    at = next(s for s in snapshots if s.t == people[-1]["t"])
    assert list(last["joints"].values()) == list(at.joints["operator"])
    assert last["errors"]["head"]["position"] == at.bones["operator"]["head"][0]


def test_a_folder_that_is_there_is_not_touched(tmp_path, capsys):
    (tmp_path / "x.bvh").write_text("no motion")
    arguments = ["capture", "bvh", str(tmp_path / "x.bvh"), "--mass", "75", "--sex", "male", "-o"]
    assert main([*arguments, str(tmp_path)]) == 3
    assert "exists already" in capsys.readouterr().err
    assert main([*arguments, str(tmp_path / "new")]) == 3
    assert not (tmp_path / "new").exists()
    assert main(["capture", "keyframes", *arguments[2:], str(tmp_path / "new")]) == 3
    assert "reads no recording of a person" in capsys.readouterr().err


def test_a_folder_that_is_moved_needs_nothing_from_where_its_recording_was(tmp_path, moved):
    outside = tmp_path / "outside"
    outside.mkdir()
    _, path = bvh(outside, moved)
    size = ["--mass", "75", "--sex", "male", "--stature", "1.75"]
    # Names that Windows takes for other things, or that another file of the folder has.
    for name, copied in (
        ("a\\b:c?.bvh", "a_b_c_.bvh"),
        ("nul.bvh", "recording_nul.bvh"),
        ("workstation.toml", "recording_workstation.toml"),
    ):
        path = path.rename(outside / name)
        made = tmp_path / copied.partition(".")[0]
        assert main(["capture", "bvh", str(path), *size, "-o", str(made)]) == 2
        assert f'file = "{copied}"' in (made / "workstation.toml").read_text()
        assert (made / copied).read_bytes() == path.read_bytes()
    elsewhere = made.rename(tmp_path / "elsewhere")
    path.unlink()
    assert main(["assess", str(elsewhere), "-o", str(tmp_path / "again")]) == 2
