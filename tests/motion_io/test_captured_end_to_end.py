"""A recording in; a twin in physics that follows it, scores, and every export out: by one command each."""

import csv
import json

import ezc3d
import made_pictures
import numpy as np
import openpyxl
import pytest
from mcap.reader import make_reader

from seerob.app.cli import main
from seerob.description.capture.mapping import conventions, plain
from seerob.description.humans import keyframes, manikin, motion
from seerob.description.humans.skeleton import BONES, JOINTS, bone_poses
from seerob.recording.recording import Recording

PERSON = manikin.build(name="person", stature=1.75, mass=75.0, sex="male")
RATE, COUNT = 30.0, 24
CENTRES = (
    ("Hips", None, "pelvis"),
    ("Chest", "Hips", "lumbar"),
    ("Chest2", "Chest", "thorax"),
    ("Neck", "Chest2", "neck"),
    ("Head", "Neck", "head"),
    *(
        row
        for s, side in (("Right", "right"), ("Left", "left"))
        for row in (
            (f"{s}Collar", "Chest2", f"{side}_clavicle"),
            (f"{s}Shoulder", f"{s}Collar", f"{side}_upper_arm"),
            (f"{s}Elbow", f"{s}Shoulder", f"{side}_forearm"),
            (f"{s}Wrist", f"{s}Elbow", f"{side}_hand"),
            (f"{s}Hip", "Hips", f"{side}_thigh"),
            (f"{s}Knee", f"{s}Hip", f"{side}_shank"),
            (f"{s}Ankle", f"{s}Knee", f"{side}_foot"),
        )
    ),
)
PAIRS = ("ASI", "PSI", "FHD", "BHD", "SHO", "ELB", "WRA", "KNE", "ANK", "HEE", "TOE")
MARKERS = ["C7", "T10", "CLAV", "STRN", *(side + name for name in PAIRS for side in "RL")]


@pytest.fixture(scope="module")
def moved():
    """Rotations and positions of the bones: somebody reaches."""
    played = motion.sample(keyframes.read("library:reach", PERSON), PERSON, RATE)
    return bone_poses(PERSON, played.q[:COUNT])


def bag(folder, moved):
    """A depth camera that loses the person for a sixth of a second."""
    given = made_pictures.pictures(count=COUNT, lost=range(10, 15))
    return "kinect_recording", made_pictures.bag(folder / "r.bag", given)


def bvh(folder, moved):
    """Joint centres by channels of position: nothing turns."""
    _, p = moved
    at = {name: 100 * p[:, BONES.index(bone)][:, [1, 2, 0]] for name, _, bone in CENTRES}  # y up
    lines = ["HIERARCHY"]

    def joint(name, parent):
        offset = at[name][0] - (at[parent][0] if parent else 0)
        lines.extend([f"{'JOINT' if parent else 'ROOT'} {name}", "{", "OFFSET " + " ".join(map(str, offset))])
        lines.append("CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")
        order.append((name, parent))
        children = [n for n, above, _ in CENTRES if above == name]
        for child in children:
            joint(child, name)
        if not children:
            lines.extend(["End Site", "{", "OFFSET 0 -5 0", "}"])
        lines.append("}")

    order: list[tuple[str, str | None]] = []
    joint("Hips", None)
    lines += ["MOTION", f"Frames: {COUNT}", f"Frame Time: {1 / RATE}"]
    for k in range(COUNT):
        rows = [[*(at[n][k] - (at[above][k] if above else 0)), 0, 0, 0] for n, above in order]
        lines.append(" ".join(str(x) for row in rows for x in row))
    (folder / "r.bvh").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return "bvh", folder / "r.bvh"


def c3d(folder, moved):
    """Markers on the skin, up to 2 cm from where they ought to be."""
    R, p = moved
    places = conventions()["markers"].places
    random = np.random.default_rng(4)
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["LABELS"]["value"], point["UNITS"]["value"] = [RATE], MARKERS, ["mm"]
    data = np.ones((4, len(MARKERS), COUNT))
    for k, name in enumerate(MARKERS):
        place = places[plain(name)]
        bone = BONES.index(place.bone)
        at = place.at * 1.75 + random.uniform(-0.02, 0.02, 3) / np.sqrt(3)
        data[:3, k] = 1e3 * (p[:, bone] + R[:, bone] @ at).T
    file["data"]["points"] = data
    file.write(str(folder / "r.c3d"))
    return "c3d", folder / "r.c3d"


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
