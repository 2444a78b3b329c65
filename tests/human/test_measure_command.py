"""``seerob measure`` prints a table that the workstation file understands."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from made_capture import PERSON, walking

from seerob.app.cli import main
from seerob.app.commands.probe import options_of
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.files.tables.mapping import toml_value
from seerob.session.reading import convert_workstation

NAMES = {
    "Hips": "pelvis", "Chest": "lumbar", "Chest2": "thorax", "Neck": "neck", "Head": "head",
    **{
        f"{side.title()}{joint}": f"{side}_{bone}"
        for side in ("left", "right")
        for joint, bone in {
            "Collar": "clavicle", "Shoulder": "upper_arm", "Elbow": "forearm", "Wrist": "hand",
            "Hip": "thigh", "Knee": "shank", "Ankle": "foot", "Toe": "toes",
        }.items()
    },
}  # fmt: skip


JOINTS = ["--set", "convention=biovision"]


def written(file):
    """Joint centres of a walk as OpenSim's TRC, y up."""
    t, q = walking()
    p = bone_poses(PERSON, q)[1][:, [BONES.index(bone) for bone in NAMES.values()]]
    rows = np.stack([-p[..., 1], p[..., 2], -p[..., 0]], axis=-1).reshape(len(t), -1)
    head = [
        "PathFileType\t4\t(X/Y/Z)\twalk.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"60\t60\t{len(t)}\t{len(NAMES)}\tm\t60\t1\t{len(t)}",
        "Frame#\tTime\t" + "\t\t\t".join(NAMES),
        "\t\t" + "\t".join(f"X{k}\tY{k}\tZ{k}" for k in range(1, len(NAMES) + 1)),
        "",
    ]
    body = [
        f"{k + 1}\t{s:.6f}\t" + "\t".join(f"{x:.7f}" for x in row)
        for k, (s, row) in enumerate(zip(t, rows, strict=True))
    ]
    file.write_text("\n".join([*head, *body]) + "\n")


def test_a_recording_becomes_a_person_of_that_size(tmp_path, capsys):
    file = tmp_path / "walk.trc"
    written(file)
    who = ["--mass", "75", "--sex", "male", "--stature", "1.75"]
    # Joint centres among files of markers: nobody is taken for the other without a word.
    assert main(["measure", "trc", str(file), *who]) == 3
    assert 'give convention = "biovision"' in " ".join(capsys.readouterr().err.split())
    assert main(["measure", "trc", str(file), *who, *JOINTS]) == 0
    out = capsys.readouterr().out
    assert "measured: thigh" in out
    table = tomllib.loads(out[out.index("[[humans]]") :])
    thigh = float(np.linalg.norm(np.diff(bone_poses(PERSON, np.zeros(53))[1][[13, 14]], axis=0)))
    assert BONES[13:15] == ("right_thigh", "right_shank")
    assert table["humans"][0]["lengths"]["thigh"] == pytest.approx(thigh, abs=1e-3)
    made, problems = convert_workstation(table, "measured.toml")
    assert made is not None, problems


def test_what_reads_no_person_is_refused(tmp_path, capsys):
    assert main(["measure", "csv", str(tmp_path / "x.csv"), "--mass", "75", "--sex", "male"]) == 3
    assert "reads no recording of a person" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["capture", "measure"])
def test_options_that_are_wrong_are_all_named_with_the_command_and_what_there_is(tmp_path, capsys, command):
    file = tmp_path / "walk.trc"
    written(file)
    more = ["-o", str(tmp_path / "out")] if command == "capture" else []
    given = ["--set", 'file="x"', "--set", "human=anna", "--set", "latncy=1"]
    assert main([command, "trc", str(file), "--mass", "75", "--sex", "male", *more, *given]) == 3
    told = " ".join(capsys.readouterr().err.split())
    assert f"seerob {command} trc: --set file: is an argument of the command itself" in told
    assert "--set human: is an argument of the command itself; --name" in told
    assert "did you mean 'latency'?" in told
    assert not (tmp_path / "out").exists()


def test_any_name_and_any_word_become_toml(tmp_path, capsys):
    file, name = tmp_path / "walk.trc", 'a "b" \\ c]'
    written(file)
    who = ["--mass", "75", "--sex", "male", "--stature", "1.75", "--name", name]
    assert main(["measure", "trc", str(file), *who, *JOINTS]) == 0
    out = capsys.readouterr().out
    assert tomllib.loads(out[out.index("[[humans]]") :])["humans"][0]["name"] == name
    assert options_of(["a=m", "b=1\nc = 2", 'd={ x = "y" }']) == {"a": "m", "b": "1\nc = 2", "d": {"x": "y"}}
    given = {"a": 'x"\n', "b": [1, 2.5, True], "c": {"k e y": {"x": -1e-9}}}
    text = "\n".join(f"{key} = {toml_value(value)}" for key, value in given.items())
    assert tomllib.loads(text) == given


def test_markers_need_the_stature_and_it_is_said(tmp_path, capsys):
    file = tmp_path / "markers.trc"
    written(file)
    text = file.read_text()
    for ours, marker in (("LeftWrist", "LWRA"), ("RightWrist", "RWRA"), ("Chest2", "T10"), ("Head", "C7")):
        text = text.replace(ours, marker)
    kept = {"LWRA", "RWRA", "T10", "C7"}
    for name in NAMES:
        text = text if name in kept else text.replace(f"\t{name}\t", f"\tX{name}X\t")
    file.write_text(text)
    out = tmp_path / "out"
    assert main(["capture", "trc", str(file), "--mass", "75", "--sex", "male", "-o", str(out)]) == 3
    assert "give --stature" in " ".join(capsys.readouterr().err.split())
    assert not out.exists()
